//! Gathers the cost and the radiance of paths, pixel by pixel.
//!
//! A [`TileRecorder`] belongs to one worker: no locks, no statics. For each pixel it opens a [`PixelRecorder`], that opens a
//! [`PathRecorder`] for each path, that hands a [`RayCounter`] to each traversal. Who takes several samples of a pixel at once opens
//! a [`PixelVisit`] (running sums, on the stack), whose [`PathCounts`] are the probe of one path after the other; who traces them side by
//! side, or books them, gives each a [`PathTally`] and adds these in the order of samples.
//!
//! Sums are added sample by sample in the order of the calls, so that the result does not depend on how the samples are
//! split into passes.

use crate::counter::{Cause, Counter};
use crate::depth_cut::DepthCut;
use hotspot_probe::{NONE, Probe, RayKind, Spawner};

pub use path::{PathCounts, PixelVisit, RayCounter};
pub use tally::{PathTally, TalliedRay};

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

    /// Half `half` of pixel (x, y) as a whole: its radiance sums, and what counts, unless the frame gathers no cost.
    ///
    /// # Panics
    /// When the pixel is outside the rectangle or the half does not exist.
    #[inline(always)]
    pub fn open(&mut self, x: u32, y: u32, half: usize) -> (&mut FilmPixel, Option<PixelRecorder<'_>>) {
        let index = self.index(x, y, half);
        let cost = self.cost.get_mut(index).map(|pixel| PixelRecorder { pixel });
        (&mut self.film[index], cost)
    }

    /// Adds time spent on half `half` of pixel (x, y): `nanoseconds` for `samples` camera samples.
    ///
    /// # Panics
    /// When the pixel is outside the rectangle, the half does not exist, or the frame gathers no cost.
    #[inline]
    pub fn add_time(&mut self, x: u32, y: u32, half: usize, nanoseconds: u64, samples: u64) {
        self.pixel(x, y, half).add_time(nanoseconds, samples);
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

/// The cost sums of one pixel while its paths are traced.
#[derive(Debug)]
pub struct PixelRecorder<'t> {
    pixel: &'t mut CostPixel,
}

impl PixelRecorder<'_> {
    /// Opens a path. Nothing is recorded before [`PathRecorder::end`].
    #[inline(always)]
    pub fn path(&mut self) -> PathRecorder<'_> {
        PathRecorder { pixel: self.pixel, path: PathCounts::none() }
    }

    /// Opens the pixel for several paths at once, which takes less of each.
    #[inline(always)]
    pub fn visit(&mut self) -> PixelVisit<'_> {
        PixelVisit::new(self.pixel)
    }

    /// Adds time spent on the pixel: `nanoseconds` for `samples` camera samples.
    #[inline(always)]
    pub fn add_time(&mut self, nanoseconds: u64, samples: u64) {
        self.pixel.time_ns += nanoseconds;
        self.pixel.time_samples += samples;
    }

    /// Where its sums are, for who wants to prefetch them.
    #[inline(always)]
    pub fn sums(&self) -> *const CostPixel {
        self.pixel
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
        let shadow = by.kind == RayKind::Shadow;
        self.path.untraced(by);
        self.path.add_visits(shadow, [nodes.into(), 0], [0, shapes.into()]);
        if shadow && hit {
            self.path.add_blocked(nodes.into(), shapes.into());
        }
    }

    /// Closes the path and adds it to its pixel.
    #[inline(always)]
    pub fn end(self, end: PathEnd) {
        PixelVisit::of(self.pixel, self.path).end(end);
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
        self.path.ray(by)
    }

    #[inline(always)]
    fn untraced(&mut self, by: Spawner) {
        self.path.untraced(by);
    }

    #[inline(always)]
    fn bsdf(&mut self, evaluations: u32) {
        self.path.bsdf(evaluations);
    }

    #[inline(always)]
    fn texture(&mut self, lookups: u32, bytes: u32) {
        self.path.texture(lookups, bytes);
    }

    #[inline(always)]
    fn light(&mut self, left: u32, luminance: f32) {
        self.path.light(left, luminance);
    }
}

mod path;
mod tally;

#[cfg(test)]
mod tests;
