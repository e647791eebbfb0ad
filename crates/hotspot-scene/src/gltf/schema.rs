//! JSON text to the `gltf` crate's types, with a JSON path in every complaint.
//!
//! The crate interprets the schema. What it misreads or stumbles over is put right in the JSON tree before it sees it:
//! explicit `null`s, whole numbers written `3.0`, indices beyond 32 bits (it would cut them off), numbers beyond f32 (it
//! would make them infinite), and members that it demands although nothing here needs them.

use gltf::json::mesh::Semantic;
use gltf::json::validation::{Checked, Error, Validate};
use gltf::json::{Path, Root};
use serde_json::{Map, Value, json};

use crate::budget::Budget;
use crate::error::{REEXPORT, Result, invalid};
use crate::notes::Notes;

/// Parses JSON after estimating from above what the tree will take.
pub(crate) fn parse_json(bytes: &[u8], budget: &Budget, notes: &mut Notes) -> Result<Value> {
    let text = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    notes.repair("byte order mark before the JSON ignored", "", u64::from(text.len() != bytes.len()));
    budget.charge(json_memory(text), 1, "the JSON as a whole")?;
    let value: Value = serde_json::from_slice(text).map_err(|error| {
        invalid(
            format!("line {}, column {}", error.line(), error.column()),
            format!("this is not valid JSON ({error})"),
            "the file is damaged or cut short: copy or export it again",
        )
    })?;
    if value.is_object() {
        Ok(value)
    } else {
        Err(invalid("the JSON as a whole", "this is not an object", "check that the file is glTF 2.0"))
    }
}

/// An upper bound for the parsed tree in bytes. An array element takes 32 bytes, up to twice that while its vector grows;
/// the first entry of an object takes a whole node of a B-tree (below 700 bytes), further ones 56 bytes in nodes at least
/// half full, and an allocation for the key. Text is copied.
fn json_memory(text: &[u8]) -> u64 {
    let mut bytes = text.len() as u64;
    let (mut quoted, mut escaped) = (false, false);
    // A bit for each level, 1 for an object. The parser gives up at 128 levels, so that what is shifted out is not missed.
    let mut levels = 0u128;
    for byte in text {
        match byte {
            _ if escaped => escaped = false,
            b'\\' if quoted => escaped = true,
            b'"' => quoted = !quoted,
            _ if quoted => {}
            b'{' => {
                bytes = bytes.saturating_add(700);
                levels = (levels << 1) | 1;
            }
            b'[' => {
                bytes = bytes.saturating_add(128);
                levels <<= 1;
            }
            b'}' | b']' => levels >>= 1,
            b',' => bytes = bytes.saturating_add(if levels & 1 == 1 { 160 } else { 64 }),
            _ => {}
        }
    }
    bytes
}

/// Puts a parsed tree right for [`interpret`]: `extras`, which may hold anything, must have been taken out.
pub(crate) fn mend(value: &mut Value) -> Result<()> {
    mend_element(value, &mut String::new())?;
    let demanded = [
        ("scenes", "", "nodes", json!([])),
        ("meshes", "", "primitives", json!([])),
        ("buffers", "", "byteLength", json!(0)),
        ("cameras", "perspective", "znear", json!(0)),
        ("cameras", "orthographic", "znear", json!(0)),
        ("cameras", "orthographic", "zfar", json!(0)),
    ];
    for (array, member, key, default) in demanded {
        for item in value.get_mut(array).and_then(Value::as_array_mut).into_iter().flatten() {
            let item = if member.is_empty() { Some(item) } else { item.get_mut(member) };
            if let Some(object) = item.and_then(Value::as_object_mut) {
                object.entry(key).or_insert_with(|| default.clone());
            }
        }
    }
    Ok(())
}

/// Takes out nulls and extras, and writes whole numbers as such. The parser has limited the depth.
pub(super) fn mend_element(value: &mut Value, path: &mut String) -> Result<()> {
    let length = path.len();
    match value {
        Value::Object(members) => {
            members.retain(|key, member| !member.is_null() && key != "extras");
            for (key, member) in members {
                if length > 0 {
                    path.push('.');
                }
                path.push_str(key);
                mend_element(member, path)?;
                path.truncate(length);
            }
        }
        Value::Array(items) => {
            for (i, item) in items.iter_mut().enumerate() {
                path.push_str(&format!("[{i}]"));
                mend_element(item, path)?;
                path.truncate(length);
            }
        }
        Value::Number(number) => {
            let float = number.as_f64().unwrap_or_default();
            // Transforms are read as f64 (see `Document::exact`).
            if float.abs() > f64::from(f32::MAX)
                && (path.starts_with("materials[") || path.starts_with("cameras["))
            {
                return Err(invalid(path.as_str(), format!("{number} is too large"), REEXPORT));
            }
            let size = ["byteOffset", "byteLength", "count"].iter().any(|key| path.ends_with(key));
            let most = if size { MAX_EXACT } else { f64::from(u32::MAX) };
            if number.is_f64()
                && float.fract() == 0.0
                && (0.0..=most).contains(&float)
                && float.is_sign_positive()
            {
                *value = json!(float as u64);
            } else if !size && number.as_u64().is_some_and(|n| n > u64::from(u32::MAX)) {
                // A float still serves where the schema says number, and is refused where it says index.
                *value = json!(float);
            }
        }
        _ => {}
    }
    Ok(())
}

/// 2^53: beyond, an f64 no longer says which whole number is meant.
const MAX_EXACT: f64 = 9_007_199_254_740_992.0;

/// A mended tree as the crate's types, all indices in range and all names of modes and types known.
pub(crate) fn interpret(value: &Value, budget: &Budget) -> Result<Root> {
    charge(value, budget)?;
    let root: Root = serde_path_to_error::deserialize(value).map_err(|error| {
        let path = match error.path().to_string() {
            path if path == "." => "the JSON as a whole".into(),
            path => path,
        };
        let problem = error.into_inner().to_string();
        let missing = problem.strip_prefix("missing field `").and_then(|rest| rest.strip_suffix('`'));
        match missing {
            Some(key) => invalid(format!("{path}.{key}"), "this is missing", REEXPORT),
            None if problem.contains("expected a sequence") => {
                invalid(path, format!("this is not an array ({problem})"), REEXPORT)
            }
            None if problem.contains("expected struct") || problem.contains("expected a map") => {
                invalid(path, format!("this is not an object ({problem})"), REEXPORT)
            }
            None => invalid(path, problem, REEXPORT),
        }
    })?;
    check_attributes(&root)?;
    let mut wrong = None;
    root.validate(&root, Path::new, &mut |path, error| {
        // What is missing matters where it is used. Of attributes, only the indices matter: applications add their own
        // names, and few exporters state the bounds of positions right.
        let matters = match error {
            Error::IndexOutOfBounds | Error::Oversize => true,
            Error::Invalid => !path().as_str().contains(".attributes["),
            Error::Missing | Error::Unsupported => false,
        };
        if matters && wrong.is_none() {
            wrong = Some((path().0, error));
        }
    });
    match wrong {
        None => Ok(root),
        Some((path, Error::IndexOutOfBounds)) => Err(out_of_range(value, &path)),
        Some((path, _)) => {
            let stated = at(value, &path).map(|value| format!("{value} ")).unwrap_or_default();
            Err(invalid(path, format!("{stated}is not among the values allowed here"), REEXPORT))
        }
    }
}

/// Announces what the crate's types take: the tree's text and maps once more at most, and the vectors while they grow.
fn charge(value: &Value, budget: &Budget) -> Result<()> {
    let count = |key: &str| value.get(key).and_then(Value::as_array).map_or(0, |items| items.len() as u64);
    let primitives = value.get("meshes").and_then(Value::as_array).into_iter().flatten();
    let primitives =
        primitives.filter_map(|mesh| mesh.get("primitives")?.as_array()).map(|list| list.len() as u64);
    let element = "the JSON as a whole";
    // The largest of them is below 1 KiB, the most numerous are given their own size.
    budget.charge(count("nodes"), 2 * size_of::<gltf::json::Node>() as u64 + 64, "nodes")?;
    budget.charge(count("accessors"), 2 * size_of::<gltf::json::Accessor>() as u64, "accessors")?;
    budget.charge(primitives.sum(), 2 * size_of::<gltf::json::mesh::Primitive>() as u64 + 700, "meshes")?;
    for key in [
        "buffers",
        "bufferViews",
        "cameras",
        "images",
        "materials",
        "meshes",
        "samplers",
        "scenes",
        "skins",
        "textures",
    ] {
        budget.charge(count(key), 2 * size_of::<gltf::json::Material>() as u64, element)?;
    }
    Ok(())
}

/// The crate's own check takes for granted that positions are in range.
fn check_attributes(root: &Root) -> Result<()> {
    for (m, mesh) in root.meshes.iter().enumerate() {
        for (p, primitive) in mesh.primitives.iter().enumerate() {
            let index = primitive.attributes.get(&Checked::Valid(Semantic::Positions));
            if index.is_some_and(|index| index.value() >= root.accessors.len()) {
                return Err(invalid(
                    format!("meshes[{m}].primitives[{p}].attributes.POSITION"),
                    format!("the index is out of range, the file has {} accessors", root.accessors.len()),
                    REEXPORT,
                ));
            }
        }
    }
    Ok(())
}

fn out_of_range(value: &Value, path: &str) -> crate::LoadError {
    let stated = at(value, path).map(|value| format!("index {value}")).unwrap_or_else(|| "the index".into());
    let key = path.rsplit('.').next().unwrap_or_default();
    let things = [format!("{key}s"), format!("{key}es")];
    let count = things.iter().find_map(|things| Some((value.get(things)?.as_array()?.len(), things)));
    let has = count.map(|(count, things)| format!(", the file has {count} {things}")).unwrap_or_default();
    invalid(path, format!("{stated} is out of range{has}"), REEXPORT)
}

/// The value at a path such as `accessors[3].count`.
pub(super) fn at<'v>(value: &'v Value, path: &str) -> Option<&'v Value> {
    value.pointer(&format!("/{}", path.replace(['.', '['], "/").replace(']', "")))
}

/// The names of the extensions on the element at a path, the empty one being the root.
pub(crate) fn extension_names<'v>(value: &'v Value, path: &str) -> impl Iterator<Item = &'v str> {
    let element = if path.is_empty() { Some(value) } else { at(value, path) };
    let extensions = element.and_then(|element| element.get("extensions")).and_then(Value::as_object);
    extensions.into_iter().flat_map(Map::keys).map(String::as_str)
}
