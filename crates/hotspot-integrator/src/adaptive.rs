//! Adaptive sampling: more samples for pixels whose relative error would otherwise be large.
//!
//! A first quarter of the samples (rounded down to a power of two) goes to all pixels alike. From it follows, for each pixel, an
//! estimate v of the relative variance of one sample, variance / (mean² + 0.01), the terms of relMSE. The rest is shared out so
//! that Σ v / n is least for the same number of samples altogether: n in proportion to √v.
//!
//! **Unbiased.** A pixel's v comes from the pixels around it and not from its own samples. Their points are independent of
//! its own, so how many samples a pixel gets does not depend on what its samples are, and its mean stays unbiased. (Were a
//! pixel's own variance asked, those which missed what is rare would stop early and stay too dark.) What is left is the common
//! factor that makes the sum come out, to which each pixel adds one part in as many as there are pixels.
//!
//! **Deterministic.** The plan is made once, at a fixed number of samples, from sums that do not depend on threads.
//!
//! **Costs.** Cost layers are means over a pixel's own samples, as unbiased as without; totals are sums over all samples, and so
//! weigh pixels by their samples: a frame's total is what *this* render did, not a multiple of one at equal samples.

use hotspot_cost::{Frame, Rect};

/// The radiance² below which errors count as absolute: that of relMSE.
const FLOOR: f64 = 0.01;
/// No pixel gets more than so many times the mean.
const MOST: f64 = 16.0;
/// How far around a pixel its neighbours are asked.
const REACH: i64 = 2;

/// How many samples each pixel shall get.
pub(crate) struct Plan {
    width: u32,
    /// Row by row; samples of both halves together, and so a multiple of the halves.
    targets: Vec<u32>,
    most: u64,
}

/// The samples that all pixels get before a plan can be made; `None`: too few altogether to adapt.
pub(crate) fn pilot(spp: u64) -> Option<u64> {
    let quarter = spp / 4;
    (quarter >= 4).then(|| 1 << quarter.ilog2())
}

impl Plan {
    /// From the sums of `pilot` samples of each pixel to as many samples altogether as `spp` of each pixel are.
    pub(crate) fn new(frame: &Frame, pilot: u64, spp: u64) -> Self {
        let (width, height) = (frame.desc().width, frame.desc().height);
        let noise = around(
            &frame.pixels().map(|(x, y)| relative_variance(frame, x, y)).collect::<Vec<_>>(),
            width,
            height,
        );
        let weights: Vec<f64> = noise.iter().map(|v| v.sqrt()).collect();
        let (least, most) = (pilot as f64, MOST * spp as f64);
        let budget = spp as f64 * weights.len() as f64;
        let granted = |factor: f64| weights.iter().map(|w| (factor * w).clamp(least, most)).sum::<f64>();
        // Σ grows with the factor: bisection, as many steps as an f64 has digits.
        let largest = weights.iter().copied().fold(0.0, f64::max);
        let (mut low, mut high) = (0.0, if largest > 0.0 { 1e6 * most / largest } else { 0.0 });
        for _ in 0..100 {
            let middle = 0.5 * (low + high);
            if granted(middle) > budget { high = middle } else { low = middle }
        }
        let step = u64::from(frame.halves() as u32) * (pilot / 4).max(1);
        let targets: Vec<u32> = weights
            .iter()
            .map(|w| {
                let n = (low * w).clamp(least, most) as u64;
                let rounded = (n + step / 2) / step * step;
                rounded.max(pilot).next_multiple_of(frame.halves() as u64).min(u64::from(u32::MAX - 1)) as u32
            })
            .collect();
        let most = targets.iter().copied().max().map_or(pilot, u64::from);
        Self { width, targets, most }
    }

    /// Samples of the pixel that gets most.
    pub(crate) const fn most(&self) -> u64 {
        self.most
    }

    /// Samples of one pixel.
    #[inline]
    pub(crate) fn target(&self, x: u32, y: u32) -> u64 {
        u64::from(self.targets[y as usize * self.width as usize + x as usize])
    }

    /// Samples of all pixels.
    pub(crate) fn total(&self) -> u64 {
        self.targets.iter().map(|t| u64::from(*t)).sum()
    }

    /// Pixels that get more than `done` samples.
    pub(crate) fn active(&self, done: u64) -> u64 {
        self.targets.iter().filter(|t| u64::from(**t) > done).count() as u64
    }

    /// Samples that numbers `start..end` are in a rectangle.
    pub(crate) fn samples(&self, rect: Rect, start: u64, end: u64) -> u64 {
        rect.pixels().map(|(x, y)| self.target(x, y)).map(|t| end.min(t).saturating_sub(start)).sum()
    }
}

/// Variance of one sample over (mean² + [`FLOOR`]), averaged over channels.
fn relative_variance(frame: &Frame, x: u32, y: u32) -> f64 {
    let film = frame.film_total(x, y);
    let n = film.samples as f64;
    let channel = |i: usize| {
        let mean = film.sum[i] / n;
        let variance = ((film.squares[i] - film.sum[i] * mean) / (n - 1.0)).max(0.0);
        // A mean that is too small by chance must not count twice.
        variance / (mean * mean + variance / n + FLOOR)
    };
    let v = (channel(0) + channel(1) + channel(2)) / 3.0;
    if v.is_finite() { v } else { 0.0 }
}

/// For each pixel the mean over the pixels around it, itself left out, the nearer ones weighing more.
fn around(values: &[f64], width: u32, height: u32) -> Vec<f64> {
    let (w, h) = (i64::from(width), i64::from(height));
    let mut result = Vec::with_capacity(values.len());
    for y in 0..h {
        for x in 0..w {
            let (mut sum, mut weights) = (0.0, 0.0);
            for dy in -REACH..=REACH {
                for dx in -REACH..=REACH {
                    let (i, j) = (x + dx, y + dy);
                    if (dx, dy) != (0, 0) && i >= 0 && j >= 0 && i < w && j < h {
                        let weight = 1.0 / (dx * dx + dy * dy) as f64;
                        sum += weight * values[(j * w + i) as usize];
                        weights += weight;
                    }
                }
            }
            result.push(if weights > 0.0 { sum / weights } else { values[(y * w + x) as usize] });
        }
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;
    use hotspot_cost::FrameDesc;

    /// A frame of `samples` samples whose radiance is 0 or 2·`level(x, y)`, half and half.
    fn frame(intervals: bool, samples: u32, level: impl Fn(u32, u32) -> f32) -> Frame {
        let mut frame = Frame::new(FrameDesc { intervals, cost: false, ..FrameDesc::new(40, 24) });
        let halves = frame.halves();
        for tile in frame.tiles_mut() {
            for (x, y) in tile.rect().pixels() {
                for i in 0..samples {
                    let radiance = if i / 2 % 2 == 0 { 0.0 } else { 2.0 * level(x, y) };
                    tile.film_mut(x, y, i as usize % halves).add([radiance; 3]);
                }
            }
        }
        frame
    }

    #[test]
    fn samples_go_where_the_noise_is_and_their_number_is_kept() {
        for intervals in [false, true] {
            let frame = frame(intervals, 16, |x, _| if x < 20 { 0.0 } else { 1.0 });
            let plan = Plan::new(&frame, 16, 64);
            assert_eq!(plan.target(2, 12), 16);
            assert!(plan.target(37, 12) > 100, "{}", plan.target(37, 12));
            let total = plan.total() as f64 / (64.0 * 40.0 * 24.0);
            assert!((total - 1.0).abs() < 0.03, "{total}");
            assert_eq!(plan.active(16), plan.targets.iter().filter(|t| **t > 16).count() as u64);
            assert!(plan.targets.iter().all(|t| t % (1 + u32::from(intervals)) == 0));
            let all = Rect { x: 0, y: 0, width: 40, height: 24 };
            assert_eq!(plan.samples(all, 0, plan.most()), plan.total());
        }
    }

    /// What makes the mean unbiased: a pixel's own samples have no say.
    #[test]
    fn a_pixel_has_no_say_in_its_own_samples() {
        let values: Vec<f64> = (0..63).map(|i| f64::from(i % 7)).collect();
        let mut changed = values.clone();
        changed[31] = 1e6;
        let (a, b) = (around(&values, 9, 7), around(&changed, 9, 7));
        assert_eq!(a[31], b[31]);
        assert_ne!(a[32], b[32]);
    }

    #[test]
    fn nothing_to_adapt_to_gives_equal_samples() {
        let plan = Plan::new(&frame(false, 16, |_, _| 0.0), 16, 64);
        assert_eq!(plan.most(), 16);
        let plan = Plan::new(&frame(false, 16, |_, _| 1.0), 16, 64);
        assert!(plan.targets.iter().all(|t| *t == 64), "{:?}", &plan.targets[..8]);
        assert_eq!([15, 16, 64, 100].map(pilot), [None, Some(4), Some(16), Some(16)]);
    }
}
