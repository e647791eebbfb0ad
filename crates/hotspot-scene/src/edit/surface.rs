//! Changes of a material's scattering.

use super::EditError;
use crate::scene::{Bsdf, Color, Material, Scalar};

/// Makes a material matte.
pub(super) fn matte(material: &mut Material) -> Result<(), EditError> {
    let nothing = |problem| EditError::Nothing { material: material.name.clone(), problem };
    let reflectance = match &material.bsdf {
        Bsdf::Matte { .. } => return Err(nothing("is matte already")),
        Bsdf::Unlit { .. } => return Err(nothing("is unlit: it scatters nothing")),
        other => base_color(other),
    };
    material.bsdf = Bsdf::Matte { reflectance };
    Ok(())
}

/// The colour that a matte surface in its place has: glTF's base colour.
fn base_color(bsdf: &Bsdf) -> Color {
    match bsdf {
        Bsdf::Matte { reflectance: color }
        | Bsdf::Substrate { diffuse: color, .. }
        | Bsdf::Mirror { reflectance: color }
        | Bsdf::RoughMetal { f0: color, .. }
        | Bsdf::Glass { transmittance: color, .. }
        | Bsdf::Unlit { color } => *color,
        // All parts of a glTF mix have the base colour.
        Bsdf::Mix { base, .. } => base_color(base),
    }
}

/// Sets the roughness wherever the material has one.
pub(super) fn roughness(material: &mut Material, value: f32) -> Result<(), EditError> {
    let nothing = |problem| EditError::Nothing { material: material.name.clone(), problem };
    let before = format!("{:?}", material.bsdf);
    let mut bsdf = material.bsdf.clone();
    if !set(&mut bsdf, value) {
        return Err(nothing(match bsdf {
            Bsdf::Matte { .. } => "is matte: roughness makes no difference to it",
            Bsdf::Glass { .. } => "is glass, which is smooth here: roughness makes no difference to it",
            _ => "has no roughness",
        }));
    }
    if format!("{bsdf:?}") == before {
        return Err(nothing("has this roughness already"));
    }
    material.bsdf = bsdf;
    Ok(())
}

/// Whether there was a roughness to set.
fn set(bsdf: &mut Bsdf, value: f32) -> bool {
    match bsdf {
        Bsdf::Substrate { roughness, .. } => {
            roughness.factor = value;
            true
        }
        Bsdf::Mirror { reflectance } => {
            if value > 0.0 {
                *bsdf = Bsdf::RoughMetal { f0: *reflectance, roughness: Scalar::constant(value) };
            }
            true
        }
        Bsdf::RoughMetal { f0, roughness } => {
            if value > 0.0 {
                roughness.factor = value;
            } else {
                *bsdf = Bsdf::Mirror { reflectance: *f0 };
            }
            true
        }
        Bsdf::Mix { base, other, .. } => {
            let (in_base, in_other) = (set(base, value), set(other, value));
            in_base || in_other
        }
        Bsdf::Matte { .. } | Bsdf::Glass { .. } | Bsdf::Unlit { .. } => false,
    }
}
