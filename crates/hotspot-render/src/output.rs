//! Writes what a command made: EXR, JSON, PNGs and the page.

use crate::args::{MapsArg, ScaleArg, ViewArgs};
use crate::commands::make_folder;
use crate::fail::{FAILED, Fail};
use crate::ledgers::ledger_tables;
use hotspot_cost::document::View;
use hotspot_cost::exr_io::{self, Header};
use hotspot_cost::maps::{
    Beauty, ColorMap, DEFAULT_CLIP, Exposure, HeatMap, HeatOptions, Scale, beauty, heat_map, write_atomic,
    write_png,
};
use hotspot_cost::report::{
    ChangeRow, CompareInput, CompareLayer, Fact, HotspotCard, MapLayer, ObjectLayer, PairFact, ReportInput,
    Side as PageSide, TotalRow, ValueKind, compare_html, html,
};
use hotspot_cost::{CiKind, Comparison, Document, Layers, Ledgers, Metric, Rect, Side, Sum, hotspots};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The maps of the first screen.
const MAIN: [Metric; 3] = [Metric::Intersection, Metric::Rays, Metric::TimeUs];

/// A folder and how to draw into it.
pub(crate) struct Writer<'a> {
    folder: &'a Path,
    views: &'a ViewArgs,
    /// Ranges by metric, from `--scale FILE`.
    ranges: BTreeMap<String, [f64; 2]>,
}

/// A render to be written.
pub(crate) struct Output<'a> {
    pub(crate) stem: &'a str,
    pub(crate) layers: &'a Layers,
    pub(crate) document: &'a mut Document,
    pub(crate) header: Header,
    /// First-hit object of each pixel; empty when unknown.
    pub(crate) objects: &'a [u32],
    pub(crate) object_names: &'a [String],
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
    object_triangles: &'a [u64],
}

/// How a comparison is called, what it says, and its JSON.
pub(crate) struct Pair<'a> {
    pub(crate) stem: &'a str,
    pub(crate) verdict: String,
    pub(crate) json: String,
}

/// What was written.
pub(crate) struct Written {
    /// "path: what it is", in order.
    pub(crate) files: Vec<String>,
    pub(crate) page: PathBuf,
}

/// The stem of a path, for naming outputs.
pub(crate) fn stem(path: &Path) -> String {
    path.file_stem().map_or_else(|| "render".into(), |s| s.to_string_lossy().into_owned())
}

impl<'a> Writer<'a> {
    /// Makes the folder and reads the ranges of `--scale FILE`.
    pub(crate) fn new(folder: &'a Path, views: &'a ViewArgs) -> Result<Self, Fail> {
        make_folder(folder)?;
        let ranges = match &views.scale {
            Some(ScaleArg::File(file)) => {
                let place = file.display().to_string();
                let text = std::fs::read_to_string(file)
                    .map_err(|e| Fail::new(FAILED, format!("--scale: cannot read {place}: {e}")))?;
                let document = Document::from_json(&text, &place)?;
                document.views.into_iter().filter_map(|v| Some((v.metric?, v.scale?))).collect()
            }
            _ => BTreeMap::new(),
        };
        Ok(Self { folder, views, ranges })
    }

    fn scale(&self, metric: &str) -> Scale {
        match (&self.views.scale, self.ranges.get(metric)) {
            (Some(ScaleArg::Fixed(lo, hi)), _) => ScaleArg::fixed(*lo, *hi),
            (_, Some([lo, hi])) => Scale::Fixed(*lo as f32, *hi as f32),
            _ => Scale::Auto { clip_percentile: DEFAULT_CLIP },
        }
    }

    fn shown(&self, layers: &Layers) -> Vec<Metric> {
        let present: Vec<Metric> = layers.metrics().collect();
        match self.views.maps {
            MapsArg::All => present,
            MapsArg::Main => MAIN.into_iter().filter(|m| present.contains(m)).collect(),
        }
    }

    /// Writes all outputs of a render.
    pub(crate) fn render(&self, output: Output<'_>) -> Result<Written, Fail> {
        let Output {
            stem,
            layers,
            document,
            header,
            objects,
            object_names,
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
            pictures.push((file, picture.image.clone(), "the picture".to_owned()));
        }
        for metric in self.shown(layers) {
            let Some(values) = layers.metric(metric) else { continue };
            let file = path(&format!(".{}.png", metric.layer()));
            let options = HeatOptions {
                label: metric.label().to_owned(),
                unit: unit_in(document, metric),
                map: self.views.colors.map(),
                scale: self.scale(metric.name()),
                despike: metric == Metric::TimeUs,
            };
            let map = heat_map(layers.width, layers.height, values, &options);
            document.views.push(View {
                file: file_name(&file),
                metric: Some(metric.name().to_owned()),
                scale: Some([map.lo.into(), map.hi.into()]),
                exposure_ev: None,
                altered: altered(&map),
            });
            pictures.push((file, map.image, format!("heat map, {}", metric.label())));
        }

        let mut files = Vec::new();
        let json = document.to_json();
        if write_exr {
            let file = path(".exr");
            exr_io::write(&file, layers, &Header { json: json.clone(), ..header })?;
            files.push(format!("{}: radiance and every cost layer", file.display()));
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
        for (file, image, what) in pictures {
            write_png(&file, &image)?;
            files.push(format!("{}: {what}", file.display()));
        }
        let page = path(".html");
        let text = self.page(
            &PageParts { title: stem, layers, document, objects, object_names, object_triangles },
            picture,
            json,
        );
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

    fn page(&self, parts: &PageParts<'_>, picture: Option<Beauty>, json: String) -> String {
        let PageParts { title, layers, document, objects, object_names, object_triangles } = *parts;
        let beauty = picture.map_or_else(
            || image::RgbImage::from_pixel(layers.width, layers.height, image::Rgb([40, 40, 44])),
            |p| p.image,
        );
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
            objects: (!objects.is_empty())
                .then(|| ObjectLayer { ids: objects, names: object_names.to_vec() }),
            materials: None,
            hotspot_pixels: &hotspot_pixels(document, layers.pixels()),
            ledgers: document
                .ledgers
                .as_ref()
                .map_or_else(Vec::new, |ledgers| ledger_tables(ledgers, document.cost_model)),
            hotspots: document.hotspots.iter().map(|hotspot| card(hotspot, object_triangles)).collect(),
            facts: facts(document),
            totals: totals(document),
            unmodelled: document.unmodelled.iter().map(note).collect(),
            repairs: document.repairs.iter().map(note).collect(),
            raw_json: json,
        })
    }

    /// Writes all outputs of a comparison.
    pub(crate) fn comparison(
        &self,
        a: &Side<'_>,
        b: &Side<'_>,
        comparison: &Comparison,
    ) -> Result<Written, Fail> {
        let verdict = comparison_verdict(comparison);
        self.pair(a, b, comparison, Pair { stem: "compare", verdict, json: comparison.to_json() })
    }

    /// The same under another name.
    pub(crate) fn pair(
        &self,
        a: &Side<'_>,
        b: &Side<'_>,
        comparison: &Comparison,
        pair: Pair<'_>,
    ) -> Result<Written, Fail> {
        let Pair { stem, verdict, json } = pair;
        let mut files = Vec::new();
        let (width, height) = (comparison.layers.width, comparison.layers.height);
        let metrics: Vec<Metric> = match self.views.maps {
            MapsArg::Main => MAIN.to_vec(),
            MapsArg::All => Metric::ALL.to_vec(),
        }
        .into_iter()
        .filter(|m| comparison.layers.plane(&format!("diff.{}", m.name())).is_some())
        .collect();
        for &metric in &metrics {
            // Both renders on one scale, then their difference, absolute and relative.
            let range = self.shared_range(a.layers, b.layers, metric);
            for (side, layers) in [("a", a.layers), ("b", b.layers)] {
                let Some(values) = layers.metric(metric) else { continue };
                self.map(
                    &mut files,
                    &format!("{stem}.{side}.{}", metric.name()),
                    width,
                    height,
                    values,
                    HeatOptions {
                        label: format!("{} ({})", metric.label(), side.to_uppercase()),
                        unit: unit(metric),
                        map: self.views.colors.map(),
                        scale: range,
                        despike: metric == Metric::TimeUs,
                    },
                )?;
            }
            for (kind, unit) in [("diff", unit(metric)), ("relative", "relative to A".to_owned())] {
                let Some(values) = comparison.layers.plane(&format!("{kind}.{}", metric.name())) else {
                    continue;
                };
                self.map(
                    &mut files,
                    &format!("{stem}.{kind}.{}", metric.name()),
                    width,
                    height,
                    values,
                    HeatOptions {
                        label: format!("{}: B - A", metric.label()),
                        unit,
                        map: ColorMap::RedBlue,
                        scale: Scale::Auto { clip_percentile: DEFAULT_CLIP },
                        despike: metric == Metric::TimeUs,
                    },
                )?;
            }
        }
        let file = self.folder.join(format!("{stem}.json"));
        write_atomic(&file, json.as_bytes())?;
        files.push(format!("{}: changes with their intervals", file.display()));
        let page = self.folder.join(format!("{stem}.html"));
        write_atomic(&page, self.comparison_page(a, b, comparison, verdict, json).as_bytes())?;
        files.push(format!("{}: the report", page.display()));
        Ok(Written { files, page })
    }

    fn map(
        &self,
        files: &mut Vec<String>,
        name: &str,
        width: u32,
        height: u32,
        values: &[f32],
        options: HeatOptions,
    ) -> Result<(), Fail> {
        let file = self.folder.join(format!("{name}.png"));
        let what = options.label.clone();
        write_png(&file, &heat_map(width, height, values, &options).image)?;
        files.push(format!("{}: heat map, {what}", file.display()));
        Ok(())
    }

    /// One scale for both renders.
    fn shared_range(&self, a: &Layers, b: &Layers, metric: Metric) -> Scale {
        match self.scale(metric.name()) {
            Scale::Fixed(lo, hi) => Scale::Fixed(lo, hi),
            scale @ Scale::Auto { .. } => {
                let (Some(a_values), Some(b_values)) = (a.metric(metric), b.metric(metric)) else {
                    return scale;
                };
                let despike = metric == Metric::TimeUs;
                let range = |values: &[f32]| {
                    let v = hotspot_cost::maps::view(a.width, a.height, values, scale, despike, false);
                    (v.lo, v.hi)
                };
                let ((lo_a, hi_a), (lo_b, hi_b)) = (range(a_values), range(b_values));
                Scale::Fixed(lo_a.min(lo_b), hi_a.max(hi_b))
            }
        }
    }

    fn comparison_page(
        &self,
        a: &Side<'_>,
        b: &Side<'_>,
        comparison: &Comparison,
        verdict: String,
        json: String,
    ) -> String {
        // One exposure for both, A's where it is automatic.
        let picture_a = tone_mapped(a.layers, self.views.exposure);
        let exposure = picture_a.as_ref().map_or(self.views.exposure, |p| Exposure::Ev(p.ev));
        let picture_b = tone_mapped(b.layers, exposure);
        let blank = || image::RgbImage::from_pixel(a.layers.width, a.layers.height, image::Rgb([40, 40, 44]));
        let (beauty_a, beauty_b) =
            (picture_a.map_or_else(blank, |p| p.image), picture_b.map_or_else(blank, |p| p.image));
        let metrics: Vec<Metric> = MAIN
            .into_iter()
            .chain(Metric::ALL.into_iter().filter(|m| !MAIN.contains(m)))
            .filter(|m| a.layers.metric(*m).is_some() && b.layers.metric(*m).is_some())
            .collect();
        let flags: Vec<Option<Vec<bool>>> = metrics
            .iter()
            .map(|m| {
                let plane = comparison.layers.plane(&format!("significant.{}", m.name()))?;
                Some(plane.iter().map(|v| *v > 0.5).collect())
            })
            .collect();
        let maps = metrics
            .iter()
            .zip(&flags)
            .filter_map(|(&metric, significant)| {
                Some(CompareLayer {
                    metric: metric.name().to_owned(),
                    label: metric.label().to_owned(),
                    unit: unit(metric),
                    kind: kind(metric),
                    a: a.layers.metric(metric)?,
                    b: b.layers.metric(metric)?,
                    scale: self.scale(metric.name()),
                    map: self.views.colors.map(),
                    difference: Scale::Auto { clip_percentile: DEFAULT_CLIP },
                    despike: metric == Metric::TimeUs,
                    significant: significant.as_deref(),
                })
            })
            .collect();
        let totals = metrics
            .iter()
            .filter_map(|metric| {
                let change = comparison.totals.get(metric.name())?;
                Some(ChangeRow {
                    label: labelled(*metric),
                    a: change.a,
                    b: change.b,
                    relative: change.relative?,
                    ci95: change.ci95,
                    significant: change.significant,
                })
            })
            .collect();
        compare_html(&CompareInput {
            title: format!("{} against {}", comparison.a, comparison.b),
            verdict,
            a: PageSide { name: comparison.a.clone(), beauty: &beauty_a },
            b: PageSide { name: comparison.b.clone(), beauty: &beauty_b },
            maps,
            totals,
            facts: pair_facts(a.document, b.document),
            notes: comparison.notes.clone(),
            raw_json: json,
        })
    }
}

/// What a comparison says in one sentence.
pub(crate) fn comparison_verdict(comparison: &Comparison) -> String {
    let headline = [Metric::Intersection, Metric::Nodes, Metric::Rays, Metric::TimeUs];
    let found = headline.iter().find_map(|m| Some((m, comparison.totals.get(m.name())?)));
    let Some((metric, change)) = found else { return "The renders share no metric".into() };
    let Some(relative) = change.relative else { return format!("{} is 0 in A", metric.label()) };
    let label = metric.label().to_lowercase();
    let direction = if relative > 0.0 { "more" } else { "less" };
    let interval = change.ci95.map_or(String::new(), |[lo, hi]| {
        format!(" (95 % interval {:+.2} % to {:+.2} %)", lo * 100.0, hi * 100.0)
    });
    match change.significant {
        _ if change.delta == 0.0 => format!("{label}: exactly the same in both"),
        Some(false) => format!("No significant change of {label}: {:+.2} %{interval}", relative * 100.0),
        tested => format!(
            "{} costs {:.2} % {direction} {label} than {}{}",
            comparison.b,
            relative.abs() * 100.0,
            comparison.a,
            if tested.is_none() { " (not tested: render with --intervals)" } else { &interval }
        ),
    }
}

/// What a heat map's view altered, in words.
fn altered(map: &HeatMap) -> Vec<String> {
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

fn file_name(path: &Path) -> String {
    path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned())
}

fn tone_mapped(layers: &Layers, exposure: Exposure) -> Option<Beauty> {
    let rgb = [layers.plane("R")?, layers.plane("G")?, layers.plane("B")?];
    Some(beauty(layers.width, layers.height, rgb, exposure))
}

const fn kind(metric: Metric) -> ValueKind {
    match metric {
        Metric::Escaped | Metric::Absorbed | Metric::Roulette | Metric::DepthLimit => ValueKind::Share,
        _ => ValueKind::Amount,
    }
}

fn unit(metric: Metric) -> String {
    metric.unit().to_owned()
}

/// The unit within a render, whose c0 and c1 may be calibrated.
fn unit_in(document: &Document, metric: Metric) -> String {
    match &document.cost_unit {
        Some(calibrated) if metric.is_weighted() => calibrated.clone(),
        _ => unit(metric),
    }
}

fn labelled(metric: Metric) -> String {
    let unit = metric.unit();
    if unit.is_empty() { metric.label().to_owned() } else { format!("{} ({unit})", metric.label()) }
}

fn card(hotspot: &hotspot_cost::Hotspot, object_triangles: &[u64]) -> HotspotCard {
    let triangles = hotspot.object.and_then(|object| object_triangles.get(object as usize)).copied();
    let [left, top, right, bottom] = hotspot.bbox;
    let f = &hotspot.factors;
    let factors = [
        ("Cost", f.cost),
        ("Rays per path", f.rays_per_path),
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
        fix: hotspots::fix(hotspot, triangles),
        factors: facts,
    }
}

fn facts(document: &Document) -> Vec<Fact> {
    let [width, height] = document.resolution;
    let mut facts = Vec::new();
    if document.samples_per_pixel > 0 {
        facts.push(Fact::new("Samples per pixel", document.samples_per_pixel));
    }
    facts.push(Fact::new("Size", format!("{width} × {height}")));
    if document.render.seconds > 0.0 {
        facts.push(Fact::new("Rendered in", format!("{:.2} s", document.render.seconds)));
    }
    if document.render.threads > 0 {
        facts.push(Fact::new("Threads", document.render.threads));
    }
    if document.tree.triangles > 0 {
        facts.push(Fact::new("Triangles", document.tree.triangles));
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

fn pair_facts(a: Option<&Document>, b: Option<&Document>) -> Vec<PairFact> {
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

fn totals(document: &Document) -> Vec<TotalRow> {
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

fn note(note: &hotspot_cost::document::Note) -> String {
    let times = if note.count > 1 { format!(" ({} times)", note.count) } else { String::new() };
    format!("{}: {}{times}", note.element, note.what)
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
