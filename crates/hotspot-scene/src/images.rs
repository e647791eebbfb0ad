//! Encoded images to [`Texture`]s, under limits, each content once.

use std::collections::HashMap;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::io::Cursor;

use image::{ImageFormat, ImageReader, Limits};

use crate::budget::Budget;
use crate::error::{REEXPORT, Result, invalid, limit, unsupported};
use crate::notes::Notes;
use crate::options::LoadOptions;
use crate::scene::Texture;

/// The scene's textures while it loads.
pub(crate) struct Images {
    textures: Vec<Texture>,
    /// Whether every texel's alpha is 1, per texture.
    solid: Vec<bool>,
    /// Hash of size and texels to candidates.
    by_content: HashMap<u64, Vec<u32>>,
    pixels: u64,
    max_dimension: u32,
    max_pixels: u64,
}

impl Images {
    pub(crate) fn new(options: &LoadOptions) -> Self {
        Self {
            textures: Vec::new(),
            solid: Vec::new(),
            by_content: HashMap::new(),
            pixels: 0,
            max_dimension: options.max_texture_dimension,
            max_pixels: options.max_texture_pixels,
        }
    }

    pub(crate) fn into_textures(self) -> Vec<Texture> {
        self.textures
    }

    /// Whether texture `index` is opaque everywhere, so that its alpha need not be looked up.
    pub(crate) fn is_solid(&self, index: u32) -> bool {
        self.solid.get(index as usize).copied().unwrap_or(true)
    }

    /// Decodes PNG or JPEG, recognised by content. Gives the index of an equal texture where there is one.
    pub(crate) fn add(
        &mut self,
        encoded: &[u8],
        name: &str,
        element: &str,
        budget: &Budget,
        notes: &mut Notes,
    ) -> Result<u32> {
        let broken = |error: image::ImageError| match error {
            image::ImageError::Limits(_) => limit(
                element,
                format!("decoding the image \"{name}\" needs more memory than the limit leaves"),
                "use a smaller image, or raise the memory limit",
            ),
            error => invalid(element, format!("the image \"{name}\" cannot be decoded ({error})"), REEXPORT),
        };
        let format = match image::guess_format(encoded) {
            Ok(format @ (ImageFormat::Png | ImageFormat::Jpeg)) => format,
            _ => {
                return Err(unsupported(
                    element,
                    format!("the image \"{name}\" is neither PNG nor JPEG"),
                    "convert it to PNG or JPEG",
                ));
            }
        };
        let (width, height) =
            ImageReader::with_format(Cursor::new(encoded), format).into_dimensions().map_err(broken)?;
        let pixels = u64::from(width) * u64::from(height);
        if width.max(height) > self.max_dimension {
            return Err(limit(
                element,
                format!(
                    "the image \"{name}\" has {width}x{height} texels, the limit is {} per side",
                    self.max_dimension
                ),
                "use a smaller image",
            ));
        }
        self.pixels = self.pixels.saturating_add(pixels);
        if self.pixels > self.max_pixels {
            return Err(limit(
                element,
                format!(
                    "with the image \"{name}\" the scene has {} texels, the limit is {}",
                    self.pixels, self.max_pixels
                ),
                "use smaller images",
            ));
        }
        // The decoder's own picture (up to 8 bytes a texel) and the RGBA copy.
        budget.charge(pixels, 12, element)?;
        let mut reader = ImageReader::with_format(Cursor::new(encoded), format);
        let mut limits = Limits::default();
        limits.max_image_width = Some(self.max_dimension);
        limits.max_image_height = Some(self.max_dimension);
        limits.max_alloc = Some(pixels.saturating_mul(8).saturating_add(budget.left()));
        reader.limits(limits);
        let decoded = reader.decode().map_err(broken)?;
        if decoded.color().bytes_per_pixel() > decoded.color().channel_count() {
            notes.repair("16-bit image reduced to 8 bits", element, 1);
        }
        let rgba = decoded.into_rgba8();
        let texture = Texture {
            name: name.into(),
            width: rgba.width(),
            height: rgba.height(),
            rgba: rgba.into_raw().into(),
        };
        Ok(self.unite(texture))
    }

    /// The index of `texture`, or of one that holds the same texels.
    fn unite(&mut self, texture: Texture) -> u32 {
        let mut hasher = DefaultHasher::new();
        (texture.width, texture.height, &texture.rgba).hash(&mut hasher);
        let candidates = self.by_content.entry(hasher.finish()).or_default();
        let same = candidates.iter().copied().find(|i| {
            self.textures.get(*i as usize).is_some_and(|other| {
                (other.width, other.height) == (texture.width, texture.height) && other.rgba == texture.rgba
            })
        });
        same.unwrap_or_else(|| {
            // Each texture has at least one texel and all texels are limited, but a limit may be set beyond u32.
            let index = u32::try_from(self.textures.len()).unwrap_or(u32::MAX);
            candidates.push(index);
            self.solid.push(texture.rgba.chunks_exact(4).all(|texel| texel.last() == Some(&255)));
            self.textures.push(texture);
            index
        })
    }
}
