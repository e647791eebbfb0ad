//! Pictures with known answers: closed forms, quadratures, symmetries.
//!
//! Where all pixels have the same expectation, they are independent replicates, and their spread gives σ. A comparison
//! fails beyond 4σ (false-alarm rate 6e-5 each, some 500 in all; seeds are fixed, so what passes once passes always), and
//! σ itself must be small enough for the comparison to mean something.

mod bsdf;
mod bumps;
mod closed;
mod cutouts;
mod default_light;
mod depth;
mod emitters;
mod environment;
mod furnace;
mod instances;
mod placing;
mod punctual;
mod surfaces;

use hotspot_integrator::{RenderScene, Settings};
use hotspot_scene::Camera;
use hotspot_tests::picture::{picture, settings};
use hotspot_tests::stats::mean_and_variance;

/// A mean and its standard deviation, by channel.
struct Measured([(f64, f64); 3]);

/// The mean of a picture whose pixels all have one expectation: that of a pencil camera.
fn measure(scene: &RenderScene, camera: &Camera, max_depth: u32, spp: u32) -> Measured {
    measure_with(scene, camera, &settings(24, 24, spp, max_depth, 1))
}

fn measure_with(scene: &RenderScene, camera: &Camera, settings: &Settings) -> Measured {
    let picture = picture(scene, camera, settings);
    Measured([0, 1, 2].map(|c| {
        let values: Vec<f64> = picture.pixels.iter().map(|p| p[c]).collect();
        let (mean, variance) = mean_and_variance(&values);
        (mean, variance.sqrt())
    }))
}

impl Measured {
    /// Within 4σ of what is expected (and f32's rounding); σ at most `most` of it.
    fn assert_near(&self, expected: [f64; 3], most: f64, what: &str) {
        for (c, (&(mean, sigma), expected)) in self.0.iter().zip(expected).enumerate() {
            let off = (mean - expected).abs();
            assert!(
                off <= 4.0 * sigma + 3e-6 * expected,
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
    fn assert_grey(&self, expected: f64, most: f64, what: &str) {
        self.assert_near([expected; 3], most, what);
    }
}
