//! Opening a scene from the command line: which part of a file, at what time, in what light.

use std::path::Path;
use std::process::Command;

fn feature(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/features").join(name);
    path.to_str().expect("a path in UTF-8").to_owned()
}

/// Runs a small render; returns the exit code, what was said, and the JSON.
fn open(arguments: &[&str]) -> (Option<i32>, String, serde_json::Value) {
    let dir = tempfile::tempdir().expect("a temporary folder");
    let output = Command::new(env!("CARGO_BIN_EXE_hotspot-render"))
        .args(arguments)
        .args(["--size", "24x16", "--spp", "2", "-o"])
        .arg(dir.path())
        .output()
        .expect("the program starts");
    let said =
        String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    let json = std::fs::read_dir(dir.path())
        .ok()
        .and_then(|files| {
            files.flatten().map(|f| f.path()).find(|p| p.extension().is_some_and(|e| e == "json"))
        })
        .and_then(|path| serde_json::from_str(&std::fs::read_to_string(path).ok()?).ok())
        .unwrap_or_default();
    (output.status.code(), said, json)
}

/// The picture's digest; the render must succeed.
fn digest(arguments: &[&str]) -> String {
    let (code, said, json) = open(arguments);
    assert_eq!(code, Some(0), "{arguments:?}\n{said}");
    json["digest"]["radiance"].as_str().expect("a digest").to_owned()
}

#[test]
fn scenes_cameras_variants_and_times_are_chosen() {
    let file = feature("scenes-cameras.gltf");
    let first = digest(&[&file, "--scene", "#0"]);
    assert_ne!(first, digest(&[&file, "--scene", "#1"]));
    let (code, said, _) = open(&[&file, "--scene", "Atlantis"]);
    assert!(code == Some(1) && said.contains("\"Atlantis\" is asked for, the file has"), "{code:?} {said}");

    let file = feature("material-variants.gltf");
    let (code, said, _) = open(&[&file, "--variant", "no such variant"]);
    assert!(code == Some(1) && said.contains("no such variant"), "{code:?} {said}");

    let (code, said, _) = open(&[&feature("obj-features.obj"), "--time", "1"]);
    assert!(code == Some(2) && said.contains("OBJ has none"), "{code:?} {said}");

    let file = feature("animation.gltf");
    let rest = digest(&[&file]);
    assert_ne!(rest, digest(&[&file, "--time", "0.7"]));
    let (_, _, json) = open(&[&file, "--time", "0.7"]);
    assert_eq!(json["settings"]["time"], 0.7);
    assert!(json["unmodelled"].as_array().is_some_and(Vec::is_empty), "{}", json["unmodelled"]);
    let (code, said, _) = open(&[&file, "--time", "soon"]);
    assert!(code == Some(2) && said.contains("a number of seconds"), "{code:?} {said}");
}

#[test]
fn environments_come_from_files_and_turn() {
    let (file, sky) = (feature("environment.gltf"), feature("sky.hdr"));
    let map = digest(&[&file, "--env", &sky]);
    assert_ne!(map, digest(&[&file, "--env", &sky, "--env-rotate", "90"]));
    assert_eq!(map, digest(&[&file, "--env", &sky, "--env-rotate", "0"]));
    let (_, said, json) = open(&[&file, "--env", &sky]);
    assert!(said.contains("environment \"sky.hdr\""), "{said}");
    assert!(json["settings"]["env"].as_str().is_some_and(|name| name.ends_with("sky.hdr")));

    let (code, said, _) = open(&[&file, "--env", "1,1,1", "--env-rotate", "90"]);
    assert!(code == Some(2) && said.contains("--env FILE"), "{code:?} {said}");
    let (code, said, _) = open(&[&file, "--env", "no-such-sky.exr"]);
    assert!(code == Some(1) && said.contains("no-such-sky.exr"), "{code:?} {said}");
    let picture = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/pictures/demo.png");
    let (code, said, _) = open(&[&file, "--env", picture.to_str().expect("UTF-8")]);
    assert!(code == Some(1) && said.contains("demo.png"), "{code:?} {said}");
}

#[test]
fn meshes_are_stored_once_or_copied() {
    let file = feature("instances.gltf");
    let (_, _, copies) = open(&[&file, "--instances", "copies"]);
    let (_, said, once) = open(&[&file, "--instances", "once"]);
    assert!(said.contains("instances)"), "{said}");
    let count = |json: &serde_json::Value, key: &str| json["totals"][key]["sum"].as_u64();
    assert_eq!(count(&copies, "instances"), Some(0));
    assert!(count(&once, "instances") > Some(0));
    let (code, said, _) = open(&[&file, "--max-memory", "1"]);
    assert!(
        code == Some(1) && said.contains("instances.gltf: ") && said.contains("limit of 1 MiB"),
        "{code:?} {said}"
    );
    let bytes = |json: &serde_json::Value| json["memory"]["geometry"].as_u64().expect("a size");
    assert!(4 * bytes(&once) < bytes(&copies), "{} {}", bytes(&once), bytes(&copies));
}
