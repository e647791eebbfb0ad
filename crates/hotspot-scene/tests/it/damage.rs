//! Cut and flipped files: whatever happens, nothing panics, errors have a place, and what loads is sound.

use hotspot_scene::{LoadError, LoadOptions, Scene, load_glb_bytes};
use serde_json::{Value, json};

use crate::support::*;

/// SplitMix64 (Steele, Lea, Flood 2014), seeded: the mutations are the same in every run.
struct Random(u64);

impl Random {
    fn below(&mut self, bound: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) % bound as u64) as usize
    }
}

/// Small limits keep the mutations quick.
fn options() -> LoadOptions {
    LoadOptions { max_memory_bytes: 16 << 20, ..Default::default() }
}

fn judge(result: Result<Scene, LoadError>, case: &str) -> bool {
    match result {
        Ok(scene) => {
            check(&scene);
            true
        }
        Err(error) => {
            let place = error.place();
            assert!(!place.file.as_os_str().is_empty() && !place.element.is_empty(), "{case}: {error}");
            false
        }
    }
}

fn textured_glb() -> Vec<u8> {
    let (json, bin) = textured_square();
    glb(&json, &bin)
}

#[test]
fn a_glb_cut_anywhere_is_refused() {
    let whole = textured_glb();
    for length in 0..whole.len() {
        let result = load_glb_bytes("cut.glb", &whole[..length], &options());
        assert!(!judge(result, &format!("cut to {length}")), "cut to {length} loaded");
    }
    assert!(judge(load_glb_bytes("whole.glb", &whole, &options()), "whole"));
}

#[test]
fn json_and_buffers_cut_anywhere_are_refused() {
    let (mut json, bin) = square();
    json["buffers"][0]["uri"] = "b.bin".into();
    let text = json.to_string();
    for length in 0..text.len() {
        let result = load_files(&[("a.gltf", &text.as_bytes()[..length]), ("b.bin", &bin)]);
        assert!(result.is_err(), "JSON cut to {length} loaded");
    }
    for length in 0..bin.len() {
        let result = load_files(&[("a.gltf", text.as_bytes()), ("b.bin", &bin[..length])]);
        assert_refused(result, &format!("buffer cut to {length}"), "a.gltf", &["buffers[0].byteLength"]);
    }
}

#[test]
fn flipped_bits_never_panic() {
    let whole = textured_glb();
    let mut random = Random(1);
    let mut loaded = 0;
    for round in 0..2000 {
        let mut bytes = whole.clone();
        for _ in 0..1 + random.below(4) {
            let at = random.below(bytes.len());
            bytes[at] ^= 1 << random.below(8);
        }
        loaded += u32::from(judge(load_glb_bytes("flip.glb", &bytes, &options()), &format!("round {round}")));
    }
    // Both outcomes must occur, or the test tests nothing.
    assert!((100..1900).contains(&loaded), "{loaded}");
}

#[test]
fn numbers_replaced_in_the_json_never_panic() {
    let (json, bin) = textured_square();
    replace_numbers(&json, &bin);
}

#[test]
fn numbers_replaced_in_materials_lights_and_variants_never_panic() {
    let (mut json, bin) = textured_square();
    let slot = json!({"index": 0, "texCoord": 0, "extensions": {"KHR_texture_transform":
        {"offset": [0, 1], "rotation": 2, "scale": [3, 4], "texCoord": 1}}});
    json["materials"] = json!([
        {"alphaMode": "MASK", "alphaCutoff": 0, "emissiveFactor": [1, 2, 3], "emissiveTexture": slot,
            "normalTexture": slot, "occlusionTexture": {"index": 0}, "extensions": {
                "KHR_materials_pbrSpecularGlossiness": {"diffuseFactor": [1, 1, 1, 1], "diffuseTexture": slot,
                    "specularFactor": [1, 1, 1], "glossinessFactor": 1, "specularGlossinessTexture": slot}}},
        {"pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 1}, "extensions": {
            "KHR_materials_ior": {"ior": 2}, "KHR_materials_sheen": {"sheenColorFactor": [0, 1, 0]},
            "KHR_materials_specular": {"specularFactor": 1, "specularTexture": slot,
                "specularColorFactor": [1, 1, 1], "specularColorTexture": slot},
            "KHR_materials_transmission": {"transmissionFactor": 1, "transmissionTexture": slot},
            "KHR_materials_volume": {"thicknessFactor": 1, "attenuationDistance": 1,
                "attenuationColor": [1, 1, 1]}}}]);
    json["textures"] = json!([{"source": 0, "extensions": {"EXT_texture_webp": {"source": 0}}}]);
    json["nodes"] = json!([{"mesh": 0}, {"extensions": {"KHR_lights_punctual": {"light": 0}}}]);
    json["scenes"] = json!([{"nodes": [0, 1]}]);
    json["extensions"] = json!({
        "KHR_lights_punctual": {"lights": [{"type": "spot", "color": [1, 1, 1], "intensity": 1, "range": 1,
            "spot": {"innerConeAngle": 0, "outerConeAngle": 1}}]},
        "KHR_materials_variants": {"variants": [{"name": "glass"}]}});
    let mut second = json["meshes"][0]["primitives"][0].clone();
    second["extensions"] =
        json!({"KHR_materials_variants": {"mappings": [{"material": 1, "variants": [0]}]}});
    push(&mut json["meshes"][0]["primitives"], second);
    replace_numbers(&json, &bin);
}

/// Loads the file with each of its numbers replaced by what it should not be.
fn replace_numbers(json: &Value, bin: &[u8]) {
    let text = json.to_string();
    let load = |json: &Value| {
        let variant = json.pointer("/extensions/KHR_materials_variants").map(|_| "glass".into());
        load_glb_bytes("change.glb", &glb(json, bin), &LoadOptions { variant, ..options() })
    };
    let whole = load(json);
    assert!(whole.as_ref().is_ok_and(|scene| scene.repairs.len() <= 4), "{whole:?}");
    let values =
        ["-1", "0", "1e300", "4294967296", "18446744073709551615", "0.5", "null", "\"x\"", "[]", "{}"];
    let digits: Vec<usize> = text
        .bytes()
        .enumerate()
        .filter(|(i, b)| b.is_ascii_digit() && !text.as_bytes()[i - 1].is_ascii_digit())
        .map(|(i, _)| i)
        .collect();
    for start in digits {
        let end = start + text[start..].find(|c: char| !c.is_ascii_digit()).unwrap();
        for value in values {
            let changed = format!("{}{value}{}", &text[..start], &text[end..]);
            // Digits within names and within text stay text; whatever is still JSON is tried.
            if let Ok(json) = serde_json::from_str(&changed) {
                judge(load(&json), &changed);
            }
        }
    }
}

const OBJ: &str = "mtllib m.mtl\no Box\nv 0 0 0\nv 1 0 0 1 0.5 0\nv 1 1 0\nv 0 1 0 \\\n1 1 1\nvt 0 0\nvt 1 1\nvn 0 0 1\n\
    usemtl m\nf 1/1/1 2/2/1 3/1/1 4/2/1\nf -4 -3 -2\ng Other\nf 1//1 2//1 3//1\nusemtl glass\ns 1\nf 1 2 3 4\r\
    s 2\nf 1/1 3/2 4/1 # comment\nusemtl metal\ns off\nf 3 2 1\n";
const MTL: &str = "newmtl m\nKd 0.5 0.5 0.5\nKs 0.1 0.1 0.1\nNs 10\nd 0.5\nmap_Kd -s 2 2 t.png\nillum 2\n\
    newmtl glass\nillum 6\nNi 1.5\nTf 0,9 1 1\nnewmtl metal\nPm 0.5\nmap_Pr -imfchan g -clamp on -mm 0 1 t.png\n";

#[test]
fn obj_cut_or_flipped_never_panics() {
    let picture = png(&[[1; 4]; 4]);
    let run = |obj: &[u8], mtl: &[u8]| load_files(&[("a.obj", obj), ("m.mtl", mtl), ("t.png", &picture)]);
    assert!(run(OBJ.as_bytes(), MTL.as_bytes()).unwrap().unmodelled.is_empty());
    for length in 0..OBJ.len() {
        judge(run(&OBJ.as_bytes()[..length], MTL.as_bytes()), "OBJ cut");
    }
    for length in 0..MTL.len() {
        judge(run(OBJ.as_bytes(), &MTL.as_bytes()[..length]), "MTL cut");
    }
    let mut random = Random(2);
    for round in 0..1500 {
        let mut files = [OBJ.as_bytes().to_vec(), MTL.as_bytes().to_vec()];
        let file = &mut files[random.below(2)];
        let at = random.below(file.len());
        file[at] ^= 1 << random.below(8);
        judge(run(&files[0], &files[1]), &format!("round {round}"));
    }
}
