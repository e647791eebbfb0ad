//! Primitives compressed by `KHR_draco_mesh_compression`.

use hotspot_scene::{LoadError, LoadOptions, Scene, load_glb_bytes};
use serde_json::{Value, json};

use crate::support::*;

/// The unit square with normals (attribute 1), texture coordinates (2) and the numbers of its corners as joints (3), by a
/// Draco 2.2 encoder.
const DRACO: [u8; 227] = [
    0x44, 0x52, 0x41, 0x43, 0x4F, 0x02, 0x02, 0x01, 0x01, 0x00, 0x00, 0x00, 0x04, 0x02, 0x03, 0x02, 0x00,
    0x00, 0x01, 0x1F, 0xFF, 0x01, 0x11, 0xFF, 0x01, 0x11, 0xFF, 0x01, 0x11, 0xFF, 0x01, 0x11, 0x04, 0xFF,
    0x00, 0x00, 0x00, 0x00, 0x00, 0x01, 0x00, 0x00, 0x02, 0x00, 0x00, 0x01, 0x00, 0x09, 0x03, 0x00, 0x00,
    0x00, 0x01, 0x01, 0x09, 0x03, 0x00, 0x01, 0x00, 0x01, 0x03, 0x09, 0x02, 0x00, 0x02, 0x00, 0x01, 0x04,
    0x04, 0x04, 0x00, 0x03, 0x01, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00,
    0x00, 0x00, 0x80, 0x3F, 0x00, 0x00, 0x80, 0x3F, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00,
    0x00, 0x80, 0x3F, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x80, 0x3F, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00,
    0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x80, 0x3F, 0x00, 0x00, 0x00,
    0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x80, 0x3F, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00,
    0x00, 0x00, 0x80, 0x3F, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x80, 0x3F, 0x00,
    0x00, 0x00, 0x00, 0x00, 0x00, 0x80, 0x3F, 0x00, 0x00, 0x80, 0x3F, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00,
    0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x80, 0x3F, 0x00, 0x00, 0x80, 0x3F, 0x01, 0x01, 0x01,
    0x01, 0x01, 0x04, 0x01, 0x34, 0x03, 0x01, 0x08, 0x01, 0x04, 0x04, 0x00, 0xBD, 0xEA, 0x8C, 0x00, 0x00,
    0x00, 0x00, 0x03, 0x00, 0x00, 0x00,
];

/// The square of [`textured_square`] as a compressed primitive alone.
fn compressed() -> (Value, Vec<u8>) {
    let (mut json, mut bin) = textured_square();
    let view = json["bufferViews"].as_array().unwrap().len();
    bin.resize(bin.len().next_multiple_of(4), 0);
    push(&mut json["bufferViews"], json!({"buffer": 0, "byteOffset": bin.len(), "byteLength": DRACO.len()}));
    bin.extend(DRACO);
    json["buffers"][0]["byteLength"] = bin.len().into();
    for accessor in json["accessors"].as_array_mut().unwrap() {
        accessor.as_object_mut().unwrap().remove("bufferView");
    }
    json["meshes"][0]["primitives"][0]["extensions"] = json!({"KHR_draco_mesh_compression":
        {"bufferView": view, "attributes": {"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2}}});
    json["extensionsUsed"] = json!(["KHR_draco_mesh_compression"]);
    json["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]);
    (json, bin)
}

fn load_compressed(change: impl FnOnce(&mut Value)) -> Result<Scene, LoadError> {
    let (mut json, bin) = compressed();
    change(&mut json);
    load_pair(&json, &bin)
}

/// The stream's order of vertices: corners (0, 1), (0, 0), (1, 1) and (1, 0).
fn check_square(scene: &Scene) {
    check(scene);
    let mesh = &scene.meshes[0];
    assert_eq!(mesh.positions, [[0.0, 1.0, 0.0], [0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0, 0.0, 0.0]]);
    assert_eq!(mesh.triangles, [[0, 1, 2], [1, 3, 2]]);
    assert_eq!(mesh.normals.as_ref().unwrap()[..], [[0.0, 0.0, 1.0]; 4]);
    assert_eq!(mesh.uvs.as_ref().unwrap()[..], [[0.0, 0.0], [0.0, 1.0], [1.0, 0.0], [1.0, 1.0]]);
}

#[test]
fn compressed_primitives_are_read_as_plain_ones() {
    let scene = load_compressed(|_| {}).unwrap();
    check_square(&scene);
    assert!(scene.unmodelled.is_empty() && scene.repairs.is_empty());
}

#[test]
fn the_stream_counts_also_where_uncompressed_data_stands_beside_it() {
    let scene = load_compressed(|json| {
        json["accessors"][0]["bufferView"] = 0.into();
        json.as_object_mut().unwrap().remove("extensionsRequired");
        // Without an accessor for the indices, and with a wrong count.
        json["meshes"][0]["primitives"][0].as_object_mut().unwrap().remove("indices");
        json["accessors"][1]["count"] = 9.into();
    })
    .unwrap();
    check_square(&scene);
    assert_eq!(repaired(&scene, "count of an accessor"), 1);
}

#[test]
fn joints_may_be_compressed() {
    let (mut json, mut bin) = compressed();
    push(&mut json["accessors"], json!({"componentType": 5121, "count": 4, "type": "VEC4"}));
    let weights = float_accessor(&mut json, &mut bin, &[1.0, 0.0, 0.0, 0.0].repeat(4), "VEC4");
    let primitive = &mut json["meshes"][0]["primitives"][0];
    primitive["attributes"]["JOINTS_0"] = 4.into();
    primitive["attributes"]["WEIGHTS_0"] = weights.into();
    primitive["extensions"]["KHR_draco_mesh_compression"]["attributes"]["JOINTS_0"] = 3.into();
    // Each corner is lifted by its number.
    json["nodes"][0]["skin"] = 0.into();
    for joint in 0..4 {
        push(&mut json["nodes"], json!({"translation": [0, 0, joint]}));
    }
    json["skins"] = json!([{"joints": [1, 2, 3, 4]}]);
    let scene = load_pair(&json, &bin).unwrap();
    let lifted: Vec<_> = scene.meshes[0].positions.iter().map(|p| p[2]).collect();
    assert_eq!(lifted, [3.0, 0.0, 2.0, 1.0]);
}

#[test]
fn broken_streams_are_refused_by_name() {
    type Change = fn(&mut Value);
    let cases: [(&str, Change, &[&str]); 8] = [
        ("no view", |e| e["bufferView"] = Value::Null, &["KHR_draco_mesh_compression.bufferView"]),
        ("no such view", |e| e["bufferView"] = 99.into(), &["KHR_draco_mesh_compression.bufferView"]),
        ("not a stream", |e| e["bufferView"] = 1.into(), &["cannot be decoded", "without mesh compression"]),
        ("no attributes", |e| e["attributes"] = Value::Null, &["KHR_draco_mesh_compression.attributes"]),
        ("no such attribute", |e| e["attributes"]["NORMAL"] = 9.into(), &["attributes.NORMAL", "stream"]),
        ("other components", |e| e["attributes"]["NORMAL"] = 2.into(), &["2 components", "3"]),
        ("none of the primitive", |e| e["attributes"]["COLOR_0"] = 1.into(), &["attributes.COLOR_0"]),
        ("no positions", |e| e["attributes"] = json!({"NORMAL": 1}), &["accessors[0].bufferView"]),
    ];
    for (case, change, parts) in cases {
        let result = load_compressed(|json| {
            change(&mut json["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"]);
        });
        assert_refused(result, case, "test.glb", parts);
    }
    let result = load_compressed(|json| json["meshes"][0]["primitives"][0]["mode"] = 5.into());
    assert_refused(result, "a strip", "test.glb", &["strips"]);
    // Fewer positions than the stream has vertices.
    let result = load_compressed(|json| {
        let extension = &mut json["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"];
        extension["attributes"] = json!({});
        json["accessors"][0] = json!({"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"});
        json["meshes"][0]["primitives"][0]["attributes"] = json!({"POSITION": 0});
        json["materials"] = json!([{}]);
    });
    assert_refused(result, "few positions", "test.glb", &["primitives[0]", "3 positions"]);
}

#[test]
fn damaged_streams_never_panic() {
    let (json, bin) = compressed();
    let options = LoadOptions { max_memory_bytes: 16 << 20, ..Default::default() };
    let start = bin.len() - DRACO.len();
    let mut loaded = 0;
    for at in start..bin.len() {
        for bit in 0..8 {
            let mut bin = bin.clone();
            bin[at] ^= 1 << bit;
            if let Ok(scene) = load_glb_bytes("test.glb", &glb(&json, &bin), &options) {
                check(&scene);
                loaded += 1;
            }
        }
    }
    assert!(loaded > 0 && loaded < 8 * DRACO.len());
}
