//! Whole files: every scene of our own and of the shared ones is tried, and so is the program that tries models of others.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use hotspot_integrator::{BuildOptions, Control, RenderScene, frame_bounds, render};
use hotspot_scene::{LoadOptions, load};
use hotspot_tests::picture::settings;
use hotspot_tests::say;

fn corpus(path: &Path) -> (Output, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_corpus")).arg(path).output().expect("corpus runs");
    let table = String::from_utf8(output.stdout.clone()).expect("the table is text");
    (output, table)
}

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nbogus\nl 1 2\nf 1 2 3\n";

#[test]
fn models_that_load_are_measured_and_those_that_must_load_are_demanded() {
    let folder = tempfile::tempdir().expect("a folder");
    let good = folder.path().join("some/sub");
    fs::create_dir_all(&good).expect("a folder");
    fs::write(good.join("A.OBJ"), TRIANGLE).expect("a file");
    fs::write(good.join("notes.txt"), "no model").expect("a file");
    let (output, table) = corpus(folder.path());
    assert!(output.status.success(), "{table}");
    let row = table.lines().find(|line| line.contains("A.OBJ")).expect("a row for the model");
    let cells: Vec<&str> = row.split('|').map(str::trim).collect();
    assert_eq!(cells[2..5], ["1", "0", "0"], "{row}");
    let luminance: f64 = cells[6].parse().expect("a number");
    assert!(luminance > 0.5 && luminance < 1.0, "{row}");
    assert!(cells[7] == "lines (1)" && cells[8].contains("unknown statements skipped (1)"), "{row}");

    fs::write(good.join("broken.obj"), "v 0 0 0\nf 1 2 3\n").expect("a file");
    let (output, table) = corpus(folder.path());
    assert_eq!(output.status.code(), Some(1), "{table}");
    assert!(table.contains("2 files: 1 shown, 1 refused") && table.contains("FAILURES: 1"), "{table}");
}

#[test]
fn models_that_packages_excuse_may_be_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, code) in [("assimp-testmodels/invalid/malformed.obj", 0), ("other/invalid/malformed.obj", 1)] {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().expect("a parent")).expect("a folder");
        fs::write(&path, "v 0 0 0\nf 0 0 0\n").expect("a file");
        let (output, table) = corpus(&path);
        assert_eq!(output.status.code(), Some(code), "{table}");
        assert!(table.contains("broken on purpose") == (code == 0), "{table}");
    }
    // Nothing to try is a mistake.
    assert_eq!(corpus(&folder.path().join("missing")).0.status.code(), Some(2));
}

/// Models below a folder.
fn models(folder: &Path, found: &mut Vec<PathBuf>) {
    let mut entries: Vec<PathBuf> =
        fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path()).collect();
    entries.sort();
    for path in entries {
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
        if path.is_dir() {
            models(&path, found);
        } else if matches!(extension.as_str(), "gltf" | "glb" | "obj") {
            found.push(path);
        }
    }
}

/// Loads and renders everything below a folder; what is not modelled is said, with words for each item.
fn try_all(folder: &Path) -> usize {
    let mut found = Vec::new();
    models(folder, &mut found);
    for file in &found {
        let shown = file.strip_prefix(folder).unwrap_or(file).display();
        let scene = load(file, &LoadOptions::default()).unwrap_or_else(|error| panic!("{error}"));
        let prepared = RenderScene::prepare(&scene, BuildOptions::default())
            .unwrap_or_else(|error| panic!("{shown}: {error}"));
        assert!(prepared.triangle_count() > 0, "{shown}: nothing to see");
        let (min, max) = prepared.bounds();
        let camera = scene.cameras.first().cloned().unwrap_or_else(|| frame_bounds(min, max));
        let rendered = render(&prepared, &camera, &settings(32, 24, 1, 15, 0), Control::default());
        assert!(rendered.non_finite.is_empty(), "{shown}: {:?}", rendered.non_finite);
        for (x, y) in rendered.frame.pixels() {
            let film = rendered.frame.film_total(x, y);
            assert!(film.sum.iter().all(|c| c.is_finite() && *c >= 0.0), "{shown}: {x}, {y}: {film:?}");
        }
        let mut line = format!("{shown}: {} triangles", prepared.triangle_count());
        for item in &scene.unmodelled {
            assert!(!item.feature.is_empty() && !item.effect.is_empty(), "{shown}: {item:?}");
            line.push_str(&format!("; not modelled: {} ({}: {})", item.feature, item.element, item.effect));
        }
        say(&line);
    }
    found.len()
}

#[test]
fn every_scene_of_our_own_loads_and_renders() {
    let tried = try_all(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes"));
    assert!(tried >= 40, "{tried} scenes: the feature files belong to them");
}

#[test]
fn every_shared_scene_loads_and_renders() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/scenes");
    if !folder.is_dir() {
        say("SKIPPED: there are no shared scenes at ../shared/scenes");
        return;
    }
    assert!(try_all(&folder) >= 6);
}
