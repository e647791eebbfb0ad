//! The rendered picture on a screen: linear Rec.709 → exposure → sRGB curve → 8 bit.

use super::colormap::SIGNAL;
use super::view::actual_size;
use image::{Rgb, RgbImage};

/// How bright the picture is shown.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Exposure {
    /// By a rule (see [`beauty`]).
    #[default]
    Auto,
    /// In stops: radiance is multiplied by 2^EV.
    Ev(f32),
}

/// A tone-mapped picture.
#[derive(Clone, Debug)]
pub struct Beauty {
    /// 8-bit sRGB.
    pub image: RgbImage,
    /// The exposure used, in stops; [`Exposure::Ev`] with it draws the same picture again.
    pub ev: f32,
    /// Pixels with a channel that is not a finite number, drawn in [`SIGNAL`].
    pub nonfinite: usize,
}

/// Stops beyond which exposures are not followed.
const MAX_EV: f64 = 30.0;

/// Luminance above which, in averages, a pixel shows a light or a window rather than a lit surface.
const LIGHT: f64 = 6.0;

/// Tone-maps row-major planes of linear red, green and blue.
///
/// The automatic exposure puts the log-average luminance of the pixels that are neither black nor invalid at middle grey
/// (0.18), as photographers and Reinhard's operator do: a light source that is a thousand times brighter but covers few
/// pixels hardly moves it. It then leans towards a picture whose 90th percentile lies between 0.5 and 1, so that a white
/// room is not grey and a low-key scene not washed out, by at most one stop darker and two brighter; pixels more than
/// six times the average are lights or windows and do not count for that percentile. The result is rounded to 0.01
/// stops.
pub fn beauty(width: u32, height: u32, rgb: [&[f32]; 3], exposure: Exposure) -> Beauty {
    let [red, green, blue] = rgb;
    let len = red.len().min(green.len()).min(blue.len());
    let (columns, rows) = actual_size(width, height, len);
    let count = columns as usize * rows as usize;
    let pixels = || (0..count).map(|i| [red[i], green[i], blue[i]]);
    let ev = match exposure {
        Exposure::Ev(ev) if ev.is_finite() => f64::from(ev).clamp(-MAX_EV, MAX_EV),
        _ => auto_ev(pixels()),
    };
    let gain = ev.exp2() as f32;
    let mut nonfinite = 0;
    let mut image = RgbImage::new(columns, rows);
    for (target, pixel) in image.pixels_mut().zip(pixels()) {
        *target = Rgb(if pixel.iter().all(|c| c.is_finite()) {
            pixel.map(|c| srgb8(c * gain))
        } else {
            nonfinite += 1;
            SIGNAL
        });
    }
    Beauty { image, ev: ev as f32, nonfinite }
}

fn auto_ev(pixels: impl Iterator<Item = [f32; 3]>) -> f64 {
    let mut luminance: Vec<f64> = pixels
        .map(|[r, g, b]| 0.2126 * f64::from(r) + 0.7152 * f64::from(g) + 0.0722 * f64::from(b))
        .filter(|y| y.is_finite() && *y > 1e-6)
        .collect();
    if luminance.is_empty() {
        return 0.0;
    }
    let average = luminance.iter().map(|y| y.ln()).sum::<f64>() / luminance.len() as f64;
    let key = 0.18 / average.exp();
    // Something is at or below the average: never empty.
    luminance.retain(|y| *y <= LIGHT * average.exp());
    let index = luminance.len() * 9 / 10;
    let bright = *luminance.select_nth_unstable_by(index, f64::total_cmp).1;
    let gain = key.clamp(0.5 / bright, 1.0 / bright).clamp(key / 2.0, key * 4.0);
    ((gain.log2() * 100.0).round() / 100.0).clamp(-MAX_EV, MAX_EV)
}

/// The sRGB transfer curve (IEC 61966-2-1), to 8 bits.
fn srgb8(linear: f32) -> u8 {
    let linear = linear.clamp(0.0, 1.0);
    let encoded = if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 };
    (encoded * 255.0).round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grey(values: &[f32], exposure: Exposure) -> Beauty {
        beauty(values.len() as u32, 1, [values; 3], exposure)
    }

    #[test]
    fn srgb_curve_and_given_exposure() {
        let b = grey(&[0.0, 1.0, 0.214_041_14, 0.5, -3.0], Exposure::Ev(0.0));
        let at = |x| b.image.get_pixel(x, 0).0[0];
        assert_eq!((at(0), at(1), at(2), at(3), at(4)), (0, 255, 128, 188, 0));
        assert_eq!(grey(&[0.5], Exposure::Ev(1.0)).image.get_pixel(0, 0).0, [255; 3]);
    }

    #[test]
    fn auto_exposure_repeats_by_its_printed_value() {
        let values: Vec<f32> = (0..1000).map(|i| 0.003 + 0.0007 * i as f32).collect();
        let auto = grey(&values, Exposure::Auto);
        assert_eq!(auto.image, grey(&values, Exposure::Ev(auto.ev)).image);
    }

    #[test]
    fn a_visible_light_does_not_black_out_the_rest() {
        let mut values = vec![0.1; 900];
        let without = grey(&values, Exposure::Auto).ev;
        values[..27].fill(10_000.0);
        let with = grey(&values, Exposure::Auto);
        assert!(with.ev <= without && with.ev > without - 2.0, "{} {without}", with.ev);
        values[..200].fill(1000.0);
        assert!(grey(&values, Exposure::Auto).image.get_pixel(899, 0).0[0] > 20);
    }

    #[test]
    fn scaling_the_light_scales_the_exposure() {
        let values: Vec<f32> = (1..500).map(|i| i as f32 / 250.0).collect();
        let scaled: Vec<f32> = values.iter().map(|v| v * 64.0).collect();
        let (a, b) = (grey(&values, Exposure::Auto).ev, grey(&scaled, Exposure::Auto).ev);
        assert!((a - b - 6.0).abs() < 0.02, "{a} {b}");
    }

    #[test]
    fn hostile_pictures() {
        assert_eq!(grey(&[], Exposure::Auto).ev, 0.0);
        assert_eq!(grey(&[0.0; 4], Exposure::Auto).ev, 0.0);
        let b = grey(&[f32::NAN, f32::INFINITY, f32::MAX, 1.0], Exposure::Auto);
        assert_eq!((b.nonfinite, b.image.get_pixel(0, 0).0), (2, SIGNAL));
        assert!(grey(&[1.0], Exposure::Ev(f32::NAN)).ev.is_finite());
        let b = beauty(u32::MAX, 7, [&[1.0], &[], &[1.0]], Exposure::Auto);
        assert_eq!(b.image.dimensions(), (0, 0));
    }
}
