//! The light that the depth limit keeps out of the picture.
//!
//! Two figures, one exact and one estimated:
//!
//! * **What was cut**: per path the throughput with which it reached the limit, a measure of importance rather than of light.
//!   It is exact but for noise, and says nothing of the light that the path would have met: a dark room and a bright one
//!   cut the same.
//! * **What was lost**: let D_k be the luminance that light scattered exactly k times brings to the picture (per camera
//!   sample). Far along paths D_k falls like a geometric series, whatever the scene: light transport is a linear operator
//!   applied again and again, and its largest eigenvalue outlives the others. With the limit at N, the last four terms give
//!   the decay over two scatterings, r² = (D_N + D_{N−1}) / (D_{N−2} + D_{N−3}), and what is missing is
//!   Σ_{k>N} D_k = (D_N + D_{N−1}) · r²/(1 − r²). Pairs, since glass alternates: one interface brings little, two much.
//!   With N = 2 or 3 there are not as many terms of scattered light (D_0 is what lights show of themselves), so
//!   r = D_N / D_{N−1}. Below that, and where r ≥ 1, there is no estimate.
//!
//! The estimate is exact in a furnace, where the series is geometric from its first term on. Elsewhere it is good once the
//! limit is a few times what the light needs to become even; where a part of the scene hardly seen decays more slowly than
//! the rest, it is too small. Roulette weighs what survives, so that neither figure depends on it but by noise.

use crate::frame::Frame;
use serde::{Deserialize, Serialize};

/// Terms before the limit that are kept.
pub(crate) const TERMS: usize = 4;

/// Sums of a pixel, or of one path.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DepthCut {
    /// Σ over paths that the limit ended of their throughput there, its largest component.
    pub throughput: f64,
    /// Σ luminance of light scattered N, N − 1, N − 2, N − 3 times, N the limit.
    pub last: [f64; TERMS],
}

impl DepthCut {
    /// Adds the sums of others.
    #[inline(always)]
    pub(crate) fn add(&mut self, other: &Self) {
        self.throughput += other.throughput;
        for (sum, value) in self.last.iter_mut().zip(other.last) {
            *sum += value;
        }
    }

    /// Adds light that could have been scattered `left` times more; whether that is among the terms kept.
    #[inline(always)]
    pub(crate) fn arrive(&mut self, left: u32, luminance: f32) -> bool {
        let term = self.last.get_mut(left as usize);
        let kept = term.is_some();
        if let Some(term) = term {
            *term += f64::from(luminance);
        }
        kept
    }
}

/// What the depth limit did to a picture. Means over pixels of what each shows per camera sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct DepthLoss {
    /// The limit: most scattering events of a path.
    pub max_depth: u32,
    /// Share of paths that the limit ended.
    pub paths: f64,
    /// Throughput cut per path, its largest component: 1 is what every path has at the camera.
    pub throughput: f64,
    /// Estimated luminance that is missing, per camera sample; absent where the last terms do not fall.
    pub lost: Option<f64>,
    /// `lost` as a share of what the picture would have without a limit.
    pub lost_share: Option<f64>,
    /// Decay of the luminance from one scattering to the next, at the limit.
    pub decay: Option<f64>,
}

/// Rec.709.
pub(crate) fn luminance(rgb: [f64; 3]) -> f64 {
    0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]
}

impl DepthLoss {
    /// Of a frame whose paths ended at `max_depth` scattering events at the latest. `None` without counted paths or without
    /// radiance.
    pub fn of(frame: &Frame, max_depth: u32) -> Option<Self> {
        let mut sums = DepthCut::default();
        let (mut paths, mut shown, mut pixels) = (0.0, 0.0, 0u64);
        for (x, y) in frame.pixels() {
            let film = frame.film_total(x, y);
            let (samples, cuts, cut) = frame.with_cost_total(x, y, |cost| {
                (cost.samples, cost.get(crate::Cause::DepthLimit.counter()), cost.cut)
            });
            if samples == 0 || film.samples == 0 {
                continue;
            }
            let per_path = 1.0 / samples as f64;
            paths += cuts as f64 * per_path;
            sums.throughput += cut.throughput * per_path;
            for (sum, value) in sums.last.iter_mut().zip(cut.last) {
                *sum += value * per_path;
            }
            shown += luminance(film.sum) / film.samples as f64;
            pixels += 1;
        }
        if pixels == 0 {
            return None;
        }
        let mean = |sum: f64| sum / pixels as f64;
        let series = tail(sums.last.map(mean), max_depth);
        let lost = series.map(|(lost, _)| lost);
        Some(Self {
            max_depth,
            paths: mean(paths),
            throughput: mean(sums.throughput),
            lost,
            lost_share: lost.map(|lost| if lost > 0.0 { lost / (lost + mean(shown)) } else { 0.0 }),
            decay: series.map(|(_, decay)| decay),
        })
    }
}

/// The sum of the terms after the last, and the decay from one to the next. `last`: D_N, D_{N−1}, D_{N−2}, D_{N−3}.
fn tail(last: [f64; TERMS], limit: u32) -> Option<(f64, f64)> {
    let [a, b, c, d] = last;
    // Terms at the end, as many before them, and how many those are.
    let (end, before, step) = match limit {
        0 | 1 => return None,
        2 | 3 => (a, b, 1.0),
        _ => (a + b, c + d, 2.0),
    };
    if end <= 0.0 {
        // No light came so far: none is missing, as far as the samples tell.
        return Some((0.0, 0.0));
    }
    let ratio = end / before;
    (ratio < 1.0).then(|| (end * ratio / (1.0 - ratio), ratio.powf(1.0 / step)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_geometric_series_is_summed_exactly() {
        for limit in [2, 3, 4, 15] {
            for rho in [0.1f64, 0.5, 0.9] {
                let last = core::array::from_fn(|back| 3.0 * rho.powi(limit as i32 - back as i32));
                let (lost, decay) = tail(last, limit).expect("it falls");
                let expected = 3.0 * rho.powi(limit as i32 + 1) / (1.0 - rho);
                assert!((lost / expected - 1.0).abs() < 1e-12 && (decay / rho - 1.0).abs() < 1e-12);
            }
        }
        // One in two terms is nothing: glass.
        let (lost, _) = tail([0.25, 0.0, 1.0, 0.0], 8).expect("it falls");
        assert!((lost - (0.0625 + 0.25 * 0.0625 / 0.75)).abs() < 1e-12, "{lost}");
    }

    #[test]
    fn what_does_not_fall_is_not_summed() {
        assert_eq!(tail([1.0; 4], 15), None);
        assert_eq!(tail([2.0, 2.0, 1.0, 1.0], 15), None);
        assert_eq!(tail([1.0, 0.0, 0.0, 0.0], 15), None);
        assert_eq!(tail([1.0, 2.0, 4.0, 8.0], 1), None);
        assert_eq!(tail([0.0; 4], 15), Some((0.0, 0.0)));
    }
}
