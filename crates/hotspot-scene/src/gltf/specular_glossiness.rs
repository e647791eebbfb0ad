//! KHR_materials_pbrSpecularGlossiness: an archived model that many older files carry.
//!
//! Where a material has it, it is used, whatever pbrMetallicRoughness says beside it: the extension asks those who read it to.
//! Diffuse and specular colour are the substrate's Rd and Rs. The extension's factor 1 - max(specular) on the diffuse colour
//! is not applied: the substrate takes what is reflected from what is scattered by itself. A specular colour of 0 is matte, as
//! a specularFactor of 0 is. Roughness is 1 - glossiness times the texture's alpha, for which a texture of its own is made
//! of the image. The other extensions that change the metallic-roughness model are not meant to go with this one.

use super::material::{Base, Reader, Surface};
use crate::error::Result;
use crate::scene::{Bsdf, Channel, Color, Scalar, TextureRef};

const PATH: &str = "extensions.KHR_materials_pbrSpecularGlossiness";

pub(super) fn read(reader: &mut Reader<'_, '_, '_>) -> Result<Surface> {
    let Base { color: diffuse, alpha } =
        reader.tinted(&format!("{PATH}.diffuseFactor"), &format!("{PATH}.diffuseTexture"))?;
    let specular = reader.shares(&format!("{PATH}.specularFactor"), [1.0; 3])?;
    let glossiness = reader.share(&format!("{PATH}.glossinessFactor"), 1.0)?;
    if reader.has("extensions.KHR_materials_transmission") {
        let effect = "no light passes through: the material is of the specular-glossiness kind";
        reader.note("KHR_materials_transmission", effect);
    }
    if specular == [0.0; 3] {
        return Ok(Surface { bsdf: Bsdf::Matte { reflectance: diffuse }, alpha });
    }
    let texture = reader.texture(&format!("{PATH}.specularGlossinessTexture"))?;
    let mut roughness = Scalar::constant(1.0 - glossiness);
    if let Some(of_image) = texture.filter(|_| glossiness > 0.0)
        && let Some(own) = reader.textures.images.roughness(of_image.texture, glossiness)?
    {
        let texture = TextureRef { texture: own, ..of_image };
        roughness = Scalar { factor: 1.0, texture: Some((texture, Channel::R)) };
    }
    let bsdf = Bsdf::Substrate {
        diffuse,
        specular: Color { factor: specular, texture },
        specular_weight: Scalar::constant(1.0),
        roughness,
    };
    Ok(Surface { bsdf, alpha })
}
