//! How far a picture is from a reference.
//!
//! With I the picture, R the reference, and means over pixels and the channels red, green and blue:
//!
//! | measure | definition |
//! |---|---|
//! | relMSE | mean (I − R)²/(R² + ε), ε = 0.01: Rousselle, Knaus, Zwicker, *Adaptive Sampling and Reconstruction using Greedy Error Minimization* (2011), section 6 |
//! | trimmed | the same without the worst 0.1 % of pixels: no single bright outlier decides |
//! | unbiased | mean (I − A)(I − B)/(M² + ε), A and B independent halves of the reference and M their mean: the noise of A and that of B cancel in expectation, where relMSE holds the reference's own error on top. May be negative near zero |
//! | RMSE | √ mean (I − R)²: absolute, so that bright pixels decide |
//! | FLIP | the mean of Andersson and others, *FLIP: A Difference Evaluator for Alternating Images* (2020), between both pictures as a person sees them: sRGB at the reference's automatic exposure ([`crate::maps::beauty`]), at 67 pixels per degree. 0 same, 1 as far as can be |
//! | mean ratio | mean I / mean R of each channel: 1 but for noise when neither is biased |
//!
//! Sums are in f64, row by row. Every value must be finite: one that is not would silently decide, so it is an error that
//! names its pixel.

mod flip;
mod reference;
#[cfg(test)]
mod tests;

pub use flip::flip;
pub use reference::Reference;

use crate::error::{Error, Result};
use crate::layers::{Layers, RADIANCE};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;

/// The ε of relMSE: errors of pixels darker than its root, 0.1, count as if these were that bright.
pub const EPSILON: f64 = 0.01;

/// The share of pixels, the worst, that the trimmed relMSE leaves out.
pub const TRIMMED_SHARE: f64 = 0.001;

/// Linear red, green and blue, row by row from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture<'a> {
    width: u32,
    height: u32,
    rgb: [Cow<'a, [f32]>; 3],
}

impl<'a> Picture<'a> {
    /// The channels R, G and B of `layers`; `place` names them in errors.
    ///
    /// # Errors
    /// [`Error::Invalid`] when a channel is missing or holds a value that is not finite.
    pub fn of_layers(layers: &'a Layers, place: &str) -> Result<Self> {
        let plane = |name: &str| {
            layers.plane(name).map(Cow::Borrowed).ok_or_else(|| {
                let names: Vec<&str> = layers.planes.keys().map(String::as_str).take(8).collect();
                Error::invalid(
                    place,
                    format!("it has no channel {name}, only {}", names.join(", ")),
                    "save it with the channels R, G and B",
                )
            })
        };
        let [red, green, blue] = RADIANCE.map(|(name, _)| plane(name));
        Self::new(layers.width, layers.height, [red?, green?, blue?], place)
    }

    /// A picture from its planes, each of width × height values.
    ///
    /// # Errors
    /// [`Error::Invalid`] when a plane has another length or holds a value that is not finite, or without any pixel.
    pub fn new(width: u32, height: u32, rgb: [Cow<'a, [f32]>; 3], place: &str) -> Result<Self> {
        let pixels = width as usize * height as usize;
        if pixels == 0 || rgb.iter().any(|plane| plane.len() != pixels) {
            return Err(Error::invalid(
                place,
                format!("its planes do not hold {width} x {height} pixels"),
                "write it again",
            ));
        }
        let bad = (0..pixels).filter(|i| rgb.iter().any(|plane| !plane[*i].is_finite()));
        if let Some(first) = bad.clone().next() {
            return Err(Error::invalid(
                place,
                format!(
                    "{} of its pixels are not finite numbers, the first at ({}, {})",
                    bad.count(),
                    first % width as usize,
                    first / width as usize
                ),
                "an error against it would mean nothing; mend or render it again",
            ));
        }
        Ok(Self { width, height, rgb })
    }

    /// Columns and rows.
    pub const fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    /// The planes of red, green and blue.
    pub fn planes(&self) -> [&[f32]; 3] {
        [&self.rgb[0], &self.rgb[1], &self.rgb[2]]
    }

    /// The same picture, owning its planes.
    pub fn into_owned(self) -> Picture<'static> {
        Picture {
            width: self.width,
            height: self.height,
            rgb: self.rgb.map(|plane| Cow::Owned(plane.into_owned())),
        }
    }

    const fn pixels(&self) -> usize {
        self.width as usize * self.height as usize
    }

    fn value(&self, channel: usize, pixel: usize) -> f64 {
        f64::from(self.rgb[channel][pixel])
    }

    fn mean(&self, channel: usize) -> f64 {
        self.rgb[channel].iter().map(|v| f64::from(*v)).sum::<f64>() / self.pixels() as f64
    }
}

/// The measures of one picture; see the module for their definitions.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PictureError {
    /// Relative mean squared error.
    pub relmse: f64,
    /// Without the worst 0.1 % of pixels.
    pub relmse_trimmed: f64,
    /// Debiased by the reference's halves; `None` without them.
    pub relmse_unbiased: Option<f64>,
    /// Root mean squared error, absolute.
    pub rmse: f64,
    /// Mean FLIP; `None` unless built with the feature `flip`.
    pub flip: Option<f64>,
    /// Mean of the picture over mean of the reference, of red, green, blue; `None` where the reference is black.
    pub mean_ratio: [Option<f64>; 3],
}

impl PictureError {
    /// All measures.
    ///
    /// # Errors
    /// [`Error::Invalid`] when the sizes differ.
    pub fn of(picture: &Picture<'_>, reference: &Reference<'_>) -> Result<Self> {
        let mean = reference.mean();
        same_size(picture, mean)?;
        let by_pixel = relative_squares(picture, mean);
        let (mut squares, count) = (0.0, 3 * picture.pixels());
        for channel in 0..3 {
            for pixel in 0..picture.pixels() {
                let off = picture.value(channel, pixel) - mean.value(channel, pixel);
                squares += off * off;
            }
        }
        Ok(Self {
            relmse: by_pixel.iter().sum::<f64>() / by_pixel.len() as f64,
            relmse_trimmed: trimmed_mean(by_pixel),
            relmse_unbiased: reference.halves().map(|[a, b]| unbiased(picture, a, b)),
            rmse: (squares / count as f64).sqrt(),
            flip: flip(picture, mean),
            mean_ratio: core::array::from_fn(|channel| {
                let of = mean.mean(channel);
                (of != 0.0).then(|| picture.mean(channel) / of)
            }),
        })
    }
}

/// The relative mean squared error of `picture` against `reference`.
///
/// # Errors
/// [`Error::Invalid`] when the sizes differ.
pub fn relmse(picture: &Picture<'_>, reference: &Picture<'_>) -> Result<f64> {
    same_size(picture, reference)?;
    let by_pixel = relative_squares(picture, reference);
    Ok(by_pixel.iter().sum::<f64>() / by_pixel.len() as f64)
}

/// What each pixel adds to relMSE: the mean over its channels of (I − R)²/(R² + ε).
///
/// # Errors
/// [`Error::Invalid`] when the sizes differ.
pub fn error_by_pixel(picture: &Picture<'_>, reference: &Picture<'_>) -> Result<Vec<f64>> {
    same_size(picture, reference)?;
    Ok(relative_squares(picture, reference))
}

fn relative_squares(picture: &Picture<'_>, reference: &Picture<'_>) -> Vec<f64> {
    (0..picture.pixels())
        .map(|pixel| {
            let of = |channel| {
                let r = reference.value(channel, pixel);
                let off = picture.value(channel, pixel) - r;
                off * off / (r * r + EPSILON)
            };
            (of(0) + of(1) + of(2)) / 3.0
        })
        .collect()
}

/// The mean without the largest [`TRIMMED_SHARE`].
fn trimmed_mean(mut values: Vec<f64>) -> f64 {
    let kept = ((values.len() as f64 * (1.0 - TRIMMED_SHARE)) as usize).max(1);
    values.sort_unstable_by(f64::total_cmp);
    values.truncate(kept);
    values.iter().sum::<f64>() / values.len() as f64
}

/// mean (I − A)(I − B)/(M² + ε).
fn unbiased(picture: &Picture<'_>, a: &Picture<'_>, b: &Picture<'_>) -> f64 {
    let mut sum = 0.0;
    for channel in 0..3 {
        for pixel in 0..picture.pixels() {
            let (i, a, b) = (picture.value(channel, pixel), a.value(channel, pixel), b.value(channel, pixel));
            let m = 0.5 * (a + b);
            sum += (i - a) * (i - b) / (m * m + EPSILON);
        }
    }
    sum / (3 * picture.pixels()) as f64
}

fn same_size(picture: &Picture<'_>, reference: &Picture<'_>) -> Result<()> {
    if picture.size() == reference.size() {
        return Ok(());
    }
    let ((w, h), (rw, rh)) = (picture.size(), reference.size());
    Err(Error::invalid(
        "reference",
        format!("it has {rw} x {rh} pixels, the picture {w} x {h}"),
        "render at the reference's size",
    ))
}
