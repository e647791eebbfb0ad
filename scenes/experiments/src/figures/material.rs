//! Figure 3: a table of lacquer made matte.

use super::{Claim, Figure, Verdict, panel};
use crate::stage::{Pair, Scale, Subject};
use hotspot_cost::Metric;
use std::collections::BTreeSet;

const PICTURE_SPP: u32 = 256;
const METRIC_SPP: u32 = 32;
const DEPTH: u32 = 33;

/// The lacquered table is brighter than the matte one by more than this factor: a highlight.
const HIGHLIGHT: f32 = 1.25;

pub(super) fn figure(substrate: &Subject, matte: &Subject, scale: Scale) -> Result<Figure, String> {
    let size = scale.size([480, 270]);
    let [a, b] = [substrate, matte].map(|s| s.picture(size, PICTURE_SPP, DEPTH));
    let pair = Pair::new(substrate, matte, size, METRIC_SPP, DEPTH)?;
    let changed = changed_objects(substrate, matte);
    let table = |i: usize| changed.contains(&pair.a.objects[i]);
    let shiny = |i: usize| a.luminance[i] > HIGHLIGHT * b.luminance[i];
    let metric = Metric::Intersection;
    let highlights = pair.over(metric, |i| table(i) && shiny(i));
    let rest = pair.over(metric, |i| table(i) && !shiny(i));
    let (count, bright) = (
        (0..a.luminance.len()).filter(|i| table(*i)).count(),
        (0..a.luminance.len()).filter(|i| table(*i) && shiny(*i)).count(),
    );
    let names: Vec<&str> = changed
        .iter()
        .filter_map(|o| substrate.prepared.objects().get(*o as usize).map(String::as_str))
        .collect();
    let (_, rays_text) = pair.total(Metric::Rays);
    let (_, intersection_text) = pair.total(metric);
    Ok(Figure {
        title: "Figure 3: a lacquered table made matte",
        scene: format!("{} → {}", substrate.scene.name, matte.scene.name),
        settings: format!(
            "{} × {}; pictures {PICTURE_SPP} spp, metrics {METRIC_SPP} spp in two halves with shared seeds, depth {DEPTH}; \
             differences clipped at the 99.9th percentile. Changed: {}",
            size[0],
            size[1],
            names.join(", ")
        ),
        panels: vec![
            panel("(a) substrate", a.image.clone()),
            panel("(b) matte", b.image.clone()),
            panel("(c) path length, matte − substrate", pair.map(Metric::Rays)),
            panel("(d) intersection cost, matte − substrate", pair.map(metric)),
        ],
        claims: vec![
            Claim {
                paper: "Where the lacquer shows highlights, the matte table costs more.",
                ours: format!(
                    "Intersection cost on the table's highlights ({bright} of {count} pixels, the lacquer more than \
                     {HIGHLIGHT}× as bright): {highlights} per path"
                ),
                verdict: Verdict::of(highlights.rises()),
                why: "A highlight is a straight way out to the light; without it paths wander through the room. Where the \
                      highlight reflects costly geometry instead, the sign turns.",
            },
            Claim {
                paper: "Elsewhere the matte table costs less.",
                ours: format!("Intersection cost on the rest of the table: {rest} per path"),
                verdict: Verdict::of(rest.falls()),
                why: "Lacquer adds a lobe to the diffuse one (throughput, and so path length) in the paper's engine and in \
                      ours; the albedos of the two materials decide the sign.",
            },
            Claim {
                paper: "A change of material changes where paths go, so the two metrics differ.",
                ours: format!("Totals: {rays_text}; {intersection_text}"),
                verdict: Verdict::of(differ(&pair)),
                why: "",
            },
        ],
    })
}

/// Objects whose material differs between the scenes.
fn changed_objects(a: &Subject, b: &Subject) -> BTreeSet<u32> {
    let materials = |s: &Subject, i: usize| {
        format!("{:?}", s.scene.materials[s.scene.instances[i].material as usize].bsdf)
    };
    (0..a.scene.instances.len().min(b.scene.instances.len()))
        .filter(|i| materials(a, *i) != materials(b, *i))
        .map(|i| a.scene.instances[i].object)
        .collect()
}

/// The intervals of the relative changes of rays and intersection cost do not overlap.
fn differ(pair: &Pair) -> bool {
    let interval = |metric: Metric| pair.comparison.totals.get(metric.name()).and_then(|t| t.ci95);
    match (interval(Metric::Rays), interval(Metric::Intersection)) {
        (Some(a), Some(b)) => a[1] < b[0] || b[1] < a[0],
        _ => false,
    }
}
