//! As `damage`, for a file that moves: skin, morph targets, animation, colours, copies.

use hotspot_scene::{LoadOptions, load_glb_bytes};
use serde_json::{Value, json};

use crate::support::*;

fn moving() -> (Value, Vec<u8>) {
    let (mut json, mut bin) = textured_square();
    let colors = float_accessor(&mut json, &mut bin, &[0.5; 16], "VEC4");
    let joints = accessor(&mut json, &mut bin, &[0, 1, 0, 0].repeat(4), 5121, "VEC4");
    let weights = float_accessor(&mut json, &mut bin, &[0.5, 0.5, 0.0, 0.0].repeat(4), "VEC4");
    let delta = float_accessor(&mut json, &mut bin, &[0.0, 0.0, 1.0].repeat(4), "VEC3");
    let matrices = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0].repeat(2);
    let inverse = float_accessor(&mut json, &mut bin, &matrices, "MAT4");
    let times = float_accessor(&mut json, &mut bin, &[0.0, 1.0], "SCALAR");
    let turns = float_accessor(&mut json, &mut bin, &[0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0], "VEC4");
    let shares = float_accessor(&mut json, &mut bin, &[0.0, 1.0, 0.5, 1.0, 2.0, 0.5], "SCALAR");
    let copies = float_accessor(&mut json, &mut bin, &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0], "VEC3");
    let attributes = &mut json["meshes"][0]["primitives"][0]["attributes"];
    attributes["COLOR_0"] = colors.into();
    attributes["JOINTS_0"] = joints.into();
    attributes["WEIGHTS_0"] = weights.into();
    json["meshes"][0]["primitives"][0]["targets"] = json!([{"POSITION": delta, "NORMAL": delta}]);
    json["skins"] = json!([{"joints": [1, 2], "inverseBindMatrices": inverse}]);
    json["nodes"] = json!([
        {"mesh": 0, "skin": 0, "weights": [1]},
        {"children": [2], "scale": [2, 2, 2]},
        {"translation": [0, 1, 0]},
        {"mesh": 0, "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": copies}}}}
    ]);
    json["scenes"][0]["nodes"] = json!([0, 1, 3]);
    json["animations"] = json!([{
        "samplers": [
            {"input": times, "output": turns},
            {"input": times, "output": shares, "interpolation": "CUBICSPLINE"}
        ],
        "channels": [
            {"sampler": 0, "target": {"node": 2, "path": "rotation"}},
            {"sampler": 1, "target": {"node": 0, "path": "weights"}}
        ]
    }]);
    json["extensionsUsed"] = json!(["EXT_mesh_gpu_instancing"]);
    (json, bin)
}

fn load(bytes: &[u8], case: &str) -> bool {
    let options = LoadOptions { max_memory_bytes: 16 << 20, time: Some(0.25), ..Default::default() };
    match load_glb_bytes("moving.glb", bytes, &options) {
        Ok(scene) => {
            check(&scene);
            true
        }
        Err(error) => {
            assert!(!error.place().element.is_empty(), "{case}: {error}");
            false
        }
    }
}

#[test]
fn flipped_bits_of_moving_files_never_panic() {
    let (json, bin) = moving();
    let whole = glb(&json, &bin);
    assert!(load(&whole, "whole"));
    // SplitMix64 (Steele, Lea, Flood 2014).
    let mut state = 3u64;
    let mut random = move |bound: usize| {
        state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (state ^ (state >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) % bound as u64) as usize
    };
    let start = whole.len() - bin.len();
    let mut loaded = 0;
    for round in 0..4000 {
        let mut bytes = whole.clone();
        // Every other round damages the numbers alone.
        let first = if round % 2 == 0 { 0 } else { start };
        for _ in 0..1 + random(4) {
            let at = first + random(bytes.len() - first);
            bytes[at] ^= 1 << random(8);
        }
        loaded += u32::from(load(&bytes, &format!("round {round}")));
    }
    assert!((500..3800).contains(&loaded), "{loaded}");
}

#[test]
fn numbers_replaced_in_moving_files_never_panic() {
    let (json, bin) = moving();
    let text = json.to_string();
    let values = ["-1", "0", "7", "1e300", "4294967296", "0.5", "null", "\"x\"", "[]", "{}"];
    let digit = |i: usize| text.as_bytes()[i].is_ascii_digit();
    for start in (1..text.len()).filter(|i| digit(*i) && !digit(*i - 1)) {
        let end = start + text[start..].find(|c: char| !c.is_ascii_digit()).unwrap();
        for value in values {
            let changed = format!("{}{value}{}", &text[..start], &text[end..]);
            // What is still JSON is tried.
            if let Ok(json) = serde_json::from_str(&changed) {
                load(&glb(&json, &bin), &changed);
            }
        }
    }
}
