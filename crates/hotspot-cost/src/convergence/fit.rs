//! Slopes, crossings, medians and their intervals.

use crate::student::quantile95;
use serde::{Deserialize, Serialize};

/// A mean with Student's 95 % interval; no interval from one value.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// The mean.
    pub value: f64,
    /// Its 95 % interval.
    pub ci95: Option<[f64; 2]>,
}

/// A median with an interval of order statistics.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Middle {
    /// The median.
    pub value: f64,
    /// Lower and upper end.
    pub interval: [f64; 2],
    /// With which probability the true median lies between them, 0..1.
    pub coverage: f64,
}

/// The mean of values and Student's interval; `None` of no values.
pub fn mean_with_interval(values: &[f64]) -> Option<Estimate> {
    let n = values.len() as f64;
    if values.is_empty() {
        return None;
    }
    let mean = values.iter().sum::<f64>() / n;
    let ci95 = (values.len() > 1).then(|| {
        let variance = values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / (n - 1.0);
        let width = quantile95(n - 1.0) * (variance / n).sqrt();
        [mean - width, mean + width]
    });
    Some(Estimate { value: mean, ci95 })
}

/// The median of values and the narrowest symmetric interval of order statistics that covers it with 95 %, or the widest
/// there is; `None` of no values.
pub fn median_with_interval(values: &[f64]) -> Option<Middle> {
    let n = values.len();
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let value = match n {
        0 => return None,
        n if n % 2 == 1 => sorted[n / 2],
        n => 0.5 * (sorted[n / 2 - 1] + sorted[n / 2]),
    };
    // P(Binomial(n, 1/2) < k) for k = 1, 2, …
    let mut term = 0.5_f64.powi(n.min(1000) as i32);
    let mut below = term;
    let mut best = (1, 1.0 - 2.0 * below);
    for k in 2..=n.div_ceil(2) {
        term *= (n - k + 2) as f64 / (k - 1) as f64;
        below += term;
        if 1.0 - 2.0 * below < 0.95 {
            break;
        }
        best = (k, 1.0 - 2.0 * below);
    }
    let (k, coverage) = best;
    Some(Middle { value, interval: [sorted[k - 1], sorted[n - k]], coverage: coverage.max(0.0) })
}

/// Slope of log `y` on log `x` by least squares; points that are not positive are left out. `None` of fewer than two
/// different x.
pub fn slope(points: &[(f64, f64)]) -> Option<f64> {
    let logs: Vec<(f64, f64)> = points
        .iter()
        .filter(|(x, y)| *x > 0.0 && *y > 0.0)
        .map(|(x, y)| (libm::log(*x), libm::log(*y)))
        .collect();
    let n = logs.len() as f64;
    let (mx, my) = logs.iter().fold((0.0, 0.0), |m, p| (m.0 + p.0 / n, m.1 + p.1 / n));
    let (xx, xy) =
        logs.iter().fold((0.0, 0.0), |s, p| (s.0 + (p.0 - mx) * (p.0 - mx), s.1 + (p.0 - mx) * (p.1 - my)));
    (logs.len() > 1 && xx > 1e-12).then(|| xy / xx)
}

/// When an error is reached.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Crossing {
    /// Between two points, after so many seconds.
    At(f64),
    /// The first point is already below it.
    Before,
    /// No point is below it.
    Never,
}

/// Seconds after which the error first falls to `error`. `points`: (seconds, error), by rising seconds.
pub fn seconds_to(points: &[(f64, f64)], error: f64) -> Crossing {
    let Some(at) = points.iter().position(|(_, e)| *e <= error) else { return Crossing::Never };
    let Some(before) = at.checked_sub(1) else { return Crossing::Before };
    let ((s0, e0), (s1, e1)) = (points[before], points[at]);
    // An unbiased error may be at or below 0: then what is known is that it lies below.
    if e1 <= 0.0 || s0 <= 0.0 || s1 <= 0.0 {
        return Crossing::At(s1);
    }
    let part = (libm::log(e0) - libm::log(error)) / (libm::log(e0) - libm::log(e1));
    Crossing::At(libm::exp(libm::log(s0) + part * (libm::log(s1) - libm::log(s0))))
}
