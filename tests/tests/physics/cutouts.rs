//! Alpha: holes where the texels say so, shares of light where surfaces blend, for every kind of ray.

use crate::emitters::lambert;
use crate::{Measured, measure, measure_with};
use core::f64::consts::PI;
use hotspot_scene::{
    Alpha, Bsdf, Camera, Channel, Color, LightKind, Material, Projection, Scalar, TextureRef,
};
use hotspot_tests::picture::{picture, settings};
use hotspot_tests::world::{
    Random, V3, World, bilinear, camera, cuboid, dot, image, light, matte, mirror, nearest, panel, pencil,
    rectangle, rectangle_corners, unit,
};

const N: usize = 8;

/// Alphas of an image with neither symmetry nor pattern.
fn alphas(seed: u64, of: impl Fn(f64) -> u8) -> [[u8; N]; N] {
    let mut random = Random(seed);
    [[0; N]; N].map(|row| row.map(|_| of(random.unit())))
}

fn holes(seed: u64) -> [[u8; N]; N] {
    alphas(seed, |r| if r < 0.5 { 255 } else { 0 })
}

fn with_image(world: World, alphas: &[[u8; N]; N]) -> World {
    world.with_texture(image(N as u32, N as u32, |x, y| [9, 200, 80, alphas[y as usize][x as usize]]))
}

fn scalar(at: TextureRef) -> Scalar {
    Scalar { factor: 1.0, texture: Some((at, Channel::A)) }
}

fn masked(material: Material, cutoff: f32, alpha: Scalar) -> Material {
    Material { alpha: Alpha::Mask { cutoff, alpha }, ..material }
}

fn blended(material: Material, alpha: Scalar) -> Material {
    Material { alpha: Alpha::Blend { alpha }, ..material }
}

/// A camera that sees the unit panel of [`upright`] and nothing else.
fn facing() -> Camera {
    camera([0.0, 0.0, 5.0], [0.0; 3], Projection::Orthographic { xmag: 1.0, ymag: 1.0 })
}

/// Fills the square −1..1 in x and y.
fn upright(z: f64) -> hotspot_scene::Mesh {
    panel([0.0, 0.0, z], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
}

const BLACK: [f32; 3] = [0.0; 3];
const WHITE: [f32; 3] = [1.0; 3];

/// Nearest texels: each pixel lies within one texel, so it is wholly there or wholly not.
#[test]
fn a_mask_shows_its_texels() {
    for seed in 0..3 {
        let alphas = holes(seed);
        let world = with_image(World::new(), &alphas)
            .with(upright(0.0), masked(matte(BLACK), 0.5, scalar(nearest(0))))
            .with_environment(WHITE)
            .prepare();
        let edge = 32;
        for depth in [0, 1, 4] {
            let picture = picture(&world, &facing(), &settings(edge, edge, 4, depth, seed));
            for (i, p) in picture.pixels.iter().enumerate() {
                let (x, y) = (i % 32 * N / 32, i / 32 * N / 32);
                let seen = if alphas[y][x] == 0 { 1.0 } else { 0.0 };
                assert_eq!(*p, [seen; 3], "seed {seed}, depth {depth}, pixel {i}");
            }
        }
    }
}

/// What an image holds at (u, v) in f64, repeating, texel centres at (i + ½)/n.
fn between(alphas: &[[u8; N]; N], u: f64, v: f64) -> f64 {
    let (x, y) = (u * N as f64 - 0.5, v * N as f64 - 0.5);
    let (fx, fy) = (x - x.floor(), y - y.floor());
    let at = |dx: i64, dy: i64| {
        let wrap = |i: f64, d: i64| (i.floor() as i64 + d).rem_euclid(N as i64) as usize;
        f64::from(alphas[wrap(y, dy)][wrap(x, dx)]) / 255.0
    };
    (at(0, 0) * (1.0 - fx) + at(1, 0) * fx) * (1.0 - fy) + (at(0, 1) * (1.0 - fx) + at(1, 1) * fx) * fy
}

/// Between texels, against quadrature: pixel by pixel (4σ of independent samples, which Sobol points undercut; 6e-5
/// each of 1024), and exact where a pixel is all there or all hole. Through a factor, too.
#[test]
fn a_mask_between_texels() {
    let alphas = alphas(5, |r| (r * 255.99) as u8);
    let edge = 32usize;
    for (factor, cutoff) in [(1.0, 0.5), (0.8, 0.3)] {
        let alpha = Scalar { factor, ..scalar(bilinear(0)) };
        let world = with_image(World::new(), &alphas)
            .with(upright(0.0), masked(matte(BLACK), cutoff, alpha))
            .with_environment(WHITE)
            .prepare();
        let spp = 64;
        let picture = picture(&world, &facing(), &settings(edge as u32, edge as u32, spp, 1, 3));
        let (mut mean, mut variance, mut partial) = (0.0, 0.0, 0);
        for (i, p) in picture.pixels.iter().enumerate() {
            let fine = 32;
            let mut open = 0;
            for s in 0..fine * fine {
                let at = |i: usize, s: usize| (i as f64 + (s as f64 + 0.5) / fine as f64) / edge as f64;
                let a = between(&alphas, at(i % edge, s % fine), at(i / edge, s / fine));
                open += usize::from(a * f64::from(factor) < f64::from(cutoff));
            }
            let share = open as f64 / (fine * fine) as f64;
            partial += usize::from(open > 0 && open < fine * fine);
            // The quadrature misses slivers smaller than its cells.
            let sigma = (share * (1.0 - share) / f64::from(spp)).sqrt() + 1.0 / (fine * fine) as f64;
            assert!((p[0] - share).abs() <= 4.0 * sigma, "pixel {i}: {} for {share}", p[0]);
            mean += (p[0] - share) / (edge * edge) as f64;
            variance += share * (1.0 - share) / f64::from(spp) / (edge * edge).pow(2) as f64;
        }
        assert!(partial > 100, "{partial} pixels decide nothing");
        assert!(mean.abs() < 4.0 * variance.sqrt(), "{mean} off in the mean");
    }
}

/// Alpha at the cutoff is there; a cutoff of 0 leaves everything, one above 1 nothing. A vertex colour's alpha multiplies,
/// also where it is 1 and the cutoff too.
#[test]
fn cutoffs_at_their_edges() {
    let above = |v: f32| f32::from_bits(v.to_bits() + 1);
    let texel = 128.0 * (1.0 / 255.0f32);
    let image_of = |a: u8| image(1, 1, |_, _| [255, 255, 255, a]);
    for (texel_alpha, factor, vertex, cutoff, there) in [
        (None, 0.5, None, 0.5, true),
        (None, 0.5, None, above(0.5), false),
        (None, 0.0, None, 0.0, true),
        (None, 0.0, None, f32::from_bits(1), false),
        (None, 1.0, None, 1.0, true),
        (None, 1.0, None, above(1.0), false),
        (None, 1.0, None, f32::INFINITY, false),
        (None, 1.0, None, -1.0, true),
        (Some(128), 1.0, None, texel, true),
        (Some(128), 1.0, None, above(texel), false),
        (Some(255), 1.0, None, 1.0, true),
        (Some(0), 1.0, None, 0.0, true),
        (None, 1.0, Some(1.0), 1.0, true),
        (Some(255), 1.0, Some(1.0), 1.0, true),
        (None, 1.0, Some(0.25), 0.25, true),
        (None, 0.5, Some(0.5), 0.25, true),
        (None, 0.5, Some(0.5), above(0.25), false),
        (None, 1.0, Some(0.5), 0.75, false),
        (Some(255), 1.0, Some(0.5), 0.75, false),
    ] {
        // Between texels of 128/255, interpolation rounds: only 0 and 1 are exact.
        for smooth in if texel_alpha == Some(128) { &[false][..] } else { &[false, true] } {
            let smooth = *smooth;
            let at = if smooth { bilinear(0) } else { nearest(0) };
            let alpha = Scalar { factor, texture: texel_alpha.map(|_| (at, Channel::A)) };
            let mut mesh = upright(0.0);
            mesh.colors = vertex.map(|a| vec![[1.0, 1.0, 1.0, a]; 4]);
            let world = World::new()
                .with_texture(image_of(texel_alpha.unwrap_or(7)))
                .with(mesh, masked(matte(BLACK), cutoff, alpha))
                .with_environment(WHITE);
            let seen = picture(&world.prepare(), &facing(), &settings(24, 24, 16, 1, 0));
            let expected = if there { 0.0 } else { 1.0 };
            let what = format!("texel {texel_alpha:?}, factor {factor}, vertex {vertex:?}, cutoff {cutoff}");
            assert_eq!((seen.min(), seen.max()), (expected, expected), "{what}, smooth {smooth}");
        }
    }
}

/// A vertex colour's alpha changes over a triangle: under a mask the border is where its interpolation says.
#[test]
fn masks_follow_vertex_alpha() {
    // Alpha grows from 0 at the left to 1 at the right; the cutoff is at three quarters.
    let mut mesh = upright(0.0);
    mesh.colors = Some([0.0, 1.0, 1.0, 0.0].map(|a| [1.0, 1.0, 1.0, a]).to_vec());
    let world =
        World::new().with(mesh, masked(matte(BLACK), 0.75, Scalar::constant(1.0))).with_environment(WHITE);
    let seen = picture(&world.prepare(), &facing(), &settings(32, 32, 4, 1, 0));
    for (i, p) in seen.pixels.iter().enumerate() {
        assert_eq!(p[0], if i % 32 < 24 { 1.0 } else { 0.0 }, "pixel {i}");
    }
}

fn floor() -> hotspot_scene::Mesh {
    rectangle([0.0; 3], [0.0, 0.0, 40.0], [40.0, 0.0, 0.0])
}

/// A roof at height 1 over −1..1 in x and z: u runs along x, v along z.
fn roof() -> hotspot_scene::Mesh {
    panel([0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0])
}

/// A grazing view of a point of the floor, below the roof.
fn view(p: V3) -> Camera {
    pencil([p[0] + 3.9, 0.15, p[2] + 0.2], p)
}

/// Sunlight through holes: each point of the floor is lit or dark as the texel above it says.
#[test]
fn sunlight_falls_through_holes() {
    let alphas = holes(11);
    let direction = unit([0.3, -1.0, 0.2]);
    let world = with_image(World::new(), &alphas)
        .with(floor(), matte([0.5; 3]))
        .with(roof(), masked(matte(BLACK), 0.5, scalar(nearest(0))))
        .with_light(LightKind::Directional { direction: direction.map(|c| c as f32) }, [2.0; 3])
        .prepare();
    let lit = 0.5 / PI * 2.0 * -direction[1];
    let mut random = Random(12);
    let mut counts = [0; 2];
    for _ in 0..200 {
        let on_roof = [random.within(-1.0, 1.0), 1.0, random.within(-1.0, 1.0)];
        let texel = [0, 2].map(|i| (on_roof[i] + 1.0) / 2.0 * N as f64);
        if texel.iter().any(|t| (t - t.round()).abs() < 1e-4) {
            continue;
        }
        let open = alphas[texel[1] as usize][texel[0] as usize] == 0;
        let p = [0, 1, 2].map(|i| on_roof[i] - direction[i] / direction[1]);
        let seen = picture(&world, &view(p), &settings(1, 1, 2, 1, 0)).mean()[0];
        let expected = if open { lit } else { 0.0 };
        assert!((seen - expected).abs() < 3e-5, "{p:?}: {seen} for {expected}");
        counts[usize::from(open)] += 1;
    }
    assert!(counts[0] > 50 && counts[1] > 50);
}

/// Light of a lamp through a masked roof, against quadrature over the lamp: by light sampling above all. Under a sky, by
/// both techniques.
#[test]
fn lamps_shine_through_holes() {
    let alphas = holes(13);
    let there = |x: f64, z: f64| {
        let texel = |c: f64| ((c + 1.0) / 2.0 * N as f64).floor();
        let (i, j) = (texel(x), texel(z));
        (0.0..N as f64).contains(&i) && (0.0..N as f64).contains(&j) && alphas[j as usize][i as usize] == 255
    };
    let base = with_image(World::new(), &alphas)
        .with(floor(), matte([0.5; 3]))
        .with(roof(), masked(matte(BLACK), 0.5, scalar(nearest(0))));
    // A square lamp of half edge h at height 2 over (cx, cz), facing down.
    for (cx, cz, h) in [(0.1, -0.2, 0.35), (-0.4, 0.3, 0.8)] {
        let n = 800;
        let mut e = 0.0;
        for i in 0..n * n {
            let mid = |i: i32| h * (2.0 * (f64::from(i) + 0.5) / f64::from(n) - 1.0);
            let (x, z) = (cx + mid(i % n), cz + mid(i / n));
            if !there(0.5 * x, 0.5 * z) {
                let d2 = x * x + z * z + 4.0;
                e += 4.0 / (d2 * d2) * (2.0 * h / f64::from(n)).powi(2);
            }
        }
        let lamp = rectangle([cx, 2.0, cz], [h, 0.0, 0.0], [0.0, 0.0, h]);
        let world = base.clone().with(lamp, light([4.0; 3]));
        let what = format!("lamp of {h}");
        measure(&world.prepare(), &view([0.0; 3]), 1, 256).assert_grey(4.0 * 0.5 / PI * e, 0.01, &what);
    }
    // ∫ V cos dω / π over the hemisphere: points of the plane at height 1 see 1/(1 + r²)² dA.
    let n = 2048;
    let mut blocked = 0.0;
    for i in 0..n * n {
        let mid = |i: i32| 2.0 * (f64::from(i) + 0.5) / f64::from(n) - 1.0;
        let (x, z) = (mid(i % n), mid(i / n));
        if there(x, z) {
            blocked += (2.0 / f64::from(n)).powi(2) / (1.0 + x * x + z * z).powi(2);
        }
    }
    let world = base.with_environment([3.0; 3]);
    let expected = 3.0 * 0.5 * (1.0 - blocked / PI);
    measure(&world.prepare(), &view([0.0; 3]), 1, 256).assert_grey(expected, 0.01, "sky");
}

/// A masked lamp lights as one that is cut to shape: Lambert's formula over the texels that are there. Its mirror image
/// (BSDF sampling alone) shows the same shape.
#[test]
fn masked_lamps_are_cut_to_shape() {
    let alphas = holes(17);
    let (center, h) = ([0.1, 1.5, -0.3], 0.6);
    // Facing down, u along x, v along −z: the image's upper edge at +z.
    let lamp = panel(center, [h, 0.0, 0.0], [0.0, 0.0, h]);
    let world = |floor_material: Material| {
        with_image(World::new(), &alphas)
            .with(floor(), floor_material)
            .with(lamp.clone(), masked(light([5.0, 4.0, 3.0]), 0.5, scalar(nearest(0))))
            .prepare()
    };
    let mut e = 0.0;
    for (j, row) in alphas.iter().enumerate() {
        for (i, _) in row.iter().enumerate().filter(|(_, a)| **a == 255) {
            let w = h / N as f64;
            let x = center[0] - h + w * (2 * i + 1) as f64;
            let z = center[2] + h - w * (2 * j + 1) as f64;
            let corners = rectangle_corners([x, center[1], z], [w, 0.0, 0.0], [0.0, 0.0, w]);
            e += lambert(corners, [0.0; 3], [0.0, 1.0, 0.0]);
        }
    }
    let expected = [5.0, 4.0, 3.0].map(|l| l * 0.5 / PI * e);
    for depth in [1, 3] {
        // The lamp is black, so that no further bounce brings anything.
        let measured = measure(&world(matte([0.5; 3])), &pencil([3.9, 0.35, 0.2], [0.0; 3]), depth, 256);
        measured.assert_near(expected, 0.01, &format!("depth {depth}"));
    }
    // Straight up by way of the mirror.
    let scene = world(mirror(WHITE));
    for (j, row) in alphas.iter().enumerate() {
        for (i, alpha) in row.iter().enumerate() {
            let w = h / N as f64;
            let x = center[0] - h + w * (2 * i + 1) as f64;
            let z = center[2] + h - w * (2 * j + 1) as f64;
            let from = [x + 1e-3, 1.0, z];
            let seen = picture(&scene, &pencil(from, [x, 0.0, z]), &settings(1, 1, 2, 1, 0)).mean();
            let expected = if *alpha == 255 { [5.0, 4.0, 3.0] } else { [0.0; 3] };
            assert_eq!(seen, expected, "texel {i}, {j}");
        }
    }
}

/// Through n blending quads, camera rays see (1 − a)^n of what is behind; no scattering event is counted.
#[test]
fn blending_quads_multiply() {
    for (a, n) in [(0.25f32, 1), (0.5, 2), (0.3, 3), (0.9, 1), (0.1, 8)] {
        let mut world = World::new().with_environment([2.0; 3]);
        for i in 0..n {
            world = world.with(upright(f64::from(i) * 0.1), blended(matte(BLACK), Scalar::constant(a)));
        }
        let expected = 2.0 * (1.0 - f64::from(a)).powi(n);
        for depth in [0, 1] {
            let measured = measure(&world.prepare(), &pencil([0.1, 0.2, 5.0], [0.1, 0.2, 0.0]), depth, 64);
            measured.assert_grey(expected, 0.02, &format!("{n} quads of {a}, depth {depth}"));
        }
    }
    // 0 and 1 are certain; beyond them, too.
    for (a, expected) in [(0.0f32, 1.0), (1.0, 0.0), (-3.0, 1.0), (7.0, 0.0), (f32::NAN, 1.0)] {
        let world = World::new()
            .with(upright(0.0), blended(matte(BLACK), Scalar::constant(a)))
            .with_environment(WHITE);
        let seen = picture(&world.prepare(), &facing(), &settings(16, 16, 8, 1, 0));
        assert_eq!((seen.min(), seen.max()), (expected, expected), "alpha {a}");
    }
}

/// The same for shadow rays towards a sun, with alphas from texels, factors and vertices; and two that overlap are
/// independent of each other and of the camera ray that passed one of them before.
#[test]
fn shadows_of_blending_quads_multiply() {
    // Away from the diagonal, where two triangles of a quad meet.
    const SPOT: V3 = [0.1, 0.0, 0.23];
    let texel = 102u8;
    let alphas = [[texel; N]; N];
    let at = f64::from(texel) / 255.0;
    let shadow = |y: f64, alpha: Scalar, vertex: f32| {
        let mut mesh = panel([0.0, y, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]);
        mesh.colors = Some(vec![[0.2, 0.3, 0.4, vertex]; 4]);
        (mesh, blended(matte(BLACK), alpha))
    };
    let sun = || LightKind::Directional { direction: [0.0, -1.0, 0.0] };
    let base =
        || with_image(World::new(), &alphas).with(floor(), matte([0.5; 3])).with_light(sun(), [2.0; 3]);
    let factor = |factor: f32| Scalar { factor, ..scalar(bilinear(0)) };
    let one = shadow(1.0, factor(1.0), 1.0);
    let two = shadow(1.2, factor(0.5), 0.5);
    let three = shadow(1.3, Scalar::constant(0.4), 1.0);
    let full = 0.5 / PI * 2.0;
    let (a, b, c) = (1.0 - at, 1.0 - 0.25 * at, 1.0 - f64::from(0.4f32));
    for (quads, expected) in
        [(vec![&one], a), (vec![&two], b), (vec![&one, &two], a * b), (vec![&one, &two, &three], a * b * c)]
    {
        let count = quads.len();
        let world = quads.into_iter().fold(base(), |w, (mesh, m)| w.with(mesh.clone(), m.clone()));
        let measured = measure(&world.prepare(), &view(SPOT), 1, 256);
        measured.assert_grey(full * expected, 0.01, &format!("{count} quads"));
    }
    // Camera ray and shadow ray pass the same quad: (1 − a)², and the quad itself is black.
    let world = base().with(one.0.clone(), one.1.clone());
    let measured = measure(&world.prepare(), &pencil([0.2, 4.0, 0.5], SPOT), 1, 256);
    measured.assert_grey(full * a * a, 0.01, "there and back");
    // Two quads that share a mesh stored once are independent as well.
    let (mesh, material) = one;
    let mut lift = hotspot_tests::world::IDENTITY;
    lift[1][3] = 0.5;
    let world = base()
        .with(mesh, material.clone())
        .with_again(material, lift)
        .prepare_with(hotspot_integrator::Instancing::Always);
    assert_eq!(world.instance_count(), 2);
    measure(&world, &view(SPOT), 1, 256).assert_grey(full * a * a, 0.01, "two instances");
}

/// Every direction from inside of a blending box passes one wall: by light and BSDF sampling together a floor gets 1 − a
/// of the sky; over several bounces of a white floor's own it gets no more.
#[test]
fn a_blending_box_dims_the_sky() {
    for a in [0.2f32, 0.7] {
        let box_around = cuboid([-1.0, -0.5, -1.2], [1.1, 1.0, 0.9], false);
        let world = World::new()
            .with(rectangle([0.0; 3], [0.0, 0.0, 0.5], [0.5, 0.0, 0.0]), matte([0.6, 0.8, 1.0]))
            .with(box_around, blended(matte(BLACK), Scalar::constant(a)))
            .with_environment([2.0; 3])
            .prepare();
        let open = 1.0 - f64::from(a);
        let expected = [0.6f32, 0.8, 1.0].map(|r| 2.0 * open * f64::from(r));
        for depth in [1, 3] {
            let measured = measure(&world, &pencil([0.4, 0.3, 0.2], [0.0; 3]), depth, 128);
            measured.assert_near(expected, 0.01, &format!("alpha {a}, depth {depth}"));
        }
    }
}

/// A blending lamp: a·L to the eye and in a mirror, over what is behind; a·L times the form factor on a floor, with alphas
/// that change over the lamp.
#[test]
fn blending_lamps_emit_their_share() {
    let a = 0.3f32;
    let share = f64::from(a);
    let lamp = || blended(light([5.0; 3]), Scalar::constant(a));
    let world = World::new().with(upright(0.0), lamp()).with_environment([1.0; 3]).prepare();
    let eye = pencil([0.1, 0.2, 5.0], [0.1, 0.2, 0.0]);
    for depth in [0, 1, 4] {
        measure(&world, &eye, depth, 64).assert_grey(5.0 * share + 1.0 - share, 0.01, "seen");
    }
    let behind = pencil([0.1, 0.2, -5.0], [0.1, 0.2, 0.0]);
    measure(&world, &behind, 0, 64).assert_grey(1.0 - share, 0.01, "from behind");

    let center = [0.1, 1.5, -0.3];
    let over = |m: Material, floor_material| {
        World::new().with(floor(), floor_material).with(panel(center, [0.6, 0.0, 0.0], [0.0, 0.0, 0.6]), m)
    };
    let up = pencil([0.2, 1.0, -0.3], [0.2 - 1e-4, 0.0, -0.3]);
    measure(&over(lamp(), mirror(WHITE)).prepare(), &up, 1, 64).assert_grey(5.0 * share, 0.01, "mirrored");

    let alphas = alphas(19, |r| (r * 255.99) as u8);
    let textured = blended(light([5.0; 3]), Scalar { factor: 0.9, ..scalar(bilinear(0)) });
    let mut mesh_colors = panel(center, [0.6, 0.0, 0.0], [0.0, 0.0, 0.6]);
    mesh_colors.colors = Some([0.2, 1.0, 0.6, 0.9].map(|a| [1.0, 1.0, 1.0, a]).to_vec());
    let n = 512;
    let mut e = 0.0;
    for k in 0..n * n {
        let mid = |i: i32| (f64::from(i) + 0.5) / f64::from(n);
        let (u, v) = (mid(k % n), mid(k / n));
        // (0, 1), (1, 1), (1, 0) and (0, 1), (1, 0), (0, 0) are the triangles in texture space.
        let b = 1.0 - v;
        let vertex = if u >= b { 0.2 + 0.8 * (u - b) + 0.4 * b } else { 0.2 + 0.4 * u + 0.7 * (b - u) };
        let p = [center[0] + 0.6 * (2.0 * u - 1.0), center[1], center[2] + 0.6 * (1.0 - 2.0 * v)];
        let d2 = dot(p, p);
        let weight = 0.9 * between(&alphas, u, v) * vertex;
        e += weight * p[1] * p[1] / (d2 * d2) * (1.2 / f64::from(n)).powi(2);
    }
    let world = with_image(World::new(), &alphas)
        .with(floor(), matte([0.5; 3]))
        .with(mesh_colors, textured)
        .prepare();
    let view = pencil([3.9, 0.35, 0.2], [0.0; 3]);
    measure(&world, &view, 1, 256).assert_grey(5.0 * 0.5 / PI * e, 0.01, "on a floor");
}

/// What is there of a blending surface scatters as it would alone: a·ρ + (1 − a) in a uniform sky, also when the surface is
/// glass, whose own rays must not take it for a hole the second time.
#[test]
fn blending_surfaces_scatter_their_share() {
    let eye = pencil([0.4, 0.7, 5.0], [0.1, 0.2, 0.0]);
    let a = 0.4f32;
    for (bsdf, rho) in [
        (Bsdf::Matte { reflectance: Color::constant([0.3; 3]) }, f64::from(0.3f32)),
        (Bsdf::Mirror { reflectance: Color::constant([0.6; 3]) }, f64::from(0.6f32)),
    ] {
        let material = blended(hotspot_tests::world::surface(bsdf), Scalar::constant(a));
        let world = World::new().with(upright(0.0), material).with_environment(WHITE).prepare();
        let a = f64::from(a);
        measure(&world, &eye, 2, 64).assert_grey(a * rho + 1.0 - a, 0.01, "share");
    }
}

/// Samples of a pixel, pixels, seeds and rays decide each for themselves: what n·spp independent trials would give, their
/// variance included (within 4σ of a χ² of 575 degrees; Sobol points have no part in it).
#[test]
fn blending_is_decided_afresh() {
    let world = World::new()
        .with(upright(0.0), blended(matte(BLACK), Scalar::constant(0.5)))
        .with(upright(-1.0), blended(matte(BLACK), Scalar::constant(0.5)))
        .with_environment(WHITE)
        .prepare();
    let spp = 64;
    let run = |seed| -> Measured {
        measure_with(&world, &pencil([0.1, 0.2, 5.0], [0.1, 0.2, 0.0]), &settings(24, 24, spp, 0, seed))
    };
    let mut means = Vec::new();
    for seed in [1, 2, 3, 1 << 40] {
        let (mean, sigma) = run(seed).0[0];
        let expected = (0.25 * 0.75 / f64::from(spp) / 576.0f64).sqrt();
        assert!((sigma / expected - 1.0).abs() < 4.0 / (2.0 * 575.0f64).sqrt(), "{sigma} for {expected}");
        assert!((mean - 0.25).abs() < 4.0 * expected);
        means.push(mean);
    }
    means.dedup();
    assert_eq!(means.len(), 4, "seeds do not matter");
}
