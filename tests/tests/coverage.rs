//! Do the 95 % intervals of cost hold the truth 95 times in a hundred?
//!
//! Small pictures of own scenes are rendered with many seeds; each gives intervals for the whole frame and for its four tiles
//! of 8×8, for four metrics. The truth is the mean of eight renders of 4096 samples per pixel with seeds of their own. It has an error itself, which widens the spread of (estimate − truth) that the interval does not
//! know of: by a factor √(1 + r²), where r is its standard error over that of an estimate. The table says r; for r = 0.05
//! coverage falls by 0.03 %.
//!
//! Coverage over n seeds is binomial. A cell of the table fails when what was found is so far outside of 93.5 … 96.5 % that
//! a true coverage within would give it with a probability below Šidák's level for 0.1 % over all cells. Tiles of a seed are
//! independent of each other (their pixels are), metrics are not.

use hotspot_cost::{CiKind, CostModel, Frame, Metric, Rect, stats};
use hotspot_integrator::{BuildOptions, Control, Gather, RenderScene, Settings, render};
use hotspot_scene::{Camera, Environment, LoadOptions, load, load_environment};
use hotspot_tests::say;
use hotspot_tests::stats::{mean_and_variance, sidak};
use rayon::prelude::*;
use std::path::PathBuf;

const EDGE: u32 = 16;
const METRICS: [Metric; 4] = [Metric::Rays, Metric::Nodes, Metric::Shapes, Metric::Intersection];
/// Mean and variance of the mean, by metric and region.
type Truth = Vec<[(f64, f64); REGIONS]>;
/// The frame, then its tiles.
const REGIONS: usize = 5;
const FAMILY: f64 = 1e-3;

/// Means and intervals: by metric, by region.
type Estimates = Vec<[(f64, [f64; 2]); REGIONS]>;

fn rect(region: usize) -> Rect {
    let half = EDGE / 2;
    match region {
        0 => Rect { x: 0, y: 0, width: EDGE, height: EDGE },
        _ => {
            let tile = region as u32 - 1;
            Rect { x: tile % 2 * half, y: tile / 2 * half, width: half, height: half }
        }
    }
}

struct Subject {
    name: &'static str,
    scene: RenderScene,
    camera: Camera,
}

impl Subject {
    fn new(name: &'static str) -> Self {
        let folder: PathBuf = [env!("CARGO_MANIFEST_DIR"), "../scenes"].iter().collect();
        let mut scene =
            load(&folder.join(format!("{name}.gltf")), &LoadOptions::default()).expect("the scene loads");
        if name.ends_with("environment") {
            let map = load_environment(&folder.join("features/sky.hdr"), &LoadOptions::default());
            scene.environment = Some(Environment::Map(map.expect("the sky loads").0));
        }
        Self {
            name,
            scene: RenderScene::prepare(&scene, BuildOptions::default()).expect("the scene is whole"),
            camera: scene.cameras[0].clone(),
        }
    }

    fn frame(&self, spp: u32, seed: u64, intervals: bool) -> Frame {
        let mut settings = Settings::new(EDGE, EDGE);
        settings.spp = spp;
        settings.seed = seed;
        settings.intervals = intervals;
        settings.gather = Gather { time: false, ..Gather::ALL };
        render(&self.scene, &self.camera, &settings, Control::default()).frame
    }

    fn estimates(&self, spp: u32, seed: u64, intervals: bool) -> Estimates {
        let frame = self.frame(spp, seed, intervals);
        let model = CostModel::default();
        let of = |metric, region| {
            let total = stats::region(&frame, rect(region), metric, model);
            // A tile whose halves agree by chance falls back to the bound.
            let halves = total.ci_kind == CiKind::Halves;
            assert!(if intervals { halves || region > 0 } else { !halves });
            if region == 0 {
                assert_eq!(total, stats::total(&frame, metric, model));
            }
            (total.mean, total.ci95.expect("there is an interval"))
        };
        METRICS.iter().map(|metric| std::array::from_fn(|region| of(*metric, region))).collect()
    }

    /// Mean and variance of the mean, by metric and region, from renders with seeds beyond all others.
    fn truth(&self, spp: u32) -> Truth {
        let renders: Vec<Estimates> =
            (0..8).into_par_iter().map(|i| self.estimates(spp, 1_000_000 + i, true)).collect();
        (0..METRICS.len())
            .map(|m| {
                std::array::from_fn(|r| {
                    mean_and_variance(&renders.iter().map(|e| e[m][r].0).collect::<Vec<_>>())
                })
            })
            .collect()
    }
}

/// What was covered, of how many.
#[derive(Clone, Copy, Debug, Default)]
struct Count {
    covered: u64,
    of: u64,
}

impl Count {
    fn share(self) -> f64 {
        self.covered as f64 / self.of as f64
    }

    /// Probability of as few (or as many) as this where the true coverage is `p`: the normal tail with continuity correction.
    fn tail(self, p: f64, few: bool) -> f64 {
        let n = self.of as f64;
        let sigma = (n * p * (1.0 - p)).sqrt();
        let z =
            if few { self.covered as f64 + 0.5 - n * p } else { n * p - self.covered as f64 + 0.5 } / sigma;
        let two_sided = hotspot_tests::stats::p_value(z, 1e9);
        if z < 0.0 { 0.5 * two_sided } else { 1.0 - 0.5 * two_sided }
    }
}

/// A row of the table: a scene, a metric, frame or tiles.
struct Cell {
    what: String,
    count: Count,
}

/// The cells of one scene: for each metric the frame and its tiles.
fn cells(subject: &Subject, truth: &Truth, seeds: u64, spp: u32, intervals: bool) -> Vec<Cell> {
    let runs: Vec<Estimates> =
        (0..seeds).into_par_iter().map(|seed| subject.estimates(spp, seed, intervals)).collect();
    let mut out = Vec::new();
    for (m, metric) in METRICS.iter().enumerate() {
        let mut counts = [Count::default(); 2];
        for run in &runs {
            for r in 0..REGIONS {
                let (truth, [low, high]) = (truth[m][r].0, run[m][r].1);
                let count = &mut counts[usize::from(r > 0)];
                count.of += 1;
                count.covered += u64::from((low..=high).contains(&truth));
            }
        }
        let means: Vec<f64> = runs.iter().map(|run| run[m][0].0).collect();
        let (mean, of_mean) = mean_and_variance(&means);
        let spread = (of_mean * seeds as f64).sqrt();
        let (expected, truth_variance) = truth[m][0];
        // How wide intervals are, against what they should be.
        let widths = runs.iter().map(|run| run[m][0].1[1] - run[m][0].1[0]).sum::<f64>() / seeds as f64;
        let bias = (mean - expected) / (of_mean + truth_variance).sqrt();
        say(&format!(
            "| {} | {spp} | {} | {} | {:.1} | {:.1} | {:.2} | {bias:+.1} | {:.3} |",
            subject.name,
            if intervals { "halves" } else { "conservative" },
            metric.name(),
            100.0 * counts[0].share(),
            100.0 * counts[1].share(),
            0.5 * widths / (1.96 * spread),
            truth_variance.sqrt() / spread,
        ));
        for (where_, count) in ["frame", "tiles"].into_iter().zip(counts) {
            let what = format!("{}, {spp} spp, {}, {where_}", subject.name, metric.name());
            out.push(Cell { what, count });
        }
    }
    out
}

const HEAD: &str = "| scene | spp | intervals | metric | frame % | tiles % | width / ideal | bias σ | r |\n|---|---|---|---|---|---|---|---|---|";

fn check(subjects: &[&'static str], seeds: u64, spps: &[u32], truth_spp: u32) {
    say(HEAD);
    let subjects: Vec<Subject> = subjects.iter().map(|name| Subject::new(name)).collect();
    let truths: Vec<Truth> = subjects.iter().map(|subject| subject.truth(truth_spp)).collect();
    let mut all = Vec::new();
    for (subject, truth) in subjects.iter().zip(&truths) {
        for spp in spps {
            all.extend(cells(subject, truth, seeds, *spp, true));
        }
    }
    let level = sidak(FAMILY, 2 * all.len());
    let off: Vec<String> = all
        .iter()
        .filter(|cell| cell.count.tail(0.935, true) < level || cell.count.tail(0.965, false) < level)
        .map(|cell| format!("{}: {:.1} % of {}", cell.what, 100.0 * cell.count.share(), cell.count.of))
        .collect();
    // Conservative intervals may cover more, never less.
    let mut bounds = Vec::new();
    for (subject, truth) in subjects.iter().zip(&truths) {
        bounds.extend(cells(subject, truth, seeds, spps[0], false));
    }
    let level = sidak(FAMILY, bounds.len());
    let under: Vec<String> = bounds
        .iter()
        .filter(|cell| cell.count.tail(0.95, true) < level)
        .map(|cell| format!("{}: conservative, {:.1} %", cell.what, 100.0 * cell.count.share()))
        .collect();
    let inside = all.iter().filter(|c| (0.935..=0.965).contains(&c.count.share())).count();
    say(&format!("{inside} of {} cells within 93.5 … 96.5 %", all.len()));
    assert!(off.is_empty() && under.is_empty(), "coverage is off:\n{}\n{}", off.join("\n"), under.join("\n"));
}

#[test]
fn intervals_cover_the_truth() {
    check(&["cornell-box-red/cornell-box-red", "features/instances", "features/substrate"], 120, &[8], 1024);
}

const SCENES: [&str; 8] = [
    "cornell-box-red/cornell-box-red",
    "mirror-gap-narrow/mirror-gap-narrow",
    "white-room-substrate/white-room-substrate",
    "creature/creature",
    "features/glass",
    "features/alpha-blend",
    "features/instances",
    "features/environment",
];

#[test]
#[ignore = "minutes of rendering: 1000 seeds on eight scenes, with the table"]
fn intervals_cover_the_truth_over_a_thousand_seeds() {
    check(&SCENES, 1000, &[8, 16], 4096);
}
