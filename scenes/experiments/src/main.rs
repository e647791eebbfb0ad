//! The paper's experiments, repeated: `cargo run --release -p hotspot-experiments`.
//!
//! The paper: *Identifying and Visualizing Computational Hotspots in Path Tracing* (Sundarrajan, van de Ruit, Eisemann 2022),
//! section 5, Figures 1 to 4. Each is rendered with its samples per pixel and depth, on this project's scenes and on
//! `../shared/scenes` where they lie beside the checkout. One page sets each claim beside what is measured; whether
//! they agree is decided by the numbers, never by hand.
#![forbid(unsafe_code)]
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a command")]

mod figures;
mod page;
mod stage;

use stage::Scale;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

const USAGE: &str = "usage: hotspot-experiments [-o DIR] [--quick]
  -o DIR    folder for the page [default: hotspot-out/experiments]
  --quick   pictures of a quarter of the edge: a look at everything in seconds, too noisy to judge";

fn main() -> ExitCode {
    let mut folder = PathBuf::from("hotspot-out/experiments");
    let mut scale = Scale::Paper;
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        match word.as_str() {
            "--quick" => scale = Scale::Quick,
            "-o" => match words.next() {
                Some(name) => folder = name.into(),
                None => return usage("-o needs the name of a folder"),
            },
            "-h" | "--help" => {
                println!("{USAGE}");
                return ExitCode::SUCCESS;
            }
            other => return usage(&format!("there is no option {other}")),
        }
    }
    match run(&folder, scale) {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("hotspot-experiments: {message}");
            ExitCode::FAILURE
        }
    }
}

fn usage(problem: &str) -> ExitCode {
    eprintln!("hotspot-experiments: {problem}\n{USAGE}");
    ExitCode::from(2)
}

fn run(folder: &Path, scale: Scale) -> Result<(), String> {
    std::fs::create_dir_all(folder)
        .map_err(|e| format!("cannot make the folder {}: {e}", folder.display()))?;
    let figures = figures::all(scale)?;
    for figure in &figures {
        println!("\n{} — {}", figure.title, figure.scene);
        for claim in &figure.claims {
            println!("  [{}] {}\n      {}", claim.verdict.word(), claim.paper, claim.ours);
        }
    }
    let file = folder.join("experiments.html");
    hotspot_cost::maps::write_atomic(&file, page::html(&figures, scale).as_bytes())
        .map_err(|e| e.to_string())?;
    println!("\n→ open {}", file.display());
    Ok(())
}
