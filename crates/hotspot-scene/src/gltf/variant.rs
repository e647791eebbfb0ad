//! KHR_materials_variants: which materials primitives have in the variant that [`crate::LoadOptions::variant`] names.
//!
//! Without a choice, the primitives' own materials are drawn. That is what the file shows by default, so nothing is noted.

use serde_json::Value;

use super::document::Document;
use super::member;
use crate::error::{REEXPORT, Result, invalid};

const LIST: &str = "extensions.KHR_materials_variants.variants";
const MAPPINGS: &str = "extensions.KHR_materials_variants.mappings";

/// The index of the chosen variant; `None` where none is chosen.
pub(crate) fn choose(doc: &Document<'_>) -> Result<Option<usize>> {
    let Some(wanted) = doc.options.variant.as_deref() else { return Ok(None) };
    let list = member::at(doc.json(), LIST).and_then(Value::as_array).map(Vec::as_slice).unwrap_or_default();
    let names: Vec<&str> =
        list.iter().map(|item| item.get("name").and_then(Value::as_str).unwrap_or_default()).collect();
    if let Some(index) = names.iter().position(|name| *name == wanted) {
        return Ok(Some(index));
    }
    let has = match names.as_slice() {
        [] => "the file has none".to_owned(),
        names => format!(
            "the file has {}",
            names.iter().map(|n| format!("\"{n}\"")).collect::<Vec<_>>().join(", ")
        ),
    };
    let problem = format!("the material variant \"{wanted}\" is asked for, {has}");
    Err(invalid(LIST, problem, if names.is_empty() { "choose none" } else { "choose one of them" }))
}

/// The material that the primitive at `path` has in `variant`; `None` where it keeps its own.
pub(crate) fn material(
    doc: &Document<'_>,
    variant: Option<usize>,
    mesh: usize,
    primitive: usize,
) -> Result<Option<usize>> {
    let Some(variant) = variant else { return Ok(None) };
    let path = format!("meshes[{mesh}].primitives[{primitive}]");
    let json = doc.json().pointer(&format!("/meshes/{mesh}/primitives/{primitive}"));
    let mappings = json.and_then(|json| member::at(json, MAPPINGS)).and_then(Value::as_array);
    for (i, mapping) in mappings.into_iter().flatten().enumerate() {
        let path = format!("{path}.{MAPPINGS}[{i}]");
        let variants = mapping.get("variants").and_then(Value::as_array);
        if variants.into_iter().flatten().any(|number| number.as_u64() == Some(variant as u64)) {
            let index = member::index(mapping, &path, "material", doc.gltf.materials().len(), "materials")?;
            return match index {
                Some(index) => Ok(Some(index)),
                None => Err(invalid(format!("{path}.material"), "this is missing", REEXPORT)),
            };
        }
    }
    Ok(None)
}
