//! The matrix while it is gathered: what each spawner's rays visited, by column of [`Payers`].
//!
//! A visit adds once, to one word that holds two sums ([`Pair`]): so a visit costs one look-up and one addition, and a column
//! takes a quarter of a cache line of each row, a pair for nodes and one for leaf blocks ([`Place`](super::payers::Place)).
//! Blocks of several objects have columns of their own, shared out among their objects when the rows are made.

use super::payers::{Column, Payers, Place};
use super::rows::Traversal;
use std::collections::BTreeMap;
use std::ops::Range;

/// Two sums in one word: visits below, above them visits and boxes (or triangles) together. So the upper sum is never the
/// lesser, whatever a visit is of, and the top bit is set before either leaves its half.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Pair(u64);

impl Pair {
    pub(super) const NOTHING: Self = Self(0);
    /// Visits of so many boxes and more are booked elsewhere.
    const MOST: u32 = 1 << 30;

    /// One visit of so many boxes; `None` where these do not fit: 2^30 and more.
    #[inline(always)]
    pub(super) const fn visit(boxes: u32) -> Option<Self> {
        if boxes < Self::MOST { Some(Self(((boxes as u64) << 32) + (1 << 32 | 1))) } else { None }
    }

    /// So many visits and boxes, where they fit.
    pub(super) const fn of([visits, boxes]: [u64; 2]) -> Option<Self> {
        if visits + boxes < 1 << 31 { Some(Self((visits + boxes) << 32 | visits)) } else { None }
    }

    /// Adds; true where the sum is now to be taken out ([`Self::take`]) before the next one.
    #[inline(always)]
    #[must_use]
    pub(super) const fn add(&mut self, other: Self) -> bool {
        self.0 = self.0.wrapping_add(other.0);
        (self.0 as i64) < 0
    }

    /// Visits and boxes.
    #[inline(always)]
    pub(super) const fn split(self) -> [u64; 2] {
        let visits = self.0 & 0xffff_ffff;
        [visits, (self.0 >> 32) - visits]
    }

    /// The same, leaving nothing.
    #[inline(always)]
    pub(super) const fn take(&mut self) -> [u64; 2] {
        std::mem::replace(self, Self::NOTHING).split()
    }
}

/// Which of a column's pairs: nodes with their boxes, leaf blocks with their triangles.
pub(super) const NODES: usize = 0;
pub(super) const LEAVES: usize = 1;
/// How many.
pub(super) const PAIRS: usize = 2;

/// What cells cannot hold, and what few scenes have.
#[derive(Clone, Debug)]
pub(super) struct Aside {
    slots: usize,
    /// Of a row.
    pairs: usize,
    /// By index of the pair: visits, boxes.
    overflow: BTreeMap<usize, [u64; 2]>,
    /// `slots` × `slots`, a row for each spawning object: instances, alpha tests.
    rare: Vec<[u64; 2]>,
    /// `slots` × `slots`: paths that went from the one to the other and on.
    landed: Vec<u64>,
}

impl Aside {
    fn add_wide(&mut self, index: usize, [visits, boxes]: [u64; 2]) {
        let sums = self.overflow.entry(index).or_default();
        sums[0] += visits;
        sums[1] += boxes;
    }

    /// What no pair can hold: a full one that is taken out, a visit of very many boxes. `spawner`'s, at `place` of its row.
    pub(super) fn odd_visits(&mut self, spawner: Column, place: Place, visits: [u64; 2]) {
        self.add_wide(self.row(spawner).start + usize::from(place), visits);
    }

    /// Books what stands in a row's places of the instance that the ray was in ([`Payers::inside`]) on that one's slot.
    pub(super) fn leave(&mut self, spawner: Column, row: &mut [Pair], inside: Column) {
        for pair in 0..PAIRS {
            let visits = row[row.len() - PAIRS + pair].take();
            let place = PAIRS as Place * inside + pair as Place;
            // Not as a pair: it might not fit beside what is there.
            if visits[0] > 0 {
                let slot = &mut row[usize::from(place)];
                let [before, boxes] = slot.take();
                match Pair::of([before + visits[0], boxes + visits[1]]) {
                    Some(sum) => *slot = sum,
                    None => self.odd_visits(spawner, place, [before + visits[0], boxes + visits[1]]),
                }
            }
        }
        // What no pair could hold: there is hardly ever any.
        if !self.overflow.is_empty() {
            let end = self.row(spawner).end;
            for pair in 0..PAIRS {
                if let Some(visits) = self.overflow.remove(&(end - PAIRS + pair)) {
                    self.odd_visits(spawner, PAIRS as Place * inside + pair as Place, visits);
                }
            }
        }
    }

    /// A visit beyond every row: of a block of several objects that has no column, or of what does not exist.
    pub(super) fn visit_nowhere(&mut self, spawner: Column, pair: usize, boxes: u32, triangles: &[Column]) {
        let start = self.row(spawner).start + pair;
        if triangles.is_empty() {
            return self.add_wide(start, [1, u64::from(boxes)]);
        }
        self.add_wide(start, [1, 0]);
        for slot in triangles {
            self.add_wide(start + PAIRS * usize::from(*slot), [0, 1]);
        }
    }

    /// A spawner's row: the indices of its pairs.
    #[inline(always)]
    pub(super) const fn row(&self, spawner: Column) -> Range<usize> {
        let start = spawner as usize * self.pairs;
        start..start + self.pairs
    }

    #[inline(always)]
    pub(super) fn instance(&mut self, spawner: Column, payer: Column) {
        self.rare[usize::from(spawner) * self.slots + usize::from(payer)][0] += 1;
    }

    #[inline(always)]
    pub(super) fn alpha_test(&mut self, spawner: Column, payer: Column) {
        self.rare[usize::from(spawner) * self.slots + usize::from(payer)][1] += 1;
    }

    /// A path went on from an object to another; `from`: 0 for the camera, else what this said of that object.
    #[inline(always)]
    pub(super) fn landed(&mut self, from: usize, to: Column) -> usize {
        self.landed[from + usize::from(to)] += 1;
        usize::from(to) * self.slots
    }
}

/// The sums of one worker.
#[derive(Clone, Debug)]
pub(super) struct Cells {
    /// A row for each spawning object: a pair for each place.
    pairs: Vec<Pair>,
    aside: Aside,
}

impl Cells {
    pub(super) fn new(payers: &Payers) -> Self {
        let (slots, pairs) = (payers.count(), PAIRS * payers.columns());
        Self {
            pairs: vec![Pair::NOTHING; slots * pairs],
            aside: Aside {
                slots,
                pairs,
                overflow: BTreeMap::new(),
                rare: vec![[0; 2]; slots * slots],
                landed: vec![0; slots * slots],
            },
        }
    }

    /// The pairs, by row ([`Aside::row`]) and place, and what is kept beside them.
    #[inline(always)]
    pub(super) const fn parts(&mut self) -> (&mut [Pair], &mut Aside) {
        (self.pairs.as_mut_slice(), &mut self.aside)
    }

    pub(super) fn merge(&mut self, other: &Self) {
        assert_eq!(
            (self.aside.slots, self.aside.pairs),
            (other.aside.slots, other.aside.pairs),
            "ledgers of different scenes"
        );
        for (index, (sum, counts)) in self.pairs.iter_mut().zip(&other.pairs).enumerate() {
            // Most are empty: they are not written to, so that they take no memory.
            if *counts != Pair::NOTHING && sum.add(*counts) {
                self.aside.add_wide(index, sum.take());
            }
        }
        for (index, counts) in &other.aside.overflow {
            self.aside.add_wide(*index, *counts);
        }
        for (sums, counts) in self.aside.rare.iter_mut().zip(&other.aside.rare) {
            if *counts != [0; 2] {
                sums[0] += counts[0];
                sums[1] += counts[1];
            }
        }
        for (sum, count) in self.aside.landed.iter_mut().zip(&other.aside.landed) {
            if *count != 0 {
                *sum += count;
            }
        }
    }

    /// Bytes that may be touched.
    pub(super) fn memory(&self) -> usize {
        size_of_val(self.pairs.as_slice())
            + size_of_val(self.aside.rare.as_slice())
            + size_of_val(self.aside.landed.as_slice())
            + self.aside.overflow.len() * size_of::<(usize, [u64; 2])>()
    }

    /// What the rays of a spawner did, and how many paths went on, by payer.
    pub(super) fn paid(&self, spawner: usize, payers: &Payers) -> Vec<(Traversal, u64)> {
        let Aside { slots, overflow, rare, landed, .. } = &self.aside;
        let square = spawner * slots..(spawner + 1) * slots;
        let mut paid: Vec<(Traversal, u64)> = rare[square.clone()]
            .iter()
            .zip(&landed[square])
            .map(|(&[instances, alpha_tests], landed)| {
                (Traversal { instances, alpha_tests, ..Traversal::default() }, *landed)
            })
            .collect();
        let mut add = |place: usize, [visits, boxes]: [u64; 2]| {
            // Visits of instances' nodes by rays that were in none are the scene's.
            let column = if place / PAIRS == payers.inside() { 0 } else { place / PAIRS };
            if let Some((paid, _)) = paid.get_mut(column) {
                let (nodes, leaves) = if place % PAIRS == NODES { (visits, 0) } else { (0, visits) };
                let (boxes, shapes) = if place % PAIRS == NODES { (boxes, 0) } else { (0, boxes) };
                paid.add(&Traversal { nodes, boxes, leaves, shapes, ..Traversal::default() });
            } else {
                // Sets are those of blocks.
                paid[0].0.leaves += visits;
                for (slot, triangles) in payers.set(column) {
                    paid[usize::from(*slot)].0.shapes += visits * triangles;
                }
            }
        };
        let row = self.aside.row(spawner as Column);
        for (place, pair) in self.pairs[row.clone()].iter().enumerate() {
            if *pair != Pair::NOTHING {
                add(place, pair.split());
            }
        }
        for (index, counts) in overflow.range(row.clone()) {
            add(index - row.start, *counts);
        }
        paid
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_say_when_they_are_full_and_lose_nothing() {
        assert_eq!((Pair::visit(1 << 30), Pair::visit(u32::MAX)), (None, None));
        for boxes in [0, 1, 3, 8, (1 << 30) - 1] {
            let one = Pair::visit(boxes).unwrap();
            assert_eq!(one.split(), [1, u64::from(boxes)]);
            // As full as it gets without saying so, by adding it to itself.
            let (mut pair, mut visits) = (one, 1u64);
            loop {
                let (before, twice) = (pair, pair);
                let full = pair.add(twice);
                visits *= 2;
                assert_eq!(pair.split(), [visits, visits * u64::from(boxes)]);
                assert_eq!(full, visits * (u64::from(boxes) + 1) >= 1 << 31, "{before:?}");
                if full {
                    assert_eq!((pair.take(), pair), ([visits, visits * u64::from(boxes)], Pair::NOTHING));
                    break;
                }
            }
        }
    }
}
