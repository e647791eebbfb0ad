//! Scenes, renders and differences, in the paper's settings.

use hotspot_cost::maps::{ColorMap, Exposure, HeatOptions, beauty, heat_map};
use hotspot_cost::{Comparison, Frame, LayerOptions, Layers, Metric, Side, compare, hotspots};
use hotspot_integrator::{BuildOptions, Control, Gather, RenderScene, Settings, frame_bounds, render};
use hotspot_scene::{Camera, LoadOptions, Scene};
use image::RgbImage;
use std::path::{Path, PathBuf};

/// How large.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Scale {
    /// To be judged.
    Paper,
    /// To be looked at.
    Quick,
}

impl Scale {
    pub(crate) const fn size(self, [width, height]: [u32; 2]) -> [u32; 2] {
        match self {
            Self::Paper => [width, height],
            Self::Quick => [width / 4, height / 4],
        }
    }
}

/// A scene ready to be rendered.
pub(crate) struct Subject {
    pub(crate) scene: Scene,
    pub(crate) prepared: RenderScene,
    camera: Camera,
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

impl Subject {
    /// One of the project's own scenes.
    pub(crate) fn own(name: &str) -> Result<Self, String> {
        Self::load(&root().join("scenes").join(name).join(format!("{name}.gltf")))
    }

    /// One of the scenes that may lie beside the checkout.
    pub(crate) fn shared(name: &str) -> Result<Option<Self>, String> {
        let path = root().join("../shared/scenes").join(name).join(format!("{name}.gltf"));
        if path.is_file() { Self::load(&path).map(Some) } else { Ok(None) }
    }

    fn load(path: &Path) -> Result<Self, String> {
        let scene = hotspot_scene::load(path, &LoadOptions::default()).map_err(|e| e.to_string())?;
        let prepared = RenderScene::prepare(&scene, BuildOptions::default())
            .map_err(|e| format!("{}: {e}", path.display()))?;
        let (min, max) = prepared.bounds();
        let camera = scene.cameras.first().cloned().unwrap_or_else(|| frame_bounds(min, max));
        Ok(Self { scene, prepared, camera })
    }

    pub(crate) fn frame(&self, [width, height]: [u32; 2], spp: u32, depth: u32, gather: Gather) -> Frame {
        let mut settings = Settings::new(width, height);
        settings.spp = spp;
        settings.max_depth = depth;
        settings.gather = gather;
        // Halves have samples of their own: counts and times belong to the same paths only where both are in halves.
        settings.intervals = gather.cost || gather.time;
        render(&self.prepared, &self.camera, &settings, Control::default()).frame
    }

    /// The picture, tone mapped.
    pub(crate) fn picture(&self, size: [u32; 2], spp: u32, depth: u32) -> Picture {
        let frame = self.frame(size, spp, depth, Gather::RADIANCE);
        let layers = Layers::from_frame(&frame, &LayerOptions::default());
        let plane = |name| layers.plane(name).unwrap_or_default();
        let rgb = [plane("R"), plane("G"), plane("B")];
        let luminance = rgb[0]
            .iter()
            .zip(rgb[1])
            .zip(rgb[2])
            .map(|((r, g), b)| 0.2126 * r + 0.7152 * g + 0.0722 * b)
            .collect();
        Picture { image: beauty(size[0], size[1], rgb, Exposure::Auto).image, luminance }
    }

    /// Counters alone, in halves, the clock off.
    pub(crate) fn costs(&self, size: [u32; 2], spp: u32, depth: u32) -> Costs {
        let gather = Gather { radiance: false, cost: true, time: false, trace_shadow_rays: true };
        let frame = self.frame(size, spp, depth, gather);
        let layers = Layers::from_frame(&frame, &LayerOptions { radiance: false, ..LayerOptions::default() });
        Costs { size, objects: hotspots::first_objects(&frame), layers }
    }
}

/// A rendered picture.
pub(crate) struct Picture {
    pub(crate) image: RgbImage,
    /// Linear luminance (Rec.709), row by row.
    pub(crate) luminance: Vec<f32>,
}

/// The cost layers of a render.
pub(crate) struct Costs {
    pub(crate) size: [u32; 2],
    /// First-hit object of each pixel.
    pub(crate) objects: Vec<u32>,
    pub(crate) layers: Layers,
}

impl Costs {
    pub(crate) fn plane(&self, metric: Metric) -> &[f32] {
        self.layers.metric(metric).unwrap_or_default()
    }

    /// The mean over chosen pixels, from the halves: Σm / n ± 1.96 √Σh² / n.
    pub(crate) fn over(&self, metric: Metric, chosen: impl Fn(usize) -> bool) -> Change {
        let half = self.layers.half(metric).unwrap_or_default();
        mean_of(self.plane(metric), |i| half.get(i).map_or(0.0, |h| f64::from(*h)), chosen)
    }

    pub(crate) fn map(&self, metric: Metric) -> RgbImage {
        sequential(self.size, self.plane(metric), metric, metric == Metric::TimeUs)
    }
}

/// A heat map with its legend, clipped at the 99.9th percentile.
pub(crate) fn sequential(size: [u32; 2], values: &[f32], metric: Metric, despike: bool) -> RgbImage {
    let options = HeatOptions {
        label: metric.label().to_owned(),
        unit: metric.unit().to_owned(),
        map: ColorMap::Inferno,
        despike,
        ..HeatOptions::default()
    };
    heat_map(size[0], size[1], values, &options).image
}

/// What changed from A to B.
pub(crate) struct Pair {
    pub(crate) a: Costs,
    b: Costs,
    pub(crate) comparison: Comparison,
}

/// A mean difference with its 95 % interval.
#[derive(Clone, Copy)]
pub(crate) struct Change {
    pub(crate) mean: f64,
    pub(crate) half_width: f64,
}

impl Change {
    pub(crate) fn rises(self) -> bool {
        self.mean > self.half_width
    }

    pub(crate) fn falls(self) -> bool {
        self.mean < -self.half_width
    }
}

impl std::fmt::Display for Change {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:+.3} ± {:.3}", self.mean, self.half_width)
    }
}

impl Pair {
    pub(crate) fn new(
        a: &Subject,
        b: &Subject,
        size: [u32; 2],
        spp: u32,
        depth: u32,
    ) -> Result<Self, String> {
        let (costs_a, costs_b) = (a.costs(size, spp, depth), b.costs(size, spp, depth));
        let side = |name, layers| Side { name, layers, document: None };
        let comparison =
            compare(side(&a.scene.name, &costs_a.layers), side(&b.scene.name, &costs_b.layers), false)
                .map_err(|e| e.to_string())?;
        Ok(Self { a: costs_a, b: costs_b, comparison })
    }

    /// B − A per pixel.
    pub(crate) fn difference(&self, metric: Metric) -> &[f32] {
        self.comparison.layers.plane(&format!("diff.{}", metric.name())).unwrap_or_default()
    }

    /// Red where B is costlier, clipped at the 99.9th percentile as in the paper.
    pub(crate) fn map(&self, metric: Metric) -> RgbImage {
        let options = HeatOptions {
            label: format!("{}: B - A", metric.label()),
            unit: metric.unit().to_owned(),
            map: ColorMap::RedBlue,
            ..HeatOptions::default()
        };
        let [width, height] = self.a.size;
        heat_map(width, height, self.difference(metric), &options).image
    }

    /// The relative change of the total and its 95 % interval, in words; and whether it is told from chance.
    pub(crate) fn total(&self, metric: Metric) -> (f64, String) {
        let Some(change) = self.comparison.totals.get(metric.name()) else { return (0.0, String::new()) };
        let relative = change.relative.unwrap_or(0.0);
        let [lo, hi] = change.ci95.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
        let text = format!(
            "{} {:+.2} % ({:+.2} % to {:+.2} %)",
            metric.label(),
            100.0 * relative,
            100.0 * lo,
            100.0 * hi
        );
        (if change.significant == Some(true) { relative } else { 0.0 }, text)
    }

    /// The mean change over chosen pixels, from the halves' differences: Σd / n ± 1.96 √Σh² / n.
    pub(crate) fn over(&self, metric: Metric, chosen: impl Fn(usize) -> bool) -> Change {
        let half = |costs: &Costs, i: usize| {
            costs.layers.half(metric).and_then(|plane| plane.get(i)).map_or(0.0, |h| f64::from(*h))
        };
        mean_of(self.difference(metric), |i| half(&self.b, i) - half(&self.a, i), chosen)
    }
}

fn mean_of(values: &[f32], half: impl Fn(usize) -> f64, chosen: impl Fn(usize) -> bool) -> Change {
    let (mut sum, mut squares, mut count) = (0.0, 0.0, 0_usize);
    for (i, value) in values.iter().enumerate().filter(|(i, _)| chosen(*i)) {
        sum += f64::from(*value);
        squares += half(i).powi(2);
        count += 1;
    }
    let n = count.max(1) as f64;
    Change { mean: sum / n, half_width: 1.96 * squares.sqrt() / n }
}
