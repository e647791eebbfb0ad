//! Encoded images to [`Texture`]s, under limits and within a budget, each content once.
//!
//! Images are collected while materials are read and decoded together at the end: only then is it known how much all of
//! them take, and so how far the largest must be reduced to fit.

use std::borrow::Cow;
use std::cell::Cell;
use std::collections::{BinaryHeap, HashMap};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::io::Cursor;
use std::rc::Rc;

use image::{ImageDecoder, ImageFormat, ImageReader, Limits, RgbaImage};

use crate::LoadError;
use crate::budget::{Budget, readable};
use crate::error::{REEXPORT, Result, invalid, limit, unsupported};
use crate::left_out;
use crate::notes::Notes;
use crate::options::LoadOptions;
use crate::reduce::reduce;
use crate::scene::{Bsdf, Color, Material, Texture};

/// The formats that are read, for people.
const FORMATS: &str = "PNG, JPEG, WebP, BMP, GIF and TGA";

/// What decoding takes for a moment, in bytes a texel: the decoder's own picture (up to 8) and an RGBA copy.
const TRANSIENT: u64 = 12;

/// The scene's images while it loads. Those borrowed live for `'a`.
pub(crate) struct Images<'a> {
    /// One for each texture of the scene.
    sources: Vec<Source<'a>>,
    /// Hash of the encoded bytes to candidates.
    by_content: HashMap<u64, Vec<u32>>,
    /// Source and glossiness (as bits) to the texture made of them.
    roughness: HashMap<(u32, u32), u32>,
    pixels: u64,
    max_dimension: u32,
    max_pixels: u64,
    max_bytes: u64,
}

/// An image that is not decoded yet.
struct Source<'a> {
    encoded: Rc<Cow<'a, [u8]>>,
    format: ImageFormat,
    name: String,
    element: String,
    size: [u32; 2],
    has_alpha: bool,
    /// The texture holds 1 - glossiness * alpha instead of the picture.
    glossiness: Option<f32>,
    /// What [`Images::is_solid`] has found.
    solid: Cell<Option<bool>>,
}

/// Decoded textures.
pub(crate) struct Finished {
    pub(crate) textures: Vec<Texture>,
    /// Whether every texel's alpha is 1, per texture.
    pub(crate) solid: Vec<bool>,
}

impl<'a> Images<'a> {
    pub(crate) fn new(options: &LoadOptions) -> Self {
        Self {
            sources: Vec::new(),
            by_content: HashMap::new(),
            roughness: HashMap::new(),
            pixels: 0,
            max_dimension: options.max_texture_dimension,
            max_pixels: options.max_texture_pixels,
            max_bytes: options.max_texture_bytes,
        }
    }

    /// Takes an image and reads its header. Its format is recognised by content; `unmarked` is the one to try where the
    /// content has no mark of a format. Gives the index that its texture will have, which is that of an image of the same
    /// bytes where there is one. Pixels are decoded by [`Images::finish`].
    ///
    /// # Errors
    /// Of the kind `Limit` where the image is more than the limits grant, `Unsupported` where its format is not read, and
    /// `Invalid` where it is damaged.
    pub(crate) fn add(
        &mut self,
        encoded: impl Into<Cow<'a, [u8]>>,
        unmarked: Option<ImageFormat>,
        name: &str,
        element: &str,
        budget: &Budget,
    ) -> Result<u32> {
        let encoded = encoded.into();
        let mut hasher = DefaultHasher::new();
        encoded.hash(&mut hasher);
        let hash = hasher.finish();
        let known =
            self.by_content.get(&hash).into_iter().flatten().copied().find(|index| {
                self.sources.get(*index as usize).is_some_and(|source| *source.encoded == encoded)
            });
        if let Some(known) = known {
            return Ok(known);
        }
        let format = format_of(&encoded).or(unmarked).ok_or_else(|| {
            let problem = format!("the image \"{name}\" is in a format that is not read; {FORMATS} are");
            unsupported(element, problem, "convert it to PNG or JPEG")
        })?;
        let decoder = ImageReader::with_format(Cursor::new(&*encoded), format)
            .into_decoder()
            .map_err(|error| broken(error, name, element))?;
        let ((width, height), has_alpha) = (decoder.dimensions(), decoder.color_type().has_alpha());
        drop(decoder);
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
        // A record, and room in the tables.
        budget.charge(1, size_of::<Source<'_>>() as u64 + 256, element)?;
        let index = self.push(Source {
            encoded: Rc::new(encoded),
            format,
            name: name.into(),
            element: element.into(),
            size: [width, height],
            has_alpha,
            glossiness: None,
            solid: Cell::new(None),
        })?;
        self.by_content.entry(hash).or_default().push(index);
        Ok(index)
    }

    /// A further texture of image `index`: in every channel, the roughness 1 - glossiness * alpha. `None` where the image
    /// has no alpha channel, so that the roughness is the same everywhere.
    pub(crate) fn roughness(&mut self, index: u32, glossiness: f32) -> Result<Option<u32>> {
        let Some(source) = self.sources.get(index as usize).filter(|source| source.has_alpha) else {
            return Ok(None);
        };
        let key = (index, glossiness.to_bits());
        if let Some(known) = self.roughness.get(&key) {
            return Ok(Some(*known));
        }
        let new = self.push(Source {
            encoded: Rc::clone(&source.encoded),
            format: source.format,
            name: format!("{} (roughness)", source.name),
            element: source.element.clone(),
            size: source.size,
            has_alpha: false,
            glossiness: Some(glossiness),
            solid: Cell::new(None),
        })?;
        self.roughness.insert(key, new);
        Ok(Some(new))
    }

    fn push(&mut self, source: Source<'a>) -> Result<u32> {
        self.pixels = self.pixels.saturating_add(source.pixels());
        if self.pixels > self.max_pixels {
            return Err(limit(
                source.element,
                format!(
                    "with the image \"{}\" the scene has {} texels, the limit is {}",
                    source.name, self.pixels, self.max_pixels
                ),
                "use smaller images",
            ));
        }
        // Each has at least one texel and all texels are limited, but a limit may be set beyond u32.
        let index = u32::try_from(self.sources.len())
            .map_err(|_| limit(source.element.as_str(), "there are more than 2³² images", "use fewer"))?;
        self.sources.push(source);
        Ok(index)
    }

    /// Whether texture `index` is opaque everywhere, so that its alpha need not be looked up. Decodes it where its header
    /// leaves that open.
    pub(crate) fn is_solid(&self, index: u32, budget: &Budget) -> bool {
        let Some(source) = self.sources.get(index as usize).filter(|source| source.has_alpha) else {
            return true;
        };
        if let Some(known) = source.solid.get() {
            return known;
        }
        // What cannot be decoded is left out by `finish`.
        let fits = source.pixels().saturating_mul(TRANSIENT) <= budget.left();
        let solid =
            fits && source.decode(budget, &mut Notes::default()).is_ok_and(|picture| is_solid(&picture));
        source.solid.set(Some(solid));
        solid
    }

    /// Decodes everything. The sum of the textures' bytes is kept within the texture budget, and within what the memory
    /// limit leaves, by halving the sides of the largest (noted). Images that turn out to be damaged are left out of the
    /// materials (noted).
    pub(crate) fn finish(
        self,
        materials: &mut [Material],
        budget: &Budget,
        notes: &mut Notes,
    ) -> Result<Finished> {
        let mut is_color = vec![false; self.sources.len()];
        materials.iter().for_each(|material| mark_colors(material, &mut is_color));
        let sizes = self.plan(budget, notes)?;
        let mut finished = Finished { textures: Vec::new(), solid: Vec::new() };
        // The index that each texture has in the end.
        let mut places = Vec::new();
        for ((source, size), is_color) in self.sources.into_iter().zip(sizes).zip(is_color) {
            let mut picture = match source.decode(budget, notes) {
                Ok(picture) => picture,
                Err(error @ LoadError::Limit { .. }) => return Err(error),
                Err(error) => {
                    left_out::note(&error, notes);
                    places.push(None);
                    continue;
                }
            };
            // Fewer than `push` has counted.
            places.push(Some(finished.textures.len() as u32));
            if let Some(glossiness) = source.glossiness {
                for texel in picture.chunks_exact_mut(4) {
                    let alpha = f32::from(texel.last().copied().unwrap_or(255));
                    // Within 0..=255: glossiness is within 0..1.
                    texel.fill((255.0 - glossiness * alpha).round() as u8);
                }
            }
            // Frees the encoded bytes with their last user.
            let Source { name, element, size: whole, .. } = source;
            let rgba =
                if size == whole { picture.into_raw() } else { reduce(&picture, size, is_color, &element)? };
            finished.solid.push(rgba.chunks_exact(4).all(|texel| texel.last() == Some(&255)));
            finished.textures.push(Texture { name, width: size[0], height: size[1], rgba: rgba.into() });
        }
        if places.contains(&None) {
            materials.iter_mut().for_each(|material| left_out::renumber(material, &places, notes));
        }
        Ok(finished)
    }

    /// The size that each texture is given. Charges what decoding takes.
    fn plan(&self, budget: &Budget, notes: &mut Notes) -> Result<Vec<[u32; 2]>> {
        let mut sizes: Vec<[u32; 2]> = self.sources.iter().map(|source| source.size).collect();
        let Some(largest) = self.sources.iter().max_by_key(|source| source.pixels()) else {
            return Ok(sizes);
        };
        // Images are decoded one after the other.
        budget.charge(largest.pixels(), TRANSIENT, &largest.element)?;
        let room = self.max_bytes.min(budget.left());
        let bytes = |[width, height]: [u32; 2]| 4 * u64::from(width) * u64::from(height);
        let mut sum = sizes.iter().fold(0u64, |sum, size| sum.saturating_add(bytes(*size)));
        if sum > room {
            // The largest first; of equals the one met first.
            let mut heap: BinaryHeap<_> =
                sizes.iter().enumerate().map(|(i, size)| (bytes(*size), std::cmp::Reverse(i))).collect();
            while sum > room
                && let Some((before, std::cmp::Reverse(i))) = heap.pop()
            {
                let Some(size) = sizes.get_mut(i).filter(|size| **size != [1, 1]) else { break };
                *size = size.map(|side| (side / 2).max(1));
                let after = bytes(*size);
                sum = sum.saturating_sub(before - after);
                heap.push((after, std::cmp::Reverse(i)));
            }
        }
        budget.charge(sum, 1, &largest.element)?;
        if sum > room {
            return Err(limit(
                largest.element.as_str(),
                format!("{} images do not fit the texture budget of {}", sizes.len(), readable(room)),
                "raise the texture budget",
            ));
        }
        for (source, size) in self.sources.iter().zip(&sizes).filter(|(source, size)| source.size != **size) {
            let ([w, h], [width, height]) = (source.size, *size);
            let effect = format!(
                "reduced from {w}x{h} to {width}x{height} to fit the texture budget of {}",
                readable(room)
            );
            notes.unmodelled(
                "texture resolution",
                &format!("{} \"{}\"", source.element, source.name),
                &effect,
            );
        }
        Ok(sizes)
    }
}

impl Source<'_> {
    fn pixels(&self) -> u64 {
        u64::from(self.size[0]) * u64::from(self.size[1])
    }

    /// The picture at its full size.
    fn decode(&self, budget: &Budget, notes: &mut Notes) -> Result<RgbaImage> {
        let mut reader = ImageReader::with_format(Cursor::new(self.encoded.as_ref().as_ref()), self.format);
        let mut limits = Limits::default();
        limits.max_image_width = Some(self.size[0]);
        limits.max_image_height = Some(self.size[1]);
        limits.max_alloc = Some(self.pixels().saturating_mul(8).saturating_add(budget.left()));
        reader.limits(limits);
        let decoded = reader.decode().map_err(|error| broken(error, &self.name, &self.element))?;
        if decoded.color().bytes_per_pixel() > decoded.color().channel_count() {
            notes.repair("16-bit image reduced to 8 bits", &self.element, 1);
        }
        let picture = decoded.into_rgba8();
        if [picture.width(), picture.height()] == self.size {
            Ok(picture)
        } else {
            let problem = format!("the image \"{}\" is not of the size that its header states", self.name);
            Err(invalid(self.element.as_str(), problem, REEXPORT))
        }
    }
}

/// The format by the mark at the content's beginning.
fn format_of(encoded: &[u8]) -> Option<ImageFormat> {
    image::guess_format(encoded).ok().filter(|format| {
        use ImageFormat::{Bmp, Gif, Jpeg, Png, WebP};
        matches!(format, Png | Jpeg | WebP | Bmp | Gif)
    })
}

fn is_solid(picture: &RgbaImage) -> bool {
    picture.pixels().all(|texel| texel.0[3] == 255)
}

fn broken(error: image::ImageError, name: &str, element: &str) -> LoadError {
    match error {
        image::ImageError::Limits(_) => limit(
            element,
            format!("decoding the image \"{name}\" needs more memory than the limit leaves"),
            "use a smaller image, or raise the memory limit",
        ),
        error => invalid(element, format!("the image \"{name}\" cannot be decoded ({error})"), REEXPORT),
    }
}

/// Marks the textures that a material looks up as colours.
fn mark_colors(material: &Material, is_color: &mut [bool]) {
    let mut mark = |color: &Color| {
        let marked = color.texture.and_then(|texture| is_color.get_mut(texture.texture as usize));
        if let Some(marked) = marked {
            *marked = true;
        }
    };
    mark(&material.emission);
    colors_of(&material.bsdf, &mut mark);
}

/// Mixes are as deep as the loaders nest them: twice at most.
fn colors_of(bsdf: &Bsdf, visit: &mut impl FnMut(&Color)) {
    match bsdf {
        Bsdf::Matte { reflectance } | Bsdf::Mirror { reflectance } => visit(reflectance),
        Bsdf::Substrate { diffuse, specular, .. } => {
            visit(diffuse);
            visit(specular);
        }
        Bsdf::RoughMetal { f0, .. } => visit(f0),
        Bsdf::Glass { transmittance, .. } => visit(transmittance),
        Bsdf::Unlit { color } => visit(color),
        Bsdf::Mix { base, other, .. } => {
            colors_of(base, visit);
            colors_of(other, visit);
        }
    }
}
