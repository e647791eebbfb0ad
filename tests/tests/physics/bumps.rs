//! Normal maps: which way a texel turns the normal, seen without noise under a sun.

use core::f64::consts::PI;
use hotspot_integrator::Instancing;
use hotspot_scene::{LightKind, Material, Mesh, NormalMap};
use hotspot_tests::picture::{picture, settings};
use hotspot_tests::world::{
    IDENTITY, Random, V3, World, add_scaled, bilinear, cross, dot, image, matte, nearest, panel, pencil,
    pinhole, sphere, unit,
};

type Matrix = [[f64; 4]; 3];

/// The unit panel in z = 0, facing +z, with normals and with these tangents in its plane.
fn plate(tangent: V3, w: f32) -> Mesh {
    let t = tangent.map(|c| c as f32);
    Mesh {
        normals: Some(vec![[0.0, 0.0, 1.0]; 4]),
        tangents: Some(vec![[t[0], t[1], t[2], w]; 4]),
        ..panel([0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    }
}

const RIGHT: V3 = [1.0, 0.0, 0.0];

fn bumpy(scale: f32) -> Material {
    Material { normal_map: Some(NormalMap { texture: nearest(0), scale }), ..matte([0.5; 3]) }
}

/// What a texel encodes: −1..1, x and y scaled (glTF 2.0, 3.9.3).
fn decoded(texel: [u8; 3], scale: f32) -> V3 {
    let n = texel.map(|c| f64::from(c) / 127.5 - 1.0);
    unit([n[0] * f64::from(scale), n[1] * f64::from(scale), n[2]])
}

/// In the frame of tangent, bitangent w (n × t) and normal, in f64.
fn turned(n: V3, normal: V3, tangent: V3, w: f64) -> V3 {
    let bitangent = cross(normal, tangent).map(|c| c * w);
    unit(add_scaled(add_scaled(normal.map(|c| c * n[2]), n[0], tangent), n[1], bitangent))
}

/// Radiance 0.5/π · 2 · cos of a sun that shines along `direction`, seen by `eye`: the same for every sample.
fn seen(world: &World, instancing: Instancing, from: V3, to: V3, direction: V3) -> f64 {
    let kind = LightKind::Directional { direction: direction.map(|c| c as f32) };
    let scene = world.clone().with_light(kind, [2.0; 3]).prepare_with(instancing);
    let picture = picture(&scene, &pencil(from, to), &settings(2, 2, 2, 1, 0));
    assert_eq!(picture.min(), picture.max());
    picture.min()
}

fn lambert(normal: V3, direction: V3) -> f64 {
    (-dot(normal, direction)).max(0.0) / PI
}

fn texel(rgb: [u8; 3]) -> hotspot_scene::Texture {
    image(1, 1, |_, _| [rgb[0], rgb[1], rgb[2], 255])
}

/// By hand: red turns the normal to the right of the image, green to its upper edge (against v), for w = 1 of these
/// uvs; what is right goes left for the back side's light, which sees the surface from behind.
#[test]
fn red_is_right_and_green_is_up() {
    let straight = [0.0, 0.0, -1.0];
    for (rgb, n) in [([255, 128, 128], [1.0, 0.004, 0.004]), ([128, 255, 128], [0.004, 1.0, 0.004])] {
        let world = World::new().with_texture(texel(rgb)).with(plate(RIGHT, 1.0), bumpy(1.0));
        // A low sun on the side that the normal turns to, and on the other.
        let low = unit([-n[0], -n[1], -0.5]);
        let other = unit([n[0], n[1], -0.5]);
        let from = add_scaled([0.3, -0.2, 0.0], 3.0, unit([n[0], n[1], 0.6]));
        let at = |d| seen(&world, Instancing::Never, from, [0.3, -0.2, 0.0], d);
        assert!(at(low) > 0.85 / PI && at(other) == 0.0 && at(straight) < 0.01, "{rgb:?}");
    }
}

/// Any texel, tangent, handedness and scale, seen from the front and from behind.
#[test]
fn texels_turn_normals_by_what_they_say() {
    let mut random = Random(1);
    let mut lit = 0;
    for i in 0..300 {
        let byte = |random: &mut Random, low: f64| random.within(low, 256.0) as u8;
        // (128, 128, 255) is not quite flat: 1/255 each way.
        let rgb = match i {
            0 => [128, 128, 255],
            1 => [127, 127, 255],
            _ => [byte(&mut random, 0.0), byte(&mut random, 0.0), byte(&mut random, 140.0)],
        };
        let angle = random.within(0.0, 2.0 * PI);
        let tangent = [angle.cos(), angle.sin(), 0.0];
        let w = if i % 2 == 0 { 1.0 } else { -1.0 };
        let scale = [1.0, 0.3, -1.0, 2.0][i % 4];
        let normal = turned(decoded(rgb, scale), [0.0, 0.0, 1.0], tangent, w);
        // Behind, the same bump is a dent: the whole normal turns over.
        let side = if i % 3 == 0 { -1.0 } else { 1.0 };
        let normal = normal.map(|c| c * side);
        let world = World::new().with_texture(texel(rgb)).with(plate(tangent, w as f32), bumpy(scale));
        let p = [random.within(-0.8, 0.8), random.within(-0.8, 0.8), 0.0];
        let wo = unit([random.within(-0.5, 0.5), random.within(-0.5, 0.5), side]);
        let sun = unit([random.within(-1.0, 1.0), random.within(-1.0, 1.0), -side]);
        if dot(wo, normal) < 2e-3 {
            continue;
        }
        let radiance = seen(&world, Instancing::Auto, add_scaled(p, 3.0, wo), p, sun);
        let expected = lambert(normal, sun);
        assert!((radiance - expected).abs() < 2e-6, "{i}, {rgb:?}: {radiance} for {expected}");
        lit += u32::from(expected > 0.01);
    }
    assert!(lit > 150, "{lit}");
}

/// A texel without length, or one that points straight down, gives the smooth normal or the horizon, and no NaN.
#[test]
fn texels_without_direction() {
    // Between 127 and 128 lies 0 exactly.
    let between = NormalMap { texture: bilinear(0), scale: 1.0 };
    let halves = image(2, 1, |x, _| if x == 0 { [127, 127, 127, 255] } else { [128, 128, 128, 255] });
    let material = Material { normal_map: Some(between), ..matte([0.5; 3]) };
    let world = World::new().with_texture(halves).with(plate(RIGHT, 1.0), material);
    let sun = unit([0.3, 0.2, -1.0]);
    let p = [0.0, 0.25, 0.0];
    let radiance = seen(&world, Instancing::Auto, [0.5, 0.5, 3.0], p, sun);
    assert!(radiance.is_finite() && radiance <= 1.001 / PI, "{radiance}");
    for scale in [1.0, 0.0, -1.0, 1e30, f32::INFINITY, f32::NAN] {
        for rgb in [[0; 3], [127; 3], [128; 3], [128, 128, 0], [0, 128, 128], [255; 3]] {
            let world = World::new()
                .with_texture(texel(rgb))
                .with(plate(RIGHT, 1.0), bumpy(scale))
                .with_environment([1.0; 3]);
            for camera in [
                pinhole([0.3, 0.4, 2.0], [0.0; 3], 50.0),
                pinhole([2.0, 0.4, 1e-4], [0.0; 3], 20.0),
                pencil([1.0, 0.0, 1e-3], [0.0; 3]),
            ] {
                let seen = picture(&world.prepare(), &camera, &settings(8, 8, 8, 3, 0));
                assert!(seen.max() <= 1.0 + 1e-4 && seen.min() >= 0.0, "{rgb:?}, scale {scale}");
            }
        }
    }
}

/// A normal that a map turns away from the eye is tilted back to where the path arrives just above the horizon: among
/// eye, mapped normal, in one plane.
#[test]
fn bumps_do_not_vanish_behind_themselves() {
    let rgb = [255, 128, 140];
    let world = World::new().with_texture(texel(rgb)).with(plate(RIGHT, 1.0), bumpy(1.0));
    let wo = unit([-0.9, 0.1, 0.3]);
    let mapped = turned(decoded(rgb, 1.0), [0.0, 0.0, 1.0], RIGHT, 1.0);
    assert!(dot(wo, mapped) < -0.5);
    let normal = unit(add_scaled(mapped, 1e-3 - dot(wo, mapped), wo));
    let p = [0.1, 0.2, 0.0];
    for sun in [unit([-0.3, 0.2, -1.0]), unit([0.5, 0.0, -0.5])] {
        let radiance = seen(&world, Instancing::Auto, add_scaled(p, 3.0, wo), p, sun);
        let expected = lambert(normal, sun);
        assert!((radiance - expected).abs() < 1e-5, "{radiance} for {expected}");
    }
}

/// The transposed inverse of the linear part, applied.
fn normal_to_world(m: &Matrix, n: V3) -> V3 {
    let row = |i: usize| [m[i][0], m[i][1], m[i][2]];
    let (a, b, c) = (row(0), row(1), row(2));
    let determinant = dot(a, cross(b, c));
    let rows = [cross(b, c), cross(c, a), cross(a, b)];
    unit(rows.map(|r| dot(r, n) / determinant))
}

fn linear(m: &Matrix, v: V3) -> V3 {
    m.map(|r| r[0] * v[0] + r[1] * v[1] + r[2] * v[2])
}

fn determinant(m: &Matrix) -> f64 {
    let row = |i: usize| [m[i][0], m[i][1], m[i][2]];
    dot(row(0), cross(row(1), row(2)))
}

/// Mirrored, sheared, stretched, shrunk to a thousandth and blown up a thousandfold; written out in the world and
/// stored once: each as computed in f64.
#[test]
fn placing_turns_bumps_along() {
    let mut random = Random(2);
    let mut tested = 0;
    for i in 0..120 {
        let mut m = IDENTITY;
        let size = [1.0, 1e-3, 1e3][i % 3];
        for row in &mut m {
            for c in &mut row[..3] {
                *c = size * random.within(-1.0, 1.0);
            }
        }
        if i % 4 == 0 {
            // A mirror and nothing else: what the mirror does to the mapped normal.
            m = IDENTITY;
            m[i / 4 % 3][i / 4 % 3] = -1.0;
        }
        let d = determinant(&m) / (if i % 4 == 0 { 1.0 } else { size * size * size });
        if d.abs() < 0.1 {
            continue;
        }
        let angle = random.within(0.0, 2.0 * PI);
        let tangent = [angle.cos(), angle.sin(), 0.0];
        let w = if i % 2 == 0 { 1.0 } else { -1.0 };
        let rgb = [0; 3].map(|_| random.within(60.0, 200.0) as u8);
        let rgb = [rgb[0], rgb[1], 255];
        let smooth = normal_to_world(&m, [0.0, 0.0, 1.0]);
        let there = unit(linear(&m, tangent));
        let normal = turned(decoded(rgb, 1.0), smooth, there, w * d.signum());
        if i % 4 == 0 {
            let object = turned(decoded(rgb, 1.0), [0.0, 0.0, 1.0], tangent, w);
            let mirrored = linear(&m, object);
            assert!(dot(mirrored, normal) > 1.0 - 1e-12);
        }
        let p = linear(&m, [0.3, -0.4, 0.0]);
        let size = dot(p, p).sqrt();
        let wo = unit(add_scaled(smooth, 0.3, random.point(-1.0, 1.0)));
        let sun = unit(add_scaled(smooth.map(|c| -c), 0.7, random.point(-1.0, 1.0)));
        if dot(wo, normal) < 0.01 || dot(wo, smooth) < 0.1 || dot(sun, smooth) > -0.05 {
            continue;
        }
        let mut away = m;
        away[0][3] = 100.0 * size;
        let world = World::new()
            .with_texture(texel(rgb))
            .with_placed(plate(tangent, w as f32), bumpy(1.0), m)
            .with_again(matte([0.2; 3]), away);
        for instancing in [Instancing::Never, Instancing::Always] {
            let radiance = seen(&world, instancing, add_scaled(p, 3.0 * size, wo), p, sun);
            let expected = lambert(normal, sun);
            let what = format!("{i}, {instancing:?}, determinant {d}");
            assert!((radiance - expected).abs() < 2e-5, "{what}: {radiance} for {expected}");
            tested += 1;
        }
    }
    assert!(tested > 80, "{tested}");
}

/// The same mesh under a material with bumps and one without: each its own, whichever comes first.
#[test]
fn bumps_belong_to_the_material() {
    let mut away = IDENTITY;
    away[0][3] = 10.0;
    let rgb = [230, 128, 200];
    let bump = turned(decoded(rgb, 1.0), [0.0, 0.0, 1.0], RIGHT, 1.0);
    let sun = unit([-0.4, 0.1, -1.0]);
    for bumpy_first in [true, false] {
        let materials = [bumpy(1.0), matte([0.5; 3])];
        let [first, second] =
            if bumpy_first { materials } else { [materials[1].clone(), materials[0].clone()] };
        let world =
            World::new().with_texture(texel(rgb)).with(plate(RIGHT, 1.0), first).with_again(second, away);
        for instancing in [Instancing::Never, Instancing::Always] {
            for (x, has) in [(0.0, bumpy_first), (10.0, !bumpy_first)] {
                let p = [x + 0.2, 0.4, 0.0];
                let radiance = seen(&world, instancing, [x + 0.3, 0.5, 3.0], p, sun);
                let expected = lambert(if has { bump } else { [0.0, 0.0, 1.0] }, sun);
                assert!((radiance - expected).abs() < 2e-6, "{x}, {instancing:?}: {radiance}");
            }
        }
    }
}

/// Rotated texture coordinates alone turn what is read, not the frame: which texel is shown follows uvs, its direction
/// the tangents.
#[test]
fn frames_come_from_tangents_not_from_uvs() {
    let mut mesh = plate(RIGHT, 1.0);
    // A quarter turn: the image's upper edge at the left.
    mesh.uvs = Some(vec![[1.0, 1.0], [1.0, 0.0], [0.0, 0.0], [0.0, 1.0]]);
    let halves = image(1, 2, |_, y| if y == 0 { [220, 128, 180, 255] } else { [128, 40, 180, 255] });
    let world = World::new().with_texture(halves).with(mesh, bumpy(1.0));
    let sun = unit([-0.4, 0.3, -1.0]);
    // (x, y) has u = (1 − y)/2 and v = (1 − x)/2.
    for (p, rgb) in [([0.5, 0.3, 0.0], [220, 128, 180]), ([-0.5, 0.3, 0.0], [128, 40, 180])] {
        let radiance = seen(&world, Instancing::Auto, [0.1, 0.2, 3.0], p, sun);
        let expected = lambert(turned(decoded(rgb, 1.0), [0.0, 0.0, 1.0], RIGHT, 1.0), sun);
        assert!((radiance - expected).abs() < 2e-6, "{p:?}: {radiance} for {expected}");
    }
}

/// A white ball under wild bumps in a uniform sky never shows more than the sky.
#[test]
fn bumps_make_no_energy() {
    let mut random = Random(5);
    let wild = image(16, 16, |_, _| [0; 4].map(|_| random.within(0.0, 256.0) as u8));
    let mut ball = sphere([0.0; 3], 1.0, 3, false);
    ball.normals = Some(ball.positions.clone());
    ball.uvs = Some(ball.positions.iter().map(|p| [p[0] + 2.0 * p[2], p[1] - p[2]]).collect());
    let tangents = ball.positions.iter().map(|p| {
        let t = cross([0.0, 1.0, 0.01], p.map(f64::from));
        let t = unit(t).map(|c| c as f32);
        [t[0], t[1], t[2], 1.0]
    });
    ball.tangents = Some(tangents.collect());
    for texture in [nearest(0), bilinear(0)] {
        let map = NormalMap { texture, scale: 1.0 };
        let material = Material { normal_map: Some(map), ..matte([1.0; 3]) };
        let world =
            World::new().with_texture(wild.clone()).with(ball.clone(), material).with_environment([1.0; 3]);
        let seen = picture(
            &world.prepare(),
            &pinhole([1.0, 2.0, 3.0], [0.0; 3], 40.0),
            &settings(32, 32, 64, 32, 1),
        );
        // Rays that a bump sends through the surface end inside, sooner or later: less, never more.
        assert!(seen.mean()[0] <= 1.01 && seen.mean()[0] > 0.8, "{:?}", seen.mean());
    }
}
