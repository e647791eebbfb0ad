//! Cut and flipped files: whatever happens, nothing panics, errors have a place, and what loads is sound.

use hotspot_scene::{LoadError, LoadOptions, Scene, load_glb_bytes};

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
    let text = json.to_string();
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
                judge(load_glb_bytes("change.glb", &glb(&json, &bin), &options()), &changed);
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
