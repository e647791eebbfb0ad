//! Pictures to look at: binary PPM, sRGB-encoded, brightness such that the mean of what is not black is a middle grey.

use std::io;
use std::path::Path;

use hotspot_tests::picture::Picture;

/// Writes a picture.
pub(crate) fn write(picture: &Picture, path: &Path) -> io::Result<()> {
    let luminance = |p: &[f64; 3]| 0.2126 * p[0] + 0.7152 * p[1] + 0.0722 * p[2];
    let lit: Vec<f64> = picture.pixels.iter().map(luminance).filter(|l| *l > 1e-4).collect();
    let mean = lit.iter().sum::<f64>() / lit.len().max(1) as f64;
    // White surroundings are the usual case and stay white.
    let scale = if mean > 1.3 { 0.6 / mean } else { 1.0 };
    let mut bytes = format!("P6\n{} {}\n255\n", picture.width, picture.height).into_bytes();
    for value in picture.pixels.iter().flatten() {
        let value = (value * scale).clamp(0.0, 1.0);
        let encoded =
            if value <= 0.003_130_8 { 12.92 * value } else { 1.055 * value.powf(1.0 / 2.4) - 0.055 };
        bytes.push((encoded * 255.0).round() as u8);
    }
    std::fs::write(path, bytes)
}
