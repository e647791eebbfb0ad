//! The page of a comparison.

use super::input::{CompareInput, CompareLayer};
use super::page::{precise, shell};
use super::parts::{self, NAME, TEXT};
use super::{codec, escape, layers};
use crate::maps::{ColorMap, View, view};
use serde_json::{Value, json};

/// The page as one HTML text without outside references. Layers are compared as far as both pictures have them; a
/// difference is B − A, red where B is costlier.
pub fn compare_html(input: &CompareInput<'_>) -> String {
    let (width, height) = input.a.beauty.dimensions();
    let (a, b) = (layers::picture(input.a.beauty), layers::picture(input.b.beauty));
    let settings: Vec<_> =
        input.facts.iter().map(|f| ("", vec![f.label.clone(), f.a.clone(), f.b.clone()])).collect();
    let body = escape::fill(
        include_str!("compare.html"),
        &[
            ("title", &escape::name(&input.title, NAME)),
            ("verdict", &escape::name(&parts::unbroken(&input.verdict), TEXT)),
            ("name_a", &escape::name(&input.a.name, NAME)),
            ("name_b", &escape::name(&input.b.name, NAME)),
            ("beauty_a", &parts::image(a.as_deref(), "beautyA", &format!("A: {}", input.a.name))),
            ("beauty_b", &parts::image(b.as_deref(), "beautyB", &format!("B: {}", input.b.name))),
            ("notices", &parts::notice("Please note", &input.notes)),
            ("suggestions", &suggestions(input)),
            ("totals", &totals(input)),
            ("settings", &parts::table("settings", &["setting", "A", "B"], &settings)),
            ("json", &parts::raw(&input.raw_json)),
        ],
    );
    let pictures = [&a, &b].into_iter().flatten().map(String::len).sum();
    let data = data(input, width, height, pictures);
    let title = format!("{} · cost comparison", input.title);
    shell(&title, (width, height), &body, &data, include_str!("compare.js"))
}

fn data(input: &CompareInput<'_>, width: u32, height: u32, pictures: usize) -> Value {
    let pixels = width as usize * height as usize;
    let fits = |layer: &&CompareLayer<'_>| pixels > 0 && layer.a.len() == pixels && layer.b.len() == pixels;
    let shown: Vec<&CompareLayer<'_>> = input.maps.iter().filter(fits).collect();
    let differences: Vec<Vec<f32>> =
        shown.iter().map(|layer| layer.a.iter().zip(layer.b).map(|(a, b)| b - a).collect()).collect();
    // A and the difference travel: small differences of large values would drown in the steps of A and B.
    let wanted: Vec<(&[f32], bool)> = shown
        .iter()
        .zip(&differences)
        .enumerate()
        .flat_map(|(i, (layer, difference))| [(difference.as_slice(), i < 2), (layer.a, i < 1)])
        .collect();
    // Flags of a layer take about a kilobyte.
    let (planes, _) = layers::planes((width, height), &wanted, pictures + 1024 * shown.len());
    let maps: Vec<Value> = shown
        .iter()
        .zip(&differences)
        .zip(planes.chunks_exact(2))
        .map(|((layer, difference), planes)| {
            let signed = view(width, height, difference, layer.difference, layer.despike, true);
            let mut value = layers::describe(&layer.metric, &layer.label, &layer.unit, layer.kind, layer.a);
            value["scale"] = layers::scale(&signed, ColorMap::RedBlue);
            value["heat"] = layers::scale(&joint_view(width, height, layer), layer.map);
            layers::note_shrink(&mut value["scale"], &planes[0]);
            layers::note_shrink(&mut value["heat"], &planes[1]);
            value["plane"] = planes[0].clone();
            value["planeA"] = planes[1].clone();
            value["significant"] = layer.significant.map_or(Value::Null, |flags| {
                let flags: Vec<u16> = flags.iter().map(|f| u16::from(*f)).collect();
                codec::identifiers(width, height, &flags)
            });
            value
        })
        .collect();
    json!({
        "width": width,
        "height": height,
        "tables": layers::tables(),
        "maps": maps,
        "objects": input.objects.as_ref().map(|o| layers::objects(width, height, o)),
        "materials": input.materials.as_ref().map(|o| layers::objects(width, height, o)),
    })
}

/// One scale for A and B: the two pictures on top of each other, seen as one.
fn joint_view(width: u32, height: u32, layer: &CompareLayer<'_>) -> View {
    let both: Vec<f32> = layer.a.iter().chain(layer.b).copied().collect();
    view(width, height.saturating_mul(2), &both, layer.scale, layer.despike, layer.map.is_diverging())
}

/// The ranked table of what was tried.
fn suggestions(input: &CompareInput<'_>) -> String {
    if input.suggestions.is_empty() {
        return String::new();
    }
    let rows: Vec<_> = input
        .suggestions
        .iter()
        .map(|row| {
            let cells = [&row.what, &row.cost, &row.time, &row.picture, &row.command, &row.reason];
            ("", cells.map(String::clone).to_vec())
        })
        .collect();
    let headings =
        ["change", "intersection cost", "time", "the picture changes by", "command", "why it was tried"];
    format!(
        "<section class=\"block\"><h2>What was tried</h2><p>Intervals of sampling and of repeats; rebuilding the tree adds \
         its luck, which is measured for the comparison above alone.</p>{}</section>",
        parts::table("suggestions", &headings, &rows)
    )
}

fn totals(input: &CompareInput<'_>) -> String {
    let rows: Vec<_> = input
        .totals
        .iter()
        .map(|row| {
            let interval = row.ci95.map_or("not known".into(), |[lo, hi]| {
                format!("{} to {}", parts::change(lo), parts::change(hi))
            });
            let significant = match row.significant {
                Some(true) => "yes",
                Some(false) => "no: within noise",
                None => "not known",
            };
            let class = if row.significant == Some(false) { "noise" } else { "" };
            let cells = vec![
                row.label.clone(),
                precise(row.a),
                precise(row.b),
                parts::change(row.relative),
                interval,
                significant.into(),
            ];
            (class, cells)
        })
        .collect();
    let headings = ["mean per path", "A", "B", "change", "95 % interval of the change", "significant"];
    parts::table("", &headings, &rows)
}

#[cfg(test)]
#[path = "compare_tests.rs"]
mod tests;
