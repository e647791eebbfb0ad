//! Radiance that is not finite: counted in the JSON, and shown with pixel, sample and the command that shows it again.
//!
//! No scene should give any, so the file has to overflow f32: luminous mirrors face to face, of 3e38 each.

use std::path::Path;
use std::process::Command;

/// A mirror of two triangles before the eye, and a larger one behind it.
fn write_scene(folder: &Path) -> String {
    let mut buffer = Vec::new();
    for p in [[-1.0f32, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]] {
        buffer.extend([p[0], p[1], 0.0].into_iter().flat_map(f32::to_le_bytes));
    }
    buffer.extend([0u16, 1, 2, 0, 2, 3].into_iter().flat_map(u16::to_le_bytes));
    std::fs::write(folder.join("facing.bin"), &buffer).expect("the folder takes a file");
    let scene = serde_json::json!({
        "asset": { "version": "2.0" },
        "scene": 0,
        "scenes": [{ "nodes": [0, 1, 2] }],
        "nodes": [
            { "mesh": 0 },
            { "mesh": 0, "rotation": [0, 1, 0, 0], "translation": [0, 0, 4], "scale": [9, 9, 9] },
            { "camera": 0, "translation": [0.3, 0.2, 3.0] }
        ],
        "cameras": [{ "type": "perspective", "perspective": { "yfov": 1.2, "znear": 0.01 } }],
        "materials": [{
            "pbrMetallicRoughness": { "baseColorFactor": [1, 1, 1, 1], "metallicFactor": 1, "roughnessFactor": 0 },
            "emissiveFactor": [1, 0, 0],
            "extensions": { "KHR_materials_emissive_strength": { "emissiveStrength": 3e38 } }
        }],
        "extensionsUsed": ["KHR_materials_emissive_strength"],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1, "material": 0 }] }],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [-1, -1, 0], "max": [1, 1, 0] },
            { "bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR" }
        ],
        "bufferViews": [
            { "buffer": 0, "byteOffset": 0, "byteLength": 48 },
            { "buffer": 0, "byteOffset": 48, "byteLength": 12 }
        ],
        "buffers": [{ "uri": "facing.bin", "byteLength": 60 }]
    });
    let path = folder.join("facing.gltf");
    std::fs::write(&path, scene.to_string()).expect("the folder takes a file");
    path.to_str().expect("a path in UTF-8").to_owned()
}

/// The warning's words from where it begins, and the document.
fn run(arguments: &[&str], out: &Path) -> (String, serde_json::Value) {
    let output = Command::new(env!("CARGO_BIN_EXE_hotspot-render"))
        .args(arguments)
        .output()
        .expect("the program starts");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(0), "{said}");
    let warning = said.lines().find(|line| line.contains("not finite")).unwrap_or_default().to_owned();
    let json = std::fs::read_to_string(out.join("facing.json")).expect("the JSON was written");
    (warning, serde_json::from_str(&json).expect("it is JSON"))
}

#[test]
fn what_is_not_finite_is_counted_and_can_be_shown_again() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let scene = write_scene(folder.path());
    let out = folder.path().join("out");
    let out_name = out.to_str().expect("a path in UTF-8");
    // More samples than the list of a tile holds.
    let arguments = ["render", &scene, "--size", "40x24", "--spp", "60", "--threads", "2", "-o", out_name];
    let (warning, json) = run(&arguments, &out);
    let count: u64 = warning
        .split_whitespace()
        .find_map(|word| word.parse().ok())
        .unwrap_or_else(|| panic!("no count in {warning:?}"));
    assert!(count > 5_000 && count < 40 * 24 * 60, "{warning}");
    assert!(warning.contains("pixel (") && warning.contains("sample "), "{warning}");
    let repairs = json["repairs"].as_array().expect("a list");
    let noted: Vec<_> =
        repairs.iter().filter(|r| r["what"].as_str().is_some_and(|w| w.contains("not finite"))).collect();
    assert_eq!(noted.len(), 1, "{repairs:?}");
    assert_eq!(noted[0]["count"].as_u64(), Some(count));

    // The command that it names, as it stands.
    let (_, command) = warning.split_once("please report it: ").expect("a command");
    let words: Vec<&str> = command.split_whitespace().collect();
    assert!(words[0].contains("hotspot-render"), "{command}");
    let (again, _) = run(&words[1..], &out);
    assert_eq!(again, warning);
}
