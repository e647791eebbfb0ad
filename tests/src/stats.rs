//! The statistics that decide: Student's t, Satterthwaite's degrees of freedom, Šidák's correction, slopes.
//!
//! Written apart from `hotspot-cost`, so that the two check each other.

/// Two-sided p-value of Student's t: P(|T| ≥ |t|) = I_x(ν/2, 1/2) with x = ν/(ν + t²) (Abramowitz and Stegun 26.7.1).
pub fn p_value(t: f64, dof: f64) -> f64 {
    if t.is_nan() {
        return 1.0;
    }
    if t.is_infinite() {
        return 0.0;
    }
    incomplete_beta(0.5 * dof, 0.5, dof / (dof + t * t))
}

/// The t whose two-sided p-value is `p`.
pub fn quantile(p: f64, dof: f64) -> f64 {
    let (mut low, mut high) = (0.0, 1e6);
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if p_value(middle, dof) > p {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// The level of each of `tests` tests that keeps the rate of any false alarm at `family` (Šidák 1967; exact for
/// independent tests, on the safe side for positively dependent ones).
pub fn sidak(family: f64, tests: usize) -> f64 {
    -f64::exp_m1(f64::ln_1p(-family) / tests.max(1) as f64)
}

/// A sum of independent variance estimates with Satterthwaite's (1946) degrees of freedom of the sum.
#[derive(Clone, Copy, Debug, Default)]
pub struct Variance {
    /// The variance.
    pub sum: f64,
    fourth: f64,
}

impl Variance {
    /// Adds an estimate.
    pub fn add(&mut self, variance: f64, dof: f64) {
        self.sum += variance;
        self.fourth += variance * variance / dof;
    }

    /// Degrees of freedom of the sum, at least 1.
    pub fn dof(&self) -> f64 {
        if self.fourth > 0.0 { (self.sum * self.sum / self.fourth).max(1.0) } else { 1.0 }
    }

    /// Standard deviation.
    pub fn sigma(&self) -> f64 {
        self.sum.sqrt()
    }

    /// Two-sided p-value of `difference` against 0; 1 for no difference, also without any variance.
    pub fn p_value(&self, difference: f64) -> f64 {
        if difference == 0.0 { 1.0 } else { p_value(difference / self.sigma(), self.dof()) }
    }
}

/// Mean and variance of that mean.
pub fn mean_and_variance(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|v| (v - mean) * (v - mean)).sum();
    (mean, if values.len() > 1 { squares / (n - 1.0) / n } else { 0.0 })
}

/// A straight line through (x, y ± σ): slope and its standard deviation, weighted by 1/σ².
pub fn slope(points: &[(f64, f64, f64)]) -> (f64, f64) {
    let weight = |s: f64| 1.0 / (s * s);
    let total: f64 = points.iter().map(|p| weight(p.2)).sum();
    let x0 = points.iter().map(|p| weight(p.2) * p.0).sum::<f64>() / total;
    let xx: f64 = points.iter().map(|p| weight(p.2) * (p.0 - x0) * (p.0 - x0)).sum();
    let xy: f64 = points.iter().map(|p| weight(p.2) * (p.0 - x0) * p.1).sum();
    (xy / xx, xx.sqrt().recip())
}

/// ln Γ for x > 0: Lanczos (1964) with g = 7 and nine coefficients, relative error about 1e-14.
fn ln_gamma(x: f64) -> f64 {
    const C: [f64; 9] = [
        0.999_999_999_999_809_9,
        676.520_368_121_885_1,
        -1_259.139_216_722_402_8,
        771.323_428_777_653_1,
        -176.615_029_162_140_6,
        12.507_343_278_686_905,
        -0.138_571_095_265_720_12,
        9.984_369_578_019_572e-6,
        1.505_632_735_149_311_6e-7,
    ];
    let x = x - 1.0;
    let series = C[0] + (1..9).map(|i| C[i] / (x + i as f64)).sum::<f64>();
    let t = x + 7.5;
    0.5 * core::f64::consts::TAU.ln() + (x + 0.5) * t.ln() - t + series.ln()
}

/// Regularised incomplete beta function I_x(a, b): Lentz's continued fraction (Numerical Recipes, section 6.4).
fn incomplete_beta(a: f64, b: f64, x: f64) -> f64 {
    if x <= 0.0 {
        return 0.0;
    }
    if x >= 1.0 {
        return 1.0;
    }
    let front = (ln_gamma(a + b) - ln_gamma(a) - ln_gamma(b) + a * x.ln() + b * (-x).ln_1p()).exp();
    if x < (a + 1.0) / (a + b + 2.0) {
        front * fraction(a, b, x) / a
    } else {
        1.0 - front * fraction(b, a, 1.0 - x) / b
    }
}

fn fraction(a: f64, b: f64, x: f64) -> f64 {
    let guard = |v: f64| if v.abs() < 1e-300 { 1e-300 } else { v };
    let mut c = 1.0;
    let mut d = 1.0 / guard(1.0 - (a + b) * x / (a + 1.0));
    let mut h = d;
    for m in 1..1000 {
        let m = f64::from(m);
        for k in [
            m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m)),
            -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0)),
        ] {
            d = 1.0 / guard(1.0 + k * d);
            c = guard(1.0 + k / c);
            h *= c * d;
        }
        if (c * d - 1.0).abs() < 1e-14 {
            break;
        }
    }
    h
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn student_matches_tables() {
        for (dof, t) in [(1.0, 12.706_205), (2.0, 4.302_653), (5.0, 2.570_582), (30.0, 2.042_272)] {
            assert!((quantile(0.05, dof) - t).abs() < 2e-6 * t, "{dof}");
        }
        assert!((quantile(0.002, 10.0) - 4.143_700).abs() < 1e-5);
        assert!((p_value(1.0, 1.0) - 0.5).abs() < 1e-12);
        assert!((p_value(-6.0, 10.0) / 1.321_088_603_5e-4 - 1.0).abs() < 1e-9);
        // The normal distribution, far out.
        assert!((p_value(4.891_638, 1e9) / 1e-6 - 1.0).abs() < 1e-4);
        assert_eq!((p_value(0.0, 3.0), p_value(f64::INFINITY, 3.0)), (1.0, 0.0));
    }

    #[test]
    fn sidak_is_a_little_above_bonferroni() {
        assert!((sidak(0.05, 1) - 0.05).abs() < 1e-15);
        assert!((sidak(0.05, 10) - 0.005_116_196_891_823).abs() < 1e-15);
        assert!(sidak(1e-3, 768) > 1e-3 / 768.0);
    }

    #[test]
    fn variances_pool() {
        let mut equal = Variance::default();
        (0..100).for_each(|_| equal.add(2.0, 3.0));
        assert!((equal.dof() - 300.0).abs() < 1e-9 && (equal.sum - 200.0).abs() < 1e-9);
        equal.add(1e6, 3.0);
        assert!(equal.dof() < 3.01);
        assert_eq!((Variance::default().p_value(0.0), Variance::default().p_value(1.0)), (1.0, 0.0));
        assert_eq!(mean_and_variance(&[1.0, 2.0, 3.0]), (2.0, 1.0 / 3.0));
    }

    #[test]
    fn slopes_of_lines() {
        let (s, e) = slope(&[(0.0, 1.0, 0.1), (1.0, -1.0, 0.1), (2.0, -3.0, 0.1)]);
        assert!((s + 2.0).abs() < 1e-12 && (e - 0.1 / 2f64.sqrt()).abs() < 1e-12);
    }
}
