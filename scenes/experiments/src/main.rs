//! The paper's experiments, repeated: `cargo run --release -p hotspot-experiments`.
//!
//! The paper: *Identifying and Visualizing Computational Hotspots in Path Tracing* (Sundarrajan, van de Ruit, Eisemann 2022),
//! section 5, Figures 1 to 4. Each is rendered with its samples per pixel and depth, on this project's scenes and on
//! `../shared/scenes` where they lie beside the checkout. One page sets each claim beside what is measured; whether
//! they agree is decided by the numbers, never by hand.
#![forbid(unsafe_code)]
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a command")]

mod blocks;
mod figures;
mod page;
mod stage;

use stage::Scale;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

const USAGE: &str = "usage: hotspot-experiments [-o DIR] [--only N]... [--quick]
  -o DIR    folder for the page and its table [default: hotspot-out/experiments]
  --only N  figure N alone, 1 to 4; may be repeated. Figure 1 measures time: nothing else should run beside it
  --quick   pictures of a quarter of the edge: a look at everything in seconds, too noisy to judge";

fn main() -> ExitCode {
    let mut folder = PathBuf::from("hotspot-out/experiments");
    let mut scale = Scale::Paper;
    let mut wanted = Vec::new();
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        match word.as_str() {
            "--quick" => scale = Scale::Quick,
            "--only" => match words.next().and_then(|n| n.parse().ok()).filter(|n| (1..=4).contains(n)) {
                Some(number) => wanted.push(number),
                None => return usage("--only needs the number of a figure, 1 to 4"),
            },
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
    if wanted.is_empty() {
        wanted = vec![1, 2, 3, 4];
    }
    match run(&folder, scale, &wanted) {
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

fn run(folder: &Path, scale: Scale, wanted: &[u8]) -> Result<(), String> {
    std::fs::create_dir_all(folder)
        .map_err(|e| format!("cannot make the folder {}: {e}", folder.display()))?;
    let start = Instant::now();
    let figures = figures::all(scale, wanted, |figure| {
        println!("\n{} — {} ({:.0} s)", figure.title, figure.scene, start.elapsed().as_secs_f64());
        for claim in &figure.claims {
            println!("  [{}] {}\n      {}", claim.verdict.word(), claim.paper, claim.ours);
        }
    })?;
    let write = |name: &str, text: String| {
        let file = folder.join(name);
        hotspot_cost::maps::write_atomic(&file, text.as_bytes()).map_err(|e| e.to_string()).map(|()| file)
    };
    let table = write("experiments.md", page::table(&figures, scale))?;
    let page = write("experiments.html", page::html(&figures, scale))?;
    println!("\nwrote {}: the claims as a table\n→ open {}", table.display(), page.display());
    Ok(())
}
