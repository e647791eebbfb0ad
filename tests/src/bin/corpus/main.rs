//! Tries the loaders and the renderer on models of others: `corpus [OPTIONS] FOLDER|FILE|NAME=FOLDER ... > table.md`.
//!
//! Every `.gltf`, `.glb` and `.obj` is loaded, prepared and rendered at 64×48 with 4 samples per pixel; the table says what
//! became of it. Folders that `tests/corpus/fetch.py` made are known by their names: what `packages.json` does not excuse must
//! load. Exit code 1 when anything panicked, gave radiance that is not finite, or did not load though it must.
//!
//! `--results` prints totals and tables by feature instead, with names relative to the folders given (below NAME where there is
//! one). `--pictures DIR` writes pictures of 120×90 with 16 samples per pixel, as PPM.
#![forbid(unsafe_code)]

mod attempt;
mod excuses;
mod features;
mod results;
mod thumbnail;

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use attempt::{Outcome, Shown, attempt};
use excuses::Excuses;
use hotspot_tests::say;

/// What became of a model.
enum What {
    Shown(Box<Shown>),
    Refused { message: String, excuse: Option<String> },
    Panicked(String),
}

/// A model that was tried.
struct Tried {
    /// Path to show.
    name: String,
    features: BTreeSet<String>,
    /// To load it or to refuse it.
    seconds: f64,
    what: What,
}

#[derive(Default)]
struct Arguments {
    results: bool,
    pictures: Option<PathBuf>,
    /// Files with the names to show.
    files: Vec<(PathBuf, String)>,
}

fn main() -> ExitCode {
    let arguments = Arguments::read();
    if arguments.files.is_empty() {
        say(
            "usage: corpus [--results] [--pictures DIR] FOLDER|FILE|NAME=FOLDER ...: no .gltf, .glb or .obj among \
             what was given",
        );
        return ExitCode::from(2);
    }
    if let Some(folder) = &arguments.pictures
        && let Err(error) = std::fs::create_dir_all(folder)
    {
        say(&format!("{}: {error}", folder.display()));
        return ExitCode::from(2);
    }
    let excuses = Excuses::read();
    // The reports of panics go into the table.
    std::panic::set_hook(Box::new(|_| {}));
    let tried: Vec<Tried> = arguments.files.iter().map(|file| arguments.attempt(file, &excuses)).collect();
    let failures = failures(&tried);
    let mut text = if arguments.results { results::results(&tried) } else { table(&tried) };
    if !failures.is_empty() {
        let _ = write!(text, "\n## FAILURES: {}\n\n", failures.len());
        failures.iter().for_each(|failure| text.push_str(&format!("* {}\n", cell(failure))));
    }
    // A closed pipe is no failure of the corpus.
    let _ = std::io::stdout().write_all(text.as_bytes());
    ExitCode::from(u8::from(!failures.is_empty()))
}

impl Arguments {
    fn read() -> Self {
        let mut all = Self::default();
        let mut given = std::env::args_os().skip(1);
        while let Some(argument) = given.next() {
            if argument == "--results" {
                all.results = true;
            } else if argument == "--pictures" {
                all.pictures = given.next().map(PathBuf::from);
            } else {
                let text = argument.to_string_lossy();
                let (name, root) = match text.split_once('=') {
                    Some((name, root)) if !Path::new(&argument).exists() => (Some(name), Path::new(root)),
                    _ => (None, Path::new(&argument)),
                };
                let mut files = Vec::new();
                collect(root, &mut files);
                for file in files {
                    let below = file.strip_prefix(root).ok().filter(|below| !below.as_os_str().is_empty());
                    let below = below.unwrap_or(&file).to_string_lossy().replace('\\', "/");
                    let shown = match name {
                        Some(name) => format!("{name}/{below}"),
                        None => below,
                    };
                    all.files.push((file, shown));
                }
            }
        }
        all
    }

    fn attempt(&self, (file, shown): &(PathBuf, String), excuses: &Excuses) -> Tried {
        // Seen where the process dies rather than panics.
        say(&file.display().to_string());
        let started = Instant::now();
        let size = if self.pictures.is_some() { [120, 90, 16] } else { [64, 48, 4] };
        let outcome = attempt(file, size);
        let mut seconds = started.elapsed().as_secs_f64();
        let what = match outcome {
            Outcome::Shown(mut model) => {
                seconds = model.seconds;
                if let (Some(folder), Some(picture)) = (&self.pictures, model.picture.take()) {
                    let path = folder.join(format!("{}.ppm", shown.replace('/', "__")));
                    if let Err(error) = thumbnail::write(&picture, &path) {
                        say(&format!("{}: {error}", path.display()));
                    }
                }
                What::Shown(model)
            }
            Outcome::Refused(message) => {
                // The message begins with the file as it was given.
                let message = message.replace(&*file.to_string_lossy(), shown);
                What::Refused { message, excuse: excuses.of(file).map(str::to_owned) }
            }
            Outcome::Panicked(message) => What::Panicked(message),
        };
        let name = if self.results { shown.clone() } else { file.display().to_string() };
        let features = if self.results { features::of(file) } else { BTreeSet::new() };
        Tried { name, features, seconds, what }
    }
}

fn failures(tried: &[Tried]) -> Vec<String> {
    let failure = |Tried { name, what, .. }: &Tried| match what {
        What::Shown(model) => (!model.finite).then(|| format!("{name}: radiance that is not finite")),
        What::Refused { message, excuse } => excuse.is_none().then(|| format!("{name}: {message}")),
        What::Panicked(message) => Some(format!("{name}: panicked: {message}")),
    };
    tried.iter().filter_map(failure).collect()
}

/// A line for each model.
fn table(tried: &[Tried]) -> String {
    let mut table = String::from(
        "| file | triangles | textures | lights | load s | luminance | unmodelled | repairs or error |\n\
         |---|---|---|---|---|---|---|---|\n",
    );
    let mut refused = 0;
    for Tried { name, seconds, what, .. } in tried {
        let name = cell(name);
        let _ = match what {
            What::Shown(model) => {
                let Shown { triangles, textures, lights, luminance, unmodelled, repairs, .. } = &**model;
                let numbers = format!("{triangles} | {textures} | {lights} | {seconds:.2} | {luminance:.4}");
                let [unmodelled, repairs] = [unmodelled, repairs].map(|counts| cell(&listed(counts)));
                writeln!(table, "| {name} | {numbers} | {unmodelled} | {repairs} |")
            }
            What::Refused { message, excuse } => {
                refused += 1;
                let why = excuse.as_ref().map_or(String::new(), |why| format!(" (expected: {why})"));
                let [why, message] = [&why, message].map(|text| cell(text));
                writeln!(table, "| {name} | | | | {seconds:.2} | | | refused{why}: {message} |")
            }
            What::Panicked(message) => {
                writeln!(table, "| {name} | | | | | | | PANICKED: {} |", cell(message))
            }
        };
    }
    let shown = tried.iter().filter(|tried| matches!(tried.what, What::Shown(_))).count();
    let _ = write!(table, "\n{} files: {shown} shown, {refused} refused.\n", tried.len());
    table
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

fn listed(counts: &BTreeMap<String, u64>) -> String {
    let items: Vec<String> = counts.iter().map(|(name, count)| format!("{name} ({count})")).collect();
    items.join(", ")
}

/// Text that does not break a table.
fn cell(text: &str) -> String {
    text.replace('|', "\\|").replace(['\n', '\r'], " ")
}
