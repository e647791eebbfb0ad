//! FLIP by NVIDIA's own implementation, through the crate `nv-flip` (which compiles C++: feature `flip`).

use super::Picture;

/// Mean FLIP of a picture against a reference of the same size, both in sRGB at the reference's automatic exposure, at the
/// default 67 pixels per degree (a 4K monitor of 0.7 m from 0.7 m). `None` when built without the feature `flip`, when the
/// sizes differ, and for pictures of 2^29 pixels or more.
#[cfg(feature = "flip")]
pub fn flip(picture: &Picture<'_>, reference: &Picture<'_>) -> Option<f64> {
    use crate::maps::{Exposure, beauty};
    use nv_flip::{DEFAULT_PIXELS_PER_DEGREE, FlipImageRgb8};

    let (width, height) = reference.size();
    if picture.size() != reference.size() || reference.pixels() >= 1 << 29 {
        return None;
    }
    let seen = beauty(width, height, reference.planes(), Exposure::Auto);
    let test = beauty(width, height, picture.planes(), Exposure::Ev(seen.ev));
    let image = |rgb: &image::RgbImage| FlipImageRgb8::with_data(width, height, rgb.as_raw());
    let map = nv_flip::flip(image(&seen.image), image(&test.image), DEFAULT_PIXELS_PER_DEGREE).to_vec();
    Some(map.iter().map(|v| f64::from(*v)).sum::<f64>() / map.len() as f64)
}

/// Mean FLIP: `None`, since this was built without the feature `flip`.
#[cfg(not(feature = "flip"))]
pub const fn flip(_: &Picture<'_>, _: &Picture<'_>) -> Option<f64> {
    None
}
