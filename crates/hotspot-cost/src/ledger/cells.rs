//! The matrix while it is gathered: what each spawner's rays visited, by column of [`Payers`].
//!
//! A visit adds once, to one word that holds two sums ([`Pair`]): so a visit costs one look-up and one addition, and a column
//! takes a quarter of a cache line of each row, a pair for nodes and one for leaf blocks ([`Place`](super::payers::Place)).
//! Blocks of several objects have columns of their own, shared out among their objects when the rows are made.

use super::payers::{Column, Payers, Place};
use super::rows::Traversal;
use crate::pair::{NODES, PAIRS, Pair};
use std::collections::BTreeMap;
use std::ops::Range;

/// A row and what follows it, as far as any place can point: so a visit need not ask whether its place is there. Places are those of the
/// row alone ([`Payers`]). Each word is a [`Pair`]: memory of words that are 0 is not written to before it is used.
pub(super) type Row = [u64; ROW];
const ROW: usize = Place::MAX as usize + 1;

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
    pub(super) fn leave(&mut self, spawner: Column, row: &mut Row, inside: Column) {
        for pair in 0..PAIRS {
            let visits = Pair::take_from(&mut row[self.pairs - PAIRS + pair]);
            let place = PAIRS as Place * inside + pair as Place;
            // Not as a pair: it might not fit beside what is there.
            if visits[0] > 0 {
                let slot = &mut row[usize::from(place)];
                let [before, boxes] = Pair::take_from(slot);
                match Pair::of([before + visits[0], boxes + visits[1]]) {
                    Some(sum) => *slot = sum.0,
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
    const fn row(&self, spawner: Column) -> Range<usize> {
        let start = spawner as usize * self.pairs;
        start..start + self.pairs
    }

    /// The same among all pairs ([`Cells::parts`]).
    #[inline(always)]
    pub(super) fn row_of<'c>(&self, words: &'c mut [u64], spawner: Column) -> &'c mut Row {
        // Sums of numbers of so few bits cannot overflow, which leaves one check.
        let start = usize::from(spawner) * self.pairs as u32 as usize;
        match words.get_mut(start..start + ROW).map(TryFrom::try_from) {
            Some(Ok(row)) => row,
            _ => unreachable!("a row's length stands behind the last"),
        }
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
    /// A row for each spawning object: a pair for each place. Then nothing, so that there is a [`Row`] from each on.
    pairs: Vec<u64>,
    aside: Aside,
}

impl Cells {
    pub(super) fn new(payers: &Payers) -> Self {
        let (slots, pairs) = (payers.count(), PAIRS * payers.columns());
        Self {
            pairs: vec![0; slots * pairs + ROW],
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
    pub(super) const fn parts(&mut self) -> (&mut [u64], &mut Aside) {
        (self.pairs.as_mut_slice(), &mut self.aside)
    }

    pub(super) fn merge(&mut self, other: &Self) {
        assert_eq!(
            (self.aside.slots, self.aside.pairs),
            (other.aside.slots, other.aside.pairs),
            "ledgers of different scenes"
        );
        // Most are empty: they are not written to, so that they take no memory.
        for (index, (sum, counts)) in self.pairs.iter_mut().zip(&other.pairs).enumerate() {
            if *counts != 0 && Pair(*counts).add_to(sum) {
                self.aside.add_wide(index, Pair::take_from(sum));
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
            if *pair != 0 {
                add(place, Pair(*pair).split());
            }
        }
        for (index, counts) in overflow.range(row.clone()) {
            add(index - row.start, *counts);
        }
        paid
    }
}
