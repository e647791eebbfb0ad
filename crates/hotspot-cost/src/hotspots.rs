//! Where the cost is: hotspots, their share, and why in plain words.
//!
//! The paper (section 3) calls a region above the mean cost of all pixels a hotspot. So that a picture falls into parts,
//! ours are 8-connected components of at least [`MIN_PIXELS`] pixels, each of one first-hit object, where the smoothed
//! cost's lower bound exceeds the mean; ranked by excess cost Σ (cost − mean). Smoothing averages the pixels of the same
//! object in a 9×9 window (about a tile), so that cost does not bleed from one object onto its neighbour.

mod causes;
mod ordinary;
mod rules;
mod sentences;
mod smooth;
mod sounding;
mod tries;
mod words;

pub use causes::{CauseKind, Context, Finding, MaterialKind, explain};
pub use ordinary::ordinary_pixels;
pub use smooth::smoothed_lower_bound;
pub use sounding::Sounding;
pub use tries::Try;
pub use words::{fix, verdict};

use crate::analysis::median;
use crate::frame::Frame;
use crate::layers::{LayerOptions, Layers, variance_of_mean};
use crate::metric::{CostModel, Metric};
use crate::metric_set::MetricSet;
use hotspot_probe::NONE;
use ordinary::Means;
use serde::{Deserialize, Serialize};

/// Smaller components are not reported.
pub const MIN_PIXELS: usize = 16;

/// Hotspots are listed until they hold this share of the excess …
const HALF: f64 = 0.5;

/// … or are so many times the number asked for.
const PATIENCE: usize = 4;

/// Planes to look for hotspots in; all of width × height values, row by row from the top, and empty where unknown (only
/// `cost` is needed).
#[derive(Clone, Copy, Debug, Default)]
pub struct HotspotInput<'a> {
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Mean cost per path: `intersection`, or any other measure.
    pub cost: &'a [f32],
    /// Smoothed lower bound of `cost` ([`smoothed_lower_bound`]); empty: the one for unknown variances.
    pub lower: &'a [f32],
    /// First-hit object of each pixel, [`NONE`] for the background.
    pub objects: &'a [u32],
    /// Mean rays per path.
    pub rays: &'a [f32],
    /// Mean shadow rays per path.
    pub shadow_rays: &'a [f32],
    /// Mean nodes per path.
    pub nodes: &'a [f32],
    /// Mean triangles tested per path.
    pub shapes: &'a [f32],
    /// Mean cost in vain per path, in the unit of `cost`.
    pub waste: &'a [f32],
}

/// One hotspot. Shares are of 1.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Hotspot {
    /// Rank, 1 for the largest excess.
    pub rank: usize,
    /// Left, top, right, bottom in pixels; right and bottom excluded.
    pub bbox: [u32; 4],
    /// Its pixels.
    pub pixels: usize,
    /// Indices of its pixels, row by row from the top. Not written to files.
    #[serde(skip)]
    pub members: Vec<u32>,
    /// Its share of all pixels.
    pub pixel_share: f64,
    /// Its share of the frame's cost.
    pub cost_share: f64,
    /// Σ (cost − mean) over its pixels.
    pub excess: f64,
    /// Its share of the excess of all pixels that are above the mean.
    pub excess_share: f64,
    /// Index of the object that its camera rays hit first; absent for the background or when unknown.
    pub object: Option<u32>,
    /// The object's name.
    pub name: Option<String>,
    /// How it compares with the median pixel.
    pub factors: Factors,
    /// The cause in plain words.
    pub cause: String,
    /// The causes, the strongest first; empty where nothing stands out or none was looked for.
    pub causes: Vec<Finding>,
    /// Paths traced again through its pixels, booked, to find the causes; 0: `cause` and `fix` go by ratios alone.
    pub sounded: u64,
    /// What to try, in plain words; empty where nothing is known.
    pub fix: String,
    /// Options of `hotspot-render whatif SCENE` that try it; empty where none applies.
    pub whatif: Vec<String>,
}

/// A region against the frame's pixels of about the median cost ([`ordinary_pixels`]): 1 is like them, 2 twice as much; absent where the planes
/// are not given or those pixels have none of it. The cost is a product:
/// `cost = vertices_per_path · rays_per_vertex · nodes_per_ray · cost_per_node`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Factors {
    /// Cost.
    pub cost: Option<f64>,
    /// Rays per path.
    pub rays_per_path: Option<f64>,
    /// Camera and bounce rays per path.
    pub vertices_per_path: Option<f64>,
    /// Rays per camera or bounce ray.
    pub rays_per_vertex: Option<f64>,
    /// Nodes visited per ray.
    pub nodes_per_ray: Option<f64>,
    /// Triangles tested per ray.
    pub shapes_per_ray: Option<f64>,
    /// Cost per node visited: grows with the triangles tested per node.
    pub cost_per_node: Option<f64>,
    /// Share of the region's cost spent in vain (0 to 1, not a ratio).
    pub waste_share: Option<f64>,
}

/// What hotspots by `intersection` are found from.
const NEEDED: [Metric; 6] =
    [Metric::Intersection, Metric::Rays, Metric::RaysShadow, Metric::Nodes, Metric::Shapes, Metric::Waste];

/// The hotspots of a frame by `intersection`, as many as [`find`] lists; `names[object]` names an object. Empty without cost.
pub fn of_frame(frame: &Frame, model: CostModel, names: &[String], most: usize) -> Vec<Hotspot> {
    let options = LayerOptions { model, metrics: NEEDED.into_iter().collect(), radiance: false, var: false };
    let layers = Layers::from_frame(frame, &options);
    of_frame_layers(frame, &layers, model, &first_objects(frame), names, most)
}

/// [`of_frame`] for callers that have the frame's layers and [`first_objects`] already: only what lies in neither is made
/// anew. `layers` must be those of this frame with this cost model.
///
/// # Panics
/// When layers or objects are of another size than the frame.
pub fn of_frame_layers(
    frame: &Frame,
    layers: &Layers,
    model: CostModel,
    objects: &[u32],
    names: &[String],
    most: usize,
) -> Vec<Hotspot> {
    let metric = Metric::Intersection;
    let absent: MetricSet = NEEDED.into_iter().filter(|metric| layers.metric(*metric).is_none()).collect();
    if !frame.desc().cost {
        return Vec::new();
    }
    let completed;
    let layers = if absent.is_empty() {
        layers
    } else {
        let options = LayerOptions { model, metrics: absent, radiance: false, var: false };
        let mut made = Layers::from_frame(frame, &options);
        for metric in NEEDED {
            for name in [metric.layer(), format!("half.{}", metric.name()), format!("var.{}", metric.name())]
            {
                if let Some(plane) = layers.plane(&name) {
                    made.insert(name, plane.to_vec());
                }
            }
        }
        completed = made;
        &completed
    };
    if layers.half(metric).is_some() || layers.var(metric).is_some() {
        return of_layers(layers, metric, objects, names, most);
    }
    let variances = frame
        .pixels()
        .map(|(x, y)| {
            frame.with_cost_total(x, y, |pixel| {
                metric
                    .squares(pixel, model)
                    .and_then(|squares| variance_of_mean(metric.sum(pixel, model), squares, pixel.samples))
                    .map_or(0.0, |variance| variance as f32)
            })
        })
        .collect();
    with_variances(layers, metric, Some((variances, None)), objects, names, most)
}

/// The hotspots of layers by a metric of choice; `objects` may be empty. The lower bound follows from `half.*`, else from
/// `var.*`. Where neither tells the noise (a single sample, other programs' files) it follows from how the costs of the
/// pixels around differ ([`smoothed_lower_bound`]). Empty without that metric.
///
/// # Panics
/// When `objects` is not empty and does not hold width × height values.
pub fn of_layers(
    layers: &Layers,
    metric: Metric,
    objects: &[u32],
    names: &[String],
    most: usize,
) -> Vec<Hotspot> {
    let variances = match (layers.half(metric), layers.var(metric)) {
        (Some(half), _) => Some((half.iter().map(|half| half * half).collect(), Some(1.0))),
        (None, Some(var)) => Some((var.to_vec(), None)),
        (None, None) => None,
    };
    with_variances(layers, metric, variances, objects, names, most)
}

/// The hotspots with the variances of the pixels' means and their degrees of freedom: one less than samples when `None`.
fn with_variances(
    layers: &Layers,
    metric: Metric,
    variances: Option<(Vec<f32>, Option<f64>)>,
    objects: &[u32],
    names: &[String],
    most: usize,
) -> Vec<Hotspot> {
    let Some(cost) = layers.metric(metric) else { return Vec::new() };
    let samples = layers.plane("cost.samples");
    let (mut variances, dof) = variances.unwrap_or_else(|| (vec![f32::NAN; cost.len()], Some(1.0)));
    let dof = dof.unwrap_or_else(|| (samples.map_or(2.0, |plane| f64::from(median(plane))) - 1.0).max(1.0));
    if variances.iter().all(|variance| *variance == 0.0) {
        variances.fill(f32::NAN);
    } else if let Some(samples) = samples {
        // One sample shows no variance.
        for (variance, samples) in variances.iter_mut().zip(samples) {
            if *variance == 0.0 && (*samples > 0.0 && *samples < 2.0) {
                *variance = f32::NAN;
            }
        }
    }
    let lower = smoothed_lower_bound(layers.width, layers.height, cost, &variances, dof, objects);
    let plane = |metric| layers.metric(metric).unwrap_or_default();
    let input = HotspotInput {
        width: layers.width,
        height: layers.height,
        cost,
        lower: &lower,
        objects,
        rays: plane(Metric::Rays),
        shadow_rays: plane(Metric::RaysShadow),
        nodes: plane(Metric::Nodes),
        shapes: plane(Metric::Shapes),
        // In units of intersection cost alone is it a share of it.
        waste: if metric == Metric::Intersection { plane(Metric::Waste) } else { &[] },
    };
    find(&input, names, most)
}

/// The object that each pixel's camera rays hit first, [`NONE`] for the background, row by row from the top.
pub fn first_objects(frame: &Frame) -> Vec<u32> {
    frame.pixels().map(|(x, y)| frame.with_cost_total(x, y, |total| total.first_object)).collect()
}

/// The hotspots of a picture by falling excess: `most`, and while these hold less than half of the excess further ones, up to
/// four times as many. `names[object]` names an object.
///
/// # Panics
/// When a plane that is not empty does not hold width × height values.
pub fn find(input: &HotspotInput<'_>, names: &[String], most: usize) -> Vec<Hotspot> {
    let cost = input.cost;
    let pixels = input.width as usize * input.height as usize;
    assert_eq!(cost.len(), pixels, "the cost plane does not fit its size");
    for plane in [input.lower, input.rays, input.shadow_rays, input.nodes, input.shapes, input.waste] {
        assert!(plane.is_empty() || plane.len() == pixels, "a plane does not fit the picture");
    }
    let total: f64 = cost.iter().map(|c| f64::from(*c)).sum();
    let mean = total / pixels as f64;
    if !total.is_finite() || total <= 0.0 {
        return Vec::new();
    }
    let smoothed;
    let lower = if input.lower.is_empty() {
        smoothed = smoothed_lower_bound(
            input.width,
            input.height,
            cost,
            &vec![f32::NAN; pixels],
            1.0,
            input.objects,
        );
        &smoothed
    } else {
        input.lower
    };
    let all_excess: f64 = cost.iter().map(|c| (f64::from(*c) - mean).max(0.0)).sum();
    let ordinary = Means::of(input, &ordinary_pixels(cost, input.objects));
    let mut found: Vec<Hotspot> = components(input, |index| f64::from(lower[index]) > mean)
        .into_iter()
        .filter(|members| members.len() >= MIN_PIXELS)
        .filter_map(|members| {
            let sum: f64 = members.iter().map(|index| f64::from(cost[*index])).sum();
            let excess = sum - mean * members.len() as f64;
            // A sum over something that hardly stands out may round to nothing.
            if excess <= 0.0 {
                return None;
            }
            let bbox = bounds(&members, input.width as usize);
            let object = input.objects.get(members[0]).copied().filter(|object| *object != NONE);
            let members: Vec<u32> = members.into_iter().map(|index| index as u32).collect();
            let factors = Means::of(input, &members).against(&ordinary);
            Some(Hotspot {
                rank: 0,
                bbox,
                pixels: members.len(),
                pixel_share: members.len() as f64 / pixels as f64,
                cost_share: sum / total,
                excess,
                excess_share: excess / all_excess,
                object,
                name: object.and_then(|object| names.get(object as usize).cloned()),
                factors,
                cause: words::by_ratios(&factors),
                members,
                ..Hotspot::default()
            })
        })
        .collect();
    found.sort_by(|a, b| b.excess.total_cmp(&a.excess).then(a.bbox.cmp(&b.bbox)));
    let mut explained = 0.0;
    let needed = found.iter().take_while(|hotspot| {
        let more = explained < HALF;
        explained += hotspot.excess_share;
        more
    });
    let needed = needed.count();
    found.truncate(most.max(needed.min(PATIENCE * most)));
    for (index, hotspot) in found.iter_mut().enumerate() {
        hotspot.rank = index + 1;
    }
    found
}

/// 8-connected components of the pixels that `hot` accepts, each of one object.
fn components(input: &HotspotInput<'_>, hot: impl Fn(usize) -> bool) -> Vec<Vec<usize>> {
    let (width, height) = (input.width as usize, input.height as usize);
    let object = |index: usize| input.objects.get(index).copied().unwrap_or(NONE);
    let mut open: Vec<bool> = (0..width * height).map(hot).collect();
    let mut components = Vec::new();
    for start in 0..open.len() {
        if !open[start] {
            continue;
        }
        open[start] = false;
        let mut members = vec![start];
        let mut next = 0;
        while let Some(index) = members.get(next).copied() {
            next += 1;
            let (x, y) = (index % width, index / width);
            for row in y.saturating_sub(1)..(y + 2).min(height) {
                for column in x.saturating_sub(1)..(x + 2).min(width) {
                    let neighbour = row * width + column;
                    if open[neighbour] && object(neighbour) == object(start) {
                        open[neighbour] = false;
                        members.push(neighbour);
                    }
                }
            }
        }
        components.push(members);
    }
    components
}

fn bounds(members: &[usize], width: usize) -> [u32; 4] {
    let mut bbox = [u32::MAX, u32::MAX, 0, 0];
    for index in members {
        let (x, y) = ((index % width) as u32, (index / width) as u32);
        bbox = [bbox[0].min(x), bbox[1].min(y), bbox[2].max(x + 1), bbox[3].max(y + 1)];
    }
    bbox
}

#[cfg(test)]
mod tests;
