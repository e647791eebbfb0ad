//! Small cumulative distributions in whole units of a byte or two: a cache line holds all that a choice reads.
//!
//! Where each light choice goes to another table, what it costs are the lines that it misses, not what it computes. So
//! entries begin at whole units, 255 or 65 535 of them, and the probability of an entry is exactly the units that it spans:
//! rounded weights are as good to sample by as the weights themselves, as long as the density tells what was sampled. An
//! entry with any weight spans a unit at least. All entries are compared at once, which compilers turn into one or two
//! vector instructions. Inversion stays monotonic, so stratified numbers stay stratified.

/// A number of units, by which a distribution over as many as [`Unit::ALL`] is cut.
pub(super) trait Unit: Copy + Default + PartialOrd {
    /// Units of a distribution; the number must hold it.
    const ALL: u32;
    /// From at most [`Unit::ALL`].
    fn of(units: u32) -> Self;
    /// Rounded towards 0.
    fn below(units: f32) -> Self;
    /// Exactly.
    fn value(self) -> f32;
}

macro_rules! unit {
    ($type:ty) => {
        impl Unit for $type {
            const ALL: u32 = <$type>::MAX as u32;

            #[inline(always)]
            fn of(units: u32) -> Self {
                units as Self
            }

            #[inline(always)]
            fn below(units: f32) -> Self {
                units as Self
            }

            #[inline(always)]
            fn value(self) -> f32 {
                f32::from(self)
            }
        }
    };
}
unit!(u8);
unit!(u16);

/// A distribution over `N` entries (2 to 255): the units before each.
#[derive(Clone, Copy, Debug)]
pub(super) struct Steps<U, const N: usize>([U; N]);

/// An entry that a number chose.
#[derive(Clone, Copy, Debug)]
pub(super) struct Step {
    pub(super) index: usize,
    /// Where in it the number lies, in [0, 1).
    pub(super) rest: f32,
    pub(super) probability: f32,
}

impl<U: Unit, const N: usize> Steps<U, N> {
    /// In proportion to `weights` (at least 0), but for rounding to units. Without any weight, or if they sum to no finite
    /// number, the first entry gets everything.
    pub(super) fn new(weights: &[f32; N]) -> Self {
        let present = weights.iter().filter(|w| **w > 0.0).count() as u32;
        let total: f64 = weights.iter().map(|w| f64::from(*w)).sum();
        if !(total > 0.0 && total.is_finite()) {
            let mut steps = [U::of(U::ALL); N];
            steps[0] = U::default();
            return Self(steps);
        }
        let scale = f64::from(U::ALL - present) / total;
        let (mut before, mut seen) = (0.0, 0);
        let steps = weights.map(|weight| {
            // Half up: `round` is a call on processors without an instruction for it.
            let step = seen + (before * scale + 0.5) as u32;
            before += f64::from(weight);
            seen += u32::from(weight > 0.0);
            U::of(step.min(U::ALL))
        });
        Self(steps)
    }

    /// The entry that holds `u` (in [0, 1)); never one without weight.
    #[inline(always)]
    pub(super) fn sample(&self, u: f32) -> Step {
        // A product below the number of units may round to it.
        let at = (u * U::ALL as f32).min(U::ALL as f32 * (1.0 - f32::EPSILON));
        let whole = U::below(at);
        let index = usize::from(self.0[1..].iter().map(|step| u8::from(*step <= whole)).sum::<u8>());
        let (start, width) = self.span(index);
        Step {
            index,
            rest: ((at - start) / width).clamp(0.0, 1.0 - f32::EPSILON),
            probability: width * (1.0 / U::ALL as f32),
        }
    }

    /// The probability with which [`Steps::sample`] finds an entry.
    #[inline(always)]
    pub(super) fn probability(&self, index: usize) -> f32 {
        self.span(index).1 * (1.0 / U::ALL as f32)
    }

    /// Units before an entry, and in it.
    #[inline(always)]
    fn span(&self, index: usize) -> (f32, f32) {
        let start = self.0[index].value();
        let end = self.0.get(index + 1).map_or(U::ALL as f32, |end| end.value());
        (start, end - start)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chi_square::Random;

    /// Against a plain search, for numbers on and beside every boundary; spans are the weights to within rounding, and an
    /// entry is never chosen without weight, always found with it.
    fn check<U: Unit, const N: usize>() {
        let mut random = Random(7);
        let mut cases = vec![[1.0; N], [0.0; N], [0.0; N], [1e-9; N]];
        cases[1][N / 2] = 3.0;
        cases[2][N - 1] = 1e-30;
        cases[3][0] = 1e6;
        for zeros in [0.0, 0.5, 0.9] {
            for _ in 0..20 {
                cases.push(
                    [0.0; N].map(
                        |_: f32| {
                            if random.unit() < zeros { 0.0 } else { (random.unit() as f32).powi(4) }
                        },
                    ),
                );
            }
        }
        for odd in [0.0, f32::INFINITY, f32::NAN] {
            let steps = Steps::<U, N>::new(&[odd; N]);
            assert!((0..100).all(|i| steps.sample(i as f32 / 100.0).index == 0));
        }
        for weights in cases {
            let total: f64 = weights.iter().map(|w| f64::from(*w)).sum();
            if total == 0.0 {
                continue;
            }
            let steps = Steps::<U, N>::new(&weights);
            let mut sum = 0.0;
            let mut numbers: Vec<f32> = (0..500).map(|_| random.single()).collect();
            for (index, weight) in weights.iter().enumerate() {
                let probability = steps.probability(index);
                let off = f64::from(probability) - f64::from(*weight) / total;
                assert!(off.abs() <= (N + 1) as f64 / f64::from(U::ALL), "{index}: {off}");
                assert_eq!(probability > 0.0, *weight > 0.0, "{index}");
                sum += f64::from(probability);
                let start = steps.span(index).0 / U::ALL as f32;
                numbers.extend([start.next_down(), start, start.next_up()]);
            }
            assert!((sum - 1.0).abs() < 1e-6, "{sum}");
            numbers.extend([0.0, 1.0f32.next_down()]);
            for u in numbers.into_iter().filter(|u| (0.0..1.0).contains(u)) {
                let found = steps.sample(u);
                assert!(weights[found.index] > 0.0 && (0.0..1.0).contains(&found.rest), "{u}: {found:?}");
                assert_eq!(found.probability, steps.probability(found.index));
                let (start, width) = steps.span(found.index);
                let back = (start + found.rest * width) / U::ALL as f32;
                assert!((back - u).abs() < 1e-6, "{u}: {found:?}");
            }
        }
    }

    #[test]
    fn entries_span_their_weights() {
        check::<u8, 16>();
        check::<u8, 32>();
        check::<u16, 16>();
        check::<u16, 64>();
    }
}
