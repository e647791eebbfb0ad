//! Small statistics over planes: percentile, despiking, correlation and R², per pixel and per tile.
//!
//! Planes are row-major slices of width × height values, row 0 on top. Nothing here knows what a value means.

/// Edge of the tiles that [`tile_means`] averages and that comparisons test, in pixels.
pub const TILE: u32 = 8;

/// The `p`-th percentile (0 to 100) of the finite values, with linear interpolation between ranks (Hyndman and Fan 1996,
/// type 7: what NumPy does by default). 0 when there is no finite value; `p` outside 0 to 100 is clamped.
pub fn percentile(values: &[f32], p: f64) -> f32 {
    let mut finite: Vec<f32> = values.iter().copied().filter(|value| value.is_finite()).collect();
    if finite.is_empty() {
        return 0.0;
    }
    let position = (finite.len() - 1) as f64 * (p.clamp(0.0, 100.0) / 100.0);
    let below = position.floor() as usize;
    let (_, &mut low, rest) = finite.select_nth_unstable_by(below, f32::total_cmp);
    let Some(high) = rest.iter().copied().min_by(f32::total_cmp) else { return low };
    let fraction = position - below as f64;
    (f64::from(low) + (f64::from(high) - f64::from(low)) * fraction) as f32
}

/// Replaces every value above the `p`-th percentile (the paper's section 5: 99.9) by the median of its 3×3
/// neighbourhood, itself included; at the border by the median of what there is. Medians are taken over the values given,
/// not over ones already replaced; NaN counts as the largest and is replaced too. Returns the new plane and how many
/// values were replaced. A view's tool: never applied to stored data.
///
/// # Panics
/// When `values` does not hold width × height values.
pub fn despike(width: u32, height: u32, values: &[f32], p: f64) -> (Vec<f32>, usize) {
    let (width, height) = (width as usize, height as usize);
    assert_eq!(values.len(), width * height, "despike: the plane does not fit its size");
    let limit = percentile(values, p);
    let mut out = values.to_vec();
    let mut replaced = 0;
    for (index, value) in out.iter_mut().enumerate() {
        if *value <= limit {
            continue;
        }
        let (x, y) = (index % width, index / width);
        let mut window = [0.0; 9];
        let mut count = 0;
        for row in y.saturating_sub(1)..=(y + 1).min(height - 1) {
            for column in x.saturating_sub(1)..=(x + 1).min(width - 1) {
                window[count] = values[row * width + column];
                count += 1;
            }
        }
        let window = &mut window[..count];
        window.sort_unstable_by(f32::total_cmp);
        *value = if count % 2 == 1 {
            window[count / 2]
        } else {
            window[count / 2 - 1].midpoint(window[count / 2])
        };
        replaced += 1;
    }
    (out, replaced)
}

/// The median of the finite values, 0 without any.
pub fn median(values: &[f32]) -> f32 {
    percentile(values, 50.0)
}

/// Pearson's correlation of two planes, over the places where both are finite; `None` with fewer than two such places or
/// when either plane is constant there.
pub fn correlation(a: &[f32], b: &[f32]) -> Option<f64> {
    let pairs = || {
        a.iter()
            .zip(b)
            .filter(|(a, b)| a.is_finite() && b.is_finite())
            .map(|(a, b)| (f64::from(*a), f64::from(*b)))
    };
    let count = pairs().count();
    if count < 2 {
        return None;
    }
    // Two passes: the textbook formula with raw second moments cancels.
    let (sum_a, sum_b) = pairs().fold((0.0, 0.0), |(sa, sb), (a, b)| (sa + a, sb + b));
    let (mean_a, mean_b) = (sum_a / count as f64, sum_b / count as f64);
    let (aa, bb, ab) = pairs().fold((0.0, 0.0, 0.0), |(aa, bb, ab), (a, b)| {
        let (a, b) = (a - mean_a, b - mean_b);
        (aa + a * a, bb + b * b, ab + a * b)
    });
    if aa <= 0.0 || bb <= 0.0 {
        return None;
    }
    Some((ab / (aa.sqrt() * bb.sqrt())).clamp(-1.0, 1.0))
}

/// The share of the variance of `observed` that `predicted` explains: R² = 1 − Σ(o − p)² / Σ(o − mean)². At most 1, and
/// negative for a prediction worse than the mean; `None` when `observed` is constant or too short. For the R² of the best
/// straight line through two planes square [`correlation`].
pub fn r_squared(predicted: &[f32], observed: &[f32]) -> Option<f64> {
    let pairs = || {
        predicted
            .iter()
            .zip(observed)
            .filter(|(p, o)| p.is_finite() && o.is_finite())
            .map(|(p, o)| (f64::from(*p), f64::from(*o)))
    };
    let count = pairs().count();
    if count < 2 {
        return None;
    }
    let mean = pairs().map(|(_, o)| o).sum::<f64>() / count as f64;
    let spread: f64 = pairs().map(|(_, o)| (o - mean) * (o - mean)).sum();
    let residual: f64 = pairs().map(|(p, o)| (o - p) * (o - p)).sum();
    (spread > 0.0).then(|| 1.0 - residual / spread)
}

/// The means over the 8×8 tiles of a plane, row by row from the top; tiles at the right and bottom border average what
/// they have. Smooths noise away before a correlation that should not be diluted by it.
///
/// # Panics
/// When `values` does not hold width × height values.
pub fn tile_means(width: u32, height: u32, values: &[f32]) -> Vec<f32> {
    assert_eq!(values.len(), width as usize * height as usize, "tile_means: the plane does not fit its size");
    let mut out = Vec::new();
    for y in (0..height).step_by(TILE as usize) {
        for x in (0..width).step_by(TILE as usize) {
            let (right, bottom) = (width.min(x.saturating_add(TILE)), height.min(y.saturating_add(TILE)));
            let mut sum = 0.0;
            for row in y..bottom {
                for column in x..right {
                    sum += f64::from(values[row as usize * width as usize + column as usize]);
                }
            }
            out.push((sum / f64::from((right - x) * (bottom - y))) as f32);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_interpolate_between_ranks() {
        let values = [4.0, 1.0, 3.0, 2.0, f32::NAN, f32::INFINITY];
        assert_eq!(percentile(&values, 0.0), 1.0);
        assert_eq!(percentile(&values, 100.0), 4.0);
        assert_eq!(percentile(&values, 50.0), 2.5);
        assert_eq!(percentile(&values, 25.0), 1.75);
        assert_eq!(percentile(&[7.0], 99.9), 7.0);
        assert_eq!(percentile(&[], 50.0), 0.0);
    }

    #[test]
    fn despiking_touches_only_what_is_above_the_percentile() {
        let mut values: Vec<f32> = (0..2000).map(|i| (i % 10) as f32).collect();
        values[5 * 50 + 7] = 1000.0;
        let (out, replaced) = despike(50, 40, &values, 99.9);
        // Two of 2000 values would be above the 99.9th percentile, but the ties at 9 are not above it.
        assert_eq!(replaced, 1);
        // The neighbourhood holds three columns 6, 7 (with the spike), 8.
        assert_eq!(out[5 * 50 + 7], 7.0);
        for (index, (new, old)) in out.iter().zip(&values).enumerate() {
            assert!(index == 5 * 50 + 7 || new == old);
        }
    }

    #[test]
    fn despiking_a_corner_uses_what_there_is() {
        let (out, replaced) = despike(2, 2, &[100.0, 1.0, 2.0, 3.0], 70.0);
        assert_eq!((out[0], replaced), (2.5, 1));
    }

    #[test]
    fn correlation_of_lines_and_of_nothing() {
        let a = [1.0, 2.0, 3.0, 4.0];
        assert!((correlation(&a, &[2.0, 4.0, 6.0, 8.0]).unwrap() - 1.0).abs() < 1e-12);
        assert!((correlation(&a, &[4.0, 3.0, 2.0, 1.0]).unwrap() + 1.0).abs() < 1e-12);
        assert_eq!(correlation(&a, &[1.0, -1.0, -1.0, 1.0]), Some(0.0));
        assert_eq!(correlation(&a, &[5.0; 4]), None);
        assert_eq!(correlation(&a[..1], &a[..1]), None);
    }

    #[test]
    fn r_squared_punishes_offsets_that_correlation_forgives() {
        let observed = [1.0, 2.0, 3.0, 4.0];
        assert_eq!(r_squared(&observed, &observed), Some(1.0));
        assert_eq!(r_squared(&[2.5; 4], &observed), Some(0.0));
        assert!(r_squared(&[11.0, 12.0, 13.0, 14.0], &observed).unwrap() < 0.0);
    }

    #[test]
    fn tiles_at_the_border_average_what_they_have() {
        let values: Vec<f32> = (0..10 * 9).map(|i| if i % 10 >= 8 { 5.0 } else { 1.0 }).collect();
        assert_eq!(tile_means(10, 9, &values), [1.0, 5.0, 1.0, 5.0]);
    }
}
