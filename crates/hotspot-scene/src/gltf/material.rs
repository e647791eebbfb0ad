//! Materials: glTF's metallic-roughness model and its extensions to the scattering models of the scene.
//!
//! Which model a material becomes is decided by the first rule that applies: transmission is glass; metallic 1 is a mirror
//! (roughness 0) or rough metal; metallic 0 is matte (specularFactor 0) or substrate; in between is glTF's linear mix.

use gltf::material::AlphaMode;
use gltf::texture::Info;

use super::document::{Document, label};
use super::texture::Textures;
use crate::LoadError;
use crate::error::{REEXPORT, Result, invalid};
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

const IOR: &str = "extensions.KHR_materials_ior.ior";

/// A material and the sets of texture coordinates that its textures read: as [`crate::Mesh::uvs`] and as its second ones.
pub(crate) struct Loaded {
    pub(crate) material: Material,
    pub(crate) uv_sets: [Option<u32>; 2],
}

/// The material at `index`, under its name in the file.
pub(crate) fn read(
    doc: &Document<'_>,
    stated: &gltf::Material<'_>,
    index: usize,
    textures: &mut Textures,
    notes: &mut Notes,
) -> Result<Loaded> {
    let path = format!("materials[{index}]");
    doc.note_unknown(&path, stated.name(), &KNOWN, notes);
    let name = match stated.name() {
        Some(name) if !name.is_empty() => name.to_owned(),
        _ => format!("material {index}"),
    };
    let mut reader =
        Reader { doc, label: label(&path, stated.name()), path, stated, textures, notes, uv_sets: [None; 2] };
    let material = reader.material(name)?;
    Ok(Loaded { material, uv_sets: reader.uv_sets })
}

struct Reader<'d, 'a, 'r> {
    doc: &'d Document<'a>,
    stated: &'r gltf::Material<'r>,
    path: String,
    label: String,
    textures: &'r mut Textures,
    notes: &'r mut Notes,
    uv_sets: [Option<u32>; 2],
}

/// The values of `pbrMetallicRoughness`.
struct Pbr {
    base: Color,
    alpha: f32,
    metallic: Scalar,
    roughness: Scalar,
}

impl Reader<'_, '_, '_> {
    fn material(&mut self, name: String) -> Result<Material> {
        let pbr = self.pbr()?;
        let bsdf = match self.glass(&pbr)? {
            Some(glass) => glass,
            None => self.opaque(&pbr)?,
        };
        let emission = self.emission()?;
        let alpha = self.alpha(&pbr);
        if self.stated.normal_texture().is_some() {
            self.note("normalTexture", "the surface is drawn without bumps");
        }
        Ok(Material {
            name,
            bsdf,
            double_sided: self.stated.double_sided(),
            emission,
            alpha,
            normal_map: None,
        })
    }

    fn note(&mut self, feature: &str, effect: &str) {
        self.notes.unmodelled(feature, &self.label, effect);
    }

    fn wrong(&self, key: &str, problem: &str) -> LoadError {
        invalid(format!("{}.{key}", self.path), problem, REEXPORT)
    }

    fn pbr(&mut self) -> Result<Pbr> {
        let pbr = self.stated.pbr_metallic_roughness();
        let [r, g, b, alpha] = self.shares(pbr.base_color_factor(), "pbrMetallicRoughness.baseColorFactor");
        let texture = self.texture(pbr.base_color_texture(), "pbrMetallicRoughness.baseColorTexture")?;
        let [metallic] = self.shares([pbr.metallic_factor()], "pbrMetallicRoughness.metallicFactor");
        let [roughness] = self.shares([pbr.roughness_factor()], "pbrMetallicRoughness.roughnessFactor");
        let both = pbr.metallic_roughness_texture();
        let both = self.texture(both, "pbrMetallicRoughness.metallicRoughnessTexture")?;
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

    /// Numbers in 0..1; others are clamped and noted.
    fn shares<const N: usize>(&mut self, stated: [f32; N], key: &str) -> [f32; N] {
        let clamped = stated.map(|number| number.clamp(0.0, 1.0));
        let path = format!("{}.{key}", self.path);
        self.notes.repair("factor clamped to 0..1", &path, u64::from(clamped != stated));
        clamped
    }

    /// The texture in a slot. The textures of a material read two sets of coordinates at most; the first ones decide.
    fn texture(&mut self, info: Option<Info<'_>>, key: &str) -> Result<Option<TextureRef>> {
        let Some(info) = info else { return Ok(None) };
        let path = format!("{}.{key}", self.path);
        let Some(slot) = self.textures.slot(self.doc, &info, &path, self.notes)? else { return Ok(None) };
        for (i, set) in self.uv_sets.iter_mut().enumerate() {
            if *set.get_or_insert(slot.uv_set) == slot.uv_set {
                return Ok(Some(TextureRef { second_uvs: i == 1, ..slot.texture }));
            }
        }
        let slot = key.rsplit('.').next().unwrap_or_default();
        self.note(
            &format!("{slot} with texture coordinates of its own"),
            "the texture is left out: a material reads two sets at most",
        );
        Ok(None)
    }

    /// Glass, where the material transmits light.
    fn glass(&mut self, pbr: &Pbr) -> Result<Option<Bsdf>> {
        let Some(transmission) = self.stated.transmission() else { return Ok(None) };
        let factor = transmission.transmission_factor();
        let [factor] = self.shares([factor], "extensions.KHR_materials_transmission.transmissionFactor");
        if factor == 0.0 {
            return Ok(None);
        }
        if factor < 1.0 {
            self.note("transmissionFactor below 1", "the surface is clear glass");
        }
        if transmission.transmission_texture().is_some() {
            self.note("transmissionTexture", "the whole surface transmits");
        }
        if pbr.roughness.factor > 0.0 {
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
        let mut thin = true;
        if let Some(volume) = self.stated.volume() {
            thin = volume.thickness_factor() <= 0.0;
            if volume.thickness_texture().is_some() {
                self.note("thicknessTexture", "the thickness is that of the geometry");
            }
            if volume.attenuation_distance().is_finite() && volume.attenuation_color() != [1.0; 3] {
                self.note("attenuation in glass", "the glass absorbs nothing");
            }
        }
        Ok(Some(Bsdf::Glass { ior, thin, transmittance: pbr.base, absorption: [0.0; 3] }))
    }

    fn ior(&self) -> Result<f32> {
        match self.stated.ior().unwrap_or(1.5) {
            ior if ior >= 0.0 => Ok(ior),
            _ => Err(self.wrong(IOR, "an index of refraction is not below 0")),
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
        Ok(Bsdf::Mix { weight: pbr.metallic, base: Box::new(base), other: Box::new(metal()) })
    }

    /// Matte or substrate.
    fn dielectric(&mut self, pbr: &Pbr) -> Result<Bsdf> {
        let mut factor = 1.0;
        let mut color = [1.0; 3];
        if let Some(specular) = self.stated.specular() {
            let key = "extensions.KHR_materials_specular.specularFactor";
            [factor] = self.shares([specular.specular_factor()], key);
            color = specular.specular_color_factor();
            let slots = [
                ("specularTexture", specular.specular_texture().is_some()),
                ("specularColorTexture", specular.specular_color_texture().is_some()),
            ];
            for (slot, _) in slots.into_iter().filter(|(_, used)| *used && factor > 0.0) {
                self.note(slot, "the highlights have the same strength everywhere");
            }
        }
        if factor == 0.0 {
            return Ok(Bsdf::Matte { reflectance: pbr.base });
        }
        let ior = f64::from(self.ior()?);
        let f0 = ((ior - 1.0) / (ior + 1.0)).powi(2) * f64::from(factor);
        let specular = color.map(|c| (f0 * f64::from(c)).clamp(0.0, 1.0) as f32);
        Ok(Bsdf::Substrate {
            diffuse: pbr.base,
            specular: Color::constant(specular),
            specular_weight: Scalar::constant(1.0),
            roughness: pbr.roughness,
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
        Ok(Color { factor, texture: self.texture(self.stated.emissive_texture(), "emissiveTexture")? })
    }

    fn alpha(&self, pbr: &Pbr) -> Alpha {
        // Not looked up where it is 1 all over.
        let texture = pbr.base.texture.filter(|t| !self.textures.images.is_solid(t.texture));
        let alpha = Scalar { factor: pbr.alpha, texture: texture.map(|t| (t, Channel::A)) };
        match self.stated.alpha_mode() {
            AlphaMode::Blend if alpha != Scalar::constant(1.0) => Alpha::Blend { alpha },
            AlphaMode::Opaque | AlphaMode::Blend => Alpha::Opaque,
            AlphaMode::Mask => {
                let cutoff = self.stated.alpha_cutoff().unwrap_or(0.5);
                let whole = alpha.texture.is_none() && alpha.factor >= cutoff;
                if whole { Alpha::Opaque } else { Alpha::Mask { cutoff, alpha } }
            }
        }
    }
}
