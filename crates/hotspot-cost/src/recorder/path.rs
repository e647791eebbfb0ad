//! The counts of one path, and their sums over one visit of a pixel.
//!
//! A visit of a ray adds to its path's counts at once, so that a ray has nothing to hand over when it ends; a path's counts are
//! added as a whole; the pixel is written once per visit.

use super::{CostPixel, PathEnd};
use crate::counter::{Cause, Counter};
use crate::depth_cut::DepthCut;
use hotspot_probe::{Probe, RayKind, RayProbe, Spawner};

/// Which of a pair of sums shadow rays have; the other is that of camera and bounce rays.
const SHADOW: usize = 1;

/// Sums by kind of ray, and what no kind is asked of.
#[derive(Clone, Copy, Debug, Default)]
struct Counts {
    rays: [u64; 2],
    nodes: [u64; 2],
    boxes: [u64; 2],
    leaves: [u64; 2],
    shapes: [u64; 2],
    instances: [u64; 2],
    bsdf: u64,
    texture: u64,
    texture_bytes: u64,
    alpha_tests: u64,
}

impl Counts {
    #[inline(always)]
    fn add(&mut self, other: &Self) {
        for kind in 0..2 {
            self.rays[kind] += other.rays[kind];
            self.nodes[kind] += other.nodes[kind];
            self.boxes[kind] += other.boxes[kind];
            self.leaves[kind] += other.leaves[kind];
            self.shapes[kind] += other.shapes[kind];
            self.instances[kind] += other.instances[kind];
        }
        self.bsdf += other.bsdf;
        self.texture += other.texture;
        self.texture_bytes += other.texture_bytes;
        self.alpha_tests += other.alpha_tests;
    }
}

/// The counts of one path: the [`Probe`] to hand to a path loop, to be added to its pixel ([`PixelVisit::add`]).
#[derive(Clone, Copy, Debug, Default)]
pub struct PathCounts {
    counts: Counts,
    /// Nodes and shapes of blocked shadow rays.
    blocked: [u64; 2],
    /// Light among the last terms before the depth limit, and whether there was any.
    cut: DepthCut,
    near_limit: bool,
}

impl PathCounts {
    /// Adds visits of nodes with their boxes, and of leaf blocks with their shapes.
    #[inline(always)]
    pub(crate) fn add_visits(&mut self, shadow: bool, [nodes, boxes]: [u64; 2], [leaves, shapes]: [u64; 2]) {
        let kind = usize::from(shadow);
        self.counts.nodes[kind] += nodes;
        self.counts.boxes[kind] += boxes;
        self.counts.leaves[kind] += leaves;
        self.counts.shapes[kind] += shapes;
    }

    /// Of the visits that were added these were of blocked shadow rays.
    #[inline(always)]
    pub(crate) fn add_blocked(&mut self, nodes: u64, shapes: u64) {
        self.blocked[0] += nodes;
        self.blocked[1] += shapes;
    }

    pub(crate) fn add_instances(&mut self, shadow: bool, instances: u64) {
        self.counts.instances[usize::from(shadow)] += instances;
    }

    /// Adds an alpha test of any ray.
    #[inline(always)]
    pub(crate) fn add_alpha(&mut self, lookups: u32, bytes: u32) {
        self.counts.alpha_tests += 1;
        self.texture(lookups, bytes);
    }
}

impl Probe for PathCounts {
    const ON: bool = true;
    type Ray<'r> = RayCounter<'r>;

    #[inline(always)]
    fn ray(&mut self, by: Spawner) -> RayCounter<'_> {
        self.untraced(by);
        let before = [self.counts.nodes[SHADOW], self.counts.shapes[SHADOW]];
        RayCounter { kind: usize::from(by.kind == RayKind::Shadow), before, path: self }
    }

    #[inline(always)]
    fn untraced(&mut self, by: Spawner) {
        self.counts.rays[usize::from(by.kind == RayKind::Shadow)] += 1;
    }

    #[inline(always)]
    fn bsdf(&mut self, evaluations: u32) {
        self.counts.bsdf += u64::from(evaluations);
    }

    #[inline(always)]
    fn texture(&mut self, lookups: u32, bytes: u32) {
        self.counts.texture += u64::from(lookups);
        self.counts.texture_bytes += u64::from(bytes);
    }

    #[inline(always)]
    fn light(&mut self, left: u32, luminance: f32) {
        self.near_limit |= self.cut.arrive(left, luminance);
    }
}

/// Counts one ray's traversal, visit by visit; it must be finished, or a blocked shadow ray counts as one that was not.
#[derive(Debug)]
pub struct RayCounter<'r> {
    path: &'r mut PathCounts,
    /// Which of each pair of sums.
    kind: usize,
    /// Nodes and shapes of the path's shadow rays before this one.
    before: [u64; 2],
}

impl RayProbe for RayCounter<'_> {
    #[inline(always)]
    fn node(&mut self, _id: u32, boxes: u32) {
        self.path.counts.nodes[self.kind] += 1;
        self.path.counts.boxes[self.kind] += u64::from(boxes);
    }

    #[inline(always)]
    fn leaf(&mut self, _id: u32, shapes: u32) {
        self.path.counts.leaves[self.kind] += 1;
        self.path.counts.shapes[self.kind] += u64::from(shapes);
    }

    #[inline(always)]
    fn instance(&mut self, _id: u32) {
        self.path.counts.instances[self.kind] += 1;
    }

    #[inline(always)]
    fn alpha(&mut self, lookups: u32, bytes: u32) {
        self.path.add_alpha(lookups, bytes);
    }

    #[inline(always)]
    fn finish(self, hit: bool) {
        if self.kind == SHADOW && hit {
            let Counts { nodes, shapes, .. } = self.path.counts;
            self.path.add_blocked(nodes[SHADOW] - self.before[0], shapes[SHADOW] - self.before[1]);
        }
    }
}

/// A visit of a pixel: its paths' integer sums on the way to the pixel, which has them when the visit is dropped. Sums of floats
/// are the pixel's own, so that they do not depend on how samples are split into visits.
#[derive(Debug)]
pub struct PixelVisit<'t> {
    pixel: &'t mut CostPixel,
    counts: Counts,
    /// Nodes and shapes.
    waste: [u64; 2],
    /// Paths by [`Cause`].
    causes: [u64; 4],
}

impl<'t> PixelVisit<'t> {
    #[inline(always)]
    pub(super) fn new(pixel: &'t mut CostPixel) -> Self {
        Self { pixel, counts: Counts::default(), waste: [0; 2], causes: [0; 4] }
    }

    /// Adds a path that has ended.
    #[inline(always)]
    pub fn add(&mut self, path: &PathCounts, end: PathEnd) {
        let Self { pixel, counts, waste, causes } = self;
        counts.add(&path.counts);
        let all = |[others, shadow]: [u64; 2]| others + shadow;
        let (nodes, shapes) = (all(path.counts.nodes), all(path.counts.shapes));
        let wasted = if end.brought_radiance { path.blocked } else { [nodes, shapes] };
        waste[0] += wasted[0];
        waste[1] += wasted[1];
        causes[end.cause as usize] += 1;
        // By way of i64, one instruction each: nothing is ever as large as its sign bit.
        let real = |count: u64| count as i64 as f64;
        let (rays, nodes, shapes) = (real(all(path.counts.rays)), real(nodes), real(shapes));
        pixel.squares[0] += rays * rays;
        pixel.squares[1] += nodes * nodes;
        pixel.squares[2] += shapes * shapes;
        pixel.squares[3] += nodes * shapes;
        pixel.throughput += f64::from(end.throughput);
        if end.cause == Cause::DepthLimit {
            pixel.cut.throughput += f64::from(end.throughput);
        }
        // Radiance that is not finite counts as none; few paths find light so near the limit.
        if path.near_limit && end.brought_radiance {
            pixel.cut.add(&path.cut);
        }
        if pixel.samples == 0 {
            pixel.first_object = end.first_object;
        }
        pixel.samples += 1;
    }
}

impl Drop for PixelVisit<'_> {
    #[inline(always)]
    fn drop(&mut self) {
        let Self { pixel, counts, waste, causes } = self;
        let mut both = |of: [u64; 2], all: Counter, shadow: Counter| {
            pixel.add(all, of[0] + of[1]);
            pixel.add(shadow, of[SHADOW]);
        };
        both(counts.rays, Counter::Rays, Counter::RaysShadow);
        both(counts.nodes, Counter::Nodes, Counter::NodesShadow);
        both(counts.shapes, Counter::Shapes, Counter::ShapesShadow);
        both(counts.boxes, Counter::Boxes, Counter::BoxesShadow);
        both(counts.leaves, Counter::Leaves, Counter::LeavesShadow);
        both(counts.instances, Counter::Instances, Counter::InstancesShadow);
        pixel.add(Counter::Bsdf, counts.bsdf);
        pixel.add(Counter::Texture, counts.texture);
        pixel.add(Counter::TextureBytes, counts.texture_bytes);
        pixel.add(Counter::AlphaTests, counts.alpha_tests);
        pixel.add(Counter::WasteNodes, waste[0]);
        pixel.add(Counter::WasteShapes, waste[1]);
        for cause in [Cause::Escaped, Cause::Absorbed, Cause::Roulette, Cause::DepthLimit] {
            pixel.add(cause.counter(), causes[cause as usize]);
        }
    }
}
