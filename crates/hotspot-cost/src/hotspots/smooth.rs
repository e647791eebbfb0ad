//! Smoothing within objects, with a lower bound.

use crate::student::{Variance, quantile};

/// Reach of the window on each side, in pixels.
const REACH: usize = 4;

/// The bound fails at one pixel in a thousand (a two-sided p-value of 0.002): with the usual one in forty, noise alone makes
/// a patch of 16 pixels in most pictures.
const TWO_SIDED: f64 = 0.002;

/// A bound that the true smoothed cost exceeds with 99.9 %: window mean − t·√Σ var / k over the k pixels of the window that
/// show the same object. `variances` holds Var of each pixel's mean: half² (pass `dof` 1) or s²/n (pass `dof` n − 1).
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
    // The window's degrees of freedom are rounded down, so that a small table of quantiles serves.
    let quantiles: Vec<f64> = (1..=200).map(|dof| quantile(TWO_SIDED, f64::from(dof))).collect();
    let mut out = Vec::with_capacity(cost.len());
    for_windows(width, height, objects, cost.len(), |window| {
        let mut variance = Variance::default();
        let (mut sum, mut count) = (0.0, 0.0);
        for index in window {
            sum += f64::from(cost[index]);
            variance.add(f64::from(variances[index]), dof);
            count += 1.0;
        }
        let t = quantiles[(variance.dof() as usize).clamp(1, quantiles.len()) - 1];
        out.push(((sum - t * variance.sum().sqrt()) / count) as f32);
    });
    out
}

/// Calls `each` for every pixel with the indices of its window.
fn for_windows(
    width: u32,
    height: u32,
    objects: &[u32],
    len: usize,
    mut each: impl FnMut(&mut dyn Iterator<Item = usize>),
) {
    let (width, height) = (width as usize, height as usize);
    assert_eq!(len, width * height, "the plane does not fit its size");
    assert!(objects.is_empty() || objects.len() == len, "the object plane does not fit its size");
    for y in 0..height {
        for x in 0..width {
            let centre = y * width + x;
            let columns = x.saturating_sub(REACH)..(x + REACH + 1).min(width);
            let rows = y.saturating_sub(REACH)..(y + REACH + 1).min(height);
            let mut window = rows
                .flat_map(|row| columns.clone().map(move |column| row * width + column))
                .filter(|index| objects.is_empty() || objects[*index] == objects[centre]);
            each(&mut window);
        }
    }
}
