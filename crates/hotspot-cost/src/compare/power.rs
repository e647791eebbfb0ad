//! How many samples it takes to find a change.
//!
//! A test at 5 % finds a relative change δ in 80 % of runs when the standard error of the relative change is
//! δ/(z_0.975 + z_0.8) = δ/2.802 (two-sided; Student's distribution is close to normal with the hundreds of degrees of
//! freedom that a frame has). The sampling part falls with the number of samples n at least as 1/√n (scrambled Sobol points
//! do no worse than independent ones), the tree's part s_t does not fall at all. From a standard error s at n₀ samples:
//!
//! n = n₀ · s² / ((δ/2.802)² − s_t²)
//!
//! and where s_t ≥ δ/2.802 no number of samples will do: other trees will, or leaving the tree alone.

use super::Comparison;
use crate::metric::Metric;

/// z_0.975 + z_0.8.
pub const FOUND_IN_80_PERCENT: f64 = 1.959_964 + 0.841_621;

/// What it would take to find a change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Needed {
    /// About so many times the samples there are (below 1: fewer).
    Times(f64),
    /// More samples do not help: the tree noise alone hides it.
    TreeNoise,
}

impl Comparison {
    /// How many times as many samples would find a relative change of `change` (0.02 for 2 %) of this metric's total in 80 %
    /// of runs. `None` where there is no interval from halves.
    pub fn samples_to_find(&self, metric: Metric, change: f64) -> Option<Needed> {
        let total = self.totals.get(metric.name())?;
        let sampling = total.sampling_error?;
        let tree = total.tree_error.unwrap_or(0.0);
        Some(needed(sampling, tree, change))
    }
}

fn needed(sampling: f64, tree: f64, change: f64) -> Needed {
    let left = (change / FOUND_IN_80_PERCENT).powi(2) - tree * tree;
    if left <= 0.0 { Needed::TreeNoise } else { Needed::Times(sampling * sampling / left) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quadrupling_the_samples_halves_what_is_found() {
        let Needed::Times(at_2) = needed(0.01, 0.0, 0.02) else { panic!() };
        let Needed::Times(at_1) = needed(0.01, 0.0, 0.01) else { panic!() };
        assert!((at_1 / at_2 - 4.0).abs() < 1e-9);
        assert!((at_2 - (0.01 * 2.801_585 / 0.02_f64).powi(2)).abs() < 1e-9);
        assert_eq!(needed(0.01, 0.01, 0.02), Needed::TreeNoise);
        let Needed::Times(with_tree) = needed(0.01, 0.005, 0.02) else { panic!() };
        assert!(with_tree > at_2);
    }
}
