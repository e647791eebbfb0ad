//! Buffer views compressed by `EXT_meshopt_compression` and its successor.

use hotspot_scene::{LoadError, LoadOptions, Scene, load_glb_bytes};
use serde_json::{Value, json};

use crate::support::*;

/// Corners of the unit square, by the reference encoder (meshoptimizer 1.3).
const SQUARE_V0: [u8; 67] = [
    0xA0, 0x00, 0x00, 0x01, 0x33, 0x00, 0x00, 0x00, 0xFF, 0xFF, 0x01, 0x33, 0x00, 0x00, 0x00, 0x7E, 0x7D,
    0x00, 0x00, 0x01, 0x0C, 0x00, 0x00, 0x00, 0xFF, 0x01, 0x0C, 0x00, 0x00, 0x00, 0x7E, 0x00, 0x00, 0x00,
    0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00,
    0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00,
];
/// Its two triangles.
const TRIANGLES: [u8; 19] = [
    0xE1, 0xF0, 0x00, 0x00, 0x76, 0x87, 0x56, 0x67, 0x78, 0xA9, 0x86, 0x65, 0x89, 0x68, 0x98, 0x01, 0x69,
    0x00, 0x00,
];

/// The square of [`square`], positions and indices compressed, in a second buffer that has no data. `extension` is one of
/// the two names.
fn compressed(extension: &str) -> (Value, Vec<u8>) {
    let (mut json, mut bin) = square();
    for (view, stream, layout) in [
        (0, &SQUARE_V0[..], json!({"byteStride": 12, "count": 4, "mode": "ATTRIBUTES"})),
        (3, &TRIANGLES[..], json!({"byteStride": 2, "count": 6, "mode": "TRIANGLES", "filter": "NONE"})),
    ] {
        let mut layout = layout;
        layout["buffer"] = 0.into();
        layout["byteOffset"] = bin.len().into();
        layout["byteLength"] = stream.len().into();
        bin.extend(stream);
        json["bufferViews"][view]["buffer"] = 1.into();
        json["bufferViews"][view]["extensions"][extension] = layout;
    }
    json["buffers"][0]["byteLength"] = bin.len().into();
    push(&mut json["buffers"], json!({"byteLength": 140, "extensions": {extension: {"fallback": true}}}));
    json["extensionsUsed"] = json!([extension]);
    json["extensionsRequired"] = json!([extension]);
    (json, bin)
}

fn load_compressed(change: impl FnOnce(&mut Value)) -> Result<Scene, LoadError> {
    let (mut json, bin) = compressed("EXT_meshopt_compression");
    change(&mut json);
    load_pair(&json, &bin)
}

#[test]
fn compressed_views_are_read_as_plain_ones() {
    for extension in ["EXT_meshopt_compression", "KHR_meshopt_compression"] {
        let (json, bin) = compressed(extension);
        let scene = load_pair(&json, &bin).unwrap();
        check(&scene);
        assert_eq!(scene.meshes[0].positions.concat(), SQUARE);
        assert_eq!(scene.meshes[0].triangles, [[0, 1, 2], [0, 2, 3]]);
        assert!(scene.unmodelled.is_empty() && scene.repairs.is_empty());
    }
}

#[test]
fn broken_compression_is_refused_by_name() {
    type Change = fn(&mut Value);
    let cases: [(&str, Change, &[&str]); 13] = [
        ("no such buffer", |e| e["buffer"] = 7.into(), &["EXT_meshopt_compression.buffer", "7"]),
        ("no buffer", |e| e["buffer"] = Value::Null, &["EXT_meshopt_compression.buffer"]),
        ("a buffer without data", |e| e["buffer"] = 1.into(), &["buffers[1]", "no data"]),
        ("beyond the buffer", |e| e["byteOffset"] = 9999.into(), &["bufferViews[0]", "9999"]),
        ("another mode", |e| e["mode"] = "POINTS".into(), &["EXT_meshopt_compression.mode", "POINTS"]),
        ("another filter", |e| e["filter"] = "BLUR".into(), &["EXT_meshopt_compression.filter", "BLUR"]),
        ("a stride of 0", |e| e["byteStride"] = 0.into(), &["byteStride"]),
        ("an odd stride", |e| e["byteStride"] = 10.into(), &["byteStride"]),
        ("a huge stride", |e| e["byteStride"] = 260.into(), &["byteStride"]),
        ("a stride that the filter lacks", |e| e["filter"] = "QUATERNION".into(), &["byteStride"]),
        ("too many elements", |e| e["count"] = 400.into(), &["bufferViews[0]", "cut short"]),
        ("too few elements", |e| e["count"] = 0.into(), &["bufferViews[0]", "more than it should"]),
        ("a stream of another mode", |e| e["mode"] = "INDICES".into(), &["bufferViews[0]"]),
    ];
    for (case, change, parts) in cases {
        let result = load_compressed(|json| {
            change(&mut json["bufferViews"][0]["extensions"]["EXT_meshopt_compression"]);
        });
        assert_refused(result, case, "test.glb", parts);
    }
    // Claims of more than memory holds are refused before anything is allocated.
    let result = load_compressed(|json| {
        json["bufferViews"][0]["extensions"]["EXT_meshopt_compression"]["count"] = (1u64 << 40).into();
    });
    assert!(matches!(result, Err(LoadError::Limit { .. })), "{result:?}");
}

#[test]
fn damaged_compressed_files_never_panic() {
    let (json, bin) = compressed("KHR_meshopt_compression");
    let options = LoadOptions { max_memory_bytes: 16 << 20, ..Default::default() };
    for at in 140..bin.len() {
        for bit in 0..8 {
            let mut bin = bin.clone();
            bin[at] ^= 1 << bit;
            if let Ok(scene) = load_glb_bytes("test.glb", &glb(&json, &bin), &options) {
                check(&scene);
            }
        }
    }
}
