//! The spawner ledger while it is gathered: an open-addressing table, since there are far more possible keys than real ones.

use super::payers::Column;
use crate::pair::{LEAVES, NODES, PAIRS, Pair};
use hotspot_probe::RayKind;
use std::collections::BTreeMap;

/// Bounces from here on share an entry.
pub(super) const LAST_BOUNCE: u32 = 31;

/// What sends a ray, as ledgers book it: object (11 bits), light (11 bits), bounce (5 bits), kind (2 bits), material (32 bits).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct RayKey(u64);

/// An object with a material, as a part of [`RayKey`]s ([`Payers::sender`](super::Payers::sender)).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sender(u64);

/// A light that shadow rays are aimed at, as a part of [`RayKey`]s ([`Payers::aim`](super::Payers::aim)).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Aim(u64);

impl Sender {
    /// Object: a slot, below 2^11.
    #[inline(always)]
    pub(super) fn new(object: Column, material: u32) -> Self {
        Self(u64::from(object) << 50 | u64::from(material))
    }
}

impl Aim {
    /// None that has an entry of its own.
    pub const NONE: Self = Self(0);

    /// Light: a slot, below 2^11.
    #[inline(always)]
    pub(super) fn new(light: Column) -> Self {
        Self(u64::from(light) << 39)
    }
}

impl RayKey {
    /// No ray's.
    const EMPTY: Self = Self(u64::MAX);

    /// Of a ray of this kind after so many scattering events.
    #[inline(always)]
    pub fn new(Sender(sender): Sender, Aim(aim): Aim, bounce: u32, kind: RayKind) -> Self {
        let how = 4 * bounce.min(LAST_BOUNCE) + kind as u32;
        Self(sender | aim | u64::from(how) << 32)
    }

    pub(super) const fn object(self) -> Column {
        (self.0 >> 50) as Column
    }

    pub(super) const fn material(self) -> u32 {
        self.0 as u32
    }

    pub(super) const fn light(self) -> Column {
        (self.0 >> 39 & 0x7ff) as Column
    }

    pub(super) const fn bounce(self) -> u32 {
        (self.0 >> 34) as u32 & LAST_BOUNCE
    }

    pub(super) const fn kind(self) -> RayKind {
        match self.0 >> 32 & 3 {
            0 => RayKind::Camera,
            1 => RayKind::Bounce,
            _ => RayKind::Shadow,
        }
    }
}

/// Counts of a bin.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct BinCounts {
    pub(super) rays: u64,
    pub(super) hits: u64,
    /// Nodes and shapes of blocked shadow rays.
    pub(super) blocked: u64,
    pub(super) nodes: u64,
    pub(super) boxes: u64,
    pub(super) leaves: u64,
    pub(super) shapes: u64,
}

impl BinCounts {
    pub(super) fn add(&mut self, other: &Self) {
        self.rays += other.rays;
        self.hits += other.hits;
        self.blocked += other.blocked;
        self.nodes += other.nodes;
        self.boxes += other.boxes;
        self.leaves += other.leaves;
        self.shapes += other.shapes;
    }
}

/// A cache line. Rays and hits do not lie side by side: compilers would make a vector of them, for twice the instructions.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
struct Bin {
    key: RayKey,
    rays: u64,
    /// Nodes with boxes, leaf blocks with shapes.
    visits: [Pair; PAIRS],
    /// The same, of blocked shadow rays.
    blocked: [Pair; PAIRS],
    hits: u64,
}

const EMPTY: Bin = Bin {
    key: RayKey::EMPTY,
    rays: 0,
    hits: 0,
    visits: [Pair::NOTHING; PAIRS],
    blocked: [Pair::NOTHING; PAIRS],
};

impl Bin {
    /// Adds a ray; whether a sum is full then.
    #[inline(always)]
    #[must_use]
    fn add(&mut self, hit: bool, visits: [Pair; PAIRS], blocked: bool) -> bool {
        self.rays += 1;
        self.hits += u64::from(hit);
        let mut full = false;
        for (sum, visits) in self.visits.iter_mut().zip(visits) {
            full |= sum.add(visits);
        }
        if blocked {
            for (sum, visits) in self.blocked.iter_mut().zip(visits) {
                full |= sum.add(visits);
            }
        }
        full
    }

    /// All but those that went aside.
    const fn counts(&self) -> BinCounts {
        let ([nodes, boxes], [leaves, shapes]) = (self.visits[NODES].split(), self.visits[LEAVES].split());
        let blocked = self.blocked[NODES].split()[0] + self.blocked[LEAVES].split()[1];
        BinCounts { rays: self.rays, hits: self.hits, blocked, nodes, boxes, leaves, shapes }
    }
}

/// Instances and alpha tests of a bin, where there are any.
pub(super) type RareCounts = [u64; 2];

/// The table: a power of two of bins, at most one in eight of them used, so that few rays need to search.
#[derive(Clone, Debug)]
pub(super) struct Bins {
    bins: Vec<Bin>,
    /// By bin.
    rare: Vec<RareCounts>,
    /// What pairs could not hold.
    wide: BTreeMap<RayKey, BinCounts>,
    used: usize,
    /// Bits of a hash that are too many.
    shift: u32,
}

/// Bins of an empty table.
const FEWEST: usize = 2048;

impl Bins {
    pub(super) fn new() -> Self {
        Self {
            bins: vec![EMPTY; FEWEST],
            rare: vec![[0; 2]; FEWEST],
            wide: BTreeMap::new(),
            used: 0,
            shift: u64::BITS - FEWEST.ilog2(),
        }
    }

    /// Where the search for a key begins: Fibonacci hashing, by the product's top bits, since only those depend on the whole key.
    #[inline(always)]
    fn first(&self, key: RayKey) -> usize {
        (key.0.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> self.shift) as usize
    }

    /// Adds a ray with its visits of nodes and leaf blocks. `blocked`: it is a shadow ray that hit.
    #[inline(always)]
    pub(super) fn add_ray(&mut self, key: RayKey, hit: bool, visits: [Pair; PAIRS], blocked: bool) {
        let index = self.first(key);
        let Some(bin) = self.bins.get_mut(index).filter(|bin| bin.key == key) else {
            let [nodes, leaves] = visits;
            return self.add_elsewhere(key, hit, nodes, leaves, blocked);
        };
        if bin.add(hit, visits, blocked) {
            self.empty(index);
        }
    }

    /// The same, of a key whose bin is not where the search begins, or that has none. Pairs by themselves stay in registers.
    #[inline(never)]
    fn add_elsewhere(&mut self, key: RayKey, hit: bool, nodes: Pair, leaves: Pair, blocked: bool) {
        let index = self.find(key);
        if self.bins[index].add(hit, [nodes, leaves], blocked) {
            self.empty(index);
        }
    }

    /// Takes the sums out of a bin of which one is full.
    #[cold]
    #[inline(never)]
    fn empty(&mut self, index: usize) {
        let Bin { key, .. } = self.bins[index];
        self.wide.entry(key).or_default().add(&self.bins[index].counts());
        self.bins[index] = Bin { key, ..EMPTY };
    }

    /// Adds what pairs may not hold.
    #[cold]
    #[inline(never)]
    pub(super) fn add_wide(&mut self, key: RayKey, counts: &BinCounts) {
        self.find(key);
        self.wide.entry(key).or_default().add(counts);
    }

    /// Adds instances and alpha tests.
    pub(super) fn add_rare(&mut self, key: RayKey, rare: RareCounts) {
        let index = self.find(key);
        self.rare[index][0] += rare[0];
        self.rare[index][1] += rare[1];
    }

    /// The bin of a key, made where there is none.
    fn find(&mut self, key: RayKey) -> usize {
        let place = self.place(key);
        if self.bins[place].key == key {
            return place;
        }
        self.used += 1;
        if 8 * self.used > self.bins.len() {
            let len = 2 * self.bins.len();
            self.shift -= 1;
            let bins = std::mem::replace(&mut self.bins, vec![EMPTY; len]);
            let rare = std::mem::replace(&mut self.rare, vec![[0; 2]; len]);
            for (bin, rare) in bins.into_iter().zip(rare).filter(|(bin, _)| bin.key != RayKey::EMPTY) {
                let place = self.place(bin.key);
                self.bins[place] = bin;
                self.rare[place] = rare;
            }
        }
        let place = self.place(key);
        self.bins[place].key = key;
        place
    }

    /// The place of a key, or the free one where it belongs.
    fn place(&self, key: RayKey) -> usize {
        let mut index = self.first(key);
        while self.bins[index].key != key && self.bins[index].key != RayKey::EMPTY {
            index = (index + 1) & (self.bins.len() - 1);
        }
        index
    }

    /// What was counted, in no order.
    pub(super) fn iter(&self) -> impl Iterator<Item = (RayKey, BinCounts, RareCounts)> {
        let used = self.bins.iter().zip(&self.rare).filter(|(bin, _)| bin.key != RayKey::EMPTY);
        used.map(|(bin, rare)| {
            let mut counts = self.wide.get(&bin.key).copied().unwrap_or_default();
            counts.add(&bin.counts());
            (bin.key, counts, *rare)
        })
    }

    pub(super) fn merge(&mut self, other: &Self) {
        for (key, counts, rare) in other.iter() {
            self.add_wide(key, &counts);
            self.add_rare(key, rare);
        }
    }

    pub(super) fn memory(&self) -> usize {
        size_of_val(self.bins.as_slice()) + size_of_val(self.rare.as_slice())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Random;
    use hotspot_probe::NONE;
    use std::collections::BTreeMap;

    #[test]
    fn agrees_with_a_sorted_map() {
        let mut random = Random::new(5);
        let (mut bins, mut other, mut expected) = (Bins::new(), Bins::new(), BTreeMap::new());
        for round in 0..20_000u64 {
            let kind = [RayKind::Camera, RayKind::Bounce, RayKind::Shadow][random.below(3) as usize];
            let key = RayKey::new(
                Sender::new(random.below(30) as Column, random.below(4)),
                Aim::new(random.below(3) as Column),
                random.below(40),
                kind,
            );
            // Few rays of many bins, so that some sums are full at some time.
            let [nodes, leaves] = [[3, 4], [5, 6]].map(|visits: [u64; 2]| {
                if random.below(9) == 0 { [Pair::FULL - visits[0], 255 * Pair::FULL / 2] } else { visits }
            });
            let (hit, shadow) = (round % 2 == 0, kind == RayKind::Shadow);
            let counts = BinCounts {
                rays: 1,
                hits: hit.into(),
                blocked: if hit && shadow { nodes[0] + leaves[1] } else { 0 },
                nodes: nodes[0],
                boxes: nodes[1],
                leaves: leaves[0],
                shapes: leaves[1],
            };
            let rare = [round % 3, round % 2];
            let into = if round % 3 == 0 { &mut other } else { &mut bins };
            into.add_ray(key, hit, [nodes, leaves].map(|visits| Pair::of(visits).unwrap()), hit && shadow);
            into.add_rare(key, rare);
            let sums: &mut (BinCounts, RareCounts) = expected.entry(key).or_default();
            sums.0.add(&counts);
            sums.1[0] += rare[0];
            sums.1[1] += rare[1];
        }
        bins.merge(&other);
        let found: BTreeMap<RayKey, (BinCounts, RareCounts)> =
            bins.iter().map(|(key, counts, rare)| (key, (counts, rare))).collect();
        assert!(found == expected && found.len() > 4000);
        assert_eq!(found.values().map(|(counts, _)| counts.rays).sum::<u64>(), 20_000);
        assert_eq!(size_of::<Bin>(), 64);
    }

    #[test]
    fn keys_keep_their_parts() {
        for kind in [RayKind::Camera, RayKind::Bounce, RayKind::Shadow] {
            for (object, material, light, bounce) in
                [(0, NONE, 0, 0), (2047, 0, 1, 30), (5, NONE - 1, 2047, 31)]
            {
                let key = RayKey::new(Sender::new(object, material), Aim::new(light), bounce, kind);
                assert_eq!((key.object(), key.material(), key.light()), (object, material, light));
                assert_eq!((key.bounce(), key.kind()), (bounce, kind));
                assert_ne!(key, RayKey::EMPTY);
            }
        }
        assert_eq!(RayKey::new(Sender::new(0, 0), Aim::NONE, 99, RayKind::Bounce).bounce(), LAST_BOUNCE);
    }
}
