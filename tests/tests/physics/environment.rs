//! Environment maps: irradiance against quadrature, what mirrors and cameras see, equal texels against a constant.

use crate::measure;
use core::f64::consts::{PI, TAU};
use hotspot_cost::Counter;
use hotspot_integrator::{BuildOptions, Isa, RenderScene};
use hotspot_scene::{Environment, EnvironmentMap, LightKind, Material};
use hotspot_tests::picture::{frame, picture, settings};
use hotspot_tests::world::{
    Random, V3, World, add_scaled, cross, dot, environment_map, matte, metal, mirror, pencil, rectangle,
    substrate, unit,
};

/// Radiance of a direction: the words of `EnvironmentMap`, in f64, with bilinear interpolation.
fn seen(map: &EnvironmentMap, d: V3) -> [f64; 3] {
    // Back to where the picture lies unrotated: about +Y, clockwise seen from above.
    let (s, c) = map.rotation.sin_cos();
    let d = [c * d[0] - s * d[2], d[1], s * d[0] + c * d[2]];
    let (w, h) = (i64::from(map.width), i64::from(map.height));
    let x = (d[0].atan2(-d[2]) + PI) / TAU * w as f64 - 0.5;
    let y = d[0].hypot(d[2]).atan2(d[1]) / PI * h as f64 - 0.5;
    let mut sum = [0.0; 3];
    for (j, wy) in [(0, 1.0 - (y - y.floor())), (1, y - y.floor())] {
        for (i, wx) in [(0, 1.0 - (x - x.floor())), (1, x - x.floor())] {
            let (column, row) =
                ((x.floor() as i64 + i).rem_euclid(w), (y.floor() as i64 + j).clamp(0, h - 1));
            let texel = map.texels[(row * w + column) as usize];
            for k in 0..3 {
                sum[k] += wx * wy * f64::from(texel[k]) * f64::from(map.scale[k]);
            }
        }
    }
    sum
}

/// ∫ L cos dω over the hemisphere around `n`, by midpoints, `fine`² of them per texel.
fn irradiance(map: &EnvironmentMap, n: V3, fine: u32) -> [f64; 3] {
    let (columns, rows) = (map.width * fine, map.height * fine);
    let mut sum = [0.0; 3];
    for j in 0..rows {
        let theta = PI * (f64::from(j) + 0.5) / f64::from(rows);
        let (sin, cos) = theta.sin_cos();
        for i in 0..columns {
            let (s, c) = (TAU * (f64::from(i) + 0.5) / f64::from(columns)).sin_cos();
            let d = [s * sin, cos, -c * sin];
            let facing = dot(d, n);
            if facing > 0.0 {
                let l = seen(map, d);
                (0..3).for_each(|k| sum[k] += l[k] * facing * sin);
            }
        }
    }
    sum.map(|s| s * TAU * PI / f64::from(columns * rows))
}

/// A blue sky that brightens towards the horizon over a brown ground, and a sun in one texel.
fn sky(sun: f32) -> EnvironmentMap {
    environment_map(48, 24, |x, y| match (x, y) {
        (30, 6) => [sun, 0.9 * sun, 0.7 * sun],
        (_, 0..12) => [0.3, 0.5, 1.0].map(|c| c * (0.3 + 0.05 * y as f32 + 0.01 * x as f32)),
        _ => [0.2, 0.15, 0.1],
    })
}

/// A plane through the origin with its front along unit vector `n`, and a camera that sees it at a slant.
fn plane(n: V3, material: Material) -> (World, hotspot_scene::Camera) {
    let u = unit(cross(if n[1].abs() < 0.9 { [0.0, 1.0, 0.0] } else { [1.0, 0.0, 0.0] }, n));
    let v = cross(n, u);
    let from = add_scaled(add_scaled(n.map(|c| 2.0 * c), 1.0, u), 0.3, v);
    (World::new().with(rectangle([0.0; 3], u, v), material), pencil(from, [0.0; 3]))
}

#[test]
fn planes_of_any_slope_are_lit_by_quadrature() {
    let planes = [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [-0.48, 0.64, 0.6], [0.0, -0.8, -0.6]];
    for (sun, rotation) in [(1.0, 0.0), (100.0, 0.7), (1e5, -2.0), (1e5, 4.0)] {
        let mut map = sky(sun);
        map.rotation = rotation;
        map.scale = [1.0, 0.5, 2.0];
        for n in planes {
            let n = unit(n);
            let (world, camera) = plane(n, matte([0.5, 0.8, 0.3]));
            let scene = world.with_environment_map(map.clone()).prepare();
            let e = irradiance(&map, n, 64);
            let expected = [0.5f32, 0.8, 0.3];
            let expected = [0, 1, 2].map(|c| f64::from(expected[c]) / PI * e[c]);
            measure(&scene, &camera, 1, 512).assert_near(
                expected,
                1e-3,
                &format!("sun {sun}, turned {rotation}, normal {n:?}"),
            );
        }
    }
}

/// A dark half, black rows and hot texels over shiny planes, where both ways of sampling matter. Interpolated to more texels
/// the picture shows the same light (up to 4e-3, by the curvature of sin θ and of the interpolation's corners) and is sampled
/// by another distribution.
#[test]
fn shiny_planes_weigh_both_ways_of_sampling() {
    let mut random = Random(8);
    let mut map = environment_map(32, 16, |x, y| {
        if x < 9 || y % 5 == 0 { [0.0; 3] } else { [0; 3].map(|_| random.unit().powi(9) as f32) }
    });
    map.rotation = 1.0;
    let n = unit([0.3, 0.9, 0.1]);
    for material in [metal([0.9; 3], 0.4), substrate([0.4; 3], 0.3, 0.25)] {
        let (world, camera) = plane(n, material);
        let few = measure(&world.clone().with_environment_map(map.clone()).prepare(), &camera, 1, 1024);
        let fine = refined(&map, 8);
        let other = measure(&world.with_environment_map(fine).prepare(), &camera, 1, 1024);
        for c in 0..3 {
            let ((a, sa), (b, sb)) = (few.0[c], other.0[c]);
            let sigma = sa.hypot(sb);
            assert!((a - b).abs() < 4.0 * sigma + 4e-3 * a, "{a} and {b}, sigma {sigma}");
            assert!(sigma < 4e-3 * a, "sigma {sigma} of {a}");
        }
    }
}

/// The picture interpolated to `n` times as many texels each way.
fn refined(map: &EnvironmentMap, n: u32) -> EnvironmentMap {
    let (w, h) = (map.width * n, map.height * n);
    let unrotated = EnvironmentMap { rotation: 0.0, ..map.clone() };
    let fine = environment_map(w, h, |x, y| {
        let (phi, theta) =
            (TAU * (f64::from(x) + 0.5) / f64::from(w) - PI, PI * (f64::from(y) + 0.5) / f64::from(h));
        seen(&unrotated, [phi.sin() * theta.sin(), theta.cos(), -phi.cos() * theta.sin()]).map(|c| c as f32)
    });
    EnvironmentMap { rotation: map.rotation, ..fine }
}

/// In a map that is 1 in one half space and 0 in the other, a shiny plane reflects the
/// share of its albedo that leads there; the two halves make the whole.
#[test]
fn halves_of_the_sky_add_up_to_the_whole() {
    let n = unit([0.2, 0.9, 0.4]);
    for material in [matte([0.7; 3]), metal([0.9; 3], 0.35), substrate([0.4; 3], 0.3, 0.25)] {
        let (world, camera) = plane(n, material);
        let whole = measure(&world.clone().with_environment([1.0; 3]).prepare(), &camera, 1, 256).0[0];
        let half = |left: bool| {
            let map = environment_map(16, 8, |x, _| [f32::from(u8::from((x < 8) == left)); 3]);
            measure(&world.clone().with_environment_map(map).prepare(), &camera, 1, 256).0[0]
        };
        let (left, right) = (half(true), half(false));
        let sigma = whole.1.hypot(left.1).hypot(right.1);
        let off = left.0 + right.0 - whole.0;
        assert!(off.abs() < 4.0 * sigma, "{} + {} for {}, sigma {sigma}", left.0, right.0, whole.0);
        assert!(sigma < 4e-3 * whole.0 && left.0 > 0.1 * whole.0 && right.0 > 0.1 * whole.0, "sigma {sigma}");
    }
}

#[test]
fn equal_texels_are_a_constant() {
    let radiance = [0.5, 1.0, 3.0];
    for material in [matte([0.6, 0.4, 0.9]), metal([0.9; 3], 0.5), substrate([0.5; 3], 0.2, 0.4)] {
        let (world, camera) = plane(unit([0.5, 0.7, -0.2]), material);
        // A second, tilted plate, so that paths scatter more than once and some of the sky is hidden.
        let plate = rectangle([0.0, -0.9, 0.3], [1.5, 0.3, 0.0], [0.0, 0.2, 1.5]);
        let world = world.with(plate, matte([0.8; 3]));
        let constant = measure(&world.clone().with_environment(radiance).prepare(), &camera, 5, 256);
        for (w, h) in [(1, 1), (2, 1), (16, 8)] {
            let map = environment_map(w, h, |_, _| radiance);
            let mapped = measure(&world.clone().with_environment_map(map).prepare(), &camera, 5, 256);
            for c in 0..3 {
                let ((a, sa), (b, sb)) = (constant.0[c], mapped.0[c]);
                let sigma = sa.hypot(sb);
                assert!((a - b).abs() < 4.0 * sigma, "{w} x {h}: {a} and {b}, sigma {sigma}");
                assert!(sigma < 4e-3 * a, "{w} x {h}: sigma {sigma} of {a}");
            }
        }
    }
}

/// The camera and a mirror see the picture itself.
#[test]
fn mirrors_and_cameras_see_the_map() {
    let mut map = sky(30.0);
    map.rotation = 0.9;
    map.scale = [2.0, 1.0, 0.5];
    let mut random = Random(4);
    for _ in 0..40 {
        let n = unit(random.point(-1.0, 1.0));
        let (world, camera) = plane(n, mirror([0.5, 0.9, 1.0]));
        let scene = world.with_environment_map(map.clone()).prepare();
        let back = [0, 1, 2].map(|i| camera.to_world[i][2]);
        let reflected = add_scaled(back.map(|c| -c), 2.0 * dot(back, n), n);
        let expected = seen(&map, reflected);
        let expected = [0, 1, 2].map(|c| [0.5, 0.9, 1.0][c] * expected[c]);
        let shown = picture(&scene, &camera, &settings(2, 2, 2, 1, 0));
        // Looking away from the plane.
        let away = pencil(n.map(|c| 2.0 * c), add_scaled(n.map(|c| 2.0 * c), 1.0, reflected));
        let direct = picture(&scene, &away, &settings(2, 2, 2, 0, 0));
        let plain = seen(&map, unit(reflected));
        for c in 0..3 {
            assert!(
                shown.pixels.iter().all(|p| (p[c] - expected[c]).abs() < 1e-3),
                "{:?} {expected:?}",
                shown.pixels[0]
            );
            assert!(
                direct.pixels.iter().all(|p| (p[c] - plain[c]).abs() < 1e-3),
                "{:?} {plain:?}",
                direct.pixels[0]
            );
        }
    }
}

#[test]
fn maps_that_are_not_whole_are_refused_by_name() {
    let (world, _) = plane([0.0, 1.0, 0.0], matte([0.5; 3]));
    let mut scene = world.scene;
    scene.environment = Some(Environment::Map(EnvironmentMap { width: 7, ..sky(1.0) }));
    let error = RenderScene::prepare(&scene, BuildOptions::default()).unwrap_err().to_string();
    assert!(error.contains("environment \"map\"") && error.contains("texels"), "{error}");
    // A black one is no light, and is respected.
    scene.environment = Some(Environment::Map(environment_map(4, 2, |_, _| [0.0; 3])));
    let prepared = RenderScene::prepare(&scene, BuildOptions::default()).unwrap();
    assert!(prepared.repairs().is_empty(), "{:?}", prepared.repairs());
    // Texels are held and counted.
    let memory = |w: u32| {
        let world =
            World { scene: scene.clone() }.with_environment_map(environment_map(w, w, |_, _| [1.0; 3]));
        world.prepare().memory().textures
    };
    assert!((12 * 255 * 256..18 * 256 * 256).contains(&(memory(256) - memory(16))));
}

/// The same bits from every instruction set; and each look-up counts as one of a texture: four texels of twelve bytes.
#[test]
fn look_ups_are_the_same_everywhere_and_counted() {
    let (world, camera) = plane(unit([0.2, 0.8, 0.5]), metal([0.9; 3], 0.4));
    let world = world
        .with_light(LightKind::Point { position: [0.3, 0.9, 0.4] }, [0.5; 3])
        .with_light(LightKind::Directional { direction: [0.0, -1.0, 0.0] }, [1.0; 3]);
    let run = |world: &World, isa: Isa| {
        let scene =
            RenderScene::prepare(&world.scene, BuildOptions { isa, ..BuildOptions::default() }).unwrap();
        frame(&scene, &camera, &settings(16, 16, 16, 3, 0)).frame
    };
    let mapped = world.clone().with_environment_map(sky(100.0));
    let (auto, portable) = (run(&mapped, Isa::Auto), run(&mapped, Isa::Portable));
    for (x, y) in auto.pixels() {
        assert_eq!(auto.film_total(x, y), portable.film_total(x, y), "{x}, {y}");
    }
    let sum = |frame: &hotspot_cost::Frame, c| frame.costs().map(|cost| cost.get(c)).sum::<u64>();
    let look_ups = sum(&auto, Counter::Texture);
    assert_eq!(sum(&auto, Counter::TextureBytes), 48 * look_ups);
    // Every path leaves the plane for the sky or is absorbed; the sky is sampled at most once at its only vertex.
    assert!((3000..=2 * 4096).contains(&look_ups), "{look_ups}");
    assert_eq!(sum(&run(&world.with_environment([1.0; 3]), Isa::Auto), Counter::Texture), 0);
}
