//! A binary tree over boxes from the bottom up: Meister and Bittner, *Parallel Locally-Ordered Clustering for Bounding
//! Volume Hierarchy Construction* (TVCG 2018). Along a Morton curve every node looks for the neighbour, at most so many
//! places away, with which its box would be smallest; those that chose each other merge; again, until one is left.
//!
//! Where boxes tie, the neighbour whose index differs in the lowest bits wins: a rule that both sides read alike, so that
//! of many equal boxes all find a partner at once. A pass that still merges next to nothing is followed by one that pairs
//! everyone: the number of passes grows with the logarithm of the number of nodes whatever the boxes.
//!
//! Each element of a parallel loop depends on its index alone, so the tree is the same for any number of threads.

use crate::binary::{BinaryNode, link_children};
use crate::huge;
use crate::tasks::{self, TASK};
use core::ops::Range;
use glam::{DVec3, Vec4};
use rayon::prelude::*;

/// The longest search distance.
pub(crate) const FARTHEST: usize = 14;

/// The tree over `count` leaves, which `leaf` makes, more than once; nodes search `distance` places each way.
pub(crate) fn build(
    count: usize,
    leaf: impl Fn(u32) -> BinaryNode + Sync + Send,
    distance: usize,
) -> Vec<BinaryNode> {
    let keys = along_the_curve(count, &leaf);
    // What is not yet paired stands at the front and pairs are put at the end. A pass that leaves n of up to 2n nodes leaves
    // the pairs from place 2n on, so they never meet.
    let mut nodes = huge::with_capacity(2 * count);
    tasks::map_into(&mut nodes, &keys, |key| leaf(key.index));
    drop(keys);
    nodes.resize(2 * count, BinaryNode::EMPTY);
    let mut count = count;
    let mut partners = vec![0u32; count];
    let mut next_pair = count;
    let mut stuck = false;
    // The first pass looks at immediate neighbours alone. In regular meshes many farther ones do as well, and pairs chosen among
    // them lie across each other: rays visited 30 % more in a height field of a million triangles, elsewhere as much as otherwise.
    let mut reach = 1;
    while count > 1 {
        let partners = &mut partners[..count];
        if stuck {
            let last = count as u32 - 1;
            for (i, partner) in partners.iter_mut().enumerate() {
                *partner = (i as u32 ^ 1).min(last);
            }
        } else {
            find_partners(&nodes[..count], partners, reach);
            reach = distance;
        }
        let before = count;
        count = 0;
        for i in 0..before {
            let partner = partners[i] as usize;
            let mut node = nodes[i];
            if partners[partner] as usize == i && partner != i {
                if partner < i {
                    continue;
                }
                next_pair -= 1;
                let place = 2 * next_pair;
                nodes[place] = node;
                nodes[place + 1] = nodes[partner];
                node = BinaryNode::parent_of(&nodes[place], &nodes[place + 1], next_pair as u32);
                link_children(&mut nodes, place as u32);
                link_children(&mut nodes, place as u32 + 1);
            }
            nodes[count] = node;
            count += 1;
        }
        stuck = (before - count) * 32 < before;
    }
    if let [_, empty, ..] = &mut nodes[..] {
        *empty = BinaryNode::EMPTY;
        link_children(&mut nodes, 0);
    }
    nodes
}

fn find_partners(nodes: &[BinaryNode], partners: &mut [u32], distance: usize) {
    let search = match distance {
        1 => partners_of_chunk::<1>,
        2 => partners_of_chunk::<2>,
        3 => partners_of_chunk::<3>,
        4..=6 => partners_of_chunk::<6>,
        _ => partners_of_chunk::<FARTHEST>,
    };
    if !tasks::worthwhile(nodes.len()) {
        return search(nodes, 0, partners);
    }
    let chunks = partners.par_chunks_mut(TASK).enumerate();
    chunks.for_each(|(chunk, partners)| search(nodes, chunk * TASK, partners));
}

/// For the nodes from `first` on the neighbour within `R` places with which each would be smallest.
fn partners_of_chunk<const R: usize>(nodes: &[BinaryNode], first: usize, partners: &mut [u32]) {
    // Of node i and those after it: the least so far of (area, i ^ neighbour) as one number.
    let mut best = [u64::MAX; FARTHEST + 1];
    for i in first.saturating_sub(R)..first + partners.len() {
        let node = &nodes[i];
        let mut own = best[0];
        let mut look = |d: usize, other: &BinaryNode| {
            // Areas are not negative, so their bits are in their order.
            let area = node.half_area_with(other).to_bits();
            let key = u64::from(area) << 32 | (i ^ (i + d)) as u64;
            own = own.min(key);
            best[d] = best[d].min(key);
        };
        if let Some(after) = nodes[i + 1..].first_chunk::<R>() {
            for d in 1..=R {
                look(d, &after[d - 1]);
            }
        } else {
            for (other, d) in nodes[i + 1..].iter().zip(1..) {
                look(d, other);
            }
        }
        if i >= first {
            partners[i - first] = i as u32 ^ own as u32;
        }
        for d in 0..R {
            best[d] = best[d + 1];
        }
        best[R] = u64::MAX;
    }
}

/// A place along the curve.
#[derive(Clone, Copy, Default)]
struct Key {
    code: u64,
    index: u32,
}

/// The leaves in the order of a Morton curve through their centres, 21 bits an axis; equals in the order of their coming.
fn along_the_curve(count: usize, leaf: &(impl Fn(u32) -> BinaryNode + Sync + Send)) -> Vec<Key> {
    let none = || (Vec4::INFINITY, Vec4::NEG_INFINITY);
    let middles = |range: Range<u32>| {
        range.fold(none(), |(low, high), i| {
            let middle = leaf(i).middle();
            (low.min(middle), high.max(middle))
        })
    };
    let (low, high) = tasks::fold(count as u32, none, middles, |a, b| (a.0.min(b.0), a.1.max(b.1)));
    let low = low.truncate().as_dvec3();
    const STEPS: f64 = (1u32 << 21) as f64;
    let size = high.truncate().as_dvec3() - low;
    let scale = DVec3::select(size.cmpgt(DVec3::ZERO), STEPS / size, DVec3::ZERO);
    let mut keys = tasks::collect(count as u32, |index| {
        let at = (leaf(index).middle().truncate().as_dvec3() - low) * scale;
        // The conversion saturates.
        let [x, y, z] = [at.x, at.y, at.z].map(|c| spread((c as u32).min((1 << 21) - 1)));
        Key { code: x << 2 | y << 1 | z, index }
    });
    sort(&mut keys);
    keys
}

/// Two zeros between bits, of 21.
fn spread(x: u32) -> u64 {
    let mut x = u64::from(x);
    x = (x | x << 32) & 0x001f_0000_0000_ffff;
    x = (x | x << 16) & 0x001f_0000_ff00_00ff;
    x = (x | x << 8) & 0x100f_00f0_0f00_f00f;
    x = (x | x << 4) & 0x10c3_0c30_c30c_30c3;
    (x | x << 2) & 0x1249_2492_4924_9249
}

/// By code, then by index: into buckets by the highest bits, which are then sorted side by side.
fn sort(keys: &mut Vec<Key>) {
    // Some hundreds in a bucket, where they are spread evenly.
    let bits = (keys.len() / 256).max(1).ilog2().min(12);
    let bucket = |key: &Key| (key.code >> (63 - bits)) as usize;
    if bits == 0 {
        return keys.sort_unstable_by_key(|key| (key.code, key.index));
    }
    let mut ends = vec![0u32; 1 << bits];
    for key in keys.iter() {
        ends[bucket(key)] += 1;
    }
    let mut next = ends.clone();
    let mut start = 0;
    for next in &mut next {
        start += core::mem::replace(next, start);
    }
    let mut sorted = huge::filled(Key::default(), keys.len());
    for key in keys.iter() {
        let next = &mut next[bucket(key)];
        sorted[*next as usize] = *key;
        *next += 1;
    }
    let mut rest = &mut sorted[..];
    let mut buckets = Vec::with_capacity(ends.len());
    for count in ends {
        let (bucket, after) = rest.split_at_mut(count as usize);
        buckets.push(bucket);
        rest = after;
    }
    let sort = |bucket: &mut &mut [Key]| bucket.sort_unstable_by_key(|key| (key.code, key.index));
    if tasks::worthwhile(keys.len()) {
        buckets.par_iter_mut().with_min_len(16).for_each(sort);
    } else {
        buckets.iter_mut().for_each(sort);
    }
    *keys = sorted;
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::binary::tests::{Boxes, assert_whole, depth, total_area};
    use crate::node::Bounds;

    pub(crate) fn over(leaves: &[BinaryNode], distance: usize) -> Vec<BinaryNode> {
        build(leaves.len(), |i| leaves[i as usize], distance)
    }

    /// Ties and all, alone and in chunks that three threads share.
    #[test]
    fn partners_are_the_nearest() {
        let mut boxes = Boxes::new(1);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
        for (count, size) in [(2, 0.5), (3, 0.5), (17, 0.5), (40, 0.0), (3 * TASK + 5, 0.5)] {
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
            }
        }
    }

    #[test]
    fn the_order_is_that_of_a_stable_sort() {
        let mut boxes = Boxes::new(2);
        for (count, mask) in [(0, !0), (100, !0), (9000, !0), (9000, 0xff), (9000, 0xffff << 40), (9000, 0)] {
            let mut keys: Vec<Key> =
                (0..count).map(|index| Key { code: boxes.0.bits() & mask & (!0 >> 1), index }).collect();
            let mut expected: Vec<(u64, u32)> = keys.iter().map(|key| (key.code, key.index)).collect();
            expected.sort_unstable();
            sort(&mut keys);
            let sorted: Vec<(u64, u32)> = keys.iter().map(|key| (key.code, key.index)).collect();
            assert!(sorted == expected, "{count} {mask:x}");
        }
    }

    /// Boxes that tie, that grow so that nobody is chosen back, that have no size: whole trees, of no more levels than passes
    /// that halve at least one in 32 allow.
    #[test]
    fn hostile_boxes_make_whole_and_shallow_trees() {
        let at = |min: f32, max: f32| Bounds { min: [min; 3], max: [max; 3] };
        let cases: [(&str, &dyn Fn(u32) -> Bounds); 5] = [
            ("equal", &|_| at(0.0, 1.0)),
            ("points", &|_| at(3.0, 3.0)),
            ("growing", &|i| at(0.0, (i as f32 * 0.01).exp2().min(1e15))),
            ("on a line", &|i| at(i as f32, i as f32 + 0.5)),
            ("nested", &|i| at(-(i as f32), i as f32)),
        ];
        for (name, bounds) in cases {
            for count in [1u32, 2, 3, 7, 5000] {
                for distance in [1, 2, FARTHEST] {
                    let leaves: Vec<_> = (0..count).map(|i| BinaryNode::leaf(&bounds(i), i)).collect();
                    let nodes = over(&leaves, distance);
                    assert_eq!(assert_whole(&nodes), count, "{name}");
                    let levels = depth(&nodes);
                    assert!(levels <= 120, "{name} {count} {distance}: {levels} levels");
                    assert!(name != "equal" || levels <= 14, "{count} {distance}: {levels} levels");
                }
            }
        }
    }

    /// The whole area of inner nodes beside what obvhs makes of the same boxes with the same search distance, immediate neighbours in
    /// the first pass, and share.
    #[test]
    fn trees_are_as_good_as_those_of_obvhs() {
        use obvhs::ploc::{PlocBuilder, SortPrecision};
        let mut boxes = Boxes::new(5);
        for (count, size) in [(20_000, 0.01), (20_000, 0.3), (5000, 0.0)] {
            let leaves = boxes.leaves(count, size);
            let theirs: Vec<obvhs::aabb::Aabb> = leaves
                .iter()
                .map(|leaf| leaf.bounds())
                .map(|b| obvhs::aabb::Aabb::new(b.min.into(), b.max.into()))
                .collect();
            let indices = (0..count as u32).collect();
            let mut bvh2 = PlocBuilder::new().build(6.into(), &theirs, indices, SortPrecision::U64, 1);
            obvhs::bvh2::reinsertion::ReinsertionOptimizer::default().run(&mut bvh2, 0.05, None);
            let inner = bvh2.nodes.iter().filter(|node| node.prim_count == 0);
            let theirs: f64 = inner.map(|node| f64::from(node.aabb().half_area())).sum();
            let mut nodes = over(&leaves, 6);
            crate::reinsertion::optimize(&mut nodes, 0.05);
            let ours = total_area(&nodes);
            assert!(ours < 1.01 * theirs, "{count} {size}: {ours} beside {theirs}");
        }
    }
}
