//! What a view shows of a plane: its scale, what lies outside it, and what was despiked.

use crate::analysis::{self, percentile};

/// Percentile above which views clip unless told otherwise.
pub const DEFAULT_CLIP: f64 = 99.9;

/// Percentile above which a despiked view takes the 3×3 median (the paper, §5).
const DESPIKE_PERCENTILE: f64 = 99.9;

/// A despiked view also replaces values above this many times the median of their 3×3 neighbourhood: on a busy machine
/// more than one pixel in a thousand was interrupted, and the percentile lies among the spikes.
pub const SPIKE: f32 = 10.0;

/// How the ends of the colour scale are found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Scale {
    /// From the values. Sequential: up to the given percentile of the finite values, and down to 0, or to the smallest
    /// value where that is above a quarter of the upper end (so that a flat map keeps contrast) or negative.
    /// Diverging: plus and minus the percentile of the absolute values. A percentile of 100 clips nothing.
    Auto {
        /// In percent, 0..=100.
        clip_percentile: f64,
    },
    /// Given lower and upper end, so that pictures compare; a diverging view takes the larger absolute of both. Ends
    /// that are not finite count as `Auto`.
    Fixed(f32, f32),
}

impl Default for Scale {
    fn default() -> Self {
        Self::Auto { clip_percentile: DEFAULT_CLIP }
    }
}

/// A plane as it is shown.
#[derive(Clone, Debug)]
pub struct View {
    /// The values drawn: the plane's own but for the despiked pixels. Exactly `width × height` of [`View::size`].
    pub values: Vec<f32>,
    /// Columns and rows that the plane really holds.
    pub size: (u32, u32),
    /// Lower end of the scale.
    pub lo: f32,
    /// Upper end of the scale, above `lo`.
    pub hi: f32,
    /// Percentile that set the scale; `None` when it was fixed or nothing needed clipping.
    pub clip_percentile: Option<f64>,
    /// Finite pixels outside the scale, drawn in the colour of its end.
    pub clipped: usize,
    /// Pixels replaced by the median of their 3×3 neighbourhood.
    pub despiked: usize,
    /// Value above which pixels were despiked; infinite when none were to be.
    pub despike_above: f32,
    /// Of these, pixels that stood out of their 3×3 neighbourhood alone: above [`SPIKE`] times its median.
    pub spikes: usize,
    /// Pixels that are not numbers or infinite.
    pub nonfinite: usize,
}

/// Prepares a row-major plane for display; `diverging` makes the scale symmetric about zero.
pub fn view(width: u32, height: u32, values: &[f32], scale: Scale, despike: bool, diverging: bool) -> View {
    let size = actual_size(width, height, values.len());
    let mut values = values[..size.0 as usize * size.1 as usize].to_vec();
    let mut despike_above = f32::INFINITY;
    let (mut despiked, mut spikes) = (0, 0);
    if despike {
        despike_above = percentile(&values, DESPIKE_PERCENTILE);
        (values, despiked) = despiked_plane(size, &values, despike_above);
        (values, spikes) = without_spikes(size, &values);
        despiked += spikes;
    }
    let (lo, hi, clip_percentile) = ends(&values, scale, diverging);
    let outside = |v: &&f32| v.is_finite() && (**v < lo || **v > hi);
    let clipped = values.iter().filter(outside).count();
    let nonfinite = values.iter().filter(|v| !v.is_finite()).count();
    View { size, lo, hi, clip_percentile, clipped, despiked, spikes, despike_above, nonfinite, values }
}

/// The part of a picture for which there are values.
pub(crate) fn actual_size(width: u32, height: u32, len: usize) -> (u32, u32) {
    let rows = len.checked_div(width as usize).unwrap_or(0).min(height as usize) as u32;
    if rows == 0 { (0, 0) } else { (width, rows) }
}

/// The despiked plane and how many pixels that altered; what is not finite stays, to be seen.
fn despiked_plane((width, height): (u32, u32), values: &[f32], above: f32) -> (Vec<f32>, usize) {
    let (mut plane, _) = analysis::despike(width, height, values, DESPIKE_PERCENTILE);
    let mut altered = 0;
    for (new, old) in plane.iter_mut().zip(values) {
        if new.is_finite() && old.is_finite() {
            altered += usize::from(*old > above);
        } else {
            *new = *old;
        }
    }
    (plane, altered)
}

/// The plane with every value above [`SPIKE`] times the positive median of the finite values in its 3×3 neighbourhood
/// replaced by that, and how many were. `viewer.js` does the same.
fn without_spikes((width, height): (u32, u32), values: &[f32]) -> (Vec<f32>, usize) {
    let (width, height) = (width as usize, height as usize);
    let mut out = values.to_vec();
    let mut replaced = 0;
    for (index, new) in out.iter_mut().enumerate().filter(|(_, value)| value.is_finite() && **value > 0.0) {
        let (x, y) = (index % width, index / width);
        let mut window = [0.0; 9];
        let mut count = 0;
        let mut below = 0;
        for row in y.saturating_sub(1)..(y + 2).min(height) {
            for column in x.saturating_sub(1)..(x + 2).min(width) {
                let value = values[row * width + column];
                if value.is_finite() {
                    below += usize::from(value * SPIKE < *new);
                    window[count] = value;
                    count += 1;
                }
            }
        }
        // Of the median only whether it is that far below matters, which half of the window decides.
        if 2 * below < count {
            continue;
        }
        let window = &mut window[..count];
        window.sort_unstable_by(f32::total_cmp);
        let middle = if count % 2 == 1 {
            window[count / 2]
        } else {
            window[count / 2 - 1].midpoint(window[count / 2])
        };
        if middle > 0.0 && *new > SPIKE * middle {
            *new = middle;
            replaced += 1;
        }
    }
    (out, replaced)
}

/// Lower end, upper end, and the percentile that set them.
fn ends(values: &[f32], scale: Scale, diverging: bool) -> (f32, f32, Option<f64>) {
    let clip = match scale {
        Scale::Fixed(a, b) if a.is_finite() && b.is_finite() => {
            let (lo, hi) = if diverging {
                let reach = a.abs().max(b.abs());
                (-reach, reach)
            } else {
                (a.min(b), a.max(b))
            };
            return (lo, if hi > lo { hi } else { above(lo) }, None);
        }
        Scale::Fixed(..) => DEFAULT_CLIP,
        Scale::Auto { clip_percentile } if clip_percentile.is_nan() => DEFAULT_CLIP,
        Scale::Auto { clip_percentile } => clip_percentile,
    };
    let finite = || values.iter().copied().filter(|v| v.is_finite());
    let max = finite().fold(f32::NEG_INFINITY, f32::max);
    let min = finite().fold(f32::INFINITY, f32::min);
    if diverging {
        let largest = max.abs().max(min.abs());
        let sizes: Vec<f32> = finite().map(f32::abs).collect();
        let reach = Some(percentile(&sizes, clip)).filter(|v| *v > 0.0).unwrap_or(largest);
        // Half the largest f32 keeps the width of the scale finite.
        let reach = if reach > 0.0 && reach.is_finite() { reach.min(f32::MAX / 2.0) } else { 1.0 };
        return (-reach, reach, (reach < largest && largest.is_finite()).then_some(clip));
    }
    if min > max {
        return (0.0, 1.0, None);
    }
    let hi = percentile(values, clip);
    // A map that is zero but for a few pixels would vanish: show those then.
    let hi = if hi > min { hi } else { max };
    let lo = if min < 0.0 || min > hi / 4.0 { min } else { 0.0 };
    let (lo, hi) = if hi > lo {
        (lo, hi)
    } else if hi > 0.0 {
        (0.0, hi)
    } else {
        (hi, above(hi))
    };
    (lo.max(f32::MIN / 2.0), hi.min(f32::MAX / 2.0), (hi < max).then_some(clip))
}

/// A value above `lo` by a visible amount.
fn above(lo: f32) -> f32 {
    lo + (lo.abs() / 2.0).max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clips_at_the_percentile_and_counts() {
        let values: Vec<f32> = (1..=2000).map(|i| i as f32).collect();
        let v = view(50, 40, &values, Scale::default(), false, false);
        assert_eq!((v.lo, v.hi, v.clip_percentile, v.clipped), (0.0, 1998.001, Some(99.9), 2));
        let all = view(50, 40, &values, Scale::Auto { clip_percentile: 100.0 }, false, false);
        assert_eq!((all.hi, all.clip_percentile, all.clipped), (2000.0, None, 0));
        let fixed = view(50, 40, &values, Scale::Fixed(11.0, 1990.0), false, false);
        assert_eq!((fixed.clip_percentile, fixed.clipped), (None, 20));
    }

    #[test]
    fn flat_maps_keep_contrast_and_constant_ones_a_scale() {
        let all = Scale::Auto { clip_percentile: 100.0 };
        let v = view(2, 1, &[8.0, 10.0], all, false, false);
        assert_eq!((v.lo, v.hi), (8.0, 10.0));
        for (value, want) in [(7.0, (0.0, 7.0)), (0.0, (0.0, 1.0)), (-2.0, (-2.0, -1.0))] {
            let v = view(2, 2, &[value; 4], Scale::default(), false, false);
            assert_eq!((v.lo, v.hi, v.clipped), (want.0, want.1, 0));
        }
        let mut sparse = vec![0.0; 10_000];
        sparse[5] = 3.0;
        let v = view(100, 100, &sparse, Scale::default(), false, false);
        assert_eq!((v.lo, v.hi, v.clipped, v.clip_percentile), (0.0, 3.0, 0, None));
    }

    #[test]
    fn diverging_is_symmetric() {
        let all = Scale::Auto { clip_percentile: 100.0 };
        let v = view(4, 1, &[-1.0, 0.0, 2.0, f32::NAN], all, false, true);
        assert_eq!((v.lo, v.hi, v.nonfinite), (-2.0, 2.0, 1));
        let v = view(4, 1, &[0.0; 4], Scale::default(), false, true);
        assert_eq!((v.lo, v.hi), (-1.0, 1.0));
        let v = view(1, 1, &[0.0], Scale::Fixed(-1.0, 5.0), false, true);
        assert_eq!((v.lo, v.hi), (-5.0, 5.0));
    }

    #[test]
    fn despikes_only_above_the_percentile() {
        let mut values: Vec<f32> = vec![2.0; 10_000];
        values[5050] = 1000.0;
        values[0] = 900.0;
        values[7] = f32::NAN;
        let v = view(100, 100, &values, Scale::default(), true, false);
        assert_eq!((v.despiked, v.despike_above, v.nonfinite), (2, 2.0, 1));
        assert_eq!((v.values[5050], v.values[0], v.values[1]), (2.0, 2.0, 2.0));
    }

    #[test]
    fn a_busy_machines_spikes_do_not_set_the_scale() {
        // Two pixels in a hundred wait for 1 to 20 ms, the others take about 2 µs.
        let mut random = crate::testing::Random::new(5);
        let values: Vec<f32> = (0..200 * 100)
            .map(|_| {
                let spike = random.below(50) == 0;
                2.0 + random.unit() as f32
                    + if spike { 1000.0 + 19_000.0 * random.unit() as f32 } else { 0.0 }
            })
            .collect();
        let spikes = values.iter().filter(|value| **value > 100.0).count();
        let v = view(200, 100, &values, Scale::default(), true, false);
        assert!(v.hi < 4.0, "{}", v.hi);
        assert!(
            v.despiked >= spikes && v.spikes > 300 && v.despiked < spikes + 20,
            "{} {spikes}",
            v.despiked
        );
        assert!(view(200, 100, &values, Scale::default(), false, false).hi > 1000.0);
        let notes = super::super::legend::notes(&v).join("\n");
        assert!(notes.contains("10 times their 3x3 median"), "{notes}");
    }

    #[test]
    fn hostile_sizes_and_values() {
        for scale in
            [Scale::default(), Scale::Fixed(f32::NAN, 1.0), Scale::Auto { clip_percentile: f64::NAN }]
        {
            for diverging in [false, true] {
                for values in
                    [&[][..], &[f32::NAN; 6], &[f32::INFINITY; 6], &[f32::MIN, f32::MAX, 0.0, 1.0, 2.0, 3.0]]
                {
                    for (w, h) in [(0, 0), (3, 2), (u32::MAX, u32::MAX), (2, 100), (0, 5)] {
                        let v = view(w, h, values, scale, true, diverging);
                        assert!(v.hi > v.lo && (v.hi - v.lo).is_finite(), "{v:?}");
                        assert_eq!(v.values.len(), v.size.0 as usize * v.size.1 as usize);
                    }
                }
            }
        }
    }
}
