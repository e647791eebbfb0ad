//! Which tiles changed.

use crate::analysis::TILE;
use crate::student::Variance;

/// What was found, pixel by pixel.
pub(super) struct Tested {
    /// Whether the pixel's tile changed.
    pub(super) flags: Vec<bool>,
    /// The tile's p-value.
    pub(super) p_values: Vec<f32>,
}

/// Tests every 8 × 8 tile. `differences` holds for each pixel (b − a, half_b − half_a); `trees` the
/// standard deviation over trees of the tile's mean, in each pixel of it, with its degrees of freedom.
pub(super) fn test(width: u32, height: u32, differences: &[[f64; 2]], trees: &[(&[f32], f64)]) -> Tested {
    let (p_values, tile) = p_values(width, height, differences, trees);
    let limit = benjamini_hochberg(&p_values, super::FALSE_DISCOVERY_RATE);
    let of_pixels = || (0..differences.len()).map(|index| p_values[tile(index)]);
    Tested {
        flags: of_pixels().map(|p| p <= limit).collect(),
        p_values: of_pixels().map(|p| p as f32).collect(),
    }
}

/// The p-value of each tile, and the tile of a pixel.
pub(super) fn p_values(
    width: u32,
    height: u32,
    differences: &[[f64; 2]],
    trees: &[(&[f32], f64)],
) -> (Vec<f64>, impl Fn(usize) -> usize) {
    let columns = width.div_ceil(TILE);
    let tile = move |index: usize| {
        let (x, y) = (index as u32 % width, index as u32 / width);
        (y / TILE * columns + x / TILE) as usize
    };
    let mut sums = vec![(0.0, 0.0, Variance::default()); (columns * height.div_ceil(TILE)) as usize];
    // Of each tile: its last pixel and how many count.
    let mut counts = vec![(0, 0.0); sums.len()];
    for (index, [difference, half]) in differences.iter().enumerate() {
        let (sum, size, variance) = &mut sums[tile(index)];
        if difference.is_finite() && half.is_finite() {
            *sum += difference;
            *size += difference.abs();
            variance.add(half * half, 1.0);
            counts[tile(index)] = (index, counts[tile(index)].1 + 1.0);
        }
    }
    for ((_, _, variance), (pixel, count)) in sums.iter_mut().zip(counts) {
        for (plane, dof) in trees {
            let deviation = count * f64::from(plane[pixel]);
            if deviation.is_finite() {
                variance.add(deviation * deviation, *dof);
            }
        }
    }
    let p_values = sums
        .iter()
        .map(|(sum, size, variance)| {
            // What cancels to rounding noise is no change.
            if sum.abs() <= 1e-9 * size { 1.0 } else { variance.p_value(*sum) }
        })
        .collect();
    (p_values, tile)
}

/// The largest p-value to reject so that the expected share of false rejections stays at `rate`; below 0 when none is.
/// Sorted p-values: the last k with p_k ≤ rate·k/m.
pub(super) fn benjamini_hochberg(p_values: &[f64], rate: f64) -> f64 {
    let mut sorted = p_values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let count = sorted.len() as f64;
    sorted
        .iter()
        .enumerate()
        .rev()
        .find(|(index, p)| **p <= rate * (index + 1) as f64 / count)
        .map_or(-1.0, |(_, p)| *p)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn benjamini_hochberg_on_the_papers_example() {
        // Benjamini and Hochberg 1995, section 4: 15 p-values, of which the procedure rejects four at 5 %.
        let p = [
            0.0001, 0.0004, 0.0019, 0.0095, 0.0201, 0.0278, 0.0298, 0.0344, 0.0459, 0.3240, 0.4262, 0.5719,
            0.6528, 0.7590, 1.0,
        ];
        assert_eq!(benjamini_hochberg(&p, 0.05), 0.0095);
        assert_eq!(benjamini_hochberg(&[0.2, 0.9], 0.05), -1.0);
        assert_eq!(benjamini_hochberg(&[], 0.05), -1.0);
    }

    #[test]
    fn a_changed_tile_is_flagged_to_its_border_and_no_further() {
        let differences: Vec<[f64; 2]> = (0..20 * 12)
            .map(|index| {
                let (x, y) = (index % 20, index / 20);
                let half = if (x + y) % 2 == 0 { 0.1 } else { -0.1 };
                [if x >= 16 && y >= 8 { 1.0 } else { 0.0 } + half, half]
            })
            .collect();
        let flags = test(20, 12, &differences, &[]).flags;
        for (index, flag) in flags.iter().enumerate() {
            assert_eq!(*flag, index % 20 >= 16 && index / 20 >= 8, "pixel {index}");
        }
    }

    /// Tree noise hides what it explains, and no more.
    #[test]
    fn tree_noise_is_part_of_a_tiles_variance() {
        let differences: Vec<[f64; 2]> =
            (0..64).map(|index| [1.0, if index % 2 == 0 { 0.1 } else { -0.1 }]).collect();
        let p = |deviation: f32| p_values(8, 8, &differences, &[(&[deviation; 64], 4.0)]).0[0];
        assert!(p(0.0) < 1e-20 && p(0.05) < 1e-3 && p(1.0) > 0.3);
    }
}
