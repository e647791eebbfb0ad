//! What a picture's relMSE is expected to be, without a reference.
//!
//! With R the unknown truth, the error of a pixel is E (I − R)²/(R² + ε) = Var(I)/(R² + ε). The numerator is known without
//! bias from two halves, half² with half = (a − b)/2, or bounded by s²/n. What remains is to put something for R that does
//! not depend on the pixel's own noise. Its own mean I does: where a rare bright sample ("firefly") lands, half² and I² are
//! large together and half² ≤ I² for values that are not negative, so no pixel would ever add more than 1, while the true
//! relative error of such a pixel has no bound. Against references that estimate was 0.05 to 0.97 of the true error.
//!
//! Here R is the mean of the pixel's neighbours without itself, whose noise is independent, in a square window as large as
//! the noise demands: the smallest of radius 1, 2, 4, … whose mean has a standard error of at most [`NOISE`] of itself, the
//! pixel's own variance included in that sum, so that the pixel of a firefly looks as far as it takes to meet others of
//! its kind. Where the pixel differs from that mean by more than [`OWN`] times its own half difference, noise does not
//! explain it: it is an edge or a gradient, and its own value stands. Windows come from summed-area tables: the time is
//! linear in the pixels.
//!
//! Limits: where noise is several times the signal (relMSE above 1) and its sources are rarer than the windows reach, the
//! result is too large (2 times at relMSE 3.6). Light that no sample of the frame has found is not in any estimate.

use crate::frame::Frame;
use crate::layers::{mean, variance_of_mean};
use crate::picture_error::EPSILON;
use crate::stats::CiKind;

/// Standard error, relative, that a window's mean may have.
const NOISE: f64 = 0.5;

/// How many half differences a pixel may be from its neighbours before it stands for itself; 1.5 to 3 were measured 3 to 12 %
/// too high on scenes with much noise, where 1 is within 3 %.
const OWN: f64 = 1.0;

/// Radii of the windows.
const RADII: [usize; 7] = [1, 2, 4, 8, 16, 32, 64];

/// What the picture's relative squared error is expected to be: the mean over pixels and channels of Var(mean)/(R² + 0.01),
/// with the variance from halves ([`CiKind::Halves`]) or else s²/n ([`CiKind::Conservative`]: an upper bound, since samples
/// are stratified). `None` without two samples anywhere.
pub fn estimated_relmse(frame: &Frame) -> Option<(f64, CiKind)> {
    let (width, height) = (frame.desc().width as usize, frame.desc().height as usize);
    let intervals = frame.desc().intervals;
    let mut kind = if intervals { CiKind::Halves } else { CiKind::Conservative };
    let films: Vec<_> = frame.pixels().map(|(x, y)| frame.film_total(x, y)).collect();
    let counted: Vec<bool> = films.iter().map(|film| film.samples >= 2).collect();
    let pixels = counted.iter().filter(|counted| **counted).count();
    if pixels == 0 {
        return None;
    }
    let mut sum = 0.0;
    for channel in 0..3 {
        let values: Vec<f64> = films.iter().map(|film| mean(film.sum[channel], film.samples)).collect();
        let variances: Vec<f64> = frame
            .pixels()
            .zip(&films)
            .map(|((x, y), film)| {
                let halves = [0, 1].map(|half| frame.film(x, y, half).filter(|f| f.samples > 0));
                if intervals && let [Some(a), Some(b)] = halves {
                    let half = 0.5 * (mean(a.sum[channel], a.samples) - mean(b.sum[channel], b.samples));
                    return half * half;
                }
                if film.samples >= 2 {
                    kind = CiKind::Conservative;
                }
                variance_of_mean(film.sum[channel], film.squares[channel], film.samples).unwrap_or(0.0)
            })
            .collect();
        let truth = Truth::new(width, height, &values, &variances);
        for (i, variance) in variances.iter().enumerate().filter(|(i, v)| counted[*i] && **v > 0.0) {
            let r = truth.at(i % width, i / width, values[i], *variance);
            sum += variance / (r * r + EPSILON);
        }
    }
    Some((sum / (3 * pixels) as f64, kind))
}

/// Stands for the true values of a channel.
struct Truth {
    width: usize,
    height: usize,
    /// Sums of values and of variances over all pixels above and to the left.
    values: Vec<f64>,
    variances: Vec<f64>,
}

impl Truth {
    fn new(width: usize, height: usize, values: &[f64], variances: &[f64]) -> Self {
        let table = |plane: &[f64]| {
            let mut table = vec![0.0; (width + 1) * (height + 1)];
            for y in 0..height {
                let mut row = 0.0;
                for x in 0..width {
                    row += plane[y * width + x];
                    table[(y + 1) * (width + 1) + x + 1] = table[y * (width + 1) + x + 1] + row;
                }
            }
            table
        };
        Self { width, height, values: table(values), variances: table(variances) }
    }

    /// What a pixel's true value is likely to be.
    fn at(&self, x: usize, y: usize, value: f64, variance: f64) -> f64 {
        let mut around = value;
        for radius in RADII {
            let (x0, x1) = (x.saturating_sub(radius), (x + radius + 1).min(self.width));
            let (y0, y1) = (y.saturating_sub(radius), (y + radius + 1).min(self.height));
            let count = ((x1 - x0) * (y1 - y0)) as f64;
            if count < 2.0 {
                return value;
            }
            let sum = |table: &[f64]| {
                let at = |x: usize, y: usize| table[y * (self.width + 1) + x];
                at(x1, y1) - at(x0, y1) - at(x1, y0) + at(x0, y0)
            };
            around = (sum(&self.values) - value) / (count - 1.0);
            let noise = sum(&self.variances).max(variance) / (count * count);
            if noise <= NOISE * NOISE * (around * around + EPSILON) {
                break;
            }
        }
        let off = value - around;
        if off * off > OWN * OWN * variance { value } else { around }
    }
}
