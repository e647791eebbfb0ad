//! Is the error that a picture expects of itself the one that it has?
//!
//! For each scene and number of samples: the estimated relMSE over 16 seeds, its mean divided by the mean of the true relMSE
//! (against halves A and B of a reference, mean of (I − A)(I − B)/(M² + ε), free of the reference's noise). By halves
//! (`--intervals`) the ratio must be within 10 % of 1; the upper bound's must not be below 1. Seeds are fixed: what passes once
//! passes always; the standard error of a ratio is printed: 0.3 to 3.6 %.
//!
//! Short: two own scenes, 8 samples (where `--target-error` asks first). Long (ignored): the shared scenes, 4 to 64 samples.

use hotspot_cost::{CiKind, stats};
use hotspot_integrator::{Control, Gather, render};
use hotspot_tests::picture::{Picture, settings};
use hotspot_tests::reference::{Loaded, own_scene, reference, shared_scene};
use hotspot_tests::say;
use hotspot_tests::stats::mean_and_variance;

const SEEDS: u64 = 16;

/// ε of relMSE.
const EPSILON: f64 = 0.01;

fn relmse(picture: &Picture, [a, b]: [&Picture; 2]) -> f64 {
    let mut sum = 0.0;
    for ((i, a), b) in picture.pixels.iter().zip(&a.pixels).zip(&b.pixels) {
        for c in 0..3 {
            let mean = 0.5 * (a[c] + b[c]);
            sum += (i[c] - a[c]) * (i[c] - b[c]) / (mean * mean + EPSILON);
        }
    }
    sum / (3 * picture.pixels.len()) as f64
}

/// Estimated over true, for halves and for the upper bound.
fn check(
    name: &str,
    loaded: &Loaded,
    halves: [&Picture; 2],
    depth: u32,
    spps: &[u32],
    problems: &mut Vec<String>,
) {
    for spp in spps {
        for intervals in [true, false] {
            let (mut estimated, mut actual) = (Vec::new(), Vec::new());
            for seed in 0..SEEDS {
                let mut settings =
                    settings(halves[0].width as u32, halves[0].height as u32, *spp, depth, 100 + seed);
                settings.gather = Gather::RADIANCE;
                settings.intervals = intervals;
                let rendered = render(&loaded.scene, &loaded.camera, &settings, Control::default());
                let (estimate, kind) = stats::estimated_relmse(&rendered.frame).expect("there are samples");
                assert_eq!(kind == CiKind::Halves, intervals);
                estimated.push(estimate);
                actual.push(relmse(&Picture::of_frame(&rendered.frame), halves));
            }
            let ((e, _), (a, _)) = (mean_and_variance(&estimated), mean_and_variance(&actual));
            let ratio = e / a;
            // Of the ratio of means, to first order.
            let rest: Vec<f64> = estimated.iter().zip(&actual).map(|(e, a)| e - ratio * a).collect();
            let sigma = mean_and_variance(&rest).1.sqrt() / a;
            let kind = if intervals { "halves" } else { "bound" };
            let line =
                format!("{name}, {spp} spp, {kind}: true {a:.3e}, estimated {ratio:.3} ± {sigma:.3} of it");
            say(&line);
            if (intervals && (ratio - 1.0).abs() > 0.1) || ratio < if intervals { 0.9 } else { 1.0 } {
                problems.push(line);
            }
        }
    }
}

#[test]
fn own_scenes() {
    let mut problems = Vec::new();
    for (name, width, height) in [("cornell-box-red", 160, 160), ("white-room-substrate", 96, 72)] {
        let Some(scene) = own_scene(name) else { continue };
        let loaded = Loaded::new(&scene);
        let half = |seed| {
            let mut settings = settings(width, height, 128, 15, seed);
            settings.gather = Gather::RADIANCE;
            Picture::of_frame(&render(&loaded.scene, &loaded.camera, &settings, Control::default()).frame)
        };
        check(name, &loaded, [&half(1), &half(2)], 15, &[8], &mut problems);
    }
    assert!(problems.is_empty(), "{problems:#?}");
}

/// The shared scenes at their references' sizes.
fn shared_scenes(spps: &[u32]) {
    let mut problems = Vec::new();
    for (name, stem) in [
        ("cornell-box-red", "cornell-box-red_256x256_4096"),
        ("killeroo", "killeroo_256x256_2048"),
        ("veach-mis", "veach-mis_300x200_4140"),
        ("living-room-matte", "living-room-matte_320x180_2160"),
        ("living-room-substrate", "living-room-substrate_320x180_3456"),
    ] {
        let (Some(scene), Some(reference)) = (shared_scene(name), reference(stem)) else { continue };
        check(name, &Loaded::new(&scene), [&reference.a, &reference.b], 64, spps, &mut problems);
    }
    assert!(problems.is_empty(), "{problems:#?}");
}

#[test]
#[ignore = "a quarter of an hour of rendering"]
fn shared_scenes_at_4_to_16_samples() {
    shared_scenes(&[4, 8, 16]);
}

#[test]
#[ignore = "half an hour of rendering"]
fn shared_scenes_at_64_samples() {
    shared_scenes(&[64]);
}
