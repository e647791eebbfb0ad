//! The samples of a tile that go eight at a time, and what is kept of them.

use super::{Kept, Kernel, TileJob, of_half};
use crate::adaptive::Plan;
use crate::class::{Class, FullClass, Learning, LobesClass, MatteClass, SceneClass};
use crate::lanes::{
    Counted, End, INTERRUPTION, LaneScene, Listener, SampleList, SharedClock, View, passed, points_table,
    trace_samples,
};
use crate::sampler::pixel_key;
use glam::Vec3;
use hotspot_bvh::simd::Simd;
use hotspot_cost::{PathEnd, PathTally, Rect};
use std::ops::Range;
use std::time::Instant;

/// Samples of a list: so many that those that end last do not matter.
const LIST: usize = 2048;

/// The same of a list of counted ones, which have their tallies beside them.
const COUNTED_LIST: usize = 512;

/// Edge of the blocks of pixels that lists go through.
const BLOCK: u32 = 4;

/// Numbers of samples, within a half, whose points lanes know.
pub(super) const EIGHTS: u64 = 1 << 16;

/// Some samples of a pixel's half.
struct Visit {
    x: u32,
    y: u32,
    half: usize,
    range: Range<u64>,
}

/// Blocks of a tile: pixels that go beside each other lie close together, and are those that share time.
fn blocks(tile: Rect) -> impl Iterator<Item = Rect> {
    let starts = |length: u32| (0..length).step_by(BLOCK as usize);
    starts(tile.height).flat_map(move |y| {
        starts(tile.width).map(move |x| {
            let block = Rect { x: tile.x + x, y: tile.y + y, width: BLOCK, height: BLOCK };
            tile.intersection(&block)
        })
    })
}

impl Visit {
    fn len(&self) -> usize {
        (self.range.end - self.range.start) as usize
    }

    /// Those of a job that have any samples: block by block, half by half, pixel by pixel. Halves of a pixel do not go beside each other, so that
    /// their times tell apart what they took.
    fn all<'a>(
        rect: Rect,
        samples: &'a Range<u64>,
        plan: Option<&'a Plan>,
        halves: usize,
    ) -> impl Iterator<Item = Self> + use<'a> {
        let of_pixel = move |(x, y), half| {
            let end = plan.map_or(samples.end, |plan| samples.end.min(plan.target(x, y)));
            let samples = samples.start..end.max(samples.start);
            Self { x, y, half, range: of_half(&samples, half as u64, halves as u64) }
        };
        let of_block = move |block: Rect| {
            (0..halves).flat_map(move |half| block.pixels().map(move |pixel| of_pixel(pixel, half)))
        };
        blocks(rect).flat_map(of_block).filter(|visit| !visit.range.is_empty())
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

/// The samples of a job, all of which are counted.
pub(super) fn take_counted<S: Simd>(simd: S, job: &mut TileJob<'_>, lanes: &LaneScene) {
    let samples = job.samples.clone();
    if samples.is_empty() {
        return;
    }
    let mut counting = CountedList::new(job.kernel.clock);
    for mut visit in Visit::all(job.tile.rect(), &samples, job.plan, job.kernel.halves) {
        while !visit.range.is_empty() {
            counting.push(&mut visit, job.kernel.seed);
            if counting.list.len() == COUNTED_LIST {
                counting.take(simd, job, lanes);
            }
        }
    }
    counting.take(simd, job, lanes);
}

/// Counted samples that go side by side, and what is found of them.
struct CountedList {
    list: SampleList,
    visits: Vec<Visit>,
    /// Which of them each sample is of.
    visit_of: Vec<u32>,
    found: Vec<[f32; 3]>,
    /// As many as there may be, that have counted nothing.
    tallies: Vec<PathTally>,
    ends: Vec<End>,
    /// Nanoseconds of each visit.
    spent: Vec<u64>,
    /// Where there is a clock, when the last list was done.
    since: Option<Instant>,
}

impl CountedList {
    fn new(clock: bool) -> Self {
        Self {
            list: SampleList::default(),
            visits: Vec::new(),
            visit_of: Vec::new(),
            found: Vec::new(),
            tallies: std::iter::repeat_with(PathTally::new).take(COUNTED_LIST).collect(),
            ends: Vec::new(),
            spent: Vec::new(),
            since: clock.then(Instant::now),
        }
    }

    /// Adds the first samples of a visit, as many as there is room for, and takes them off it.
    fn push(&mut self, visit: &mut Visit, seed: u64) {
        let these = visit.list((COUNTED_LIST - self.list.len()) as u64, seed, &mut self.list);
        self.visit_of.resize(self.list.len(), self.visits.len() as u32);
        self.visits.push(these);
    }

    /// Takes all samples, and keeps what is found.
    fn take<S: Simd>(&mut self, simd: S, job: &mut TileJob<'_>, lanes: &LaneScene) {
        let Self { list, visits, visit_of, found, tallies, ends, spent, since } = self;
        if list.len() == 0 {
            return;
        }
        ends.resize(list.len(), End::NOT_YET);
        spent.resize(visits.len(), 0);
        let listener = match (job.ledger.as_deref_mut(), job.kernel.booking) {
            (Some(ledger), Some(booking)) => {
                Listener::Books(ledger.side_by_side(&booking.payers, tallies), booking)
            }
            _ => Listener::Tallies(tallies),
        };
        let clock = since.map(|_| SharedClock::new(visit_of, spent));
        let mut counted = Counted { listener, ends, clock };
        take_list(simd, job.kernel, lanes, list, found, Some(&mut counted));
        let mut last = counted.clock.as_mut().map(SharedClock::read);
        let mut at = 0;
        for (number, visit) in visits.iter().enumerate() {
            if let Some(next) = visits.get(number + 1)
                && let (_, Some(cost)) = job.tile.open(next.x, next.y, next.half)
            {
                // Not touched since the last wave.
                let sums = cost.sums();
                simd.prefetch(sums.cast());
                simd.prefetch(sums.wrapping_add(1).cast::<u8>().wrapping_sub(256));
            }
            let these = at..at + visit.len();
            at = these.end;
            let found = found[these.clone()].iter().zip(&mut tallies[these.clone()]).zip(&ends[these]);
            keep_counted(simd, job, visit, found);
            if let Some(last) = &mut last {
                spent[number] += passed(last);
            }
        }
        if let (Some(since), Some(last)) = (since, last) {
            let all = last.duration_since(*since).as_nanos() as u64;
            *since = last;
            // What is nobody's, such as what it takes to make the list, is everybody's, unless it is an interruption.
            let told: u64 = spent.iter().sum();
            let mut rest = all.saturating_sub(told);
            if rest > INTERRUPTION.max(told / 4) {
                spent[0] += std::mem::take(&mut rest);
            }
            let mut samples = list.len() as u64;
            for (visit, spent) in visits.iter().zip(&*spent) {
                let Visit { x, y, half, .. } = *visit;
                let taken = visit.len() as u64;
                let share = rest * taken / samples;
                (rest, samples) = (rest - share, samples - taken);
                job.tile.add_time(x, y, half, spent + share, taken);
            }
        }
        list.clear();
        visits.clear();
        visit_of.clear();
        ends.clear();
        spent.clear();
    }
}

/// Takes all samples of a list.
fn take_list<S: Simd>(
    simd: S,
    kernel: &Kernel<'_>,
    lanes: &LaneScene,
    list: &SampleList,
    found: &mut Vec<[f32; 3]>,
    counted: Option<&mut Counted<'_>>,
) {
    let few = lanes.few.as_ref().filter(|few| counted.is_none() || few.counts());
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
    // Four kernels, where lanes are emulated two: what others would save, of textured scenes without cutouts or without learned lights, is
    // little beside what they take to compile.
    match (kernel.scene.class(), kernel.path.learned.is_some()) {
        (SceneClass::Matte, false) if !S::EMULATED => {
            take_list_of::<S, MatteClass>(simd, &view, list, found, counted);
        }
        (SceneClass::Matte | SceneClass::Lobes, false) => {
            take_list_of::<S, LobesClass>(simd, &view, list, found, counted);
        }
        (SceneClass::Matte | SceneClass::Lobes, true) if !S::EMULATED => {
            take_list_of::<S, Learning<LobesClass>>(simd, &view, list, found, counted);
        }
        _ => take_list_of::<S, Learning<FullClass>>(simd, &view, list, found, counted),
    }
}

/// Not inlined: where lanes are emulated the kernels would be one function, that takes compilers longer than each by itself.
#[inline(never)]
fn take_list_of<S: Simd, C: Class>(
    simd: S,
    view: &View<'_>,
    list: &SampleList,
    found: &mut Vec<[f32; 3]>,
    counted: Option<&mut Counted<'_>>,
) {
    simd.vectorize(
        #[inline(always)]
        || trace_samples::<S, C>(simd, view, list, found, counted),
    );
}

/// Adds what was found to its pixels, in the order of samples.
fn keep(job: &mut TileJob<'_>, visits: &[Visit], mut found: &[[f32; 3]]) {
    for visit in visits {
        let Visit { x, y, half, range } = visit;
        let (film, _) = job.tile.open(*x, *y, *half);
        let mut kept =
            Kept { film: *film, lost: job.lost, radiance: job.kernel.radiance, x: *x, y: *y, half: *half };
        let (these, rest) = found.split_at(visit.len());
        for (index, radiance) in range.clone().zip(these) {
            kept.add(index, Vec3::from_array(*radiance));
        }
        *film = kept.film;
        found = rest;
    }
}

/// The same of counted samples of one visit, with their counts, which are none then.
fn keep_counted<'f, S: Simd>(
    simd: S,
    job: &mut TileJob<'_>,
    &Visit { x, y, half, ref range }: &Visit,
    found: impl Iterator<Item = ((&'f [f32; 3], &'f mut PathTally), &'f End)>,
) {
    let (film, Some(mut cost)) = job.tile.open(x, y, half) else { return };
    let mut kept = Kept { film: *film, lost: job.lost, radiance: job.kernel.radiance, x, y, half };
    simd.vectorize(
        #[inline(always)]
        || {
            let mut visit = cost.visit();
            for (index, ((radiance, tally), end)) in range.clone().zip(found) {
                let radiance = Vec3::from_array(*radiance);
                let finite = kept.add(index, radiance);
                let &End { cause, throughput, first_object } = end;
                let brought_radiance = finite && radiance != Vec3::ZERO;
                visit.add(tally, PathEnd { cause, throughput, brought_radiance, first_object });
                tally.clear();
            }
        },
    );
    *film = kept.film;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pixel_of_a_tile_is_in_one_block() {
        for (x, y, width, height) in [(0, 0, 16, 16), (32, 16, 5, 7), (3, 1, 1, 4), (0, 0, 0, 3)] {
            let tile = Rect { x, y, width, height };
            let mut pixels: Vec<_> = blocks(tile).flat_map(Rect::pixels).map(|(x, y)| (y, x)).collect();
            pixels.sort_unstable();
            assert_eq!(pixels, tile.pixels().map(|(x, y)| (y, x)).collect::<Vec<_>>());
        }
    }

    /// Each sample of a list is said to be of the visit that it was taken off, and what does not fit is left.
    #[test]
    fn lists_know_whose_samples_they_hold() {
        let mut counting = CountedList::new(true);
        let mut left = Vec::new();
        for (x, range) in [(0, 0..3), (1, 7..8), (2, 0..COUNTED_LIST as u64), (3, 0..4)] {
            let mut visit = Visit { x, y: 0, half: 0, range };
            if counting.list.len() < COUNTED_LIST {
                counting.push(&mut visit, 1);
            }
            left.push(visit.len());
        }
        assert_eq!(left, [0, 0, 4, 4]);
        let lengths: Vec<usize> = counting.visits.iter().map(Visit::len).collect();
        assert_eq!(lengths, [3, 1, COUNTED_LIST - 4]);
        let owners = |visit: u32| counting.visit_of.iter().filter(|of| **of == visit).count();
        assert_eq!([owners(0), owners(1), owners(2)], *lengths);
        assert!(counting.visit_of.is_sorted());
    }
}
