//! Small files written on the spot.

use std::path::Path;

use hotspot_scene::{LoadError, LoadOptions, Scene, load, load_glb_bytes};
use serde_json::{Value, json};

/// A GLB container around JSON and a binary chunk.
pub(crate) fn glb(json: &Value, bin: &[u8]) -> Vec<u8> {
    let mut text = json.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut bin = bin.to_vec();
    bin.resize(bin.len().next_multiple_of(4), 0);
    let mut out = b"glTF".to_vec();
    out.extend(2u32.to_le_bytes());
    out.extend((12 + 8 + text.len() as u32 + 8 + bin.len() as u32).to_le_bytes());
    for (kind, payload) in [(b"JSON", &text), (b"BIN\0", &bin)] {
        out.extend((payload.len() as u32).to_le_bytes());
        out.extend(kind);
        out.extend(payload);
    }
    out
}

pub(crate) fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// Corners of the unit square, as two triangles would use them.
pub(crate) const SQUARE: [f32; 12] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0];

/// A file with one square: accessors 0 POSITION, 1 NORMAL, 2 TEXCOORD_0, 3 indices (u16); one material, one node. Its
/// buffer is the GLB's.
pub(crate) fn square() -> (Value, Vec<u8>) {
    let mut bin = floats(&SQUARE);
    bin.extend(floats(&[0.0, 0.0, 1.0].repeat(4)));
    bin.extend(floats(&[0.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0]));
    bin.extend([0u16, 1, 2, 0, 2, 3].iter().flat_map(|i| i.to_le_bytes()));
    let json = json!({
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": "Square", "mesh": 0}],
        "meshes": [{"name": "Quad", "primitives": [{
            "attributes": {"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2}, "indices": 3, "material": 0}]}],
        "materials": [{"name": "Paint", "pbrMetallicRoughness": {"metallicFactor": 0.0}}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 2, "componentType": 5126, "count": 4, "type": "VEC2"},
            {"bufferView": 3, "componentType": 5123, "count": 6, "type": "SCALAR"}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 48},
            {"buffer": 0, "byteOffset": 48, "byteLength": 48},
            {"buffer": 0, "byteOffset": 96, "byteLength": 32},
            {"buffer": 0, "byteOffset": 128, "byteLength": 12}],
        "buffers": [{"byteLength": 140}]
    });
    (json, bin)
}

/// As [`square`], with an image of 2×2 texels (the first of alpha 64) as the material's base colour texture.
pub(crate) fn textured_square() -> (Value, Vec<u8>) {
    let (mut json, mut bin) = square();
    let picture = png(&[[255, 0, 0, 64], [0, 255, 0, 255], [0, 0, 255, 255], [9, 9, 9, 255]]);
    let start = bin.len();
    bin.extend(&picture);
    push(&mut json["bufferViews"], json!({"buffer": 0, "byteOffset": start, "byteLength": picture.len()}));
    json["buffers"][0]["byteLength"] = bin.len().into();
    json["images"] = json!([{"bufferView": 4, "mimeType": "image/png"}]);
    json["textures"] = json!([{"source": 0}]);
    json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = json!({"index": 0});
    (json, bin)
}

/// Appends to a JSON array.
pub(crate) fn push(array: &mut Value, value: Value) {
    array.as_array_mut().unwrap().push(value);
}

/// A PNG of 2×2 texels.
pub(crate) fn png(texels: &[[u8; 4]; 4]) -> Vec<u8> {
    let image = image::RgbaImage::from_raw(2, 2, texels.concat()).unwrap();
    let mut out = Vec::new();
    image.write_to(&mut std::io::Cursor::new(&mut out), image::ImageFormat::Png).unwrap();
    out
}

/// Appends an accessor over bytes of its own and returns its index.
pub(crate) fn accessor(
    json: &mut Value,
    bin: &mut Vec<u8>,
    bytes: &[u8],
    component: u32,
    kind: &str,
) -> usize {
    let components = match kind {
        "SCALAR" => 1,
        "VEC2" => 2,
        "VEC3" => 3,
        "MAT4" => 16,
        _ => 4,
    };
    let size = match component {
        5120 | 5121 => 1,
        5122 | 5123 => 2,
        _ => 4,
    };
    bin.resize(bin.len().next_multiple_of(4), 0);
    let view = json["bufferViews"].as_array().unwrap().len();
    push(&mut json["bufferViews"], json!({"buffer": 0, "byteOffset": bin.len(), "byteLength": bytes.len()}));
    let count = bytes.len() / size / components;
    push(
        &mut json["accessors"],
        json!({"bufferView": view, "componentType": component, "count": count, "type": kind}),
    );
    bin.extend(bytes);
    json["buffers"][0]["byteLength"] = bin.len().into();
    json["accessors"].as_array().unwrap().len() - 1
}

/// As [`accessor`], of floats.
pub(crate) fn float_accessor(json: &mut Value, bin: &mut Vec<u8>, values: &[f32], kind: &str) -> usize {
    accessor(json, bin, &floats(values), 5126, kind)
}

/// Loads at a point in time.
pub(crate) fn load_at(json: &Value, bin: &[u8], time: f64) -> Result<Scene, LoadError> {
    let options = LoadOptions { time: Some(time), ..Default::default() };
    load_glb_bytes("test.glb", &glb(json, bin), &options)
}

/// Asserts that numbers agree.
#[track_caller]
pub(crate) fn assert_close<A: Into<f64> + Copy, B: Into<f64> + Copy>(
    got: &[A],
    wanted: &[B],
    tolerance: f64,
) {
    assert_eq!(got.len(), wanted.len());
    for (i, (got, wanted)) in got.iter().zip(wanted).enumerate() {
        let (got, wanted) = ((*got).into(), (*wanted).into());
        assert!((got - wanted).abs() <= tolerance, "number {i}: {got} instead of {wanted}");
    }
}

pub(crate) fn load_pair(json: &Value, bin: &[u8]) -> Result<Scene, LoadError> {
    load_glb_bytes("test.glb", &glb(json, bin), &LoadOptions::default())
}

/// Loads [`square`] after a change.
pub(crate) fn load_changed(change: impl FnOnce(&mut Value, &mut Vec<u8>)) -> Result<Scene, LoadError> {
    let (mut json, mut bin) = square();
    change(&mut json, &mut bin);
    load_pair(&json, &bin)
}

/// Writes files into a fresh folder and loads the first.
pub(crate) fn load_files(files: &[(&str, &[u8])]) -> Result<Scene, LoadError> {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in files {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, bytes).unwrap();
    }
    load(&folder.path().join(files[0].0), &LoadOptions::default())
}

/// Asserts that every index of a scene leads somewhere and that the numbers are what the types promise.
pub(crate) fn check(scene: &Scene) {
    for instance in &scene.instances {
        assert!((instance.object as usize) < scene.objects.len());
        assert!((instance.mesh as usize) < scene.meshes.len());
        assert!((instance.material as usize) < scene.materials.len());
        assert!(instance.to_world.iter().flatten().all(|c| c.is_finite()));
    }
    for mesh in &scene.meshes {
        assert!(!mesh.triangles.is_empty());
        assert!(mesh.triangles.iter().flatten().all(|i| (*i as usize) < mesh.positions.len()));
        assert!(mesh.positions.iter().flatten().all(|c| c.is_finite()));
        for normal in mesh.normals.iter().flatten() {
            let length = normal.iter().map(|c| f64::from(*c).powi(2)).sum::<f64>();
            assert!((length - 1.0).abs() < 1e-5, "{normal:?}");
        }
        assert!(mesh.normals.as_ref().is_none_or(|n| n.len() == mesh.positions.len()));
        assert!(mesh.uvs.as_ref().is_none_or(|uv| uv.len() == mesh.positions.len()));
        assert!(mesh.uvs.iter().flatten().flatten().all(|c| c.is_finite()));
        assert!(mesh.colors.as_ref().is_none_or(|c| c.len() == mesh.positions.len()));
        assert!(mesh.colors.iter().flatten().flatten().all(|c| (0.0..=1.0).contains(c)));
        assert!(mesh.tangents.as_ref().is_none_or(|t| t.len() == mesh.positions.len()));
        for [x, y, z, w] in mesh.tangents.iter().flatten() {
            assert!((x * x + y * y + z * z - 1.0).abs() < 1e-5 && w.abs() == 1.0);
        }
    }
    for texture in &scene.textures {
        assert_eq!(texture.rgba.len(), 4 * texture.width as usize * texture.height as usize);
    }
    let mut names: Vec<_> = scene.objects.iter().map(|o| &o.name).collect();
    names.extend(scene.lights.iter().map(|light| &light.name));
    names.sort();
    names.dedup();
    assert_eq!(names.len(), scene.objects.len() + scene.lights.len());
    for light in &scene.lights {
        assert!(light.intensity.iter().all(|c| c.is_finite() && *c >= 0.0));
    }
}

/// The count of the repair that says `what`, 0 where there is none.
pub(crate) fn repaired(scene: &Scene, what: &str) -> u64 {
    scene.repairs.iter().filter(|r| r.what.contains(what)).map(|r| r.count).sum()
}

/// Asserts that the scene is whole but for one image, which is named with all `parts`.
#[track_caller]
pub(crate) fn assert_left_out(scene: &Scene, case: &str, parts: &[&str]) {
    check(scene);
    assert!(scene.textures.is_empty() && scene.meshes.len() == 1, "{case}");
    let [repair] = &scene.repairs[..] else { panic!("{case}: {:?}", scene.repairs) };
    assert!(repair.what.contains("image left out") && repair.count == 1, "{case}: {repair:?}");
    for part in parts {
        assert!(repair.element.contains(part), "{case}: no {part} in {repair:?}");
    }
}

/// Asserts that loading failed with a message that names `file` and holds all `parts`.
#[track_caller]
pub(crate) fn assert_refused(result: Result<Scene, LoadError>, case: &str, file: &str, parts: &[&str]) {
    let message = match result {
        Ok(_) => panic!("{case}: loaded"),
        Err(error) => error.to_string(),
    };
    assert!(message.contains(file), "{case}: no file in: {message}");
    assert!(message.contains("; "), "{case}: no advice in: {message}");
    for part in parts {
        assert!(message.contains(part), "{case}: no {part:?} in: {message}");
    }
}

/// The path of a file in a folder as text.
pub(crate) fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}
