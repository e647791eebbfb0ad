//! Causes of hotspots, as a process: with ledgers, without, and read again from an EXR.

use serde_json::Value;
use std::path::Path;
use std::process::Command;

fn run(folder: &Path, words: &[&str]) {
    let output = Command::new(env!("CARGO_BIN_EXE_hotspot-render"))
        .args(words)
        .args(["--quiet", "-o"])
        .arg(folder)
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(0), "{words:?}: {}", String::from_utf8_lossy(&output.stderr));
}

fn hotspots(folder: &Path) -> (Vec<Value>, f64, String) {
    let text = std::fs::read_to_string(folder.join("creature.json")).unwrap();
    let json: Value = serde_json::from_str(&text).unwrap();
    let page = std::fs::read_to_string(folder.join("creature.html")).unwrap();
    (json["hotspots"].as_array().unwrap().clone(), json["render"]["causes_seconds"].as_f64().unwrap(), page)
}

#[test]
fn causes_come_from_ledgers_and_stay_in_the_file() {
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/creature/creature.gltf");
    let scene = scene.to_string_lossy().into_owned();
    let small = ["render", &scene, "--size", "96x54", "--spp", "8"];
    let folder = tempfile::tempdir().unwrap();
    run(folder.path(), &small);
    let (found, seconds, page) = hotspots(folder.path());
    let first = &found[0];
    assert!(seconds > 0.0 && first["sounded"].as_u64().unwrap() >= 1000, "{first}");
    assert_eq!(first["causes"][0]["kind"], "dense-geometry", "{first}");
    assert_eq!(first["causes"][0]["names"][0], first["name"], "{first}");
    assert!(first["fix"].as_str().unwrap().starts_with("Simplify \"Creature"), "{first}");
    assert!(page.contains("each ray meets dense geometry"), "the page tells the cause");
    for factor in ["vertices_per_path", "rays_per_vertex", "nodes_per_ray", "cost_per_node", "shapes_per_ray"]
    {
        assert!(first["factors"][factor].is_number(), "{factor}: {first}");
    }

    // Deterministic, whatever the threads.
    let again = tempfile::tempdir().unwrap();
    run(again.path(), &[&small[..], &["--threads", "1"]].concat());
    assert_eq!(hotspots(again.path()).0, found);

    // The EXR alone keeps what was found.
    let report = tempfile::tempdir().unwrap();
    let exr = folder.path().join("creature.exr");
    run(report.path(), &["report", &exr.to_string_lossy()]);
    let (kept, _, page) = hotspots(report.path());
    assert_eq!(kept, found);
    assert!(page.contains("each ray meets dense geometry"), "the page tells the cause");

    // Without ledgers ratios have to do, and it is said.
    run(folder.path(), &[&small[..], &["--metrics", "rays,intersection"]].concat());
    let (found, seconds, _) = hotspots(folder.path());
    assert!(seconds == 0.0 && found[0]["sounded"] == 0 && found[0]["causes"] == Value::Array(Vec::new()));
    let cause = found[0]["cause"].as_str().unwrap();
    assert!(cause.ends_with("(by ratios alone: ledgers were not asked for)"), "{cause}");
}
