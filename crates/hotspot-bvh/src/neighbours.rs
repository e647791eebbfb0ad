//! For each node along the curve the neighbour with which its box would be smallest.
//!
//! Where boxes tie, the neighbour whose index differs in the lowest bits wins. Boxes are taken apart into rows of coordinates, block by
//! block, so that the loops below become vector instructions of whatever width there is; what they find does not depend on it.

use crate::binary::BinaryNode;
use crate::simd::{Isa, Simd, WithSimd, dispatch};
use crate::tasks::{self, PIECE};
use rayon::prelude::*;

/// The longest search distance.
pub(crate) const FARTHEST: usize = 14;

/// Nodes that are looked at together: all that is kept of them stays in the first cache.
const BLOCK: usize = 256;

/// Finds a partner for each of `nodes`, more than one, at most `distance` places away: 1, 2, 3, 6 or [`FARTHEST`], others
/// search as far as the next of these.
pub(crate) fn find_partners(nodes: &[BinaryNode], partners: &mut [u32], distance: usize) {
    let search = |first: usize, partners: &mut [u32]| match distance {
        1 => dispatch(Isa::Auto, Search::<1> { nodes, first, partners }),
        2 => dispatch(Isa::Auto, Search::<2> { nodes, first, partners }),
        3 => dispatch(Isa::Auto, Search::<3> { nodes, first, partners }),
        4..=6 => dispatch(Isa::Auto, Search::<6> { nodes, first, partners }),
        _ => dispatch(Isa::Auto, Search::<FARTHEST> { nodes, first, partners }),
    };
    if tasks::worthwhile(nodes.len()) {
        let chunks = partners.par_chunks_mut(PIECE).with_max_len(2).enumerate();
        chunks.for_each(|(chunk, partners)| search(chunk * PIECE, partners));
    } else {
        search(0, partners);
    }
}

/// For the nodes from `first` on the neighbour within `R` places with which each would be smallest.
struct Search<'a, const R: usize> {
    nodes: &'a [BinaryNode],
    first: usize,
    partners: &'a mut [u32],
}

impl<const R: usize> WithSimd for Search<'_, R> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, _: S) {
        // Minima and maxima. Slot k is node `start` + k - R.
        let mut rows: Rows = [[0.0; BLOCK + 2 * FARTHEST]; 6];
        // Of slot k and the one so many behind it, the area of the box around both. Without signs, so bits are in their order.
        let mut areas = [0u32; BLOCK + FARTHEST];
        let mut start = self.first;
        for partners in self.partners.chunks_mut(BLOCK) {
            let count = partners.len();
            #[expect(clippy::needless_range_loop, reason = "six rows of the same index")]
            for k in 0..count + 2 * R {
                // The box of nobody is larger than any.
                let (mut low, mut high) = ([f32::NEG_INFINITY; 3], [f32::INFINITY; 3]);
                let i = (start + k).wrapping_sub(R);
                if i < self.nodes.len() {
                    (low, high) = self.nodes[i].corners();
                }
                (rows[0][k], rows[1][k], rows[2][k]) = (low[0], low[1], low[2]);
                (rows[3][k], rows[4][k], rows[5][k]) = (high[0], high[1], high[2]);
            }
            let mut least = [u32::MAX; BLOCK];
            let mut found = [0u32; BLOCK];
            for d in 1..=R {
                areas_of_pairs(&rows, d, &mut areas[..count + R]);
                let (before, after) = (&areas[R - d..R - d + count], &areas[R..R + count]);
                let (least, found) = (&mut least[..count], &mut found[..count]);
                for k in 0..count {
                    let i = (start + k) as u32;
                    let (mut area, mut bits) = (least[k], found[k]);
                    let at = i ^ i.wrapping_sub(d as u32);
                    let better = (before[k] < area) | ((before[k] == area) & (at < bits));
                    area = if better { before[k] } else { area };
                    bits = if better { at } else { bits };
                    let at = i ^ i.wrapping_add(d as u32);
                    let better = (after[k] < area) | ((after[k] == area) & (at < bits));
                    area = if better { after[k] } else { area };
                    bits = if better { at } else { bits };
                    (least[k], found[k]) = (area, bits);
                }
            }
            for k in 0..count {
                partners[k] = (start + k) as u32 ^ found[k];
            }
            start += count;
        }
    }
}

/// Minima and maxima of boxes along the three axes.
type Rows = [[f32; BLOCK + 2 * FARTHEST]; 6];

/// Half the area of the box around each and the one `d` places on, as [`BinaryNode::half_area_with`] has it, to the last bit.
#[inline(always)]
fn areas_of_pairs(rows: &Rows, d: usize, areas: &mut [u32]) {
    let count = areas.len();
    let [x0, y0, z0, x1, y1, z1] = rows;
    let [x0, x0_far, y0, y0_far] = [&x0[..count], &x0[d..d + count], &y0[..count], &y0[d..d + count]];
    let [z0, z0_far, x1, x1_far] = [&z0[..count], &z0[d..d + count], &x1[..count], &x1[d..d + count]];
    let [y1, y1_far, z1, z1_far] = [&y1[..count], &y1[d..d + count], &z1[..count], &z1[d..d + count]];
    for k in 0..count {
        let x = larger(x1[k], x1_far[k]) - smaller(x0[k], x0_far[k]);
        let y = larger(y1[k], y1_far[k]) - smaller(y0[k], y0_far[k]);
        let z = larger(z1[k], z1_far[k]) - smaller(z0[k], z0_far[k]);
        // Without a sign: boxes of no size may have one.
        areas[k] = ((x + y) * z + x * y).abs().to_bits();
    }
}

/// As vectors do it: the second of equals.
#[inline(always)]
fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// Likewise.
#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::binary::tests::Boxes;

    /// Ties and all, alone and in chunks that three threads share, by either instruction set.
    #[test]
    fn partners_are_the_nearest() {
        let mut boxes = Boxes::new(1);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
        for (count, size) in
            [(2, 0.5), (3, 0.5), (17, 0.5), (40, 0.0), (3 * BLOCK + 1, 0.0), (5 * PIECE + 5, 0.5)]
        {
            let nodes = boxes.leaves(count, size);
            for distance in [1, 2, 3, 6, FARTHEST] {
                let mut partners = vec![0; count];
                pool.install(|| find_partners(&nodes, &mut partners, distance));
                for (i, &partner) in partners.iter().enumerate() {
                    let others =
                        (i.saturating_sub(distance)..=(i + distance).min(count - 1)).filter(|&j| j != i);
                    let nearest = others.min_by(|&a, &b| {
                        let [x, y] = [a, b].map(|j| nodes[i].half_area_with(&nodes[j]));
                        x.total_cmp(&y).then((i ^ a).cmp(&(i ^ b)))
                    });
                    assert_eq!(Some(partner as usize), nearest, "{count} {distance} {i}");
                }
                let mut portable = vec![0; count];
                if distance == 6 {
                    dispatch(Isa::Portable, Search::<6> { nodes: &nodes, first: 0, partners: &mut portable });
                    assert!(portable == partners, "{count}");
                }
            }
        }
    }
}
