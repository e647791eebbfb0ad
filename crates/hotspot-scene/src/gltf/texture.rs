//! Texture slots of materials: image, sampler and KHR_texture_transform to a [`TextureRef`].

use std::collections::HashMap;

use gltf::texture::{Info, MagFilter, Sampler, TextureTransform, WrappingMode};

use super::document::Document;
use crate::error::{REEXPORT, Result, invalid};
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
    pub(crate) uv_set: u32,
}

impl Textures {
    pub(crate) fn new(images: Images) -> Self {
        Self { images, by_image: HashMap::new() }
    }

    /// The slot that the `textureInfo` object at `path` describes; `None` where there is no image that we read (noted).
    pub(crate) fn slot(
        &mut self,
        doc: &Document<'_>,
        info: &Info<'_>,
        path: &str,
        notes: &mut Notes,
    ) -> Result<Option<Slot>> {
        let texture = info.texture();
        let texture_path = format!("textures[{}]", texture.index());
        doc.note_unknown(path, None, &["KHR_texture_transform"], notes);
        doc.note_unknown(&texture_path, texture.name(), &[], notes);
        let Some(image) = texture.source() else {
            // Usual with formats that come by extension, which is named above.
            notes.repair("texture without an image left out", &texture_path, 1);
            return Ok(None);
        };
        let texture_index = match self.by_image.get(&image.index()) {
            Some(known) => *known,
            None => {
                let new = self.decode(doc, image.index(), notes)?;
                self.by_image.insert(image.index(), new);
                new
            }
        };
        let (wrap, nearest) = sampler(&texture.sampler());
        let mut uv_set = info.tex_coord();
        let mut transform = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        if let Some(extension) = info.texture_transform() {
            uv_set = extension.tex_coord().unwrap_or(uv_set);
            transform = matrix(&extension, path)?;
        }
        Ok(Some(Slot {
            texture: TextureRef { texture: texture_index, wrap, nearest, transform, second_uvs: false },
            uv_set,
        }))
    }

    /// `gltf::Image::source` panics on images with neither URI nor view, so the JSON type is asked.
    fn decode(&mut self, doc: &Document<'_>, index: usize, notes: &mut Notes) -> Result<u32> {
        let path = format!("images[{index}]");
        let neither = || invalid(path.as_str(), "the image has neither a uri nor a bufferView", REEXPORT);
        let image = doc.gltf.as_json().images.get(index).ok_or_else(neither)?;
        let name = match (image.name.as_deref(), image.uri.as_deref()) {
            (Some(name), _) if !name.is_empty() => name.to_owned(),
            (_, Some(uri)) if !crate::uri::is_data(uri) => uri.to_owned(),
            _ => format!("image {index}"),
        };
        if let Some(uri) = &image.uri {
            let path = format!("{path}.uri");
            let encoded = doc.fetch(uri, &path)?;
            return self.images.add(&encoded, &name, &path, doc.budget, notes);
        }
        let view = image.buffer_view.and_then(|view| doc.gltf.views().nth(view.value()));
        self.images.add(doc.view(&view.ok_or_else(neither)?)?, &name, &path, doc.budget, notes)
    }
}

/// Wrap modes, and whether texels are not blended.
fn sampler(sampler: &Sampler<'_>) -> ([Wrap; 2], bool) {
    let wrap = [sampler.wrap_s(), sampler.wrap_t()].map(|mode| match mode {
        WrappingMode::Repeat => Wrap::Repeat,
        WrappingMode::ClampToEdge => Wrap::Clamp,
        WrappingMode::MirroredRepeat => Wrap::Mirror,
    });
    (wrap, sampler.mag_filter() == Some(MagFilter::Nearest))
}

/// The rows of KHR_texture_transform's matrix: scale, then rotate, then move.
///
/// The sense of the rotation is that of the extension's worked example (a rotation of π/2, scale ½ and offset (0, 1) cover
/// the lower left quadrant of the image), which viewers follow too.
fn matrix(extension: &TextureTransform<'_>, path: &str) -> Result<[[f32; 3]; 2]> {
    let [tx, ty] = extension.offset().map(f64::from);
    let [sx, sy] = extension.scale().map(f64::from);
    let (s, c) = libm::sincos(f64::from(extension.rotation()));
    let matrix = [[c * sx, s * sy, tx], [-s * sx, c * sy, ty]].map(|row| row.map(|n| n as f32));
    if matrix.iter().flatten().all(|n| n.is_finite()) {
        Ok(matrix)
    } else {
        Err(invalid(format!("{path}.extensions.KHR_texture_transform"), "a number is too large", REEXPORT))
    }
}
