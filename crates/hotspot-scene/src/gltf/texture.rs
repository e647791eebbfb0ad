//! Texture slots of materials: image, sampler and KHR_texture_transform to a [`TextureRef`].
//!
//! Slots are read from the JSON: the crate knows those of few extensions, and the transform of few slots.

use std::collections::HashMap;

use gltf::texture::{MagFilter, Sampler, WrappingMode};
use serde_json::Value;

use super::document::{Document, label};
use super::member;
use crate::LoadError;
use crate::error::{REEXPORT, Result, invalid, unsupported};
use crate::images::Images;
use crate::left_out;
use crate::notes::Notes;
use crate::scene::{TextureRef, Wrap};

/// Extensions that put an image of another format into a texture, with what it is called.
pub(crate) const FOREIGN: [(&str, &str); 3] = [
    ("KHR_texture_basisu", "a KTX2 (Basis Universal)"),
    ("EXT_texture_avif", "an AVIF"),
    ("MSFT_texture_dds", "a DDS"),
];

const WEBP: &str = "EXT_texture_webp";

/// Images in use, by index in the file too.
pub(crate) struct Textures<'d> {
    pub(crate) images: Images<'d>,
    /// `None` for those left out.
    by_image: HashMap<usize, Option<u32>>,
}

/// A texture slot whose image is not read yet.
pub(crate) struct Slot {
    /// Index in the file's `textures`.
    texture: usize,
    transform: [[f32; 3]; 2],
    /// Which TEXCOORD_n it reads.
    pub(crate) uv_set: u32,
}

/// The slot that the `textureInfo` object at `path` describes.
pub(crate) fn slot(doc: &Document<'_>, info: &Value, path: &str, notes: &mut Notes) -> Result<Slot> {
    doc.note_unknown(path, None, &["KHR_texture_transform"], notes);
    let count = doc.gltf.textures().len();
    let texture = member::index(info, path, "index", count, "textures")?
        .ok_or_else(|| invalid(format!("{path}.index"), "this is missing", REEXPORT))?;
    // The schema sets no bound; beyond, there is no such set.
    let set = |key| member::index(info, path, key, u32::MAX as usize, "sets of texture coordinates");
    let stated = set("texCoord")?;
    let set = match set("extensions.KHR_texture_transform.texCoord")? {
        Some(set) => set,
        None => stated.unwrap_or(0),
    };
    let uv_set = u32::try_from(set).unwrap_or(u32::MAX);
    Ok(Slot { texture, transform: transform(info, path)?, uv_set })
}

impl<'d> Textures<'d> {
    pub(crate) fn new(images: Images<'d>) -> Self {
        Self { images, by_image: HashMap::new() }
    }

    /// The texture of a slot; `None` where there is no image, or none that can be read (noted).
    pub(crate) fn read(
        &mut self,
        doc: &'d Document<'_>,
        slot: &Slot,
        notes: &mut Notes,
    ) -> Result<Option<TextureRef>> {
        let Some(texture) = doc.gltf.textures().nth(slot.texture) else { return Ok(None) };
        let Some(image) = image(doc, &texture, notes)? else { return Ok(None) };
        let index = match self.by_image.get(&image) {
            Some(known) => *known,
            None => {
                let new = self.collect(doc, image, notes)?;
                self.by_image.insert(image, new);
                new
            }
        };
        let Some(index) = index else { return Ok(None) };
        let (wrap, nearest) = sampler(&texture.sampler());
        Ok(Some(TextureRef { texture: index, wrap, nearest, transform: slot.transform, second_uvs: false }))
    }

    /// An image that is missing, leads outside or is damaged is left out (noted); what refers to it inside of the file must
    /// be right, and limits hold. `gltf::Image::source` panics on images with neither URI nor view, so the JSON type is
    /// asked.
    fn collect(&mut self, doc: &'d Document<'_>, index: usize, notes: &mut Notes) -> Result<Option<u32>> {
        let path = format!("images[{index}]");
        let Some(image) = doc.gltf.as_json().images.get(index) else { return Ok(None) };
        let name = match (image.name.as_deref(), image.uri.as_deref()) {
            (Some(name), _) if !name.is_empty() => name.to_owned(),
            (_, Some(uri)) if !crate::uri::is_data(uri) => uri.to_owned(),
            _ => format!("image {index}"),
        };
        let view = image.buffer_view.and_then(|view| doc.gltf.views().nth(view.value()));
        let read = match (&image.uri, view) {
            (Some(uri), _) => {
                let path = format!("{path}.uri");
                let encoded = doc.fetch(uri, &path);
                encoded.and_then(|encoded| self.images.add(encoded, None, &name, &path, doc.budget))
            }
            (None, Some(view)) => self.images.add(doc.view(&view)?, None, &name, &path, doc.budget),
            (None, None) => Err(invalid(path, "the image has neither a uri nor a bufferView", REEXPORT)),
        };
        match read {
            Ok(index) => Ok(Some(index)),
            Err(error @ LoadError::Limit { .. }) => Err(error),
            Err(error) => {
                left_out::note(&error, notes);
                Ok(None)
            }
        }
    }
}

/// The index of a texture's image: a WebP is preferred, as the extension asks for. Of the formats that we lack, the
/// plain image beside them serves; where there is none, the texture is left out, unless the file requires it.
fn image(doc: &Document<'_>, texture: &gltf::Texture<'_>, notes: &mut Notes) -> Result<Option<usize>> {
    let path = format!("textures[{}]", texture.index());
    let [(basisu, _), (avif, _), (dds, _)] = FOREIGN;
    doc.note_unknown(&path, texture.name(), &[WEBP, basisu, avif, dds], notes);
    let json = doc.json().get("textures").and_then(|textures| textures.get(texture.index()));
    let count = doc.gltf.images().len();
    let webp =
        json.map(|json| member::index(json, &path, "extensions.EXT_texture_webp.source", count, "images"));
    if let Some(webp) = webp.transpose()?.flatten() {
        return Ok(Some(webp));
    }
    if let Some(source) = texture.source() {
        return Ok(Some(source.index()));
    }
    let extensions = json.and_then(|json| json.get("extensions"));
    let foreign = FOREIGN.iter().find(|(name, _)| extensions.is_some_and(|all| all.get(name).is_some()));
    match foreign {
        Some((extension, kind)) if doc.requires(extension) => Err(unsupported(
            format!("{path}.extensions.{extension}"),
            format!("the texture has {kind} image alone, which cannot be decoded"),
            "export the file again with PNG, JPEG or WebP textures",
        )),
        Some((extension, kind)) => {
            let effect = format!("the texture is left out: it has {kind} image alone");
            notes.unmodelled(extension, &label(&path, texture.name()), &effect);
            Ok(None)
        }
        None => {
            notes.repair("texture without an image left out", &path, 1);
            Ok(None)
        }
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
fn transform(info: &Value, path: &str) -> Result<[[f32; 3]; 2]> {
    let path = format!("{path}.extensions.KHR_texture_transform");
    let Some(stated) = member::at(info, "extensions.KHR_texture_transform") else {
        return Ok([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    };
    let [tx, ty] = member::numbers(stated, &path, "offset")?.unwrap_or([0.0; 2]);
    let [sx, sy] = member::numbers(stated, &path, "scale")?.unwrap_or([1.0; 2]);
    let (s, c) = libm::sincos(member::number(stated, &path, "rotation")?.unwrap_or(0.0));
    let matrix = [[c * sx, s * sy, tx], [-s * sx, c * sy, ty]].map(|row| row.map(|n| n as f32));
    if matrix.iter().flatten().all(|n| n.is_finite()) {
        Ok(matrix)
    } else {
        Err(invalid(path, "a number is too large", REEXPORT))
    }
}
