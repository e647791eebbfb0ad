//! The metrics: names, units, words for people, and how each follows from a pixel's sums.
//!
//! A metric is a mean per path (camera sample): a sum over the paths of a pixel, divided by their number. Equations 1 and
//! 2 of the paper: `C(r) = c0·nodes + c1·shapes`, summed over a path's tracing and shadow rays with weight 1.

mod words;

use crate::counter::Counter;
use crate::recorder::CostPixel;
use serde::{Deserialize, Serialize};

/// The constants of equation 1. They make `intersection` and `waste` out of `nodes` and `shapes`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CostModel {
    /// Cost of visiting a node, at least 0.
    pub c0: f64,
    /// Cost of testing a triangle, at least 0.
    pub c1: f64,
}

impl Default for CostModel {
    /// The paper's units: 1 and 1.
    fn default() -> Self {
        Self { c0: 1.0, c1: 1.0 }
    }
}

/// The exact form of a metric's sum over paths.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Sum {
    /// An integer.
    Exact(u64),
    /// Rounded.
    Real(f64),
}

impl Sum {
    /// As f64, rounded to nearest.
    pub const fn as_f64(self) -> f64 {
        match self {
            Self::Exact(value) => value as f64,
            Self::Real(value) => value,
        }
    }
}

/// What makes up a metric's sum.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Source {
    One(Counter),
    /// c0·first + c1·second.
    Weighted(Counter, Counter),
    Time,
    Throughput,
}

/// One metric.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[repr(u8)]
pub enum Metric {
    /// Rays cast.
    Rays,
    /// … shadow rays.
    RaysShadow,
    /// Tree nodes visited.
    Nodes,
    /// … by shadow rays.
    NodesShadow,
    /// Triangles tested.
    Shapes,
    /// … by shadow rays.
    ShapesShadow,
    /// c0·nodes + c1·shapes.
    Intersection,
    /// … of shadow rays.
    IntersectionShadow,
    /// Child boxes tested.
    Boxes,
    /// … by shadow rays.
    BoxesShadow,
    /// Leaf blocks tested.
    Leaves,
    /// … by shadow rays.
    LeavesShadow,
    /// Rays transformed into an instance's space.
    Instances,
    /// … shadow rays.
    InstancesShadow,
    /// Intersection cost that brought nothing.
    Waste,
    /// Microseconds.
    TimeUs,
    /// BSDF evaluations and samplings.
    Bsdf,
    /// Texture look-ups.
    Texture,
    /// Bytes of texels touched.
    TextureBytes,
    /// Alpha tests.
    AlphaTests,
    /// Throughput at the path's end.
    Throughput,
    /// Share of paths that left the scene.
    Escaped,
    /// Share of paths with nothing left to carry.
    Absorbed,
    /// Share of paths that roulette ended.
    Roulette,
    /// Share of paths that reached the maximum depth.
    DepthLimit,
}

impl Metric {
    /// All of them.
    pub const ALL: [Self; 25] = [
        Self::Rays,
        Self::RaysShadow,
        Self::Nodes,
        Self::NodesShadow,
        Self::Shapes,
        Self::ShapesShadow,
        Self::Intersection,
        Self::IntersectionShadow,
        Self::Boxes,
        Self::BoxesShadow,
        Self::Leaves,
        Self::LeavesShadow,
        Self::Instances,
        Self::InstancesShadow,
        Self::Waste,
        Self::TimeUs,
        Self::Bsdf,
        Self::Texture,
        Self::TextureBytes,
        Self::AlphaTests,
        Self::Throughput,
        Self::Escaped,
        Self::Absorbed,
        Self::Roulette,
        Self::DepthLimit,
    ];

    /// Name in JSON, on the command line, and after `half.`, `var.`, `diff.`: `nodes`, `nodes_shadow`, `cause.escaped`.
    pub const fn name(self) -> &'static str {
        self.words().0
    }

    /// Name of its EXR channel: `cost.nodes`, `cause.escaped`.
    pub fn layer(self) -> String {
        match self {
            Self::Throughput | Self::Escaped | Self::Absorbed | Self::Roulette | Self::DepthLimit => {
                self.name().to_owned()
            }
            _ => format!("cost.{}", self.name()),
        }
    }

    /// Whether EXR files hold it. Totals hold all; the shadow parts of boxes, leaves and instances are only there.
    pub const fn in_layers(self) -> bool {
        !matches!(self, Self::BoxesShadow | Self::LeavesShadow | Self::InstancesShadow)
    }

    /// For a heading: "Intersection cost".
    pub const fn label(self) -> &'static str {
        self.words().1
    }

    /// Unit of the mean: "rays per path".
    pub const fn unit(self) -> &'static str {
        self.words().2
    }

    /// One sentence for a tooltip.
    pub const fn description(self) -> &'static str {
        self.words().3
    }

    /// The metric of that [`Metric::name`] or [`Metric::layer`].
    pub fn from_name(name: &str) -> Option<Self> {
        let name = name.strip_prefix("cost.").unwrap_or(name);
        Self::ALL.into_iter().find(|metric| metric.name() == name)
    }

    /// The metric with shadow rays alone, where there is one.
    pub const fn shadow(self) -> Option<Self> {
        match self {
            Self::Rays => Some(Self::RaysShadow),
            Self::Nodes => Some(Self::NodesShadow),
            Self::Shapes => Some(Self::ShapesShadow),
            Self::Intersection => Some(Self::IntersectionShadow),
            Self::Boxes => Some(Self::BoxesShadow),
            Self::Leaves => Some(Self::LeavesShadow),
            Self::Instances => Some(Self::InstancesShadow),
            _ => None,
        }
    }

    /// Whether it depends on c0 and c1.
    pub const fn is_weighted(self) -> bool {
        matches!(self.source(), Source::Weighted(..))
    }

    const fn source(self) -> Source {
        match self {
            Self::Rays => Source::One(Counter::Rays),
            Self::RaysShadow => Source::One(Counter::RaysShadow),
            Self::Nodes => Source::One(Counter::Nodes),
            Self::NodesShadow => Source::One(Counter::NodesShadow),
            Self::Shapes => Source::One(Counter::Shapes),
            Self::ShapesShadow => Source::One(Counter::ShapesShadow),
            Self::Intersection => Source::Weighted(Counter::Nodes, Counter::Shapes),
            Self::IntersectionShadow => Source::Weighted(Counter::NodesShadow, Counter::ShapesShadow),
            Self::Boxes => Source::One(Counter::Boxes),
            Self::BoxesShadow => Source::One(Counter::BoxesShadow),
            Self::Leaves => Source::One(Counter::Leaves),
            Self::LeavesShadow => Source::One(Counter::LeavesShadow),
            Self::Instances => Source::One(Counter::Instances),
            Self::InstancesShadow => Source::One(Counter::InstancesShadow),
            Self::Waste => Source::Weighted(Counter::WasteNodes, Counter::WasteShapes),
            Self::TimeUs => Source::Time,
            Self::Bsdf => Source::One(Counter::Bsdf),
            Self::Texture => Source::One(Counter::Texture),
            Self::TextureBytes => Source::One(Counter::TextureBytes),
            Self::AlphaTests => Source::One(Counter::AlphaTests),
            Self::Throughput => Source::Throughput,
            Self::Escaped => Source::One(Counter::Escaped),
            Self::Absorbed => Source::One(Counter::Absorbed),
            Self::Roulette => Source::One(Counter::Roulette),
            Self::DepthLimit => Source::One(Counter::DepthLimit),
        }
    }

    /// Camera samples that its sum covers.
    pub const fn samples(self, pixel: &CostPixel) -> u64 {
        match self.source() {
            Source::Time => pixel.time_samples,
            _ => pixel.samples,
        }
    }

    /// The sum over a pixel's paths, in f64.
    pub fn sum(self, pixel: &CostPixel, model: CostModel) -> f64 {
        match self.source() {
            Source::One(counter) => pixel.get(counter) as f64,
            Source::Weighted(nodes, shapes) => {
                model.c0 * pixel.get(nodes) as f64 + model.c1 * pixel.get(shapes) as f64
            }
            Source::Time => pixel.time_ns as f64 / 1000.0,
            Source::Throughput => pixel.throughput,
        }
    }

    /// The sum over the paths of many pixels: exact for counts, and for the weighted metrics where c0 and c1 are whole
    /// numbers and the result fits 64 bits.
    pub fn total<'p>(self, pixels: impl Iterator<Item = &'p CostPixel>, model: CostModel) -> Sum {
        let sum = |counter: Counter, pixel: &CostPixel| u128::from(pixel.get(counter));
        let exact = |value: u128| u64::try_from(value).map_or(Sum::Real(value as f64), Sum::Exact);
        match self.source() {
            Source::One(counter) => exact(pixels.map(|pixel| sum(counter, pixel)).sum()),
            Source::Weighted(nodes, shapes) => {
                let (nodes, shapes) = pixels
                    .fold((0_u128, 0_u128), |(n, s), pixel| (n + sum(nodes, pixel), s + sum(shapes, pixel)));
                let whole =
                    |c: f64| (c >= 0.0 && c <= f64::from(u32::MAX) && c.fract() == 0.0).then_some(c as u128);
                let product = |c: f64, n: u128| whole(c).and_then(|c| c.checked_mul(n));
                match (product(model.c0, nodes), product(model.c1, shapes)) {
                    (Some(nodes), Some(shapes)) if nodes.checked_add(shapes).is_some() => {
                        exact(nodes + shapes)
                    }
                    _ => Sum::Real(model.c0 * nodes as f64 + model.c1 * shapes as f64),
                }
            }
            Source::Time => {
                Sum::Real(pixels.map(|pixel| u128::from(pixel.time_ns)).sum::<u128>() as f64 / 1000.0)
            }
            Source::Throughput => Sum::Real(pixels.map(|pixel| pixel.throughput).sum()),
        }
    }

    /// Σ over a pixel's paths of the metric's square, where it is known: rays, nodes, shapes, intersection, and the
    /// `cause` shares, whose values are 0 or 1. Intersection: (c0·n + c1·s)² = c0²n² + 2·c0·c1·ns + c1²s².
    pub fn squares(self, pixel: &CostPixel, model: CostModel) -> Option<f64> {
        let [rays, nodes, shapes, mixed] = pixel.squares;
        match self {
            Self::Rays => Some(rays),
            Self::Nodes => Some(nodes),
            Self::Shapes => Some(shapes),
            Self::Intersection => {
                let CostModel { c0, c1 } = model;
                Some(c0 * c0 * nodes + 2.0 * c0 * c1 * mixed + c1 * c1 * shapes)
            }
            Self::Escaped | Self::Absorbed | Self::Roulette | Self::DepthLimit => {
                Some(self.sum(pixel, model))
            }
            _ => None,
        }
    }
}
