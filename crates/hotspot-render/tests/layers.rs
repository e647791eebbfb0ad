//! `--layers aov`, and `bake`, from the command line to the files.

use hotspot_cost::exr_io::{Limits, read};
use hotspot_cost::{Document, cryptomatte};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn scene(name: &str) -> String {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
    root.join(name).to_string_lossy().into_owned()
}

fn hotspot(words: &[&str], folder: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_hotspot-render")).args(words).arg("-o").arg(folder).output().unwrap()
}

fn run(words: &[&str], folder: &Path) -> String {
    let output = hotspot(words, folder);
    assert!(output.status.success(), "{words:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// The layers are there, change nothing else, and name what the pixels show.
#[test]
fn guides_and_mattes_are_in_the_file_and_change_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let (plain, with) = (folder.path().join("plain"), folder.path().join("with"));
    let wide = scene("mirror-gap-wide/mirror-gap-wide.gltf");
    let words = [wide.as_str(), "--size", "40x30", "--spp", "4", "--quiet"];
    run(&words, &plain);
    run(&[&words[..], &["--layers", "var,aov"]].concat(), &with);
    let load = |out: &Path| read(&out.join("mirror-gap-wide.exr"), &Limits::default()).unwrap();
    let (a, b) = (load(&plain), load(&with));
    let digest = |json: &str| Document::from_json(json, "test").unwrap().digest;
    assert_eq!(digest(&a.header.json), digest(&b.header.json));
    for (name, plane) in &a.layers.planes {
        if !name.contains("time") && name != "A" {
            assert_eq!(b.layers.plane(name), Some(plane.as_slice()), "{name}");
        }
    }
    for name in ["albedo.R", "albedo.G", "albedo.B", "normal.X", "normal.Y", "normal.Z", "depth.Z"] {
        let plane = b.layers.plane(name).unwrap();
        assert!(plane.iter().all(|v| v.is_finite()) && plane.iter().any(|v| *v != 0.0), "{name}");
        assert!(a.layers.plane(name).is_none());
    }
    for layer in ["CryptoObject", "CryptoMaterial"] {
        let alpha = b.layers.plane("A").unwrap();
        for (i, alpha) in alpha.iter().enumerate() {
            let shares = ["00.g", "00.a", "01.g", "01.a", "02.g", "02.a"];
            let sum: f32 = shares.iter().map(|c| b.layers.plane(&format!("{layer}{c}")).unwrap()[i]).sum();
            assert!((sum - alpha).abs() < 1e-6, "{layer} {i}: {sum} {alpha}");
        }
        let (ids, names) = cryptomatte::largest(&b.layers, &b.header.attributes, layer).unwrap();
        assert!(ids.iter().all(|id| (*id as usize) < names.len()), "the room is closed");
    }
    let (_, names) = cryptomatte::largest(&b.layers, &b.header.attributes, "CryptoObject").unwrap();
    assert!(names.iter().any(|name| name == "Wall mirror"), "{names:?}");
    let (_, names) = cryptomatte::largest(&b.layers, &b.header.attributes, "CryptoMaterial").unwrap();
    assert!(names.iter().any(|name| name == "Mirror glass"), "{names:?}");
}

fn glb(path: &Path) -> (Value, Vec<u8>) {
    let bytes = std::fs::read(path).unwrap();
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    (serde_json::from_slice(&bytes[20..20 + length]).unwrap(), bytes[28 + length..].to_vec())
}

/// The values in the file, weighed by the rays in it, are the sum in the JSON; and our loader opens it.
#[test]
fn a_bake_opens_and_its_values_sum_up() {
    let folder = tempfile::tempdir().unwrap();
    let file = |suffix: &str| -> PathBuf { folder.path().join(format!("cornell-box-red.bake.{suffix}")) };
    for views in [&[][..], &["--views", "3"]] {
        let cornell = scene("cornell-box-red/cornell-box-red.gltf");
        let words = ["bake", &cornell, "--size", "32x32", "--spp", "8", "--detail", "24", "--c1", "2"];
        let said = run(&[&words[..], views].concat(), folder.path());
        assert!(said.contains("Of the cost where rays land"), "{said}");
        let (json, bytes) = glb(&file("glb"));
        let document: Value = serde_json::from_slice(&std::fs::read(file("json")).unwrap()).unwrap();
        let landed = &document["landed"];
        let number = |v: &Value| v.as_f64().unwrap();
        assert_eq!(number(&landed["cost"]), number(&landed["nodes"]) + 2.0 * number(&landed["shapes"]));
        assert_eq!(number(&document["paths"]), 8192.0);
        let floats = |accessor: &Value| -> Vec<f64> {
            let view = &json["bufferViews"]
                [json["accessors"][accessor.as_u64().unwrap() as usize]["bufferView"].as_u64().unwrap()
                    as usize];
            let at = view["byteOffset"].as_u64().unwrap() as usize;
            bytes[at..at + view["byteLength"].as_u64().unwrap() as usize]
                .chunks_exact(4)
                .map(|b| f64::from(f32::from_le_bytes(b.try_into().unwrap())))
                .collect()
        };
        let (mut cost, mut rays) = (0.0, 0.0);
        for mesh in json["meshes"].as_array().unwrap() {
            for primitive in mesh["primitives"].as_array().unwrap() {
                let attributes = &primitive["attributes"];
                for (c, r) in floats(&attributes["_COST"]).iter().zip(floats(&attributes["_RAYS"])) {
                    cost += c * r;
                    rays += r;
                }
            }
        }
        // Written as f32.
        assert!((cost / number(&landed["cost"]) - 1.0).abs() < 1e-6, "{cost} {landed}");
        assert!((rays / number(&landed["rays"]) - 1.0).abs() < 1e-6, "{rays} {landed}");
        let opened = hotspot_scene::load(&file("glb"), &hotspot_scene::LoadOptions::default()).unwrap();
        assert!(opened.repairs.is_empty() && opened.unmodelled.is_empty(), "{:?}", opened.repairs);
        assert!(opened.meshes.iter().all(|mesh| mesh.colors.is_some()) && opened.cameras.len() == 1);
        assert!(file("png").is_file());
        // And renders.
        run(&[&file("glb").to_string_lossy(), "--size", "16x16", "--spp", "1", "--quiet"], folder.path());
    }
}

#[test]
fn what_cannot_be_baked_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let cornell = scene("cornell-box-red/cornell-box-red.gltf");
    let fails = |words: &[&str], code: i32, said: &str| {
        let output = hotspot(&[&["bake", &cornell][..], words].concat(), folder.path());
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(code), "{words:?}: {text}");
        assert!(text.contains(said), "{words:?}: {text}");
    };
    fails(&["--adaptive"], 2, "leave --adaptive out");
    fails(&["--views", "3", "--lights", "learned"], 2, "leave it or --views out");
    fails(&["--scale", "3:1"], 2, "lower and the upper end");
    fails(&["--detail", "9999", "--max-memory", "64"], 1, "split triangles less");
}
