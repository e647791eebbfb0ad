//! Pictures to bytes and files, and small versions of them.

use crate::{Error, Result};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder, RgbImage, imageops};
use std::io::Write;
use std::path::Path;

/// The picture as a PNG file in memory.
pub fn encode_png(image: &RgbImage) -> Result<Vec<u8>> {
    let (width, height) = image.dimensions();
    let mut bytes = Vec::new();
    PngEncoder::new_with_quality(&mut bytes, CompressionType::Default, FilterType::Adaptive)
        .write_image(image.as_raw(), width, height, ExtendedColorType::Rgb8)
        .map_err(|error| Error::Limit {
            place: "picture".into(),
            what: format!("{width} × {height} pixels cannot be a PNG ({error})"),
            advice: "choose another size".into(),
        })?;
    Ok(bytes)
}

/// Writes a PNG through a temporary file in the same folder, renamed when complete.
pub fn write_png(path: &Path, image: &RgbImage) -> Result<()> {
    write_atomic(path, &encode_png(image)?)
}

/// Writes bytes through a temporary file in the same folder, renamed when complete: readers see the old file or the
/// new one, never half of one.
pub fn write_atomic(path: &Path, bytes: &[u8]) -> Result<()> {
    let fail = |source| Error::Io { action: "write", path: path.to_owned(), source };
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    builder.prefix(".hotspot-");
    // Temporary files are private by default; these are to be as readable as any other file.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut file = builder.tempfile_in(folder).map_err(fail)?;
    file.write_all(bytes).map_err(fail)?;
    file.persist(path).map_err(|e| fail(e.error))?;
    Ok(())
}

/// A smaller version whose longer edge is at most `edge` pixels; never larger than the picture.
pub fn thumbnail(image: &RgbImage, edge: u32) -> RgbImage {
    let (width, height) = image.dimensions();
    let longest = width.max(height);
    if longest <= edge || longest == 0 {
        return image.clone();
    }
    let shrink =
        |length: u32| (u64::from(length) * u64::from(edge.max(1))).div_ceil(u64::from(longest)).max(1) as u32;
    imageops::thumbnail(image, shrink(width).min(width), shrink(height).min(height))
}

/// The part of a picture within a rectangle, as far as it lies inside.
pub fn crop(image: &RgbImage, x: u32, y: u32, width: u32, height: u32) -> RgbImage {
    let (x, y) = (x.min(image.width()), y.min(image.height()));
    let (width, height) = (width.min(image.width() - x), height.min(image.height() - y));
    imageops::crop_imm(image, x, y, width, height).to_image()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn writes_and_replaces_a_readable_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let image = RgbImage::from_fn(7, 5, |x, y| image::Rgb([x as u8 * 30, y as u8 * 40, 9]));
        std::fs::write(&path, b"old").unwrap();
        write_png(&path, &image).unwrap();
        assert_eq!(image::open(&path).unwrap().to_rgb8(), image);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "no temporary file left");
        let error = write_png(&folder.path().join("no/a.png"), &image).unwrap_err().to_string();
        assert!(error.contains("a.png") && error.contains("write"), "{error}");
    }

    #[test]
    fn thumbnails_and_crops_of_any_size() {
        let image = RgbImage::new(300, 10);
        assert_eq!(thumbnail(&image, 100).dimensions(), (100, 4));
        assert_eq!(thumbnail(&image, 1000).dimensions(), (300, 10));
        assert_eq!(thumbnail(&image, 0).dimensions(), (1, 1));
        assert_eq!(thumbnail(&RgbImage::new(0, 0), 10).dimensions(), (0, 0));
        assert_eq!(crop(&image, 290, 5, 100, 100).dimensions(), (10, 5));
        assert_eq!(crop(&image, u32::MAX, 5, u32::MAX, 1).dimensions(), (0, 1));
    }
}
