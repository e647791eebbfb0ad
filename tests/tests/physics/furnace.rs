//! White furnaces: in uniform light a white surface vanishes, and any other shows its own albedo.

use crate::{measure, measure_with};
use hotspot_integrator::Roulette;
use hotspot_scene::{Bsdf, Color, Material};
use hotspot_tests::albedo::{metal_albedo, substrate_albedo};
use hotspot_tests::picture::{picture, settings};
use hotspot_tests::say;
use hotspot_tests::stats::mean_and_variance;
use hotspot_tests::world::{
    World, cuboid, emitting, light, matte, metal, mirror, pencil, pinhole, rectangle, sphere, substrate,
    surface,
};

/// A convex white matte object in a uniform unit environment: every pixel is 1, whatever the samples.
#[test]
fn a_white_ball_vanishes() {
    for object in [sphere([0.0; 3], 1.0, 3, false), cuboid([-0.8; 3], [0.9, 0.5, 0.7], false)] {
        let scene = World::new().with(object, matte([1.0; 3])).with_environment([1.0; 3]).prepare();
        let camera = pinhole([1.0, 2.0, 3.0], [0.0; 3], 35.0);
        let picture = picture(&scene, &camera, &settings(48, 48, 8, 64, 0));
        assert!(
            picture.min() > 1.0 - 1e-5 && picture.max() < 1.0 + 1e-5,
            "{}..{}",
            picture.min(),
            picture.max()
        );
    }
}

/// Its albedo shows in colour.
#[test]
fn a_coloured_ball_shows_its_albedo() {
    let scene =
        World::new().with(sphere([0.0; 3], 1.0, 2, false), matte([0.2, 0.5, 0.8])).with_environment([2.0; 3]);
    let measured = measure(&scene.prepare(), &pencil([0.1, 0.2, 3.0], [0.1, 0.2, 0.0]), 7, 4);
    measured.assert_near([0.4, 1.0, 1.6], 1e-5, "ball");
}

/// Uniform light from the walls of a closed box: light and BSDF sampling with different densities must add up.
#[test]
fn a_white_ball_between_luminous_walls_vanishes() {
    let world = World::new()
        .with(sphere([0.1, -0.2, 0.3], 0.7, 3, false), matte([1.0; 3]))
        .with(cuboid([-1.5, -1.2, -1.1], [1.2, 1.4, 1.6], true), light([1.0; 3]));
    // Walls of the same radiance in front of a luminous environment, mixed with a part of it.
    let open = World::new()
        .with(sphere([0.1, -0.2, 0.3], 0.7, 3, false), matte([1.0; 3]))
        .with(rectangle([0.0, 1.5, 0.0], [3.0, 0.0, 0.0], [0.0, 0.0, 3.0]), light([1.0; 3]))
        .with(rectangle([-2.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]), light([1.0; 3]))
        .with_environment([1.0; 3]);
    for (world, what) in [(world, "closed"), (open, "open")] {
        let camera = pinhole([1.0, 0.9, 1.4], [0.1, -0.2, 0.3], 60.0);
        for depth in [1, 9] {
            let picture = picture(&world.prepare(), &camera, &settings(40, 40, 64, depth, 2));
            let values: Vec<f64> = picture.pixels.iter().map(|p| p[1]).collect();
            let (mean, variance) = mean_and_variance(&values);
            let sigma = variance.sqrt();
            assert!(sigma < 3e-3, "{what}: sigma {sigma}");
            assert!((mean - 1.0).abs() < 4.0 * sigma, "{what}, depth {depth}: {mean} ± {sigma}");
        }
    }
}

/// Inside a closed box whose walls emit e and reflect ρ: e Σ ρ^k over k = 0..=N after N scattering events, with any
/// roulette; e/(1 − ρ) without a limit.
#[test]
fn luminous_boxes_sum_the_geometric_series() {
    let (e, rho) = ([0.5f32, 1.0, 2.0], [0.3f32, 0.6, 0.9]);
    let walls = emitting(matte(rho), e);
    let world = World::new().with(cuboid([-1.0, -0.7, -1.3], [1.2, 0.9, 1.0], true), walls);
    let scene = world.prepare();
    let camera = pencil([0.1, 0.05, -0.2], [-0.3, -0.6, 0.7]);
    for roulette in [Roulette::Off, Roulette::From(0), Roulette::From(4), Roulette::Efficient] {
        for depth in [0, 1, 2, 5, 6, 12, 400] {
            let spp = match depth {
                0..=2 => 32,
                3..=100 => 256,
                _ => 1024,
            };
            let mut settings = settings(24, 24, spp, depth, 7);
            settings.roulette = roulette;
            if depth > 100 && roulette == Roulette::Off {
                continue;
            }
            let expected = [0, 1, 2].map(|c| {
                let (e, rho) = (f64::from(e[c]), f64::from(rho[c]));
                e * (1.0 - rho.powi(depth as i32 + 1)) / (1.0 - rho)
            });
            let what = format!("depth {depth}, roulette {roulette:?}");
            measure_with(&scene, &camera, &settings).assert_near(expected, 1e-3, &what);
        }
    }
}

/// The same to a hundredth of a percent: what is lost or won where walls meet would show.
#[test]
#[ignore = "16.8 million paths: run in release"]
fn luminous_boxes_to_a_hundredth_of_a_percent() {
    let (e, rho) = ([0.5f32, 1.0, 2.0], [0.3f32, 0.6, 0.9]);
    let walls = emitting(matte(rho), e);
    let scene = World::new().with(cuboid([-1.0, -0.7, -1.3], [1.2, 0.9, 1.0], true), walls).prepare();
    let mut settings = settings(64, 64, 4096, 6, 3);
    settings.roulette = Roulette::Off;
    let measured = measure_with(&scene, &pencil([0.1, 0.05, -0.2], [-0.3, -0.6, 0.7]), &settings);
    let expected = [0, 1, 2].map(|c| {
        let (e, rho) = (f64::from(e[c]), f64::from(rho[c]));
        e * (1.0 - rho.powi(7)) / (1.0 - rho)
    });
    for (c, (mean, sigma)) in measured.0.into_iter().enumerate() {
        say(&format!(
            "channel {c}: {:+.4} % ± {:.4} %",
            100.0 * (mean / expected[c] - 1.0),
            100.0 * sigma / expected[c]
        ));
    }
    measured.assert_near(expected, 1.5e-4, "luminous box");
}

/// The albedo of a plane of each material at several incidences, against quadrature; energy at most 1.01.
#[test]
fn planes_show_their_albedo() {
    let shown = |material: Material, cos: f64, what: &str, expected: f64| {
        let plane = rectangle([0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
        let scene = World::new().with(plane, material).with_environment([1.0; 3]).prepare();
        let sin = (1.0 - cos * cos).sqrt();
        let from = [5.0 * sin * 0.6, 5.0 * sin * 0.8, 5.0 * cos];
        let what = format!("{what}, cos {cos}");
        measure(&scene, &pencil(from, [0.0; 3]), 1, 256).assert_grey(expected, 1e-3, &what);
        assert!(expected < 1.01, "{what}: albedo {expected}");
    };
    for cos in [0.98, 0.7, 0.3, 0.1] {
        for (rd, rs, roughness) in
            [(0.5f32, 0.04f32, 0.5f32), (1.0, 1.0 / 9.0, 0.3), (0.0, 0.5, 0.8), (0.3, 0.05, 0.12)]
        {
            let alpha = f64::from(roughness * roughness);
            let expected = substrate_albedo(rd.into(), rs.into(), alpha, cos);
            let what = format!("substrate {rd} {rs} {roughness}");
            shown(substrate([rd; 3], rs, roughness), cos, &what, expected);
        }
        for (f0, roughness) in [(1.0f32, 0.5f32), (0.5, 0.2), (0.9, 1.0)] {
            let expected = metal_albedo(f0.into(), f64::from(roughness * roughness), cos);
            shown(metal([f0; 3], roughness), cos, &format!("metal {f0} {roughness}"), expected);
        }
        shown(mirror([0.7; 3]), cos, "mirror", f64::from(0.7f32));
        let halves = Bsdf::Mix {
            weight: hotspot_scene::Scalar::constant(0.25),
            base: Box::new(Bsdf::Matte { reflectance: Color::constant([0.8; 3]) }),
            other: Box::new(Bsdf::Mirror { reflectance: Color::constant([0.4; 3]) }),
        };
        shown(surface(halves), cos, "mix", 0.75 * f64::from(0.8f32) + 0.25 * f64::from(0.4f32));
    }
}

/// Glass that absorbs nothing vanishes too: solid (radiance is scaled by 1/η² on entry and back on exit) and thin.
#[test]
fn clear_glass_vanishes() {
    for thin in [false, true] {
        let glass = surface(Bsdf::Glass {
            ior: 1.5,
            thin,
            transmittance: Color::constant([1.0; 3]),
            absorption: [0.0; 3],
        });
        let world = World::new().with(sphere([0.0; 3], 1.0, 3, false), glass).with_environment([1.0; 3]);
        let mut settings = settings(32, 32, 8, 1000, 0);
        settings.roulette = Roulette::Off;
        let picture = picture(&world.prepare(), &pinhole([0.0, 1.0, 3.0], [0.0; 3], 40.0), &settings);
        assert!(picture.min() > 0.9999 && picture.max() < 1.0001, "{}..{}", picture.min(), picture.max());
    }
}

/// With and without roulette the same expectation, in a room lit through many bounces.
#[test]
fn roulette_does_not_bias() {
    let world = World::new()
        .with(cuboid([-1.0; 3], [1.0; 3], true), matte([0.85, 0.5, 0.2]))
        .with(cuboid([-0.6, -1.0, -0.2], [0.0, 0.2, 0.4], false), mirror([0.9, 0.8, 0.7]))
        .with(rectangle([0.3, 0.9, 0.0], [0.2, 0.0, 0.0], [0.0, 0.0, 0.2]), light([10.0; 3]));
    let scene = world.prepare();
    let camera = pencil([0.5, 0.1, 0.8], [0.6, -1.0, 0.1]);
    let with = |roulette, seed| {
        let mut settings = settings(24, 24, 64, 60, seed);
        settings.roulette = roulette;
        measure_with(&scene, &camera, &settings).0
    };
    let off = with(Roulette::Off, 1);
    let some = [Roulette::From(0), Roulette::From(2), Roulette::From(4), Roulette::Efficient];
    for (roulette, seed) in some.into_iter().zip(2..) {
        for (c, ((a, sa), (b, sb))) in off.into_iter().zip(with(roulette, seed)).enumerate() {
            let sigma = sa.hypot(sb);
            assert!((a - b).abs() < 4.0 * sigma, "{roulette:?}, channel {c}: {a} and {b}, sigma {sigma}");
            assert!(sigma < 0.02 * a, "{roulette:?}: sigma {sigma} of {a}");
        }
    }
}
