//! The command `error`, as a process.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn scene() -> String {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/cornell-box-red");
    root.join("cornell-box-red.gltf").to_string_lossy().into_owned()
}

fn run(words: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_hotspot-render")).args(words).output().unwrap()
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn json(folder: &Path) -> serde_json::Value {
    serde_json::from_str(&std::fs::read_to_string(folder.join("error.json")).unwrap()).unwrap()
}

#[test]
fn configurations_are_measured_side_by_side() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().to_string_lossy().into_owned();
    let scene = scene();
    let words = ["error", &scene, "--size", "24x24", "--spp", "16,4,1", "--seeds", "3", "--to", "1e-1,1e-30"];
    let more = ["--vary", "sampler=sobol,independent", "--reference-spp", "512", "--quiet", "-o", &out];
    let output = run(&[&words[..], &more].concat());
    assert!(output.status.success(), "{}", said(&output));
    let report = json(folder.path());
    let runs = report["runs"].as_array().unwrap();
    assert_eq!(runs.len(), 2 * 3 * 3);
    // In turns, beginning with another configuration for each seed.
    let turns: Vec<&str> = runs.iter().map(|r| r["config"].as_str().unwrap()).collect();
    assert_eq!(&turns[..2], ["sampler=sobol", "sampler=independent"]);
    assert_eq!(&turns[6..8], ["sampler=independent", "sampler=sobol"]);
    for run in runs {
        assert!(run["seconds"].as_f64().unwrap() < run["process_seconds"].as_f64().unwrap());
        assert!(run["relmse_trimmed"].as_f64().unwrap() <= run["relmse"].as_f64().unwrap());
        let ratio = run["mean_ratio"][1].as_f64().unwrap();
        assert!((0.5..2.0).contains(&ratio), "{ratio}");
    }
    // Small pictures have fireflies: the median errors fall, the slope's value says little.
    assert!(report["slope"].as_f64().unwrap() < 0.0);
    let points = report["configs"][0]["points"].as_array().unwrap();
    let error = |k: usize| points[k]["error"]["value"].as_f64().unwrap();
    assert!(points[2]["spp"] == 16 && error(2) < 0.3 * error(0), "{} {}", error(0), error(2));
    assert!(report["seconds_to"]["1e-30"].is_null());
    assert_eq!(report["reference"]["spp"], 512);
    assert_eq!(report["ratios"][0]["to"], "sampler=sobol");
    for file in ["error.csv", "error.svg", "error.png", "error.map.png"] {
        assert!(folder.path().join(file).metadata().unwrap().len() > 500, "{file}");
    }
}

#[test]
fn a_reference_gives_the_size_and_takes_its_own_noise_out() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().to_string_lossy().into_owned();
    let scene = scene();
    let render = [
        "render",
        &scene,
        "--size",
        "20x16",
        "--spp",
        "64",
        "--seed",
        "77",
        "--intervals",
        "--metrics",
        "none",
    ];
    let output = run(&[&render[..], &["--quiet", "-o", &out]].concat());
    assert!(output.status.success(), "{}", said(&output));
    let exr = folder.path().join("cornell-box-red.exr").to_string_lossy().into_owned();
    let words =
        ["error", &scene, "--reference", &exr, "--spp", "2,64", "--seeds", "2", "--quiet", "-o", &out];
    let output = run(&words);
    assert!(output.status.success(), "{}", said(&output));
    let report = json(folder.path());
    assert_eq!(report["resolution"], serde_json::json!([20, 16]));
    let floor = report["reference"]["noise_floor"].as_f64().unwrap();
    assert!(floor > 1e-5, "{floor}");
    // (I − M)² − (I − A)(I − B) = ((A − B)/2)²: the difference is the reference's own noise, whatever the picture.
    for run in report["runs"].as_array().unwrap() {
        let noise = run["relmse"].as_f64().unwrap() - run["relmse_unbiased"].as_f64().unwrap();
        assert!((noise / floor - 1.0).abs() < 1e-3, "{noise} {floor}");
    }

    let output = run(&["error", &scene, "--reference", &exr, "--size", "8x8", "-o", &out]);
    assert_eq!(output.status.code(), Some(2));
    assert!(said(&output).contains("20x16"), "{}", said(&output));
}

#[test]
fn bad_input_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().to_string_lossy().into_owned();
    let scene = scene();
    let not_exr: PathBuf = folder.path().join("not.exr");
    std::fs::write(&not_exr, b"this is no picture").unwrap();
    let not_exr = not_exr.to_string_lossy().into_owned();
    for (words, code, hint) in [
        (vec!["--reference", "missing.exr"], 1, "missing.exr"),
        (vec!["--reference", &not_exr], 1, "not.exr"),
        (vec!["--spp", "0,4"], 2, "0"),
        (vec!["--spp", "a"], 2, "a"),
        (vec!["--spp", "3", "--intervals"], 2, "even"),
        (vec!["--to", "0"], 2, "positive"),
        (vec!["--vary", "sampelr=sobol"], 2, "did you mean sampler"),
        (vec!["--vary", "sampler=halton"], 2, "halton"),
        (vec!["--seeds", "0"], 2, "seeds"),
    ] {
        let output = run(&[&["error", &scene, "--size", "8x8", "-o", &out], &words[..]].concat());
        assert_eq!(output.status.code(), Some(code), "{words:?}: {}", said(&output));
        assert!(said(&output).contains(hint), "{words:?}: {}", said(&output));
        assert!(!folder.path().join("error.json").exists());
    }
}
