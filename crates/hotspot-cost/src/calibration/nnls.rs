//! Non-negative least squares on normal equations: minimise Σ w·(t − x·β)² over β ≥ 0.
//!
//! The active-set method of Lawson and Hanson, *Solving Least Squares Problems* (1974), chapter 23, in the form of Bro and
//! De Jong, *A fast non-negativity-constrained least squares algorithm* (J. Chemometrics 11, 1997): only XᵀX and Xᵀt are
//! kept, so that resampling tiles means adding small matrices. A dozen columns are all there is: a Cholesky factorisation
//! is thirty lines, and a linear algebra crate would bring more code to review than the whole room.
//!
//! # Collinear columns
//! Columns and coefficients are not negative, so that each term's share of the fitted time, β_k·x̄_k, lies between 0 and the
//! whole: no coefficient can run away against another of the opposite sign, however ill-conditioned XᵀX is (non-negative
//! least squares regularise themselves: Slawski and Hein, Electronic Journal of Statistics 7, 2013). What collinearity
//! leaves undecided is which of two columns gets the time; the intervals show that. Only exact dependence needs a rule: a
//! column whose part that is orthogonal to the columns already taken has less than [`DEPENDENT`] of its length squared
//! stays out.

/// Share of a column's squared length below which it counts as a combination of others. Sums of n squares carry a relative
/// rounding error of at most n·2^-53, 1e-11 for 10^5 tiles: what is left of a dependent column is below that.
const DEPENDENT: f64 = 1e-10;

/// Weighted sums of products of rows (x, t): all that least squares needs to know.
#[derive(Clone, Debug)]
pub(super) struct Gram {
    columns: usize,
    /// Σ w·x_i·x_j, row by row.
    products: Vec<f64>,
    /// Σ w·x_i·t.
    targets: Vec<f64>,
}

impl Gram {
    pub(super) fn new(columns: usize) -> Self {
        Self { columns, products: vec![0.0; columns * columns], targets: vec![0.0; columns] }
    }

    /// Adds one row.
    pub(super) fn add(&mut self, x: &[f64], t: f64, weight: f64) {
        for (i, xi) in x.iter().enumerate().take(self.columns) {
            for (j, xj) in x.iter().enumerate().take(self.columns) {
                self.products[i * self.columns + j] += weight * xi * xj;
            }
            self.targets[i] += weight * xi * t;
        }
    }

    /// Adds the rows of another.
    pub(super) fn merge(&mut self, other: &Self) {
        for (sum, value) in self.products.iter_mut().zip(&other.products) {
            *sum += value;
        }
        for (sum, value) in self.targets.iter_mut().zip(&other.targets) {
            *sum += value;
        }
    }

    /// The same rows with some of their columns alone.
    pub(super) fn select(&self, columns: &[usize]) -> Self {
        let at = |i: usize, j: usize| self.products[i * self.columns + j];
        Self {
            columns: columns.len(),
            products: columns.iter().flat_map(|i| columns.iter().map(|j| at(*i, *j))).collect(),
            targets: columns.iter().map(|i| self.targets[*i]).collect(),
        }
    }

    /// The same rows with another target: a combination of their columns.
    pub(super) fn with_target(&self, weights: &[f64]) -> Self {
        let of = |i: usize| -> f64 {
            weights.iter().enumerate().map(|(j, w)| w * self.products[i * self.columns + j]).sum()
        };
        Self { targets: (0..self.columns).map(of).collect(), ..self.clone() }
    }

    /// The best coefficients that are not negative. Columns without length, and columns that depend on others, get 0.
    pub(super) fn solve(&self) -> Vec<f64> {
        let n = self.columns;
        let at = |i: usize, j: usize| self.products[i * n + j];
        // Columns of unit length: thresholds are shares then.
        let length: Vec<f64> = (0..n).map(|i| at(i, i).sqrt()).collect();
        let usable = |i: usize| length[i] > 0.0 && length[i].is_finite();
        let g = |i: usize, j: usize| at(i, j) / (length[i] * length[j]);
        let target: Vec<f64> =
            (0..n).map(|i| if usable(i) { self.targets[i] / length[i] } else { 0.0 }).collect();
        let largest = target.iter().fold(0.0f64, |m, t| m.max(t.abs()));
        let mut beta = vec![0.0; n];
        // Columns in use, in the order in which they came; those that came out dependent wait until another step has changed the
        // residual. One whose gradient was but rounding leaves again in the inner loop.
        let mut taken: Vec<usize> = Vec::new();
        let mut waiting = vec![false; n];
        // Each round takes one column in; Lawson and Hanson's proof bounds them, rounding could cycle.
        for _ in 0..10 * n {
            let gradient =
                |j: usize, beta: &[f64]| target[j] - taken.iter().map(|i| g(j, *i) * beta[*i]).sum::<f64>();
            let best = (0..n)
                .filter(|j| usable(*j) && !waiting[*j] && !taken.contains(j))
                .map(|j| (gradient(j, &beta), j))
                .filter(|(w, _)| *w > 1e-12 * largest)
                .fold(None, |best: Option<(f64, usize)>, next| match best {
                    Some(b) if b.0 >= next.0 => Some(b),
                    _ => Some(next),
                });
            let Some((_, new)) = best else { break };
            taken.push(new);
            let Some(mut s) = cholesky_solve(&taken, &g, &target) else {
                taken.pop();
                waiting[new] = true;
                continue;
            };
            while s.iter().any(|value| *value <= 0.0) {
                // As far towards s as all stay non-negative; who reaches 0 leaves.
                let before = if cfg!(debug_assertions) { objective(&beta, &g, &target) } else { 0.0 };
                let step = taken
                    .iter()
                    .zip(&s)
                    .filter(|(_, value)| **value <= 0.0)
                    .map(|(i, value)| beta[*i] / (beta[*i] - value))
                    .fold(1.0f64, f64::min);
                for (i, value) in taken.iter().zip(&s) {
                    beta[*i] += step * (value - beta[*i]);
                }
                let leaving = taken.iter().zip(&s).filter(|(_, value)| **value <= 0.0).map(|(i, _)| *i).fold(
                    None,
                    |least: Option<usize>, i| match least {
                        Some(l) if beta[l] <= beta[i] => Some(l),
                        _ => Some(i),
                    },
                );
                taken.retain(|i| Some(*i) != leaving && beta[*i] > 0.0);
                for (i, value) in beta.iter_mut().enumerate() {
                    if !taken.contains(&i) {
                        *value = 0.0;
                    }
                }
                // Lawson and Hanson's proof that rounds end rests on this.
                debug_assert!(
                    beta.iter().all(|b| *b >= 0.0)
                        && objective(&beta, &g, &target)
                            <= before + 1e-9 * (before.abs() + largest * largest),
                    "a step went up"
                );
                match cholesky_solve(&taken, &g, &target) {
                    Some(next) => s = next,
                    None => return unscaled(&beta, &length),
                }
            }
            for (i, value) in taken.iter().zip(&s) {
                beta[*i] = *value;
            }
            waiting.fill(false);
        }
        unscaled(&beta, &length)
    }
}

/// The sum of squares less that of t: what steps lessen.
fn objective(beta: &[f64], g: &impl Fn(usize, usize) -> f64, target: &[f64]) -> f64 {
    let used: Vec<usize> = (0..beta.len()).filter(|i| beta[*i] != 0.0).collect();
    let product = |i: usize| used.iter().map(|j| g(i, *j) * beta[*j]).sum::<f64>();
    used.iter().map(|i| beta[*i] * (product(*i) - 2.0 * target[*i])).sum()
}

fn unscaled(beta: &[f64], length: &[f64]) -> Vec<f64> {
    beta.iter().zip(length).map(|(b, l)| if *l > 0.0 && l.is_finite() { b / l } else { 0.0 }).collect()
}

/// Solves the normal equations of some columns of unit length; `None` when one depends on those before it.
fn cholesky_solve(columns: &[usize], g: &impl Fn(usize, usize) -> f64, target: &[f64]) -> Option<Vec<f64>> {
    let n = columns.len();
    // L·Lᵀ = G, row by row.
    let mut l = vec![0.0; n * n];
    for i in 0..n {
        for j in 0..=i {
            let inner: f64 = (0..j).map(|k| l[i * n + k] * l[j * n + k]).sum();
            let rest = g(columns[i], columns[j]) - inner;
            if i == j {
                if rest < DEPENDENT {
                    return None;
                }
                l[i * n + i] = rest.sqrt();
            } else {
                l[i * n + j] = rest / l[j * n + j];
            }
        }
    }
    let mut x: Vec<f64> = columns.iter().map(|i| target[*i]).collect();
    for i in 0..n {
        let inner: f64 = (0..i).map(|k| l[i * n + k] * x[k]).sum();
        x[i] = (x[i] - inner) / l[i * n + i];
    }
    for i in (0..n).rev() {
        let inner: f64 = (i + 1..n).map(|k| l[k * n + i] * x[k]).sum();
        x[i] = (x[i] - inner) / l[i * n + i];
    }
    Some(x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Random;

    fn gram(rows: &[(Vec<f64>, f64)]) -> Gram {
        let mut gram = Gram::new(rows[0].0.len());
        for (x, t) in rows {
            gram.add(x, *t, 1.0);
        }
        gram
    }

    fn loss(rows: &[(Vec<f64>, f64)], beta: &[f64]) -> f64 {
        rows.iter().map(|(x, t)| (t - x.iter().zip(beta).map(|(x, b)| x * b).sum::<f64>()).powi(2)).sum()
    }

    /// The best over every subset of columns whose unconstrained solution is not negative: brute force.
    fn every_subset(gram: &Gram, rows: &[(Vec<f64>, f64)]) -> f64 {
        let n = gram.columns;
        let mut best = loss(rows, &vec![0.0; n]);
        for subset in 1u32..1 << n {
            let columns: Vec<usize> = (0..n).filter(|i| subset >> i & 1 == 1).collect();
            let raw = |i: usize, j: usize| gram.products[i * n + j];
            let Some(x) = cholesky_solve(&columns, &raw, &gram.targets) else { continue };
            if x.iter().all(|value| *value >= 0.0) {
                let mut beta = vec![0.0; n];
                for (i, value) in columns.iter().zip(&x) {
                    beta[*i] = *value;
                }
                best = best.min(loss(rows, &beta));
            }
        }
        best
    }

    #[test]
    fn as_good_as_the_best_of_all_subsets() {
        let mut random = Random::new(3);
        let mut bound = 0;
        for round in 0..300 {
            let n = 2 + round % 6;
            let rows: Vec<(Vec<f64>, f64)> = (0..20)
                .map(|_| {
                    let common = random.normal();
                    ((0..n).map(|_| random.normal() + 2.0 * common).collect(), random.normal() + common)
                })
                .collect();
            let gram = gram(&rows);
            let beta = gram.solve();
            assert!(beta.iter().all(|b| *b >= 0.0), "{beta:?}");
            bound += beta.iter().filter(|b| **b == 0.0).count();
            let (found, best) = (loss(&rows, &beta), every_subset(&gram, &rows));
            assert!(found <= best * (1.0 + 1e-10), "round {round}: {found} against {best}");
        }
        assert!(bound > 300, "the bound was hardly ever met: {bound}");
    }

    /// The conditions of Kuhn and Tucker, which the optimum alone meets: no coefficient is negative, the gradient is 0 along those
    /// above 0 and leads nowhere along those at 0. In columns of unit length, over the size of t; rounding grows with the
    /// coefficients.
    fn assert_optimal(rows: &[(Vec<f64>, f64)], what: &str) {
        let beta = gram(rows).solve();
        let length: Vec<f64> =
            (0..beta.len()).map(|k| rows.iter().map(|(x, _)| x[k] * x[k]).sum::<f64>().sqrt()).collect();
        let size = rows.iter().map(|(_, t)| t * t).sum::<f64>().sqrt();
        let residual: Vec<f64> =
            rows.iter().map(|(x, t)| t - x.iter().zip(&beta).map(|(x, b)| x * b).sum::<f64>()).collect();
        let parts = beta.iter().zip(&length).map(|(b, l)| b * l).sum::<f64>() / size;
        let bound = 1e-10 * (1.0 + parts);
        for (k, b) in beta.iter().enumerate().filter(|(k, _)| length[*k] > 0.0) {
            let gradient =
                rows.iter().zip(&residual).map(|((x, _), r)| x[k] * r).sum::<f64>() / (length[k] * size);
            assert!(
                *b >= 0.0 && gradient < bound && (*b == 0.0 || gradient > -bound),
                "{what}, column {k}: {b}, {gradient} beyond {bound}"
            );
        }
    }

    /// Twelve columns as alike as counters are, many bound at 0.
    #[test]
    fn optimal_where_several_columns_leave_at_once() {
        let mut random = Random::new(17);
        for round in 0..4000 {
            let n = 4 + round % 9;
            let alike = [0.5, 2.0, 6.0][round % 3];
            let rows: Vec<(Vec<f64>, f64)> = (0..n + 4)
                .map(|_| {
                    let common = alike * random.normal();
                    ((0..n).map(|_| random.normal() + common).collect(), random.normal() + common)
                })
                .collect();
            assert_optimal(&rows, &format!("round {round}"));
        }
    }

    /// Columns that are copies, sums or nearly the opposite of others, or alike but for a part of 1e-3 (1e-6 of their length
    /// squared), in units from 1e-8 to 1e8.
    #[test]
    fn optimal_where_columns_depend_on_others() {
        let mut random = Random::new(23);
        for round in 0..4000 {
            let n = 5 + round % 7;
            let part = [1e-3, 1e-2, 0.3][round % 3];
            let unit: Vec<f64> = (0..n).map(|_| 10.0_f64.powi(random.below(17) as i32 - 8)).collect();
            let kinds: Vec<u32> = (0..n).map(|_| random.below(5)).collect();
            let rows: Vec<(Vec<f64>, f64)> = (0..2 * n)
                .map(|_| {
                    let mut x: Vec<f64> = Vec::new();
                    for (k, kind) in kinds.iter().enumerate() {
                        let fresh = random.normal();
                        x.push(match (kind, &x[..]) {
                            (1, [.., last]) => *last,
                            (2, [.., a, b]) => a + b,
                            // One of each at most: what is left of the second would be too small.
                            (3, [.., last]) if kinds[..k].iter().all(|k| *k != 3) => part * fresh - last,
                            (4, [.., last]) if kinds[..k].iter().all(|k| *k != 4) => part * fresh + last,
                            _ => fresh,
                        });
                    }
                    let t = random.normal() + x[0] + x[n - 1];
                    (x.iter().zip(&unit).map(|(x, unit)| x * unit).collect(), t)
                })
                .collect();
            assert_optimal(&rows, &format!("round {round}, {kinds:?}"));
        }
    }

    /// A column that all but depends on another is left out, others behind it are not.
    #[test]
    fn what_waits_does_not_hold_up_the_others() {
        // The third is the sum of the first two and 3e-6 of what nobody else has; the fourth gains less than that would.
        let rows = vec![
            (vec![1.0, 0.0, 1.0, 0.0], 1.0),
            (vec![0.0, 1.0, 1.0, 0.0], 0.1),
            (vec![0.0, 0.0, 3e-6, 0.0], 1.0),
            (vec![0.0, 0.0, 0.0, 1.0], 1e-7),
        ];
        for (found, expected) in gram(&rows).solve().iter().zip([1.0, 0.1, 0.0, 1e-7]) {
            assert!((found - expected).abs() < 1e-15, "{found} for {expected}");
        }
    }

    #[test]
    fn sums_are_those_of_the_rows() {
        let mut random = Random::new(31);
        let mut row = || ((0..4).map(|_| random.unit()).collect::<Vec<f64>>(), random.unit());
        let rows: Vec<_> = (0..12).map(|_| row()).collect();
        let close = |a: &Gram, b: &Gram| {
            let same = |a: &[f64], b: &[f64]| {
                a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12)
            };
            assert!(a.columns == b.columns && same(&a.products, &b.products) && same(&a.targets, &b.targets));
        };
        // A weight of 2 is the row twice; merging is adding.
        let (mut weighted, mut merged) = (Gram::new(4), gram(&rows));
        for (i, (x, t)) in rows.iter().enumerate() {
            weighted.add(x, *t, if i < 5 { 2.0 } else { 1.0 });
        }
        merged.merge(&gram(&rows[..5]));
        close(&weighted, &merged);
        let part = |x: &[f64]| vec![x[3], x[1]];
        let selected: Vec<_> = rows.iter().map(|(x, t)| (part(x), *t)).collect();
        close(&gram(&rows).select(&[3, 1]), &gram(&selected));
        let b = [2.0, 0.0, 0.5, 7.0];
        let other: Vec<_> =
            rows.iter().map(|(x, _)| (x.clone(), x.iter().zip(b).map(|(x, b)| x * b).sum())).collect();
        close(&gram(&rows).with_target(&b), &gram(&other));
    }

    #[test]
    fn recovers_what_made_the_rows() {
        let mut random = Random::new(5);
        let truth = [3.0, 0.0, 0.25, 40.0];
        let rows: Vec<(Vec<f64>, f64)> = (0..50)
            .map(|_| {
                let x: Vec<f64> = [1.0, 10.0, 100.0, 0.01].map(|scale| scale * random.unit()).into();
                let t = x.iter().zip(truth).map(|(x, b)| x * b).sum();
                (x, t)
            })
            .collect();
        for (found, truth) in gram(&rows).solve().iter().zip(truth) {
            assert!((found - truth).abs() < 1e-6 * (1.0 + truth), "{found} for {truth}");
        }
    }

    #[test]
    fn dependent_empty_and_broken_columns_do_no_harm() {
        let mut random = Random::new(9);
        let rows: Vec<(Vec<f64>, f64)> = (0..100)
            .map(|_| {
                let (a, b) = (random.unit(), random.unit());
                // The third is the sum of the first two, the fourth is empty, the fifth a copy.
                (vec![a, b, a + b, 0.0, a], 2.0 * a + 5.0 * b)
            })
            .collect();
        let beta = gram(&rows).solve();
        assert!(loss(&rows, &beta) < 1e-12, "{beta:?}");
        assert!(beta.iter().all(|b| b.is_finite() && *b >= 0.0) && beta[3] == 0.0);
        let broken = vec![(vec![f64::NAN, 1.0], 2.0), (vec![f64::INFINITY, 1.0], 2.0)];
        let beta = gram(&broken).solve();
        assert!(beta.iter().all(|b| b.is_finite()), "{beta:?}");
        assert_eq!(Gram::new(3).solve(), [0.0; 3]);
    }
}
