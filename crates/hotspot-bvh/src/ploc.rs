//! A binary tree over boxes from the bottom up: Meister and Bittner, *Parallel Locally-Ordered Clustering for Bounding
//! Volume Hierarchy Construction* (TVCG 2018). Along a Morton curve every node looks for the neighbour, at most so many
//! places away, with which its box would be smallest; those that chose each other merge; again, until one is left.
//!
//! Where boxes tie, the neighbour whose index differs in the lowest bits wins: a rule that both sides read alike, so that
//! of many equal boxes all find a partner at once. A pass that still merges next to nothing is followed by one that pairs
//! everyone: the number of passes grows with the logarithm of the number of nodes whatever the boxes.
//!
//! Each element of a parallel loop depends on its index alone, so the tree is the same for any number of threads.

use crate::binary::{BinaryNode, BinaryTree, Parents};
use crate::curve;
use crate::huge;
use crate::tasks::{self, TASK};
use rayon::prelude::*;

/// The longest search distance.
pub(crate) const FARTHEST: usize = 14;

/// The tree over `count` leaves, which `leaf` makes, more than once; nodes search `distance` places each way.
pub(crate) fn build(
    count: usize,
    leaf: impl Fn(u32) -> BinaryNode + Sync + Send,
    distance: usize,
) -> BinaryTree {
    let order = curve::order(count, &leaf);
    // What is not yet paired stands at the front and pairs are put at the end. A pass that leaves n of up to 2n nodes leaves
    // the pairs from place 2n on, so they never meet.
    let mut nodes = huge::with_capacity(2 * count);
    tasks::map_into(&mut nodes, &order, |index| leaf(*index));
    drop(order);
    tasks::extend(&mut nodes, BinaryNode::EMPTY, count);
    let parents = Parents::new(count);
    let mut partners = vec![0u32; count];
    let mut passes =
        Passes { nodes: &mut nodes, parents: &parents, other: Vec::new(), aside: false, next_pair: count };
    let mut count = count;
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
            find_partners(passes.unpaired(count), partners, reach);
            reach = distance;
        }
        let before = count;
        count = passes.merge(partners);
        stuck = (before - count) * 32 < before;
    }
    if let [root, empty, ..] = &mut nodes[..] {
        *empty = BinaryNode::EMPTY;
        parents.link_children(root, 0);
    }
    BinaryTree { nodes, parents }
}

/// The state between passes.
struct Passes<'a> {
    nodes: &'a mut [BinaryNode],
    parents: &'a Parents,
    /// What is not yet paired stands here after every other pass that several threads share: none of them could tell when
    /// what another reads has been read.
    other: Vec<BinaryNode>,
    aside: bool,
    /// The lowest pair so far.
    next_pair: usize,
}

impl Passes<'_> {
    fn unpaired(&self, count: usize) -> &[BinaryNode] {
        if self.aside { &self.other[..count] } else { &self.nodes[..count] }
    }

    /// Pairs all that chose each other and returns how many nodes are left.
    fn merge(&mut self, partners: &[u32]) -> usize {
        if tasks::worthwhile(partners.len()) {
            return self.merge_side_by_side(partners);
        }
        if self.aside {
            self.nodes[..partners.len()].copy_from_slice(&self.other[..partners.len()]);
            self.aside = false;
        }
        let mut count = 0;
        for i in 0..partners.len() {
            let mut node = self.nodes[i];
            match Role::of(i, partners) {
                Role::Right => continue,
                Role::Left(partner) => {
                    self.next_pair -= 1;
                    let place = 2 * self.next_pair;
                    let right = self.nodes[partner];
                    (self.nodes[place], self.nodes[place + 1]) = (node, right);
                    node = joined(&node, &right, self.next_pair, self.parents);
                }
                Role::Single => {}
            }
            self.nodes[count] = node;
            count += 1;
        }
        count
    }

    /// The same, in chunks: how many pairs and nodes come of each is counted first.
    fn merge_side_by_side(&mut self, partners: &[u32]) -> usize {
        let counts: Vec<(usize, usize)> = (0..partners.len().div_ceil(TASK))
            .into_par_iter()
            .map(|chunk| {
                let range = chunk * TASK..partners.len().min((chunk + 1) * TASK);
                range.fold((0, 0), |(pairs, left), i| match Role::of(i, partners) {
                    Role::Left(_) => (pairs + 1, left + 1),
                    Role::Single => (pairs, left + 1),
                    Role::Right => (pairs, left),
                })
            })
            .collect();
        let (pairs, count) = counts.iter().fold((0, 0), |sum, n| (sum.0 + n.0, sum.1 + n.1));
        if self.other.is_empty() {
            // Later passes leave fewer.
            self.other = huge::with_capacity(count);
            tasks::extend(&mut self.other, BinaryNode::EMPTY, count);
        }
        let lowest = self.next_pair - pairs;
        let (front, back) = self.nodes.split_at_mut(2 * lowest);
        let (from, to) = if self.aside {
            (&self.other[..partners.len()], &mut front[..count])
        } else {
            (&front[..partners.len()], &mut self.other[..count])
        };
        let (mut rest, mut back) = (to, &mut back[..2 * pairs]);
        let mut next_pair = self.next_pair;
        let mut chunks = Vec::with_capacity(counts.len());
        for (chunk, (pairs, count)) in counts.into_iter().enumerate() {
            let (to, after) = rest.split_at_mut(count);
            let (before, own) = back.split_at_mut(back.len() - 2 * pairs);
            (rest, back) = (after, before);
            chunks.push((chunk * TASK, to, own, next_pair));
            next_pair -= pairs;
        }
        let parents = self.parents;
        chunks.into_par_iter().for_each(|(first, to, pairs, mut next_pair)| {
            let mut i = first;
            let mut pairs = pairs.rchunks_exact_mut(2);
            for to in to {
                *to = loop {
                    let node = from[i];
                    let role = Role::of(i, partners);
                    i += 1;
                    match role {
                        Role::Right => {}
                        Role::Single => break node,
                        Role::Left(partner) => {
                            next_pair -= 1;
                            let right = from[partner];
                            if let Some(pair) = pairs.next() {
                                (pair[0], pair[1]) = (node, right);
                            }
                            break joined(&node, &right, next_pair, parents);
                        }
                    }
                };
            }
        });
        self.aside = !self.aside;
        self.next_pair = lowest;
        count
    }
}

/// What becomes of a node in a pass.
enum Role {
    /// It is paired with a later one, and the parent of both takes its place.
    Left(usize),
    /// It is paired with an earlier one.
    Right,
    /// It waits for the next pass.
    Single,
}

impl Role {
    #[inline(always)]
    fn of(i: usize, partners: &[u32]) -> Self {
        let partner = partners[i] as usize;
        if partners[partner] as usize != i || partner == i {
            Self::Single
        } else if partner < i {
            Self::Right
        } else {
            Self::Left(partner)
        }
    }
}

/// The parent of two nodes that stand at `pair`.
#[inline(always)]
fn joined(left: &BinaryNode, right: &BinaryNode, pair: usize, parents: &Parents) -> BinaryNode {
    let place = 2 * pair as u32;
    parents.link_children(left, place);
    parents.link_children(right, place + 1);
    BinaryNode::parent_of(left, right, pair as u32)
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

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::binary::tests::{Boxes, assert_whole, depth, total_area};
    use crate::node::Bounds;

    pub(crate) fn over(leaves: &[BinaryNode], distance: usize) -> BinaryTree {
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
                    let tree = over(&leaves, distance);
                    assert_eq!(assert_whole(&tree), count, "{name}");
                    let levels = depth(&tree.nodes);
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
            let mut tree = over(&leaves, 6);
            crate::reinsertion::optimize(&mut tree, 0.05);
            let ours = total_area(&tree.nodes);
            assert!(ours < 1.01 * theirs, "{count} {size}: {ours} beside {theirs}");
        }
    }
}
