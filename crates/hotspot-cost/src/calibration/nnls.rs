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
        // Columns in use, in the order in which they came; those that came out dependent or gave nothing wait until another
        // step has changed the residual.
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
            if s.last().is_some_and(|last| *last <= 0.0) {
                // Its gradient was rounding.
                taken.pop();
                waiting[new] = true;
                continue;
            }
            while s.iter().any(|value| *value <= 0.0) {
                // As far towards s as all stay non-negative; who reaches 0 leaves.
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
                if rest.is_nan() || rest < DEPENDENT {
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

    /// Where [`Gram::solve`] ends by itself it is at the optimum, whatever its inner step was; a wrong step shows as a cycle, which
    /// the bound on its rounds cuts short. So: twelve columns as alike as counters are, many bound at 0, and the conditions of
    /// Kuhn and Tucker, with the gradient in columns of unit length.
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
            let gram = gram(&rows);
            let beta = gram.solve();
            let residual: Vec<f64> =
                rows.iter().map(|(x, t)| t - x.iter().zip(&beta).map(|(x, b)| x * b).sum::<f64>()).collect();
            let size = rows.iter().map(|(_, t)| t * t).sum::<f64>().sqrt();
            for (k, b) in beta.iter().enumerate() {
                let length = rows.iter().map(|(x, _)| x[k] * x[k]).sum::<f64>().sqrt();
                let gradient =
                    rows.iter().zip(&residual).map(|((x, _), r)| x[k] * r).sum::<f64>() / (length * size);
                assert!(
                    *b >= 0.0 && gradient < 1e-9 && (*b == 0.0 || gradient > -1e-9),
                    "round {round}, column {k}: {b}, {gradient}"
                );
            }
        }
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
