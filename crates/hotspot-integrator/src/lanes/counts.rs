//! What counted paths in lanes tell: as [`crate::path::trace`] tells the probe of one path, so that counts are the same.
//!
//! Paths that go side by side have a tally each, that is added to its pixel in the order of samples once all are done. What is told is told
//! lane by lane, out of the way of the loop, which asks a few times a vertex whether anybody listens: so there is one loop for both.

use super::clock::SharedClock;
use crate::path::LUMINANCE;
use crate::payers::Booking;
use crate::scene::RenderScene;
use hotspot_bvh::lanes::LaneProbes;
use hotspot_bvh::simd::{F8, Floats, Integers, Lanes, Simd, U8, Vectors};
use hotspot_cost::ledger::{BookedPaths, BookedRay, RayKey};
use hotspot_cost::{Cause, PathTally, TalliedRay};
use hotspot_probe::{NONE, NoProbe, Probe, RayKind, Spawner};

/// How a path ended.
#[derive(Clone, Copy, Debug)]
pub(crate) struct End {
    pub(crate) cause: Cause,
    /// Largest component of the throughput, before roulette's compensation.
    pub(crate) throughput: f32,
    /// Object that it hit first, [`NONE`] if none.
    pub(crate) first_object: u32,
}

impl End {
    /// Of a path that is to begin.
    pub(crate) const NOT_YET: Self = Self { cause: Cause::Absorbed, throughput: 0.0, first_object: NONE };
}

/// Who listens.
pub(crate) enum Listener<'p> {
    Tallies(&'p mut [PathTally]),
    Books(BookedPaths<'p>, &'p Booking),
}

/// The counts of a list's paths, by number, and how they end.
pub(crate) struct Counted<'p> {
    pub(crate) listener: Listener<'p>,
    pub(crate) ends: &'p mut [End],
    pub(crate) clock: Option<SharedClock<'p>>,
}

impl Counted<'_> {
    #[inline(always)]
    fn tallies(&mut self) -> &mut [PathTally] {
        match &mut self.listener {
            Listener::Tallies(tallies) => tallies,
            Listener::Books(books, _) => books.tallies(),
        }
    }

    /// The paths of lanes `ended` end with this throughput.
    #[inline(always)]
    pub(super) fn end<S: Simd>(
        &mut self,
        cause: Cause,
        number: Integers<S>,
        throughput: Floats<S>,
        ended: u32,
    ) {
        if ended != 0 {
            self.end_each(cause, &number.store(), &throughput.store(), ended);
        }
    }

    #[inline(never)]
    fn end_each(&mut self, cause: Cause, number: &U8, throughput: &F8, ended: u32) {
        for lane in Lanes(ended) {
            let end = &mut self.ends[number.0[lane] as usize];
            (end.cause, end.throughput) = (cause, throughput.0[lane]);
        }
    }

    /// The camera rays of lanes `landed` hit these parts.
    #[inline(never)]
    pub(super) fn land(&mut self, scene: &RenderScene, number: &U8, part: &U8, landed: u32) {
        for lane in Lanes(landed) {
            let object = scene.geometry.part_of_number(part.0[lane]).object;
            self.ends[number.0[lane] as usize].first_object = object;
        }
    }

    /// The paths of lanes `lit` found light, that the depth limit would have let scatter so many times more.
    #[inline(always)]
    pub(super) fn light<S: Simd>(
        &mut self,
        s: S,
        number: Integers<S>,
        found: Vectors<S>,
        left: Integers<S>,
        lit: u32,
    ) {
        if lit != 0 {
            let luminance = found.dot(Vectors::splat(s, LUMINANCE.to_array()));
            self.light_each(&number.store(), &luminance.store(), &left.store(), lit);
        }
    }

    #[inline(never)]
    fn light_each(&mut self, number: &U8, luminance: &F8, left: &U8, lit: u32) {
        let tallies = self.tallies();
        for lane in Lanes(lit) {
            tallies[number.0[lane] as usize].light(left.0[lane], luminance.0[lane]);
        }
    }

    /// The paths of lanes `active` are about to be taken further.
    #[inline(always)]
    pub(super) fn step<S: Simd>(&mut self, s: S, number: Integers<S>, active: u32) {
        if let Some(clock) = &mut self.clock {
            clock.step(s, number, active);
        }
    }

    /// BSDFs were evaluated in lanes `evaluated`, and sampled in lanes `sampled`, which are at least those.
    #[inline(always)]
    pub(super) fn bsdfs<S: Simd>(&mut self, number: Integers<S>, evaluated: u32, sampled: u32) {
        self.bsdfs_each(&number.store(), evaluated, sampled);
    }

    #[inline(never)]
    fn bsdfs_each(&mut self, number: &U8, evaluated: u32, sampled: u32) {
        let tallies = self.tallies();
        for lane in Lanes(sampled) {
            tallies[number.0[lane] as usize].bsdf(1 + (evaluated >> lane & 1));
        }
    }

    /// Textures were looked up.
    #[inline(never)]
    pub(super) fn textures(&mut self, number: &U8, lookups: &[Lookups; 8]) {
        let tallies = self.tallies();
        for (number, Lookups { lookups, bytes }) in number.0.iter().zip(lookups) {
            if *lookups > 0 {
                tallies[*number as usize].texture(*lookups, *bytes);
            }
        }
    }
}

/// Counts look-ups of textures.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Lookups {
    lookups: u32,
    bytes: u32,
}

impl Lookups {
    /// Of eight lanes.
    pub(crate) const NONE: [Self; 8] = [Self { lookups: 0, bytes: 0 }; 8];
}

impl Probe for Lookups {
    const ON: bool = true;
    type Ray<'p> = NoProbe;

    #[inline(always)]
    fn ray(&mut self, _by: Spawner) -> NoProbe {
        NoProbe
    }

    #[inline(always)]
    fn untraced(&mut self, _by: Spawner) {}

    #[inline(always)]
    fn bsdf(&mut self, _evaluations: u32) {}

    #[inline(always)]
    fn texture(&mut self, lookups: u32, bytes: u32) {
        self.lookups += lookups;
        self.bytes += bytes;
    }
}

/// Rays of eight lanes, of which paths they are and what sends them.
pub(super) struct Senders<'a> {
    pub(super) scene: &'a RenderScene,
    pub(super) kind: RayKind,
    pub(super) number: U8,
    /// The parts that they leave ([`Geometry::part_of_number`](crate::geometry::Geometry::part_of_number)), and the triangles of the world that shadow
    /// rays are aimed at ([`NONE`]: none).
    pub(super) part: U8,
    pub(super) to: U8,
    /// Scattering events before them.
    pub(super) bounces: U8,
}

impl Senders<'_> {
    #[inline(always)]
    fn number(&self, lane: usize) -> usize {
        self.number.0[lane] as usize
    }

    #[inline(always)]
    fn key(&self, booking: &Booking, lane: usize) -> RayKey {
        let (part, bounce) = (self.part.0[lane], self.bounces.0[lane]);
        if self.kind == RayKind::Shadow {
            booking.shadow(&self.scene.geometry, part, self.to.0[lane], bounce)
        } else {
            booking.onward(part, bounce)
        }
    }
}

/// Rays that are counted.
pub(super) struct TalliedRays<'a> {
    pub(super) tallies: &'a mut [PathTally],
    pub(super) senders: &'a Senders<'a>,
}

impl LaneProbes for TalliedRays<'_> {
    type Ray<'r>
        = TalliedRay<'r>
    where
        Self: 'r;

    #[inline(always)]
    fn ray(&mut self, lane: usize) -> TalliedRay<'_> {
        self.tallies[self.senders.number(lane)].ray(self.senders.kind == RayKind::Shadow)
    }
}

/// Rays that are booked and counted.
pub(super) struct BookedRays<'a, 'p> {
    pub(super) books: &'a mut BookedPaths<'p>,
    pub(super) booking: &'a Booking,
    pub(super) senders: &'a Senders<'a>,
}

impl<'p> LaneProbes for BookedRays<'_, 'p> {
    type Ray<'r>
        = BookedRay<'r, 'p>
    where
        Self: 'r;

    #[inline(always)]
    fn ray(&mut self, lane: usize) -> BookedRay<'_, 'p> {
        self.books.ray(self.senders.number(lane), self.senders.key(self.booking, lane))
    }
}
