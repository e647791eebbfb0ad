//! Totals over a frame with their 95 % intervals, and an estimate of the picture's error.
//!
//! A frame's mean per path is M = Σ_p S_p / N: the sums of all pixels over the number of paths. With n_p paths in pixel p
//! and w_p = n_p/N, Var M = Σ w_p² Var(m_p), pixels being independent. What stands for Var(m_p):
//! - [`CiKind::Halves`]: half_p² = ((m_a − m_b)/2)², from two independently scrambled halves; unbiased for the mean, one
//!   degree of freedom per pixel. Where the halves differ in their samples it errs on the wide side; where a sampled pixel
//!   has an empty half, halves are not used at all. Nor are they where the halves of every pixel agree though their
//!   samples differ: a few pixels of few samples with rare exceptions do that by chance (in 15 % of renders of a tile of
//!   sky whose rays exceed one at two pixels, 8 samples each), and an interval of no width would be wrong for sure;
//! - [`CiKind::Conservative`]: s_p²/n_p with n_p − 1 degrees of freedom. Within one scrambled Sobol sequence samples are
//!   negatively correlated on the whole, so this is an upper bound. Pixels with one path each are treated as one
//!   stratum with the variance among them, which holds the differences between pixels too and is larger still.
//!
//! The interval is M ± t·√Var M, t the quantile of Student's distribution at Satterthwaite's degrees of freedom: exact
//! when pixel means are normal, and close for frames of a few hundred pixels whatever they are. Sample counts are taken
//! as given: if they were chosen by what the samples showed (adaptive sampling), intervals come out slightly narrow.

pub use crate::expected_error::estimated_relmse;
use crate::frame::Frame;
use crate::layers::{mean, variance_of_mean};
use crate::metric::{CostModel, Metric, Sum};
use crate::metric_set::MetricSet;
use crate::recorder::{CostPixel, Rect};
use crate::student::Variance;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Where an interval comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CiKind {
    /// Two independent halves of the samples.
    Halves,
    /// s²/n, an upper bound.
    Conservative,
    /// Interleaved repeats: of time alone.
    Repeats,
    /// There is none.
    #[default]
    None,
}

/// A metric over the whole frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Total {
    /// Σ over all paths; an exact integer for counts.
    pub sum: Sum,
    /// Per path: sum / samples.
    pub mean: f64,
    /// 95 % interval of the mean.
    pub ci95: Option<[f64; 2]>,
    /// Where it comes from.
    pub ci_kind: CiKind,
}

/// The totals of the metrics chosen, by [`Metric::name`]. Time never gets an interval: repeats alone can give one. Works in the caller's
/// thread pool, a metric at a time.
pub fn totals(frame: &Frame, metrics: MetricSet, model: CostModel) -> BTreeMap<String, Total> {
    if !frame.desc().cost {
        return BTreeMap::new();
    }
    // Of two kinds: paths that were counted, and that were timed.
    let (counted, timed) = frame.costs().fold((0, 0), |(counted, timed), pixel| {
        (counted + Metric::Rays.samples(pixel), timed + Metric::TimeUs.samples(pixel))
    });
    let of = |metric: Metric| {
        let samples = if metric == Metric::TimeUs { timed } else { counted };
        (metric.name().to_owned(), total_over(frame, metric, model, samples))
    };
    let metrics: Vec<Metric> = metrics.iter().collect();
    metrics.into_par_iter().with_max_len(1).map(of).collect()
}

/// The total of one metric.
pub fn total(frame: &Frame, metric: Metric, model: CostModel) -> Total {
    total_over(frame, metric, model, frame.costs().map(|pixel| metric.samples(pixel)).sum())
}

/// The same over so many samples.
fn total_over(frame: &Frame, metric: Metric, model: CostModel, samples: u64) -> Total {
    let sum = metric.total(frame.costs(), model);
    with_interval(frame, || frame.pixels(), metric, model, sum, samples)
}

/// The total of one metric over a part of the frame (a tile, say), as far as it lies inside; the mean is per path there.
pub fn region(frame: &Frame, rect: Rect, metric: Metric, model: CostModel) -> Total {
    let whole = Rect { x: 0, y: 0, width: frame.desc().width, height: frame.desc().height };
    let part = whole.intersection(&rect);
    let costs: Vec<CostPixel> = part.pixels().map(|(x, y)| frame.cost_total(x, y)).collect();
    let sum = metric.total(costs.iter(), model);
    let samples: u64 = costs.iter().map(|pixel| metric.samples(pixel)).sum();
    with_interval(frame, || part.pixels(), metric, model, sum, samples)
}

/// The interval of a sum over some pixels.
fn with_interval<I: Iterator<Item = (u32, u32)>>(
    frame: &Frame,
    pixels: impl Fn() -> I,
    metric: Metric,
    model: CostModel,
    sum: Sum,
    samples: u64,
) -> Total {
    let mean = mean(sum.as_f64(), samples);
    let (variance, ci_kind) = if metric == Metric::TimeUs || samples == 0 {
        (None, CiKind::None)
    } else {
        let halves = halves_variance(frame, pixels(), metric, model, samples);
        let agree = halves.is_some_and(|variance| variance.sum() == 0.0);
        let conservative = if halves.is_none() || agree {
            conservative_variance(frame, pixels(), metric, model, samples)
        } else {
            None
        };
        match (halves, conservative) {
            // Halves agree by chance where samples differ.
            (_, Some(bound)) if !agree || bound.sum() > 0.0 => (Some(bound), CiKind::Conservative),
            (Some(variance), _) => (Some(variance), CiKind::Halves),
            _ => (None, CiKind::None),
        }
    };
    let ci95 = variance.map(|variance| {
        let width = variance.half_width95();
        [mean - width, mean + width]
    });
    Total { sum, mean, ci95, ci_kind }
}

/// `None` without halves, and when a half of a sampled pixel is empty: that pixel's spread is unknown.
fn halves_variance(
    frame: &Frame,
    pixels: impl Iterator<Item = (u32, u32)>,
    metric: Metric,
    model: CostModel,
    samples: u64,
) -> Option<Variance> {
    if !frame.desc().intervals {
        return None;
    }
    let mut variance = Variance::default();
    for (x, y) in pixels {
        let halves = [0, 1].map(|half| {
            frame.cost(x, y, half).map_or((0.0, 0), |p| (metric.sum(p, model), metric.samples(p)))
        });
        if (halves[0].1 == 0) != (halves[1].1 == 0) {
            return None;
        }
        let weight = (halves[0].1 + halves[1].1) as f64 / samples as f64;
        let [a, b] = halves.map(|(sum, n)| mean(sum, n));
        let half = weight * 0.5 * (a - b);
        variance.add(half * half, 1.0);
    }
    Some(variance)
}

fn conservative_variance(
    frame: &Frame,
    pixels: impl Iterator<Item = (u32, u32)>,
    metric: Metric,
    model: CostModel,
    samples: u64,
) -> Option<Variance> {
    metric.squares(&CostPixel::default(), model)?;
    let mut variance = Variance::default();
    // The pixels with a single path: their count, sum, sum of squares.
    let mut lone = (0_u64, 0.0, 0.0);
    for (x, y) in pixels {
        let (sum, squares, paths) = frame.with_cost_total(x, y, |pixel| {
            (metric.sum(pixel, model), metric.squares(pixel, model), pixel.samples)
        });
        let squares = squares?;
        match variance_of_mean(sum, squares, paths) {
            Some(of_mean) => {
                let weight = paths as f64 / samples as f64;
                variance.add(weight * weight * of_mean, (paths - 1) as f64);
            }
            None if paths == 1 => lone = (lone.0 + 1, lone.1 + sum, lone.2 + squares),
            None => {}
        }
    }
    match lone.0 {
        0 => {}
        // A stratum of one says nothing about its spread: its square bounds it.
        1 => variance.add(lone.2 / (samples as f64 * samples as f64), 1.0),
        count => {
            let of_mean = variance_of_mean(lone.1, lone.2, count)?;
            let weight = count as f64 / samples as f64;
            variance.add(weight * weight * of_mean, (count - 1) as f64);
        }
    }
    Some(variance)
}

#[cfg(test)]
mod tests;
