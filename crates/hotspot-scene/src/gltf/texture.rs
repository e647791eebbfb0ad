//! Texture slots of materials: image, sampler and KHR_texture_transform to a [`TextureRef`].

use std::collections::HashMap;

use super::document::Document;
use super::extensions;
use super::json::Element;
use crate::error::Result;
use crate::images::Images;
use crate::notes::Notes;
use crate::scene::{TextureRef, Wrap};

/// Decoded images, by index in the file too.
pub(crate) struct Textures {
    pub(crate) images: Images,
    by_image: HashMap<usize, u32>,
}

/// A texture slot.
pub(crate) struct Slot {
    pub(crate) texture: TextureRef,
    /// Which TEXCOORD_n it reads.
    pub(crate) uv_set: u64,
}

impl Textures {
    pub(crate) fn new(images: Images) -> Self {
        Self { images, by_image: HashMap::new() }
    }

    /// The slot that a `textureInfo` object describes; `None` where there is no image that we read (noted).
    pub(crate) fn slot<'a>(
        &mut self,
        doc: &Document<'a>,
        info: &Element<'a>,
        notes: &mut Notes,
    ) -> Result<Option<Slot>> {
        let Some((_, texture)) = doc.follow(info, "index", "textures")? else {
            return Err(info.wrong("index", "this is missing"));
        };
        extensions::note_unknown(info, &["KHR_texture_transform"], notes)?;
        extensions::note_unknown(&texture, &[], notes)?;
        let Some((index, image)) = doc.follow(&texture, "source", "images")? else {
            // Usual with formats that come by extension, which is named above.
            notes.repair("texture without an image left out", &texture.path, 1);
            return Ok(None);
        };
        let texture_index = match self.by_image.get(&index) {
            Some(known) => *known,
            None => {
                let new = self.decode(doc, index, &image, notes)?;
                self.by_image.insert(index, new);
                new
            }
        };
        let (wrap, nearest) = sampler(doc, &texture)?;
        let mut uv_set = info.integer("texCoord")?.unwrap_or(0);
        let mut transform = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        if let Some(extension) = info.extension("KHR_texture_transform")? {
            uv_set = extension.integer("texCoord")?.unwrap_or(uv_set);
            transform = matrix(&extension)?;
        }
        Ok(Some(Slot { texture: TextureRef { texture: texture_index, wrap, nearest, transform }, uv_set }))
    }

    fn decode<'a>(
        &mut self,
        doc: &Document<'a>,
        index: usize,
        image: &Element<'a>,
        notes: &mut Notes,
    ) -> Result<u32> {
        let uri = image.string("uri")?;
        let name = match (image.string("name")?, uri) {
            (Some(name), _) if !name.is_empty() => name.to_owned(),
            (_, Some(uri)) if !crate::uri::is_data(uri) => uri.to_owned(),
            _ => format!("image {index}"),
        };
        if let Some(uri) = uri {
            let path = image.path_of("uri");
            let encoded = doc.fetch(uri, &path)?;
            return self.images.add(&encoded, &name, &path, doc.budget, notes);
        }
        match doc.view(image, "bufferView")? {
            Some(view) => self.images.add(view.bytes, &name, &image.path, doc.budget, notes),
            None => Err(image.wrong_here("the image has neither a uri nor a bufferView")),
        }
    }
}

/// Wrap modes, and whether texels are not blended.
fn sampler<'a>(doc: &Document<'a>, texture: &Element<'a>) -> Result<([Wrap; 2], bool)> {
    let Some((_, sampler)) = doc.follow(texture, "sampler", "samplers")? else {
        return Ok(([Wrap::Repeat; 2], false));
    };
    let wrap = |key: &str| match sampler.integer(key)? {
        None | Some(10497) => Ok(Wrap::Repeat),
        Some(33071) => Ok(Wrap::Clamp),
        Some(33648) => Ok(Wrap::Mirror),
        Some(other) => Err(sampler.wrong(key, format!("{other} is not a wrap mode (10497, 33071 or 33648)"))),
    };
    let nearest = match sampler.integer("magFilter")? {
        None | Some(9729) => false,
        Some(9728) => true,
        Some(other) => {
            return Err(sampler.wrong("magFilter", format!("{other} is not a filter (9728 or 9729)")));
        }
    };
    Ok(([wrap("wrapS")?, wrap("wrapT")?], nearest))
}

/// The rows of KHR_texture_transform's matrix: scale, then rotate, then move.
///
/// The sense of the rotation is that of the extension's worked example (a rotation of π/2, scale ½ and offset (0, 1) cover
/// the lower left quadrant of the image), which viewers follow too.
fn matrix(extension: &Element<'_>) -> Result<[[f32; 3]; 2]> {
    let [tx, ty] = extension.numbers::<2>("offset")?.unwrap_or([0.0; 2]);
    let [sx, sy] = extension.numbers::<2>("scale")?.unwrap_or([1.0; 2]);
    let (s, c) = libm::sincos(extension.number("rotation")?.unwrap_or(0.0));
    let matrix = [[c * sx, s * sy, tx], [-s * sx, c * sy, ty]].map(|row| row.map(|n| n as f32));
    if matrix.iter().flatten().all(|n| n.is_finite()) {
        Ok(matrix)
    } else {
        Err(extension.wrong_here("a number is too large"))
    }
}
