//! `sky.hdr`: a small equirectangular sky with a sun, in Radiance's format without run lengths.

use crate::gltf_writer::File;
use crate::math::{sin_cos, v};

const WIDTH: usize = 64;
const HEIGHT: usize = 32;

/// The sun's texels: 2 x 2, ahead to the left (towards -x and -z), 40 degrees up.
const SUN: ([usize; 2], [usize; 2]) = ([24, 25], [8, 9]);

/// Radiance at a texel.
fn radiance(x: usize, y: usize) -> [f64; 3] {
    if SUN.0.contains(&x) && SUN.1.contains(&y) {
        return [320.0, 280.0, 220.0];
    }
    // Azimuth from straight ahead (-z) to the right, and height.
    let (sin, cos) = sin_cos((x as f64 + 0.5) / WIDTH as f64 - 0.5);
    let (_, height) = sin_cos((y as f64 + 0.5) / (2.0 * HEIGHT as f64));
    let to_sun = v(sin, 0.0, -cos).dot(v(-0.69, 0.0, -0.72));
    let warm = (0.5 + 0.5 * to_sun) * (1.0 - height.abs());
    if height < 0.0 {
        return [0.16, 0.14, 0.11].map(|c| c * (0.6 + 0.4 * warm));
    }
    [0.35 + 0.9 * warm - 0.2 * height, 0.5 + 0.45 * warm - 0.1 * height, 0.85 + 0.1 * warm]
}

/// Shared-exponent bytes of a colour above 1e-9.
fn rgbe(color: [f64; 3]) -> [u8; 4] {
    let largest = color.into_iter().fold(0.0, f64::max);
    // The power of two above the largest.
    let mut exponent = 0i32;
    let mut scale = 1.0;
    while largest >= scale {
        scale *= 2.0;
        exponent += 1;
    }
    while largest < scale / 2.0 {
        scale /= 2.0;
        exponent -= 1;
    }
    let [r, g, b] = color.map(|c| (c / scale * 256.0).floor().min(255.0) as u8);
    [r, g, b, (exponent + 128) as u8]
}

pub(super) fn file() -> File {
    let mut bytes =
        format!("#?RADIANCE\n# CC0-1.0\nFORMAT=32-bit_rle_rgbe\n\n-Y {HEIGHT} +X {WIDTH}\n").into_bytes();
    for y in 0..HEIGHT {
        for x in 0..WIDTH {
            bytes.extend(rgbe(radiance(x, y)));
        }
    }
    File { path: "features/sky.hdr".into(), bytes }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shared_exponents_hold_the_colour() {
        assert_eq!(rgbe([1.0, 0.5, 0.25]), [128, 64, 32, 129]);
        assert_eq!(rgbe([0.25, 0.0, 0.0]), [128, 0, 0, 127]);
        assert_eq!(rgbe([320.0, 280.0, 220.0]), [160, 140, 110, 137]);
    }
}
