//! A plane of costs as a picture in false colours, legend burned in.

use super::colormap::{ColorMap, SIGNAL};
use super::legend::Legend;
use super::view::{Scale, View, view};
use image::{Rgb, RgbImage};

/// Steps of a colour table; odd, so that zero of a diverging map has an entry of its own.
const STEPS: usize = 1025;

/// What to draw and how.
#[derive(Clone, Debug, Default)]
pub struct HeatOptions {
    /// What the plane holds, for people: "Intersection cost".
    pub label: String,
    /// Its unit: "nodes + triangles per path", "µs per path". May be empty.
    pub unit: String,
    /// Colour map; a diverging one makes the scale symmetric about zero.
    pub map: ColorMap,
    /// How the scale's ends are found.
    pub scale: Scale,
    /// Replace values above the 99.9th percentile by the median of their 3×3 neighbourhood, for `time_us`.
    pub despike: bool,
}

/// A finished picture and the facts of its legend.
#[derive(Clone, Debug)]
pub struct HeatMap {
    /// The map with its top left corner at (0, 0), the legend below it. Wider than the map where the map is too narrow
    /// for the legend.
    pub image: RgbImage,
    /// Columns and rows of the map itself.
    pub size: (u32, u32),
    /// Lower end of the scale.
    pub lo: f32,
    /// Upper end of the scale.
    pub hi: f32,
    /// Percentile that set the scale; `None` when it was fixed or nothing needed clipping.
    pub clip_percentile: Option<f64>,
    /// Finite pixels outside the scale.
    pub clipped: usize,
    /// Pixels replaced by their 3×3 median.
    pub despiked: usize,
    /// Pixels that are not finite numbers, drawn in [`SIGNAL`].
    pub nonfinite: usize,
}

/// Draws a row-major plane.
pub fn heat_map(width: u32, height: u32, values: &[f32], options: &HeatOptions) -> HeatMap {
    let view = view(width, height, values, options.scale, options.despike, options.map.is_diverging());
    let legend = Legend::new(&view, options);
    let lut = options.map.lut(STEPS);
    let (columns, rows) = view.size;
    let mut image = RgbImage::from_pixel(legend.width, rows + legend.height, Rgb([12, 12, 14]));
    for (i, value) in view.values.iter().enumerate() {
        let (x, y) = (i as u32 % columns, i as u32 / columns);
        image.put_pixel(x, y, Rgb(color(&view, &lut, *value)));
    }
    legend.draw(&mut image, rows, &view, &lut);
    let View { size, lo, hi, clip_percentile, clipped, despiked, nonfinite, .. } = view;
    HeatMap { image, size, lo, hi, clip_percentile, clipped, despiked, nonfinite }
}

fn color(view: &View, lut: &[[u8; 3]], value: f32) -> [u8; 3] {
    if !value.is_finite() {
        return SIGNAL;
    }
    let t = ((value - view.lo) / (view.hi - view.lo)).clamp(0.0, 1.0);
    lut.get((t * (lut.len() - 1) as f32).round() as usize).copied().unwrap_or(SIGNAL)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn options(map: ColorMap) -> HeatOptions {
        HeatOptions { label: "Intersection cost".into(), unit: "µs".into(), map, ..Default::default() }
    }

    #[test]
    fn zero_is_neutral_and_signs_mirror() {
        let heat = heat_map(3, 1, &[-2.0, 0.0, 2.0], &options(ColorMap::RedBlue));
        let lut = ColorMap::RedBlue.lut(STEPS);
        let at = |x| heat.image.get_pixel(x, 0).0;
        assert_eq!((at(0), at(1), at(2)), (lut[0], lut[STEPS / 2], lut[STEPS - 1]));
        assert!(at(2)[0] > at(2)[2], "red where the second is costlier");
    }

    #[test]
    fn small_pictures_get_a_wider_canvas() {
        let heat = heat_map(64, 48, &vec![1.0; 64 * 48], &options(ColorMap::Inferno));
        assert_eq!(heat.size, (64, 48));
        assert!(heat.image.width() >= 200 && heat.image.height() > 48);
        let big = heat_map(640, 360, &vec![1.0; 640 * 360], &options(ColorMap::Inferno));
        assert_eq!(big.image.width(), 640);
    }

    #[test]
    fn signal_colour_marks_what_is_not_finite() {
        let heat = heat_map(3, 1, &[f32::NAN, 1.0, f32::INFINITY], &options(ColorMap::Viridis));
        assert_eq!(heat.nonfinite, 2);
        assert_eq!((heat.image.get_pixel(0, 0).0, heat.image.get_pixel(2, 0).0), (SIGNAL, SIGNAL));
    }

    #[test]
    fn hostile_input_still_gives_a_picture() {
        let mut hostile = options(ColorMap::Turbo);
        hostile.label = "\u{202e}\0🔥".repeat(10_000);
        hostile.unit = "x".repeat(100_000);
        for (w, h, n) in [(0, 0, 0), (u32::MAX, u32::MAX, 3), (1, 1, 1), (5, 1000, 12)] {
            let heat = heat_map(w, h, &vec![f32::MAX; n], &hostile);
            assert!(heat.image.width() > 0 && heat.image.height() > 0);
        }
    }
}
