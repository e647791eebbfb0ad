//! How many samples it takes to find a change.
//!
//! A test at 5 % finds a relative change δ in 80 % of runs when the standard error of the relative change is
//! δ/(t_0.975 + t_0.8), two-sided, with Student's quantiles at the error's degrees of freedom ν (z_0.975 + z_0.8 = 2.802
//! for many). The sampling part of the error falls with the number of samples n at least as 1/√n (scrambled Sobol points do
//! no worse than independent ones), the tree's part s_t does not fall at all. From a standard error s at n₀ samples:
//!
//! n = n₀ · s² / ((δ/(t_0.975 + t_0.8))² − s_t²)
//!
//! and where s_t is too large no number of samples will do: other trees will, or leaving the tree alone. With shared random
//! numbers most paths are the same on both sides and the error stems from the few that are not; fewer samples have fewer of
//! them, so below n₀ we take ν in proportion to n; above n₀ as it is, which is on the safe side.

use super::Comparison;
use crate::metric::Metric;
use crate::student;

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
        Some(needed(sampling, total.sampling_dof.unwrap_or(f64::INFINITY), tree, change))
    }
}

fn needed(sampling: f64, dof: f64, tree: f64, change: f64) -> Needed {
    let with = |dof: f64| {
        let quantiles = student::quantile(0.05, dof) + student::quantile(0.4, dof);
        let left = (change / quantiles).powi(2) - tree * tree;
        if left <= 0.0 { None } else { Some(sampling * sampling / left) }
    };
    let Some(mut times) = with(dof) else { return Needed::TreeNoise };
    // n on the right side too: more samples, more degrees of freedom, fewer samples. Bisection of n − with(ν₀·n) keeps to
    // the larger end, where both hold.
    if times < 1.0 {
        let (mut low, mut high) = (times, 1.0);
        for _ in 0..40 {
            times = 0.5 * (low + high);
            if with((dof * times).max(1.0)).is_some_and(|wanted| wanted <= times) {
                high = times;
            } else {
                low = times;
            }
        }
        times = high;
    }
    Needed::Times(times)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quadrupling_the_samples_halves_what_is_found() {
        let Needed::Times(at_2) = needed(0.01, 1e6, 0.0, 0.02) else { panic!() };
        let Needed::Times(at_1) = needed(0.01, 1e6, 0.0, 0.01) else { panic!() };
        assert!((at_1 / at_2 - 4.0).abs() < 1e-5);
        assert!((at_2 - (0.01 * 2.801_585 / 0.02_f64).powi(2)).abs() < 1e-5);
        assert_eq!(needed(0.01, 1e6, 0.01, 0.02), Needed::TreeNoise);
        let Needed::Times(with_tree) = needed(0.01, 1e6, 0.005, 0.02) else { panic!() };
        assert!(with_tree > at_2);
        // Two degrees of freedom: 4.303 + 1.061 standard errors. Half the samples have one: 12.71 + 1.376 of them.
        let Needed::Times(at_few) = needed(0.01, 2.0, 0.0, 0.05) else { panic!() };
        assert!((at_few - (0.01 * 5.363_3 / 0.05_f64).powi(2)).abs() < 1e-4, "{at_few}");
        let Needed::Times(fewer) = needed(0.01, 2.0, 0.0, 0.2) else { panic!() };
        let quantiles =
            student::quantile(0.05, (2.0 * fewer).max(1.0)) + student::quantile(0.4, (2.0 * fewer).max(1.0));
        assert!((fewer - (0.01 * quantiles / 0.2_f64).powi(2)).abs() < 1e-6, "{fewer}");
    }
}
