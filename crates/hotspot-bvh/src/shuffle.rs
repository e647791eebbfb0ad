//! Other trees over the same triangles, as good as the one that everyone gets: how much of a cost is the tree's luck?
//!
//! Editing a scene rebuilds its tree, and every ray's counts change a little, also where nothing was edited. How much, is
//! measured by building the same scene several times with [`crate::BuildOptions::shuffle`] set to different numbers.
//!
//! A shuffle changes what decides a topology without being a property of the scene: the order of the primitives, which
//! breaks ties, and the axes, which decide the Morton order that the builder starts from. The boxes are turned by one of the 48
//! symmetries of the cube; areas, hence the surface area heuristic, are what they were. Shuffling the order alone would show
//! next to nothing, since Morton codes seldom tie. Only the topology is made from turned boxes: triangles, their numbers
//! and therefore hits and ties between them stay.

use crate::node::Bounds;

/// An order of primitives and a symmetry of the cube.
pub(crate) struct Shuffle {
    /// The primitive at each place.
    order: Vec<u32>,
    /// Where each axis comes from.
    axes: [usize; 3],
    /// Turns each axis round.
    mirrored: [bool; 3],
}

impl Shuffle {
    /// The shuffle of that number; the same for the same number and count, on any machine.
    pub(crate) fn new(seed: u64, count: usize) -> Self {
        let mut random = SplitMix(seed);
        const AXES: [[usize; 3]; 6] = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
        let symmetry = random.below(48);
        let mirrored = [1, 2, 4].map(|bit| symmetry & bit != 0);
        let mut order: Vec<u32> = (0..count as u32).collect();
        // Fisher and Yates.
        for last in (1..count).rev() {
            order.swap(last, random.below(last as u64 + 1) as usize);
        }
        Self { order, axes: AXES[(symmetry / 8) as usize], mirrored }
    }

    /// The primitive at each place.
    pub(crate) fn order(&self) -> &[u32] {
        &self.order
    }

    /// A box in the shuffle's axes.
    pub(crate) fn turned(&self, b: &Bounds) -> Bounds {
        let mut turned = Bounds::EMPTY;
        for (to, (&from, &mirrored)) in self.axes.iter().zip(&self.mirrored).enumerate() {
            (turned.min[to], turned.max[to]) =
                if mirrored { (-b.max[from], -b.min[from]) } else { (b.min[from], b.max[from]) };
        }
        turned
    }
}

/// SplitMix64 (Steele, Lea and Flood 2014).
struct SplitMix(u64);

impl SplitMix {
    fn below(&mut self, limit: u64) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        // Multiply and shift: its bias, at most limit/2^64, is no matter here.
        ((u128::from(z ^ (z >> 31)) * u128::from(limit)) >> 64) as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shuffle_reorders_and_turns_without_losing_anything() {
        let boxes: Vec<Bounds> = (0..50)
            .map(|i| {
                let [x, y, z] = [i as f32, 2.0 * i as f32, -(i as f32)];
                Bounds { min: [x, y, z], max: [x + 1.0, y + 2.0, z + 3.0] }
            })
            .collect();
        let mut symmetries = std::collections::BTreeSet::new();
        for seed in 0..200 {
            let shuffle = Shuffle::new(seed, boxes.len());
            symmetries.insert((shuffle.axes, shuffle.mirrored));
            let mut seen = shuffle.order().to_vec();
            seen.sort_unstable();
            assert!(seen.iter().copied().eq(0..50));
            for original in &boxes {
                let turned = shuffle.turned(original);
                assert_eq!(turned.half_area(), original.half_area());
                assert!((0..3).all(|axis| turned.min[axis] < turned.max[axis]));
            }
        }
        // 200 draws from 48 leave one out with a probability of 48 (47/48)^200 = 0.7 each, five with below 0.001.
        assert!(symmetries.len() > 42, "{}", symmetries.len());
    }
}
