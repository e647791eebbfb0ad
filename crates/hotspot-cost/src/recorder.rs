//! Gathers the cost and the radiance of paths, pixel by pixel.
//!
//! A [`TileRecorder`] belongs to one worker: no locks, no statics. For each pixel it opens a [`PixelRecorder`] (the
//! pixel's running sums, on the stack), that opens a [`PathRecorder`] for each path (the path's own counts, in
//! registers), that hands a [`RayCounter`] to each traversal. Paths are never stored.
//!
//! Sums are added sample by sample in the order of the calls, so that the result does not depend on how the samples are
//! split into passes.

use crate::counter::{Cause, Counter};
use crate::depth_cut::DepthCut;
use hotspot_probe::{NONE, Probe, RayKind, RayProbe, Spawner};

/// A rectangle of pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Rect {
    /// Left column.
    pub x: u32,
    /// Top row.
    pub y: u32,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl Rect {
    /// Number of pixels.
    pub const fn area(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// Row-major index of an absolute pixel within the rectangle; `None` outside it.
    #[inline]
    pub const fn index(&self, x: u32, y: u32) -> Option<usize> {
        if x < self.x || y < self.y || x - self.x >= self.width || y - self.y >= self.height {
            return None;
        }
        Some((y - self.y) as usize * self.width as usize + (x - self.x) as usize)
    }

    /// Absolute coordinates of the pixels, row by row from the top.
    pub fn pixels(self) -> impl Iterator<Item = (u32, u32)> {
        let (right, bottom) = (self.x.saturating_add(self.width), self.y.saturating_add(self.height));
        (self.y..bottom).flat_map(move |y| (self.x..right).map(move |x| (x, y)))
    }

    /// What it shares with another; empty (0 × 0) when they lie apart.
    pub fn intersection(&self, other: &Self) -> Self {
        let (x, y) = (self.x.max(other.x), self.y.max(other.y));
        let right = self.x.saturating_add(self.width).min(other.x.saturating_add(other.width));
        let bottom = self.y.saturating_add(self.height).min(other.y.saturating_add(other.height));
        if x < right && y < bottom {
            Self { x, y, width: right - x, height: bottom - y }
        } else {
            Self { x: 0, y: 0, width: 0, height: 0 }
        }
    }
}

/// Radiance sums of a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FilmPixel {
    /// Σ radiance, linear Rec.709.
    pub sum: [f64; 3],
    /// Σ radiance², for the variance's upper bound.
    pub squares: [f64; 3],
    /// Camera samples.
    pub samples: u64,
}

impl FilmPixel {
    /// Adds one camera sample.
    #[inline(always)]
    pub fn add(&mut self, radiance: [f32; 3]) {
        for ((sum, square), value) in self.sum.iter_mut().zip(&mut self.squares).zip(radiance) {
            let value = f64::from(value);
            *sum += value;
            *square += value * value;
        }
        self.samples += 1;
    }

    pub(crate) fn merge(&mut self, other: &Self) {
        for channel in 0..3 {
            self.sum[channel] += other.sum[channel];
            self.squares[channel] += other.squares[channel];
        }
        self.samples += other.samples;
    }
}

/// Cost sums of a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CostPixel {
    /// Exact integer sums, indexed by [`Counter`].
    pub counts: [u64; Counter::COUNT],
    /// Σ over paths of rays², nodes², shapes² and nodes·shapes: exact up to 2^53, then rounded by at most 2^-53 of the
    /// sum per addition.
    pub squares: [f64; 4],
    /// Σ over paths of the throughput's largest component at the path's end, before roulette's compensation.
    pub throughput: f64,
    /// What the depth limit cut.
    pub cut: DepthCut,
    /// Counted camera samples.
    pub samples: u64,
    /// Nanoseconds spent on the pixel, over `time_samples` camera samples.
    pub time_ns: u64,
    /// Camera samples that `time_ns` covers.
    pub time_samples: u64,
    /// Object that the first counted path hit first, [`NONE`] where it hit nothing.
    pub first_object: u32,
}

impl Default for CostPixel {
    fn default() -> Self {
        Self {
            counts: [0; Counter::COUNT],
            squares: [0.0; 4],
            throughput: 0.0,
            cut: DepthCut::default(),
            samples: 0,
            time_ns: 0,
            time_samples: 0,
            first_object: NONE,
        }
    }
}

impl CostPixel {
    /// One sum.
    #[inline]
    pub const fn get(&self, counter: Counter) -> u64 {
        self.counts[counter as usize]
    }

    #[inline(always)]
    fn add(&mut self, counter: Counter, value: u64) {
        self.counts[counter as usize] += value;
    }

    pub(crate) fn merge(&mut self, other: &Self) {
        if self.samples == 0 {
            self.first_object = other.first_object;
        }
        for (sum, value) in self.counts.iter_mut().zip(other.counts) {
            *sum += value;
        }
        for (sum, value) in self.squares.iter_mut().zip(other.squares) {
            *sum += value;
        }
        self.throughput += other.throughput;
        self.cut.add(&other.cut);
        self.samples += other.samples;
        self.time_ns += other.time_ns;
        self.time_samples += other.time_samples;
    }
}

/// How a path ended and what it brought.
#[derive(Clone, Copy, Debug)]
pub struct PathEnd {
    /// Why it ended.
    pub cause: Cause,
    /// Largest component of the throughput when it ended, before roulette's compensation.
    pub throughput: f32,
    /// Whether it brought any radiance; if not, all its cost is waste.
    pub brought_radiance: bool,
    /// Object that the camera ray hit, [`NONE`] if nothing.
    pub first_object: u32,
}

/// The sums of a rectangle of pixels, filled by one worker at a time.
#[derive(Clone, Debug)]
pub struct TileRecorder {
    rect: Rect,
    film: Vec<FilmPixel>,
    cost: Vec<CostPixel>,
    halves: usize,
}

impl TileRecorder {
    /// An empty recorder. `halves`: 1, or 2 to keep two independent halves apart.
    pub(crate) fn new(rect: Rect, halves: usize, with_cost: bool) -> Self {
        let pixels = rect.area() * halves;
        Self {
            rect,
            film: vec![FilmPixel::default(); pixels],
            cost: if with_cost { vec![CostPixel::default(); pixels] } else { Vec::new() },
            halves,
        }
    }

    /// The pixels covered.
    pub const fn rect(&self) -> Rect {
        self.rect
    }

    /// False when only radiance is gathered.
    pub const fn has_cost(&self) -> bool {
        !self.cost.is_empty()
    }

    /// The radiance sums of half `half` of pixel (x, y), absolute coordinates.
    ///
    /// # Panics
    /// When the pixel is outside the rectangle or the half does not exist.
    #[inline]
    pub fn film_mut(&mut self, x: u32, y: u32, half: usize) -> &mut FilmPixel {
        let index = self.index(x, y, half);
        &mut self.film[index]
    }

    /// Opens half `half` of pixel (x, y) for counting.
    ///
    /// # Panics
    /// When the pixel is outside the rectangle, the half does not exist, or the frame gathers no cost.
    #[inline]
    pub fn pixel(&mut self, x: u32, y: u32, half: usize) -> PixelRecorder<'_> {
        let index = self.index(x, y, half);
        PixelRecorder { pixel: &mut self.cost[index] }
    }

    /// Adds time spent on half `half` of pixel (x, y): `nanoseconds` for `samples` camera samples.
    ///
    /// # Panics
    /// When the pixel is outside the rectangle, the half does not exist, or the frame gathers no cost.
    #[inline]
    pub fn add_time(&mut self, x: u32, y: u32, half: usize, nanoseconds: u64, samples: u64) {
        let index = self.index(x, y, half);
        let pixel = &mut self.cost[index];
        pixel.time_ns += nanoseconds;
        pixel.time_samples += samples;
    }

    /// Radiance sums of a pixel's half, `None` outside the tile or for a half that does not exist.
    pub fn film(&self, x: u32, y: u32, half: usize) -> Option<&FilmPixel> {
        self.film.get(self.checked_index(x, y, half)?)
    }

    /// Cost sums of a pixel's half, `None` outside the tile, for a half that does not exist, or without cost.
    pub fn cost(&self, x: u32, y: u32, half: usize) -> Option<&CostPixel> {
        self.cost.get(self.checked_index(x, y, half)?)
    }

    #[inline]
    fn checked_index(&self, x: u32, y: u32, half: usize) -> Option<usize> {
        let index = self.rect.index(x, y)?;
        (half < self.halves).then_some(index * self.halves + half)
    }

    /// The cost sums of all pixels and halves.
    pub(crate) fn costs(&self) -> impl Iterator<Item = &CostPixel> {
        self.cost.iter()
    }

    #[inline]
    fn index(&self, x: u32, y: u32, half: usize) -> usize {
        assert!(half < self.halves, "half {half} of {}", self.halves);
        match self.rect.index(x, y) {
            Some(index) => index * self.halves + half,
            None => panic!("pixel ({x}, {y}) is outside the tile {:?}", self.rect),
        }
    }

    /// Adds the sums of `other` where the rectangles overlap. Halves that this recorder lacks go to its last one, so that no
    /// count is lost.
    pub(crate) fn merge(&mut self, other: &Self) {
        for (x, y) in self.rect.intersection(&other.rect).pixels() {
            for half in 0..other.halves {
                let index = self.index(x, y, half.min(self.halves - 1));
                if let Some(theirs) = other.film(x, y, half) {
                    self.film[index].merge(theirs);
                }
                if self.has_cost()
                    && let Some(theirs) = other.cost(x, y, half)
                {
                    self.cost[index].merge(theirs);
                }
            }
        }
    }
}

/// The running cost sums of one pixel while its paths are traced.
#[derive(Debug)]
pub struct PixelRecorder<'t> {
    pixel: &'t mut CostPixel,
}

impl PixelRecorder<'_> {
    /// Opens a path. Nothing is recorded before [`PathRecorder::end`].
    #[inline(always)]
    pub fn path(&mut self) -> PathRecorder<'_> {
        PathRecorder { pixel: self.pixel, path: PathCounts::default() }
    }
}

/// The counts of one path.
#[derive(Clone, Copy, Debug, Default)]
struct PathCounts {
    rays: u64,
    rays_shadow: u64,
    trace: RayCounts,
    shadow: RayCounts,
    blocked_nodes: u64,
    blocked_shapes: u64,
    bsdf: u64,
    texture: u64,
    texture_bytes: u64,
    alpha_tests: u64,
    /// Light among the last terms before the depth limit, and whether there was any.
    cut: DepthCut,
    near_limit: bool,
}

/// The counts of one or more rays.
#[derive(Clone, Copy, Debug, Default)]
struct RayCounts {
    nodes: u64,
    boxes: u64,
    leaves: u64,
    shapes: u64,
    instances: u64,
}

impl RayCounts {
    #[inline(always)]
    fn add(&mut self, other: &Self) {
        self.nodes += other.nodes;
        self.boxes += other.boxes;
        self.leaves += other.leaves;
        self.shapes += other.shapes;
        self.instances += other.instances;
    }
}

/// Records one path: the [`Probe`] to hand to a path loop, or to feed by hand ([`PathRecorder::add_ray`]).
#[derive(Debug)]
pub struct PathRecorder<'p> {
    pixel: &'p mut CostPixel,
    path: PathCounts,
}

impl PathRecorder<'_> {
    /// Adds a ray whose traversal was counted elsewhere: the door for renderers that cannot pass a probe through their
    /// traversal. `nodes`: inner nodes visited, `shapes`: triangles (or other shapes) tested, `hit`: whether it hit
    /// anything (for shadow rays: whether it was blocked).
    #[inline]
    pub fn add_ray(&mut self, by: Spawner, nodes: u32, shapes: u32, hit: bool) {
        let mut ray = self.ray(by);
        ray.counts.nodes += u64::from(nodes);
        ray.counts.shapes += u64::from(shapes);
        ray.finish(hit);
    }

    /// Adds nodes, boxes, leaves, shapes and instances of a ray that was announced by [`Probe::untraced`].
    #[inline(always)]
    pub(crate) fn add_traversal(&mut self, shadow: bool, counts: [u64; 5], hit: bool) {
        let [nodes, boxes, leaves, shapes, instances] = counts;
        let counts = RayCounts { nodes, boxes, leaves, shapes, instances };
        RayCounter { path: &mut self.path, counts, shadow }.finish(hit);
    }

    /// Adds an alpha test of any ray.
    #[inline(always)]
    pub(crate) fn add_alpha(&mut self, lookups: u32, bytes: u32) {
        RayCounter { path: &mut self.path, counts: RayCounts::default(), shadow: false }
            .alpha(lookups, bytes);
    }

    /// Closes the path and adds it to its pixel.
    #[inline(always)]
    pub fn end(self, end: PathEnd) {
        let Self { pixel, path } = self;
        let all = |trace: u64, shadow: u64| trace + shadow;
        let nodes = all(path.trace.nodes, path.shadow.nodes);
        let shapes = all(path.trace.shapes, path.shadow.shapes);
        pixel.add(Counter::Rays, path.rays);
        pixel.add(Counter::RaysShadow, path.rays_shadow);
        pixel.add(Counter::Nodes, nodes);
        pixel.add(Counter::NodesShadow, path.shadow.nodes);
        pixel.add(Counter::Shapes, shapes);
        pixel.add(Counter::ShapesShadow, path.shadow.shapes);
        pixel.add(Counter::Boxes, all(path.trace.boxes, path.shadow.boxes));
        pixel.add(Counter::BoxesShadow, path.shadow.boxes);
        pixel.add(Counter::Leaves, all(path.trace.leaves, path.shadow.leaves));
        pixel.add(Counter::LeavesShadow, path.shadow.leaves);
        pixel.add(Counter::Instances, all(path.trace.instances, path.shadow.instances));
        pixel.add(Counter::InstancesShadow, path.shadow.instances);
        pixel.add(Counter::Bsdf, path.bsdf);
        pixel.add(Counter::Texture, path.texture);
        pixel.add(Counter::TextureBytes, path.texture_bytes);
        pixel.add(Counter::AlphaTests, path.alpha_tests);
        let (waste_nodes, waste_shapes) =
            if end.brought_radiance { (path.blocked_nodes, path.blocked_shapes) } else { (nodes, shapes) };
        pixel.add(Counter::WasteNodes, waste_nodes);
        pixel.add(Counter::WasteShapes, waste_shapes);
        pixel.add(end.cause.counter(), 1);
        // By way of i64, one instruction each: nothing is ever as large as its sign bit.
        let (rays, nodes, shapes) = (path.rays as i64 as f64, nodes as i64 as f64, shapes as i64 as f64);
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

impl Probe for PathRecorder<'_> {
    const ON: bool = true;
    type Ray<'r>
        = RayCounter<'r>
    where
        Self: 'r;

    #[inline(always)]
    fn ray(&mut self, by: Spawner) -> RayCounter<'_> {
        self.untraced(by);
        RayCounter { shadow: by.kind == RayKind::Shadow, path: &mut self.path, counts: RayCounts::default() }
    }

    #[inline(always)]
    fn untraced(&mut self, by: Spawner) {
        self.path.rays += 1;
        self.path.rays_shadow += u64::from(by.kind == RayKind::Shadow);
    }

    #[inline(always)]
    fn bsdf(&mut self, evaluations: u32) {
        self.path.bsdf += u64::from(evaluations);
    }

    #[inline(always)]
    fn texture(&mut self, lookups: u32, bytes: u32) {
        self.path.texture += u64::from(lookups);
        self.path.texture_bytes += u64::from(bytes);
    }

    #[inline(always)]
    fn light(&mut self, left: u32, luminance: f32) {
        self.path.near_limit |= self.path.cut.arrive(left, luminance);
    }
}

/// Counts one ray's traversal.
#[derive(Debug)]
pub struct RayCounter<'r> {
    path: &'r mut PathCounts,
    counts: RayCounts,
    shadow: bool,
}

impl RayProbe for RayCounter<'_> {
    #[inline(always)]
    fn node(&mut self, _id: u32, boxes: u32) {
        self.counts.nodes += 1;
        self.counts.boxes += u64::from(boxes);
    }

    #[inline(always)]
    fn leaf(&mut self, _id: u32, shapes: u32) {
        self.counts.leaves += 1;
        self.counts.shapes += u64::from(shapes);
    }

    #[inline(always)]
    fn instance(&mut self, _id: u32) {
        self.counts.instances += 1;
    }

    #[inline(always)]
    fn alpha(&mut self, lookups: u32, bytes: u32) {
        self.path.alpha_tests += 1;
        self.path.texture += u64::from(lookups);
        self.path.texture_bytes += u64::from(bytes);
    }

    #[inline(always)]
    fn finish(self, hit: bool) {
        if self.shadow {
            self.path.shadow.add(&self.counts);
            if hit {
                self.path.blocked_nodes += self.counts.nodes;
                self.path.blocked_shapes += self.counts.shapes;
            }
        } else {
            self.path.trace.add(&self.counts);
        }
    }
}

#[cfg(test)]
mod tests;
