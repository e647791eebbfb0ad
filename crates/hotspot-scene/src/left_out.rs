//! Images that cannot be read: their textures are taken out of the materials, as viewers do, and named.
//!
//! A colour or number without its texture is its factor alone. Emission is different: a factor is written for the few bright
//! texels of its texture, and the surface would glow all over and light the scene. So it goes with its texture.

use crate::LoadError;
use crate::notes::Notes;
use crate::scene::{Alpha, Bsdf, Color, Material, NormalMap, Scalar, TextureRef};

/// Names an image that is left out because of `error`, which is about it.
pub(crate) fn note(error: &LoadError, notes: &mut Notes) {
    let what = match error {
        LoadError::Unsupported { place, problem, .. } => {
            return notes.unmodelled("image format", &place.element, &format!("left out: {problem}"));
        }
        LoadError::Io { .. } => "missing image left out",
        LoadError::Invalid { .. } | LoadError::Limit { .. } => "unreadable image left out",
    };
    let (LoadError::Io { place, problem, .. }
    | LoadError::Invalid { place, problem, .. }
    | LoadError::Unsupported { place, problem, .. }
    | LoadError::Limit { place, problem, .. }) = error;
    notes.repair(what, &format!("{}: {problem}", place.element), 1);
}

/// Names a material whose emission is left out with its texture.
pub(crate) fn note_emission(material: &str, notes: &mut Notes) {
    notes.repair("emission left out with its texture", material, 1);
}

/// Sets the textures of a material to their new places; `None` are those left out.
pub(crate) fn renumber(material: &mut Material, places: &[Option<u32>], notes: &mut Notes) {
    let place = |texture: TextureRef| {
        let new = places.get(texture.texture as usize).copied().flatten()?;
        Some(TextureRef { texture: new, ..texture })
    };
    if let Some(texture) = material.emission.texture {
        material.emission.texture = place(texture);
        if material.emission.texture.is_none() {
            material.emission.factor = [0.0; 3];
            note_emission(&material.name, notes);
        }
    }
    if let Alpha::Mask { alpha, .. } | Alpha::Blend { alpha } = &mut material.alpha {
        scalar(alpha, &place);
    }
    material.normal_map = material.normal_map.and_then(|map| {
        let texture = place(map.texture)?;
        Some(NormalMap { texture, ..map })
    });
    bsdf(&mut material.bsdf, &place);
}

fn color(color: &mut Color, place: &impl Fn(TextureRef) -> Option<TextureRef>) {
    color.texture = color.texture.and_then(place);
}

fn scalar(scalar: &mut Scalar, place: &impl Fn(TextureRef) -> Option<TextureRef>) {
    scalar.texture = scalar.texture.and_then(|(texture, channel)| Some((place(texture)?, channel)));
}

/// Mixes are as deep as the loaders nest them: twice at most.
fn bsdf(of: &mut Bsdf, place: &impl Fn(TextureRef) -> Option<TextureRef>) {
    match of {
        Bsdf::Matte { reflectance } | Bsdf::Mirror { reflectance } => color(reflectance, place),
        Bsdf::Substrate { diffuse, specular, specular_weight, roughness } => {
            color(diffuse, place);
            color(specular, place);
            scalar(specular_weight, place);
            scalar(roughness, place);
        }
        Bsdf::RoughMetal { f0, roughness } => {
            color(f0, place);
            scalar(roughness, place);
        }
        Bsdf::Glass { transmittance, .. } => color(transmittance, place),
        Bsdf::Unlit { color: shown } => color(shown, place),
        Bsdf::Mix { weight, base, other } => {
            scalar(weight, place);
            bsdf(base, place);
            bsdf(other, place);
        }
    }
}
