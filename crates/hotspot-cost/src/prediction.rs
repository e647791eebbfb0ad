//! What a render will cost, from small independent renders of the same film.
//!
//! A *pilot* is a render of the whole film with fewer pixels and samples. Every pilot sample is uniform within its pixel, and
//! pixels of equal size cover the film, so that the mean over a pilot's paths is an unbiased estimate of the mean over the
//! film, whatever the resolution: costs per path do not depend on it (textures are not filtered by footprint). Pilots with
//! seeds of their own are independent, pixel by pixel.
//!
//! **Counts.** With R pilots, m_pr the mean per path of pixel p in pilot r, and P pixels, M = Σ_p m̄_p/P and Var M =
//! Σ_p s_p²/(R·P²), s_p² the variance over pilots with R − 1 degrees of freedom: differences between pixels are no noise. The
//! render to be predicted has noise of its own, at most Var M times the pilots' paths over its own (its samples are stratified
//! at least as well). The interval is M ± t·√(both), Student's t at Satterthwaite's degrees of freedom ([`crate::stats`]).
//!
//! **Time.** A machine's speed wanders, and not like independent draws: on the machine where this was made (two shared cores
//! with nothing else running) adjacent means over 0.25, 0.5, 1 … 30 seconds differ by as much at each of these scales, as
//! flicker noise does. Then more or longer readings hardly narrow the error, the scatter of readings about their mean holds
//! but a part of it, and R readings are worth far fewer degrees of freedom than R − 1. [`seconds`] is made for that.

use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::layers::mean;
use crate::metric::{CostModel, Metric};
use crate::student::{Variance, quantile95};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;

/// The schema written.
pub const PREDICT_SCHEMA: &str = "hotspot-predict/1";

/// The JSON Schema of [`Prediction`].
pub const PREDICT_JSON_SCHEMA: &str = include_str!("../schema/hotspot-predict-1.schema.json");

/// A number with its 95 % prediction interval.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Interval {
    /// Best guess.
    pub value: f64,
    /// 95 % of renders lie between.
    pub ci95: [f64; 2],
}

impl Interval {
    /// `value` ± `half`, not below 0.
    fn around(value: f64, half: f64) -> Self {
        Self { value, ci95: [(value - half).max(0.0), value + half] }
    }

    /// Half the interval over the value; 0 for a value of 0.
    pub fn relative(&self) -> f64 {
        if self.value > 0.0 { 0.5 * (self.ci95[1] - self.ci95[0]) / self.value } else { 0.0 }
    }

    /// Value and ends times a factor that is not negative.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        Self { value: factor * self.value, ci95: self.ci95.map(|end| factor * end) }
    }

    /// Value and ends plus a constant.
    #[must_use]
    pub fn plus(&self, constant: f64) -> Self {
        Self { value: self.value + constant, ci95: self.ci95.map(|end| end + constant) }
    }
}

/// Sums over pilots.
#[derive(Clone, Debug)]
pub struct Pilots {
    width: u32,
    height: u32,
    model: CostModel,
    metrics: Vec<Metric>,
    count: u64,
    /// Camera samples of all pilots.
    paths: u64,
    /// Σ_r m_pr and Σ_r m_pr² for each pixel and metric.
    sums: Vec<[f64; 2]>,
}

impl Pilots {
    /// None yet, for pilots of this size. `model` makes the weighted metrics.
    pub fn new(width: u32, height: u32, model: CostModel) -> Self {
        let metrics: Vec<Metric> =
            Metric::ALL.into_iter().filter(|metric| *metric != Metric::TimeUs).collect();
        let sums = vec![[0.0; 2]; metrics.len() * width as usize * height as usize];
        Self { width, height, model, metrics, count: 0, paths: 0, sums }
    }

    /// Adds a pilot with counts; its seed must differ from the others'.
    ///
    /// # Errors
    /// [`Error::Invalid`] for another size or a pixel that was not counted.
    pub fn add(&mut self, frame: &Frame) -> Result<()> {
        let desc = frame.desc();
        let invalid = |what: String| Error::invalid("prediction", what, "give pilots of one size that count");
        if (desc.width, desc.height) != (self.width, self.height) {
            return Err(invalid(format!(
                "a pilot of {} x {} pixels among pilots of {} x {}",
                desc.width, desc.height, self.width, self.height
            )));
        }
        let mut sums = self.sums.iter_mut();
        for (x, y) in frame.pixels() {
            let pixel = frame.cost_total(x, y);
            if pixel.samples == 0 {
                return Err(invalid(format!("a pilot counted nothing in pixel ({x}, {y})")));
            }
            self.paths += pixel.samples;
            for (metric, sum) in self.metrics.iter().zip(&mut sums) {
                let value = mean(metric.sum(&pixel, self.model), pixel.samples);
                sum[0] += value;
                sum[1] += value * value;
            }
        }
        self.count += 1;
        Ok(())
    }

    /// Camera samples of all pilots.
    pub const fn paths(&self) -> u64 {
        self.paths
    }

    /// Sums over a render of `paths` camera samples, by [`Metric::name`]; empty with fewer than two pilots.
    pub fn totals(&self, paths: u64) -> BTreeMap<String, Interval> {
        if self.count < 2 {
            return BTreeMap::new();
        }
        let r = self.count as f64;
        let pixels = self.sums.len() / self.metrics.len().max(1);
        let scale = 1.0 / (r * (pixels * pixels) as f64);
        let own = 1.0 + self.paths as f64 / paths.max(1) as f64;
        let of = |index: usize| {
            let (mut total, mut variance) = (0.0, Variance::default());
            for [sum, squares] in self.sums.iter().skip(index).step_by(self.metrics.len()) {
                total += sum / r;
                let spread = (squares - sum * sum / r).max(0.0) / (r - 1.0);
                variance.add(spread * scale * own, r - 1.0);
            }
            let mean = Interval::around(total / pixels as f64, variance.half_width95());
            mean.scaled(paths as f64)
        };
        self.metrics.iter().enumerate().map(|(i, metric)| (metric.name().to_owned(), of(i))).collect()
    }
}

/// The mean reading with an interval for the mean over the time of `length` further readings, soon after; `drift`: standard
/// deviation of the machine's slower drift, relative, 0 when unknown. `None` with fewer than two readings.
///
/// V, the mean square of the differences between adjacent means over 1, 2, 4 … readings (twice the Allan variance), averaged
/// over these scales, is what adjacent means differ by at any scale when noise is flicker noise. The interval is ± t(ν)·√(g·V):
/// g = 1.25 while the render takes up to four times as long as the readings did together and 0.12 more for each doubling, ν =
/// 1.1·R^0.63, both from simulated flicker noise of 2^13 readings, R of 8 to 32, `length` of 4 to 512, a gap of three
/// readings between. Where noise is independent instead, intervals are two to three times as wide as they need be.
pub fn seconds(readings: &[f64], drift: f64, length: f64) -> Option<Interval> {
    if readings.len() < 2 {
        return None;
    }
    let r = readings.len() as f64;
    let mean = readings.iter().sum::<f64>() / r;
    let growth = 1.25 + 0.12 * (length / (4.0 * r)).max(1.0).log2();
    let dof = (1.106 * r.powf(0.63)).min(r - 1.0);
    let half = quantile95(dof) * (growth * wander(readings)).sqrt();
    // Known in advance, not estimated here: the normal quantile.
    let slow = 1.96 * drift * mean;
    Some(Interval::around(mean, half.hypot(slow)))
}

/// The V of [`seconds`].
fn wander(readings: &[f64]) -> f64 {
    let (mut sum, mut scales, mut block) = (0.0, 0.0, 1);
    while 2 * block <= readings.len() {
        let means: Vec<f64> =
            readings.chunks_exact(block).map(|part| part.iter().sum::<f64>() / block as f64).collect();
        let squares = means.windows(2).map(|pair| (pair[1] - pair[0]).powi(2)).sum::<f64>();
        sum += squares / (means.len() - 1) as f64;
        scales += 1.0;
        block *= 2;
    }
    if scales > 0.0 { sum / scales } else { 0.0 }
}

/// The document of a prediction: `NAME.predict.json`, schema [`PREDICT_SCHEMA`]. The rules for keys are those of
/// [`crate::document`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Prediction {
    /// [`PREDICT_SCHEMA`].
    pub schema: String,
    /// Program and version that predicted.
    pub generator: String,
    /// The command line, word by word.
    pub command: Vec<String>,
    /// The scene's name.
    pub scene: String,
    /// Settings of the render predicted, by the name of their command-line option.
    pub settings: BTreeMap<String, Value>,
    /// Width and height of the render predicted.
    pub resolution: [u32; 2],
    /// Its camera samples per pixel.
    pub samples_per_pixel: u64,
    /// Worker threads.
    pub threads: u32,
    /// The kernel that was timed.
    pub kernel: String,
    /// How it was predicted.
    pub pilot: Pilot,
    /// Seconds of the render.
    pub seconds: Seconds,
    /// Sums over all paths of the render, by [`Metric::name`].
    pub totals: BTreeMap<String, Interval>,
    /// Unit of `intersection` and `waste` where c0 and c1 are calibrated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cost_unit: Option<String>,
    /// Seconds of sampling by a profile's full fit and the counts above, without its uncertainty.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seconds_by_profile: Option<f64>,
    /// What fits into a given time.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub budget: Option<Budget>,
    /// One sentence for people.
    pub verdict: String,
}

/// The small renders.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Pilot {
    /// Width and height in pixels.
    pub resolution: [u32; 2],
    /// Camera samples per pixel of each.
    pub samples_per_pixel: u64,
    /// How many.
    pub repeats: u32,
    /// Nanoseconds of one thread per path, reading by reading.
    pub path_ns: Vec<f64>,
    /// Seconds for each wave of samples in which threads wait for each other, or that no pixel's clock sees: the pilots' mean.
    pub idle_per_wave: f64,
    /// Seconds that all of it took.
    pub seconds: f64,
}

/// Where the time goes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Seconds {
    /// Sampling.
    pub render: Interval,
    /// Reading the scene: measured just now.
    pub load: f64,
    /// Placing its geometry and building the tree: measured just now.
    pub build: f64,
    /// Writing the outputs: the pilot's outputs, scaled by the number of pixels; no interval.
    pub output: f64,
    /// All of it; the interval is that of `render`.
    pub total: Interval,
}

/// What fits into a time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Budget {
    /// Seconds to spend, from start to end.
    pub seconds: f64,
    /// Camera samples per pixel that fit at the slow end of the interval; 0 when not even one does.
    pub samples_per_pixel: u64,
}

impl Prediction {
    /// As indented JSON with a newline at its end.
    pub fn to_json(&self) -> String {
        let mut text = serde_json::to_string_pretty(self).unwrap_or_default();
        text.push('\n');
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Random, random_frame};
    use crate::{FrameDesc, stats};

    #[test]
    fn totals_are_those_of_the_pilots_per_path() {
        let frames: Vec<Frame> = (0..3).map(|seed| random_frame(FrameDesc::new(12, 8), 4, seed)).collect();
        let mut pilots = Pilots::new(12, 8, CostModel::default());
        for frame in &frames {
            pilots.add(frame).unwrap();
        }
        assert_eq!(pilots.paths(), 3 * 96 * 4);
        let totals = pilots.totals(1_000_000);
        for metric in [Metric::Nodes, Metric::Intersection, Metric::Escaped, Metric::RaysShadow] {
            let expected = frames
                .iter()
                .map(|frame| stats::total(frame, metric, CostModel::default()).mean)
                .sum::<f64>()
                / 3.0
                * 1e6;
            let found = totals[metric.name()];
            assert!((found.value / expected - 1.0).abs() < 1e-12, "{metric:?}");
            assert!(found.ci95[0] < expected && expected < found.ci95[1]);
        }
        assert!(!totals.contains_key("time_us"));
    }

    /// 600 predictions from 4 pilots each, of a render of 8 times as many samples as one pilot; a render's own noise counts.
    /// 95 % should lie inside; with samples that are independent, as here, the render's noise is what is assumed. One standard
    /// deviation of the share is 0.9 %: below 92.3 % by chance once in a thousand.
    #[test]
    fn intervals_cover_renders() {
        let mut inside = 0;
        for seed in 0..600 {
            let mut pilots = Pilots::new(6, 5, CostModel::default());
            for r in 0..4 {
                pilots.add(&random_frame(FrameDesc::new(6, 5), 2, 10 * seed + r)).unwrap();
            }
            let render = random_frame(FrameDesc::new(6, 5), 16, 10 * seed + 9);
            let truth = stats::total(&render, Metric::Nodes, CostModel::default()).sum.as_f64();
            let [low, high] = pilots.totals(30 * 16)["nodes"].ci95;
            inside += u32::from(low <= truth && truth <= high);
        }
        assert!((554..=590).contains(&inside), "{inside} of 600");
    }

    /// Flicker noise: sums of values that hold for 1, 2, 4 … 2^11 readings (Voss and McCartney), each series from a random start.
    fn flicker(random: &mut Random, count: usize) -> Vec<f64> {
        let mut held: Vec<(f64, usize)> = (0..12)
            .map(|octave| (random.normal(), (random.unit() * f64::from(1 << octave)) as usize))
            .collect();
        (0..count)
            .map(|_| {
                for (octave, (value, left)) in held.iter_mut().enumerate() {
                    if *left == 0 {
                        (*value, *left) = (random.normal(), 1 << octave);
                    }
                    *left -= 1;
                }
                held.iter().map(|(value, _)| value).sum()
            })
            .collect()
    }

    /// 2000 intervals of 95 % for each of 4 cases; one standard deviation of a share is 0.5 %. The bounds leave 3 % to the fit
    /// of g and ν, which was made on flicker noise of another make.
    #[test]
    fn seconds_cover_a_render_on_a_machine_whose_speed_wanders() {
        for (count, length) in [(8, 8), (16, 4), (16, 120), (32, 32)] {
            let mut random = Random::new(4);
            let mut inside = 0;
            for _ in 0..2000 {
                let all = flicker(&mut random, count + 3 + length);
                let all: Vec<f64> = all.iter().map(|x| 5.0 + 0.05 * x).collect();
                let render = all[count + 3..].iter().sum::<f64>() / length as f64;
                let [low, high] = seconds(&all[..count], 0.0, length as f64).unwrap().ci95;
                inside += u32::from(low <= render && render <= high);
            }
            assert!((1840..=1960).contains(&inside), "{count}, {length}: {inside} of 2000");
        }
        // Independent noise: wider than need be, not narrower.
        let mut random = Random::new(5);
        let inside = (0..2000)
            .filter(|_| {
                let mut mean =
                    |of: usize| (0..of).map(|_| 5.0 + 0.3 * random.normal()).sum::<f64>() / of as f64;
                let (readings, render): (Vec<f64>, f64) = ((0..16).map(|_| mean(1)).collect(), mean(4));
                let [low, high] = seconds(&readings, 0.0, 4.0).unwrap().ci95;
                low <= render && render <= high
            })
            .count();
        assert!(inside > 1960, "{inside} of 2000");
    }

    #[test]
    fn what_is_told_of_drift_counts() {
        assert!(seconds(&[1.0], 0.0, 1.0).is_none());
        let wide = seconds(&[1.0, 1.0], 0.1, 1.0).unwrap();
        assert!((wide.ci95[1] - 1.196).abs() < 1e-12 && wide.value == 1.0);
        // A step between halves shows at every scale, and in a long render more.
        let step = [1.0, 1.0, 1.0, 1.0, 1.01, 1.01, 1.01, 1.01];
        assert!((wander(&step) - 1e-4 * (1.0 / 7.0 + 1.0 / 3.0 + 1.0) / 3.0).abs() < 1e-12);
        let [short, long] = [8.0, 1024.0].map(|length| seconds(&step, 0.0, length).unwrap().relative());
        assert!((long / short - (1.85f64 / 1.25).sqrt()).abs() < 1e-3, "{short} {long}");
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        let mut pilots = Pilots::new(4, 4, CostModel::default());
        assert!(pilots.add(&random_frame(FrameDesc::new(4, 5), 1, 0)).is_err());
        assert!(pilots.add(&Frame::new(FrameDesc::new(4, 4))).is_err());
        assert!(pilots.totals(10).is_empty());
    }

    #[test]
    fn the_schema_names_every_key() {
        let prediction = Prediction {
            cost_unit: Some("ns".into()),
            seconds_by_profile: Some(1.0),
            budget: Some(Budget::default()),
            totals: [("nodes".to_owned(), Interval::default())].into(),
            ..Prediction::default()
        };
        let schema: Value = serde_json::from_str(PREDICT_JSON_SCHEMA).unwrap();
        let value = serde_json::to_value(&prediction).unwrap();
        assert_eq!(schema["properties"]["schema"]["const"], PREDICT_SCHEMA);
        let keys = |value: &Value| value.as_object().unwrap().keys().cloned().collect::<Vec<_>>();
        assert_eq!(keys(&schema["properties"]), keys(&value));
        for part in ["pilot", "seconds", "budget"] {
            assert_eq!(keys(&schema["properties"][part]["properties"]), keys(&value[part]), "{part}");
        }
    }
}
