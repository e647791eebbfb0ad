//! The outputs of a render, and of its EXR read again.

use super::words::{altered, facts, kind, note, totals, unit_in};
use super::{MAIN, Writer, Written, tone_mapped};
use crate::fail::Fail;
use crate::ledgers::ledger_tables;
use hotspot_cost::document::View;
use hotspot_cost::exr_io::{self, Header};
use hotspot_cost::maps::{Beauty, HeatOptions, encode_png, heat_map, write_atomic};
use hotspot_cost::report::{CardTry, Fact, HotspotCard, MapLayer, ObjectLayer, ReportInput, html};
use hotspot_cost::{Document, Layers, Ledgers, Metric, Rect, WhatIf, hotspots};
use rayon::prelude::*;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::Path;

/// A render to be written.
pub(crate) struct Output<'a> {
    pub(crate) stem: &'a str,
    pub(crate) layers: &'a Layers,
    pub(crate) document: &'a mut Document,
    pub(crate) header: Header,
    /// First-hit object of each pixel; empty when unknown.
    pub(crate) objects: &'a [u32],
    pub(crate) object_names: &'a [String],
    /// First-hit material of each pixel; empty when unknown.
    pub(crate) materials: &'a [u32],
    pub(crate) material_names: &'a [String],
    /// Triangles of each object; empty when unknown.
    pub(crate) object_triangles: &'a [u64],
    /// Whole, for the CSV files.
    pub(crate) ledgers: Option<&'a Ledgers>,
    pub(crate) write_exr: bool,
}

/// What the page of a render is made from, but for the picture.
#[derive(Clone, Copy)]
struct PageParts<'a> {
    title: &'a str,
    layers: &'a Layers,
    document: &'a Document,
    objects: &'a [u32],
    object_names: &'a [String],
    materials: &'a [u32],
    material_names: &'a [String],
    object_triangles: &'a [u64],
}

impl Writer<'_> {
    /// Writes all outputs of a render. Works in the caller's thread pool.
    pub(crate) fn render(&self, output: Output<'_>) -> Result<Written, Fail> {
        let Output {
            stem,
            layers,
            document,
            header,
            objects,
            object_names,
            materials,
            material_names,
            object_triangles,
            ledgers,
            write_exr,
        } = output;
        let path = |suffix: &str| self.folder.join(format!("{stem}{suffix}"));
        self.remove_stale_maps(stem);

        // Drawn first, since the JSON says what they altered; written last, since only the layers cannot be made again.
        let mut pictures = Vec::new();
        document.views.clear();
        let picture = tone_mapped(layers, self.views.exposure);
        if let Some(picture) = &picture {
            let file = path(".png");
            document.views.push(View {
                file: file_name(&file),
                exposure_ev: Some(picture.ev.into()),
                ..View::default()
            });
            pictures.push((file, Cow::Borrowed(&picture.image), "the picture".to_owned()));
        }
        let draw = |metric: Metric| {
            let options = HeatOptions {
                label: metric.label().to_owned(),
                unit: unit_in(document, metric),
                map: self.views.colors.map(),
                scale: self.scale(metric.name()),
                despike: metric == Metric::TimeUs,
            };
            Some((metric, heat_map(layers.width, layers.height, layers.metric(metric)?, &options)))
        };
        let maps: Vec<_> = self.shown(layers).into_par_iter().filter_map(draw).collect();
        for (metric, map) in maps {
            let file = path(&format!(".{}.png", metric.layer()));
            document.views.push(View {
                file: file_name(&file),
                metric: Some(metric.name().to_owned()),
                scale: Some([map.lo.into(), map.hi.into()]),
                exposure_ev: None,
                altered: altered(&map),
            });
            pictures.push((file, Cow::Owned(map.image), format!("heat map, {}", metric.label())));
        }

        let mut files = Vec::new();
        let json = document.to_json();
        let page = path(".html");
        let parts = PageParts {
            title: stem,
            layers,
            document,
            objects,
            object_names,
            materials,
            material_names,
            object_triangles,
        };
        // Side by side, but for the order in which files come to be.
        let exr = path(".exr");
        let write_layers = || {
            if write_exr {
                exr_io::write(&exr, layers, &Header { json: json.clone(), ..header })
            } else {
                Ok(())
            }
        };
        let pngs = || pictures.par_iter().map(|(_, image, _)| encode_png(image)).collect::<Vec<_>>();
        let text = || self.page(&parts, picture.as_ref());
        let (written, (pngs, text)) = rayon::join(write_layers, || rayon::join(pngs, text));
        written?;
        if write_exr {
            files.push(format!("{}: radiance and every cost layer", exr.display()));
        }
        let file = path(".json");
        write_atomic(&file, json.as_bytes())?;
        files.push(format!("{}: totals, hotspots and settings", file.display()));
        if let Some(ledgers) = ledgers {
            for (ledger, text, what) in [
                ("spawner", ledgers.spawner_csv(), "cost by what sent the rays"),
                ("payer", ledgers.payer_csv(), "cost by what they met"),
                ("matrix", ledgers.matrix_csv(), "cost by both"),
            ] {
                let file = path(&format!(".ledger.{ledger}.csv"));
                write_atomic(&file, text.as_bytes())?;
                files.push(format!("{}: {what}", file.display()));
            }
        }
        for ((file, _, what), png) in pictures.iter().zip(pngs) {
            write_atomic(file, &png?)?;
            files.push(format!("{}: {what}", file.display()));
        }
        write_atomic(&page, text.as_bytes())?;
        files.push(format!("{}: the report", page.display()));
        Ok(Written { files, page })
    }

    /// Removes the pictures and tables of an earlier render of this name, so that none stays beside a JSON that does not know it. What
    /// cannot be removed is about to be overwritten or reported.
    fn remove_stale_maps(&self, stem: &str) {
        for metric in Metric::ALL {
            let _ = std::fs::remove_file(self.folder.join(format!("{stem}.{}.png", metric.layer())));
        }
        for suffix in ["png", "ledger.spawner.csv", "ledger.payer.csv", "ledger.matrix.csv"] {
            let _ = std::fs::remove_file(self.folder.join(format!("{stem}.{suffix}")));
        }
    }

    /// What `whatif` measured of this scene, by option, where its document lies in the same folder and speaks of the same tree.
    /// Whatever is wrong with that file is no fault of this render.
    fn measured(&self, document: &Document) -> BTreeMap<String, String> {
        let file = self.folder.join(format!("{}.whatif.json", document.scene));
        let text = std::fs::read_to_string(&file).unwrap_or_default();
        match WhatIf::from_json(&text, &file.display().to_string()) {
            Ok(whatif) if !whatif.tree.is_empty() && whatif.tree == document.tree.digest => {
                whatif.by_option().map(|(option, words)| (option.to_owned(), words)).collect()
            }
            _ => BTreeMap::new(),
        }
    }

    fn page(&self, parts: &PageParts<'_>, picture: Option<&Beauty>) -> String {
        let PageParts { title, layers, document, object_triangles, .. } = *parts;
        let measured = self.measured(document);
        let blank = || image::RgbImage::from_pixel(layers.width, layers.height, image::Rgb([40, 40, 44]));
        let beauty = picture.map_or_else(|| Cow::Owned(blank()), |picture| Cow::Borrowed(&picture.image));
        let mut metrics: Vec<Metric> = MAIN.into_iter().filter(|m| layers.metric(*m).is_some()).collect();
        for metric in layers.metrics() {
            if !metrics.contains(&metric) {
                metrics.push(metric);
            }
        }
        let maps = metrics
            .iter()
            .filter_map(|&metric| {
                Some(MapLayer {
                    metric: metric.name().to_owned(),
                    label: metric.label().to_owned(),
                    unit: unit_in(document, metric),
                    kind: kind(metric),
                    values: layers.metric(metric)?,
                    scale: self.scale(metric.name()),
                    map: self.views.colors.map(),
                    despike: metric == Metric::TimeUs,
                })
            })
            .collect();
        html(&ReportInput {
            title: title.to_owned(),
            verdict: document.verdict.clone(),
            beauty: &beauty,
            maps,
            objects: named(parts.objects, parts.object_names),
            materials: named(parts.materials, parts.material_names),
            hotspot_pixels: &hotspot_pixels(document, layers.pixels()),
            ledgers: document
                .ledgers
                .as_ref()
                .map_or_else(Vec::new, |ledgers| ledger_tables(ledgers, document.cost_model)),
            hotspots: document
                .hotspots
                .iter()
                .map(|hotspot| card(hotspot, object_triangles, &measured))
                .collect(),
            facts: facts(document),
            totals: totals(document),
            unmodelled: document.unmodelled.iter().map(note).collect(),
            repairs: document.repairs.iter().map(note).collect(),
            raw_json: without_ledgers(document),
        })
    }
}

/// The JSON for the page, which has the ledgers as tables: their rows alone are as large as several layers.
fn without_ledgers(document: &Document) -> String {
    Document { ledgers: None, ..document.clone() }.to_json()
}

/// A plane of names for the read-out; `None` without one.
pub(super) fn named<'a>(ids: &'a [u32], names: &[String]) -> Option<ObjectLayer<'a>> {
    (!ids.is_empty()).then(|| ObjectLayer { ids, names: names.to_vec() })
}

fn file_name(path: &Path) -> String {
    path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned())
}

/// The command that tries an option.
pub(super) fn whatif_command(option: &str) -> String {
    format!("hotspot-render whatif SCENE {option}")
}

fn card(
    hotspot: &hotspot_cost::Hotspot,
    object_triangles: &[u64],
    measured: &BTreeMap<String, String>,
) -> HotspotCard {
    let triangles = hotspot.object.and_then(|object| object_triangles.get(object as usize)).copied();
    let [left, top, right, bottom] = hotspot.bbox;
    let f = &hotspot.factors;
    let factors = [
        ("Cost", f.cost),
        ("Vertices per path", f.vertices_per_path),
        ("Rays per vertex", f.rays_per_vertex),
        ("Nodes per ray", f.nodes_per_ray),
        ("Triangles per ray", f.shapes_per_ray),
    ];
    let mut facts: Vec<Fact> = factors
        .into_iter()
        .filter_map(|(label, factor)| Some(Fact::new(label, format!("{:.2}×", factor?))))
        .collect();
    if let Some(waste) = f.waste_share {
        facts.push(Fact::new("In vain", format!("{:.0} %", waste * 100.0)));
    }
    HotspotCard {
        rank: hotspot.rank as u32,
        name: hotspot.name.clone().unwrap_or_else(|| "background".into()),
        bbox: Rect { x: left, y: top, width: right - left, height: bottom - top },
        pixel_share: hotspot.pixel_share,
        cost_share: hotspot.cost_share,
        cause: hotspot.cause.clone(),
        fix: if hotspot.fix.is_empty() && hotspot.sounded == 0 {
            hotspots::fix(hotspot, triangles)
        } else {
            hotspot.fix.clone()
        },
        tries: hotspot
            .whatif
            .iter()
            .map(|option| CardTry {
                command: whatif_command(option),
                measured: measured.get(option).cloned().unwrap_or_default(),
            })
            .collect(),
        factors: facts,
    }
}

/// Per pixel the rank of its hotspot, 0 for none.
fn hotspot_pixels(document: &Document, pixels: usize) -> Vec<u16> {
    let mut ranks = vec![0; pixels];
    for hotspot in &document.hotspots {
        for index in &hotspot.members {
            if let Some(rank) = ranks.get_mut(*index as usize) {
                *rank = u16::try_from(hotspot.rank).unwrap_or(u16::MAX);
            }
        }
    }
    if document.hotspots.iter().all(|h| h.members.is_empty()) { Vec::new() } else { ranks }
}
