//! Rough metal of base colour 1 becomes the mirror as its roughness goes to 0.

use hotspot_scene::Material;
use hotspot_tests::picture::{Picture, picture, settings};
use hotspot_tests::world::{World, environment_map, matte, metal, mirror, pinhole, rectangle, sphere};

/// Metal balls on a floor under a sky whose brightness changes slowly and everywhere.
fn shown(material: &Material, seed: u64) -> Picture {
    let sky = environment_map(64, 32, |x, y| {
        let (s, c) = (f64::from(x) / 64.0 * core::f64::consts::TAU).sin_cos();
        let v = f64::from(y) / 32.0;
        [1.0 + 0.5 * s * v, 1.0 + 0.5 * c * v, 0.3 + v].map(|c| c as f32)
    });
    let world = World::new()
        .with(rectangle([0.0, -1.0, 0.0], [0.0, 0.0, 5.0], [5.0, 0.0, 0.0]), matte([0.4, 0.3, 0.2]))
        .with(sphere([-0.9, 0.0, 0.0], 1.0, 2, false), material.clone())
        .with(sphere([1.2, -0.2, 0.3], 0.8, 2, false), material.clone())
        .with_environment_map(sky);
    picture(
        &world.prepare(),
        &pinhole([0.0, 1.0, 5.0], [0.0, -0.2, 0.0], 40.0),
        &settings(32, 32, 256, 6, seed),
    )
}

/// RMS difference over the mean, and the relative difference of the means.
fn apart(a: &Picture, b: &Picture) -> (f64, f64) {
    let mean = b.pixels.iter().map(|p| p[1]).sum::<f64>() / b.pixels.len() as f64;
    let squares = a.pixels.iter().zip(&b.pixels).map(|(a, b)| (a[1] - b[1]).powi(2));
    let rms = (squares.sum::<f64>() / b.pixels.len() as f64).sqrt() / mean;
    (rms, a.mean()[1] / b.mean()[1] - 1.0)
}

/// With every step the picture comes nearer, to less than what two mirrors of different seeds differ by and 0.2 %.
#[test]
fn smooth_metal_shows_the_mirrors_image() {
    let smooth = mirror([1.0; 3]);
    let reference = shown(&smooth, 1);
    let (noise, _) = apart(&shown(&smooth, 2), &reference);
    let mut before = f64::INFINITY;
    for roughness in [0.6, 0.3, 0.15, 0.0] {
        let (rms, mean) = apart(&shown(&metal([1.0; 3], roughness), 3), &reference);
        hotspot_tests::say(&format!(
            "roughness {roughness}: rms {:.3} %, mean {:+.3} %, noise {:.3} %",
            100.0 * rms,
            100.0 * mean,
            100.0 * noise
        ));
        assert!(rms < before, "roughness {roughness}: {rms}, before {before}");
        before = rms;
        if roughness == 0.0 {
            assert!(rms < 1.2 * noise + 2e-3, "{rms}, noise {noise}");
            assert!(mean.abs() < 2e-3, "{mean}");
        }
    }
}
