//! The matrix while it is gathered: what each spawner's rays visited, by column of [`Payers`].
//!
//! A visit adds once, to one word that holds two sums ([`Pair`]): so a visit costs one look-up and one addition, and a cell
//! takes a quarter of a cache line. Blocks of several objects have columns of their own, shared out among their objects
//! when the rows are made.

use super::payers::{Column, Payers};
use super::rows::Traversal;
use std::collections::BTreeMap;

/// Two sums in one word: boxes (or triangles) above, visits below. A visit of no box at all is booked elsewhere, so visits
/// never outnumber boxes and the top bit is set before either sum leaves its half.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Pair(u64);

impl Pair {
    pub(super) const NOTHING: Self = Self(0);

    /// One visit of so many boxes; `None` where these do not fit: 0, or 2^31 and more.
    #[inline(always)]
    pub(super) const fn visit(boxes: u32) -> Option<Self> {
        if boxes as i32 > 0 { Some(Self((boxes as u64) << 32 | 1)) } else { None }
    }

    /// Adds; true where the sum is now to be taken out ([`Self::take`]) before the next one.
    #[inline(always)]
    #[must_use]
    pub(super) const fn add(&mut self, other: Self) -> bool {
        self.0 = self.0.wrapping_add(other.0);
        (self.0 as i64) < 0
    }

    /// Visits and boxes.
    pub(super) const fn split(self) -> [u64; 2] {
        [self.0 & 0xffff_ffff, self.0 >> 32]
    }

    /// The same, leaving nothing.
    pub(super) const fn take(&mut self) -> [u64; 2] {
        std::mem::replace(self, Self::NOTHING).split()
    }
}

/// Nodes with their boxes, leaf blocks with their triangles.
pub(super) type Cell = [Pair; 2];

/// Which of a cell's pairs.
pub(super) const NODES: usize = 0;
pub(super) const LEAVES: usize = 1;

/// What cells cannot hold, and what few scenes have.
#[derive(Clone, Debug)]
pub(super) struct Aside {
    slots: usize,
    columns: usize,
    /// By index of the cell: nodes, boxes, leaves, shapes.
    overflow: BTreeMap<usize, [u64; 4]>,
    /// `slots` × `slots`, a row for each spawning object: instances, alpha tests.
    rare: Vec<[u64; 2]>,
    /// `slots` × `slots`: paths that went from the one to the other and on.
    landed: Vec<u64>,
}

impl Aside {
    fn add_wide(&mut self, cell: usize, pair: usize, counts: [u64; 2]) {
        let sums = self.overflow.entry(cell).or_default();
        sums[2 * pair] += counts[0];
        sums[2 * pair + 1] += counts[1];
    }

    /// Takes a full pair out of its cell.
    #[cold]
    #[inline(never)]
    pub(super) fn empty(&mut self, cell: usize, pair: usize, full: &mut Pair) {
        self.add_wide(cell, pair, full.take());
    }

    /// A visit that no pair can hold.
    #[cold]
    #[inline(never)]
    pub(super) fn odd_visit(&mut self, cell: usize, pair: usize, boxes: u32) {
        self.add_wide(cell, pair, [1, u64::from(boxes)]);
    }

    /// A visit of a block of several objects that has no column. `start`: [`Self::start`] of the spawner.
    #[cold]
    #[inline(never)]
    pub(super) fn stray_visit(&mut self, start: usize, triangles: &[Column]) {
        self.add_wide(start, LEAVES, [1, 0]);
        for slot in triangles {
            self.add_wide(start + usize::from(*slot), LEAVES, [0, 1]);
        }
    }

    /// Index of a spawner's first cell.
    #[inline(always)]
    pub(super) const fn start(&self, spawner: Column) -> usize {
        spawner as usize * self.columns
    }

    #[inline(always)]
    pub(super) fn instance(&mut self, spawner: Column, payer: Column) {
        self.rare[usize::from(spawner) * self.slots + usize::from(payer)][0] += 1;
    }

    #[inline(always)]
    pub(super) fn alpha_test(&mut self, spawner: Column, payer: Column) {
        self.rare[usize::from(spawner) * self.slots + usize::from(payer)][1] += 1;
    }

    #[inline(always)]
    pub(super) fn landed(&mut self, from: Column, to: Column) {
        self.landed[usize::from(from) * self.slots + usize::from(to)] += 1;
    }
}

/// The sums of one worker.
#[derive(Clone, Debug)]
pub(super) struct Cells {
    /// `slots` × `columns`, a row for each spawning object.
    cells: Vec<Cell>,
    aside: Aside,
}

impl Cells {
    pub(super) fn new(payers: &Payers) -> Self {
        let (slots, columns) = (payers.count(), payers.columns());
        // Zeroed pages take memory only when touched.
        Self {
            cells: vec![[Pair::NOTHING; 2]; slots * columns],
            aside: Aside {
                slots,
                columns,
                overflow: BTreeMap::new(),
                rare: vec![[0; 2]; slots * slots],
                landed: vec![0; slots * slots],
            },
        }
    }

    /// The cells, by spawner ([`Aside::start`]) and column, and what is kept beside them.
    #[inline(always)]
    pub(super) const fn parts(&mut self) -> (&mut [Cell], &mut Aside) {
        (self.cells.as_mut_slice(), &mut self.aside)
    }

    pub(super) fn merge(&mut self, other: &Self) {
        assert_eq!(
            (self.aside.slots, self.aside.columns),
            (other.aside.slots, other.aside.columns),
            "ledgers of different scenes"
        );
        for (index, (sums, counts)) in self.cells.iter_mut().zip(&other.cells).enumerate() {
            // Most are empty: they are not written to, so that they take no memory.
            if *counts != [Pair::NOTHING; 2] {
                for pair in [NODES, LEAVES] {
                    if sums[pair].add(counts[pair]) {
                        self.aside.add_wide(index, pair, sums[pair].take());
                    }
                }
            }
        }
        for (cell, counts) in &other.aside.overflow {
            self.aside.add_wide(*cell, NODES, [counts[0], counts[1]]);
            self.aside.add_wide(*cell, LEAVES, [counts[2], counts[3]]);
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
        size_of_val(self.cells.as_slice())
            + size_of_val(self.aside.rare.as_slice())
            + size_of_val(self.aside.landed.as_slice())
            + self.aside.overflow.len() * size_of::<(usize, [u64; 4])>()
    }

    /// What the rays of a spawner did, and how many paths went on, by payer.
    pub(super) fn paid(&self, spawner: usize, payers: &Payers) -> Vec<(Traversal, u64)> {
        let Aside { slots, columns, overflow, rare, landed } = &self.aside;
        let square = spawner * slots..(spawner + 1) * slots;
        let mut paid: Vec<(Traversal, u64)> = rare[square.clone()]
            .iter()
            .zip(&landed[square])
            .map(|(&[instances, alpha_tests], landed)| {
                (Traversal { instances, alpha_tests, ..Traversal::default() }, *landed)
            })
            .collect();
        let start = spawner * columns;
        let mut add = |column: usize, [nodes, boxes, leaves, shapes]: [u64; 4]| {
            if let Some((paid, _)) = paid.get_mut(column) {
                paid.add(&Traversal { nodes, boxes, leaves, shapes, ..Traversal::default() });
            } else {
                paid[0].0.leaves += leaves;
                for (slot, triangles) in payers.set(column) {
                    paid[usize::from(*slot)].0.shapes += leaves * triangles;
                }
            }
        };
        for (column, [nodes, leaves]) in self.cells[start..start + columns].iter().enumerate() {
            let ([nodes, boxes], [leaves, shapes]) = (nodes.split(), leaves.split());
            if nodes + leaves > 0 {
                add(column, [nodes, boxes, leaves, shapes]);
            }
        }
        for (cell, counts) in overflow.range(start..start + columns) {
            add(cell - start, *counts);
        }
        paid
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_say_when_they_are_full_and_lose_nothing() {
        assert_eq!((Pair::visit(0), Pair::visit(1 << 31)), (None, None));
        for boxes in [1, 3, 8, (1 << 31) - 1] {
            let one = Pair::visit(boxes).unwrap();
            assert_eq!(one.split(), [1, u64::from(boxes)]);
            // As full as it gets without saying so, by adding it to itself.
            let (mut pair, mut visits) = (one, 1u64);
            loop {
                let (before, twice) = (pair, pair);
                let full = pair.add(twice);
                visits *= 2;
                assert_eq!(pair.split(), [visits, visits * u64::from(boxes)]);
                assert_eq!(full, visits * u64::from(boxes) >= 1 << 31, "{before:?}");
                if full {
                    assert_eq!((pair.take(), pair), ([visits, visits * u64::from(boxes)], Pair::NOTHING));
                    break;
                }
            }
        }
    }
}
