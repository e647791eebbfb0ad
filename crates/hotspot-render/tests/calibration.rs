//! `calibrate`, `predict` and `--profile` as processes. Nothing here asserts a time.

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Command;

fn scene(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes").join(name).join(name);
    format!("{}.gltf", path.to_str().expect("a path in UTF-8"))
}

/// Runs the program with outputs in `dir`; returns the exit code and what was said.
fn run(dir: &Path, arguments: &[&str]) -> (Option<i32>, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_hotspot-render"))
        .args(arguments)
        .arg("-o")
        .arg(dir)
        .output()
        .expect("the program starts");
    let said =
        String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    (output.status.code(), said)
}

fn read(path: PathBuf) -> Value {
    serde_json::from_str(&std::fs::read_to_string(path).expect("a file")).expect("JSON")
}

#[test]
fn a_profile_is_made_and_used() {
    let dir = tempfile::tempdir().expect("a temporary folder");
    let path = dir.path().join("machine.json");
    let profile = path.to_str().expect("a path in UTF-8");
    let (cornell, room) = (scene("cornell-box-red"), scene("white-room-matte"));
    let (code, said) = run(
        dir.path(),
        &[
            "calibrate",
            &cornell,
            &room,
            "--size",
            "48x32",
            "--spp",
            "2",
            "--repeats",
            "4",
            "--profile",
            profile,
        ],
    );
    assert_eq!(code, Some(0), "{said}");
    let json = read(path.clone());
    assert_eq!(json["schema"], "hotspot-profile/1");
    let scenes = json["scenes"].as_array().expect("scenes");
    assert_eq!(scenes.len(), 2);
    for scene in scenes {
        assert_eq!((&scene["tiles"], &scene["repeats"]), (&24.into(), &4.into()));
        assert!(scene["from_other_scenes"]["full"].is_object());
        let map = dir.path().join(scene["residual_map"].as_str().expect("a map"));
        assert!(map.exists(), "{}", map.display());
    }
    let c0 = json["intersection"]["c0"]["ns"].as_f64().expect("a number");

    let (code, said) =
        run(dir.path(), &["render", &cornell, "--size", "32x32", "--spp", "2", "--profile", profile]);
    assert_eq!(code, Some(0), "{said}");
    let render = read(dir.path().join("cornell-box-red.json"));
    assert_eq!(render["cost_model"]["c0"].as_f64(), Some(c0));
    assert!(render["cost_unit"].as_str().is_some_and(|unit| unit.starts_with("ns of traversal")));

    let (code, said) = run(
        dir.path(),
        &[
            "predict",
            &cornell,
            "--size",
            "64x64",
            "--spp",
            "4",
            "--pilot",
            "0.05",
            "--budget",
            "100",
            "--profile",
            profile,
            // A profile is of paths that go one by one, as they do by points other than Sobol's.
            "--sampler",
            "independent",
        ],
    );
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("64x64 at 4 spp: ") && said.contains(" node visits ± "), "{said}");
    let prediction = read(dir.path().join("cornell-box-red.predict.json"));
    assert_eq!(prediction["schema"], "hotspot-predict/1");
    assert!(prediction["seconds_by_profile"].is_number() && prediction["budget"].is_object());

    // A plain render counts nothing; its prediction does.
    let (code, said) = run(
        dir.path(),
        &["predict", &cornell, "--size", "64x64", "--spp", "4", "--pilot", "0.05", "--plain"],
    );
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains(" node visits ± "), "{said}");

    std::fs::write(&path, "{}").expect("a file");
    let (code, said) = run(dir.path(), &["render", &cornell, "--profile", profile]);
    assert!(code == Some(1) && said.contains("calibrate"), "{code:?} {said}");
    let (code, said) = run(dir.path(), &["render", &cornell, "--profile", profile, "--c0", "2"]);
    assert!(code == Some(2), "{code:?} {said}");
    let (code, said) = run(dir.path(), &["calibrate", &cornell, "--size", "7x9"]);
    assert!(code == Some(2) && said.contains("8 x 8"), "{code:?} {said}");
}

/// How many of `seeds` predictions of a render of the same seed hold its node visits, and the worst error.
fn covered(name: &str, seeds: u64) -> (u64, f64) {
    let dir = tempfile::tempdir().expect("a temporary folder");
    let (mut inside, mut worst) = (0, 0.0_f64);
    for seed in 0..seeds {
        let seed = (1000 * seed).to_string();
        // Not square, and no whole multiple of the pilot's size.
        let common = [&scene(name), "--size", "147x91", "--spp", "4", "--seed", &seed, "--quiet"];
        let (code, said) = run(dir.path(), &[&["predict"], &common[..], &["--pilot", "0.05"]].concat());
        assert_eq!(code, Some(0), "{said}");
        let (code, said) =
            run(dir.path(), &[&["render"], &common[..], &["--metrics", "intersection"]].concat());
        assert_eq!(code, Some(0), "{said}");
        let predicted = read(dir.path().join(format!("{name}.predict.json")))["totals"]["nodes"].clone();
        let truth = read(dir.path().join(format!("{name}.json")))["totals"]["nodes"]["sum"].as_f64();
        let truth = truth.expect("a sum");
        let end = |i: usize| predicted["ci95"][i].as_f64().expect("an end");
        inside += u64::from(end(0) <= truth && truth <= end(1));
        worst = worst.max((predicted["value"].as_f64().expect("a value") / truth - 1.0).abs());
    }
    (inside, worst)
}

/// Of 12 intervals of 95 % fewer than 9 cover once in 450 times; how long the pilots are depends on the machine, so that
/// seeds do not fix the outcome.
#[test]
fn predicted_counts_cover_the_render() {
    let (inside, worst) = covered("cornell-box-red", 12);
    assert!(inside >= 9 && worst < 0.05, "{inside} of 12, off by up to {worst}");
}

/// Of 50 intervals of 95 % fewer than 42 cover once in 1300 times; for one of the four scenes, once in 330.
#[test]
#[ignore = "minutes"]
fn predicted_counts_cover_renders_of_every_scene() {
    for name in ["cornell-box-red", "mirror-gap-narrow", "white-room-matte", "creature"] {
        let (inside, worst) = covered(name, 50);
        assert!(inside >= 42 && worst < 0.05, "{name}: {inside} of 50, off by up to {worst}");
    }
}
