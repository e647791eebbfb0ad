//! Numbers as words.

use super::{Factors, Hotspot};
use crate::names::in_sentence;

/// Above this factor something is worth a word.
const NOTABLE: f64 = 1.4;

/// From this share on, cost in vain is worth a word.
pub(super) const WASTED: f64 = 0.5;

/// Longest name within a sentence.
pub(super) const NAME: usize = 60;

/// With more triangles per pixel of a hotspot than this, its object's own mesh may be too fine.
const FINE_MESH: f64 = 1.0;

/// The factors as a sentence, the strongest first: what can be said without ledgers.
pub(super) fn by_ratios(factors: &Factors) -> String {
    let mut parts: Vec<(f64, String)> = [
        (factors.rays_per_path, "paths cast", "as many rays as the median pixel's"),
        (factors.nodes_per_ray, "each ray visits", "as many tree nodes as at the median pixel"),
        (factors.shapes_per_ray, "each ray is tested against", "as many triangles as at the median pixel"),
    ]
    .into_iter()
    .filter_map(|(factor, before, after)| {
        let factor = factor.filter(|factor| *factor >= NOTABLE)?;
        Some((factor, format!("{before} {factor:.1} times {after}")))
    })
    .collect();
    parts.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut words: Vec<String> = parts.into_iter().map(|(_, words)| words).collect();
    if let Some(waste) = factors.waste_share.filter(|share| *share >= WASTED) {
        words.push(format!("{:.0} % of the cost brings no light (blocked or lost rays)", waste * 100.0));
    }
    if words.is_empty() {
        "slightly more of everything than the median pixel".to_owned()
    } else {
        words.join("; ")
    }
}

/// "A", "A and B", "A, B and C" of names in quotes; empty without any.
pub(super) fn list(names: &[String]) -> String {
    joined(&names.iter().map(|name| super::sentences::name(name)).collect::<Vec<_>>())
}

fn joined(parts: &[String]) -> String {
    match parts {
        [] => String::new(),
        [one] => one.clone(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}

/// Whether the object seen there has more triangles than the hotspot has pixels.
pub(super) fn too_fine(hotspot: &Hotspot, object_triangles: Option<u64>) -> bool {
    object_triangles.is_some_and(|triangles| triangles as f64 / hotspot.pixels.max(1) as f64 > FINE_MESH)
}

/// What to try about a hotspot whose causes were not found, a sentence for each of its causes and empty when none is known. `object_triangles` is the
/// number of triangles of the object seen there: a coarser mesh is advised only where that has more than about one triangle
/// per pixel of the hotspot; elsewhere the dense geometry is what rays meet on leaving it.
pub fn fix(hotspot: &Hotspot, object_triangles: Option<u64>) -> String {
    let notable = |factor: Option<f64>| factor.is_some_and(|factor| factor >= NOTABLE);
    let factors = &hotspot.factors;
    let mut advice: Vec<&str> = Vec::new();
    if notable(factors.rays_per_path) {
        advice.push(
            "Close gaps that trap paths, darken near-white surfaces that face each other, or lower --max-depth.",
        );
    }
    let (nodes, shapes) = (notable(factors.nodes_per_ray), notable(factors.shapes_per_ray));
    if nodes || shapes {
        advice.push(if too_fine(hotspot, object_triangles) {
            "Simplify this object's mesh: it has more triangles than pixels here."
        } else if nodes {
            "Rays that leave this surface cross dense geometry elsewhere: simplify or move apart what surrounds it."
        } else {
            "Rays that leave this surface are tested against dense geometry elsewhere: look for large or long thin \
             triangles among fine ones, and subdivide them."
        });
    }
    if advice.is_empty() && factors.waste_share.is_some_and(|share| share >= WASTED) {
        advice.push("Most of the work brings no light: check for lights that are hidden from here.");
    }
    advice.join(" ")
}

/// A hotspot whose pixels cost this many times the mean is worth a sentence before larger ones that barely stand out.
const DENSE: f64 = 1.4;

/// The sentence ends when its hotspots hold this share of the excess.
const ENOUGH: f64 = 0.75;

/// Dense hotspots are preferred only where they hold at least this share of the cost.
const WORTHWHILE: f64 = 0.05;

/// The sentence without hotspots.
const EVEN: &str =
    "No region stands out from the noise: none can be told apart from the mean cost at this sample count";

/// One sentence for people: `41 % of the cost lies in 9 % of the pixels: "Wardrobe mirror"`. Where hotspots that cost well
/// above the mean hold a fair share of the cost, the sentence is about them; else about all. Takes them by rank until they
/// hold most of what they exceed the mean by, and at most three objects.
pub fn verdict(hotspots: &[Hotspot]) -> String {
    let dense: Vec<&Hotspot> =
        hotspots.iter().filter(|hotspot| hotspot.cost_share >= DENSE * hotspot.pixel_share).collect();
    let worthwhile = dense.iter().map(|hotspot| hotspot.cost_share).sum::<f64>() >= WORTHWHILE;
    let hotspots = if worthwhile { dense } else { hotspots.iter().collect() };
    let all: f64 = hotspots.iter().map(|hotspot| hotspot.excess).sum();
    let (mut excess, mut cost, mut pixels) = (0.0, 0.0, 0.0);
    let mut names: Vec<String> = Vec::new();
    for hotspot in hotspots {
        let name = match (&hotspot.name, hotspot.object) {
            (Some(name), _) => format!("\"{}\"", in_sentence(name, NAME)),
            (None, Some(object)) => format!("object {object}"),
            (None, None) => format!("around pixel ({}, {})", hotspot.bbox[0], hotspot.bbox[1]),
        };
        let known = names.contains(&name);
        if !known && (names.len() == 3 || excess >= ENOUGH * all) {
            continue;
        }
        if !known {
            names.push(name);
        }
        excess += hotspot.excess;
        cost += hotspot.cost_share;
        pixels += hotspot.pixel_share;
    }
    if names.is_empty() {
        return EVEN.to_owned();
    }
    let list = joined(&names);
    format!("{} of the cost lies in {} of the pixels: {list}", percent(cost), percent(pixels))
}

/// A share as a percentage with as many digits as people read.
fn percent(share: f64) -> String {
    let percent = share * 100.0;
    if percent < 1.0 { format!("{percent:.1} %") } else { format!("{percent:.0} %") }
}
