//! Materials: glTF's models and their extensions to the scattering models of the scene.
//!
//! Which model a material becomes: KHR_materials_unlit is unlit; KHR_materials_pbrSpecularGlossiness is a substrate
//! (see [`super::specular_glossiness`]); all else is metallic-roughness, whose metallic factor mixes a dielectric (at 0) with
//! a metal (at 1). The metal is a mirror (roughness 0) or rough; the dielectric is matte (specularFactor 0) or a substrate,
//! and KHR_materials_transmission mixes in glass. So a metal transmits nothing, as that extension has it. Mixes of weight 0
//! or 1 all over are not made.
//!
//! occlusionTexture is not read: it stands for shadows that a path tracer computes.

use gltf::material::AlphaMode;
use serde_json::Value;

use super::document::{Document, label};
use super::member;
use super::texture::{self, Textures};
use crate::LoadError;
use crate::error::{REEXPORT, Result, invalid};
use crate::left_out;
use crate::notes::{Notes, cut};
use crate::scene::{Alpha, Bsdf, Channel, Color, Material, NormalMap, Scalar, TextureRef};

/// Extensions that [`read`] takes care of.
const KNOWN: [&str; 13] = [
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_dispersion",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_iridescence",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_volume",
];

/// Extensions that are not modelled, the factor without which they do nothing, and what is missing in the picture.
const UNMODELLED: [(&str, &str, &str); 5] = [
    ("KHR_materials_clearcoat", "clearcoatFactor", "the glossy coat over the surface is missing"),
    ("KHR_materials_sheen", "sheenColorFactor", "the velvety sheen at grazing angles is missing"),
    ("KHR_materials_iridescence", "iridescenceFactor", "the colours of the thin film are missing"),
    ("KHR_materials_anisotropy", "anisotropyStrength", "highlights are round instead of stretched"),
    (
        "KHR_materials_diffuse_transmission",
        "diffuseTransmissionFactor",
        "no light shines through from behind, as it does through leaves and paper",
    ),
];

const IOR: &str = "extensions.KHR_materials_ior.ior";
const SPECULAR: &str = "extensions.KHR_materials_specular";
const TRANSMISSION: &str = "extensions.KHR_materials_transmission";
const VOLUME: &str = "extensions.KHR_materials_volume";

/// A material and the sets of texture coordinates that its textures read: as [`crate::Mesh::uvs`] and as its second ones.
pub(crate) struct Loaded {
    pub(crate) material: Material,
    pub(crate) uv_sets: [Option<u32>; 2],
}

/// The material at `index`, under its name in the file.
pub(crate) fn read<'d>(
    doc: &'d Document<'_>,
    stated: &gltf::Material<'_>,
    index: usize,
    textures: &mut Textures<'d>,
    notes: &mut Notes,
) -> Result<Loaded> {
    let path = format!("materials[{index}]");
    doc.note_unknown(&path, stated.name(), &KNOWN, notes);
    let name = match stated.name() {
        Some(name) if !name.is_empty() => cut(name).to_owned(),
        _ => format!("material {index}"),
    };
    let json = doc.json().get("materials").and_then(|materials| materials.get(index)).unwrap_or(&Value::Null);
    let label = label(&path, stated.name());
    let mut reader = Reader { doc, label, path, stated, json, textures, notes, uv_sets: [None; 2] };
    let material = reader.material(name)?;
    Ok(Loaded { material, uv_sets: reader.uv_sets })
}

/// Makes a material opaque whose alpha is 1 all over; done when its textures are decoded. `solid` tells the textures whose
/// alpha is 1, `by_vertex` whether the vertices' colours have a say.
pub(crate) fn settle_alpha(material: &mut Material, solid: &[bool], by_vertex: bool) {
    let (Alpha::Mask { alpha, .. } | Alpha::Blend { alpha }) = &mut material.alpha else { return };
    alpha.texture = alpha.texture.filter(|(texture, channel)| {
        *channel != Channel::A || solid.get(texture.texture as usize) == Some(&false)
    });
    let factor = alpha.factor;
    let uniform = alpha.texture.is_none() && !by_vertex;
    let opaque = match material.alpha {
        Alpha::Mask { cutoff, .. } => uniform && factor >= cutoff,
        _ => uniform && factor >= 1.0,
    };
    if opaque {
        material.alpha = Alpha::Opaque;
    }
}

pub(super) struct Reader<'d, 'a, 'r> {
    doc: &'d Document<'a>,
    stated: &'r gltf::Material<'r>,
    json: &'d Value,
    path: String,
    label: String,
    pub(super) textures: &'r mut Textures<'d>,
    notes: &'r mut Notes,
    uv_sets: [Option<u32>; 2],
}

/// How a material scatters, and its alpha before the mode has its say.
pub(super) struct Surface {
    pub(super) bsdf: Bsdf,
    pub(super) alpha: Scalar,
}

/// A colour and the alpha that comes with it.
pub(super) struct Base {
    pub(super) color: Color,
    pub(super) alpha: Scalar,
}

impl Reader<'_, '_, '_> {
    fn material(&mut self, name: String) -> Result<Material> {
        let unlit = self.has("extensions.KHR_materials_unlit");
        let surface = if unlit {
            let Base { color, alpha } = self.base()?;
            Surface { bsdf: Bsdf::Unlit { color }, alpha }
        } else if self.has("extensions.KHR_materials_pbrSpecularGlossiness") {
            super::specular_glossiness::read(self)?
        } else {
            self.metallic_roughness()?
        };
        let (emission, normal_map) = if unlit {
            (Color::constant([0.0; 3]), None)
        } else {
            self.note_unmodelled();
            (self.emission()?, self.normal_map()?)
        };
        let alpha = match self.stated.alpha_mode() {
            AlphaMode::Opaque => Alpha::Opaque,
            AlphaMode::Blend => Alpha::Blend { alpha: surface.alpha },
            AlphaMode::Mask => {
                Alpha::Mask { cutoff: self.stated.alpha_cutoff().unwrap_or(0.5), alpha: surface.alpha }
            }
        };
        let double_sided = self.stated.double_sided();
        Ok(Material { name, bsdf: surface.bsdf, double_sided, emission, alpha, normal_map })
    }

    /// Whether there is a member at `key`.
    pub(super) fn has(&self, key: &str) -> bool {
        member::at(self.json, key).is_some()
    }

    pub(super) fn note(&mut self, feature: &str, effect: &str) {
        self.notes.unmodelled(feature, &self.label, effect);
    }

    fn wrong(&self, key: &str, problem: &str) -> LoadError {
        invalid(format!("{}.{key}", self.path), problem, REEXPORT)
    }

    /// Numbers in 0..1 at `key`; others are clamped and noted.
    pub(super) fn shares<const N: usize>(&mut self, key: &str, absent: [f32; N]) -> Result<[f32; N]> {
        let stated = if N == 1 {
            member::number(self.json, &self.path, key)?.map(|number| [number as f32; N])
        } else {
            member::numbers::<N>(self.json, &self.path, key)?.map(|numbers| numbers.map(|n| n as f32))
        };
        let Some(stated) = stated else { return Ok(absent) };
        let clamped = stated.map(|number| number.clamp(0.0, 1.0));
        let path = format!("{}.{key}", self.path);
        self.notes.repair("factor clamped to 0..1", &path, u64::from(clamped != stated));
        Ok(clamped)
    }

    pub(super) fn share(&mut self, key: &str, absent: f32) -> Result<f32> {
        self.shares(key, [absent]).map(|[share]| share)
    }

    /// The texture in the slot at `key`. The textures of a material read two sets of coordinates at most; the first ones
    /// decide.
    pub(super) fn texture(&mut self, key: &str) -> Result<Option<TextureRef>> {
        let Some(info) = member::at(self.json, key) else { return Ok(None) };
        let slot = texture::slot(self.doc, info, &format!("{}.{key}", self.path), self.notes)?;
        for (i, set) in self.uv_sets.iter_mut().enumerate() {
            if *set.get_or_insert(slot.uv_set) == slot.uv_set {
                let texture = self.textures.read(self.doc, &slot, self.notes)?;
                return Ok(texture.map(|texture| TextureRef { second_uvs: i == 1, ..texture }));
            }
        }
        let slot = key.rsplit('.').next().unwrap_or_default();
        self.note(
            &format!("{slot} with texture coordinates of its own"),
            "the texture is left out: a material reads two sets at most",
        );
        Ok(None)
    }

    /// A colour and an alpha, each factor times texture.
    pub(super) fn tinted(&mut self, factor: &str, texture: &str) -> Result<Base> {
        let [r, g, b, alpha] = self.shares(factor, [1.0; 4])?;
        let texture = self.texture(texture)?;
        Ok(Base {
            color: Color { factor: [r, g, b], texture },
            alpha: Scalar { factor: alpha, texture: texture.map(|texture| (texture, Channel::A)) },
        })
    }

    fn base(&mut self) -> Result<Base> {
        self.tinted("pbrMetallicRoughness.baseColorFactor", "pbrMetallicRoughness.baseColorTexture")
    }

    fn note_unmodelled(&mut self) {
        for (extension, key, effect) in UNMODELLED {
            let factor = member::at(self.json, &format!("extensions.{extension}.{key}"));
            let acts = |number: &Value| number.as_f64().is_some_and(|number| number != 0.0);
            if factor
                .is_some_and(|factor| acts(factor) || factor.as_array().is_some_and(|n| n.iter().any(acts)))
            {
                self.note(extension, effect);
            }
        }
    }

    fn metallic_roughness(&mut self) -> Result<Surface> {
        let Base { color: base, alpha } = self.base()?;
        let metallic = self.share("pbrMetallicRoughness.metallicFactor", 1.0)?;
        let roughness = self.share("pbrMetallicRoughness.roughnessFactor", 1.0)?;
        let slot = "pbrMetallicRoughness.metallicRoughnessTexture";
        let transmission =
            if metallic == 1.0 && !self.has(slot) { Scalar::constant(0.0) } else { self.transmission()? };
        // Read where something depends on it: clear glass has no roughness here.
        let clear = transmission == Scalar::constant(1.0);
        let both = if metallic > 0.0 || (roughness > 0.0 && !clear) { self.texture(slot)? } else { None };
        let scaled = |factor: f32, channel| Scalar {
            factor,
            texture: both.filter(|_| factor > 0.0).map(|texture| (texture, channel)),
        };
        let (metallic, roughness) = (scaled(metallic, Channel::B), scaled(roughness, Channel::G));
        let metal = || {
            if roughness.factor == 0.0 {
                Bsdf::Mirror { reflectance: base }
            } else {
                Bsdf::RoughMetal { f0: base, roughness }
            }
        };
        if metallic == Scalar::constant(1.0) {
            return Ok(Surface { bsdf: metal(), alpha });
        }
        let dielectric = if transmission.factor == 0.0 {
            self.opaque(base, roughness)?
        } else {
            let glass = self.glass(base, roughness)?;
            if clear { glass } else { mix(transmission, self.opaque(base, roughness)?, glass) }
        };
        let bsdf = if metallic.factor == 0.0 { dielectric } else { mix(metallic, dielectric, metal()) };
        Ok(Surface { bsdf, alpha })
    }

    /// The share of light that passes through what is not metal.
    fn transmission(&mut self) -> Result<Scalar> {
        let factor = self.share(&format!("{TRANSMISSION}.transmissionFactor"), 0.0)?;
        if factor == 0.0 {
            return Ok(Scalar::constant(0.0));
        }
        let texture = self.texture(&format!("{TRANSMISSION}.transmissionTexture"))?;
        Ok(Scalar { factor, texture: texture.map(|texture| (texture, Channel::R)) })
    }

    fn glass(&mut self, base: Color, roughness: Scalar) -> Result<Bsdf> {
        if roughness.factor > 0.0 {
            self.note("rough glass", "the glass is smooth");
        }
        let ior = self.ior()?;
        if ior == 0.0 {
            return Err(invalid(
                format!("{}.{IOR}", self.path),
                "an index of refraction of 0 cannot transmit",
                "set it to 1 or more",
            ));
        }
        let thickness = member::number(self.json, &self.path, &format!("{VOLUME}.thicknessFactor"))?;
        let thin = thickness.unwrap_or(0.0) <= 0.0;
        let mut absorption = [0.0; 3];
        if !thin {
            if self.has(&format!("{VOLUME}.thicknessTexture")) {
                self.note("thicknessTexture", "the thickness is that of the geometry");
            }
            absorption = self.absorption()?;
            let dispersion = "extensions.KHR_materials_dispersion.dispersion";
            if member::number(self.json, &self.path, dispersion)?.unwrap_or(0.0) > 0.0 {
                self.note("KHR_materials_dispersion", "the glass does not split light into colours");
            }
        }
        Ok(Bsdf::Glass { ior, thin, transmittance: base, absorption })
    }

    /// KHR_materials_volume's attenuation coefficient, -ln(attenuationColor) / attenuationDistance, per unit of length.
    /// A channel that lets nothing through is given a colour of 1e-30: dark beyond any picture, and finite.
    fn absorption(&mut self) -> Result<[f32; 3]> {
        let key = format!("{VOLUME}.attenuationDistance");
        // Infinite by default.
        let Some(distance) = member::number(self.json, &self.path, &key)? else { return Ok([0.0; 3]) };
        let color = self.shares(&format!("{VOLUME}.attenuationColor"), [1.0; 3])?;
        if distance <= 0.0 {
            let path = format!("{}.{key}", self.path);
            self.notes.repair("attenuation distance not above 0: no light is absorbed", &path, 1);
            return Ok([0.0; 3]);
        }
        // Not below 0, since the colour is not above 1; the sum turns -0 into 0.
        let per_length =
            |c: f32| (-libm::log(f64::from(c).max(1e-30)) / distance).min(f64::from(f32::MAX)) + 0.0;
        Ok(color.map(|c| per_length(c) as f32))
    }

    fn ior(&self) -> Result<f32> {
        match self.stated.ior().unwrap_or(1.5) {
            ior if ior >= 0.0 => Ok(ior),
            _ => Err(self.wrong(IOR, "an index of refraction is not below 0")),
        }
    }

    /// Matte or substrate. By KHR_materials_specular, the reflectance at normal incidence is
    /// min(((ior - 1) / (ior + 1))² specularColor, 1) specularFactor. The colour's factor is bounded before its texture
    /// is multiplied in.
    fn opaque(&mut self, base: Color, roughness: Scalar) -> Result<Bsdf> {
        let factor = self.share(&format!("{SPECULAR}.specularFactor"), 1.0)?;
        if factor == 0.0 {
            return Ok(Bsdf::Matte { reflectance: base });
        }
        let key = format!("{SPECULAR}.specularColorFactor");
        let color = member::numbers::<3>(self.json, &self.path, &key)?.unwrap_or([1.0; 3]);
        let ior = f64::from(self.ior()?);
        let f0 = ((ior - 1.0) / (ior + 1.0)).powi(2);
        let weight = self.texture(&format!("{SPECULAR}.specularTexture"))?;
        let texture = self.texture(&format!("{SPECULAR}.specularColorTexture"))?;
        // Without a texture the weight is part of the colour.
        let (inside, outside) = if weight.is_some() { (1.0, factor) } else { (f64::from(factor), 1.0) };
        let specular = color.map(|c| ((f0 * c).clamp(0.0, 1.0) * inside) as f32);
        Ok(Bsdf::Substrate {
            diffuse: base,
            specular: Color { factor: specular, texture },
            specular_weight: Scalar { factor: outside, texture: weight.map(|texture| (texture, Channel::A)) },
            roughness,
        })
    }

    fn emission(&mut self) -> Result<Color> {
        let factor = self.stated.emissive_factor();
        let path = format!("{}.emissiveFactor", self.path);
        self.notes.repair("negative emission set to 0", &path, u64::from(factor.iter().any(|f| *f < 0.0)));
        let strength = f64::from(self.stated.emissive_strength().unwrap_or(1.0));
        if strength < 0.0 {
            let key = "extensions.KHR_materials_emissive_strength.emissiveStrength";
            return Err(self.wrong(key, "a strength is not below 0"));
        }
        let factor = factor.map(|f| (f64::from(f.max(0.0)) * strength) as f32);
        if !factor.iter().all(|f| f.is_finite()) {
            return Err(self.wrong("emissiveFactor", "factor times strength is too large"));
        }
        if factor == [0.0; 3] {
            return Ok(Color::constant(factor));
        }
        let texture = self.texture("emissiveTexture")?;
        if texture.is_none() && self.has("emissiveTexture") {
            left_out::note_emission(&self.label, self.notes);
            return Ok(Color::constant([0.0; 3]));
        }
        Ok(Color { factor, texture })
    }

    fn normal_map(&mut self) -> Result<Option<NormalMap>> {
        let scale = member::number(self.json, &self.path, "normalTexture.scale")?.unwrap_or(1.0) as f32;
        if scale == 0.0 {
            return Ok(None);
        }
        let texture = self.texture("normalTexture")?;
        Ok(texture.map(|texture| NormalMap { texture, scale }))
    }
}

fn mix(weight: Scalar, base: Bsdf, other: Bsdf) -> Bsdf {
    Bsdf::Mix { weight, base: Box::new(base), other: Box::new(other) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Wrap;

    #[test]
    fn alpha_settles_by_texture_factor_and_vertices() {
        let texture = TextureRef {
            texture: 0,
            wrap: [Wrap::Repeat; 2],
            nearest: false,
            transform: [[0.0; 3]; 2],
            second_uvs: false,
        };
        let settled = |alpha: Alpha, solid: bool, by_vertex: bool| {
            let mut material = Material { alpha, ..Material::default_matte("x") };
            settle_alpha(&mut material, &[solid], by_vertex);
            material.alpha
        };
        let scalar =
            |factor, textured: bool| Scalar { factor, texture: textured.then_some((texture, Channel::A)) };
        let blend = |factor, textured| Alpha::Blend { alpha: scalar(factor, textured) };
        let mask = |factor, textured| Alpha::Mask { cutoff: 0.5, alpha: scalar(factor, textured) };
        assert_eq!(settled(blend(1.0, true), true, false), Alpha::Opaque);
        assert_eq!(settled(blend(1.0, true), false, false), blend(1.0, true));
        assert_eq!(settled(blend(0.5, true), true, false), blend(0.5, false));
        assert_eq!(settled(mask(0.5, true), true, false), Alpha::Opaque);
        assert_eq!(settled(mask(0.25, true), true, false), mask(0.25, false));
        // Vertices of alpha below 1 make it matter again.
        assert_eq!(settled(blend(1.0, true), true, true), blend(1.0, false));
        assert_eq!(settled(mask(0.5, false), true, true), mask(0.5, false));
    }
}
