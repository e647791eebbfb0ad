//! How many samples does a cost map need to rank its hotspots right? (The paper used 8 to 32.)
//!
//! The five first hotspots of a map by `intersection`, as the program reports them, are compared with those of 1024 samples
//! per pixel of another seed:
//! * **pixels**: Jaccard index of the pixels in any of the five, |A ∩ B| / |A ∪ B|;
//! * **excess**: the same, each pixel weighted by its cost above the mean at 1024 samples: a rim that comes and goes with
//!   the lower bound weighs little;
//! * **captured**: the excess at 1024 samples of the pixels in the map's five, over that of the true five: who works through
//!   the map's list finds that much of what there is to be found, whatever near-equals trade places;
//! * **first**: the first hotspot is the same one: half of the pixels of both together are in both.
//!
//! A map of 1024 samples of a third seed, the twin, says how much can be asked of the pixels.
//!
//! The samples needed are the least, in powers of two, from which on at least 90 % of the seeds reach 0.9, or have the same
//! first hotspot. Pictures are small (144×96), which asks for more samples than large ones do:
//! a hotspot has fewer pixels to average over.

use hotspot_cost::{CostModel, Frame, LayerOptions, Layers, Metric, hotspots};
use hotspot_integrator::{Control, Gather, Settings, render};
use hotspot_probe::NONE;
use hotspot_tests::reference::{Loaded, own_scene, shared_scene};
use hotspot_tests::say;
use rayon::prelude::*;

const SIZE: [u32; 2] = [144, 96];
const TOP: usize = 5;

/// A map's first hotspots.
struct Map {
    /// Rank of each pixel, from 0; `usize::MAX` outside.
    rank: Vec<usize>,
    /// Cost above the mean, at least 0.
    excess: Vec<f64>,
    found: usize,
}

fn frame(loaded: &Loaded, [width, height]: [u32; 2], spp: u32, seed: u64) -> Frame {
    let mut settings = Settings::new(width, height);
    settings.spp = spp;
    settings.seed = seed;
    settings.gather = Gather { time: false, ..Gather::ALL };
    render(&loaded.scene, &loaded.camera, &settings, Control::default()).frame
}

impl Map {
    fn of(frame: &Frame) -> Self {
        let model = CostModel::default();
        let list = hotspots::of_frame(frame, model, &[], TOP);
        let metrics = [Metric::Intersection].into_iter().collect();
        let layers = Layers::from_frame(frame, &LayerOptions { model, metrics, radiance: false, var: true });
        let cost = layers.metric(Metric::Intersection).expect("cost was gathered");
        let mean = cost.iter().map(|c| f64::from(*c)).sum::<f64>() / cost.len() as f64;
        let rank = members(frame, &layers, cost, mean, &list);
        let excess = cost.iter().map(|c| (f64::from(*c) - mean).max(0.0)).collect();
        Self { rank, excess, found: list.len() }
    }

    /// Weighted Jaccard index of the pixels in any hotspot.
    fn overlap(&self, other: &Self, weight: impl Fn(usize) -> f64) -> f64 {
        let (mut both, mut any) = (0.0, 0.0);
        for (i, (a, b)) in self.rank.iter().zip(&other.rank).enumerate() {
            let (a, b) = (*a != usize::MAX, *b != usize::MAX);
            both += if a && b { weight(i) } else { 0.0 };
            any += if a || b { weight(i) } else { 0.0 };
        }
        if any > 0.0 { both / any } else { 1.0 }
    }

    /// Excess of the pixels in hotspots of `map`, by this one's costs, over that of its own; at most 1.
    fn captured(&self, map: &Self) -> f64 {
        let of = |rank: &[usize]| -> f64 {
            rank.iter().zip(&self.excess).filter(|(rank, _)| **rank != usize::MAX).map(|(_, e)| e).sum()
        };
        let own = of(&self.rank);
        if own > 0.0 { (of(&map.rank) / own).min(1.0) } else { 1.0 }
    }

    fn same_first(&self, other: &Self) -> bool {
        let (mut both, mut any) = (0, 0);
        for (a, b) in self.rank.iter().zip(&other.rank) {
            both += u32::from(*a == 0 && *b == 0);
            any += u32::from(*a == 0 || *b == 0);
        }
        2 * both >= any
    }
}

/// Which hotspot each pixel is in. The program reports hotspots without their pixels; they are found again from the same
/// lower bound, and must have the boxes and the sizes reported.
fn members(
    frame: &Frame,
    layers: &Layers,
    cost: &[f32],
    mean: f64,
    list: &[hotspots::Hotspot],
) -> Vec<usize> {
    let (width, height) = (layers.width as usize, layers.height as usize);
    let objects = hotspots::first_objects(frame);
    let samples = frame.cost_total(0, 0).samples;
    let mut variances = layers.var(Metric::Intersection).expect("variances were asked for").to_vec();
    if samples < 2 || variances.iter().all(|v| *v == 0.0) {
        variances.fill(f32::NAN);
    }
    let dof = (samples as f64 - 1.0).max(1.0);
    let lower = hotspots::smoothed_lower_bound(layers.width, layers.height, cost, &variances, dof, &objects);
    let mut open: Vec<bool> = lower.iter().map(|l| f64::from(*l) > mean).collect();
    let mut rank = vec![usize::MAX; cost.len()];
    let mut matched = 0;
    for start in 0..open.len() {
        if !std::mem::take(&mut open[start]) {
            continue;
        }
        let mut component = vec![start];
        let mut bbox = [width, height, 0, 0];
        let mut next = 0;
        while next < component.len() {
            let (x, y) = (component[next] % width, component[next] / width);
            next += 1;
            bbox = [bbox[0].min(x), bbox[1].min(y), bbox[2].max(x + 1), bbox[3].max(y + 1)];
            for row in y.saturating_sub(1)..(y + 2).min(height) {
                for column in x.saturating_sub(1)..(x + 2).min(width) {
                    let near = row * width + column;
                    if open[near] && objects[near] == objects[start] {
                        open[near] = false;
                        component.push(near);
                    }
                }
            }
        }
        let object = Some(objects[start]).filter(|o| *o != NONE);
        let is = |h: &&hotspots::Hotspot| {
            h.bbox.map(|c| c as usize) == bbox && h.pixels == component.len() && h.object == object
        };
        if let Some(hotspot) = list.iter().find(is) {
            matched += 1;
            component.iter().for_each(|i| rank[*i] = hotspot.rank - 1);
        }
    }
    assert_eq!(matched, list.len(), "the hotspots reported were not found again");
    rank
}

/// One line of the table.
fn study(
    name: &str,
    loaded: &Loaded,
    size: [u32; 2],
    most: u32,
    seeds: u64,
    reference_spp: u32,
) -> [Option<u32>; 4] {
    let reference = Map::of(&frame(loaded, size, reference_spp, 1_000_000));
    // What two maps of that many samples have in common.
    let twin = Map::of(&frame(loaded, size, reference_spp, 2_000_000));
    let most_pixels = twin.overlap(&reference, |_| 1.0);
    let steps: Vec<u32> = (0..).map(|i| 1 << i).take_while(|spp| *spp <= most).collect();
    // By step and seed: pixels, excess, captured, first.
    let results: Vec<Vec<[f64; 4]>> = steps
        .iter()
        .map(|spp| {
            (0..seeds)
                .into_par_iter()
                .map(|seed| {
                    let map = Map::of(&frame(loaded, size, *spp, seed));
                    [
                        map.overlap(&reference, |_| 1.0),
                        map.overlap(&reference, |i| reference.excess[i]),
                        reference.captured(&map),
                        f64::from(u8::from(map.same_first(&reference))),
                    ]
                })
                .collect()
        })
        .collect();
    let reached = |step: usize, what: usize| {
        let good = results[step].iter().filter(|r| r[what] >= 0.9).count();
        good as f64 >= 0.9 * seeds as f64
    };
    let needed = [0, 1, 2, 3].map(|what| {
        let from = (0..steps.len()).rev().take_while(|step| reached(*step, what)).last();
        from.map(|step| steps[step])
    });
    let tell = |needed: Option<u32>| needed.map_or(format!("> {most}"), |spp| spp.to_string());
    let median = |spp: u32, what: usize| {
        let Some(step) = steps.iter().position(|s| *s == spp) else { return "-".to_owned() };
        let mut values: Vec<f64> = results[step].iter().map(|r| r[what]).collect();
        values.sort_by(f64::total_cmp);
        format!("{:.2}", values[values.len() / 2])
    };
    let medians = |what| [8, 16, 32, 64].map(|spp| median(spp, what)).join(" / ");
    let [pixels, excess, captured, first] = needed.map(tell);
    let found = reference.found;
    say(&format!(
        "| {name} | {found} | {first} | {captured} | {excess} | {pixels} | {} | {} | {} | {most_pixels:.2} |",
        medians(2),
        medians(1),
        medians(0),
    ));
    needed
}

const HEAD: &str = "| scene | hotspots | spp: first | captured | excess | pixels | median captured at 8 / 16 / 32 / 64 | excess | pixels | pixels, twin |\n|---|---|---|---|---|---|---|---|---|---|";

/// Eight samples find nine tenths of what is to be found before the narrow mirror.
#[test]
fn few_samples_find_what_there_is() {
    let Some(scene) = own_scene("mirror-gap-narrow") else { return };
    let [_, _, captured, _] = study("mirror-gap-narrow", &Loaded::new(&scene), [72, 48], 8, 10, 64);
    assert!(captured.is_some_and(|spp| spp <= 8), "{captured:?}");
}

#[test]
#[ignore = "twelve minutes of rendering: the table for own and shared scenes"]
fn samples_needed_to_rank_hotspots() {
    say(HEAD);
    let own = [
        "cornell-box-red",
        "mirror-gap-wide",
        "mirror-gap-narrow",
        "white-room-substrate",
        "white-room-matte",
        "creature",
    ];
    let shared = ["cornell-box-red", "killeroo", "veach-mis", "living-room-substrate", "living-room-matte"];
    let own = own.into_iter().map(|name| (name.to_owned(), own_scene(name)));
    let shared = shared.into_iter().map(|name| (format!("{name} (shared)"), shared_scene(name)));
    for (name, scene) in own.chain(shared) {
        if let Some(scene) = scene {
            study(&name, &Loaded::new(&scene), SIZE, 64, 20, 1024);
        }
    }
}
