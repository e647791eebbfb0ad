//! Metrics, totals and settings in the words of pages and legends.

use hotspot_cost::maps::{HeatMap, grouped};
use hotspot_cost::report::{Fact, PairFact, TotalRow, ValueKind};
use hotspot_cost::{CiKind, Document, Metric, Sum};

/// What a heat map's view altered, in words.
pub(super) fn altered(map: &HeatMap) -> Vec<String> {
    let mut altered = Vec::new();
    if map.clipped > 0 {
        altered.push(match map.clip_percentile {
            Some(p) => format!("{} pixels beyond the {p}th percentile clipped", map.clipped),
            None => format!("{} pixels beyond the fixed scale clipped", map.clipped),
        });
    }
    if map.despiked > 0 {
        altered.push(format!(
            "{} spikes (beyond the 99.9th percentile, or far above their neighbours) replaced by the median of their \
             3 x 3 neighbours",
            map.despiked
        ));
    }
    altered
}

pub(super) const fn kind(metric: Metric) -> ValueKind {
    match metric {
        Metric::Escaped | Metric::Absorbed | Metric::Roulette | Metric::DepthLimit => ValueKind::Share,
        _ => ValueKind::Amount,
    }
}

pub(super) fn unit(metric: Metric) -> String {
    metric.unit().to_owned()
}

/// The unit within a render, whose c0 and c1 may be calibrated.
pub(super) fn unit_in(document: &Document, metric: Metric) -> String {
    match &document.cost_unit {
        Some(calibrated) if metric.is_weighted() => calibrated.clone(),
        _ => unit(metric),
    }
}

pub(super) fn labelled(metric: Metric) -> String {
    let unit = metric.unit();
    if unit.is_empty() { metric.label().to_owned() } else { format!("{} ({unit})", metric.label()) }
}

pub(super) fn facts(document: &Document) -> Vec<Fact> {
    let [width, height] = document.resolution;
    let mut facts = Vec::new();
    if document.samples_per_pixel > 0 {
        let (samples, counted) = (document.samples_per_pixel, document.cost_samples_per_pixel);
        // Under `--cost-spp` the maps are of fewer samples than the picture, and noisier.
        let of_them =
            if counted > 0 && counted < samples { format!(", {counted} counted") } else { String::new() };
        facts.push(Fact::new("Samples per pixel", format!("{samples}{of_them}")));
    }
    facts.push(Fact::new("Size", format!("{width} × {height}")));
    if document.render.seconds > 0.0 {
        facts.push(Fact::new("Rendered in", format!("{:.2} s", document.render.seconds)));
    }
    if document.render.threads > 0 {
        facts.push(Fact::new("Threads", document.render.threads));
    }
    if document.tree.triangles > 0 {
        facts.push(Fact::new("Triangles", grouped(document.tree.triangles).replace(' ', "\u{a0}")));
    }
    if let Some(depth) = document.settings.get("max-depth") {
        facts.push(Fact::new("Max depth", depth));
    }
    if document.memory.peak > 0 {
        facts.push(Fact::new("Peak memory", format!("{} MiB", document.memory.peak >> 20)));
    }
    if let Some(error) = document.estimated_relmse {
        let kind = if document.estimated_relmse_kind == CiKind::Halves { "" } else { " at most" };
        facts.push(Fact::new("Estimated relative squared error", format!("{error:.2e}{kind}")));
    }
    if !document.render.kernel.is_empty() {
        facts.push(Fact::new("Kernel", &document.render.kernel));
        facts.push(Fact::new(
            "Tree",
            format!("{}, {}-wide, {} nodes", document.tree.builder, document.tree.width, document.tree.nodes),
        ));
        facts.push(Fact::new(
            "Load and build",
            format!("{:.2} s, {:.2} s", document.render.load_seconds, document.render.build_seconds),
        ));
    }
    facts
}

pub(super) fn pair_facts(a: Option<&Document>, b: Option<&Document>) -> Vec<PairFact> {
    let (Some(a), Some(b)) = (a, b) else { return Vec::new() };
    let (a, b) = (facts(a), facts(b));
    a.into_iter()
        .map(|fact| {
            let other = b.iter().find(|f| f.label == fact.label);
            PairFact {
                label: fact.label,
                a: fact.value,
                b: other.map_or_else(String::new, |f| f.value.clone()),
            }
        })
        .collect()
}

pub(super) fn totals(document: &Document) -> Vec<TotalRow> {
    Metric::ALL
        .into_iter()
        .filter_map(|metric| {
            let total = document.total(metric)?;
            Some(TotalRow {
                label: match &document.cost_unit {
                    Some(unit) if metric.is_weighted() => format!("{} ({unit})", metric.label()),
                    _ => labelled(metric),
                },
                mean: total.mean,
                ci95: total.ci95,
                ci_kind: match total.ci_kind {
                    CiKind::Halves => "independent halves".into(),
                    CiKind::Conservative => "upper bound".into(),
                    CiKind::Repeats => "repeats".into(),
                    CiKind::None => String::new(),
                },
                sum: match total.sum {
                    Sum::Exact(sum) => sum.to_string(),
                    Sum::Real(sum) => format!("{sum:.6e}"),
                },
            })
        })
        .collect()
}

pub(super) fn note(note: &hotspot_cost::document::Note) -> String {
    let times = if note.count > 1 { format!(" ({} times)", note.count) } else { String::new() };
    format!("{}: {}{times}", note.element, note.what)
}
