//! A picture that stands for the truth, and its own noise.

use super::{EPSILON, Picture, same_size};
use crate::error::{Error, Result};
use crate::layers::{Layers, RADIANCE};
use std::borrow::Cow;

/// A converged picture, where possible with the two independent halves of its samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Reference<'a> {
    mean: Picture<'a>,
    halves: Option<[Picture<'a>; 2]>,
}

impl<'a> Reference<'a> {
    /// A reference of which nothing but its mean is known.
    pub const fn new(mean: Picture<'a>) -> Self {
        Self { mean, halves: None }
    }

    /// A reference with its two halves; `place` names it in errors.
    ///
    /// # Errors
    /// [`Error::Invalid`] when sizes differ, and when `mean` is not the mean of the halves: by more than 1 % of the sum of
    /// its values, which no rounding explains.
    pub fn with_halves(mean: Picture<'a>, halves: [Picture<'a>; 2], place: &str) -> Result<Self> {
        for half in &halves {
            if half.size() != mean.size() {
                let ((w, h), (hw, hh)) = (mean.size(), half.size());
                return Err(Error::invalid(
                    place,
                    format!("it has {w} x {h} pixels but one of its halves {hw} x {hh}"),
                    "render all three again, or take the halves away",
                ));
            }
        }
        let (mut off, mut sum) = (0.0, 0.0);
        for channel in 0..3 {
            for pixel in 0..mean.pixels() {
                let value = mean.value(channel, pixel);
                let middle = 0.5 * (halves[0].value(channel, pixel) + halves[1].value(channel, pixel));
                off += (value - middle).abs();
                sum += value.abs();
            }
        }
        if off > 0.01 * sum {
            return Err(Error::invalid(
                place,
                format!("it is not the mean of its halves but off by {:.1} % of its sum", 100.0 * off / sum),
                "render all three again, or take the halves away",
            ));
        }
        Ok(Self { mean, halves: Some(halves) })
    }

    /// From layers: R, G, B, and where `half.red`, `half.green`, `half.blue` are present a = mean + half, b = mean − half.
    ///
    /// # Errors
    /// [`Error::Invalid`] when a channel is missing or holds a value that is not finite.
    pub fn of_layers(layers: &'a Layers, place: &str) -> Result<Self> {
        let mean = Picture::of_layers(layers, place)?;
        let half = RADIANCE.map(|(_, long)| layers.plane(&format!("half.{long}")));
        let [Some(red), Some(green), Some(blue)] = half else { return Ok(Self::new(mean)) };
        let shifted = |sign: f32| {
            let planes = mean.planes();
            let planes = [(planes[0], red), (planes[1], green), (planes[2], blue)]
                .map(|(mean, half)| mean.iter().zip(half).map(|(m, h)| m + sign * h).collect());
            Picture::new(layers.width, layers.height, planes.map(Cow::Owned), place)
        };
        let halves = Some([shifted(1.0)?, shifted(-1.0)?]);
        Ok(Self { mean, halves })
    }

    /// Reads `path`, with its halves from its own `half.*` channels or from `<stem>_a.exr` and `<stem>_b.exr` beside it where
    /// both exist.
    ///
    /// # Errors
    /// Those of [`crate::exr_io::read`], [`Self::of_layers`] and [`Self::with_halves`].
    #[cfg(feature = "exr")]
    pub fn read(path: &std::path::Path, limits: &crate::exr_io::Limits) -> Result<Reference<'static>> {
        let place = path.display().to_string();
        let file = crate::exr_io::read(path, limits)?;
        let own = Reference::of_layers(&file.layers, &place)?.into_owned();
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        let beside = ["a", "b"].map(|half| path.with_file_name(format!("{stem}_{half}.exr")));
        if own.halves.is_some() || !beside.iter().all(|half| half.is_file()) {
            return Ok(own);
        }
        let read = |path: &std::path::Path| {
            let file = crate::exr_io::read(path, limits)?;
            Ok(Picture::of_layers(&file.layers, &path.display().to_string())?.into_owned())
        };
        let [a, b] = beside;
        Reference::with_halves(own.mean, [read(&a)?, read(&b)?], &place)
    }

    /// The picture itself.
    pub const fn mean(&self) -> &Picture<'a> {
        &self.mean
    }

    /// Its halves.
    pub const fn halves(&self) -> Option<&[Picture<'a>; 2]> {
        self.halves.as_ref()
    }

    /// The relMSE that the reference itself is expected to have against the truth: mean ((A − B)/2)²/(M² + ε). It is in every
    /// relMSE against this reference, but not in the unbiased one. `None` without halves.
    pub fn noise_floor(&self) -> Option<f64> {
        let [a, b] = self.halves.as_ref()?;
        let mut sum = 0.0;
        for channel in 0..3 {
            for pixel in 0..a.pixels() {
                let (a, b) = (a.value(channel, pixel), b.value(channel, pixel));
                let (half, mean) = (0.5 * (a - b), 0.5 * (a + b));
                sum += half * half / (mean * mean + EPSILON);
            }
        }
        Some(sum / (3 * a.pixels()) as f64)
    }

    /// Whether a picture has its size.
    ///
    /// # Errors
    /// [`Error::Invalid`] when not.
    pub fn fits(&self, picture: &Picture<'_>) -> Result<()> {
        same_size(picture, &self.mean)
    }

    /// The same reference, owning its planes.
    pub fn into_owned(self) -> Reference<'static> {
        Reference {
            mean: self.mean.into_owned(),
            halves: self.halves.map(|halves| halves.map(Picture::into_owned)),
        }
    }
}
