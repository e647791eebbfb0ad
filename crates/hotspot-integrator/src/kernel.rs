//! One tile's samples: the loop that is compiled for each instruction set, scene class and instrumentation.

use crate::adaptive::Plan;
use crate::camera::FilmCamera;
use crate::cast::closest_hits;
use crate::class::{Class, FullClass, Learning, LobesClass, MatteClass, SceneClass, TexturedClass};
use crate::lanes::LaneScene;
use crate::path::{PathResult, PathSettings, Start, trace};
use crate::payers::Booking;
use crate::sampler::{Dimensions, PixelSampler, Sampler, SamplerKind};
use crate::scene::RenderScene;
use glam::Vec3;
use hotspot_bvh::PACKET;
use hotspot_bvh::simd::{Simd, WithSimd};
use hotspot_cost::ledger::{Ledger, Payers};
use hotspot_cost::{FilmPixel, PathEnd, PixelRecorder, TileRecorder};
use hotspot_probe::{NoProbe, Probe};
use std::ops::Range;
use std::time::Instant;

use eights::{EIGHTS, take_counted, take_eights};

/// A camera sample whose radiance was not finite; it counts as black.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct NonFinite {
    /// Pixel row.
    pub y: u32,
    /// Pixel column.
    pub x: u32,
    /// Sample index within the pixel (within its half under intervals).
    pub sample: u64,
    /// Half, 0 or 1.
    pub half: usize,
}

/// Most that a tile lists in one wave: enough to find the fault, too few to fill the memory.
const MOST_NON_FINITE: usize = 64;

/// The samples of a tile and wave whose radiance was not finite.
#[derive(Debug, Default)]
pub(crate) struct Lost {
    /// How many.
    pub(crate) count: u64,
    /// The first of them.
    pub(crate) listed: Vec<NonFinite>,
}

impl Lost {
    /// Not inlined: no scene should ever come here.
    #[cold]
    #[inline(never)]
    fn add(&mut self, sample: NonFinite) {
        self.count += 1;
        if self.listed.len() < MOST_NON_FINITE {
            self.listed.push(sample);
        }
    }
}

/// What all tiles of a render share.
pub(crate) struct Kernel<'a> {
    pub(crate) scene: &'a RenderScene,
    pub(crate) camera: FilmCamera,
    pub(crate) width: u32,
    pub(crate) height: u32,
    pub(crate) path: PathSettings<'a>,
    pub(crate) sampler: SamplerKind,
    pub(crate) seed: u64,
    pub(crate) halves: usize,
    /// Samples below this are counted, the others run on the plain kernel.
    pub(crate) counted: u64,
    pub(crate) radiance: bool,
    pub(crate) clock: bool,
    /// Who pays for what, where ledgers are gathered.
    pub(crate) booking: Option<&'a Booking>,
    /// Whether camera rays that are not counted go in packets.
    pub(crate) packets: bool,
    /// Where paths go eight at a time.
    pub(crate) lanes: Option<&'a LaneScene>,
    /// Whether those that are counted do.
    pub(crate) counted_in_eights: bool,
}

/// A tile and the samples to take of each of its pixels.
pub(crate) struct TileJob<'a> {
    pub(crate) kernel: &'a Kernel<'a>,
    pub(crate) tile: &'a mut TileRecorder,
    /// Sample numbers over both halves: number n is sample n / halves of half n % halves.
    pub(crate) samples: Range<u64>,
    /// Where pixels get different numbers of samples.
    pub(crate) plan: Option<&'a Plan>,
    pub(crate) lost: &'a mut Lost,
    /// Books the counted samples, where ledgers are gathered.
    pub(crate) ledger: Option<&'a mut Ledger>,
}

impl WithSimd for TileJob<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(mut self, simd: S) {
        let Some(lanes) = self.kernel.lanes else { return self.one_by_one(simd) };
        let counted = if self.tile.has_cost() { self.kernel.counted } else { 0 };
        let Range { start, end } = self.samples;
        // In the order of samples, as pixels want them: those that are counted, those that are not, and those beyond the points that lanes
        // know.
        let known = (EIGHTS * self.kernel.halves as u64).clamp(start, end);
        let counted = counted.clamp(start, known);
        if self.kernel.counted_in_eights {
            take_counted(simd, &mut self.part(start..counted), lanes);
        } else {
            self.part(start..counted).one_by_one(simd);
        }
        take_eights(simd, &mut self.part(counted..known), lanes);
        self.part(known..end).one_by_one(simd);
    }
}

impl Kernel<'_> {
    /// Whether any of these samples go eight at a time, in a frame that counts or not.
    pub(crate) fn in_eights(&self, Range { start, end }: Range<u64>, counts: bool) -> bool {
        let known = (EIGHTS * self.halves as u64).clamp(start, end);
        let counted = if counts { self.counted.clamp(start, known) } else { start };
        self.lanes.is_some() && (counted < known || (counted > start && self.counted_in_eights))
    }
}

impl TileJob<'_> {
    /// Some of its samples.
    fn part(&mut self, samples: Range<u64>) -> TileJob<'_> {
        TileJob {
            tile: self.tile,
            samples,
            lost: self.lost,
            ledger: self.ledger.as_deref_mut(),
            kernel: self.kernel,
            plan: self.plan,
        }
    }
}

impl TileJob<'_> {
    /// Path by path.
    #[inline(never)]
    fn one_by_one<S: Simd>(self, simd: S) {
        if self.samples.is_empty() {
            return;
        }
        #[cfg(hotspot_ablation)]
        if let Some(feature) = self.kernel.scene.without {
            return self.run_without(simd, feature);
        }
        if self.kernel.path.learned.is_some() {
            // Matte and lobes take that of textured: what it would save is little beside what it takes to compile.
            return match self.kernel.scene.class() {
                SceneClass::Matte | SceneClass::Lobes | SceneClass::Textured => {
                    self.pixels_of::<S, Learning<TexturedClass>>(simd);
                }
                SceneClass::Full => self.pixels_of::<S, Learning<FullClass>>(simd),
            };
        }
        match self.kernel.scene.class() {
            SceneClass::Matte => self.pixels_of::<S, MatteClass>(simd),
            SceneClass::Lobes => self.pixels_of::<S, LobesClass>(simd),
            SceneClass::Textured => self.pixels_of::<S, TexturedClass>(simd),
            SceneClass::Full => self.pixels_of::<S, FullClass>(simd),
        }
    }

    /// Not inlined: without vectors the kernels would be one function, that takes compilers longer than each by itself.
    #[inline(never)]
    fn pixels_of<S: Simd, C: Class>(self, simd: S) {
        simd.vectorize(
            #[inline(always)]
            || self.pixels::<S, C>(simd),
        );
    }
}

/// The kernels of the classes without one feature, for benches.
#[cfg(hotspot_ablation)]
impl TileJob<'_> {
    fn run_without<S: Simd>(self, simd: S, feature: crate::class::Feature) {
        match feature as usize {
            0 => self.class_without::<S, 0>(simd),
            1 => self.class_without::<S, 1>(simd),
            2 => self.class_without::<S, 2>(simd),
            3 => self.class_without::<S, 3>(simd),
            4 => self.class_without::<S, 4>(simd),
            5 => self.class_without::<S, 5>(simd),
            6 => self.class_without::<S, 6>(simd),
            7 => self.class_without::<S, 7>(simd),
            8 => self.class_without::<S, 8>(simd),
            9 => self.class_without::<S, 9>(simd),
            _ => self.class_without::<S, 10>(simd),
        }
    }

    fn class_without<S: Simd, const FEATURE: usize>(self, simd: S) {
        use crate::class::Without;
        match self.kernel.scene.class() {
            SceneClass::Matte => self.pixels_of::<S, Without<MatteClass, FEATURE>>(simd),
            SceneClass::Lobes => self.pixels_of::<S, Without<LobesClass, FEATURE>>(simd),
            SceneClass::Textured => self.pixels_of::<S, Without<TexturedClass, FEATURE>>(simd),
            SceneClass::Full => self.pixels_of::<S, Without<FullClass, FEATURE>>(simd),
        }
    }
}

/// The numbers of `samples` that belong to `half`, as indices within the half. `halves`: 1 or 2; shifted, since a division takes
/// as long as twenty instructions.
fn of_half(samples: &Range<u64>, half: u64, halves: u64) -> Range<u64> {
    let index = |n: u64| (n + halves - 1 - half) >> (halves - 1);
    index(samples.start)..index(samples.end)
}

impl TileJob<'_> {
    #[inline(always)]
    fn pixels<S: Simd, C: Class>(self, simd: S) {
        let Self { kernel, tile, samples, plan, lost, mut ledger } = self;
        let halves = kernel.halves as u64;
        let counts = tile.has_cost();
        let counted = if counts { kernel.counted } else { 0 };
        let split = |range: Range<u64>, half: u64| {
            let bound = of_half(&(0..counted), half, halves).end.clamp(range.start, range.end);
            (range.start..bound, bound..range.end)
        };
        let mut clock = kernel.clock.then(Instant::now);
        for (x, y) in tile.rect().pixels() {
            let mut samples = samples.clone();
            if let Some(plan) = plan {
                samples.end = samples.end.min(plan.target(x, y));
                if samples.is_empty() {
                    continue;
                }
            }
            for half in 0..kernel.halves {
                let range = of_half(&samples, half as u64, halves);
                let (counting, plain) = split(range.clone(), half as u64);
                let at = [x, y, half as u32];
                let pixel_sampler = PixelSampler::of(simd, kernel.sampler, at, kernel.seed);
                let (film, mut cost) = tile.open(x, y, half);
                if let Some(cost) = &cost {
                    // Not touched since the last wave, and not before the first path ends: by then they are here.
                    let sums = cost.sums();
                    simd.prefetch(sums.cast());
                    simd.prefetch(sums.wrapping_add(1).cast::<u8>().wrapping_sub(256));
                }
                let mut kept = Kept { film: *film, lost, radiance: kernel.radiance, x, y, half };
                if let Some(cost) = cost.as_mut().filter(|_| !counting.is_empty()) {
                    if let (Some(ledger), Some(booking)) = (ledger.as_deref_mut(), kernel.booking) {
                        let books = Books { payers: &booking.payers, ledger, cost };
                        let kept_here = Kept { lost: kept.lost, ..kept };
                        kept.film =
                            booked_samples::<S, C>(simd, kernel, &pixel_sampler, counting, books, kept_here);
                    } else {
                        let mut visit = cost.visit();
                        for index in counting {
                            let sampler = pixel_sampler.sample(index);
                            let result = sample::<S, _, C>(simd, kernel, (x, y), &sampler, visit.path());
                            let finite = kept.add(index, result.radiance);
                            visit.end(path_end(&result, finite));
                        }
                    }
                }
                for first in plain.clone().step_by(PACKET) {
                    let indices = first..plain.end.min(first + PACKET as u64);
                    let mut starts = [Start::NONE; PACKET];
                    camera_hits::<S, C>(simd, kernel, (x, y), &pixel_sampler, indices.clone(), &mut starts);
                    for (index, start) in indices.zip(&starts) {
                        let sampler = pixel_sampler.sample(index);
                        let result = trace::<S, _, C, true>(
                            simd,
                            kernel.scene,
                            &kernel.path,
                            *start,
                            &sampler,
                            &mut NoProbe,
                        );
                        kept.add(index, result.radiance);
                    }
                }
                *film = kept.film;
                if let (Some(start), Some(cost)) = (&mut clock, &mut cost) {
                    // One reading per visit: the end of one is the start of the next.
                    let now = Instant::now();
                    let nanoseconds = now.duration_since(*start).as_nanos() as u64;
                    cost.add_time(nanoseconds, range.end - range.start);
                    *start = now;
                }
            }
        }
    }
}

/// `finite`: whether its radiance is.
#[inline(always)]
fn path_end(result: &PathResult, finite: bool) -> PathEnd {
    PathEnd {
        cause: result.cause,
        throughput: result.throughput,
        brought_radiance: finite && result.radiance != Vec3::ZERO,
        first_object: result.first_object,
    }
}

/// What a visit of a pixel keeps of its samples' radiance.
struct Kept<'a> {
    film: FilmPixel,
    lost: &'a mut Lost,
    radiance: bool,
    x: u32,
    y: u32,
    half: usize,
}

impl Kept<'_> {
    /// Adds a sample; whether its radiance is finite.
    #[inline(always)]
    fn add(&mut self, sample: u64, radiance: Vec3) -> bool {
        let finite = radiance.is_finite();
        if self.radiance {
            if !finite {
                let Self { x, y, half, .. } = *self;
                self.lost.add(NonFinite { x, y, sample, half });
            }
            self.film.add(if finite { radiance.to_array() } else { [0.0; 3] });
        }
        finite
    }
}

/// Where the samples of a visit are booked.
struct Books<'a, 't> {
    payers: &'a Payers,
    ledger: &'a mut Ledger,
    cost: &'a mut PixelRecorder<'t>,
}

/// The counted samples of a visit of a pixel, recorded and booked. Not inlined, so that the kernels without ledgers stay as they
/// are; the film is handed over and back, so that theirs can stay in registers.
#[inline(never)]
fn booked_samples<S: Simd, C: Class>(
    simd: S,
    kernel: &Kernel<'_>,
    sampler: &PixelSampler,
    samples: Range<u64>,
    books: Books<'_, '_>,
    mut kept: Kept<'_>,
) -> FilmPixel {
    simd.vectorize(
        #[inline(always)]
        || {
            let mut visit = books.ledger.visit(books.payers, books.cost.visit());
            for index in samples {
                let mut path = visit.path();
                let at = (kept.x, kept.y);
                let result = sample::<S, _, C>(simd, kernel, at, &sampler.sample(index), &mut path);
                let finite = kept.add(index, result.radiance);
                path.end(path_end(&result, finite));
            }
            kept.film
        },
    )
}

/// Where the path of a camera sample starts.
#[inline(always)]
fn start(kernel: &Kernel<'_>, pixel: (u32, u32), sampler: &Sampler<'_>) -> Start {
    let [u, v, light @ ..] = sampler.get(Dimensions::segment(0));
    Start::new(kernel.camera.ray_of(pixel, [u, v], (kernel.width, kernel.height)), light)
}

/// One camera sample.
#[inline(always)]
fn sample<S: Simd, P: Probe, C: Class>(
    simd: S,
    kernel: &Kernel<'_>,
    pixel: (u32, u32),
    sampler: &Sampler<'_>,
    probe: &mut P,
) -> PathResult {
    let start = start(kernel, pixel, sampler);
    trace::<S, P, C, false>(simd, kernel.scene, &kernel.path, start, sampler, probe)
}

/// Where the paths of a packet of samples of a pixel start, and what their camera rays hit. Not inlined: its registers are not
/// those of the path loop.
#[inline(never)]
fn camera_hits<S: Simd, C: Class>(
    simd: S,
    kernel: &Kernel<'_>,
    pixel: (u32, u32),
    sampler: &PixelSampler,
    indices: Range<u64>,
    starts: &mut [Start; PACKET],
) {
    simd.vectorize(
        #[inline(always)]
        || {
            let mut rays = [Start::NONE.ray; PACKET];
            let mut hits = [None; PACKET];
            let mut count = 0;
            for index in indices.clone() {
                starts[count] = start(kernel, pixel, &sampler.sample(index));
                rays[count] = starts[count].ray;
                count += 1;
            }
            let keys = |place: usize| sampler.sample(indices.start + place as u64);
            closest_hits::<S, C>(simd, kernel, &rays[..count], keys, &mut hits[..count]);
            for (at, hit) in starts.iter_mut().zip(hits) {
                at.hit = hit;
            }
        },
    );
}

mod eights;
#[cfg(test)]
pub(crate) mod ray_counts;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_share_the_sample_numbers() {
        for halves in [1, 2u64] {
            for (start, end) in [(0, 0), (0, 1), (0, 7), (3, 8), (4, 5)] {
                let mut numbers: Vec<u64> = (0..halves)
                    .flat_map(|h| of_half(&(start..end), h, halves).map(move |i| i * halves + h))
                    .collect();
                numbers.sort_unstable();
                assert_eq!(numbers, (start..end).collect::<Vec<_>>());
            }
        }
    }
}
