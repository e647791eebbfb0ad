//! Which glTF extensions the scene models, and what becomes of the others.

use serde_json::Value;

use super::document::label;
use super::schema::extension_names;
use crate::error::{Result, unsupported};
use crate::notes::Notes;

/// Extensions whose meaning reaches the scene.
const MODELLED: [&str; 11] = [
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    "KHR_draco_mesh_compression",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    "KHR_texture_transform",
];

/// Extensions that say nothing about the picture.
const SILENT: [&str; 3] = ["KHR_xmp", "KHR_xmp_json_ld", "KHR_draco_mesh_compression"];

/// Refuses a file that demands an extension which we lack: without it, it would be misread.
pub(crate) fn check_required(root: &Value) -> Result<()> {
    let required = root.get("extensionsRequired").and_then(Value::as_array);
    for (i, value) in required.into_iter().flatten().enumerate() {
        let path = format!("extensionsRequired[{i}]");
        let Some(name) = value.as_str() else {
            return Err(crate::error::invalid(path, "this is not a string", crate::error::REEXPORT));
        };
        if MODELLED.contains(&name) {
            continue;
        }
        let remedy = match name {
            "KHR_texture_basisu" | "EXT_texture_webp" | "EXT_texture_avif" | "MSFT_texture_dds" => {
                "export the file again with PNG or JPEG textures"
            }
            _ => "export the file again without it, or with it as optional",
        };
        return Err(unsupported(
            path,
            format!("the file requires the extension {name}, which is not supported"),
            remedy,
        ));
    }
    Ok(())
}

/// Names the extensions on the element at `path` that have no effect here. `known` are those its reader takes care of.
pub(crate) fn note_unknown(value: &Value, path: &str, name: Option<&str>, known: &[&str], notes: &mut Notes) {
    for extension in extension_names(value, path) {
        if known.contains(&extension) || SILENT.contains(&extension) {
            continue;
        }
        let effect = match extension {
            "KHR_lights_punctual" => "the light is left out",
            "KHR_materials_unlit" => "the surface is lit",
            "KHR_materials_variants" => "the default material is used",
            "KHR_materials_pbrSpecularGlossiness" => "the metallic-roughness values are used",
            "KHR_materials_sheen" => "no sheen is added",
            "KHR_materials_clearcoat" => "no coat is added",
            "KHR_materials_iridescence" => "no iridescence is added",
            "KHR_materials_anisotropy" => "the highlights are isotropic",
            "KHR_materials_dispersion" => "all wavelengths refract alike",
            "KHR_materials_diffuse_transmission" => "no light passes diffusely",
            "EXT_lights_image_based" => "the environment map is left out",
            _ => "ignored",
        };
        let element = if path.is_empty() { "the file as a whole".into() } else { label(path, name) };
        notes.unmodelled(extension, &element, effect);
    }
}
