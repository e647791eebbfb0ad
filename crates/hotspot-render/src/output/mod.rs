//! Writes what a command made: EXR, JSON, PNGs and the page.

mod comparison;
mod render;
mod words;

pub(crate) use comparison::Pair;
pub(crate) use render::Output;

use crate::args::{MapsArg, ScaleArg, ViewArgs};
use crate::commands::make_folder;
use crate::fail::{FAILED, Fail};
use crate::seen::Names;
use hotspot_cost::maps::{Beauty, DEFAULT_CLIP, Exposure, Scale, beauty};
use hotspot_cost::{Document, Layers, Metric};
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
    /// Objects and materials under the pointer on the pages of comparisons.
    seen: [Names; 2],
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
        Ok(Self { folder, views, ranges, seen: Default::default() })
    }

    /// Names the objects and materials of the pixels on the pages of comparisons.
    pub(crate) fn shows(&mut self, seen: [Names; 2]) {
        self.seen = seen;
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
}

fn tone_mapped(layers: &Layers, exposure: Exposure) -> Option<Beauty> {
    let rgb = [layers.plane("R")?, layers.plane("G")?, layers.plane("B")?];
    Some(beauty(layers.width, layers.height, rgb, exposure))
}
