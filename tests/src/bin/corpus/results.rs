//! The outcome of a whole run as Markdown, made to be kept: without times and places, so that it changes with the loader and
//! the models alone.

use std::collections::BTreeMap;
use std::fmt::Write;

use crate::attempt::Shown;
use crate::{Tried, What, cell, listed};

const ABOUT: &str = "# What became of the corpus\n\n\
Made by two commands (FOLDER lies outside of the repository; robosuite is fetched only when named):\n\n\
```\n\
python3 tests/corpus/fetch.py FOLDER assimp-testmodels easy-gltf obj-rs pybullet robosuite webxr-input-profiles\n\
cargo run -p hotspot-tests --bin corpus -- --results FOLDER shared=../shared/scenes own=scenes > tests/corpus/RESULTS.md\n\
```\n\n\
Every model was loaded, prepared and rendered at 64x48 with 4 samples per pixel, at rest, by its first camera or one that\n\
frames it. \"Named\" is what the loader says it does not model (an animation is, where no time is asked for), \"repairs\" what\n\
it says it mended. Not read on purpose and without remark: occlusionTexture and map_Ka, which stand for shadows and\n\
light from all around.\n";

/// Files of a kind, and how many of them were rendered.
#[derive(Default)]
struct Count {
    files: u64,
    rendered: u64,
}

/// The whole text.
pub(crate) fn results(tried: &[Tried]) -> String {
    let mut out = String::from(ABOUT);
    totals(tried, &mut out);
    refusals(tried, &mut out);
    packages(tried, &mut out);
    features(tried, &mut out);
    notes(tried, &mut out);
    gltf_files(tried, &mut out);
    obj_folders(tried, &mut out);
    out
}

fn head(out: &mut String, title: &str, columns: &[&str]) {
    let _ = write!(out, "\n## {title}\n\n| {} |\n|{}\n", columns.join(" | "), "---|".repeat(columns.len()));
}

fn shown(tried: &Tried) -> Option<&Shown> {
    if let What::Shown(model) = &tried.what { Some(model) } else { None }
}

/// First folder of the name.
fn package(tried: &Tried) -> &str {
    tried.name.split('/').next().unwrap_or_default()
}

fn is_obj(tried: &Tried) -> bool {
    tried.name.to_ascii_lowercase().ends_with(".obj")
}

fn totals(tried: &[Tried], out: &mut String) {
    let count = |matches: &dyn Fn(&Tried) -> bool| tried.iter().filter(|tried| matches(tried)).count();
    head(out, "Totals", &["", "number"]);
    let triangles: u64 = tried.iter().filter_map(shown).map(|model| model.triangles as u64).sum();
    for (name, number) in [
        ("files", tried.len()),
        ("of them OBJ", count(&is_obj)),
        ("of them glTF", count(&|t| !is_obj(t))),
        ("rendered", count(&|t| shown(t).is_some())),
        ("refused, as expected", count(&|t| matches!(&t.what, What::Refused { excuse: Some(_), .. }))),
        (
            "refused, though they should load",
            count(&|t| matches!(&t.what, What::Refused { excuse: None, .. })),
        ),
        ("panics", count(&|t| matches!(t.what, What::Panicked(_)))),
        ("with pixels that are not finite", count(&|t| shown(t).is_some_and(|model| !model.finite))),
        ("pictures all black", count(&|t| shown(t).is_some_and(|model| model.luminance == 0.0))),
        ("triangles", triangles as usize),
    ] {
        let _ = writeln!(out, "| {name} | {number} |");
    }
}

fn refusals(tried: &[Tried], out: &mut String) {
    let mut reasons: BTreeMap<&str, (u64, &str)> = BTreeMap::new();
    for tried in tried {
        let (reason, message) = match &tried.what {
            What::Refused { excuse: Some(why), message } => (why.as_str(), message.as_str()),
            What::Refused { excuse: None, message } => ("UNEXPECTED", message.as_str()),
            What::Panicked(message) => ("PANIC", message.as_str()),
            What::Shown(_) => continue,
        };
        let entry = reasons.entry(reason).or_insert((0, message));
        entry.0 += 1;
    }
    head(out, "Refused", &["reason", "files", "for example"]);
    for (reason, (files, example)) in reasons {
        let _ = writeln!(out, "| {} | {files} | {} |", cell(reason), cell(example));
    }
}

fn packages(tried: &[Tried], out: &mut String) {
    let mut packages: BTreeMap<&str, (Count, u64)> = BTreeMap::new();
    for tried in tried {
        let (count, triangles) = packages.entry(package(tried)).or_default();
        count.files += 1;
        if let Some(model) = shown(tried) {
            count.rendered += 1;
            *triangles += model.triangles as u64;
        }
    }
    head(out, "By package", &["package", "files", "rendered", "triangles"]);
    for (name, (Count { files, rendered }, triangles)) in packages {
        let _ = writeln!(out, "| {name} | {files} | {rendered} | {triangles} |");
    }
}

/// How the loader names a feature that it does not carry, where that is not the feature's own name.
fn loaders_name(feature: &str) -> &str {
    match feature {
        "animations" => "animation",
        "line loops" | "line strips" | "OBJ lines" => "lines",
        _ => feature,
    }
}

fn features(tried: &[Tried], out: &mut String) {
    let mut features: BTreeMap<&str, (Count, u64)> = BTreeMap::new();
    for tried in tried {
        for feature in &tried.features {
            let (count, named) = features.entry(feature).or_default();
            count.files += 1;
            if let Some(model) = shown(tried) {
                count.rendered += 1;
                *named += u64::from(model.unmodelled.contains_key(loaders_name(feature)));
            }
        }
    }
    let columns = ["what files use", "files", "rendered", "of these without remark", "named"];
    head(out, "By feature", &columns);
    for (name, (Count { files, rendered }, named)) in features {
        let _ = writeln!(out, "| {} | {files} | {rendered} | {} | {named} |", cell(name), rendered - named);
    }
}

fn notes(tried: &[Tried], out: &mut String) {
    type Of = fn(&Shown) -> &BTreeMap<String, u64>;
    let lists: [(&str, Of); 2] =
        [("Named as not modelled", |model| &model.unmodelled), ("Repairs", |model| &model.repairs)];
    for (title, of) in lists {
        let mut kinds: BTreeMap<&str, (u64, u64)> = BTreeMap::new();
        for (kind, times) in tried.iter().filter_map(shown).flat_map(of) {
            let entry = kinds.entry(kind).or_default();
            entry.0 += 1;
            entry.1 += times;
        }
        head(out, title, &["what", "files", "times"]);
        for (kind, (files, times)) in kinds {
            let _ = writeln!(out, "| {} | {files} | {times} |", cell(kind));
        }
    }
}

/// Repairs, but for those that stand for what a file without lights or cameras is given.
fn repairs(model: &Shown) -> u64 {
    model.repairs.iter().filter(|(kind, _)| !kind.starts_with("no light")).map(|(_, times)| times).sum()
}

fn gltf_files(tried: &[Tried], out: &mut String) {
    let columns = ["file", "triangles", "textures", "lights", "luminance", "named", "repairs"];
    head(out, "glTF files", &columns);
    for tried in tried.iter().filter(|tried| !is_obj(tried)) {
        let name = cell(&tried.name);
        match &tried.what {
            What::Shown(model) => {
                let Shown { triangles, textures, lights, luminance, unmodelled, .. } = &**model;
                let (unmodelled, repairs) = (cell(&listed(unmodelled)), repairs(model));
                let _ = writeln!(
                    out,
                    "| {name} | {triangles} | {textures} | {lights} | {luminance:.3} | {unmodelled} | {repairs} |"
                );
            }
            What::Refused { .. } => {
                let _ = writeln!(out, "| {name} | | | | | refused | |");
            }
            What::Panicked(_) => {
                let _ = writeln!(out, "| {name} | | | | | PANIC | |");
            }
        }
    }
}

/// A line for all OBJ files of a folder and those below it, two folders deep.
fn obj_folders(tried: &[Tried], out: &mut String) {
    let mut folders: BTreeMap<String, (Count, Shown)> = BTreeMap::new();
    for tried in tried.iter().filter(|tried| is_obj(tried)) {
        let parts: Vec<&str> = tried.name.split('/').collect();
        let folder = parts[..(parts.len() - 1).min(2)].join("/");
        let (count, sum) = folders.entry(folder).or_default();
        count.files += 1;
        let Some(model) = shown(tried) else { continue };
        count.rendered += 1;
        sum.triangles += model.triangles;
        sum.textures += model.textures;
        for (all, some) in [(&mut sum.unmodelled, &model.unmodelled), (&mut sum.repairs, &model.repairs)] {
            some.iter().for_each(|(kind, times)| *all.entry(kind.clone()).or_default() += times);
        }
    }
    let columns = ["folder", "files", "rendered", "triangles", "textures", "named", "repairs"];
    head(out, "OBJ files", &columns);
    for (folder, (Count { files, rendered }, sum)) in folders {
        let (named, repairs) = (cell(&listed(&sum.unmodelled)), repairs(&sum));
        let _ = writeln!(
            out,
            "| {} | {files} | {rendered} | {} | {} | {named} | {repairs} |",
            cell(&folder),
            sum.triangles,
            sum.textures
        );
    }
}
