//! Which glTF extensions the scene models, and what becomes of the others.

use serde_json::Value;

use super::document::label;
use super::schema::extension_names;
use super::texture::FOREIGN;
use crate::error::{Result, unsupported};
use crate::notes::Notes;

/// Extensions whose meaning reaches the scene.
const MODELLED: [&str; 16] = [
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    "EXT_texture_webp",
    "KHR_draco_mesh_compression",
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_variants",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    "KHR_texture_transform",
];

/// Extensions that say nothing about the picture, or whose readers say what they leave out.
const SILENT: [&str; 5] = [
    "KHR_draco_mesh_compression",
    "KHR_lights_punctual",
    "KHR_materials_variants",
    "KHR_xmp",
    "KHR_xmp_json_ld",
];

/// Refuses a file that demands an extension which we lack: without it, it would be misread.
pub(crate) fn check_required(root: &Value) -> Result<()> {
    let required = root.get("extensionsRequired").and_then(Value::as_array);
    for (i, value) in required.into_iter().flatten().enumerate() {
        let path = format!("extensionsRequired[{i}]");
        let Some(name) = value.as_str() else {
            return Err(crate::error::invalid(path, "this is not a string", crate::error::REEXPORT));
        };
        // Of images, it depends on the texture whether there is one that we read.
        if MODELLED.contains(&name) || FOREIGN.iter().any(|(foreign, _)| *foreign == name) {
            continue;
        }
        let remedy = "export the file again without it, or with it as optional";
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
            "EXT_lights_image_based" => {
                "the file's own environment map lights nothing; its rotation and intensity are not read either"
            }
            _ => "ignored",
        };
        let element = if path.is_empty() { "the file as a whole".into() } else { label(path, name) };
        notes.unmodelled(extension, &element, effect);
    }
}
