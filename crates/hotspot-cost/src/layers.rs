//! The planes of a picture: what its EXR file holds, as means per path in f32.
//!
//! Each value is a sum divided by the number of paths, in f64, rounded once to f32. Pixels without samples are 0.
//!
//! With intervals a frame keeps two halves, a and b. The mean of a pixel is the mean of all its samples;
//! `half.X = (mean of a − mean of b)/2`. Where both halves have as many samples (what the renderer does) a = mean + half
//! and b = mean − half, up to rounding, and half² estimates the variance of the mean with one degree of freedom. Where
//! they have not, a and b do not follow from mean and half, and half² is larger on average: (s²/n_a + s²/n_b)/4 ≥
//! s²/(n_a + n_b), so intervals err on the wide side. Where a half has no samples nothing is known of the spread: half is 0,
//! and no interval is made of it.

use crate::frame::Frame;
use crate::metric::{CostModel, Metric};
use crate::metric_set::MetricSet;
use crate::recorder::{CostPixel, FilmPixel, Rect};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Channels of the radiance and their names after `half.` and `var.`.
pub const RADIANCE: [(&str, &str); 3] = [("R", "red"), ("G", "green"), ("B", "blue")];

/// What to make of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LayerOptions {
    /// The constants of equation 1.
    pub model: CostModel,
    /// Metrics to keep.
    pub metrics: MetricSet,
    /// Keep radiance: R, G, B, A.
    pub radiance: bool,
    /// Add `var.*`: s²/n, an upper bound of the variance of a pixel's mean (its samples are stratified); 0 where a pixel
    /// has fewer than two samples.
    pub var: bool,
}

impl Default for LayerOptions {
    fn default() -> Self {
        Self { model: CostModel::default(), metrics: MetricSet::ALL, radiance: true, var: false }
    }
}

/// Named planes of one size, row by row from the top.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Layers {
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Channel name → width × height values.
    pub planes: BTreeMap<String, Vec<f32>>,
}

impl Layers {
    /// No planes yet.
    pub const fn new(width: u32, height: u32) -> Self {
        Self { width, height, planes: BTreeMap::new() }
    }

    /// Values in a plane.
    pub const fn pixels(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// The plane of that channel name.
    pub fn plane(&self, name: &str) -> Option<&[f32]> {
        self.planes.get(name).map(Vec::as_slice)
    }

    /// The means of a metric.
    pub fn metric(&self, metric: Metric) -> Option<&[f32]> {
        self.plane(&metric.layer())
    }

    /// Its half differences.
    pub fn half(&self, metric: Metric) -> Option<&[f32]> {
        self.plane(&format!("half.{}", metric.name()))
    }

    /// Its variances of the mean (upper bounds).
    pub fn var(&self, metric: Metric) -> Option<&[f32]> {
        self.plane(&format!("var.{}", metric.name()))
    }

    /// The metrics present, in the order of [`Metric::ALL`].
    pub fn metrics(&self) -> impl Iterator<Item = Metric> {
        Metric::ALL.into_iter().filter(|metric| self.metric(*metric).is_some())
    }

    /// Planes named `cost.*` that are no metric known here: other programs' costs.
    pub fn foreign_cost(&self) -> Vec<&str> {
        self.planes
            .keys()
            .map(String::as_str)
            .filter(|name| {
                name.strip_prefix("cost.").is_some_and(|rest| !rest.is_empty() && rest != "samples")
                    && !Metric::ALL.iter().any(|metric| metric.layer() == *name)
            })
            .collect()
    }

    /// Adds a plane.
    ///
    /// # Panics
    /// When it does not hold width × height values.
    pub fn insert(&mut self, name: impl Into<String>, plane: Vec<f32>) {
        let name = name.into();
        assert_eq!(plane.len(), self.pixels(), "plane {name} does not fit the picture");
        self.planes.insert(name, plane);
    }

    /// The planes of a frame. A is 1 everywhere; a renderer that knows where its camera rays miss may overwrite it.
    /// `half.*` is there when the frame keeps halves, `half.time_us` too: as the spread of two runs, never as an interval.
    /// Works in the caller's thread pool.
    pub fn from_frame(frame: &Frame, options: &LayerOptions) -> Self {
        let (width, height) = (frame.desc().width, frame.desc().height);
        let mut layers = Self::new(width, height);
        let wanted = wanted(frame, options);
        let mut planes: Vec<Vec<f32>> = wanted.iter().map(|_| vec![0.0; layers.pixels()]).collect();
        // Pixel by pixel, since its sums are far larger than what a plane wants of them; as many rows at a time as tiles have.
        let rows = frame.desc().tile as usize;
        let mut bands: Vec<Vec<&mut [f32]>> = Vec::new();
        bands.resize_with((height as usize).div_ceil(rows), Vec::new);
        for plane in &mut planes {
            for (band, part) in bands.iter_mut().zip(plane.chunks_mut(rows * width as usize)) {
                band.push(part);
            }
        }
        bands.into_par_iter().enumerate().for_each(|(band, mut parts)| {
            let part = Rect { x: 0, y: (band * rows) as u32, width, height: rows as u32 };
            let whole = Rect { x: 0, y: 0, width, height };
            for (place, (x, y)) in whole.intersection(&part).pixels().enumerate() {
                let film = frame.film_total(x, y);
                frame.with_cost_total(x, y, |cost| {
                    let pixel = Pixel {
                        films: [0, 1].map(|half| frame.film(x, y, half)),
                        costs: [0, 1].map(|half| frame.cost(x, y, half)),
                        film: &film,
                        cost,
                        model: options.model,
                    };
                    for (value, part) in wanted.iter().map(|(_, value)| value).zip(&mut parts) {
                        part[place] = value.of(&pixel);
                    }
                });
            }
        });
        for ((name, _), plane) in wanted.into_iter().zip(planes) {
            layers.insert(name, plane);
        }
        if options.radiance {
            layers.insert("A", vec![1.0; layers.pixels()]);
        }
        layers
    }
}

/// The names of a frame's planes and what they hold.
fn wanted(frame: &Frame, options: &LayerOptions) -> Vec<(String, Value)> {
    let intervals = frame.desc().intervals;
    let mut wanted = vec![("samples".to_owned(), Value::Samples)];
    if options.radiance {
        for (channel, (name, long)) in RADIANCE.into_iter().enumerate() {
            wanted.push((name.to_owned(), Value::Radiance(channel)));
            if intervals {
                wanted.push((format!("half.{long}"), Value::RadianceHalf(channel)));
            }
            if options.var {
                wanted.push((format!("var.{long}"), Value::RadianceVariance(channel)));
            }
        }
    }
    if !frame.desc().cost {
        return wanted;
    }
    wanted.push(("cost.samples".to_owned(), Value::CostSamples));
    for metric in options.metrics.iter().filter(|metric| metric.in_layers()) {
        wanted.push((metric.layer(), Value::Cost(metric)));
        if intervals {
            wanted.push((format!("half.{}", metric.name()), Value::CostHalf(metric)));
        }
        if options.var && metric.squares(&CostPixel::default(), options.model).is_some() {
            wanted.push((format!("var.{}", metric.name()), Value::CostVariance(metric)));
        }
    }
    wanted
}

/// What a plane holds of each pixel; radiance by channel.
#[derive(Clone, Copy, Debug)]
enum Value {
    Samples,
    Radiance(usize),
    RadianceHalf(usize),
    RadianceVariance(usize),
    CostSamples,
    Cost(Metric),
    CostHalf(Metric),
    CostVariance(Metric),
}

/// The sums of a pixel: of its halves (the first alone without any), and in all.
struct Pixel<'a> {
    films: [Option<&'a FilmPixel>; 2],
    costs: [Option<&'a CostPixel>; 2],
    film: &'a FilmPixel,
    cost: &'a CostPixel,
    model: CostModel,
}

impl Value {
    fn of(self, pixel: &Pixel<'_>) -> f32 {
        let &Pixel { film, cost, model, .. } = pixel;
        match self {
            Self::Samples => film.samples as f32,
            Self::Radiance(channel) => mean(film.sum[channel], film.samples) as f32,
            Self::RadianceHalf(channel) => {
                half(pixel.films.map(|film| film.map_or((0.0, 0), |f| (f.sum[channel], f.samples))))
            }
            Self::RadianceVariance(channel) => {
                variance_of_mean(film.sum[channel], film.squares[channel], film.samples).unwrap_or(0.0) as f32
            }
            Self::CostSamples => cost.samples as f32,
            Self::Cost(metric) => mean(metric.sum(cost, model), metric.samples(cost)) as f32,
            Self::CostHalf(metric) => half(
                pixel.costs.map(|cost| cost.map_or((0.0, 0), |c| (metric.sum(c, model), metric.samples(c)))),
            ),
            Self::CostVariance(metric) => metric
                .squares(cost, model)
                .and_then(|squares| variance_of_mean(metric.sum(cost, model), squares, cost.samples))
                .unwrap_or(0.0) as f32,
        }
    }
}

/// Sum over count, 0 of nothing.
pub(crate) fn mean(sum: f64, samples: u64) -> f64 {
    if samples == 0 { 0.0 } else { sum / samples as f64 }
}

/// Half the difference of two halves' means, from their sums and samples; 0 when a half is empty.
fn half([a, b]: [(f64, u64); 2]) -> f32 {
    if a.1 == 0 || b.1 == 0 {
        return 0.0;
    }
    (0.5 * (mean(a.0, a.1) - mean(b.0, b.1))) as f32
}

/// s²/n with s² = (Σx² − (Σx)²/n)/(n − 1), at least 0; `None` for fewer than two samples.
pub(crate) fn variance_of_mean(sum: f64, squares: f64, samples: u64) -> Option<f64> {
    if samples < 2 {
        return None;
    }
    let n = samples as f64;
    Some(((squares - sum * sum / n) / (n - 1.0)).max(0.0) / n)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::random_frame;
    use crate::{FrameDesc, PathEnd};
    use hotspot_probe::Spawner;

    /// Paths with the given node counts in a half of pixel 0.
    fn add(frame: &mut Frame, half: usize, nodes: &[u32]) {
        for nodes in nodes {
            let tile = &mut frame.tiles_mut()[0];
            tile.film_mut(0, 0, half).add([*nodes as f32, 0.0, 0.0]);
            let mut pixel = tile.pixel(0, 0, half);
            let mut path = pixel.path();
            path.add_ray(Spawner::CAMERA, *nodes, 1, true);
            path.end(PathEnd {
                cause: crate::Cause::Escaped,
                throughput: 0.5,
                brought_radiance: true,
                first_object: 0,
            });
        }
    }

    #[test]
    fn the_names_are_those_of_the_format() {
        let frame = random_frame(FrameDesc { intervals: true, ..FrameDesc::new(4, 4) }, 2, 1);
        let layers = Layers::from_frame(&frame, &LayerOptions { var: true, ..LayerOptions::default() });
        let mut expected: Vec<String> =
            ["R", "G", "B", "A", "samples", "cost.samples"].map(String::from).to_vec();
        let cost = [
            "rays",
            "rays_shadow",
            "nodes",
            "nodes_shadow",
            "shapes",
            "shapes_shadow",
            "intersection",
            "intersection_shadow",
            "time_us",
            "boxes",
            "leaves",
            "instances",
            "bsdf",
            "texture",
            "texture_bytes",
            "alpha_tests",
            "waste",
        ];
        let cause = ["throughput", "escaped", "absorbed", "roulette", "depth_limit"];
        for name in cost {
            expected.extend([format!("cost.{name}"), format!("half.{name}")]);
        }
        for name in cause {
            expected.extend([format!("cause.{name}"), format!("half.cause.{name}")]);
        }
        expected.extend(["red", "green", "blue"].map(|name| format!("half.{name}")));
        let var = ["red", "green", "blue", "rays", "nodes", "shapes", "intersection"];
        expected.extend(var.map(|name| format!("var.{name}")));
        expected.extend(
            ["escaped", "absorbed", "roulette", "depth_limit"].map(|name| format!("var.cause.{name}")),
        );
        expected.sort();
        let names: Vec<&String> = layers.planes.keys().collect();
        assert_eq!(names, expected.iter().collect::<Vec<_>>());
    }

    /// Frames of several tiles, the last ones smaller: each pixel's planes are of its own sums.
    #[test]
    fn planes_hold_the_means_of_their_pixels() {
        for (intervals, tile, size) in [(false, 16, (37, 35)), (true, 5, (11, 13)), (false, 64, (9, 3))] {
            let desc = FrameDesc { intervals, tile, ..FrameDesc::new(size.0, size.1) };
            let frame = random_frame(desc, 3, 7);
            let options = LayerOptions { var: true, ..LayerOptions::default() };
            let layers = Layers::from_frame(&frame, &options);
            for (index, (x, y)) in frame.pixels().enumerate() {
                let (film, cost) = (frame.film_total(x, y), frame.cost_total(x, y));
                let at = |name: &str| layers.plane(name).unwrap()[index];
                assert_eq!(at("G"), (film.sum[1] / film.samples as f64) as f32);
                assert_eq!((at("samples"), at("cost.samples")), (film.samples as f32, cost.samples as f32));
                let nodes = Metric::Nodes.sum(&cost, options.model);
                assert_eq!(at("cost.nodes"), (nodes / cost.samples as f64) as f32);
                let squares = cost.squares[1] - nodes * nodes / cost.samples as f64;
                let (n, var) = (cost.samples as f64, f64::from(at("var.nodes")));
                assert!((var - squares.max(0.0) / (n - 1.0) / n).abs() <= 1e-6 * var, "{var}");
                if intervals {
                    let [a, b] = [0, 1].map(|half| frame.cost(x, y, half).unwrap());
                    let [a, b] = [a, b].map(|c| Metric::Nodes.sum(c, options.model) / c.samples as f64);
                    assert_eq!(at("half.nodes"), (0.5 * (a - b)) as f32);
                }
            }
        }
    }

    #[test]
    fn halves_give_back_both_means() {
        let mut frame = Frame::new(FrameDesc { intervals: true, ..FrameDesc::new(2, 1) });
        add(&mut frame, 0, &[10, 20]);
        add(&mut frame, 1, &[2, 4]);
        let layers = Layers::from_frame(&frame, &LayerOptions { var: true, ..LayerOptions::default() });
        let at = |name: &str| layers.plane(name).unwrap()[0];
        assert_eq!((at("cost.nodes"), at("half.nodes")), (9.0, 6.0));
        assert_eq!((at("R"), at("half.red"), at("A")), (9.0, 6.0, 1.0));
        assert_eq!((at("cost.intersection"), at("half.intersection")), (10.0, 6.0));
        assert_eq!((at("samples"), at("cost.samples")), (4.0, 4.0));
        // s² of 10, 20, 2, 4 is (100 + 400 + 4 + 16 − 4·81)/3.
        assert!((at("var.nodes") - 196.0 / 3.0 / 4.0).abs() < 1e-5);
        assert_eq!(at("var.nodes"), at("var.intersection"));
        // The other pixel has no samples.
        for (name, plane) in &layers.planes {
            assert_eq!(plane[1], if name == "A" { 1.0 } else { 0.0 }, "{name}");
        }
    }

    #[test]
    fn unequal_halves_keep_the_mean_of_all_samples() {
        let mut frame = Frame::new(FrameDesc { intervals: true, ..FrameDesc::new(1, 1) });
        add(&mut frame, 0, &[10, 10, 10]);
        add(&mut frame, 1, &[2]);
        let layers = Layers::from_frame(&frame, &LayerOptions::default());
        assert_eq!((layers.planes["cost.nodes"][0], layers.planes["half.nodes"][0]), (8.0, 4.0));
    }

    #[test]
    fn an_empty_half_says_nothing() {
        let mut frame = Frame::new(FrameDesc { intervals: true, ..FrameDesc::new(1, 1) });
        add(&mut frame, 0, &[10]);
        let layers = Layers::from_frame(&frame, &LayerOptions::default());
        assert_eq!(layers.planes["cost.nodes"][0], 10.0);
        for (name, plane) in layers.planes.iter().filter(|(name, _)| name.starts_with("half.")) {
            assert_eq!(plane[0], 0.0, "{name}");
        }
    }

    #[test]
    fn foreign_costs_are_told_from_known_ones() {
        let mut layers = Layers::new(1, 1);
        for name in
            ["cost.nodes", "cost.samples", "cost.bvh_visits", "cost.", "R", "half.x", "cost.Texture (KiB)"]
        {
            layers.insert(name, vec![1.0]);
        }
        assert_eq!(layers.foreign_cost(), ["cost.Texture (KiB)", "cost.bvh_visits"]);
    }

    #[test]
    fn only_what_was_chosen_is_kept() {
        let frame = random_frame(FrameDesc::new(4, 4), 2, 1);
        let metrics = MetricSet::parse("rays").unwrap();
        let options = LayerOptions { metrics, radiance: false, ..LayerOptions::default() };
        let layers = Layers::from_frame(&frame, &options);
        let names: Vec<&str> = layers.planes.keys().map(String::as_str).collect();
        assert_eq!(names, ["cost.rays", "cost.rays_shadow", "cost.samples", "samples"]);
    }
}
