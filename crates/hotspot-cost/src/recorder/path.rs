//! The counts of the paths of one visit of a pixel.
//!
//! A visit of a node adds to the counts of its pixel's visit at once, so that neither a ray nor a path has anything to hand over when
//! it ends; what is asked of single paths is the difference to what was counted before it. The pixel is written once per visit.

use super::{CostPixel, PathEnd, PathTally};
use crate::counter::{Cause, Counter};
use crate::depth_cut::{DepthCut, TERMS};
use hotspot_probe::{Probe, RayKind, RayProbe, Spawner};

/// Which of a pair of sums shadow rays have; the other is that of camera and bounce rays.
const SHADOW: usize = 1;

/// Sums of one kind of ray. What is added to at once or read at once is not side by side: compilers would make vectors of it, that
/// cannot be kept in a register during a traversal as two numbers can, and whose loads wait until what the last ray wrote has reached the cache.
#[derive(Clone, Copy, Debug, Default)]
struct Visits {
    nodes: u64,
    leaves: u64,
    rays: u64,
    /// Boxes less nodes and shapes less leaf blocks, modulo 2^64: traversals that know these numbers as one more than what is written
    /// in a word then need not add that one.
    boxes_beyond_nodes: u64,
    shapes_beyond_leaves: u64,
    instances: u64,
}

impl Visits {
    #[inline(always)]
    const fn boxes(&self) -> u64 {
        self.boxes_beyond_nodes.wrapping_add(self.nodes)
    }

    #[inline(always)]
    const fn shapes(&self) -> u64 {
        self.shapes_beyond_leaves.wrapping_add(self.leaves)
    }
}

/// Sums by kind of ray, and what no kind is asked of.
#[derive(Clone, Copy, Debug, Default)]
struct Counts {
    visits: [Visits; 2],
    bsdf: u64,
    texture: u64,
    texture_bytes: u64,
    alpha_tests: u64,
}

impl Counts {
    #[inline(always)]
    fn add(&mut self, other: &Self) {
        for (sum, more) in self.visits.iter_mut().zip(&other.visits) {
            sum.nodes += more.nodes;
            sum.leaves += more.leaves;
            sum.rays += more.rays;
            sum.boxes_beyond_nodes = sum.boxes_beyond_nodes.wrapping_add(more.boxes_beyond_nodes);
            sum.shapes_beyond_leaves = sum.shapes_beyond_leaves.wrapping_add(more.shapes_beyond_leaves);
            sum.instances += more.instances;
        }
        self.bsdf += other.bsdf;
        self.texture += other.texture;
        self.texture_bytes += other.texture_bytes;
        self.alpha_tests += other.alpha_tests;
    }

    /// Rays, nodes, shapes.
    #[inline(always)]
    fn totals(&self) -> [u64; 3] {
        let [others, shadow] = &self.visits;
        [others.rays + shadow.rays, others.nodes + shadow.nodes, others.shapes() + shadow.shapes()]
    }
}

/// The counts of a path and of those before it in the same visit of a pixel: the [`Probe`] to hand to a path loop
/// ([`PixelVisit::path`]), or, in a [`PathTally`], what few paths have.
#[derive(Debug)]
pub struct PathCounts {
    counts: Counts,
    /// Nodes and shapes of the path's blocked shadow rays.
    blocked: [u64; 2],
    /// The path's light among the last terms before the depth limit, and whether there was any.
    cut: DepthCut,
    near_limit: bool,
}

impl PathCounts {
    #[inline(always)]
    pub(super) fn none() -> Self {
        Self { counts: Counts::default(), blocked: [0; 2], cut: DepthCut::default(), near_limit: false }
    }

    /// Adds visits of nodes with their boxes, and of leaf blocks with their shapes.
    #[inline(always)]
    pub(crate) fn add_visits(&mut self, shadow: bool, [nodes, boxes]: [u64; 2], [leaves, shapes]: [u64; 2]) {
        let visits = &mut self.counts.visits[usize::from(shadow)];
        visits.nodes += nodes;
        visits.leaves += leaves;
        let (more_boxes, more_shapes) = (boxes.wrapping_sub(nodes), shapes.wrapping_sub(leaves));
        visits.boxes_beyond_nodes = visits.boxes_beyond_nodes.wrapping_add(more_boxes);
        visits.shapes_beyond_leaves = visits.shapes_beyond_leaves.wrapping_add(more_shapes);
    }

    /// Of the visits that were added these were of blocked shadow rays.
    #[inline(always)]
    pub(crate) fn add_blocked(&mut self, nodes: u64, shapes: u64) {
        self.blocked[0] += nodes;
        self.blocked[1] += shapes;
    }

    pub(crate) fn add_instances(&mut self, shadow: bool, instances: u64) {
        self.counts.visits[usize::from(shadow)].instances += instances;
    }

    /// Adds an alpha test of any ray.
    #[inline(always)]
    pub(crate) fn add_alpha(&mut self, lookups: u32, bytes: u32) {
        self.counts.alpha_tests += 1;
        self.add_texture(lookups, bytes);
    }

    /// Adds look-ups of textures.
    #[inline(always)]
    pub(super) fn add_texture(&mut self, lookups: u32, bytes: u32) {
        self.counts.texture += u64::from(lookups);
        self.counts.texture_bytes += u64::from(bytes);
    }

    /// Whether light that could have been scattered `left` times more is kept.
    #[inline(always)]
    pub(super) const fn near_limit(left: u32) -> bool {
        (left as usize) < TERMS
    }

    /// Adds light.
    #[inline(always)]
    pub(super) fn add_light(&mut self, left: u32, luminance: f32) {
        self.near_limit |= self.cut.arrive(left, luminance);
    }
}

impl Probe for PathCounts {
    const ON: bool = true;
    type Ray<'r> = RayCounter<'r>;

    #[inline(always)]
    fn ray(&mut self, by: Spawner) -> RayCounter<'_> {
        self.untraced(by);
        let Visits { nodes, leaves, shapes_beyond_leaves, .. } = self.counts.visits[SHADOW];
        let before = [nodes, leaves, shapes_beyond_leaves];
        RayCounter { kind: usize::from(by.kind == RayKind::Shadow), before, path: self }
    }

    #[inline(always)]
    fn untraced(&mut self, by: Spawner) {
        self.counts.visits[usize::from(by.kind == RayKind::Shadow)].rays += 1;
    }

    #[inline(always)]
    fn bsdf(&mut self, evaluations: u32) {
        self.counts.bsdf += u64::from(evaluations);
    }

    #[inline(always)]
    fn texture(&mut self, lookups: u32, bytes: u32) {
        self.add_texture(lookups, bytes);
    }

    #[inline(always)]
    fn light(&mut self, left: u32, luminance: f32) {
        self.add_light(left, luminance);
    }
}

/// Counts one ray's traversal, visit by visit; it must be finished, or a blocked shadow ray counts as one that was not.
#[derive(Debug)]
pub struct RayCounter<'r> {
    path: &'r mut PathCounts,
    /// Which of each pair of sums.
    kind: usize,
    /// Nodes, leaf blocks and shapes beyond them of shadow rays before this one.
    before: [u64; 3],
}

impl RayProbe for RayCounter<'_> {
    #[inline(always)]
    fn node(&mut self, _id: u32, boxes: u32) {
        let visits = &mut self.path.counts.visits[self.kind];
        visits.nodes += 1;
        let more = u64::from(boxes).wrapping_sub(1);
        visits.boxes_beyond_nodes = visits.boxes_beyond_nodes.wrapping_add(more);
    }

    #[inline(always)]
    fn leaf(&mut self, _id: u32, shapes: u32) {
        let visits = &mut self.path.counts.visits[self.kind];
        visits.leaves += 1;
        let more = u64::from(shapes).wrapping_sub(1);
        visits.shapes_beyond_leaves = visits.shapes_beyond_leaves.wrapping_add(more);
    }

    #[inline(always)]
    fn instance(&mut self, _id: u32) {
        self.path.counts.visits[self.kind].instances += 1;
    }

    #[inline(always)]
    fn alpha(&mut self, lookups: u32, bytes: u32) {
        self.path.add_alpha(lookups, bytes);
    }

    #[inline(always)]
    fn finish(self, hit: bool) {
        if self.kind == SHADOW && hit {
            let Visits { nodes, leaves, shapes_beyond_leaves, .. } = self.path.counts.visits[SHADOW];
            let [nodes_before, leaves_before, more_before] = self.before;
            let more = shapes_beyond_leaves.wrapping_sub(more_before);
            self.path.add_blocked(nodes - nodes_before, more.wrapping_add(leaves - leaves_before));
        }
    }
}

/// A visit of a pixel: its paths' integer sums on the way to the pixel, which has them when the visit is dropped. Sums of floats
/// are the pixel's own, so that they do not depend on how samples are split into visits.
#[derive(Debug)]
pub struct PixelVisit<'t> {
    pixel: &'t mut CostPixel,
    path: PathCounts,
    /// [`Counts::totals`] before the path.
    before: [u64; 3],
    /// Nodes and shapes.
    waste: [u64; 2],
    /// Paths by [`Cause`].
    causes: [u64; 4],
}

impl<'t> PixelVisit<'t> {
    #[inline(always)]
    pub(super) fn new(pixel: &'t mut CostPixel) -> Self {
        Self::of(pixel, PathCounts::none())
    }

    /// A visit whose first path has counted this.
    #[inline(always)]
    pub(super) fn of(pixel: &'t mut CostPixel, path: PathCounts) -> Self {
        Self { pixel, path, before: [0; 3], waste: [0; 2], causes: [0; 4] }
    }

    /// The probe of the next path, which must be ended ([`Self::end`]): what one that is not has counted would be in the frame as
    /// a part of the next path, or without a sample.
    #[inline(always)]
    pub fn path(&mut self) -> &mut PathCounts {
        &mut self.path
    }

    /// Adds a path that was counted in a tally, and ends it: as if it had been counted here.
    #[inline(always)]
    pub fn add(&mut self, tally: &PathTally, end: PathEnd) {
        let sums = &mut self.path;
        for shadow in [false, true] {
            let [nodes, leaves] = tally.visits(shadow);
            sums.add_visits(shadow, nodes, leaves);
            sums.counts.visits[usize::from(shadow)].rays += tally.rays(shadow);
        }
        sums.blocked = tally.blocked();
        sums.counts.bsdf += tally.evaluations();
        if let Some(PathCounts { counts, blocked, cut, near_limit }) = tally.if_more() {
            sums.counts.add(counts);
            sums.add_blocked(blocked[0], blocked[1]);
            if *near_limit {
                sums.cut = *cut;
                sums.near_limit = true;
            }
        }
        self.end(end);
    }

    /// Ends the path.
    #[inline(always)]
    pub fn end(&mut self, end: PathEnd) {
        let Self { pixel, path, before, waste, causes } = self;
        let all = path.counts.totals();
        let [rays, nodes, shapes] = [all[0] - before[0], all[1] - before[1], all[2] - before[2]];
        *before = all;
        let wasted = if end.brought_radiance { path.blocked } else { [nodes, shapes] };
        path.blocked = [0; 2];
        waste[0] += wasted[0];
        waste[1] += wasted[1];
        causes[end.cause as usize] += 1;
        // By way of i64, one instruction each: nothing is ever as large as its sign bit.
        let real = |count: u64| count as i64 as f64;
        let (rays, nodes, shapes) = (real(rays), real(nodes), real(shapes));
        pixel.squares[0] += rays * rays;
        pixel.squares[1] += nodes * nodes;
        pixel.squares[2] += shapes * shapes;
        pixel.squares[3] += nodes * shapes;
        pixel.throughput += f64::from(end.throughput);
        if end.cause == Cause::DepthLimit {
            pixel.cut.throughput += f64::from(end.throughput);
        }
        // Few paths find light so near the limit.
        if path.near_limit {
            // Radiance that is not finite counts as none.
            if end.brought_radiance {
                pixel.cut.add(&path.cut);
            }
            path.cut = DepthCut::default();
            path.near_limit = false;
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
        let Self { pixel, path, waste, causes, .. } = self;
        let Counts { visits: [others, shadow], bsdf, texture, texture_bytes, alpha_tests } = path.counts;
        let mut both = |of: fn(&Visits) -> u64, all: Counter, of_shadow: Counter| {
            pixel.add(all, of(&others) + of(&shadow));
            pixel.add(of_shadow, of(&shadow));
        };
        both(|v| v.rays, Counter::Rays, Counter::RaysShadow);
        both(|v| v.nodes, Counter::Nodes, Counter::NodesShadow);
        both(Visits::shapes, Counter::Shapes, Counter::ShapesShadow);
        both(Visits::boxes, Counter::Boxes, Counter::BoxesShadow);
        both(|v| v.leaves, Counter::Leaves, Counter::LeavesShadow);
        both(|v| v.instances, Counter::Instances, Counter::InstancesShadow);
        pixel.add(Counter::Bsdf, bsdf);
        pixel.add(Counter::Texture, texture);
        pixel.add(Counter::TextureBytes, texture_bytes);
        pixel.add(Counter::AlphaTests, alpha_tests);
        pixel.add(Counter::WasteNodes, waste[0]);
        pixel.add(Counter::WasteShapes, waste[1]);
        for cause in [Cause::Escaped, Cause::Absorbed, Cause::Roulette, Cause::DepthLimit] {
            pixel.add(cause.counter(), causes[cause as usize]);
        }
    }
}
