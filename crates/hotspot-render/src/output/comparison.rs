//! The outputs of a comparison of two renders.

use super::render::named;
use super::words::{kind, labelled, pair_facts, unit};
use super::{MAIN, Writer, Written, tone_mapped};
use crate::args::MapsArg;
use crate::fail::Fail;
use hotspot_cost::maps::{
    ColorMap, DEFAULT_CLIP, Exposure, HeatOptions, Scale, heat_map, write_atomic, write_png,
};
use hotspot_cost::report::{
    ChangeRow, CompareInput, CompareLayer, Side as PageSide, SuggestionRow, compare_html,
};
use hotspot_cost::whatif::{Suggestion, image_in_words, with_interval};
use hotspot_cost::{Comparison, Layers, Metric, Side};

/// How a comparison is called, what it says, and its JSON.
pub(crate) struct Pair<'a> {
    pub(crate) stem: &'a str,
    pub(crate) verdict: String,
    pub(crate) json: String,
    /// What was tried; empty for a comparison.
    pub(crate) suggestions: &'a [Suggestion],
}

impl Writer<'_> {
    /// Writes all outputs of a comparison.
    pub(crate) fn comparison(
        &self,
        a: &Side<'_>,
        b: &Side<'_>,
        comparison: &Comparison,
    ) -> Result<Written, Fail> {
        let verdict = comparison_verdict(comparison);
        let pair = Pair { stem: "compare", verdict, json: comparison.to_json(), suggestions: &[] };
        self.pair(a, b, comparison, pair)
    }

    /// The same under another name.
    pub(crate) fn pair(
        &self,
        a: &Side<'_>,
        b: &Side<'_>,
        comparison: &Comparison,
        pair: Pair<'_>,
    ) -> Result<Written, Fail> {
        let Pair { stem, .. } = pair;
        let mut files = Vec::new();
        let (width, height) = (comparison.layers.width, comparison.layers.height);
        let metrics: Vec<Metric> = match self.views.maps {
            MapsArg::Main => MAIN.to_vec(),
            MapsArg::All => Metric::ALL.to_vec(),
        }
        .into_iter()
        .filter(|m| comparison.layers.plane(&format!("diff.{}", m.name())).is_some())
        .filter(|m| is_mapped(*m, a.layers, b.layers))
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
        write_atomic(&file, pair.json.as_bytes())?;
        files.push(format!("{}: changes with their intervals", file.display()));
        let page = self.folder.join(format!("{stem}.html"));
        write_atomic(&page, self.comparison_page(a, b, comparison, pair).as_bytes())?;
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

    fn comparison_page(&self, a: &Side<'_>, b: &Side<'_>, comparison: &Comparison, pair: Pair<'_>) -> String {
        let Pair { verdict, json, suggestions, .. } = pair;
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
            .filter(|(metric, _)| is_mapped(**metric, a.layers, b.layers))
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
                if *metric == Metric::TimeUs && change.a == 0.0 && change.b == 0.0 {
                    return None;
                }
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
        let [objects, materials] = &self.seen;
        compare_html(&CompareInput {
            title: format!("{} against {}", comparison.a, comparison.b),
            verdict,
            a: PageSide { name: comparison.a.clone(), beauty: &beauty_a },
            b: PageSide { name: comparison.b.clone(), beauty: &beauty_b },
            maps,
            totals,
            objects: named(&objects.ids, &objects.names),
            materials: named(&materials.ids, &materials.names),
            suggestions: suggestions.iter().map(row).collect(),
            facts: pair_facts(a.document, b.document),
            notes: comparison.notes.clone(),
            raw_json: json,
        })
    }
}

fn row(suggestion: &Suggestion) -> SuggestionRow {
    let doubt = |significant: Option<bool>| if significant == Some(false) { ", not significant" } else { "" };
    SuggestionRow {
        what: suggestion.what.clone(),
        reason: suggestion.reason.clone(),
        command: super::render::whatif_command(&suggestion.option),
        cost: suggestion.relative.map_or_else(String::new, |relative| {
            format!("{}{}", with_interval(relative, suggestion.ci95), doubt(suggestion.significant))
        }),
        time: suggestion.time.map_or_else(String::new, |time| {
            format!("{}{}", with_interval(time.relative, time.ci95), doubt(time.significant()))
        }),
        picture: image_in_words(&suggestion.image).unwrap_or_default(),
    }
}

/// Whether there is anything to draw. `whatif` times whole renders by themselves: its counted ones have no time per pixel.
fn is_mapped(metric: Metric, a: &Layers, b: &Layers) -> bool {
    let timed = |layers: &Layers| layers.metric(metric).is_some_and(|plane| plane.iter().any(|v| *v > 0.0));
    metric != Metric::TimeUs || timed(a) || timed(b)
}

/// What a comparison says in one sentence.
fn comparison_verdict(comparison: &Comparison) -> String {
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
            "{} takes {:.2} % {direction} {label} than {}{}",
            comparison.b,
            relative.abs() * 100.0,
            comparison.a,
            if tested.is_none() { " (not tested: render with --intervals)" } else { &interval }
        ),
    }
}
