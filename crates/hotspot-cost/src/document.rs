//! The document beside a picture: `NAME.json`, repeated in the EXR's header.
//!
//! Schema `hotspot-render/1`, published as `schema/hotspot-render-1.schema.json`. Readers ignore keys that they do not
//! know and take absent ones as empty, so that keys can be added without a new version; a key never changes its meaning.
//! Integer sums are written exactly. Times are in seconds, memory in bytes, shares of 1.

use crate::depth_cut::DepthLoss;
use crate::digest::Digest;
use crate::error::{self, Error};
use crate::frame::Frame;
use crate::hotspots::Hotspot;
use crate::layers::LayerOptions;
use crate::ledger::Ledgers;
use crate::metric::{CostModel, Metric};
use crate::stats::{self, CiKind, Total};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;

/// The schema written.
pub const SCHEMA: &str = "hotspot-render/1";

/// The JSON Schema of [`Document`].
pub const JSON_SCHEMA: &str = include_str!("../schema/hotspot-render-1.schema.json");

/// Everything known about a render but its pixels.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Document {
    /// [`SCHEMA`].
    pub schema: String,
    /// Program and version that rendered.
    pub generator: String,
    /// The scene file's name.
    pub scene: String,
    /// The command line, word by word.
    pub command: Vec<String>,
    /// Settings that shaped the picture, by the name of their command-line option: `max-depth`, `seed`, …
    pub settings: BTreeMap<String, Value>,
    /// Width and height in pixels.
    pub resolution: [u32; 2],
    /// Camera samples that every pixel got; with adaptive sampling, the most that any got.
    pub samples_per_pixel: u64,
    /// Of these, counted.
    pub cost_samples_per_pixel: u64,
    /// Camera samples in total.
    pub samples: Samples,
    /// Two independent halves were kept.
    pub intervals: bool,
    /// The constants of equation 1 behind `intersection` and `waste`.
    pub cost_model: CostModel,
    /// Unit of `intersection` and `waste` where these constants are calibrated; absent: units of a node visit and a triangle
    /// test, weighted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cost_unit: Option<String>,
    /// How it was rendered.
    pub render: Render,
    /// The acceleration structure.
    pub tree: Tree,
    /// Bytes.
    pub memory: Memory,
    /// How much the totals vary from tree to tree, when measured.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tree_noise: Option<crate::TreeNoise>,
    /// Totals by [`Metric::name`].
    pub totals: BTreeMap<String, Total>,
    /// Expected relative squared error of the picture ([`stats::estimated_relmse`]).
    pub estimated_relmse: Option<f64>,
    /// Where that comes from: conservative means that it is too large.
    pub estimated_relmse_kind: CiKind,
    /// What the depth limit did, where paths were counted and radiance gathered.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub depth_limit: Option<DepthLoss>,
    /// Fingerprints of the sums.
    pub digest: Digest,
    /// Cost by what sent and by what was visited, when gathered.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ledgers: Option<Ledgers>,
    /// One sentence for people.
    pub verdict: String,
    /// Where the cost is, by falling excess.
    pub hotspots: Vec<Hotspot>,
    /// What the scene uses and the renderer does not model.
    pub unmodelled: Vec<Note>,
    /// What was repaired while loading.
    pub repairs: Vec<Note>,
    /// Pictures made of the data, and what they altered.
    pub views: Vec<View>,
}

/// Exact numbers of camera samples over the frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Samples {
    /// That brought radiance.
    pub radiance: u64,
    /// That were counted.
    pub cost: u64,
}

/// How it was rendered.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Render {
    /// Sampling alone.
    pub seconds: f64,
    /// Reading the scene.
    pub load_seconds: f64,
    /// Building the tree.
    pub build_seconds: f64,
    /// Tracing further paths to find the causes of hotspots, after the render; 0: they go by ratios.
    pub causes_seconds: f64,
    /// Worker threads.
    pub threads: u32,
    /// The traversal kernel that was counted.
    pub kernel: String,
    /// Why sampling ended; absent when unknown.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stopped: Option<Stopped>,
}

/// Why sampling ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Stopped {
    /// All samples were taken.
    Samples,
    /// The time was over.
    TimeLimit,
    /// The estimated error was small enough.
    TargetError,
    /// The user ended it.
    Interrupted,
}

/// The acceleration structure.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Tree {
    /// Builder and quality.
    pub builder: String,
    /// Children per node.
    pub width: u32,
    /// Nodes.
    pub nodes: u64,
    /// Triangles.
    pub triangles: u64,
    /// Fingerprint: renders over the same tree have the same one. Empty when unknown.
    pub digest: String,
}

/// Bytes held.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Memory {
    /// Vertices, indices, materials.
    pub geometry: u64,
    /// The tree.
    pub bvh: u64,
    /// Texels.
    pub textures: u64,
    /// The frame's sums.
    pub film: u64,
    /// The process's peak.
    pub peak: u64,
}

/// Something that was not modelled or that was repaired.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Note {
    /// What.
    pub what: String,
    /// Where in the scene: a JSON path, a line, a name.
    pub element: String,
    /// How often.
    pub count: u64,
}

/// A picture made of the data.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct View {
    /// File name.
    pub file: String,
    /// The metric shown; absent for the beauty.
    pub metric: Option<String>,
    /// Values at the two ends of the colour scale.
    pub scale: Option<[f64; 2]>,
    /// Exposure in stops.
    pub exposure_ev: Option<f64>,
    /// What was altered, in words: "41 pixels above the 99.9th percentile clipped".
    pub altered: Vec<String>,
}

impl Document {
    /// A document with everything that follows from a frame: resolution, samples, totals, estimated error, digests, film
    /// memory. The rest is the caller's to fill. Works in the caller's thread pool.
    pub fn of_frame(frame: &Frame, options: &LayerOptions) -> Self {
        let desc = frame.desc();
        let (mut most, mut cost_most, mut samples) = (0, 0, Samples::default());
        for (x, y) in frame.pixels() {
            let film = frame.film_total(x, y).samples;
            let cost = frame.with_cost_total(x, y, |total| total.samples);
            most = most.max(film);
            cost_most = cost_most.max(cost);
            samples.radiance += film;
            samples.cost += cost;
        }
        let ((relmse, totals), digest) = rayon::join(
            || {
                rayon::join(
                    || stats::estimated_relmse(frame),
                    || stats::totals(frame, options.metrics, options.model),
                )
            },
            || Digest::of(frame),
        );
        Self {
            schema: SCHEMA.to_owned(),
            resolution: [desc.width, desc.height],
            samples_per_pixel: most,
            cost_samples_per_pixel: cost_most,
            samples,
            intervals: desc.intervals,
            cost_model: options.model,
            memory: Memory { film: frame.memory(), ..Memory::default() },
            totals,
            estimated_relmse: relmse.map(|(value, _)| value),
            estimated_relmse_kind: relmse.map_or(CiKind::None, |(_, kind)| kind),
            digest,
            ..Self::default()
        }
    }

    /// The total of a metric.
    pub fn total(&self, metric: Metric) -> Option<&Total> {
        self.totals.get(metric.name())
    }

    /// As indented JSON with a newline at its end. Not-a-number and infinity become null.
    pub fn to_json(&self) -> String {
        // Serialising to memory fails only on maps with keys that are not strings, of which there are none.
        let mut text = serde_json::to_string_pretty(self).unwrap_or_default();
        text.push('\n');
        text
    }

    /// Reads a document; `place` names it in errors.
    ///
    /// # Errors
    /// [`Error::Invalid`] when it is not JSON of this shape, [`Error::Unsupported`] for another schema or version.
    pub fn from_json(text: &str, place: &str) -> error::Result<Self> {
        let document: Self = serde_json::from_str(text).map_err(|error| {
            Error::invalid(place, format!("its JSON does not read: {error}"), "write it again by rendering")
        })?;
        if document.schema != SCHEMA {
            return Err(Error::unsupported(
                place,
                format!("its schema is \"{}\", this program reads \"{SCHEMA}\"", document.schema),
                "use the program version that wrote it",
            ));
        }
        Ok(document)
    }
}

#[cfg(test)]
pub(crate) mod tests;
