//! Means with their standard deviation, held against what must come out.
//!
//! A comparison fails beyond 4σ: a false-alarm rate of 6.3e-5 each (seeds are fixed, so what passes once passes always).
//! σ itself is estimated from independent replicates and must be small enough for the comparison to mean something.

use crate::picture::{picture, settings};
use crate::stats::{mean_and_variance, quantile};
use hotspot_integrator::{RenderScene, Settings};
use hotspot_scene::Camera;

/// The rate of false alarms of a normal variable at 4σ, two-sided.
const RATE: f64 = 6.334e-5;

/// A mean and its standard deviation, by channel, and how many replicates gave it.
#[derive(Clone, Copy, Debug)]
pub struct Measured(pub [(f64, f64); 3], usize);

/// The mean of a picture whose pixels all have one expectation: that of a pencil camera. 576 pixels, independent replicates.
pub fn measure(scene: &RenderScene, camera: &Camera, max_depth: u32, spp: u32) -> Measured {
    measure_with(scene, camera, &settings(24, 24, spp, max_depth, 1))
}

/// The same with other settings.
pub fn measure_with(scene: &RenderScene, camera: &Camera, settings: &Settings) -> Measured {
    Measured::of(&picture(scene, camera, settings).pixels)
}

/// The mean over the film of pictures whose pixels differ: `replicates` renders with seeds of their own.
pub fn measure_film(
    scene: &RenderScene,
    camera: &Camera,
    settings: &Settings,
    replicates: usize,
) -> Measured {
    let seeds = settings.seed..settings.seed + replicates as u64;
    let mut settings = settings.clone();
    let means: Vec<_> = seeds
        .map(|seed| {
            settings.seed = seed;
            picture(scene, camera, &settings).mean()
        })
        .collect();
    Measured::of(&means)
}

impl Measured {
    /// Of independent values with one expectation.
    pub fn of(replicates: &[[f64; 3]]) -> Self {
        let channels = [0, 1, 2].map(|c| {
            let values: Vec<f64> = replicates.iter().map(|p| p[c]).collect();
            let (mean, variance) = mean_and_variance(&values);
            (mean, variance.sqrt())
        });
        Self(channels, replicates.len())
    }

    /// Within 4σ of what is expected (the t of that rate for so many replicates; and f32's rounding); σ at most `most` of it.
    #[track_caller]
    pub fn assert_near(&self, expected: [f64; 3], most: f64, what: &str) {
        let t = quantile(RATE, self.1 as f64 - 1.0);
        for (c, (&(mean, sigma), expected)) in self.0.iter().zip(expected).enumerate() {
            let off = (mean - expected).abs();
            assert!(
                off <= t * sigma + 3e-6 * expected,
                "{what}, channel {c}: {mean} for {expected}, {:.1} sigma, {:+.3} %",
                off / sigma,
                100.0 * (mean / expected - 1.0)
            );
            assert!(
                sigma <= most * expected,
                "{what}, channel {c}: sigma {sigma} tells too little of {expected}"
            );
        }
    }

    /// The same in all channels.
    #[track_caller]
    pub fn assert_grey(&self, expected: f64, most: f64, what: &str) {
        self.assert_near([expected; 3], most, what);
    }
}
