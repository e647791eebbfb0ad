//! What a model's file uses, told from its text alone, so that it can be held against what the loader says.

use std::collections::BTreeSet;
use std::path::Path;

use serde_json::Value;

/// Names of features; empty where the file cannot be understood.
pub(crate) fn of(file: &Path) -> BTreeSet<String> {
    let bytes = std::fs::read(file).unwrap_or_default();
    if file.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("obj")) {
        return of_obj(file, &bytes);
    }
    let binary = bytes.starts_with(b"glTF");
    let json = if binary { json_chunk(&bytes).unwrap_or_default() } else { &bytes };
    let Ok(json) = serde_json::from_slice::<Value>(json) else { return BTreeSet::new() };
    let mut features = of_gltf(&json);
    features.insert(if binary { "GLB container" } else { "glTF as text" }.into());
    features
}

fn json_chunk(bytes: &[u8]) -> Option<&[u8]> {
    let length = u32::from_le_bytes(bytes.get(12..16)?.try_into().ok()?) as usize;
    bytes.get(20..20usize.checked_add(length)?)
}

fn of_gltf(json: &Value) -> BTreeSet<String> {
    let mut features = BTreeSet::new();
    let mut add = |name: &str| features.insert(name.to_owned());
    let list = |value: &Value| value.as_array().cloned().unwrap_or_default();
    if json["asset"]["version"].as_str().is_none_or(|version| version.starts_with('1')) {
        add("glTF 1.0");
    }
    for name in list(&json["extensionsUsed"]) {
        add(name.as_str().unwrap_or("?"));
    }
    for key in ["skins", "animations", "cameras"] {
        if !list(&json[key]).is_empty() {
            add(key);
        }
    }
    for primitive in list(&json["meshes"]).iter().flat_map(|mesh| list(&mesh["primitives"])) {
        for name in primitive["attributes"].as_object().into_iter().flat_map(|a| a.keys()) {
            if !["POSITION", "NORMAL", "TEXCOORD_0"].contains(&name.as_str()) {
                add(name);
            }
        }
        if !list(&primitive["targets"]).is_empty() {
            add("morph targets");
        }
        let modes = ["points", "lines", "line loops", "line strips", "", "triangle strips", "triangle fans"];
        let mode = primitive["mode"].as_u64().unwrap_or(4) as usize;
        if let Some(mode) = modes.get(mode).filter(|mode| !mode.is_empty()) {
            add(mode);
        }
    }
    for material in list(&json["materials"]) {
        let base = &material["pbrMetallicRoughness"];
        for (slot, within) in [
            ("normalTexture", &material),
            ("emissiveTexture", &material),
            ("occlusionTexture", &material),
            ("baseColorTexture", base),
            ("metallicRoughnessTexture", base),
        ] {
            if within[slot].is_object() {
                add(slot);
            }
        }
        if let Some(mode) = material["alphaMode"].as_str().filter(|mode| *mode != "OPAQUE") {
            add(&format!("alphaMode {mode}"));
        }
    }
    if list(&json["accessors"]).iter().any(|accessor| accessor["sparse"].is_object()) {
        add("sparse accessors");
    }
    for image in list(&json["images"]) {
        let uri = image["uri"].as_str().unwrap_or_default();
        let embedded = uri.is_empty() || uri.starts_with("data:");
        add(if embedded { "images inside" } else { "images in files" });
    }
    let meshes: Vec<u64> = list(&json["nodes"]).iter().filter_map(|node| node["mesh"].as_u64()).collect();
    if meshes.iter().collect::<BTreeSet<_>>().len() < meshes.len() {
        add("meshes placed more than once");
    }
    features
}

fn of_obj(file: &Path, bytes: &[u8]) -> BTreeSet<String> {
    let mut features = BTreeSet::from(["OBJ".to_owned()]);
    let mut add = |name: &str| features.insert(name.to_owned());
    let mut libraries = Vec::new();
    for line in String::from_utf8_lossy(bytes).lines() {
        let words: Vec<&str> = line.split_whitespace().collect();
        match words.first().copied() {
            Some("f") if words.len() > 4 => add("OBJ polygons of four and more"),
            Some("f") if words.iter().any(|word| word.contains('-')) => add("OBJ negative indices"),
            Some("v") if words.len() >= 7 => add("OBJ vertex colours"),
            Some("vn") => add("OBJ normals"),
            Some("vt") => add("OBJ texture coordinates"),
            Some("s") if words.get(1).is_some_and(|group| !["0", "off"].contains(group)) => {
                add("OBJ smoothing groups")
            }
            Some("l") => add("OBJ lines"),
            Some("mtllib") => {
                libraries.push(line.trim().trim_start_matches("mtllib").trim().to_owned());
                add("MTL")
            }
            _ => false,
        };
    }
    for library in libraries {
        let library = file.with_file_name(library);
        for line in String::from_utf8_lossy(&std::fs::read(library).unwrap_or_default()).lines() {
            let Some(keyword) = line.split_whitespace().next() else { continue };
            let keyword = keyword.to_ascii_lowercase();
            if keyword.starts_with("map_") || ["bump", "norm", "tf", "pr", "pm"].contains(&keyword.as_str()) {
                features.insert(format!("MTL {keyword}"));
            }
        }
    }
    features
}
