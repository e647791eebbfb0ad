//! The spawner ledger while it is gathered: an open-addressing table, since there are far more possible keys than real ones.

use super::payers::Slot;
use hotspot_probe::RayKind;

/// Bounces from here on share an entry.
pub(super) const LAST_BOUNCE: u32 = 31;

/// What sent a ray.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Key {
    pub(super) object: Slot,
    pub(super) material: u32,
    pub(super) light: Slot,
    /// Bounce · 4 + kind.
    how: u32,
}

impl Key {
    /// No ray's.
    const EMPTY: Self = Self { object: 0, material: 0, light: 0, how: u32::MAX };

    #[inline(always)]
    pub(super) fn new(object: Slot, material: u32, light: Slot, bounce: u32, kind: RayKind) -> Self {
        Self { object, material, light, how: bounce.min(LAST_BOUNCE) * 4 + kind as u32 }
    }

    pub(super) const fn bounce(self) -> u32 {
        self.how / 4
    }

    pub(super) const fn kind(self) -> RayKind {
        match self.how % 4 {
            0 => RayKind::Camera,
            1 => RayKind::Bounce,
            _ => RayKind::Shadow,
        }
    }

    /// Fibonacci hashing of the two halves.
    #[inline(always)]
    const fn hash(self) -> usize {
        let high = (self.object as u64) << 32 | self.material as u64;
        let low = (self.light as u64) << 32 | self.how as u64;
        let mixed = high.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ low.wrapping_mul(0xd1b5_4a32_d192_ed03);
        (mixed >> 32) as usize
    }
}

/// Counts of a bin: rays, hits, blocked cost, nodes, boxes, leaves, shapes, instances, alpha tests.
pub(super) type BinCounts = [u64; 9];

#[derive(Clone, Copy, Debug)]
struct Bin {
    key: Key,
    counts: BinCounts,
}

const EMPTY: Bin = Bin { key: Key::EMPTY, counts: [0; 9] };

/// The table: a power of two of bins, at most half of them used.
#[derive(Clone, Debug)]
pub(super) struct Bins {
    bins: Vec<Bin>,
    used: usize,
}

impl Bins {
    pub(super) fn new() -> Self {
        Self { bins: vec![EMPTY; 256], used: 0 }
    }

    #[inline(always)]
    pub(super) fn add(&mut self, key: Key, counts: &BinCounts) {
        let mask = self.bins.len() - 1;
        let mut index = key.hash() & mask;
        loop {
            let bin = &mut self.bins[index];
            if bin.key == key {
                for (sum, count) in bin.counts.iter_mut().zip(counts) {
                    *sum += count;
                }
                return;
            }
            if bin.key == Key::EMPTY {
                return self.insert(key, counts);
            }
            index = (index + 1) & mask;
        }
    }

    #[cold]
    #[inline(never)]
    fn insert(&mut self, key: Key, counts: &BinCounts) {
        if 2 * (self.used + 1) > self.bins.len() {
            let larger = vec![EMPTY; 2 * self.bins.len()];
            let old = std::mem::replace(&mut self.bins, larger);
            for bin in old.into_iter().filter(|bin| bin.key != Key::EMPTY) {
                let place = self.free(bin.key);
                self.bins[place] = bin;
            }
        }
        let place = self.free(key);
        self.bins[place] = Bin { key, counts: *counts };
        self.used += 1;
    }

    /// The first free place for a key that is not in the table.
    fn free(&self, key: Key) -> usize {
        let mask = self.bins.len() - 1;
        let mut index = key.hash() & mask;
        while self.bins[index].key != Key::EMPTY {
            index = (index + 1) & mask;
        }
        index
    }

    /// What was counted, in no order.
    pub(super) fn iter(&self) -> impl Iterator<Item = (Key, &BinCounts)> {
        self.bins.iter().filter(|bin| bin.key != Key::EMPTY).map(|bin| (bin.key, &bin.counts))
    }

    pub(super) fn merge(&mut self, other: &Self) {
        for (key, counts) in other.iter() {
            self.add(key, counts);
        }
    }

    pub(super) fn memory(&self) -> usize {
        size_of_val(self.bins.as_slice())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Random;
    use std::collections::BTreeMap;

    #[test]
    fn agrees_with_a_sorted_map() {
        let mut random = Random::new(5);
        let (mut bins, mut other, mut expected) = (Bins::new(), Bins::new(), BTreeMap::new());
        for round in 0..20_000u64 {
            let kind = [RayKind::Camera, RayKind::Bounce, RayKind::Shadow][random.below(3) as usize];
            let key = Key::new(random.below(30), random.below(4), random.below(3), random.below(40), kind);
            assert_eq!(key.kind(), kind);
            let counts = [1, round % 2, round, 3, 4, 5, 6, 0, 1];
            if round % 3 == 0 { &mut other } else { &mut bins }.add(key, &counts);
            let sums: &mut BinCounts = expected.entry(key).or_default();
            for (sum, count) in sums.iter_mut().zip(counts) {
                *sum += count;
            }
        }
        bins.merge(&other);
        let found: BTreeMap<Key, BinCounts> = bins.iter().map(|(key, counts)| (key, *counts)).collect();
        assert!(found == expected && found.len() > 4000);
        assert!(found.keys().all(|key| key.bounce() <= LAST_BOUNCE));
    }
}
