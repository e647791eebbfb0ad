//! The command `whatif`, as a process.

use std::path::Path;
use std::process::Command;

fn scene(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../../scenes/{name}/{name}.gltf"));
    path.to_string_lossy().into_owned()
}

/// Exit code, standard error, and the JSON beside the picture.
fn run(name: &str, words: &[&str]) -> (Option<i32>, String, serde_json::Value) {
    let folder = tempfile::tempdir().unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_hotspot-render"))
        .args(["whatif", &scene(name), "--quiet", "--spp", "4", "-o"])
        .arg(folder.path())
        .args(words)
        .output()
        .unwrap();
    let text = std::fs::read_to_string(folder.path().join(format!("{name}.whatif.json")));
    let json = text.ok().and_then(|text| serde_json::from_str(&text).ok()).unwrap_or_default();
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned(), json)
}

#[test]
fn a_matte_table_top_is_measured() {
    let words = ["--matte", "Table top lacquer", "--size", "64x36", "--repeats", "2", "--tree-noise", "2"];
    let (code, said, json) = run("white-room-substrate", &words);
    assert_eq!(code, Some(0), "{said}");
    assert_eq!(json["schema"], "hotspot-whatif/1");
    assert_eq!(json["change"]["options"][0], "--matte Table top lacquer");
    assert!(json["image"]["relmse"].is_number(), "{}", json["image"]);
    assert_eq!(json["totals"]["time_us"]["ci_kind"], "repeats");
    assert_ne!(json["totals"]["intersection"]["delta"], 0.0);
    assert_eq!(json["tree_noise"]["trees"], 2);
}

#[test]
fn names_that_do_not_exist_are_answered() {
    let (code, said, _) = run("cornell-box-red", &["--matte", "Red piant"]);
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("did you mean \"Red paint\"?"), "{said}");
}

#[test]
fn without_a_change_there_is_nothing_to_do() {
    let (code, said, _) = run("cornell-box-red", &[]);
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("nothing to change"), "{said}");
}

#[test]
fn taking_the_only_light_away_is_told_and_leaves_the_dark() {
    let words = ["--delete", "Ceiling light", "--size", "16x16", "--repeats", "0", "--tree-noise", "0"];
    let (code, said, json) = run("cornell-box-red", &words);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("no light is left"), "{said}");
    assert!(json["image"]["relmse"].as_f64().unwrap() > 0.1, "{}", json["image"]);
}
