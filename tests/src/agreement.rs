//! Does a picture agree with a reference? Means and tiles by Student's t.
//!
//! The difference of a tile's means is tested against its variance: the sum over the tile's pixels of our variance over
//! independently scrambled renders and of the reference's, with Satterthwaite's degrees of freedom. The level of a single
//! test is Šidák's for a family-wise false-alarm rate. Pixels of the reference must be independent of each other.

use crate::picture::{Picture, tiles};
use crate::stats::{Variance, mean_and_variance, sidak};
use std::fmt::Write;

/// Mean and the variance of that mean, by pixel and channel.
#[derive(Clone, Debug)]
pub struct Estimate {
    /// Mean.
    pub mean: Picture,
    /// Variance of the mean.
    pub variance: Vec<[f64; 3]>,
    /// Degrees of freedom of each variance.
    pub dof: f64,
}

impl Estimate {
    /// From independent pictures of the same thing, at least two.
    pub fn of(renders: &[Picture]) -> Self {
        let mut mean = renders[0].clone();
        let mut variance = vec![[0.0; 3]; mean.pixels.len()];
        for (i, (mean, variance)) in mean.pixels.iter_mut().zip(&mut variance).enumerate() {
            for (c, (mean, variance)) in mean.iter_mut().zip(variance).enumerate() {
                let values: Vec<f64> = renders.iter().map(|r| r.pixels[i][c]).collect();
                (*mean, *variance) = mean_and_variance(&values);
            }
        }
        Self { mean, variance, dof: renders.len() as f64 - 1.0 }
    }
}

/// The difference of two sums over some pixels.
#[derive(Clone, Copy, Debug)]
pub struct Difference {
    /// Ours minus the reference's.
    pub difference: f64,
    /// The reference's sum.
    pub sum: f64,
    /// Of the difference.
    pub variance: Variance,
}

/// Relative difference that rounding alone may cause: several hundred samples summed in 32 bits, colours decoded in 32 bits.
const ROUNDING: f64 = 2e-5;

impl Difference {
    /// Over `pixels`, in channel `c`.
    pub fn of(
        ours: &Estimate,
        reference: &Estimate,
        pixels: impl IntoIterator<Item = usize>,
        c: usize,
    ) -> Self {
        let (mut difference, mut sum, mut variance) = (0.0, 0.0, Variance::default());
        for i in pixels {
            difference += ours.mean.pixels[i][c] - reference.mean.pixels[i][c];
            sum += reference.mean.pixels[i][c];
            for estimate in [ours, reference] {
                if estimate.variance[i][c] > 0.0 {
                    variance.add(estimate.variance[i][c], estimate.dof);
                }
            }
        }
        Self { difference, sum, variance }
    }

    /// Of the reference's sum.
    pub fn relative(&self) -> f64 {
        self.difference / self.sum
    }

    /// Two-sided p-value of what exceeds rounding.
    pub fn p_value(&self) -> f64 {
        self.variance.p_value((self.difference.abs() - ROUNDING * self.sum).max(0.0))
    }
}

/// One test.
#[derive(Clone, Copy, Debug)]
pub struct Test {
    /// Number of the tile, row by row; `None`: the whole picture.
    pub tile: Option<usize>,
    /// Red, green or blue.
    pub channel: usize,
    /// What was found.
    pub found: Difference,
    /// Its p-value.
    pub p: f64,
}

/// All tests of a picture.
#[derive(Clone, Debug)]
pub struct Tests {
    /// The whole picture first, then its tiles.
    pub tests: Vec<Test>,
    /// Level of a single test.
    pub level: f64,
    per_row: usize,
}

impl Tests {
    /// Tests tiles of `edge` pixels, and with `whole` the picture's means as well, over the pixels where `used` holds; any
    /// of them raises a false alarm with probability `family`. What is black in both says nothing and is left out.
    pub fn new(
        ours: &Estimate,
        reference: &Estimate,
        used: impl Fn(usize) -> bool,
        edge: usize,
        whole: bool,
        family: f64,
    ) -> Self {
        let Picture { width, height, .. } = reference.mean;
        let all = whole.then(|| (None, (0..width * height).collect()));
        let tiles = tiles(width, height, edge).into_iter().enumerate().map(|(t, pixels)| (Some(t), pixels));
        let mut tests = Vec::new();
        for (tile, pixels) in all.into_iter().chain(tiles) {
            for channel in 0..3 {
                let pixels = pixels.iter().copied().filter(|i| used(*i));
                let found = Difference::of(ours, reference, pixels, channel);
                if found.sum != 0.0 || found.difference != 0.0 {
                    tests.push(Test { tile, channel, found, p: found.p_value() });
                }
            }
        }
        Self { level: sidak(family, tests.len()), tests, per_row: width.div_ceil(edge) }
    }

    /// Those that fail.
    pub fn failed(&self) -> impl Iterator<Item = &Test> {
        self.tests.iter().filter(|test| test.p < self.level)
    }

    /// A line for people.
    pub fn summary(&self) -> String {
        let below = |p: f64| self.tests.iter().filter(|t| t.p < p).count() as f64 / self.tests.len() as f64;
        let Some(worst) = self.tests.iter().min_by(|a, b| a.p.total_cmp(&b.p)) else {
            return "nothing to test".into();
        };
        format!(
            "{} tests at level {:.1e}; smallest p {:.1e} ({} {}, {:+.2} %); p < 0.05: {:.1} %, p < 0.01: {:.2} %",
            self.tests.len(),
            self.level,
            worst.p,
            worst.tile.map_or("all of".into(), |t| format!(
                "tile {}, {}",
                t % self.per_row,
                t / self.per_row
            )),
            ["red", "green", "blue"][worst.channel],
            100.0 * worst.found.relative(),
            100.0 * below(0.05),
            100.0 * below(0.01),
        )
    }

    /// What failed, with t by tile for people; empty when nothing did.
    pub fn problems(&self) -> String {
        let mut out = String::new();
        let failed = self.failed().count();
        if failed == 0 {
            return out;
        }
        let t = |test: &Test| test.found.difference / test.found.variance.sigma();
        let _ = writeln!(out, "{failed} of {} tests below {:.1e}; t by tile:", self.tests.len(), self.level);
        for (c, channel) in ["red", "green", "blue"].into_iter().enumerate() {
            let _ = writeln!(out, "{channel}");
            for test in self.tests.iter().filter(|test| test.channel == c) {
                match test.tile {
                    None => {
                        let _ =
                            writeln!(out, "mean {:+.3} %, t {:.1}", 100.0 * test.found.relative(), t(test));
                    }
                    Some(tile) => {
                        let end = if (tile + 1) % self.per_row == 0 { "\n" } else { "" };
                        let _ = write!(out, "{:>6.1}{end}", t(test));
                    }
                }
            }
            out.push('\n');
        }
        out
    }
}

/// Ours, the reference and t by pixel side by side as a PNG, each pixel four wide: red where ours is brighter, blue where it
/// is darker, full at |t| = 5.
pub fn write_difference(path: &std::path::Path, ours: &Estimate, reference: &Estimate) {
    const SCALE: u32 = 4;
    let Picture { width, height, .. } = reference.mean;
    let exposure = 0.7 / (reference.mean.mean().iter().sum::<f64>() / 3.0).max(1e-9) * 0.5;
    let shown = |p: [f64; 3]| p.map(|c| (255.0 * (c * exposure).clamp(0.0, 1.0).powf(1.0 / 2.2)) as u8);
    let t = |i: usize| {
        let (mut difference, mut variance) = (0.0, 0.0);
        for c in 0..3 {
            difference += ours.mean.pixels[i][c] - reference.mean.pixels[i][c];
            variance += ours.variance[i][c] + reference.variance[i][c];
        }
        let t = if difference == 0.0 { 0.0 } else { (difference / variance.sqrt() / 5.0).clamp(-1.0, 1.0) };
        let pale = (255.0 * (1.0 - t.abs())) as u8;
        if t > 0.0 { [255, pale, pale] } else { [pale, pale, 255] }
    };
    let image = image::RgbImage::from_fn(3 * width as u32 * SCALE, height as u32 * SCALE, |x, y| {
        let (x, y) = ((x / SCALE) as usize, (y / SCALE) as usize);
        let i = y * width + x % width;
        image::Rgb(match x / width {
            0 => shown(ours.mean.pixels[i]),
            1 => shown(reference.mean.pixels[i]),
            _ => t(i),
        })
    });
    hotspot_cost::maps::write_png(path, &image).expect("the folder can be written to");
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::world::Random;

    fn noisy(random: &mut Random, level: f64) -> Picture {
        let pixels = (0..32 * 16).map(|_| [0; 3].map(|_| level + random.within(-0.3, 0.3))).collect();
        Picture { width: 32, height: 16, pixels }
    }

    /// Expected: nothing in 200 comparisons of equal pictures at 0.1 % (more than 2 with probability 1e-3 at most), and
    /// 4 % always, of tiles of 64 pixels with 16 + 4 renders: their sigma is 0.5 %.
    #[test]
    fn equal_pictures_agree_and_others_do_not() {
        let mut random = Random(5);
        let mut compare = |ours: f64| {
            let reference: Vec<Picture> = (0..16).map(|_| noisy(&mut random, 1.0)).collect();
            let ours: Vec<Picture> = (0..4).map(|_| noisy(&mut random, ours)).collect();
            let tests = Tests::new(&Estimate::of(&ours), &Estimate::of(&reference), |_| true, 8, true, 1e-3);
            assert_eq!(tests.tests.len(), 3 * 9);
            assert_eq!(tests.problems().is_empty(), tests.failed().count() == 0);
            tests.failed().count()
        };
        assert!((0..200).filter(|_| compare(1.0) > 0).count() <= 2);
        assert!((0..50).all(|_| compare(1.04) > 0));
    }
}
