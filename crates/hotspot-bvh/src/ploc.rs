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
use crate::neighbours::find_partners;
use crate::tasks::{self, PIECE};
use rayon::prelude::*;

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
    let mut passes = Passes {
        nodes: &mut nodes,
        parents: &parents,
        other: Vec::new(),
        aside: false,
        next_pair: count,
        roles: vec![Roles::default()],
    };
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
    /// Of each chunk, where several threads share a pass; at least one.
    roles: Vec<Roles>,
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
        let (front, back) = self.nodes.split_at_mut(partners.len());
        let mut left = 0;
        for first in (0..partners.len()).step_by(PIECE) {
            let roles = &mut self.roles[0];
            roles.tell(first, partners);
            let next_pair = self.next_pair;
            self.next_pair -= roles.firsts.len();
            let pairs = &mut back[2 * self.next_pair - partners.len()..2 * next_pair - partners.len()];
            roles.pair_up(front, partners, pairs, next_pair, self.parents);
            // What is overwritten stands before all that is still to be read.
            for (to, &from) in (left..).zip(&roles.stay) {
                front[to] = front[from as usize];
            }
            roles.put_parents(pairs, next_pair, &mut front[left..]);
            left += roles.stay.len();
        }
        left
    }

    /// The same, in chunks: how many pairs and nodes come of each is counted first.
    fn merge_side_by_side(&mut self, partners: &[u32]) -> usize {
        let chunks = partners.len().div_ceil(PIECE);
        if self.roles.len() < chunks {
            self.roles.resize_with(chunks, Roles::default);
        }
        let roles = &mut self.roles[..chunks];
        let each = roles.par_iter_mut().with_max_len(4).enumerate();
        each.for_each(|(chunk, roles)| roles.tell(chunk * PIECE, partners));
        let pairs: usize = roles.iter().map(|roles| roles.firsts.len()).sum();
        let left = roles.iter().map(|roles| roles.stay.len()).sum();
        if self.other.is_empty() {
            // Later passes leave fewer.
            self.other = huge::with_capacity(left);
            tasks::extend(&mut self.other, BinaryNode::EMPTY, left);
        }
        let lowest = self.next_pair - pairs;
        let (front, back) = self.nodes.split_at_mut(2 * lowest);
        let (from, mut to) = if self.aside {
            (&self.other[..partners.len()], &mut front[..left])
        } else {
            (&front[..partners.len()], &mut self.other[..left])
        };
        let mut back = &mut back[..2 * pairs];
        let mut next_pair = self.next_pair;
        let mut chunks = Vec::with_capacity(chunks);
        for roles in &*roles {
            let (own, after) = to.split_at_mut(roles.stay.len());
            let (before, own_pairs) = back.split_at_mut(back.len() - 2 * roles.firsts.len());
            (to, back) = (after, before);
            chunks.push((roles, own, own_pairs, next_pair));
            next_pair -= roles.firsts.len();
        }
        let parents = self.parents;
        chunks.into_par_iter().with_max_len(2).for_each(|(roles, to, pairs, next_pair)| {
            roles.pair_up(from, partners, pairs, next_pair, parents);
            for (to, &i) in to.iter_mut().zip(&roles.stay) {
                *to = from[i as usize];
            }
            roles.put_parents(pairs, next_pair, to);
        });
        self.aside = !self.aside;
        self.next_pair = lowest;
        left
    }
}

/// What becomes of the nodes of a chunk. Lists instead of a branch for each node, which would follow no pattern.
#[derive(Default)]
struct Roles {
    /// Those that are not paired with an earlier one.
    stay: Vec<u32>,
    /// Where in `stay` those are that are paired with a later one: the parent of both takes that place.
    firsts: Vec<u32>,
}

impl Roles {
    /// Whether node `i` is the first of a pair, or the second.
    #[inline(always)]
    fn of(i: usize, partners: &[u32]) -> (bool, bool) {
        let partner = partners[i] as usize;
        let mutual = partners[partner] as usize == i;
        (mutual & (partner > i), mutual & (partner < i))
    }

    /// Makes the lists for the chunk that begins at `first`.
    fn tell(&mut self, first: usize, partners: &[u32]) {
        let end = partners.len().min(first + PIECE);
        self.stay.resize(end - first, 0);
        self.firsts.resize(end - first, 0);
        let (mut stay, mut firsts) = (0, 0);
        for i in first..end {
            let (is_first, is_second) = Self::of(i, partners);
            self.stay[stay] = i as u32;
            self.firsts[firsts] = stay as u32;
            stay += usize::from(!is_second);
            firsts += usize::from(is_first);
        }
        self.stay.truncate(stay);
        self.firsts.truncate(firsts);
    }

    /// Puts pairs below `next_pair`, which stand at the end of `pairs`.
    fn pair_up(
        &self,
        from: &[BinaryNode],
        partners: &[u32],
        pairs: &mut [BinaryNode],
        next_pair: usize,
        parents: &Parents,
    ) {
        let mut place = 2 * next_pair as u32;
        for (pair, &first) in pairs.rchunks_exact_mut(2).zip(&self.firsts) {
            place -= 2;
            let i = self.stay[first as usize] as usize;
            (pair[0], pair[1]) = (from[i], from[partners[i] as usize]);
            parents.link_children(&pair[0], place);
            parents.link_children(&pair[1], place + 1);
        }
    }

    /// Puts the parents of those pairs in the places of their first nodes.
    fn put_parents(&self, pairs: &[BinaryNode], next_pair: usize, to: &mut [BinaryNode]) {
        for ((pair, &first), number) in pairs.rchunks_exact(2).zip(&self.firsts).zip(1..) {
            to[first as usize] = BinaryNode::parent_of(&pair[0], &pair[1], (next_pair - number) as u32);
        }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::binary::tests::{Boxes, assert_whole, depth, total_area};
    use crate::neighbours::FARTHEST;
    use crate::node::Bounds;

    pub(crate) fn over(leaves: &[BinaryNode], distance: usize) -> BinaryTree {
        build(leaves.len(), |i| leaves[i as usize], distance)
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
