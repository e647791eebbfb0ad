//! Student's t distribution: two-sided p-values and quantiles, and Satterthwaite's degrees of freedom.

/// Two-sided p-value of `t` with `dof` degrees of freedom (at least 1): P(|T| ≥ |t|) = I_x(ν/2, 1/2), x = ν/(ν + t²)
/// (Abramowitz and Stegun 26.7.1). 1 for NaN.
pub(crate) fn p_value(t: f64, dof: f64) -> f64 {
    if t.is_nan() || dof.is_nan() {
        return 1.0;
    }
    if t.is_infinite() {
        return 0.0;
    }
    incomplete_beta(dof / 2.0, 0.5, dof / (dof + t * t))
}

/// The t with two-sided p-value 0.05: 12.7 at one degree of freedom, 1.96 at many.
pub(crate) fn quantile95(dof: f64) -> f64 {
    quantile(0.05, dof)
}

/// The t whose two-sided p-value is `p` (1e-3 to 1), with at least one degree of freedom.
pub(crate) fn quantile(p: f64, dof: f64) -> f64 {
    // Beyond 10^7 degrees of freedom the distribution is normal to seven digits.
    let dof = dof.clamp(1.0, 1e7);
    let (mut low, mut high) = (0.0, 1000.0);
    for _ in 0..70 {
        let middle = 0.5 * (low + high);
        if p_value(middle, dof) > p {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// Regularised incomplete beta function I_x(a, b) by Lentz's continued fraction (Numerical Recipes, 6.4).
fn incomplete_beta(a: f64, b: f64, x: f64) -> f64 {
    if x <= 0.0 {
        return 0.0;
    }
    if x >= 1.0 {
        return 1.0;
    }
    let front =
        (libm::lgamma(a + b) - libm::lgamma(a) - libm::lgamma(b) + a * libm::log(x) + b * libm::log1p(-x))
            .min(700.0);
    let front = libm::exp(front);
    if x < (a + 1.0) / (a + b + 2.0) {
        front * beta_fraction(a, b, x) / a
    } else {
        1.0 - front * beta_fraction(b, a, 1.0 - x) / b
    }
}

fn beta_fraction(a: f64, b: f64, x: f64) -> f64 {
    const TINY: f64 = 1e-300;
    let guard = |v: f64| if v.abs() < TINY { TINY } else { v };
    let mut c = 1.0;
    let mut d = 1.0 / guard(1.0 - (a + b) * x / (a + 1.0));
    let mut h = d;
    for m in 1..10_000 {
        let m = f64::from(m);
        let even = m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m));
        d = 1.0 / guard(1.0 + even * d);
        c = guard(1.0 + even / c);
        h *= d * c;
        let odd = -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0));
        d = 1.0 / guard(1.0 + odd * d);
        c = guard(1.0 + odd / c);
        let step = d * c;
        h *= step;
        if (step - 1.0).abs() < 1e-15 {
            break;
        }
    }
    h
}

/// The k of [`Variance`].
const K: f64 = 0.5;

/// A sum of independent variance estimates, with the degrees of freedom of the sum.
///
/// Satterthwaite (1946) approximates Σv_i by a scaled χ² with ν = (Σσ_i²)²/Σ(σ_i⁴/ν_i) degrees of freedom. Only the
/// estimates v_i are known, so that ν is estimated too, by
///
/// ν = (Σv)²/Σ(v_i²/(ν_i + k)) − k, at least 1 and at most Σν_i,
///
/// which is ν_1 again for one term. k = 0 is the textbook's formula; k = 2 makes numerator and denominator unbiased
/// (E v_i² = σ_i⁴(1 + 2/ν_i)), but then p-values are too small in the tail. Simulated for t tests of sums over 64 pixels
/// with one degree of freedom each, normal errors, standard deviations log-uniform over a factor F; the share of p < α
/// divided by α:
///
/// | F | α | k = 0 | k = 1/2 | k = 1 | k = 2 |
/// |---|---|---|---|---|---|
/// | 10 | 0.0005 | 0.19 | 0.53 | 0.81 | 1.26 |
/// | 100 | 0.003 | 0.27 | 0.62 | 0.90 | 1.35 |
/// | 100 | 0.00005 | 0.07 | 0.42 | 0.90 | 2.30 |
/// | 1000 | 0.0005 | 0.22 | 0.82 | 1.47 | 2.64 |
///
/// Tests of many tiles depend on that tail, so k = 1/2.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Variance {
    sum: f64,
    fourth: f64,
    most: f64,
}

impl Variance {
    /// Adds an estimate with its degrees of freedom (at least 1). Estimates of 0 add nothing.
    #[inline]
    pub(crate) fn add(&mut self, variance: f64, dof: f64) {
        if variance > 0.0 {
            self.sum += variance;
            self.fourth += variance * variance / (dof + K);
            self.most += dof;
        }
    }

    /// The variance of the sum.
    pub(crate) const fn sum(&self) -> f64 {
        self.sum
    }

    /// Its degrees of freedom.
    pub(crate) fn dof(&self) -> f64 {
        if self.fourth <= 0.0 {
            return 1.0;
        }
        (self.sum * self.sum / self.fourth - K).clamp(1.0, self.most.max(1.0))
    }

    /// Half the width of the 95 % interval of a quantity with this variance.
    pub(crate) fn half_width95(&self) -> f64 {
        if self.sum > 0.0 { quantile95(self.dof()) * self.sum.sqrt() } else { 0.0 }
    }

    /// Two-sided p-value of a difference from 0: 1 for none, 0 for one without any variance.
    pub(crate) fn p_value(&self, difference: f64) -> f64 {
        if difference == 0.0 {
            1.0
        } else if self.sum > 0.0 {
            p_value(difference / self.sum.sqrt(), self.dof())
        } else {
            0.0
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_and_p_values_match_tables() {
        for (dof, t) in
            [(1.0, 12.706_205), (2.0, 4.302_653), (5.0, 2.570_582), (30.0, 2.042_272), (1e6, 1.959_966)]
        {
            assert!((quantile95(dof) - t).abs() < 2e-6 * t, "dof {dof}: {}", quantile95(dof));
        }
        assert_eq!(quantile95(0.2), quantile95(1.0));
        assert!((quantile95(1e9) - 1.959_964).abs() < 1e-6);
        assert!(
            (quantile(0.002, 1.0) - 318.308_8).abs() < 1e-3
                && (quantile(0.002, 10.0) - 4.143_700).abs() < 1e-5
        );
        // One degree of freedom is the Cauchy distribution: P(|T| ≥ 1) = 1/2.
        assert!((p_value(1.0, 1.0) - 0.5).abs() < 1e-12);
        assert!((p_value(-6.0, 10.0) - 1.321_088_603_5e-4).abs() < 1e-13);
        assert!((p_value(2.5, 4.5) - 0.059_905_686_502).abs() < 1e-11);
        assert!((p_value(3.7, 63.0) - 4.549_550_568_7e-4).abs() < 1e-13);
        assert!((p_value(40.0, 1e4) - 0.0) < 1e-300);
        assert_eq!(p_value(0.0, 3.0), 1.0);
        assert_eq!(p_value(f64::INFINITY, 3.0), 0.0);
    }

    #[test]
    fn degrees_of_freedom_of_sums() {
        let mut one = Variance::default();
        one.add(3.0, 1.0);
        assert!((one.dof() - 1.0).abs() < 1e-12);
        let mut wide = Variance::default();
        wide.add(3.0, 17.0);
        assert!((wide.dof() - 17.0).abs() < 1e-9);
        // One estimate that outweighs the rest brings its own degrees of freedom.
        for _ in 0..100 {
            one.add(1e-9, 1.0);
        }
        assert!((one.dof() - 1.0).abs() < 1e-3);
        assert_eq!(Variance::default().p_value(1.0), 0.0);
        assert_eq!(Variance::default().p_value(0.0), 1.0);
    }

    /// The claim of the table above, at F = 100.
    #[test]
    fn p_values_of_uneven_sums_are_not_too_small() {
        let mut random = crate::testing::Random::new(7);
        let (count, mut below) = (20_000, [0; 3]);
        let levels = [0.05, 0.01, 0.003];
        for _ in 0..count {
            let (mut difference, mut variance) = (0.0, Variance::default());
            for _ in 0..64 {
                let deviation = 10.0_f64.powf(2.0 * random.unit() - 1.0);
                difference += deviation * random.normal();
                let half = deviation * random.normal();
                variance.add(half * half, 1.0);
            }
            let p = variance.p_value(difference);
            for (below, level) in below.iter_mut().zip(levels) {
                *below += u32::from(p < level);
            }
        }
        // Expected 1000, 200 and 60 at most; one standard deviation is 31, 14 and 8. And not far less: that would cost power.
        assert!((600..=1040).contains(&below[0]), "{below:?}");
        assert!((80..=200).contains(&below[1]), "{below:?}");
        assert!((18..=60).contains(&below[2]), "{below:?}");
    }
}
