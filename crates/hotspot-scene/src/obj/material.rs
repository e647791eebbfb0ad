//! From what an MTL file states to a [`Material`].
//!
//! The first rule that applies decides:
//! 1. **Glass**, a solid with Ni (1.5 by default): illumination models 6 and 7, which ask for refraction, unless Tf is 0 or
//!    d says "opaque" beside a Ni of 1. Models 4 and 9 ask for glass too, but no program means it by the number alone: Maya
//!    writes 4 (and Tf 1 1 1) for everything, Blender 9 for every surface whose alpha is below 1. So they are glass where Tf is
//!    a filter, neither 0 nor 1 all over. Where Pr or Pm is stated, Tf is the share that passes (as Blender writes it), so that
//!    any above 0 is glass. In all other models (3ds Max writes Tf 1 1 1 with 2) Tf says nothing.
//! 2. **Metallic-roughness**, where Pr, Pm or a map of them is stated: as glTF's. Metallic 1 is a mirror (roughness 0) or rough
//!    metal, metallic 0 a substrate with the reflectance of Ni (1.5 by default), between them is their mix. Roughness is 1
//!    by default, or that of Ns where it is stated.
//! 3. **Mirror**: models 3 and 5, of reflectance Ks.
//! 4. **Matte**: models 0 and 1, which have no highlights, and materials without Ks.
//! 5. **Substrate**: Kd and Ks, with GGX's alpha = roughness² = sqrt(2 / (Ns + 2)).
//!
//! Ke is radiance and leaves both sides: OBJ does not say which is the front. d is opacity, Tr its complement where d is not
//! stated; Tr 1 alone is what MeshLab and openMVS wrote for opaque surfaces, and is taken as such. A colour of 0 under a texture
//! (Kd, Ke) is what Maya and 3ds Max write for "the texture alone", and is taken as white.

use super::map::Map;
use super::mtl::Mtl;
use super::textures::Textures;
use crate::error::Result;
use crate::left_out;
use crate::notes::Notes;
use crate::scene::{Alpha, Bsdf, Channel, Color, Material, Scalar, TextureRef};

/// The material that `mtl` states.
pub(super) fn build(
    name: String,
    mtl: &Mtl,
    textures: &mut Textures<'_>,
    notes: &mut Notes,
) -> Result<Material> {
    for (feature, line, effect) in &mtl.unmodelled {
        let element = format!("{} line {line} \"{name}\"", mtl.file.display());
        notes.unmodelled(feature, &element, effect);
    }
    let mut reader = Reader { label: label(&name, mtl), mtl, textures, notes };
    let diffuse = reader.color("Kd", mtl.kd, mtl.map_kd.as_ref(), 0.8)?;
    let mut emission = reader.color("Ke", mtl.ke, mtl.map_ke.as_ref(), 0.0)?;
    if mtl.map_ke.is_some() && emission.texture.is_none() && emission.factor != [0.0; 3] {
        left_out::note_emission(&reader.label, reader.notes);
        emission = Color::constant([0.0; 3]);
    }
    let (bsdf, is_glass) = reader.bsdf(diffuse)?;
    let alpha = reader.alpha(is_glass)?;
    Ok(Material { name, bsdf, double_sided: true, emission, alpha, normal_map: None })
}

fn label(name: &str, mtl: &Mtl) -> String {
    format!("{} line {} \"{name}\"", mtl.file.display(), mtl.line)
}

struct Reader<'r, 't, 'n> {
    /// Of the material, for notes.
    label: String,
    mtl: &'r Mtl,
    textures: &'r mut Textures<'t>,
    notes: &'n mut Notes,
}

impl Reader<'_, '_, '_> {
    fn texture(&mut self, map: Option<&Map>) -> Result<Option<TextureRef>> {
        self.textures.read(map, &self.mtl.file, self.notes)
    }

    /// A colour with its texture, which alone is shown as it is.
    fn color(
        &mut self,
        keyword: &str,
        stated: Option<[f32; 3]>,
        map: Option<&Map>,
        absent: f32,
    ) -> Result<Color> {
        let texture = self.texture(map)?;
        let factor = match (stated, texture) {
            (Some([0.0, 0.0, 0.0]), Some(_)) => {
                self.notes.repair(&format!("black {keyword} under a texture taken as white"), &self.label, 1);
                [1.0; 3]
            }
            (Some(stated), _) => stated,
            (None, Some(_)) => [1.0; 3],
            (None, None) => [absent; 3],
        };
        Ok(Color { factor, texture })
    }

    fn bsdf(&mut self, diffuse: Color) -> Result<(Bsdf, bool)> {
        let mtl = self.mtl;
        let physical = mtl.pr.is_some() || mtl.pm.is_some() || mtl.map_pr.is_some() || mtl.map_pm.is_some();
        if let Some(transmittance) = self.transmittance(diffuse, physical) {
            if mtl.pr.is_some_and(|pr| pr > 0.0) || mtl.map_pr.is_some() {
                self.notes.unmodelled("rough glass", &self.label, "the glass is smooth");
            }
            let ior = mtl.ni.unwrap_or(1.5);
            return Ok((Bsdf::Glass { ior, thin: false, transmittance, absorption: [0.0; 3] }, true));
        }
        if physical {
            return Ok((self.metallic_roughness(diffuse)?, false));
        }
        // Not lit by a texture where it says 0.
        let specular = match mtl.ks {
            Some([0.0, 0.0, 0.0]) => Color::constant([0.0; 3]),
            _ => self.color("Ks", mtl.ks, mtl.map_ks.as_ref(), 0.0)?,
        };
        Ok(match mtl.illum {
            Some(3 | 5) => (Bsdf::Mirror { reflectance: specular }, false),
            Some(0 | 1) => (Bsdf::Matte { reflectance: diffuse }, false),
            _ if specular.factor == [0.0; 3] => (Bsdf::Matte { reflectance: diffuse }, false),
            _ => {
                let roughness = Scalar::constant(roughness_of(mtl.ns.unwrap_or(0.0)));
                let specular_weight = Scalar::constant(1.0);
                (Bsdf::Substrate { diffuse, specular, specular_weight, roughness }, false)
            }
        })
    }

    /// What passes through glass; `None` for what is not glass.
    fn transmittance(&mut self, diffuse: Color, physical: bool) -> Option<Color> {
        let mtl = self.mtl;
        let tf = mtl.tf.unwrap_or([1.0; 3]);
        let illum = mtl.illum.unwrap_or(2);
        if tf == [0.0; 3] {
            return None;
        }
        if physical && mtl.tf.is_some() {
            let mut transmittance = diffuse;
            transmittance.factor.iter_mut().zip(tf).for_each(|(c, tf)| *c *= tf);
            return Some(transmittance);
        }
        let is_opaque = mtl.ni == Some(1.0) && tf == [1.0; 3] && self.opacity() == 1.0;
        let is_glass = match illum {
            6 | 7 => !is_opaque,
            4 | 9 => tf != [1.0; 3],
            _ => false,
        };
        if !is_glass && mtl.tf.is_some() && tf != [1.0; 3] {
            self.notes.unmodelled("Tf", &self.label, "no light passes through");
        }
        is_glass.then(|| Color::constant(tf))
    }

    fn metallic_roughness(&mut self, diffuse: Color) -> Result<Bsdf> {
        let mtl = self.mtl;
        let metallic = self.scalar(mtl.pm, mtl.map_pm.as_ref(), 0.0)?;
        let default = mtl.ns.map_or(1.0, roughness_of);
        let roughness = self.scalar(mtl.pr, mtl.map_pr.as_ref(), default)?;
        let metal = || {
            if roughness.factor == 0.0 {
                Bsdf::Mirror { reflectance: diffuse }
            } else {
                Bsdf::RoughMetal { f0: diffuse, roughness }
            }
        };
        if metallic == Scalar::constant(1.0) {
            return Ok(metal());
        }
        let ior = f64::from(mtl.ni.unwrap_or(1.5));
        let f0 = (((ior - 1.0) / (ior + 1.0)).powi(2) as f32).clamp(0.0, 1.0);
        let base = if f0 == 0.0 {
            Bsdf::Matte { reflectance: diffuse }
        } else {
            Bsdf::Substrate {
                diffuse,
                specular: Color::constant([f0; 3]),
                specular_weight: Scalar::constant(1.0),
                roughness,
            }
        };
        if metallic.factor == 0.0 {
            return Ok(base);
        }
        Ok(Bsdf::Mix { weight: metallic, base: Box::new(base), other: Box::new(metal()) })
    }

    /// A number with its texture: a grey picture unless `-imfchan` says otherwise. A texture alone counts as it is.
    fn scalar(&mut self, stated: Option<f32>, map: Option<&Map>, absent: f32) -> Result<Scalar> {
        let texture = self.texture(map)?;
        let factor = stated.unwrap_or(if texture.is_some() { 1.0 } else { absent });
        let channel = map.and_then(|map| map.channel).unwrap_or(Channel::R);
        // A factor of 0 makes the texture irrelevant.
        Ok(Scalar { factor, texture: texture.filter(|_| factor > 0.0).map(|texture| (texture, channel)) })
    }

    /// Opacity without its texture.
    fn opacity(&self) -> f32 {
        match (self.mtl.d, self.mtl.tr) {
            (Some(d), _) => d,
            (None, Some(1.0)) => 1.0,
            (None, tr) => 1.0 - tr.unwrap_or(0.0),
        }
    }

    fn alpha(&mut self, is_glass: bool) -> Result<Alpha> {
        let mtl = self.mtl;
        if mtl.d.is_none() && mtl.tr == Some(1.0) {
            self.notes.repair("Tr 1 alone taken as opaque", &self.label, 1);
        }
        // Glass lets light through by itself: its d says how it is to be faked.
        let mut alpha = Scalar::constant(if is_glass { 1.0 } else { self.opacity() });
        if let Some(texture) = self.texture(mtl.map_d.as_ref())? {
            // Opacity maps are grey pictures, or pictures with an alpha channel.
            let solid = self.textures.images.is_solid(texture.texture, self.textures.budget);
            let by_content = if solid { Channel::R } else { Channel::A };
            let stated = mtl.map_d.as_ref().and_then(|map| map.channel);
            alpha.texture = Some((texture, stated.unwrap_or(by_content)));
        }
        Ok(if alpha == Scalar::constant(1.0) { Alpha::Opaque } else { Alpha::Blend { alpha } })
    }
}

/// Roughness of a Phong exponent: its square root is exactly rounded, so that every machine agrees.
fn roughness_of(ns: f32) -> f32 {
    (2.0 / (f64::from(ns) + 2.0)).sqrt().sqrt() as f32
}

/// Whether the material looks up a texture.
pub(super) fn is_textured(material: &Material) -> bool {
    let alpha = matches!(material.alpha, Alpha::Blend { alpha } if alpha.texture.is_some());
    alpha || material.emission.texture.is_some() || looks_up(&material.bsdf)
}

fn looks_up(bsdf: &Bsdf) -> bool {
    let color = |color: &Color| color.texture.is_some();
    let scalar = |scalar: &Scalar| scalar.texture.is_some();
    match bsdf {
        Bsdf::Matte { reflectance } | Bsdf::Mirror { reflectance } => color(reflectance),
        Bsdf::Substrate { diffuse, specular, specular_weight, roughness } => {
            color(diffuse) || color(specular) || scalar(specular_weight) || scalar(roughness)
        }
        Bsdf::RoughMetal { f0, roughness } => color(f0) || scalar(roughness),
        Bsdf::Glass { transmittance, .. } => color(transmittance),
        Bsdf::Unlit { color: shown } => color(shown),
        Bsdf::Mix { weight, base, other } => scalar(weight) || looks_up(base) || looks_up(other),
    }
}
