//! An edited glTF file: the JSON of the original with as little changed as the edits need, its buffers and images inside.
//!
//! Objects and materials are found by the names that the loader gives them, so the file is loaded first. What each edit does:
//! * matte: `metallicFactor` 0 and KHR_materials_specular with `specularFactor` 0; extensions that gloss or let light through
//!   go. A specular-glossiness material becomes metallic-roughness with its diffuse colour.
//! * roughness: `roughnessFactor` (or `glossinessFactor`);
//! * delete: the node loses its mesh and keeps its place, children, camera and light;
//! * move: the mesh goes to a new child of its node, translated, so that children and animations of the node stay as they are.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Map, Value, json};

use super::document::Document;
use super::graph::Affine;
use super::{Loader, glb, instancing, schema, variant};
use crate::LoadError;
use crate::budget::Budget;
use crate::edit::Edit;
use crate::error::{REEXPORT, Result, invalid, limit, unsupported};
use crate::files::Folder;
use crate::notes::Notes;
use crate::options::LoadOptions;
use crate::scene::Scene;
use crate::uri;

/// Extensions of a material that a matte one has no use for.
const GLOSSY: [&str; 9] = [
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_dispersion",
    "KHR_materials_iridescence",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_sheen",
    "KHR_materials_transmission",
    "KHR_materials_volume",
];
const SPECULAR: &str = "KHR_materials_specular";
const GLOSSINESS: &str = "KHR_materials_pbrSpecularGlossiness";

/// Where the elements of a loaded scene come from.
#[derive(Clone, Debug, Default)]
pub(crate) struct Origins {
    /// Node of each object, and where it stands.
    pub(crate) objects: Vec<(usize, Affine)>,
    /// Material in the file of each material; `None`: the default one.
    pub(crate) materials: Vec<Option<usize>>,
}

/// How the edited file is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Container {
    /// JSON text with everything embedded (`.gltf`).
    Json,
    /// The binary container (`.glb`).
    Binary,
}

/// The edited file's bytes.
pub(crate) fn rewrite(
    bytes: &[u8],
    folder: Option<&Folder>,
    options: &LoadOptions,
    edits: &[Edit],
    environment: Option<[f32; 3]>,
    container: Container,
) -> Result<Vec<u8>> {
    let budget = Budget::new(options.max_memory_bytes);
    let mut notes = Notes::default();
    let (text, bin) = if glb::is_glb(bytes) {
        let parts = glb::parse(bytes, &mut notes)?;
        (parts.json, parts.bin)
    } else {
        (bytes, None)
    };
    let mut file = schema::parse_json(text, &budget, &mut notes)?;
    let doc = Document::new(file.clone(), bin, folder, options, &budget, &mut notes)?;
    let mut loader = Loader::new(&doc, notes);
    loader.variant = variant::choose(&doc)?;
    loader.scene()?;
    let (scene, origins) = (&loader.scene, &loader.origins);
    for edit in merged(edits) {
        one(&mut file, scene, origins, &edit)?;
    }
    if let Some(radiance) = environment {
        set_environment(&mut file, options, &doc, radiance)?;
    }
    let bin = embed(&mut file, &doc, bin, container)?;
    match container {
        Container::Json => {
            // A tree that was parsed has string keys alone and serialises.
            let mut text = serde_json::to_vec_pretty(&file).unwrap_or_default();
            text.push(b'\n');
            Ok(text)
        }
        Container::Binary => glb::write(&file, bin.as_deref()),
    }
}

/// Moves of one object as one move.
fn merged(edits: &[Edit]) -> Vec<Edit> {
    let mut merged: Vec<Edit> = Vec::new();
    for edit in edits {
        let Edit::Move { object, by } = edit else {
            merged.push(edit.clone());
            continue;
        };
        let known = merged.iter_mut().find_map(|known| match known {
            Edit::Move { object: other, by } if other == object => Some(by),
            _ => None,
        });
        match known {
            Some(sum) => sum.iter_mut().zip(by).for_each(|(sum, by)| *sum += by),
            None => merged.push(edit.clone()),
        }
    }
    merged
}

fn one(file: &mut Value, scene: &Scene, origins: &Origins, edit: &Edit) -> Result<()> {
    match edit {
        Edit::Matte { material } => {
            let (index, material) = material_of(file, scene, origins, material)?;
            matte(material, &format!("materials[{index}]"))?;
            let used = member(object(file, "the JSON as a whole")?, "extensionsUsed", || json!([]));
            if let Some(used) = used.as_array_mut()
                && !used.iter().any(|name| name == SPECULAR)
            {
                used.push(json!(SPECULAR));
            }
            Ok(())
        }
        Edit::Roughness { material, roughness } => {
            let (index, material) = material_of(file, scene, origins, material)?;
            set_roughness(material, &format!("materials[{index}]"), *roughness)
        }
        Edit::Delete { object } => {
            let (node, _) = node_of(scene, origins, object)?;
            take_mesh(file, node)?;
            Ok(())
        }
        Edit::Move { object, by } => {
            let (node, to_world) = node_of(scene, origins, object)?;
            move_mesh(file, node, &to_world, *by)
        }
    }
}

fn material_of<'f>(
    file: &'f mut Value,
    scene: &Scene,
    origins: &Origins,
    name: &str,
) -> Result<(usize, &'f mut Map<String, Value>)> {
    let number = scene.materials.iter().position(|m| m.name == name);
    let index = number.and_then(|number| *origins.materials.get(number)?);
    let Some(index) = index else {
        return Err(unsupported(
            "materials",
            format!("the file itself has no material \"{name}\""),
            "give the surfaces a material first",
        ));
    };
    let path = format!("materials[{index}]");
    let element = file.get_mut("materials").and_then(|m| m.get_mut(index));
    Ok((index, element.and_then(Value::as_object_mut).ok_or_else(|| not_an_object(&path))?))
}

fn node_of(scene: &Scene, origins: &Origins, name: &str) -> Result<(usize, Affine)> {
    let number = scene.objects.iter().position(|o| o.name == name);
    number.and_then(|number| origins.objects.get(number).copied()).ok_or_else(|| {
        unsupported("nodes", format!("no node is the object \"{name}\""), "choose another object")
    })
}

fn matte(material: &mut Map<String, Value>, path: &str) -> Result<()> {
    let extensions = member(material, "extensions", || json!({}));
    let extensions = object(extensions, &format!("{path}.extensions"))?;
    let glossiness = extensions.get(GLOSSINESS).cloned();
    for name in GLOSSY {
        extensions.remove(name);
    }
    extensions.insert(SPECULAR.into(), json!({"specularFactor": 0.0}));
    let surface = member(material, "pbrMetallicRoughness", || json!({}));
    let surface = object(surface, &format!("{path}.pbrMetallicRoughness"))?;
    if let Some(glossiness) = glossiness {
        surface.clear();
        for (from, to) in [("diffuseFactor", "baseColorFactor"), ("diffuseTexture", "baseColorTexture")] {
            if let Some(value) = glossiness.get(from) {
                surface.insert(to.into(), value.clone());
            }
        }
    }
    surface.insert("metallicFactor".into(), json!(0.0));
    Ok(())
}

fn set_roughness(material: &mut Map<String, Value>, path: &str, roughness: f32) -> Result<()> {
    // Shortest decimal form of the f32, which the loader rounds back to it.
    let number: Value = serde_json::from_str(&roughness.to_string()).unwrap_or(json!(roughness));
    let glossy =
        material.get_mut("extensions").and_then(|e| e.get_mut(GLOSSINESS)).and_then(Value::as_object_mut);
    if let Some(glossy) = glossy {
        if glossy.contains_key("specularGlossinessTexture") {
            return Err(unsupported(
                format!("{path}.extensions.{GLOSSINESS}"),
                "the glossiness is in a texture, which edits do not touch",
                "convert the material to metallic-roughness first",
            ));
        }
        glossy.insert("glossinessFactor".into(), json!(1.0 - f64::from(roughness)));
        return Ok(());
    }
    let surface = member(material, "pbrMetallicRoughness", || json!({}));
    let surface = object(surface, &format!("{path}.pbrMetallicRoughness"))?;
    let smooth = surface.get("roughnessFactor").and_then(Value::as_f64) == Some(0.0);
    if smooth && surface.contains_key("metallicRoughnessTexture") {
        return Err(unsupported(
            format!("{path}.pbrMetallicRoughness"),
            "the roughness is 0 times a texture, which would come in with the new roughness",
            "take the texture out of the material first",
        ));
    }
    surface.insert("roughnessFactor".into(), number);
    Ok(())
}

/// Takes what draws the mesh from a node.
fn take_mesh(file: &mut Value, node: usize) -> Result<Map<String, Value>> {
    let path = format!("nodes[{node}]");
    let element = file.get_mut("nodes").and_then(|nodes| nodes.get_mut(node));
    let element = element.and_then(Value::as_object_mut).ok_or_else(|| not_an_object(&path))?;
    let mut taken = Map::new();
    for key in ["mesh", "skin", "weights"] {
        if let Some(value) = element.remove(key) {
            taken.insert(key.into(), value);
        }
    }
    if let Some(extensions) = element.get_mut("extensions").and_then(Value::as_object_mut)
        && let Some(copies) = extensions.remove(instancing::NAME)
    {
        taken.insert("extensions".into(), json!({instancing::NAME: copies}));
        if extensions.is_empty() {
            element.remove("extensions");
        }
    }
    Ok(taken)
}

fn move_mesh(file: &mut Value, node: usize, to_world: &Affine, by: [f64; 3]) -> Result<()> {
    let path = format!("nodes[{node}]");
    let mut mesh = take_mesh(file, node)?;
    if mesh.contains_key("skin") {
        return Err(unsupported(
            path,
            "the mesh is placed by a skin; moving its joints would move whatever else hangs on them",
            "move it where the scene was made",
        ));
    }
    let Some(translation) = solve(to_world, by) else {
        return Err(unsupported(path, "its transform flattens space, so no translation moves it", REEXPORT));
    };
    mesh.insert("translation".into(), json!(translation));
    let name = file.pointer(&format!("/nodes/{node}/name")).cloned();
    let name = name.or_else(|| {
        // Unnamed nodes are called after their mesh; what has neither gets its old number for a name.
        let index = mesh.get("mesh").and_then(Value::as_u64)?;
        file.pointer(&format!("/meshes/{index}/name")).is_none().then(|| json!(format!("node {node}")))
    });
    if let Some(name) = name {
        mesh.insert("name".into(), name);
    }
    let nodes = file.get_mut("nodes").and_then(Value::as_array_mut).ok_or_else(|| not_an_object("nodes"))?;
    let child = nodes.len();
    nodes.push(Value::Object(mesh));
    let parent = nodes.get_mut(node).and_then(Value::as_object_mut).ok_or_else(|| not_an_object(&path))?;
    // First, so that objects are met in the order they were.
    if let Some(children) = member(parent, "children", || json!([])).as_array_mut() {
        children.insert(0, json!(child));
    }
    // Morph weights are animated where the mesh is.
    let channels = file.get_mut("animations").and_then(Value::as_array_mut).into_iter().flatten();
    let channels = channels.filter_map(|a| a.get_mut("channels")?.as_array_mut()).flatten();
    for target in channels.filter_map(|c| c.get_mut("target")?.as_object_mut()) {
        let here = target.get("node").and_then(Value::as_u64) == Some(node as u64);
        if here && target.get("path").and_then(Value::as_str) == Some("weights") {
            target.insert("node".into(), json!(child));
        }
    }
    Ok(())
}

/// The v with `linear part of m` · v = `by`, by Cramer's rule.
fn solve(m: &Affine, by: [f64; 3]) -> Option<[f64; 3]> {
    let column = |j: usize| [m[0][j], m[1][j], m[2][j]];
    let determinant = |a: [f64; 3], b: [f64; 3], c: [f64; 3]| {
        a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0])
            + a[2] * (b[0] * c[1] - b[1] * c[0])
    };
    let (a, b, c) = (column(0), column(1), column(2));
    let all = determinant(a, b, c);
    let v = [determinant(by, b, c) / all, determinant(a, by, c) / all, determinant(a, b, by) / all];
    v.iter().all(|c| c.is_finite()).then_some(v)
}

fn set_environment(
    file: &mut Value,
    options: &LoadOptions,
    doc: &Document<'_>,
    radiance: [f32; 3],
) -> Result<()> {
    let chosen = match &options.scene {
        Some(crate::SceneChoice::Index(index)) => Some(*index),
        Some(crate::SceneChoice::Name(name)) => {
            doc.gltf.scenes().find(|scene| scene.name() == Some(name)).map(|scene| scene.index())
        }
        None => doc.gltf.default_scene().map_or(Some(0), |scene| Some(scene.index())),
    };
    let scene =
        chosen.and_then(|index| file.get_mut("scenes")?.get_mut(index)).and_then(Value::as_object_mut);
    let Some(scene) = scene else {
        return Err(unsupported("scenes", "the file has no scene to keep an environment in", REEXPORT));
    };
    let extras = member(scene, "extras", || json!({}));
    let environment = member(object(extras, "scenes.extras")?, "environment", || json!({}));
    object(environment, "scenes.extras.environment")?.insert("constant".into(), json!(radiance));
    Ok(())
}

/// Brings buffers and images that lie in other files inside. Returns the binary chunk of a [`Container::Binary`].
fn embed(
    file: &mut Value,
    doc: &Document<'_>,
    bin: Option<&[u8]>,
    container: Container,
) -> Result<Option<Vec<u8>>> {
    let mut chunk = None;
    let buffers = file.get_mut("buffers").and_then(Value::as_array_mut).into_iter().flatten();
    for (index, buffer) in buffers.enumerate() {
        let path = format!("buffers[{index}]");
        let Some(buffer) = buffer.as_object_mut() else { continue };
        let stated = buffer.get("uri").and_then(Value::as_str).map(str::to_owned);
        let bytes = match &stated {
            Some(uri) if uri::is_data(uri) && (index > 0 || container == Container::Json) => continue,
            Some(uri) => doc.fetch(uri, &format!("{path}.uri"))?,
            None => match bin {
                Some(bin) if index == 0 => bin.to_vec(),
                // A placeholder for what is compressed elsewhere.
                _ => continue,
            },
        };
        if index == 0 && container == Container::Binary {
            buffer.remove("uri");
            chunk = Some(bytes);
        } else {
            let text = format!("data:application/octet-stream;base64,{}", STANDARD.encode(&bytes));
            buffer.insert("uri".into(), json!(text));
        }
    }
    let images = file.get_mut("images").and_then(Value::as_array_mut).into_iter().flatten();
    for (index, image) in images.enumerate() {
        let Some(image) = image.as_object_mut() else { continue };
        let Some(uri) = image.get("uri").and_then(Value::as_str).map(str::to_owned) else { continue };
        if uri::is_data(&uri) {
            continue;
        }
        // A picture that is missing is missing from the original too: its name stays.
        let Ok(bytes) = doc.fetch(&uri, &format!("images[{index}].uri")) else { continue };
        let kind = match image.get("mimeType").and_then(Value::as_str) {
            Some(kind) => kind.to_owned(),
            None => mime(&bytes).to_owned(),
        };
        image.insert("uri".into(), json!(format!("data:{kind};base64,{}", STANDARD.encode(&bytes))));
        if !image.contains_key("name") {
            image.insert("name".into(), json!(uri));
        }
    }
    Ok(chunk)
}

/// The kind of an image by its first bytes.
fn mime(bytes: &[u8]) -> &'static str {
    match bytes {
        [0x89, b'P', b'N', b'G', ..] => "image/png",
        [0xff, 0xd8, ..] => "image/jpeg",
        [b'R', b'I', b'F', b'F', _, _, _, _, b'W', b'E', b'B', b'P', ..] => "image/webp",
        [b'B', b'M', ..] => "image/bmp",
        [b'G', b'I', b'F', ..] => "image/gif",
        _ => "application/octet-stream",
    }
}

fn member<'m>(map: &'m mut Map<String, Value>, key: &str, absent: impl FnOnce() -> Value) -> &'m mut Value {
    let value = map.entry(key).or_insert(Value::Null);
    if value.is_null() {
        *value = absent();
    }
    value
}

fn object<'v>(value: &'v mut Value, path: &str) -> Result<&'v mut Map<String, Value>> {
    value.as_object_mut().ok_or_else(|| not_an_object(path))
}

fn not_an_object(path: &str) -> LoadError {
    invalid(path, "this is not what glTF says it is", REEXPORT)
}

/// The error for files beyond what a GLB can say of its own length.
pub(super) fn too_long(bytes: usize) -> LoadError {
    limit(
        "the file as a whole",
        format!("{bytes} bytes are more than a GLB can hold"),
        "write a .gltf file instead",
    )
}
