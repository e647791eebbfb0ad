//! Edited files: written, loaded again, they are the edited scene.

use crate::support::{glb, square};
use hotspot_scene::edit::{Edit, apply};
use hotspot_scene::{Container, Environment, LoadOptions, Scene, edited_gltf, load, load_glb_bytes};
use serde_json::{Value, json};
use std::path::Path;

fn options() -> LoadOptions {
    LoadOptions::default()
}

fn shared(name: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes").join(name)
}

/// Everything that a renderer sees of a scene, as text; transforms to nine digits.
fn seen(scene: &Scene) -> String {
    let round = |m: [[f64; 4]; 3]| m.map(|row| row.map(|c| (c * 1e9).round() + 0.0));
    // Textures that nothing uses any more are not loaded: numbers shift, texels do not.
    let named = |text: String| {
        let textures = scene.textures.iter().enumerate();
        textures.fold(text, |text, (i, t)| {
            let texels = t.rgba.iter().fold(7u64, |sum, texel| sum.wrapping_mul(31) ^ u64::from(*texel));
            text.replace(&format!("texture: {i},"), &format!("texture: <{texels:x}>,"))
        })
    };
    let instances: Vec<_> = scene
        .instances
        .iter()
        .map(|i| {
            let mesh = &scene.meshes[i.mesh as usize];
            let material = &scene.materials[i.material as usize];
            // Of equal names, the numbers shift when one is no longer used.
            let plain = |name: &str| name.split(" #").next().unwrap_or_default().to_owned();
            let name = plain(&scene.objects[i.object as usize].name);
            let material = hotspot_scene::Material { name: plain(&material.name), ..material.clone() };
            (name, &mesh.positions, &mesh.triangles, named(format!("{material:?}")), round(i.to_world))
        })
        .collect();
    format!("{instances:?} {:?} {:?} {:?}", scene.cameras, scene.lights, scene.environment)
}

/// Writes the edited file both ways into another folder, loads it, and compares it with the edited scene.
fn check(path: &Path, edits: &[Edit]) {
    let original = load(path, &options()).unwrap();
    let (edited, _) = apply(&original, edits).unwrap();
    assert_ne!(seen(&original), seen(&edited), "{edits:?} changes nothing");
    let elsewhere = tempfile::tempdir().unwrap();
    for (container, name) in [(Container::Json, "edited.gltf"), (Container::Binary, "edited.glb")] {
        let bytes = edited_gltf(path, &options(), edits, None, container).unwrap();
        let file = elsewhere.path().join(name);
        std::fs::write(&file, bytes).unwrap();
        let again = load(&file, &options()).unwrap();
        let (expected, got) = (seen(&edited), seen(&again));
        let at = expected.bytes().zip(got.bytes()).position(|(a, b)| a != b).unwrap_or(0).saturating_sub(200);
        let cut = |text: &str| text.get(at..).unwrap_or_default().chars().take(500).collect::<String>();
        let place = format!("{} {name} {edits:?}", path.display());
        assert!(expected == got, "{place}:\n{}\n{}", cut(&expected), cut(&got));
    }
}

fn matte(material: &str) -> Edit {
    Edit::Matte { material: material.into() }
}

fn delete(object: &str) -> Edit {
    Edit::Delete { object: object.into() }
}

fn by(object: &str, by: [f64; 3]) -> Edit {
    Edit::Move { object: object.into(), by }
}

fn rough(material: &str, roughness: f32) -> Edit {
    Edit::Roughness { material: material.into(), roughness }
}

/// Objects and materials of every feature scene, with every change that applies to them.
#[test]
fn edited_files_are_the_edited_scenes() {
    let mut checked = 0;
    let features = std::fs::read_dir(shared("features")).unwrap().map(|entry| entry.unwrap().path());
    let ours = ["mirror-gap-wide"].map(|name| shared(name).join(format!("{name}.gltf")));
    for path in features.chain(ours).filter(|path| path.extension().is_some_and(|e| e == "gltf")) {
        let scene = load(&path, &options()).unwrap();
        let skinned = path.ends_with("skin.gltf");
        let objects = scene.objects.iter().take(2).map(|o| delete(&o.name));
        let moves = scene.objects.iter().filter(|_| !skinned).take(2).map(|o| by(&o.name, [0.5, -1.0, 0.25]));
        let mattes = scene.materials.iter().rev().take(2).map(|m| matte(&m.name));
        let roughs = scene.materials.iter().rev().take(2).map(|m| rough(&m.name, 0.65));
        for edit in objects.chain(moves).chain(mattes).chain(roughs) {
            let edits = [edit];
            // Matte materials cannot be made matte, nor rough.
            if apply(&scene, &edits).is_err() {
                continue;
            }
            match edited_gltf(&path, &options(), &edits, None, Container::Json) {
                Ok(_) => {
                    check(&path, &edits);
                    checked += 1;
                }
                Err(error) => {
                    assert!(error.to_string().contains("texture"), "{error}");
                }
            }
        }
    }
    assert!(checked > 100, "{checked}");
}

/// Nothing but what the edit needs changes in the JSON.
#[test]
fn the_rest_of_the_file_stays() {
    let path = shared("mirror-gap-wide/mirror-gap-wide.gltf");
    let original: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    let scene = load(&path, &options()).unwrap();
    let object = scene.objects[0].name.clone();
    let bytes = edited_gltf(&path, &options(), &[delete(&object)], None, Container::Json).unwrap();
    let mut edited: Value = serde_json::from_slice(&bytes).unwrap();
    let node = original["nodes"].as_array().unwrap().iter().position(|n| n["name"] == json!(object)).unwrap();
    edited["nodes"][node]["mesh"] = original["nodes"][node]["mesh"].clone();
    let uri = edited["buffers"][0]["uri"].as_str().unwrap();
    assert!(uri.starts_with("data:application/octet-stream;base64,"));
    edited["buffers"][0]["uri"] = original["buffers"][0]["uri"].clone();
    assert_eq!(edited, original);
}

/// Children, cameras and what is animated stay where they are when an object is moved.
#[test]
fn moving_an_object_moves_nothing_else() {
    let (mut json, bin) = square();
    json["nodes"] = json!([
        {"name": "Square", "mesh": 0, "scale": [2, 4, 0.5], "rotation": [0, 0.6, 0, 0.8], "children": [1, 2]},
        {"name": "Child", "mesh": 0, "translation": [1, 1, 1]},
        {"mesh": 0, "translation": [-1, 1, 1]}]);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("nested.glb");
    std::fs::write(&path, glb(&json, &bin)).unwrap();
    for object in ["Square", "Child", "Quad"] {
        check(&path, &[by(object, [3.0, -2.0, 1.0])]);
    }
    check(&path, &[by("Child", [1.0, 0.0, 0.0]), delete("Square"), by("Child", [1.0, 0.0, 0.0])]);
}

#[test]
fn an_environment_goes_into_the_scene() {
    let (json, bin) = square();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("square.glb");
    std::fs::write(&path, glb(&json, &bin)).unwrap();
    let dark = Some([0.0; 3]);
    let bytes = edited_gltf(&path, &options(), &[delete("Square")], dark, Container::Binary).unwrap();
    let scene = load_glb_bytes("x.glb", &bytes, &options()).unwrap();
    assert!(matches!(scene.environment, Some(Environment::Constant([0.0, 0.0, 0.0]))));
    assert!(scene.instances.is_empty());
}

#[test]
fn what_a_file_cannot_say_is_refused() {
    let refused =
        |path: &str, edit: Edit| match edited_gltf(&shared(path), &options(), &[edit], None, Container::Json)
        {
            Ok(_) => panic!("{path} is written"),
            Err(error) => error.to_string(),
        };
    let scene = load(&shared("features/skin.gltf"), &options()).unwrap();
    let bent = scene.meshes.iter().position(|m| m.name.contains(" of ")).expect("a skinned mesh");
    let bent = scene.instances.iter().find(|i| i.mesh as usize == bent).unwrap();
    let name = &scene.objects[bent.object as usize].name;
    let error = refused("features/skin.gltf", by(name, [1.0; 3]));
    assert!(error.contains("skin.gltf: nodes[") && error.contains("placed by a skin"), "{error}");
    let error = refused("obj-still-life/obj-still-life.obj", matte("x"));
    assert!(error.contains("only be written for glTF"), "{error}");
}
