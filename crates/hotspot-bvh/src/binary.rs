//! The binary tree that [`crate::ploc`] builds, [`crate::reinsertion`] betters and [`crate::collapse`] makes wide.
//!
//! A tree over n primitives has 2n places. Place 0 is the root, place 1 stays empty; siblings share a pair of places
//! (2p, 2p + 1) and with it a cache line. A node is its box and, in the lanes that two vectors of three leave over, a link
//! (an inner node's pair of children, a leaf's primitive) and the number of leaves below. Where the parent of a pair stands is
//! kept apart: several threads tell pairs far apart about their parents, and nothing else.

use crate::node::Bounds;
use core::sync::atomic::{AtomicU32, Ordering::Relaxed};
use glam::Vec4;

/// The whole tree.
pub(crate) struct BinaryTree {
    pub(crate) nodes: Vec<BinaryNode>,
    pub(crate) parents: Parents,
}

/// Where the parent of each pair stands.
pub(crate) struct Parents(Vec<AtomicU32>);

impl Parents {
    /// None known.
    pub(crate) fn new(pairs: usize) -> Self {
        Self((0..pairs).map(|_| AtomicU32::new(0)).collect())
    }

    /// Tells the children of a node that it stands at `place`.
    #[inline(always)]
    pub(crate) fn link_children(&self, node: &BinaryNode, place: u32) {
        if let Some(pair) = node.pair() {
            self.0[pair as usize].store(place, Relaxed);
        }
    }
}

/// The box of a node with its links in the fourth lanes.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub(crate) struct BinaryNode {
    /// Minima; the pair of children, or flagged the primitive.
    low: Vec4,
    /// Maxima; how many leaves are below, roughly once subtrees have been moved.
    high: Vec4,
}

const FLAG: u32 = 1 << 31;
/// Makes a link the bits of a normal number (below 0x3f80_0000; of larger trees some are NaN), which arithmetic on all four lanes
/// takes in its stride.
const NORMAL: u32 = 1 << 30;

/// `index` below 2^30.
fn link(index: u32, flag: bool) -> f32 {
    f32::from_bits(index | NORMAL | if flag { FLAG } else { 0 })
}

impl BinaryNode {
    pub(crate) const EMPTY: Self = Self { low: Vec4::ZERO, high: Vec4::ZERO };

    pub(crate) fn leaf(bounds: &Bounds, primitive: u32) -> Self {
        let ([a, b, c], [d, e, f]) = (bounds.min, bounds.max);
        Self { low: Vec4::new(a, b, c, link(primitive, true)), high: Vec4::new(d, e, f, link(1, false)) }
    }

    /// The leaf of a triangle.
    #[inline(always)]
    pub(crate) fn of_triangle(triangle: &[[f32; 3]; 3], primitive: u32) -> Self {
        let [a, b, c] = triangle.map(|[x, y, z]| Vec4::new(x, y, z, 0.0));
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        Self { low: low.with_w(link(primitive, true)), high: high.with_w(link(1, false)) }
    }

    /// The parent of two nodes that stand at `pair`.
    #[inline(always)]
    pub(crate) fn parent_of(left: &Self, right: &Self, pair: u32) -> Self {
        let (low, high) = left.union(right);
        // Saturated so that it stays a number: after moves the sum may count leaves twice.
        let leaves = (left.leaves() + right.leaves()).min(NORMAL - 1);
        Self { low: low.with_w(link(pair, false)), high: high.with_w(link(leaves, false)) }
    }

    /// The pair of children; `None`: a leaf.
    #[inline(always)]
    pub(crate) fn pair(&self) -> Option<u32> {
        let bits = self.low.w.to_bits();
        (bits & FLAG == 0).then_some(bits & !NORMAL)
    }

    /// The primitive of a leaf.
    #[inline(always)]
    pub(crate) fn primitive(&self) -> u32 {
        self.low.w.to_bits() & !(FLAG | NORMAL)
    }

    /// Leaves below, itself included; once subtrees have been moved only roughly so, or even 0: good for sharing out work
    /// and for the order of slots.
    #[inline(always)]
    pub(crate) fn leaves(&self) -> u32 {
        self.high.w.to_bits() & !(FLAG | NORMAL)
    }

    pub(crate) fn bounds(&self) -> Bounds {
        Bounds { min: self.low.truncate().into(), max: self.high.truncate().into() }
    }

    /// Minima and maxima.
    #[inline(always)]
    pub(crate) fn corners(&self) -> ([f32; 3], [f32; 3]) {
        // Spelled out: a conversion would be a call of its own, outside of the instruction set chosen.
        let (low, high) = (self.low, self.high);
        ([low.x, low.y, low.z], [high.x, high.y, high.z])
    }

    /// Twice the centre.
    pub(crate) fn middle(&self) -> Vec4 {
        self.low + self.high
    }

    /// The box around both; the fourth lanes mean nothing.
    #[inline(always)]
    fn union(&self, other: &Self) -> (Vec4, Vec4) {
        (self.low.min(other.low), self.high.max(other.high))
    }

    /// Half the surface area of the box, in f32: it decides between topologies, nothing else.
    #[inline(always)]
    pub(crate) fn half_area(&self) -> f32 {
        half_area(self.low, self.high)
    }

    /// That of the box around both.
    #[inline(always)]
    pub(crate) fn half_area_with(&self, other: &Self) -> f32 {
        let (low, high) = self.union(other);
        half_area(low, high)
    }

    /// Grows to hold the other's box too.
    #[inline(always)]
    pub(crate) fn extend(&mut self, other: &Self) {
        let (low, high) = self.union(other);
        (self.low, self.high) = (low.with_w(self.low.w), high.with_w(self.high.w));
    }
}

/// Leaves of subtrees that are worth [`warm`]ing: all of one stays in the second cache.
pub(crate) const WARM: u32 = 2048;

/// Reads the nodes of a subtree, the first few thousand, level by level: who then goes down into it one node after the other, each
/// telling where the next is, need not wait for memory at each step. Here nothing waits for anything: reads are independent of each other, and
/// no branch depends on them.
pub(crate) fn warm(nodes: &[BinaryNode], root: u32) {
    let most = 2 * nodes[root as usize].leaves().min(WARM) as usize;
    let mut places = vec![0u32; most + 2];
    places[0] = root;
    let (mut next, mut count) = (0, 1);
    while next < count && count <= most {
        let bits = nodes[places[next] as usize].low.w.to_bits();
        let first = (bits & !(FLAG | NORMAL)) << 1;
        (places[count], places[count + 1]) = (first, first + 1);
        count += if bits & FLAG == 0 { 2 } else { 0 };
        next += 1;
    }
    core::hint::black_box(count);
}

#[inline(always)]
fn half_area(low: Vec4, high: Vec4) -> f32 {
    let d = high - low;
    (d.x + d.y) * d.z + d.x * d.y
}

impl BinaryTree {
    /// Where the parent of `place` stands.
    #[inline(always)]
    pub(crate) fn parent(&self, place: u32) -> u32 {
        self.parents.0[(place >> 1) as usize].load(Relaxed)
    }

    /// Puts a node at `place`, and tells its children.
    #[inline(always)]
    pub(crate) fn put(&mut self, place: u32, node: &BinaryNode) {
        self.nodes[place as usize] = *node;
        self.parents.link_children(node, place);
    }

    /// Makes the boxes from `place` upwards those of their children again, as far as they change.
    pub(crate) fn refit(&mut self, mut place: u32) {
        while let Some(pair) = self.nodes[place as usize].pair() {
            let (low, high) = self.nodes[2 * pair as usize].union(&self.nodes[2 * pair as usize + 1]);
            let node = &mut self.nodes[place as usize];
            let fresh = BinaryNode { low: low.with_w(node.low.w), high: high.with_w(node.high.w) };
            let same = node.low.truncate() == low.truncate() && node.high.truncate() == high.truncate();
            *node = fresh;
            if same || place == 0 {
                return;
            }
            place = self.parent(place);
        }
    }

    /// Gives leaves other boxes, by their primitives, and all else the boxes that enclose those. Numbers of leaves stay, rough as they
    /// are, so that scaling a scene does not change its tree.
    pub(crate) fn set_bounds(&mut self, bounds: impl Fn(u32) -> Bounds) {
        let mut inner = Vec::new();
        let mut open = if self.nodes.is_empty() { Vec::new() } else { vec![0u32] };
        while let Some(place) = open.pop() {
            let node = &mut self.nodes[place as usize];
            if let Some(pair) = node.pair() {
                inner.push((place, pair));
                open.extend([2 * pair, 2 * pair + 1]);
            } else {
                *node = BinaryNode::leaf(&bounds(node.primitive()), node.primitive());
            }
        }
        // Children come after their parents there.
        for (place, pair) in inner.into_iter().rev() {
            let [left, right] = [2 * pair, 2 * pair + 1].map(|child| &self.nodes[child as usize]);
            let (low, high) = left.union(right);
            let node = &mut self.nodes[place as usize];
            *node = BinaryNode { low: low.with_w(node.low.w), high: high.with_w(node.high.w) };
        }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::random::Random;

    /// Random boxes.
    pub(crate) struct Boxes(pub(crate) Random);

    impl Boxes {
        pub(crate) fn new(seed: u64) -> Self {
            Self(Random(seed))
        }

        /// Leaves in the unit cube, of up to `size` an axis; 0: corners on a grid of 8³, so that many tie.
        pub(crate) fn leaves(&mut self, count: usize, size: f32) -> Vec<BinaryNode> {
            (0..count as u32)
                .map(|i| {
                    let min = [(); 3]
                        .map(|()| self.0.unit())
                        .map(|c| if size > 0.0 { c } else { (c * 8.0).floor() });
                    let extent = [(); 3].map(|()| size * self.0.unit());
                    let max = core::array::from_fn(|axis| min[axis] + extent[axis]);
                    BinaryNode::leaf(&Bounds { min, max }, i)
                })
                .collect()
        }
    }

    /// The sum of half areas of inner nodes.
    pub(crate) fn total_area(nodes: &[BinaryNode]) -> f64 {
        let occupied = nodes.iter().enumerate().filter(|(place, node)| *place != 1 && node.pair().is_some());
        occupied.map(|(_, node)| node.bounds().half_area()).sum()
    }

    pub(crate) fn depth(nodes: &[BinaryNode]) -> u32 {
        let mut deepest = 0;
        let mut open = vec![(0, 1)];
        while let Some((place, depth)) = open.pop() {
            deepest = deepest.max(depth);
            if let Some(pair) = nodes[place].pair() {
                open.extend([0, 1].map(|i| (2 * pair as usize + i, depth + 1)));
            }
        }
        deepest
    }

    /// Every place is reached once and knows its parent, every inner box is that of its children, every primitive is there;
    /// how many they are.
    pub(crate) fn assert_whole(tree: &BinaryTree) -> u32 {
        let nodes = &tree.nodes[..];
        let mut primitives = Vec::new();
        let mut reached = vec![false; nodes.len()];
        let mut open: Vec<usize> = if nodes.is_empty() { Vec::new() } else { vec![0] };
        while let Some(place) = open.pop() {
            assert!(!core::mem::replace(&mut reached[place], true));
            let Some(pair) = nodes[place].pair() else {
                primitives.push(nodes[place].primitive());
                continue;
            };
            let children = [2 * pair as usize, 2 * pair as usize + 1];
            let [left, right] = children.map(|child| nodes[child].bounds());
            assert_eq!(nodes[place].bounds(), left.union(&right));
            assert!(children.iter().all(|&child| tree.parent(child as u32) as usize == place));
            open.extend(children);
        }
        assert!(reached.iter().enumerate().all(|(place, reached)| *reached != (place == 1)));
        primitives.sort_unstable();
        assert!(primitives.iter().copied().eq(0..nodes.len() as u32 / 2));
        primitives.len() as u32
    }
}
