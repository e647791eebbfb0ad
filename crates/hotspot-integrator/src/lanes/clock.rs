//! Time of paths that go side by side, shared out among the visits of pixels that they are of.
//!
//! A clock reading takes some twenty nanoseconds and a step of eight paths a few hundred at least. So the clock is read where steps change from the
//! paths of one visit to those of another, and between steps that take paths of several; time of such a step goes to its paths in equal parts.
//!
//! Where the machine does something else meanwhile, one pixel gets the time, as where paths go one by one: among many its like is found and left out
//! of views, while some pixels side by side would look as if they were dear.

use hotspot_bvh::simd::{Floats, Integers, Lanes, Simd, U8};
use std::time::Instant;

/// Nanoseconds that hardly any step takes, nor anything else that is shared out: what does, and is much longer than the like before it, was
/// interrupted.
pub(crate) const INTERRUPTION: u64 = 250_000;

/// Nanoseconds since a reading, which becomes the present one.
pub(crate) fn passed(since: &mut Instant) -> u64 {
    let now = Instant::now();
    let passed = now.duration_since(*since).as_nanos() as u64;
    *since = now;
    passed
}

/// Shares out time.
#[derive(Debug)]
pub(crate) struct SharedClock<'a> {
    /// The visit of each path of a list, in rising order.
    visits: &'a [u32],
    /// Nanoseconds of each visit.
    spent: &'a mut [u64],
    /// The visits whose paths were taken further since the clock was read last, one for each path, and how many; only one of each where
    /// all are of one visit.
    party: [u32; 8],
    count: usize,
    /// Where they are of one visit, its first path and the one behind its last, as floats: of other paths none is as large as the first and below the
    /// second.
    alone: [f32; 2],
    /// What the last step of several visits took.
    before: u64,
    since: Instant,
}

impl<'a> SharedClock<'a> {
    /// A clock for paths of these visits, whose nanoseconds it adds to `spent`; what passes before the first step is nobody's.
    pub(crate) fn new(visits: &'a [u32], spent: &'a mut [u64]) -> Self {
        Self { visits, spent, party: [0; 8], count: 0, alone: [0.0; 2], before: 0, since: Instant::now() }
    }

    /// The paths of lanes `active`, of these numbers, are about to be taken further.
    #[inline(always)]
    pub(super) fn step<S: Simd>(&mut self, s: S, number: Integers<S>, active: u32) {
        let [first, end] = self.alone.map(|bound| Floats::splat(s, bound));
        let at = number.to_floats();
        if (first.less_equal(at) & at.less(end)).bits() & active != active {
            self.change(&number.store(), active);
        }
    }

    /// They are not all of the visit that the last ones were.
    #[inline(never)]
    fn change(&mut self, number: &U8, active: u32) {
        self.read();
        self.count = 0;
        for lane in Lanes(active) {
            self.party[self.count] = self.visits[number.0[lane] as usize];
            self.count += 1;
        }
        self.alone = [0.0; 2];
        let visit = self.party[0];
        if self.party[..self.count].iter().all(|other| *other == visit) {
            self.count = 1;
            // Numbers of a list's paths are far below 2^24.
            let bounds = [visit, visit + 1];
            self.alone = bounds.map(|bound| self.visits.partition_point(|other| *other < bound) as f32);
        }
    }

    /// Shares out what has passed; now.
    pub(crate) fn read(&mut self) -> Instant {
        let passed = passed(&mut self.since);
        self.share(passed);
        self.since
    }

    fn share(&mut self, mut passed: u64) {
        let interrupted = passed > INTERRUPTION.max(8 * self.before);
        let count = if interrupted { self.count.min(1) } else { self.count };
        if self.count > 1 {
            self.before = passed;
        }
        for (at, visit) in self.party[..count].iter().enumerate() {
            // What division leaves goes to the last ones.
            let share = passed / (count - at) as u64;
            self.spent[*visit as usize] += share;
            passed -= share;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hotspot_bvh::simd::Portable;
    use std::time::Duration;

    /// Every nanosecond goes to whoever was taken further meanwhile.
    #[test]
    fn steps_are_shared_in_equal_parts() {
        let visits = [0, 0, 0, 1, 1, 2];
        let mut spent = [0; 3];
        let mut clock = SharedClock::new(&visits, &mut spent);
        let s = Portable;
        let numbers = Integers::load(s, &U8([0, 1, 2, 3, 4, 5, 99, 99]));
        let mut step = |active, passed| {
            // No time passes by the clock itself, which never goes back.
            clock.since = Instant::now() + Duration::from_secs(3600);
            clock.step(s, numbers, active);
            clock.share(passed);
        };
        step(0b11, 100);
        step(0b1, 1);
        step(0b11_1111, 61);
        step(0b11_1111, 5);
        step(0b10_0000, 7);
        step(0b1_1000, 4);
        // An interruption, then a step as long as that.
        step(0b11_0000, INTERRUPTION + 1);
        clock.share(INTERRUPTION + 3);
        let half = INTERRUPTION / 2 + 1;
        assert_eq!(spent, [101 + 30 + 2, 20 + 2 + 4 + INTERRUPTION + 1 + half, 11 + 1 + 7 + half + 1]);
    }

    /// The time up to a change is that of those who were taken further until then.
    #[test]
    fn changes_read_the_clock() {
        let visits = [0, 0, 1, 1];
        let mut spent = [0; 2];
        let mut clock = SharedClock::new(&visits, &mut spent);
        let numbers = Integers::load(Portable, &U8([0, 1, 2, 3, 99, 99, 99, 99]));
        let mut step = |active, passed| {
            if let Some(since) = clock.since.checked_sub(Duration::from_secs(passed)) {
                clock.since = since;
            }
            clock.step(Portable, numbers, active);
        };
        // What passes before each: nobody's, the first visit's twice, the other's.
        step(0b11, 300);
        step(0b1, 20);
        step(0b1100, 20);
        step(0b110, 100);
        clock.read();
        let seconds = spent.map(|spent| spent / 1_000_000_000);
        assert!((40..100).contains(&seconds[0]) && (100..160).contains(&seconds[1]), "{spent:?}");
    }
}
