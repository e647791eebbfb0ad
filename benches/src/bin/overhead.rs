//! Overhead of each metric group as ratios to the plain kernel, measured in turns so that a drifting machine does not
//! bias them: `cargo run --release -p hotspot-benches --bin overhead -- [SCENE …] [--size N] [--spp N] [--rounds N]
//! [--threads N] [--variants N,N…]`. Without scenes: this repository's Cornell box and creature. `--variants`: those of these
//! places in the table alone, ratios to the first of them.
#![expect(clippy::print_stdout, reason = "it prints a table")]

use hotspot_benches::{COST_ALONE, VARIANTS, run, scenes, subject};
use std::path::PathBuf;

fn main() {
    let mut files = Vec::new();
    let (mut size, mut spp, mut rounds, mut threads) = (256, 16, 7, 2);
    let mut chosen: Vec<usize> = Vec::new();
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        if word == "--variants" {
            let list = words.next().unwrap_or_default();
            chosen =
                list.split(',').map(|n| n.parse().unwrap_or_else(|_| panic!("{n} is no place"))).collect();
            continue;
        }
        let mut number = || match words.next().and_then(|n| n.parse().ok()) {
            Some(n) => n,
            None => panic!("{word} wants a number"),
        };
        match word.as_str() {
            "--size" => size = number(),
            "--spp" => spp = number(),
            "--rounds" => rounds = number(),
            "--threads" => threads = number(),
            _ => files.push(PathBuf::from(word)),
        }
    }
    if files.is_empty() {
        files = vec![
            scenes().join("cornell-box-red/cornell-box-red.gltf"),
            scenes().join("creature/creature.gltf"),
        ];
    }
    let pool = match rayon::ThreadPoolBuilder::new().num_threads(threads as usize).build() {
        Ok(pool) => pool,
        Err(e) => panic!("cannot start {threads} threads: {e}"),
    };
    for file in files {
        let subject = subject(&file);
        let mut variants: Vec<_> = VARIANTS.iter().chain(&COST_ALONE).collect();
        if !chosen.is_empty() {
            variants = chosen.iter().map(|place| variants[*place]).collect();
        }
        let mut seconds = vec![Vec::new(); variants.len()];
        // One round to warm up, then rounds that go through all variants, every other one backwards.
        for round in 0..=rounds {
            let mut order: Vec<usize> = (0..variants.len()).collect();
            if round % 2 == 1 {
                order.reverse();
            }
            for i in order {
                let rendered = pool.install(|| run(&subject, size, spp, variants[i]));
                if round > 0 {
                    seconds[i].push(rendered.seconds);
                }
            }
        }
        println!("{}: {size} x {size}, {spp} spp, {threads} threads, {rounds} rounds", subject.name);
        println!("{:<42} {:>9} {:>8} {:>17}", "metrics", "seconds", "ratio", "(ratio, min..max)");
        for (variant, times) in variants.iter().zip(&seconds) {
            // Ratios within a round: both ran within seconds of each other.
            let mut ratios: Vec<f64> = times.iter().zip(&seconds[0]).map(|(t, base)| t / base).collect();
            let (lo, middle, hi) = spread(&mut ratios);
            let (_, median, _) = spread(&mut times.clone());
            println!("{:<42} {median:>9.3} {middle:>8.3}    ({lo:.3}..{hi:.3})", variant.name);
        }
    }
}

/// Least, median and greatest.
fn spread(values: &mut [f64]) -> (f64, f64, f64) {
    values.sort_by(f64::total_cmp);
    (values[0], values[values.len() / 2], values[values.len() - 1])
}
