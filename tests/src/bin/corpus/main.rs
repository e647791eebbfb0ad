//! Tries the loaders and the renderer on models of others: `corpus FOLDER|FILE ... > table.md`.
//!
//! Every `.gltf`, `.glb` and `.obj` is loaded, prepared and rendered at 64×48 with 4 samples per pixel; the table says what
//! became of it. Folders that `tests/corpus/fetch.py` made are known by their names: what `packages.json` does not excuse must
//! load. Exit code 1 when anything panicked, gave radiance that is not finite, or did not load though it must.
#![forbid(unsafe_code)]

use std::any::Any;
use std::collections::BTreeMap;
use std::io::Write;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use hotspot_integrator::{BuildOptions, Control, RenderScene, frame_bounds, render};
use hotspot_scene::{LoadOptions, load};
use hotspot_tests::picture::{Picture, settings};
use hotspot_tests::say;
use serde_json::Value;

/// What is to be known about a model that loaded.
struct Shown {
    triangles: usize,
    textures: usize,
    lights: usize,
    seconds: f64,
    luminance: f64,
    finite: bool,
    unmodelled: String,
    repairs: String,
}

/// What became of a model.
enum Outcome {
    Shown(Box<Shown>),
    Refused(String),
    Panicked(String),
}

fn main() -> ExitCode {
    let mut files: Vec<PathBuf> = Vec::new();
    for argument in std::env::args_os().skip(1) {
        collect(Path::new(&argument), &mut files);
    }
    if files.is_empty() {
        say("usage: corpus FOLDER|FILE ...: no .gltf, .glb or .obj among what was given");
        return ExitCode::from(2);
    }
    let excuses = Excuses::read();
    // The reports of panics go into the table.
    std::panic::set_hook(Box::new(|_| {}));
    let mut failures = Vec::new();
    let mut table = String::from(
        "| file | triangles | textures | lights | load s | luminance | unmodelled | repairs or error |\n\
         |---|---|---|---|---|---|---|---|\n",
    );
    let (mut shown, mut refused) = (0, 0);
    for file in &files {
        // Seen where the process dies rather than panics.
        say(&file.display().to_string());
        let name = cell(&file.display().to_string());
        let started = Instant::now();
        let outcome = catch_unwind(AssertUnwindSafe(|| attempt(file)))
            .unwrap_or_else(|payload| Outcome::Panicked(message(payload.as_ref())));
        let row = match outcome {
            Outcome::Shown(model) => {
                shown += 1;
                if !model.finite {
                    failures.push(format!("{name}: radiance that is not finite"));
                }
                let Shown { triangles, textures, lights, seconds, luminance, unmodelled, repairs, .. } =
                    *model;
                let numbers = format!("{triangles} | {textures} | {lights} | {seconds:.2} | {luminance:.4}");
                format!("| {name} | {numbers} | {} | {} |\n", cell(&unmodelled), cell(&repairs))
            }
            Outcome::Refused(error) => {
                refused += 1;
                let why = excuses.of(file);
                if why.is_none() {
                    failures.push(format!("{name}: {error}"));
                }
                let why = why.map_or(String::new(), |why| format!(" (expected: {why})"));
                let seconds = started.elapsed().as_secs_f64();
                format!("| {name} | | | | {seconds:.2} | | | refused{}: {} |\n", cell(&why), cell(&error))
            }
            Outcome::Panicked(what) => {
                failures.push(format!("{name}: panicked: {what}"));
                format!("| {name} | | | | | | | PANICKED: {} |\n", cell(&what))
            }
        };
        table.push_str(&row);
    }
    table.push_str(&format!("\n{} files: {shown} shown, {refused} refused.\n", files.len()));
    if !failures.is_empty() {
        table.push_str(&format!("\n## FAILURES: {}\n\n", failures.len()));
        failures.iter().for_each(|failure| table.push_str(&format!("* {}\n", cell(failure))));
    }
    // A closed pipe is no failure of the corpus.
    let _ = std::io::stdout().write_all(table.as_bytes());
    ExitCode::from(u8::from(!failures.is_empty()))
}

/// Models below a folder in the order of their names. Links are not followed: they may lead round in circles.
fn collect(path: &Path, files: &mut Vec<PathBuf>) {
    if path.is_dir() {
        let entries = std::fs::read_dir(path).into_iter().flatten().flatten();
        let mut entries: Vec<PathBuf> =
            entries.filter(|e| e.file_type().is_ok_and(|t| !t.is_symlink())).map(|e| e.path()).collect();
        entries.sort();
        entries.iter().for_each(|entry| collect(entry, files));
    } else {
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
        if matches!(extension.as_str(), "gltf" | "glb" | "obj") {
            files.push(path.into());
        }
    }
}

fn attempt(file: &Path) -> Outcome {
    let started = Instant::now();
    let scene = match load(file, &LoadOptions::default()) {
        Ok(scene) => scene,
        Err(error) => return Outcome::Refused(error.to_string()),
    };
    let seconds = started.elapsed().as_secs_f64();
    let prepared = match RenderScene::prepare(&scene, BuildOptions::default()) {
        Ok(prepared) => prepared,
        Err(error) => return Outcome::Refused(error.to_string()),
    };
    let (min, max) = prepared.bounds();
    let camera = scene.cameras.first().cloned().unwrap_or_else(|| frame_bounds(min, max));
    let rendered = render(&prepared, &camera, &settings(64, 48, 4, 15, 0), Control::default());
    let [r, g, b] = Picture::of_frame(&rendered.frame).mean();
    let luminance = 0.2126 * r + 0.7152 * g + 0.0722 * b;
    let mut unmodelled: BTreeMap<&str, u64> = BTreeMap::new();
    for item in &scene.unmodelled {
        *unmodelled.entry(&item.feature).or_default() += 1;
    }
    let mut repairs: BTreeMap<&str, u64> = BTreeMap::new();
    for item in scene.repairs.iter().chain(prepared.repairs()) {
        *repairs.entry(&item.what).or_default() += item.count;
    }
    Outcome::Shown(Box::new(Shown {
        triangles: prepared.triangle_count(),
        textures: scene.textures.len(),
        lights: prepared.light_count() + scene.lights.len(),
        seconds,
        luminance,
        finite: rendered.non_finite.is_empty() && luminance.is_finite(),
        unmodelled: listed(&unmodelled),
        repairs: listed(&repairs),
    }))
}

fn listed(counts: &BTreeMap<&str, u64>) -> String {
    let items: Vec<String> = counts.iter().map(|(name, count)| format!("{name} ({count})")).collect();
    items.join(", ")
}

/// Text that does not break a table.
fn cell(text: &str) -> String {
    text.replace('|', "\\|").replace(['\n', '\r'], " ")
}

fn message(payload: &(dyn Any + Send)) -> String {
    let text = payload.downcast_ref::<&str>().map(|text| (*text).to_owned());
    text.or_else(|| payload.downcast_ref::<String>().cloned()).unwrap_or_else(|| "without words".into())
}

/// Which models may be refused, and why: `may_fail` of `packages.json`, by name of the package's folder.
struct Excuses(Vec<(String, String)>);

impl Excuses {
    fn read() -> Self {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/corpus/packages.json");
        let text = std::fs::read_to_string(path).unwrap_or_default();
        let packages: Value = serde_json::from_str(&text).unwrap_or_default();
        let mut excuses = Vec::new();
        for (folder, package) in packages["packages"].as_object().into_iter().flatten() {
            for entry in package["may_fail"].as_array().into_iter().flatten() {
                if let (Some(path), Some(why)) = (entry["path"].as_str(), entry["why"].as_str()) {
                    excuses.push((format!("{folder}/{path}"), why.to_owned()));
                }
            }
        }
        Self(excuses)
    }

    fn of(&self, file: &Path) -> Option<&str> {
        let file = file.to_string_lossy().replace('\\', "/");
        let hit = self.0.iter().find(|(path, _)| match path.strip_suffix('/') {
            Some(folder) => file.contains(&format!("/{folder}/")),
            None => file.ends_with(&format!("/{path}")),
        });
        hit.map(|(_, why)| why.as_str())
    }
}
