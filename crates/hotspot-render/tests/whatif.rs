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
    assert_eq!(json["change"]["options"][0], "--matte 'Table top lacquer'");
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
    let (code, said, json) = run("cornell-box-red", &[&words[..], &["--base-max-depth", "3"]].concat());
    assert_eq!(code, Some(0), "{said}");
    // The depth before is also that after.
    assert_eq!(json["change"]["options"].as_array().map(Vec::len), Some(1), "{}", json["change"]);
    assert!(said.contains("no light is left"), "{said}");
    assert!(json["image"]["relmse"].as_f64().unwrap() > 0.1, "{}", json["image"]);
}

/// The best comes first, the table holds time and picture beside the cost, and a render beside it shows what was measured.
#[test]
fn suggestions_are_ranked_and_come_onto_the_page() {
    let folder = tempfile::tempdir().unwrap();
    let command = |words: &[&str]| {
        let output = Command::new(env!("CARGO_BIN_EXE_hotspot-render"))
            .args(words)
            .args(["--size", "96x54", "--spp", "8", "-o"])
            .arg(folder.path())
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8_lossy(&output.stdout).into_owned()
    };
    let name = "mirror-gap-narrow";
    let said = command(&["whatif", &scene(name), "--suggest", "--repeats", "2", "--tree-noise", "0"]);
    assert!(said.contains(" 1. --") && said.contains("intersection cost"), "{said}");
    let text = std::fs::read_to_string(folder.path().join(format!("{name}.whatif.json"))).unwrap();
    let json: serde_json::Value = serde_json::from_str(&text).unwrap();
    let suggestions = json["suggestions"].as_array().unwrap();
    assert!(suggestions.len() >= 2, "{suggestions:?}");
    let saved: Vec<f64> = suggestions.iter().map(|s| s["relative"].as_f64().unwrap()).collect();
    assert!(saved.is_sorted() && saved[0] < 0.0, "{saved:?}");
    for suggestion in suggestions {
        assert!(suggestion["ci95"].is_array() && suggestion["time"]["repeats"] == 2, "{suggestion}");
        assert!(suggestion["image"]["relmse"].is_number() && suggestion["reason"] != "", "{suggestion}");
        #[cfg(feature = "flip")]
        assert!(suggestion["image"]["flip"].as_f64().is_some_and(|flip| flip >= 0.0), "{suggestion}");
    }
    // The best was measured in full.
    assert_eq!(json["change"]["options"][0], suggestions[0]["option"]);

    command(&["render", &scene(name)]);
    let page = std::fs::read_to_string(folder.path().join(format!("{name}.html"))).unwrap();
    let text = std::fs::read_to_string(folder.path().join(format!("{name}.json"))).unwrap();
    let json: serde_json::Value = serde_json::from_str(&text).unwrap();
    // `whatif` keeps halves, so its hotspots need not be those of this render; but they must have a suggestion in common.
    let wanted = |h: &serde_json::Value| {
        let options = h["whatif"].as_array().unwrap();
        suggestions.iter().any(|s| options.contains(&s["option"]))
    };
    assert!(json["hotspots"].as_array().unwrap().iter().any(wanted), "{suggestions:?}: {}", json["hotspots"]);
    assert!(page.contains("<ul class=\"tries\">") && page.contains("<b>intersection cost \u{2212}"));
    assert!(json["render"]["causes_seconds"].as_f64().unwrap() > 0.0);
}

/// Loaded again and rendered, the written scene counts what the edited one counted in memory.
#[test]
fn a_written_scene_renders_as_the_edit_did() {
    let name = "white-room-substrate";
    for (edit, ending) in [
        (&["--matte", "Table top lacquer"][..], "gltf"),
        (&["--delete", "Bookcase", "--move", "Vase=0.2,0,0.1"][..], "glb"),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join(format!("edited.{ending}"));
        let file = file.to_string_lossy().into_owned();
        let mut words =
            vec!["--size", "32x18", "--repeats", "0", "--tree-noise", "0", "--write-scene", &file];
        words.extend(edit);
        let (code, said, json) = run(name, &words);
        assert_eq!(code, Some(0), "{said}");
        let output = Command::new(env!("CARGO_BIN_EXE_hotspot-render"))
            .args(["render", &file, "--quiet", "--intervals", "--spp", "4", "--size", "32x18", "-o"])
            .arg(folder.path())
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
        let text = std::fs::read_to_string(folder.path().join("edited.json")).unwrap();
        let rendered: serde_json::Value = serde_json::from_str(&text).unwrap();
        for metric in ["rays", "nodes", "shapes", "bsdf", "rays_shadow"] {
            let (there, here) = (&json["totals"][metric]["sum_b"], &rendered["totals"][metric]["sum"]);
            assert!(
                here.as_u64().is_some_and(|sum| sum > 0) && there == here,
                "{edit:?} {metric}: {there} {here}"
            );
        }
        assert_ne!(json["totals"]["nodes"]["delta"], 0.0, "{edit:?}");
    }
}

#[test]
fn what_cannot_be_written_is_refused_before_rendering() {
    let obj = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/obj-still-life/obj-still-life.obj");
    let refused = |scene: &str, words: &[&str]| {
        let output = Command::new(env!("CARGO_BIN_EXE_hotspot-render"))
            .args(["whatif", scene, "--quiet"])
            .args(words)
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(2), "{words:?}");
        String::from_utf8_lossy(&output.stderr).into_owned()
    };
    let said = refused(&obj.to_string_lossy(), &["--delete", "x", "--write-scene", "out.gltf"]);
    assert!(said.contains("OBJ"), "{said}");
    let cornell = scene("cornell-box-red");
    let said = refused(&cornell, &["--delete", "x", "--write-scene", &cornell]);
    assert!(said.contains("scene itself"), "{said}");
    let said = refused(&cornell, &["--delete", "x", "--write-scene", "out.usd"]);
    assert!(said.contains(".gltf or .glb"), "{said}");
    let said = refused(&cornell, &["--delete", "x", "--adaptive"]);
    assert!(said.contains("--adaptive"), "{said}");
}
