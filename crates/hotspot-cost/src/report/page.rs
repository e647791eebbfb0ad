//! The page of one render.

use super::input::{HotspotCard, LedgerTable, ReportInput, TotalRow};
use super::parts::{self, NAME, TEXT};
use super::{codec, escape, layers};
use crate::maps::view;
use serde_json::{Value, json};
use std::fmt::Write;

/// Facts that stand at the top; all of them stand in the folded part.
const TOP_FACTS: usize = 6;

/// Most hotspots that get a card.
const CARDS: usize = 60;

/// Stands on the page when layers have fewer pixels than the picture.
const REDUCED: &str =
    " The picture is large: layers whose legend says so are embedded at a lower resolution.";

/// The page as one HTML text without outside references. At 640 × 360 it stays below 5 MB whatever the number of layers, at
/// 1920 × 1080 below 12 MB
/// (the JSON text and names come on top).
pub fn html(input: &ReportInput<'_>) -> String {
    let (width, height) = input.beauty.dimensions();
    let picture = layers::picture(input.beauty);
    let (data, grains) = data(input, width, height);
    let hotspots = &input.hotspots[..input.hotspots.len().min(CARDS)];
    let settings: Vec<_> = input.facts.iter().map(|f| ("", vec![f.label.clone(), f.value.clone()])).collect();
    let step = |steps: u32| parts::percent(8.0 / f64::from(steps));
    let body = escape::fill(
        include_str!("page.html"),
        &[
            ("title", &escape::name(&input.title, NAME)),
            ("verdict", &escape::name(&parts::unbroken(&input.verdict), TEXT)),
            ("facts", &parts::facts(&input.facts[..input.facts.len().min(TOP_FACTS)])),
            ("beauty", &parts::image(picture.as_deref(), "beauty", "Rendered picture")),
            ("hotspots", &cards(hotspots)),
            ("ledgers", &ledgers(&input.ledgers)),
            ("notices", &notices(input)),
            ("totals", &totals(&input.totals)),
            ("settings", &parts::table("settings", &[], &settings)),
            ("json", &parts::raw(&input.raw_json)),
            ("fine", &step(grains[0].steps)),
            ("coarse", &step(grains[1].steps)),
            ("resolution", if grains[1].shrink > 1 { REDUCED } else { "" }),
        ],
    );
    shell(&format!("{} · cost report", input.title), (width, height), &body, &data, include_str!("report.js"))
}

/// Puts a body, its data and its script into the frame that both pages share.
pub(super) fn shell(title: &str, size: (u32, u32), body: &str, data: &Value, script: &str) -> String {
    let (layout, aspect) = parts::layout(size.0, size.1);
    escape::fill(
        include_str!("shell.html"),
        &[
            ("title", &escape::name(title, NAME)),
            ("css", include_str!("page.css")),
            ("layout", layout),
            ("aspect", &aspect),
            ("body", body),
            ("data", &escape::script_json(data)),
            (
                "js",
                &[include_str!("viewer.js"), include_str!("zoom.js"), include_str!("range.js"), script]
                    .concat(),
            ),
        ],
    )
}

fn data(input: &ReportInput<'_>, width: u32, height: u32) -> (Value, [layers::Grain; 2]) {
    let wanted: Vec<_> =
        input.maps.iter().enumerate().map(|(i, map)| (map.values, i < layers::FINE_LAYERS)).collect();
    let (planes, grains) = layers::planes((width, height), &wanted, 0);
    let scales = layers::parallel(&input.maps, |map| {
        let view = view(width, height, map.values, map.scale, map.despike, map.map.is_diverging());
        let mut value = layers::describe(&map.metric, &map.label, &map.unit, map.kind, map.values);
        value["scale"] = layers::scale(&view, map.map);
        value
    });
    let maps: Vec<Value> = scales
        .into_iter()
        .zip(planes)
        .map(|(mut value, plane)| {
            layers::note_shrink(&mut value["scale"], &plane);
            value["plane"] = plane;
            value
        })
        .collect();
    let boxes: Vec<Value> = input
        .hotspots
        .iter()
        .take(CARDS)
        .map(|spot| {
            let b = spot.bbox;
            let (x, y) = (b.x.min(width.saturating_sub(1)), b.y.min(height.saturating_sub(1)));
            json!({ "x": x, "y": y, "width": b.width.min(width - x), "height": b.height.min(height - y) })
        })
        .collect();
    let value = json!({
        "width": width,
        "height": height,
        "tables": layers::tables(),
        "maps": maps,
        "objects": input.objects.as_ref().map(|o| layers::objects(width, height, o)),
        "materials": input.materials.as_ref().map(|o| layers::objects(width, height, o)),
        "spots": (input.hotspot_pixels.len() == width as usize * height as usize && !input.hotspot_pixels.is_empty())
            .then(|| codec::identifiers(width, height, input.hotspot_pixels)),
        "hotspots": boxes,
    });
    (value, grains)
}

/// Most commands on a card.
const TRIES: usize = 4;

fn cards(hotspots: &[HotspotCard]) -> String {
    if hotspots.is_empty() {
        return String::new();
    }
    let mut out = String::from("<section class=\"block\"><h2>Where to act</h2><div class=\"cards\">");
    for spot in hotspots {
        let share = |value: f64| if value.is_finite() { value.clamp(0.0, 1.0) * 100.0 } else { 0.0 };
        let _ = write!(
            out,
            "<article class=\"card\"><div class=\"crops\"><canvas role=\"img\" aria-label=\"Crop of the picture\">\
             </canvas><canvas role=\"img\" aria-label=\"Crop of the cost map\"></canvas></div><div class=\"text\">\
             <h3><span>{}</span>{}</h3><div class=\"meter\">\
             cost<i style=\"--share:{:.1}%\"></i><b>{}</b>pixels<i class=\"pixels\" style=\"--share:{:.1}%\"></i><b>{}</b>\
             </div>",
            spot.rank,
            escape::name(&spot.name, NAME),
            share(spot.cost_share),
            parts::percent(spot.cost_share),
            share(spot.pixel_share),
            parts::percent(spot.pixel_share),
        );
        if !spot.cause.is_empty() {
            let _ = write!(out, "<p>{}</p>", escape::name(&spot.cause, TEXT));
        }
        if !spot.fix.is_empty() {
            let _ = write!(out, "<p class=\"fix\"><b>Try:</b> {}</p>", escape::name(&spot.fix, TEXT));
        }
        if !spot.tries.is_empty() {
            out.push_str("<ul class=\"tries\">");
            for tried in spot.tries.iter().take(TRIES) {
                let _ = write!(out, "<li><code>{}</code>", escape::name(&tried.command, TEXT));
                if !tried.measured.is_empty() {
                    let _ = write!(out, " <b>{}</b>", escape::name(&tried.measured, TEXT));
                }
                out.push_str("</li>");
            }
            out.push_str("</ul>");
        }
        if !spot.factors.is_empty() {
            out.push_str("<ul class=\"chips\">");
            for fact in spot.factors.iter().take(12) {
                let (label, value) = (escape::name(&fact.label, NAME), escape::name(&fact.value, NAME));
                let _ = write!(out, "<li>{label} <b>{value}</b></li>");
            }
            out.push_str("</ul>");
        }
        out.push_str(
            "<button type=\"button\" class=\"show\" aria-pressed=\"false\">Show in the pictures</button>\
             </div></article>",
        );
    }
    out + "</div></section>"
}

/// Most rows of a ledger on the page; the JSON and the CSV files have the others.
const LEDGER_ROWS: usize = 12;

fn ledgers(tables: &[LedgerTable]) -> String {
    if tables.iter().all(|table| table.rows.is_empty()) {
        return String::new();
    }
    let mut out = String::from(
        "<section class=\"block\"><h2>Who sends the rays, who is met</h2><div class=\"ledgers\">",
    );
    for table in tables.iter().filter(|table| !table.rows.is_empty()) {
        let kind = if table.materials { "materials" } else { "objects" };
        let _ = write!(
            out,
            "<div class=\"ledger\"><h3>{}</h3><p class=\"small\">{}</p><ul>",
            escape::name(&table.title, NAME),
            escape::name(&table.note, TEXT)
        );
        for row in table.rows.iter().take(LEDGER_ROWS) {
            let name = escape::name(&row.name, NAME);
            let share = if row.share.is_finite() { row.share.clamp(0.0, 1.0) } else { 0.0 };
            let label = match row.id {
                Some(id) => format!(
                    "<button type=\"button\" data-kind=\"{kind}\" data-id=\"{id}\" aria-pressed=\"false\" \
                     title=\"Show its pixels\">{name}</button>"
                ),
                None => format!("<span>{name}</span>"),
            };
            let _ = write!(
                out,
                "<li>{label}<i style=\"--share:{:.1}%\"></i><b>{}</b><small>{}</small></li>",
                share * 100.0,
                parts::percent(row.share),
                escape::name(&row.detail, NAME)
            );
        }
        if table.rows.len() > LEDGER_ROWS {
            let rest: f64 = table.rows[LEDGER_ROWS..].iter().map(|row| row.share).sum();
            let _ = write!(
                out,
                "<li><span>{} others</span><i style=\"--share:{:.1}%\"></i><b>{}</b><small></small></li>",
                table.rows.len() - LEDGER_ROWS,
                rest * 100.0,
                parts::percent(rest)
            );
        }
        out.push_str("</ul></div>");
    }
    out + "</div></section>"
}

fn notices(input: &ReportInput<'_>) -> String {
    parts::notice("Used by the scene, not modelled by the renderer", &input.unmodelled)
        + &parts::notice("Repaired on loading", &input.repairs)
}

fn totals(rows: &[TotalRow]) -> String {
    let rows: Vec<_> = rows
        .iter()
        .map(|row| {
            let interval = row.ci95.map_or(String::new(), |[lo, hi]| {
                let kind = if row.ci_kind.is_empty() { String::new() } else { format!(" ({})", row.ci_kind) };
                format!("{} to {}{kind}", precise(lo), precise(hi))
            });
            ("", vec![row.label.clone(), precise(row.mean), interval, row.sum.clone()])
        })
        .collect();
    let table = parts::table("", &["total", "mean per path", "95 % interval", "sum over the frame"], &rows);
    if table.is_empty() { table } else { format!("<h2>Totals</h2>{table}") }
}

/// Five significant digits: intervals are narrower than what a glance needs.
pub(super) fn precise(value: f64) -> String {
    let size = value.abs();
    if !value.is_finite() {
        "–".into()
    } else if size == 0.0 {
        "0".into()
    } else if (1e-4..1e9).contains(&size) {
        format!("{value:.*}", (4.0 - size.log10().floor()).clamp(0.0, 9.0) as usize)
    } else {
        format!("{value:.4e}")
    }
}

#[cfg(test)]
#[path = "page_tests.rs"]
mod tests;
