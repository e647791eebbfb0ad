//! What a picture's relMSE is expected to be, without a reference.
//!
//! With R the unknown truth, the error of a pixel is E (I − R)²/(R² + ε) = Var(I)/(R² + ε). The numerator is known without
//! bias from two halves, half² with half = (a − b)/2, or bounded by s²/n. What remains is to put something for R that does
//! not depend on the pixel's own noise. Its own mean I does: where a rare bright sample ("firefly") lands, half² and I² are
//! large together and half² ≤ I² for values that are not negative, so no pixel would ever add more than 1, while the true
//! relative error of such a pixel has no bound. Against references that estimate was 0.05 to 0.97 of the true error.
//!
//! Here R is the mean of the pixel's neighbours without itself, whose noise is independent of the numerator's. A pixel's own half
//! difference decides how far to look for neighbours, but never that the pixel may stand for itself: that would keep the
//! small numerators:
//!
//! 1. neighbours are those in a square as large as the noise demands: the smallest of radius 1, 2, 4, … whose mean has a standard
//!    error of at most [`NOISE`] of itself, were its variance all the neighbours' or all this pixel's, so that the pixel of a
//!    firefly looks as far as it takes to meet others of its kind;
//! 2. where the values in a small square differ by more than their noise ([`UNEVEN`]), an edge runs through it, and pixels on an
//!    edge, which a few samples show as all or nothing, err most. Then the most even line through the pixel (four directions,
//!    three lengths) stands for it, where one is more even than the square and its other pixels together are as noisy as this
//!    one: it lies along the edge. A line of still pixels that passes a noisy one is even, too, but touches a lamp's corner from
//!    outside and knows nothing of it;
//! 3. 1/(R² + ε) of a mean that is noisy itself is too large on average (it is convex). Its second-order excess is
//!    known, g = (3R² − ε)/(R² + ε)² · Var(R), and taken off.
//!
//! No pixel adds more than [`MOST`]: beyond, it is likelier that its few neighbours missed what it shows (a lamp of the size of
//! a pixel) than that a firefly is so rare. One such pixel in 60 000 made the result 2.3 times too large.
//!
//! For the upper bound R is the smaller of the mean of 1 and 2 and the pixel's own value, and nothing is taken off: s²/n bounds the
//! numerator alone, and by little where samples are as good as independent; the denominator must not undo it.
//!
//! Squares come from summed-area tables, lines are few: the time is linear in the pixels. How well this holds is in
//! `tests/sampling-quality.md`, measured by `tests/tests/expected_error.rs`.
//!
//! Limits: light that no sample of the frame has found is not in any estimate. Features a pixel wide may hold most of the error of
//! a small picture, and have nothing like them beside them: of a Cornell box 64 pixels wide the estimate is 0.6 of the error
//! at 8 samples and 0.98 at 16, of a bright gap one row high 1.19.

use crate::frame::Frame;
use crate::layers::{mean, variance_of_mean};
use crate::picture_error::EPSILON;
use crate::stats::CiKind;
use rayon::prelude::*;

/// Standard error, relative, that a window's mean may have.
const NOISE: f64 = 0.5;

/// Most that a pixel may add.
const MOST: f64 = 1000.0;

/// Radii of the squares.
const RADII: [usize; 7] = [1, 2, 4, 8, 16, 32, 64];

/// Squares larger than this are taken as they are: what needs so many pixels against its noise finds no line that is quiet
/// enough.
const SMALL: usize = 4;

/// How often the spread of a square's values may be their noise before an edge is suspected.
const UNEVEN: f64 = 2.0;

/// How much more even than the square a line must be.
const MORE_EVEN: f64 = 1.5;

/// Pixels of a line on each side.
const REACHES: [i64; 3] = [2, 4, 8];

/// Directions of lines.
const DIRECTIONS: [(i64, i64); 4] = [(1, 0), (0, 1), (1, 1), (1, -1)];

/// What the picture's relative squared error is expected to be: the mean over pixels and channels of Var(mean)/(R² + 0.01),
/// with the variance from halves ([`CiKind::Halves`]) or else s²/n ([`CiKind::Conservative`]: an upper bound, since samples
/// are stratified). `None` without two samples anywhere. Works in the caller's thread pool.
pub fn estimated_relmse(frame: &Frame) -> Option<(f64, CiKind)> {
    let (width, height) = (frame.desc().width as usize, frame.desc().height as usize);
    // Both halves of a pixel, where both have samples.
    let halves = |i: usize| {
        let (x, y) = ((i % width) as u32, (i / width) as u32);
        let [a, b] = [0, 1].map(|half| frame.film(x, y, half).filter(|f| f.samples > 0));
        if frame.desc().intervals { a.zip(b) } else { None }
    };
    let all = || (0..width * height).into_par_iter();
    let films: Vec<_> = frame.pixels().map(|(x, y)| frame.film_total(x, y)).collect();
    let counted: Vec<bool> = films.iter().map(|film| film.samples >= 2).collect();
    let pixels = counted.iter().filter(|counted| **counted).count();
    if pixels == 0 {
        return None;
    }
    let bound = !frame.desc().intervals || all().any(|i| counted[i] && halves(i).is_none());
    let mut sum = 0.0;
    for channel in 0..3 {
        let values: Vec<f64> = films.iter().map(|film| mean(film.sum[channel], film.samples)).collect();
        let variances: Vec<f64> = all()
            .map(|i| match halves(i) {
                Some((a, b)) => {
                    let half = 0.5 * (mean(a.sum[channel], a.samples) - mean(b.sum[channel], b.samples));
                    half * half
                }
                None => {
                    let film = &films[i];
                    variance_of_mean(film.sum[channel], film.squares[channel], film.samples).unwrap_or(0.0)
                }
            })
            .collect();
        let truth = Truth::new(width, height, &values, &variances);
        let errors: Vec<f64> = all()
            .filter(|i| counted[*i] && variances[*i] > 0.0)
            .map(|i| {
                let around = truth.around(i % width, i / width);
                let weight = if bound {
                    let r = around.mean.abs().min(values[i].abs());
                    1.0 / (r * r + EPSILON)
                } else {
                    around.weight()
                };
                (variances[i] * weight).min(MOST)
            })
            .collect();
        // Added up in order: the sum does not depend on the threads.
        sum = errors.into_iter().fold(sum, |sum, error| sum + error);
    }
    Some((sum / (3 * pixels) as f64, if bound { CiKind::Conservative } else { CiKind::Halves }))
}

/// Stands for the true values of a channel.
struct Truth<'a> {
    width: usize,
    height: usize,
    values: &'a [f64],
    variances: &'a [f64],
    /// Sums of values and of variances over all pixels above and to the left.
    value_sums: Vec<f64>,
    variance_sums: Vec<f64>,
}

/// A mean of neighbours, and the variance of that mean.
#[derive(Clone, Copy, Debug)]
struct Around {
    mean: f64,
    variance: f64,
}

impl Around {
    /// 1/(R² + ε), less what it is too large by on average because the mean is noisy (to second order).
    fn weight(self) -> f64 {
        let square = self.mean * self.mean;
        let weight = 1.0 / (square + EPSILON);
        let excess = (3.0 * square - EPSILON) * self.variance * weight * weight;
        // 1 − g, and what agrees with it to first order but stays positive.
        if excess > 0.0 { weight / (1.0 + excess) } else { weight * (1.0 - excess) }
    }
}

/// Sums over some pixels.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    count: f64,
    values: f64,
    squares: f64,
    variances: f64,
}

impl Sums {
    fn add(&mut self, value: f64, variance: f64) {
        self.count += 1.0;
        self.values += value;
        self.squares += value * value;
        self.variances += variance;
    }

    /// The mean without one of the pixels.
    fn without(&self, value: f64, variance: f64) -> Around {
        let others = self.count - 1.0;
        let variances = (self.variances - variance).max(0.0);
        Around { mean: (self.values - value) / others, variance: variances / (others * others) }
    }

    /// Whether the mean's standard error is small, one pixel of this variance among them.
    fn is_quiet(&self, mean: f64, variance: f64) -> bool {
        let noise = self.variances.max(variance) / (self.count * self.count);
        noise <= NOISE * NOISE * (mean * mean + EPSILON)
    }

    /// How far the values are spread, in units of their noise.
    fn unevenness(&self) -> f64 {
        let spread = (self.squares - self.values * self.values / self.count).max(0.0);
        spread / (self.variances + f64::MIN_POSITIVE)
    }
}

impl<'a> Truth<'a> {
    fn new(width: usize, height: usize, values: &'a [f64], variances: &'a [f64]) -> Self {
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
        Self { width, height, values, variances, value_sums: table(values), variance_sums: table(variances) }
    }

    /// What a pixel's true value is likely to be, from its neighbours alone.
    fn around(&self, x: usize, y: usize) -> Around {
        let (value, variance) = (self.values[y * self.width + x], self.variances[y * self.width + x]);
        let mut around = Around { mean: value, variance: 0.0 };
        let mut reached = 0;
        for radius in RADII {
            let sums = self.square(x, y, radius);
            if sums.count < 2.0 {
                return around;
            }
            (around, reached) = (sums.without(value, variance), radius);
            if sums.is_quiet(around.mean, variance) {
                break;
            }
        }
        if reached <= SMALL { self.along_an_edge(x, y, reached).unwrap_or(around) } else { around }
    }

    /// Sums over a square, squares of values left out.
    fn square(&self, x: usize, y: usize, radius: usize) -> Sums {
        let (x0, x1) = (x.saturating_sub(radius), (x + radius + 1).min(self.width));
        let (y0, y1) = (y.saturating_sub(radius), (y + radius + 1).min(self.height));
        let sum = |table: &[f64]| {
            let at = |x: usize, y: usize| table[y * (self.width + 1) + x];
            at(x1, y1) - at(x0, y1) - at(x1, y0) + at(x0, y0)
        };
        Sums {
            count: ((x1 - x0) * (y1 - y0)) as f64,
            values: sum(&self.value_sums),
            squares: 0.0,
            variances: sum(&self.variance_sums),
        }
    }

    /// The mean along the most even line through a pixel, where the square around it is uneven and a line less so.
    fn along_an_edge(&self, x: usize, y: usize, radius: usize) -> Option<Around> {
        let (value, variance) = (self.values[y * self.width + x], self.variances[y * self.width + x]);
        let mut all = Sums::default();
        for y in y.saturating_sub(radius)..(y + radius + 1).min(self.height) {
            for i in
                y * self.width + x.saturating_sub(radius)..y * self.width + (x + radius + 1).min(self.width)
            {
                all.add(self.values[i], self.variances[i]);
            }
        }
        let uneven = all.unevenness();
        if uneven <= UNEVEN {
            return None;
        }
        let mut best = (uneven / MORE_EVEN, None);
        for reach in REACHES {
            for (dx, dy) in DIRECTIONS {
                let mut line = Sums::default();
                for k in -reach..=reach {
                    let (x, y) = (x as i64 + k * dx, y as i64 + k * dy);
                    if (0..self.width as i64).contains(&x) && (0..self.height as i64).contains(&y) {
                        let i = y as usize * self.width + x as usize;
                        line.add(self.values[i], self.variances[i]);
                    }
                }
                if line.count < 3.0 {
                    continue;
                }
                let (others, uneven) = (line.without(value, variance), line.unevenness());
                // Of normal pixels that are alike 12 % are noisier than 4 others together, 2 % than 8 and 0.1 % than 16.
                let alike = variance <= line.variances - variance;
                if uneven < best.0 && alike && line.is_quiet(others.mean, variance) {
                    best = (uneven, Some(others));
                }
            }
        }
        best.1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A lamp's edge that crosses a row of pixels: one sample of four meets it in every second.
    #[test]
    fn an_edge_is_known_by_the_pixels_along_it() {
        let (width, height) = (32, 9);
        let (mut values, mut variances) = (vec![10.0; width * height], vec![0.0; width * height]);
        for x in 0..width {
            let lit = x % 2 == 1;
            values[4 * width + x] = if lit { 2.5 } else { 0.0 };
            variances[4 * width + x] = if lit { 2.5 * 2.5 } else { 0.0 };
            for y in 5..height {
                values[y * width + x] = 0.0;
            }
        }
        let truth = Truth::new(width, height, &values, &variances);
        let edge = truth.around(13, 4).mean;
        assert!(edge > 0.8 && edge < 1.6, "{edge}");
        assert_eq!((truth.around(13, 2).mean, truth.around(13, 7).mean), (10.0, 0.0));
    }

    /// The corner of a lamp lies on dark lines that touch the lamp nowhere else: they know nothing of it.
    #[test]
    fn a_corner_is_not_known_by_the_dark_beside_it() {
        let (width, height) = (24, 24);
        let at = |x: usize, y: usize| y * width + x;
        let (mut values, mut variances) = (vec![0.1; width * height], vec![1e-6; width * height]);
        for y in 8..16 {
            for x in 8..16 {
                let border = usize::from(x == 8 || x == 15) + usize::from(y == 8 || y == 15);
                values[at(x, y)] = [15.0, 5.0, 1.0][border];
                variances[at(x, y)] = [1e-4, 4.0, 1.0][border];
            }
        }
        let truth = Truth::new(width, height, &values, &variances);
        let corner = truth.around(8, 8).mean;
        assert!(corner > 1.0, "{corner}");
    }

    /// The weight of a noisy mean, on average: R of gamma distribution with a standard error of 30 %, whose E 1/R² is
    /// 1/((1 − s)(1 − 2s)) = 1.34, s = 0.09.
    #[test]
    fn what_noise_adds_to_a_weight_is_taken_off() {
        let s = 0.09_f64;
        let shape = 1.0 / s;
        let (mut sum, mut plain, mut corrected) = (0.0, 0.0, 0.0);
        for i in 1..8000 {
            let r = f64::from(i) / 2000.0;
            let density = libm::exp((shape - 1.0) * libm::log(r) - shape * (r - 1.0));
            let scale = 100.0;
            sum += density;
            plain += density / (scale * scale * r * r);
            let around = Around { mean: scale * r, variance: s * (scale * r) * (scale * r) };
            corrected += density * around.weight();
        }
        let (plain, corrected) = (plain / sum * 1e4, corrected / sum * 1e4);
        assert!((plain - 1.34).abs() < 0.01 && (corrected - 1.0).abs() < 0.07, "{plain} {corrected}");
    }
}
