//! The samples of a tile that go eight at a time, and what is kept of them.

use super::{Kept, Kernel, TileJob, of_half};
use crate::adaptive::Plan;
use crate::class::{FullClass, Learning, LobesClass, MatteClass, SceneClass};
use crate::lanes::{Counted, End, LaneScene, Listener, SampleList, View, points_table, trace_samples};
use crate::sampler::pixel_key;
use glam::Vec3;
use hotspot_bvh::simd::Simd;
use hotspot_cost::{PathEnd, PathTally, Rect};
use hotspot_probe::Probe;
use std::ops::Range;
use std::time::Instant;

/// Samples of a list: so many that those that end last do not matter.
const LIST: usize = 2048;

/// Counted samples of a visit, of one half of a pixel, from which on they go eight at a time. All that go at once are of that visit, so that its
/// time can be read when they are done: of few, most lanes would stand idle while the last paths end (of four, it takes longer than one by one).
pub(crate) const SIDE_BY_SIDE: u64 = 8;

/// So many of them at once.
const VISIT: u64 = 64;

/// Numbers of samples, within a half, whose points lanes know.
pub(super) const EIGHTS: u64 = 1 << 16;

/// Some samples of a pixel's half.
struct Visit {
    x: u32,
    y: u32,
    half: usize,
    range: Range<u64>,
}

impl Visit {
    /// Those of a job that have any samples, half by half and pixel by pixel.
    fn all<'a>(
        rect: Rect,
        samples: &'a Range<u64>,
        plan: Option<&'a Plan>,
        halves: usize,
    ) -> impl Iterator<Item = Self> + use<'a> {
        let of_pixel = move |(x, y)| {
            let end = plan.map_or(samples.end, |plan| samples.end.min(plan.target(x, y)));
            let samples = samples.start..end.max(samples.start);
            (0..halves).map(move |half| Self {
                x,
                y,
                half,
                range: of_half(&samples, half as u64, halves as u64),
            })
        };
        rect.pixels().flat_map(of_pixel).filter(|visit| !visit.range.is_empty())
    }

    /// Puts its first samples on a list, at most so many, and takes them off; they.
    fn list(&mut self, most: u64, seed: u64, list: &mut SampleList) -> Self {
        let Self { x, y, half, ref mut range } = *self;
        let first = range.start..range.end.min(range.start + most);
        range.start = first.end;
        let key = pixel_key([x, y, half as u32], seed);
        for index in first.clone() {
            list.push(key, (x, y), index as u32);
        }
        Self { x, y, half, range: first }
    }
}

/// The samples of a job, of which none is counted.
pub(super) fn take_eights<S: Simd>(simd: S, job: &mut TileJob<'_>, lanes: &LaneScene) {
    let kernel = job.kernel;
    let samples = job.samples.clone();
    let mut list = SampleList::default();
    let mut visits = Vec::new();
    let mut found = Vec::new();
    for mut visit in Visit::all(job.tile.rect(), &samples, job.plan, kernel.halves) {
        while !visit.range.is_empty() {
            visits.push(visit.list((LIST - list.len()) as u64, kernel.seed, &mut list));
            if list.len() == LIST {
                take_list(simd, kernel, lanes, &list, &mut found, None);
                keep(job, &visits, &found);
                list.clear();
                visits.clear();
            }
        }
    }
    take_list(simd, kernel, lanes, &list, &mut found, None);
    keep(job, &visits, &found);
}

/// The samples of a job, all of which are counted, visit by visit.
pub(super) fn take_counted<S: Simd>(simd: S, job: &mut TileJob<'_>, lanes: &LaneScene) {
    let kernel = job.kernel;
    let samples = job.samples.clone();
    let mut list = SampleList::default();
    let mut found = Vec::new();
    let (mut tallies, mut ends) = (Vec::new(), Vec::new());
    let mut clock = kernel.clock.then(Instant::now);
    for mut visit in Visit::all(job.tile.rect(), &samples, job.plan, kernel.halves) {
        let Visit { x, y, half, .. } = visit;
        let taken = visit.range.end - visit.range.start;
        if let (_, Some(cost)) = job.tile.open(x, y, half) {
            // Not touched since the last wave, and not before the paths end: by then they are here.
            let sums = cost.sums();
            simd.prefetch(sums.cast());
            simd.prefetch(sums.wrapping_add(1).cast::<u8>().wrapping_sub(256));
        }
        while !visit.range.is_empty() {
            list.clear();
            let these = visit.list(VISIT, kernel.seed, &mut list);
            tallies.clear();
            tallies.resize_with(list.len(), PathTally::new);
            ends.clear();
            ends.resize(list.len(), End::NOT_YET);
            let listener = match (job.ledger.as_deref_mut(), kernel.payers) {
                (Some(ledger), Some(payers)) => Listener::Books(ledger.side_by_side(payers, &mut tallies)),
                _ => Listener::Tallies(&mut tallies),
            };
            let mut counted = Counted { listener, ends: &mut ends, bsdfs: 0 };
            take_list(simd, kernel, lanes, &list, &mut found, Some(&mut counted));
            let bsdfs = counted.bsdfs;
            keep_counted(simd, job, &these, bsdfs, found.iter().zip(&tallies).zip(&ends));
        }
        if let Some(start) = &mut clock {
            // One reading per visit: the end of one is the start of the next.
            let now = Instant::now();
            let nanoseconds = now.duration_since(*start).as_nanos() as u64;
            job.tile.add_time(x, y, half, nanoseconds, taken);
            *start = now;
        }
    }
}

/// Not inlined: compiled once for each class.
#[inline(never)]
fn take_list<S: Simd>(
    simd: S,
    kernel: &Kernel<'_>,
    lanes: &LaneScene,
    list: &SampleList,
    found: &mut Vec<[f32; 3]>,
    counted: Option<&mut Counted<'_>>,
) {
    // What rays visit is what is counted.
    let few = lanes.few.as_ref().filter(|_| counted.is_none());
    let view = View {
        scene: kernel.scene,
        lanes,
        few,
        packets: kernel.packets && few.is_none() && counted.is_none() && kernel.scene.in_packets(),
        camera: &kernel.camera,
        size: (kernel.width, kernel.height),
        settings: &kernel.path,
        table: points_table(),
    };
    // Four kernels: what others would save, of textured scenes without cutouts or without learned lights, is little beside what they take to
    // compile.
    match (kernel.scene.class(), kernel.path.learned.is_some()) {
        (SceneClass::Matte, false) => simd.vectorize(
            #[inline(always)]
            || trace_samples::<S, MatteClass>(simd, &view, list, found, counted),
        ),
        (SceneClass::Lobes, false) => simd.vectorize(
            #[inline(always)]
            || trace_samples::<S, LobesClass>(simd, &view, list, found, counted),
        ),
        (SceneClass::Matte | SceneClass::Lobes, true) => simd.vectorize(
            #[inline(always)]
            || trace_samples::<S, Learning<LobesClass>>(simd, &view, list, found, counted),
        ),
        (SceneClass::Textured | SceneClass::Full, _) => simd.vectorize(
            #[inline(always)]
            || trace_samples::<S, Learning<FullClass>>(simd, &view, list, found, counted),
        ),
    }
}

/// Adds what was found to its pixels, in the order of samples.
fn keep(job: &mut TileJob<'_>, visits: &[Visit], mut found: &[[f32; 3]]) {
    for Visit { x, y, half, range } in visits {
        let (film, _) = job.tile.open(*x, *y, *half);
        let mut kept =
            Kept { film: *film, lost: job.lost, radiance: job.kernel.radiance, x: *x, y: *y, half: *half };
        let (these, rest) = found.split_at((range.end - range.start) as usize);
        for (index, radiance) in range.clone().zip(these) {
            kept.add(index, Vec3::from_array(*radiance));
        }
        *film = kept.film;
        found = rest;
    }
}

/// The same of counted samples of one visit, with their counts; `bsdfs`: evaluations and samplings of all of them.
fn keep_counted<'f, S: Simd>(
    simd: S,
    job: &mut TileJob<'_>,
    &Visit { x, y, half, ref range }: &Visit,
    bsdfs: u32,
    found: impl Iterator<Item = ((&'f [f32; 3], &'f PathTally), &'f End)>,
) {
    let (film, Some(mut cost)) = job.tile.open(x, y, half) else { return };
    let mut kept = Kept { film: *film, lost: job.lost, radiance: job.kernel.radiance, x, y, half };
    simd.vectorize(
        #[inline(always)]
        || {
            let mut visit = cost.visit();
            visit.path().bsdf(bsdfs);
            for (index, ((radiance, tally), end)) in range.clone().zip(found) {
                let radiance = Vec3::from_array(*radiance);
                let finite = kept.add(index, radiance);
                let &End { cause, throughput, first_object } = end;
                let brought_radiance = finite && radiance != Vec3::ZERO;
                visit.add(tally, PathEnd { cause, throughput, brought_radiance, first_object });
            }
        },
    );
    *film = kept.film;
}
