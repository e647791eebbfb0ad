//! What a change of the scene would do to its cost: `whatif.json`.
//!
//! Schema `hotspot-whatif/1`: a [`Comparison`] of the edited scene (B) with the scene as it is (A), and beside it the change, the
//! pictures' difference, the times, and the tree noise that is in the intervals.

use crate::compare::{Comparison, TotalChange};
use crate::metric::Metric;
use crate::picture_change::PictureChange;
use crate::repeats::RepeatChange;
use crate::stats::CiKind;
use crate::tree_noise::TreeNoise;
use serde::{Deserialize, Serialize};

/// The schema of [`WhatIf`].
pub const SCHEMA: &str = "hotspot-whatif/1";

/// The JSON Schema of [`WhatIf`].
pub const JSON_SCHEMA: &str = include_str!("../schema/hotspot-whatif-1.schema.json");

/// What a change would do.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct WhatIf {
    /// Changes of the totals, tested tiles, notes. Its `schema` is [`SCHEMA`].
    #[serde(flatten)]
    pub comparison: Comparison,
    /// The scene's name.
    pub scene: String,
    /// Fingerprint of the tree of the scene as it is, by which a render knows whether this speaks of the same scene. Empty when
    /// unknown.
    pub tree: String,
    /// Camera samples per pixel of both renders.
    pub samples_per_pixel: u64,
    /// Width and height in pixels.
    pub resolution: [u32; 2],
    /// What was changed; empty where suggestions alone were asked for.
    pub change: Change,
    /// How far the pictures differ.
    pub image: PictureChange,
    /// Seconds of sampling, uncounted, from interleaved repeats.
    pub time: Option<RepeatChange>,
    /// What the luck of the trees adds to the intervals; absent when not measured.
    pub tree_noise: Option<TreeNoise>,
    /// Changes tried by themselves, by falling saving.
    pub suggestions: Vec<Suggestion>,
}

/// A change of a scene or of a setting.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Change {
    /// In words.
    pub what: String,
    /// As options of the command line, one edit each.
    pub options: Vec<String>,
    /// What each edit met, in words.
    pub affected: Vec<String>,
    /// What the change does besides: lights that go, darkness.
    pub warnings: Vec<String>,
}

/// A change that was tried.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Suggestion {
    /// In words.
    pub what: String,
    /// As an option of the command line.
    pub option: String,
    /// Why it was tried.
    pub reason: String,
    /// Relative change of `intersection`: below 0 where it saves.
    pub relative: Option<f64>,
    /// Its 95 % interval, from sampling.
    pub ci95: Option<[f64; 2]>,
    /// Whether the interval leaves out 0.
    pub significant: Option<bool>,
    /// Seconds of sampling, uncounted, from interleaved repeats.
    pub time: Option<RepeatChange>,
    /// How far the picture changes.
    pub image: PictureChange,
    /// What the change does besides: lights that go, darkness.
    pub warnings: Vec<String>,
}

impl Suggestion {
    /// Saving and change of the picture in a line: "intersection cost −23.1 % ± 0.8 %, time −21 % ± 3 %, FLIP 0.080".
    pub fn measured(&self) -> String {
        measured(self.relative.map(|relative| (relative, self.ci95)), self.time.as_ref(), &self.image)
    }
}

fn measured(
    cost: Option<(f64, Option<[f64; 2]>)>,
    time: Option<&RepeatChange>,
    image: &PictureChange,
) -> String {
    let cost = cost.map(|(relative, ci95)| {
        let noise = ci95.is_some_and(|[low, high]| low <= 0.0 && high >= 0.0);
        let doubt = if noise { " (not significant)" } else { "" };
        format!("intersection cost {}{doubt}", with_interval(relative, ci95))
    });
    let time = time.map(|time| {
        let doubt = if time.significant() == Some(false) { " (not significant)" } else { "" };
        format!("time {}{doubt}", with_interval(time.relative, time.ci95))
    });
    let image = image_in_words(image).map(|words| format!("picture {words}"));
    [cost, time, image].into_iter().flatten().collect::<Vec<_>>().join(", ")
}

impl WhatIf {
    /// What was measured, in a line for each option of `whatif` that was tried by itself.
    pub fn by_option(&self) -> impl Iterator<Item = (&str, String)> {
        let total = self.comparison.totals.get(Metric::Intersection.name());
        let own = match self.change.options.as_slice() {
            [option] => Some((
                option.as_str(),
                measured(
                    total.and_then(|total| Some((total.relative?, total.ci95))),
                    self.time.as_ref(),
                    &self.image,
                ),
            )),
            _ => None,
        };
        own.into_iter().chain(self.suggestions.iter().map(|s| (s.option.as_str(), s.measured())))
    }

    /// Reads a document; `place` names it in errors.
    ///
    /// # Errors
    /// [`Error::Invalid`](crate::Error::Invalid) when it is not JSON of this shape,
    /// [`Error::Unsupported`](crate::Error::Unsupported) for another schema or version.
    pub fn from_json(text: &str, place: &str) -> crate::Result<Self> {
        let read: Self = serde_json::from_str(text).map_err(|error| {
            crate::Error::invalid(place, format!("its JSON does not read: {error}"), "run whatif again")
        })?;
        if read.comparison.schema != SCHEMA {
            return Err(crate::Error::unsupported(
                place,
                format!("its schema is \"{}\", this program reads \"{SCHEMA}\"", read.comparison.schema),
                "use the program version that wrote it",
            ));
        }
        Ok(read)
    }

    /// Puts the change of time among the totals, in microseconds of all threads per path.
    pub fn set_time(&mut self, time: RepeatChange, threads: usize) {
        let [width, height] = self.resolution;
        let paths = f64::from(width) * f64::from(height) * self.samples_per_pixel as f64;
        let per_path = |seconds: f64| seconds * threads as f64 * 1e6 / paths.max(1.0);
        let change = TotalChange {
            a: per_path(time.a),
            b: per_path(time.b),
            delta: per_path(time.b - time.a),
            relative: Some(time.relative),
            ci95: time.ci95,
            ci_kind: CiKind::Repeats,
            significant: time.significant(),
            ..TotalChange::default()
        };
        self.comparison.totals.insert(Metric::TimeUs.name().to_owned(), change);
        self.time = Some(time);
    }

    /// One sentence for each of the metrics that matter, one for the time, one for the picture.
    pub fn sentences(&self) -> Vec<String> {
        let mut sentences = Vec::new();
        for (metric, label) in [
            (Metric::Intersection, "intersection cost"),
            (Metric::Nodes, "nodes"),
            (Metric::Shapes, "triangles tested"),
            (Metric::Rays, "rays"),
        ] {
            let Some(change) = self.comparison.totals.get(metric.name()) else { continue };
            sentences.push(format!("{label} {}", told(change)));
        }
        sentences.extend(self.time.map(|time| time_in_words(&time)));
        sentences.extend(image_in_words(&self.image).map(|words| format!("image {words}")));
        sentences
    }

    /// The whole in one sentence, without what [`Self::sentences`] say of errors and repeats.
    pub fn verdict(&self) -> String {
        let mut parts = Vec::new();
        if let Some(change) = self.comparison.totals.get(Metric::Intersection.name()) {
            parts.push(format!("intersection cost {}", briefly(change)));
        }
        if let Some(time) = &self.time {
            let change = with_interval(time.relative, time.ci95);
            parts.push(format!("time {change}{}", doubt(time.significant())));
        }
        let PictureChange { flip, relmse, relmse_error, .. } = self.image;
        // FLIP holds the noise of both; this difference does not.
        if relmse.zip(relmse_error).is_some_and(|(difference, error)| difference <= 2.0 * error) {
            parts.push("image the same within noise".to_owned());
        } else if let Some(flip) = flip {
            parts.push(format!("image FLIP {flip:.2}"));
        } else if let Some(relmse) = relmse {
            parts.push(format!("image relMSE {relmse:.1e}"));
        }
        format!("{}: {}", self.change.what, parts.join(", "))
    }

    /// As indented JSON with a newline at its end.
    pub fn to_json(&self) -> String {
        let mut text = serde_json::to_string_pretty(self).unwrap_or_default();
        text.push('\n');
        text
    }
}

fn doubt(significant: Option<bool>) -> &'static str {
    if significant == Some(false) { " (not significant)" } else { "" }
}

/// "−23.1 % ± 0.8 %".
fn briefly(change: &TotalChange) -> String {
    match change.relative {
        Some(_) if change.delta == 0.0 => "exactly the same".to_owned(),
        Some(relative) => with_interval(relative, change.ci95) + doubt(change.significant),
        None => format!("0 before, {:.3} per path after", change.b),
    }
}

fn told(change: &TotalChange) -> String {
    let (Some(relative), true) = (change.relative, change.delta != 0.0) else { return briefly(change) };
    let mut words = with_interval(relative, change.ci95);
    let parts = [("sampling", change.sampling_error), ("trees", change.tree_error)];
    let parts: Vec<String> = parts
        .into_iter()
        .filter_map(|(name, error)| Some((name, error.filter(|error| *error > 0.0)?)))
        .map(|(name, error)| format!("{name} {}", share(error)))
        .collect();
    if !parts.is_empty() {
        words += &format!(" (standard errors: {})", parts.join(", "));
    }
    if change.significant == Some(false) {
        words += ", not significant";
    }
    words
}

/// "time −21 % ± 3 % (5 interleaved repeats)".
fn time_in_words(time: &RepeatChange) -> String {
    let verdict = if time.significant() == Some(false) { ", not significant" } else { "" };
    format!(
        "time {} ({} interleaved repeats{}){verdict}",
        with_interval(time.relative, time.ci95),
        time.repeats,
        time.noise.map_or(String::new(), |noise| format!(", noise {} each", share(noise)))
    )
}

/// "FLIP 0.08, relMSE 1.2e-3"; `None` where neither is known.
pub fn image_in_words(image: &PictureChange) -> Option<String> {
    let mut parts = Vec::new();
    if let Some(flip) = image.flip {
        let noise = image.flip_noise.map_or(String::new(), |noise| format!(" (noise {noise:.3})"));
        parts.push(format!("FLIP {flip:.3}{noise}"));
    }
    match (image.relmse, image.relmse_error) {
        (Some(relmse), Some(error)) if relmse <= 2.0 * error => {
            parts.push(format!("relMSE below {:.1e}", (relmse + 2.0 * error).max(0.0)));
        }
        (Some(relmse), Some(error)) => parts.push(format!("relMSE {relmse:.2e} ± {:.0e}", 1.96 * error)),
        _ => {}
    }
    (!parts.is_empty()).then(|| parts.join(", "))
}

/// A relative change with half the width of its interval, "−23.1 % ± 0.8 %", or with both ends where that would say otherwise about
/// 0 than the interval does: "−14 % (−26 to 0 %)" contains it, "−14 % ± 13 %" does not.
pub fn with_interval(relative: f64, ci95: Option<[f64; 2]>) -> String {
    let width = ci95.map(|[low, high]| 0.5 * (high - low));
    let digits = match width {
        Some(width) if width >= 0.02 => 0,
        Some(width) if width < 0.001 => 2,
        _ => 1,
    };
    let number = |value: f64| {
        let number = format!("{:+.digits$}", 100.0 * value).replace('-', "\u{2212}");
        // What rounds to nothing has no sign.
        let zero = !number.contains(|c: char| ('1'..='9').contains(&c));
        if zero { number.trim_start_matches(['+', '\u{2212}']).to_owned() } else { number }
    };
    let Some([low, high]) = ci95 else { return format!("{} %", number(relative)) };
    let half = 0.5 * (high - low);
    let scale = 100.0 * 10.0_f64.powi(digits as i32);
    let written = (scale * relative).abs().round() <= (scale * half).round();
    if written == (low <= 0.0 && high >= 0.0) {
        format!("{} % ± {:.digits$} %", number(relative), 100.0 * half)
    } else {
        format!("{} % ({} to {} %)", number(relative), number(low), number(high))
    }
}

fn share(error: f64) -> String {
    if error < 1e-3 { format!("{:.2} %", 100.0 * error) } else { format!("{:.1} %", 100.0 * error) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::document::tests::agree;
    use crate::layers::{LayerOptions, Layers};
    use crate::testing::random_frame;
    use crate::{FrameDesc, Side, TreeSpread, compare::Gate, compare_over_trees};

    /// One in which every key has a value.
    fn full() -> WhatIf {
        let layers = |seed| {
            let desc = FrameDesc { intervals: true, ..FrameDesc::new(32, 16) };
            Layers::from_frame(&random_frame(desc, 2, seed), &LayerOptions::default())
        };
        let (a, b) = (layers(1), layers(2));
        let mut spread = TreeSpread::new(32, 16);
        for seed in 3..6 {
            spread.add_pair(&a, &layers(seed));
        }
        let mut planes = Layers::new(32, 16);
        let noise = spread.finish_pairs(2, &mut planes).unwrap();
        let side = |name, layers| Side { name, layers, document: None };
        let mut comparison =
            compare_over_trees(side("A", &a), side("B", &b), false, Some((&noise, &planes))).unwrap();
        comparison.schema = SCHEMA.into();
        comparison.gates = vec![comparison.gate(&Gate::parse("nodes=2%").unwrap())];
        let mut image = PictureChange::of(&a, &b);
        (image.flip, image.flip_noise) = (Some(0.1), Some(0.05));
        (image.relmse, image.relmse_error) = (Some(0.01), Some(0.001));
        let total = comparison.totals["intersection"];
        for change in comparison.totals.values_mut() {
            change.sum_a = Some(crate::Sum::Exact(3));
            change.sum_b = Some(crate::Sum::Real(4.5));
        }
        let mut whatif = WhatIf {
            comparison,
            scene: "scene".into(),
            tree: "0123456789abcdef".into(),
            samples_per_pixel: 2,
            resolution: [32, 16],
            change: Change {
                what: "material \"Mirror\" matte".into(),
                options: vec!["--matte Mirror".into()],
                affected: vec!["1 object".into()],
                warnings: vec!["dark".into()],
            },
            image,
            time: None,
            tree_noise: Some(noise),
            suggestions: vec![Suggestion {
                what: "x".into(),
                option: "--max-depth 4".into(),
                reason: "y".into(),
                relative: total.relative,
                ci95: total.ci95,
                significant: total.significant,
                time: RepeatChange::of(&[[1.0, 0.8], [1.1, 0.85]]),
                image,
                warnings: vec!["dark".into()],
            }],
        };
        whatif.set_time(RepeatChange::of(&[[1.0, 0.8], [1.1, 0.85]]).unwrap(), 2);
        whatif
    }

    #[test]
    fn the_document_and_its_schema_agree_both_ways() {
        let whatif = full();
        let value: serde_json::Value = serde_json::from_str(&whatif.to_json()).unwrap();
        agree(&value, &serde_json::from_str(JSON_SCHEMA).unwrap());
        assert_eq!(value["totals"]["time_us"]["ci_kind"], "repeats");
        let read: WhatIf = serde_json::from_value(value).unwrap();
        assert_eq!(read.change, whatif.change);
        assert_eq!(read.comparison.totals.len(), whatif.comparison.totals.len());
    }

    #[test]
    fn changes_are_told_with_as_many_digits_as_they_have() {
        assert_eq!(with_interval(-0.2312, Some([-0.2392, -0.2232])), "\u{2212}23.1 % ± 0.8 %");
        assert_eq!(with_interval(-0.21, Some([-0.24, -0.18])), "\u{2212}21 % ± 3 %");
        assert_eq!(with_interval(0.01234, Some([0.0121, 0.01258])), "+1.23 % ± 0.02 %");
        assert_eq!(with_interval(0.5, None), "+50.0 %");
        assert_eq!(with_interval(-0.002, Some([-0.06, 0.06])), "0 % ± 6 %");
        // ln-symmetric: 13 % to either side would leave out 0, and the interval does not.
        assert_eq!(with_interval(-0.138, Some([-0.26, 0.004])), "\u{2212}14 % (\u{2212}26 to 0 %)");
        assert_eq!(with_interval(-0.07, Some([-0.14, 0.011])), "\u{2212}7 % ± 8 %");
        assert_eq!(with_interval(0.20, Some([0.01, 0.43])), "+20 % (+1 to +43 %)");
        assert_eq!(with_interval(-0.0002, Some([-0.012, 0.0116])), "0.0 % ± 1.2 %");
        let verdict = full().verdict();
        assert!(verdict.starts_with("material \"Mirror\" matte: intersection cost "), "{verdict}");
        assert!(verdict.contains(", time \u{2212}2") && verdict.ends_with("image FLIP 0.10"), "{verdict}");
        assert!(!verdict.contains("standard errors") && !verdict.contains("repeats"), "{verdict}");
        let mut same = full();
        same.image.flip = None;
        assert!(same.verdict().ends_with("image relMSE 1.0e-2"), "{}", same.verdict());
        same.image.relmse = Some(0.0015);
        assert!(same.verdict().ends_with("image the same within noise"), "{}", same.verdict());
    }
}
