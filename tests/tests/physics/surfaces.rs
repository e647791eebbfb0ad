//! What varies over a surface: vertex colours, sets of texture coordinates, unlit surfaces, glass that absorbs, mixes.

use crate::emitters::lambert;
use crate::{measure, measure_with};
use core::f64::consts::PI;
use hotspot_integrator::Roulette;
use hotspot_scene::{Bsdf, Channel, Color, LightKind, Material, Mesh, Scalar, TextureRef};
use hotspot_tests::picture::{picture, settings};
use hotspot_tests::world::{
    Random, V3, World, bilinear, cuboid, emitting, image, light, linear, matte, mesh, metal, mirror, nearest,
    panel, pencil, rectangle, rectangle_corners, substrate, surface,
};

fn color(c: [f32; 3]) -> Color {
    Color::constant(c)
}

fn constant(factor: f32) -> Scalar {
    Scalar::constant(factor)
}

fn textured(factor: [f32; 3], texture: TextureRef) -> Color {
    Color { factor, texture: Some(texture) }
}

fn second(at: TextureRef) -> TextureRef {
    TextureRef { second_uvs: true, ..at }
}

fn wall() -> Mesh {
    panel([0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
}

/// Every sample alike; relative to the largest of what is expected.
fn assert_exact(world: &World, eye: (V3, V3), depth: u32, expected: V3, tolerance: f64, what: &str) {
    let seen = picture(&world.prepare(), &pencil(eye.0, eye.1), &settings(2, 2, 2, depth, 0));
    let scale = expected.iter().fold(0.0f64, |m, c| m.max(*c));
    for p in &seen.pixels {
        for c in 0..3 {
            assert!((p[c] - expected[c]).abs() <= tolerance * scale, "{what}: {p:?} for {expected:?}");
        }
    }
}

/// Vertex colours are linear over a triangle, and multiply factor and texture of the base colour of every model that has
/// one; the other colours stay as they are.
#[test]
fn vertex_colours_are_linear_and_multiply() {
    let corners = [[-1.0f32, -1.0, 0.0], [1.2, -0.8, 0.1], [0.1, 0.9, -0.2]];
    let tints: [[f32; 4]; 3] = [[1.0, 0.2, 0.0, 1.0], [0.1, 0.9, 0.5, 0.3], [0.3, 0.4, 1.0, 0.0]];
    let mut triangle = mesh(corners.to_vec(), vec![[0, 1, 2]]);
    triangle.colors = Some(tints.to_vec());
    triangle.uvs = Some(vec![[0.5, 0.5]; 3]);
    let texel = [200u8, 90, 240];
    let textured = Color { factor: [0.5, 1.0, 0.25], texture: Some(nearest(0)) };
    let base = [0, 1, 2].map(|c| linear(texel[c]) * f64::from(textured.factor[c]));
    let mut random = Random(1);
    for i in 0..100 {
        let (mut u, mut v) = (random.unit(), random.unit());
        if u + v > 1.0 {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        let weights = [1.0 - u - v, u, v];
        let at = |k: usize| (0..3).map(|i| weights[i] * f64::from(corners[i][k])).sum::<f64>();
        let p = [at(0), at(1), at(2)];
        let tint = [0, 1, 2].map(|c| (0..3).map(|i| weights[i] * f64::from(tints[i][c])).sum::<f64>());
        let shown = [0, 1, 2].map(|c| base[c] * tint[c]);
        // Unlit shows it at once; a mirror and matte show it times the sky; a thin pane of index 1 only transmits.
        let pane = Bsdf::Glass { ior: 1.0, thin: true, transmittance: textured, absorption: [0.0; 3] };
        for (bsdf, depth) in [
            (Bsdf::Unlit { color: textured }, 0),
            (Bsdf::Mirror { reflectance: textured }, 1),
            (Bsdf::Matte { reflectance: textured }, 1),
            (pane, 1),
        ] {
            let world = World::new()
                .with_texture(image(1, 1, |_, _| [texel[0], texel[1], texel[2], 255]))
                .with(triangle.clone(), surface(bsdf.clone()))
                .with_environment([1.0; 3]);
            let eye = ([p[0] + 0.2, p[1] - 0.3, p[2] + 2.0], p);
            assert_exact(&world, eye, depth, shown, 3e-6, &format!("{i}, {bsdf:?}"));
        }
    }
}

/// A tinted material is the one whose base colour is the product, sample by sample: metals and the base of a coat are
/// tinted, the coat's own colour and roughness are not. So is glass.
#[test]
fn tints_reach_the_base_colour_only() {
    let tint = [0.5f32, 0.25, 1.0];
    let scaled = |c: [f32; 3]| [0, 1, 2].map(|i| c[i] * tint[i]);
    let coat = |diffuse: [f32; 3]| {
        surface(Bsdf::Substrate {
            diffuse: color(diffuse),
            specular: color([0.04, 0.3, 0.1]),
            specular_weight: constant(0.5),
            roughness: constant(0.4),
        })
    };
    let glass = |transmittance: [f32; 3]| {
        surface(Bsdf::Glass {
            ior: 1.5,
            thin: false,
            transmittance: color(transmittance),
            absorption: [0.0; 3],
        })
    };
    let mix = |c: [f32; 3]| {
        surface(Bsdf::Mix {
            weight: constant(0.3),
            base: Box::new(Bsdf::Matte { reflectance: color(c) }),
            other: Box::new(Bsdf::RoughMetal { f0: color(c), roughness: constant(0.5) }),
        })
    };
    let base = [0.8, 0.5, 0.25];
    let cases: [&dyn Fn([f32; 3]) -> Material; 5] = [&coat, &glass, &mix, &|c| metal(c, 0.5), &mirror];
    for (i, make) in cases.into_iter().enumerate() {
        let render = |tinted: bool| {
            let mut object = cuboid([-0.5; 3], [0.5; 3], false);
            object.colors = Some(vec![if tinted { [tint[0], tint[1], tint[2], 0.5] } else { [1.0; 4] }; 8]);
            let material = make(if tinted { base } else { scaled(base) });
            let world = World::new().with(object, material).with_environment([1.0, 0.7, 0.4]);
            let world = world.with_light(LightKind::Point { position: [1.0, 2.0, 3.0] }, [9.0; 3]);
            let eye = hotspot_tests::world::pinhole([1.0, 0.8, 2.0], [0.0; 3], 40.0);
            picture(&world.prepare(), &eye, &settings(24, 24, 8, 5, 3)).pixels
        };
        assert_eq!(render(true), render(false), "case {i}");
    }
}

/// Base colour by the first set, emission by the second, and the other way round; roughness by the second.
#[test]
fn each_slot_reads_its_own_coordinates() {
    // A ramp of four texels; the first set points into texel 1, the second into texel 3.
    let ramp = || image(4, 1, |x, _| [40 + 50 * x as u8, 250 - 60 * x as u8, 10 * x as u8, 255]);
    let texel = |x: u8| [40 + 50 * x, 250 - 60 * x, 10 * x].map(linear);
    let mut panel = wall();
    panel.uvs = Some(vec![[0.3, 0.5]; 4]);
    panel.second_uvs = Some(vec![[0.8, 0.5]; 4]);
    let eye = ([0.4, 0.1, 2.0], [0.2, 0.1, 0.0]);
    for swapped in [false, true] {
        let (base_at, emission_at) =
            if swapped { (second(nearest(0)), nearest(0)) } else { (nearest(0), second(nearest(0))) };
        let material = Material {
            emission: textured([3.0; 3], emission_at),
            ..surface(Bsdf::Matte { reflectance: textured([1.0; 3], base_at) })
        };
        let world =
            World::new().with_texture(ramp()).with(panel.clone(), material).with_environment([1.0; 3]);
        let (base, emission) = if swapped { (texel(3), texel(1)) } else { (texel(1), texel(3)) };
        let expected = [0, 1, 2].map(|c| base[c] + 3.0 * emission[c]);
        let what = format!("swapped {swapped}");
        measure(&world.prepare(), &pencil(eye.0, eye.1), 1, 64).assert_near(expected, 0.01, &what);
    }
    // Roughness and weight of a coat by the second set: as with constants of the same value.
    let coat = |roughness: Scalar, weight: Scalar, specular: Color| {
        surface(Bsdf::Substrate { diffuse: color([0.3; 3]), specular, specular_weight: weight, roughness })
    };
    let of = |x: u8| [40 + 50 * x, 250 - 60 * x, 10 * x];
    let channel = |at: TextureRef, c: Channel, factor: f32| Scalar { factor, texture: Some((at, c)) };
    let by_texture = coat(
        channel(second(nearest(0)), Channel::G, 1.0),
        channel(nearest(0), Channel::R, 0.9),
        textured([0.5, 0.6, 0.7], second(bilinear(0))),
    );
    let between = {
        // u = 0.8 is 0.2 beyond the centre of texel 2's right neighbour's left half: x = 3.2 − 0.5.
        let f = 0.7f64;
        [0, 1, 2].map(|c| linear(of(2)[c]) * (1.0 - f) + linear(of(3)[c]) * f)
    };
    let by_hand = coat(
        constant(f32::from(of(3)[1]) / 255.0),
        constant(f32::from(of(1)[0]) / 255.0 * 0.9),
        color([0, 1, 2].map(|c| (between[c] * [0.5, 0.6, 0.7][c]) as f32)),
    );
    let render = |material: &Material| {
        let world = World::new()
            .with_texture(ramp())
            .with(panel.clone(), material.clone())
            .with_light(LightKind::Point { position: [-0.5, 0.2, 1.5] }, [2.0, 3.0, 4.0]);
        picture(&world.prepare(), &pencil(eye.0, eye.1), &settings(1, 1, 1, 1, 0)).mean()
    };
    let (a, b) = (render(&by_texture), render(&by_hand));
    assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 2e-5 * b && b > 0.01), "{a:?} for {b:?}");
}

/// Albedo of a coat in a uniform sky is that of its numbers: specular colour times weight, each through a texture.
#[test]
fn a_coat_weighs_its_specular_colour() {
    let texel = [220u8, 120, 60, 100];
    let eye = pencil([1.0, 0.5, 1.5], [0.1, 0.2, 0.0]);
    let weighed = surface(Bsdf::Substrate {
        diffuse: color([0.5; 3]),
        specular: textured([0.9, 0.8, 0.7], nearest(0)),
        specular_weight: Scalar { factor: 0.8, texture: Some((nearest(0), Channel::A)) },
        roughness: constant(0.6),
    });
    let world =
        World::new().with_texture(image(1, 1, |_, _| texel)).with(wall(), weighed).with_environment([1.0; 3]);
    let whole = measure(&world.prepare(), &eye, 1, 128);
    for c in 0..3 {
        let rs = linear(texel[c]) * [0.9, 0.8, 0.7][c] * 0.8 * f64::from(texel[3]) / 255.0;
        let world = World::new().with(wall(), substrate([0.5; 3], rs as f32, 0.6)).with_environment([1.0; 3]);
        let (mean, _) = measure(&world.prepare(), &eye, 1, 128).0[0];
        assert!((whole.0[c].0 / mean - 1.0).abs() < 1e-5, "channel {c}");
    }
}

fn unlit(c: [f32; 3]) -> Material {
    surface(Bsdf::Unlit { color: color(c) })
}

/// An unlit surface shows its colour from both sides, at any depth, under any light, and through a mirror its share.
#[test]
fn unlit_surfaces_show_their_colour() {
    let shown = [0.3f32, 7.0, 0.05];
    let expected = shown.map(f64::from);
    let sun = LightKind::Directional { direction: [0.0, 0.0, -1.0] };
    let dark = World::new().with(wall(), unlit(shown));
    let lit = dark.clone().with_light(sun, [100.0; 3]).with_environment([50.0; 3]);
    let lamp = dark.clone().with(
        rectangle([0.0, 0.0, 3.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]),
        Material { double_sided: true, ..light([40.0; 3]) },
    );
    for (i, world) in [dark, lit, lamp].iter().enumerate() {
        for z in [2.0, -2.0] {
            for depth in [0, 1, 6] {
                assert_exact(world, ([0.2, 0.1, z], [0.1, 0.3, 0.0]), depth, expected, 0.0, &format!("{i}"));
            }
        }
    }
    // Nothing else lights the scene: no environment is put in its stead.
    let alone = World::new().with(wall(), unlit(shown)).prepare();
    assert!(alone.repairs().is_empty() && alone.light_count() == 0);
    let mirrored = World::new()
        .with(rectangle([0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]), mirror([0.5, 0.25, 1.0]))
        .with(rectangle([0.0, 0.0, 5.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]), unlit(shown))
        .with_environment([0.0; 3]);
    let seen = [0, 1, 2].map(|c| expected[c] * [0.5, 0.25, 1.0][c]);
    for depth in [1, 6] {
        assert_exact(&mirrored, ([0.0, -0.1, 1.0], [0.0; 3]), depth, seen, 0.0, "mirrored");
    }
    assert_exact(&mirrored, ([0.0, -0.1, 1.0], [0.0; 3]), 0, [0.0; 3], 0.0, "mirrored, depth 0");
}

/// A matte floor gets the light of an unlit panel by scattering into it: colour times form factor, with no shadow ray; an
/// emitting one sends its own light besides.
#[test]
fn unlit_surfaces_shine_on_others() {
    let (center, u, v) = ([0.3, 1.0, -0.2], [0.8, 0.0, 0.0], [0.0, 0.0, 0.7]);
    let e = lambert(rectangle_corners(center, u, v), [0.0; 3], [0.0, 1.0, 0.0]);
    let floor = rectangle([0.0; 3], [0.0, 0.0, 4.0], [4.0, 0.0, 0.0]);
    let view = pencil([3.9, 0.35, 0.2], [0.0; 3]);
    let shown = [2.0, 1.0, 0.5];
    // A sun on the floor's other side, so that no environment is put in the stead of light.
    let sun = LightKind::Directional { direction: [0.0, 1.0, 0.0] };
    let plain = World::new().with(floor, matte([0.6; 3])).with_light(sun, [1e-3; 3]);
    let world = plain.clone().with(rectangle(center, u, v), unlit(shown)).prepare();
    assert_eq!(world.light_count(), 0);
    let expected = shown.map(|s| f64::from(s) * 0.6 / PI * e);
    for depth in [1, 5] {
        measure(&world, &view, depth, 256).assert_near(expected, 0.01, &format!("depth {depth}"));
    }
    let world = plain.with(rectangle(center, u, v), emitting(unlit(shown), [3.0; 3])).prepare();
    let expected = shown.map(|s| (f64::from(s) + 3.0) * 0.6 / PI * e);
    measure(&world, &view, 1, 256).assert_near(expected, 0.01, "emitting besides");
}

fn glass(ior: f32, thin: bool, absorption: [f32; 3]) -> Material {
    surface(Bsdf::Glass { ior, thin, transmittance: color([1.0; 3]), absorption })
}

const SIGMA: [f32; 3] = [0.2, 1.0, 3.0];

fn slab(thickness: f64) -> Mesh {
    cuboid([-50.0, -50.0, 0.0], [50.0, 50.0, thickness], false)
}

/// Index 1 neither reflects nor bends: what is left is exp(−σ d), d along the ray.
#[test]
fn absorption_by_lambert_and_beer() {
    for (thickness, dx) in [(0.1, 0.0), (1.0, 0.0), (1.0, 1.3), (2.5, 0.4), (0.01, 5.0)] {
        let world = World::new().with(slab(thickness), glass(1.0, false, SIGMA)).with_environment([2.0; 3]);
        let from = [0.3 + 3.0 * dx, 0.2, thickness + 3.0];
        let to = [0.3, 0.2, thickness];
        let d = thickness * f64::sqrt(1.0 + dx * dx);
        let expected = SIGMA.map(|s| 2.0 * (-f64::from(s) * d).exp());
        assert_exact(&world, (from, to), 8, expected, 1e-5, &format!("{thickness}, {dx}"));
    }
    // A pane has no inside, on neither of its sides: a lamp far behind it is seen in full.
    for z in [2.0, -2.0] {
        let lamp = Material { double_sided: true, ..light([2.0; 3]) };
        let pane = World::new()
            .with(wall(), glass(1.0, true, SIGMA))
            .with(rectangle([0.0, 0.0, -3.0 * z], [9.0, 0.0, 0.0], [0.0, 9.0, 0.0]), lamp);
        assert_exact(&pane, ([0.3, 0.2, z], [0.3, 0.2, 0.0]), 8, [2.0; 3], 1e-5, "pane");
    }
    // Beside the glass, behind it and before it nothing is lost.
    let world = World::new()
        .with(cuboid([-1.0; 3], [1.0; 3], false), glass(1.0, false, SIGMA))
        .with(rectangle([0.0, 0.0, -40.0], [30.0, 0.0, 0.0], [0.0, 30.0, 0.0]), light([1.0; 3]))
        .with_environment([0.0; 3]);
    let expected = SIGMA.map(|s| (-2.0 * f64::from(s)).exp());
    assert_exact(&world, ([0.3, 0.2, 30.0], [0.3, 0.2, 0.0]), 8, expected, 1e-5, "before and behind");
    assert_exact(&world, ([5.0, 0.2, 30.0], [5.0, 0.2, 0.0]), 8, [1.0; 3], 1e-5, "beside");
}

/// Two slabs, one of which does not absorb, in a row: each its own.
#[test]
fn absorption_ends_with_the_glass() {
    let clear = cuboid([-9.0, -9.0, -3.0], [9.0, 9.0, -1.0], false);
    let world = World::new()
        .with(slab(0.5), glass(1.0, false, SIGMA))
        .with(clear, glass(1.0, false, [0.0; 3]))
        .with_environment([1.0; 3]);
    let expected = SIGMA.map(|s| (-0.5 * f64::from(s)).exp());
    for z in [1.0, -1.0] {
        let from = [0.3, 0.2, 7.0 * z];
        assert_exact(&world, (from, [0.3, 0.2, 0.0]), 12, expected, 1e-5, &format!("from {z}"));
    }
}

/// A slab of index 1.5 in front of a lamp: T² A / (1 − R² A²) passes and comes to the eye, A = exp(−σ d), all orders of
/// reflection summed; straight and at an angle.
#[test]
fn absorption_between_reflections() {
    let ior = 1.5f64;
    let thickness = 0.4;
    let world = World::new()
        .with(slab(thickness), glass(ior as f32, false, SIGMA))
        .with(rectangle([0.0, 0.0, -9.0], [90.0, 0.0, 0.0], [0.0, 90.0, 0.0]), light([2.0; 3]))
        .with_environment([0.0; 3])
        .prepare();
    for tan in [0.0f64, 1.5] {
        let cos = 1.0 / (1.0 + tan * tan).sqrt();
        let sin = tan * cos;
        let cos_t = (1.0 - sin * sin / (ior * ior)).sqrt();
        let parallel = (ior * cos - cos_t) / (ior * cos + cos_t);
        let perpendicular = (cos - ior * cos_t) / (cos + ior * cos_t);
        let r = 0.5 * (parallel * parallel + perpendicular * perpendicular);
        let d = thickness / cos_t;
        let expected = SIGMA.map(|s| {
            let a = (-f64::from(s) * d).exp();
            2.0 * (1.0 - r) * (1.0 - r) * a / (1.0 - r * r * a * a)
        });
        for roulette in [Roulette::Off, Roulette::From(1), Roulette::Efficient] {
            let mut settings = settings(24, 24, 64, 100, 2);
            settings.roulette = roulette;
            let eye = pencil([0.3 + 3.0 * tan, 0.2, 3.0 + thickness], [0.3, 0.2, thickness]);
            let what = format!("tan {tan}, roulette {roulette:?}");
            measure_with(&world, &eye, &settings).assert_near(expected, 0.02, &what);
        }
    }
}

/// What lies inside of glass is dimmed on the way there; what bounces there, on each stretch.
#[test]
fn absorption_on_the_way_to_what_is_inside() {
    let block = || (cuboid([-2.0; 3], [2.0; 3], false), glass(1.0, false, SIGMA));
    // A lamp at depth 1.5 below the surface.
    let (mesh, material) = block();
    let lamp = rectangle([0.0, 0.0, 0.5], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
    let world =
        World::new().with(mesh, material).with(lamp.clone(), light([4.0; 3])).with_environment([0.0; 3]);
    let expected = SIGMA.map(|s| 4.0 * (-1.5 * f64::from(s)).exp());
    assert_exact(&world, ([0.3, 0.2, 7.0], [0.3, 0.2, 0.0]), 8, expected, 1e-5, "lamp");
    // A mirror there: in and out again.
    let (mesh, material) = block();
    let world = World::new().with(mesh, material).with(lamp, mirror([0.5; 3])).with_environment([1.0; 3]);
    let expected = SIGMA.map(|s| 0.5 * (-3.0 * f64::from(s)).exp());
    assert_exact(&world, ([0.3, 0.2, 7.0], [0.3, 0.2, 0.0]), 8, expected, 1e-5, "mirror");
}

/// Light that stays within the glass: from a lamp inside to a floor inside, weighted by exp(−σ d) of each point of the
/// lamp, whichever technique finds it; from a point light as well.
#[test]
fn absorption_between_surfaces_inside() {
    let sigma = [0.5f32, 1.0, 2.0];
    let base = || {
        World::new()
            .with(cuboid([-3.0; 3], [3.0; 3], false), glass(1.0, false, sigma))
            .with(rectangle([0.0; 3], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]), matte([0.5; 3]))
            .with_environment([0.0; 3])
    };
    // The eye is outside, 3 above the floor's plane within the glass.
    let eye = pencil([0.01, 9.0, 0.02], [0.01, 0.0, 0.02]);
    let way = |d: f64| sigma.map(|s| (-f64::from(s) * d).exp());
    let position = [0.5f32, 0.8, 0.3];
    let to = [0, 1, 2].map(|i| f64::from(position[i]) - [0.01, 0.0, 0.02][i]);
    let d2: f64 = to.iter().map(|c| c * c).sum();
    let world = base().with_light(LightKind::Point { position }, [6.0; 3]).prepare();
    let expected =
        [0, 1, 2].map(|c| way(3.0)[c] * way(d2.sqrt())[c] * 6.0 * 0.5 / PI * to[1] / (d2 * d2.sqrt()));
    measure(&world, &eye, 2, 1).assert_near(expected, 1e-5, "point");

    let (center, h) = ([0.9, 0.7, 0.1], 0.5);
    let lamp = rectangle(center, [h, 0.0, 0.0], [0.0, 0.0, h]);
    let n = 400;
    let mut sums = [0.0; 3];
    for i in 0..n * n {
        let mid = |i: i32| h * (2.0 * (f64::from(i) + 0.5) / f64::from(n) - 1.0);
        let p = [center[0] + mid(i % n) - 0.01, center[1], center[2] + mid(i / n) - 0.02];
        let d2 = p[0] * p[0] + p[1] * p[1] + p[2] * p[2];
        for (sum, way) in sums.iter_mut().zip(way(d2.sqrt())) {
            *sum += way * p[1] * p[1] / (d2 * d2) * (2.0 * h / f64::from(n)).powi(2);
        }
    }
    let expected = [0, 1, 2].map(|c| way(3.0)[c] * 4.0 * 0.5 / PI * sums[c]);
    let world = base().with(lamp, light([4.0; 3])).prepare();
    measure(&world, &eye, 2, 256).assert_near(expected, 0.01, "lamp");
}

fn mix(weight: Scalar, base: Bsdf, other: Bsdf) -> Bsdf {
    Bsdf::Mix { weight, base: Box::new(base), other: Box::new(other) }
}

/// Mixes of mixes have the expectation of their parts, on both sides and through textures; certain weights are certain.
#[test]
fn mixes_of_mixes_are_sums() {
    let matte = |r: f32| Bsdf::Matte { reflectance: color([r; 3]) };
    let mirror = |r: f32| Bsdf::Mirror { reflectance: color([r; 3]) };
    let eye = pencil([1.0, 0.5, 1.5], [0.1, 0.2, 0.0]);
    let weight = Scalar { factor: 0.8, texture: Some((nearest(0), Channel::B)) };
    let b = 0.8 * 70.0 / 255.0;
    let deep = |depth: u32| (0..depth).fold(matte(0.9), |m, _| mix(constant(0.5), m, mirror(0.1)));
    let half = |n: i32| 0.1 + 0.8 * 0.5f64.powi(n);
    for (bsdf, expected, what) in [
        (
            mix(constant(0.25), mix(constant(0.4), matte(0.2), mirror(0.9)), matte(0.6)),
            0.75 * (0.6 * 0.2 + 0.4 * 0.9) + 0.25 * 0.6,
            "left",
        ),
        (
            mix(constant(0.25), matte(0.6), mix(constant(0.4), matte(0.2), mirror(0.9))),
            0.25 * (0.6 * 0.2 + 0.4 * 0.9) + 0.75 * 0.6,
            "right",
        ),
        (
            mix(
                constant(0.7),
                mix(constant(0.1), mirror(0.8), matte(0.3)),
                mix(weight, matte(0.5), mix(constant(0.5), mirror(1.0), matte(0.1))),
            ),
            0.3 * (0.9 * 0.8 + 0.1 * 0.3) + 0.7 * ((1.0 - b) * 0.5 + b * (0.5 + 0.05)),
            "both",
        ),
        (deep(4), half(4), "deep"),
        (mix(constant(1.0), matte(0.2), mix(constant(0.0), mirror(0.7), matte(0.3))), 0.7, "certain"),
        (mix(constant(0.0), matte(0.2), mirror(0.9)), 0.2, "base"),
    ] {
        let world = World::new()
            .with_texture(image(1, 1, |_, _| [1, 2, 70, 255]))
            .with(wall(), surface(bsdf))
            .with_environment([1.0; 3])
            .prepare();
        for depth in [1, 3] {
            measure(&world, &eye, depth, 128).assert_grey(expected, 0.01, &format!("{what}, depth {depth}"));
        }
    }
}

/// A surface that glows through a texture is shaded as smoothly as one that does not; only lights proper are flat.
#[test]
fn glowing_surfaces_keep_their_normals() {
    let mut smooth = hotspot_tests::world::sphere([0.0; 3], 1.0, 2, false);
    smooth.normals = Some(smooth.positions.clone());
    smooth.uvs = Some(vec![[0.5; 2]; smooth.positions.len()]);
    let black = image(1, 1, |_, _| [0, 0, 0, 255]);
    let glow = Material { emission: textured([1.0; 3], nearest(0)), ..matte([0.5; 3]) };
    let shot = |mesh: Mesh, material: Material| {
        let sun = LightKind::Directional { direction: [0.0, 0.0, -1.0] };
        let world = World::new().with_texture(black.clone()).with(mesh, material).with_light(sun, [1.0; 3]);
        picture(
            &world.prepare(),
            &hotspot_tests::world::pinhole([0.0, 0.0, 5.0], [0.0; 3], 0.4),
            &settings(16, 16, 4, 1, 0),
        )
    };
    let most = |a: &hotspot_tests::picture::Picture, b: &hotspot_tests::picture::Picture| {
        a.pixels.iter().zip(&b.pixels).map(|(a, b)| (a[0] - b[0]).abs()).fold(0.0, f64::max)
    };
    let plain = shot(smooth.clone(), matte([0.5; 3]));
    assert!(most(&plain, &shot(smooth.clone(), glow)) < 1e-6);
    smooth.normals = None;
    assert!(most(&plain, &shot(smooth, matte([0.5; 3]))) > 1e-3, "facets show");
}
