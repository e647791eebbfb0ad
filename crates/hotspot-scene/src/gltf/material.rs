//! Materials: glTF's metallic-roughness model and its extensions to the scattering models of the scene.
//!
//! Which model a material becomes is decided by the first rule that applies: transmission is glass; metallic 1 is a mirror
//! (roughness 0) or rough metal; metallic 0 is matte (specularFactor 0) or substrate; in between is glTF's linear mix.

use super::document::Document;
use super::extensions;
use super::json::Element;
use super::texture::Textures;
use crate::error::Result;
use crate::notes::Notes;
use crate::scene::{Alpha, Bsdf, Channel, Color, Material, Scalar, TextureRef};

/// Extensions that [`read`] takes care of.
const KNOWN: [&str; 5] = [
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_volume",
];

/// A material and the set of texture coordinates that its textures read.
pub(crate) struct Loaded {
    pub(crate) material: Material,
    pub(crate) uv_set: Option<u64>,
}

/// The material at `index`, under its name in the file.
pub(crate) fn read<'a>(
    doc: &Document<'a>,
    index: usize,
    textures: &mut Textures,
    notes: &mut Notes,
) -> Result<Loaded> {
    let element = doc.root.item("materials", index)?;
    extensions::note_unknown(&element, &KNOWN, notes)?;
    let name = match element.string("name")? {
        Some(name) if !name.is_empty() => name.to_owned(),
        _ => format!("material {index}"),
    };
    let mut reader = Reader { doc, label: element.label(), element, textures, notes, uv_set: None };
    let material = reader.material(name)?;
    Ok(Loaded { material, uv_set: reader.uv_set })
}

struct Reader<'d, 'a, 'r> {
    doc: &'d Document<'a>,
    element: Element<'a>,
    label: String,
    textures: &'r mut Textures,
    notes: &'r mut Notes,
    uv_set: Option<u64>,
}

/// The values of `pbrMetallicRoughness`.
struct Pbr {
    base: Color,
    alpha: f32,
    metallic: Scalar,
    roughness: Scalar,
}

impl<'a> Reader<'_, 'a, '_> {
    fn material(&mut self, name: String) -> Result<Material> {
        let pbr = self.pbr()?;
        let bsdf = match self.glass(&pbr)? {
            Some(glass) => glass,
            None => self.opaque(&pbr)?,
        };
        let emission = self.emission()?;
        let alpha = self.alpha(&pbr)?;
        if self.element.get("normalTexture").is_some() {
            self.note("normalTexture", "the surface is drawn without bumps");
        }
        Ok(Material { name, bsdf, double_sided: self.element.boolean("doubleSided")?, emission, alpha })
    }

    fn note(&mut self, feature: &str, effect: &str) {
        self.notes.unmodelled(feature, &self.label, effect);
    }

    fn pbr(&mut self) -> Result<Pbr> {
        let white = Color::constant([1.0; 3]);
        let one = Scalar::constant(1.0);
        let Some(pbr) = self.element.object("pbrMetallicRoughness")? else {
            return Ok(Pbr { base: white, alpha: 1.0, metallic: one, roughness: one });
        };
        let factor = pbr.floats::<4>("baseColorFactor")?.unwrap_or([1.0; 4]);
        let [r, g, b, alpha] = factor.map(|f| f.clamp(0.0, 1.0));
        let outside = factor != [r, g, b, alpha];
        self.notes.repair("factor clamped to 0..1", &pbr.path_of("baseColorFactor"), u64::from(outside));
        let texture = self.texture(&pbr, "baseColorTexture")?;
        let metallic = self.share(&pbr, "metallicFactor", 1.0)?;
        let roughness = self.share(&pbr, "roughnessFactor", 1.0)?;
        let both = self.texture(&pbr, "metallicRoughnessTexture")?;
        // A factor of 0 makes the texture irrelevant.
        let scaled = |factor: f32, channel| Scalar {
            factor,
            texture: both.filter(|_| factor > 0.0).map(|texture| (texture, channel)),
        };
        Ok(Pbr {
            base: Color { factor: [r, g, b], texture },
            alpha,
            metallic: scaled(metallic, Channel::B),
            roughness: scaled(roughness, Channel::G),
        })
    }

    /// A number in 0..1; others are clamped and noted.
    fn share(&mut self, element: &Element<'a>, key: &str, default: f32) -> Result<f32> {
        let value = element.float(key)?.unwrap_or(default);
        let clamped = value.clamp(0.0, 1.0);
        self.notes.repair("factor clamped to 0..1", &element.path_of(key), u64::from(clamped != value));
        Ok(clamped)
    }

    /// The texture in a slot. All textures of a material must read the same coordinates; the first decides.
    fn texture(&mut self, element: &Element<'a>, key: &str) -> Result<Option<TextureRef>> {
        let Some(info) = element.object(key)? else { return Ok(None) };
        let Some(slot) = self.textures.slot(self.doc, &info, self.notes)? else { return Ok(None) };
        if *self.uv_set.get_or_insert(slot.uv_set) == slot.uv_set {
            Ok(Some(slot.texture))
        } else {
            self.note(
                &format!("{key} with its own texture coordinates"),
                "the texture is left out: a material's textures share one set",
            );
            Ok(None)
        }
    }

    /// Glass, where the material transmits light.
    fn glass(&mut self, pbr: &Pbr) -> Result<Option<Bsdf>> {
        let Some(transmission) = self.element.extension("KHR_materials_transmission")? else {
            return Ok(None);
        };
        let factor = self.share(&transmission, "transmissionFactor", 0.0)?;
        if factor == 0.0 {
            return Ok(None);
        }
        if factor < 1.0 {
            self.note("transmissionFactor below 1", "the surface is clear glass");
        }
        if transmission.get("transmissionTexture").is_some() {
            self.note("transmissionTexture", "the whole surface transmits");
        }
        if pbr.roughness.factor > 0.0 {
            self.note("rough glass", "the glass is smooth");
        }
        let ior = self.ior()?;
        if ior == 0.0 {
            let extension = self.element.path_of("extensions.KHR_materials_ior.ior");
            return Err(crate::error::invalid(
                extension,
                "an index of refraction of 0 cannot transmit",
                "set it to 1 or more",
            ));
        }
        let mut thin = true;
        if let Some(volume) = self.element.extension("KHR_materials_volume")? {
            thin = volume.float("thicknessFactor")?.unwrap_or(0.0) <= 0.0;
            if volume.get("thicknessTexture").is_some() {
                self.note("thicknessTexture", "the thickness is that of the geometry");
            }
            let tint = volume.floats::<3>("attenuationColor")?.unwrap_or([1.0; 3]);
            if volume.float("attenuationDistance")?.is_some() && tint != [1.0; 3] {
                self.note("attenuation in glass", "the glass absorbs nothing");
            }
        }
        Ok(Some(Bsdf::Glass { ior, thin, transmittance: pbr.base }))
    }

    fn ior(&mut self) -> Result<f32> {
        let Some(extension) = self.element.extension("KHR_materials_ior")? else { return Ok(1.5) };
        match extension.float("ior")?.unwrap_or(1.5) {
            ior if ior >= 0.0 => Ok(ior),
            _ => Err(extension.wrong("ior", "an index of refraction is not below 0")),
        }
    }

    fn opaque(&mut self, pbr: &Pbr) -> Result<Bsdf> {
        let metal = || {
            if pbr.roughness.factor == 0.0 {
                Bsdf::Mirror { reflectance: pbr.base }
            } else {
                Bsdf::RoughMetal { f0: pbr.base, roughness: pbr.roughness }
            }
        };
        if pbr.metallic == Scalar::constant(1.0) {
            return Ok(metal());
        }
        let base = self.dielectric(pbr)?;
        if pbr.metallic.factor == 0.0 {
            return Ok(base);
        }
        Ok(Bsdf::Mix { metallic: pbr.metallic, base: Box::new(base), metal: Box::new(metal()) })
    }

    /// Matte or substrate.
    fn dielectric(&mut self, pbr: &Pbr) -> Result<Bsdf> {
        let mut factor = 1.0;
        let mut color = [1.0; 3];
        if let Some(specular) = self.element.extension("KHR_materials_specular")? {
            factor = self.share(&specular, "specularFactor", 1.0)?;
            color = specular.floats::<3>("specularColorFactor")?.unwrap_or(color);
            for slot in ["specularTexture", "specularColorTexture"] {
                if specular.get(slot).is_some() && factor > 0.0 {
                    self.note(slot, "the highlights have the same strength everywhere");
                }
            }
        }
        if factor == 0.0 {
            return Ok(Bsdf::Matte { reflectance: pbr.base });
        }
        let ior = f64::from(self.ior()?);
        let f0 = ((ior - 1.0) / (ior + 1.0)).powi(2) * f64::from(factor);
        let specular = color.map(|c| (f0 * f64::from(c)).clamp(0.0, 1.0) as f32);
        Ok(Bsdf::Substrate { diffuse: pbr.base, specular, roughness: pbr.roughness })
    }

    fn emission(&mut self) -> Result<Color> {
        let factor = self.element.floats::<3>("emissiveFactor")?.unwrap_or([0.0; 3]);
        let path = self.element.path_of("emissiveFactor");
        self.notes.repair("negative emission set to 0", &path, u64::from(factor.iter().any(|f| *f < 0.0)));
        let mut strength = 1.0;
        if let Some(extension) = self.element.extension("KHR_materials_emissive_strength")? {
            strength = extension.number("emissiveStrength")?.unwrap_or(1.0);
            if strength < 0.0 {
                return Err(extension.wrong("emissiveStrength", "a strength is not below 0"));
            }
        }
        let factor = factor.map(|f| (f64::from(f.max(0.0)) * strength) as f32);
        if !factor.iter().all(|f| f.is_finite()) {
            return Err(self.element.wrong("emissiveFactor", "factor times strength is too large"));
        }
        if factor == [0.0; 3] {
            return Ok(Color::constant(factor));
        }
        let element = self.element.clone();
        Ok(Color { factor, texture: self.texture(&element, "emissiveTexture")? })
    }

    fn alpha(&mut self, pbr: &Pbr) -> Result<Alpha> {
        // Not looked up where it is 1 all over.
        let texture = pbr.base.texture.filter(|t| !self.textures.images.is_solid(t.texture));
        let alpha = Scalar { factor: pbr.alpha, texture: texture.map(|t| (t, Channel::A)) };
        match self.element.string("alphaMode")? {
            None | Some("OPAQUE") => Ok(Alpha::Opaque),
            Some("BLEND") if alpha == Scalar::constant(1.0) => Ok(Alpha::Opaque),
            Some("BLEND") => Ok(Alpha::Blend { alpha }),
            Some("MASK") => {
                let cutoff = self.element.float("alphaCutoff")?.unwrap_or(0.5);
                let whole = alpha.texture.is_none() && alpha.factor >= cutoff;
                Ok(if whole { Alpha::Opaque } else { Alpha::Mask { cutoff, alpha } })
            }
            Some(_) => Err(self.element.wrong("alphaMode", "the mode is none of OPAQUE, MASK and BLEND")),
        }
    }
}
