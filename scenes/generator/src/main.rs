//! Writes the scenes of this repository: deterministic glTF 2.0 and OBJ files, the same bytes on every machine.
//!
//! ```text
//! hotspot-scenes [FOLDER]          write the scenes (default: this repository's scenes/)
//! hotspot-scenes --check [FOLDER]  exit 1 if the files there differ from what would be written
//! ```
#![forbid(unsafe_code)]
#![expect(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "a command-line tool that reports what it wrote"
)]

mod cornell;
mod creature;
mod demo;
mod features;
mod furniture;
mod gltf_writer;
mod math;
mod mirror_gap;
mod shapes;
mod still_life;
#[cfg(test)]
mod tests;
mod white_room;

use gltf_writer::{File, Scene};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// A scene ready to be written.
struct Output {
    name: &'static str,
    triangles: usize,
    stored: usize,
    files: Vec<File>,
}

fn all() -> Vec<Output> {
    let output = |s: &Scene, files: Vec<File>| Output {
        name: s.name,
        triangles: s.triangles(),
        stored: s.stored_triangles(),
        files,
    };
    let scenes = [
        cornell::scene("cornell-box-red", [0.5, 0.1, 0.1]),
        cornell::scene("cornell-box-blue", [0.1, 0.1, 0.5]),
        mirror_gap::scene("mirror-gap-wide", 0.06),
        mirror_gap::scene("mirror-gap-narrow", 0.004),
        white_room::scene("white-room-substrate", true),
        white_room::scene("white-room-matte", false),
        creature::scene(),
    ];
    let mut list: Vec<Output> = scenes.iter().map(|s| output(s, s.gltf())).collect();
    list.push(still_life::output());
    let demo = demo::scene();
    list.push(output(&demo, demo.glb()));
    list
}

/// Where the scene inside the binary lives in this repository, so that the crate can be packaged by itself.
const DEMO: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../crates/hotspot-render/src/demo.glb");

/// Where a file goes: into `folder` if one is given, else to its home in this repository.
fn home(folder: Option<&Path>, file: &File) -> PathBuf {
    match folder {
        Some(folder) => folder.join(&file.path),
        None if file.path == "demo/demo.glb" => DEMO.into(),
        None => Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/..")).join(&file.path),
    }
}

fn write(path: &Path, file: &File) -> std::io::Result<()> {
    if let Some(parent) = path.parent() {
        std::fs::create_dir_all(parent)?;
    }
    std::fs::write(path, &file.bytes)
}

fn main() -> ExitCode {
    let mut check = false;
    let mut folder: Option<PathBuf> = None;
    for argument in std::env::args_os().skip(1) {
        match argument.to_str() {
            Some("--check") => check = true,
            Some("--help" | "-h") => {
                println!(
                    "hotspot-scenes [--check] [FOLDER]: writes the scenes of this repository, or compares them"
                );
                return ExitCode::SUCCESS;
            }
            Some(other) if other.starts_with('-') => {
                eprintln!("hotspot-scenes: unknown option {other}; see --help");
                return ExitCode::from(2);
            }
            _ => folder = Some(argument.into()),
        }
    }
    let mut failed = false;
    for scene in all().into_iter().chain(features::all()) {
        let bytes: usize = scene.files.iter().map(|f| f.bytes.len()).sum();
        for file in &scene.files {
            let path = home(folder.as_deref(), file);
            if check {
                if std::fs::read(&path).ok().as_ref() != Some(&file.bytes) {
                    eprintln!("hotspot-scenes: {} differs from what the generator writes", file.path);
                    failed = true;
                }
            } else if let Err(error) = write(&path, file) {
                eprintln!("hotspot-scenes: cannot write {}: {error}", path.display());
                return ExitCode::FAILURE;
            }
        }
        if !check {
            match (scene.name, scene.triangles, scene.stored, scene.files.len()) {
                (name, 0, _, count) => println!("{name}: {count} files, {bytes} bytes"),
                (name, n, stored, _) => println!("{name}: {n} triangles ({stored} stored), {bytes} bytes"),
            }
        }
    }
    if failed { ExitCode::FAILURE } else { ExitCode::SUCCESS }
}
