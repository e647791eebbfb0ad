//! Smoothing within objects, with a lower bound.

use crate::student::{Variance, quantile};
use rayon::prelude::*;

/// Reach of the window on each side, in pixels.
const REACH: usize = 4;

/// The bound fails at one pixel in a thousand (a two-sided p-value of 0.002): with the usual one in forty, noise alone makes
/// a patch of 16 pixels in most pictures.
const TWO_SIDED: f64 = 0.002;

/// A bound that the true smoothed cost exceeds with 99.9 %: window mean − t·√Σ var / k over the k pixels of the window that
/// show the same object. `variances` holds Var of each pixel's mean: half² (pass `dof` 1) or s²/n (pass `dof` n − 1).
///
/// A variance that is NaN is unknown. A window with such a pixel takes the variance among its k costs for theirs, with
/// k − 1 degrees of freedom: that holds what truly differs between pixels too and errs on the wide side. A window of a
/// single such pixel has no bound: −∞. Works in the caller's thread pool.
///
/// # Panics
/// When a plane does not hold width × height values (`objects` may be empty).
pub fn smoothed_lower_bound(
    width: u32,
    height: u32,
    cost: &[f32],
    variances: &[f32],
    dof: f64,
    objects: &[u32],
) -> Vec<f32> {
    assert_eq!(cost.len(), variances.len(), "smoothed_lower_bound: planes differ in size");
    let (width, height) = (width as usize, height as usize);
    assert_eq!(cost.len(), width * height, "the plane does not fit its size");
    assert!(objects.is_empty() || objects.len() == cost.len(), "the object plane does not fit its size");
    // The window's degrees of freedom are rounded down, so that a small table of quantiles serves.
    let quantiles: Vec<f64> = (1..=200).map(|dof| quantile(TWO_SIDED, f64::from(dof))).collect();
    let t = |dof: f64| quantiles[(dof as usize).clamp(1, quantiles.len()) - 1];
    let row_of = |y: usize| -> Vec<f32> {
        let rows = y.saturating_sub(REACH)..(y + REACH + 1).min(height);
        let bound = |x: usize| {
            let own = objects.get(y * width + x);
            let columns = x.saturating_sub(REACH)..(x + REACH + 1).min(width);
            let mut window = Window::default();
            for row in rows.clone() {
                let span = row * width + columns.start..row * width + columns.end;
                let pixels = cost[span.clone()].iter().zip(&variances[span.clone()]);
                match own {
                    None => pixels.for_each(|(cost, variance)| window.add(*cost, *variance, dof)),
                    Some(own) => pixels
                        .zip(&objects[span])
                        .filter(|(_, object)| *object == own)
                        .for_each(|((cost, variance), _)| window.add(*cost, *variance, dof)),
                }
            }
            window.lower_bound(t)
        };
        (0..width).map(bound).collect()
    };
    (0..height).into_par_iter().flat_map_iter(row_of).collect()
}

/// The pixels of a window.
#[derive(Default)]
struct Window {
    count: f64,
    sum: f64,
    variance: Variance,
    /// A pixel's variance is unknown.
    unknown: bool,
    /// The first cost, and the sums of the others' differences from it: squares of the costs themselves would cancel.
    first: f64,
    differences: f64,
    squares: f64,
}

impl Window {
    #[inline]
    fn add(&mut self, cost: f32, variance: f32, dof: f64) {
        let cost = f64::from(cost);
        if self.count == 0.0 {
            self.first = cost;
        }
        self.count += 1.0;
        self.sum += cost;
        if variance.is_nan() {
            self.unknown = true;
        } else {
            self.variance.add(f64::from(variance), dof);
        }
        let difference = cost - self.first;
        self.differences += difference;
        self.squares += difference * difference;
    }

    fn lower_bound(&self, t: impl Fn(f64) -> f64) -> f32 {
        let (variance, dof) = if !self.unknown {
            (self.variance.sum(), self.variance.dof())
        } else if self.count >= 2.0 {
            let dof = self.count - 1.0;
            let residual = (self.squares - self.differences * self.differences / self.count).max(0.0);
            (self.count * residual / dof, dof)
        } else {
            return f32::NEG_INFINITY;
        };
        ((self.sum - t(dof) * variance.sqrt()) / self.count) as f32
    }
}
