//! Which binary nodes become nodes and leaf blocks of the 8-wide tree, at the least expected cost.
//!
//! The dynamic program of Ylitie, Karras and Laine, *Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide
//! BVHs* (HPG 2017), section 3.1: for each binary node n and each i, the cheapest way to represent the subtree of n as a
//! forest of at most i wide subtrees; a wide subtree is a leaf block (up to 8 triangles) or a node whose children are a
//! forest of at most 8. Costs are surface areas times [`NODE_COST`] or [`BLOCK_COST`]: a block costs the same however
//! full it is, since its lanes are tested at once. An instance is a leaf of its own.

use crate::binary::BinaryNode;
use crate::node::Bounds;
use crate::triangle::LANES;
use crate::{huge, tasks};
use core::hint::select_unpredictable;
use rayon::prelude::*;

/// Relative cost of visiting a node.
pub(crate) const NODE_COST: f64 = 1.0;
/// Relative cost of testing a leaf block.
pub(crate) const BLOCK_COST: f64 = 0.9;
/// Relative cost of entering an instance: taking the ray there, and a visit of its root.
pub(crate) const INSTANCE_COST: f64 = 3.0;
/// Children per wide node.
pub(crate) const WIDTH: usize = 8;

/// What the dynamic program decides about a binary node. For forests of 2..=8, four bits each: how many go to the left
/// child; 0: use one fewer subtrees. Then three bits: a forest of at most so many is best as one. Then one: that one is a leaf, a block
/// or an instance.
#[derive(Clone, Copy)]
pub(crate) struct Plan(u32);

impl Plan {
    const LEAF: u32 = 1 << 31;
    const LEFTS: u32 = (1 << 28) - 1;

    pub(crate) fn left(self, count: usize) -> usize {
        (self.0 >> (4 * (count - 2)) & 15) as usize
    }

    pub(crate) fn single(self, count: usize) -> bool {
        count <= (self.0 >> 28 & 7) as usize
    }

    pub(crate) fn is_leaf(self) -> bool {
        self.0 & Self::LEAF != 0
    }
}

/// A binary node with what was decided about it. In the order of their turns, children before parents and left subtrees before
/// right ones: the right child is the one before its parent, the left one before all of the right subtree.
#[derive(Clone, Copy)]
#[repr(C, align(32))]
pub(crate) struct Planned {
    pub(crate) bounds: Bounds,
    pub(crate) plan: Plan,
    /// Of a leaf of the binary tree the primitive, otherwise how many nodes the subtree has, this one included.
    link: u32,
}

impl Planned {
    /// The primitive of a leaf of the binary tree.
    pub(crate) fn primitive(&self) -> Option<u32> {
        // Two subtrees are always one and one.
        (self.plan.0 & Plan::LEFTS == 0).then_some(self.link)
    }

    fn length(&self) -> u32 {
        if self.primitive().is_some() { 1 } else { self.link }
    }
}

/// Where a planned node stands.
#[derive(Clone, Copy, Default)]
pub(crate) struct Place {
    segment: u32,
    index: u32,
}

/// The whole tree, planned: its top, and subtrees that were planned side by side.
pub(crate) struct Plans {
    /// The top is the last; the roots of the others stand in it like leaves, with the segment for a primitive.
    segments: Vec<Vec<Planned>>,
}

impl Plans {
    pub(crate) fn root(&self) -> Place {
        let top = self.segments.len() as u32 - 1;
        self.resolved(Place { segment: top, index: self.segments[top as usize].len() as u32 - 1 })
    }

    pub(crate) fn at(&self, place: Place) -> &Planned {
        &self.segments[place.segment as usize][place.index as usize]
    }

    /// The children of a node that is no leaf.
    pub(crate) fn children(&self, place: Place) -> [Place; 2] {
        let right = Place { index: place.index - 1, ..place };
        let left = Place { index: right.index - self.at(right).length(), ..place };
        [self.resolved(left), self.resolved(right)]
    }

    /// The root of the segment that a node of the top stands for.
    fn resolved(&self, place: Place) -> Place {
        if place.segment as usize + 1 == self.segments.len()
            && self.segments.len() > 1
            && let Some(segment) = self.at(place).primitive()
        {
            return Place { segment, index: self.segments[segment as usize].len() as u32 - 1 };
        }
        place
    }
}

/// What a parent needs to know of a child.
#[derive(Clone)]
struct Waiting {
    /// Costs of a forest of at most i + 1 wide subtrees, i below `most`.
    cost: [f64; WIDTH - 1],
    bounds: Bounds,
    /// Triangles below; more than a block holds where there is an instance.
    size: u32,
    /// Wide subtrees that it can be, at most [`WIDTH`]: with more allowed, costs stay what they are.
    most: u32,
}

/// Subtrees that are planned side by side, at least, where there is a pool to share them.
const SEGMENTS: usize = 64;

/// Plans the binary tree `nodes`, which is not empty; primitives from `triangles` on are instances.
pub(crate) fn plan(nodes: &[BinaryNode], triangles: u32) -> Plans {
    let roots = if tasks::worthwhile(nodes.len() / 2) { level(nodes) } else { Vec::new() };
    let mut parts: Vec<(Vec<Planned>, Waiting)> = Vec::new();
    parts.par_extend(roots.par_iter().with_max_len(1).map(|&root| {
        // As many as there would be if all were equal.
        let mut planned = Vec::with_capacity(nodes.len() / roots.len());
        let root = subtree(nodes, triangles, root, |_| None, &mut planned);
        (planned, root)
    }));
    let mut top = huge::with_capacity(if roots.is_empty() { nodes.len() - 1 } else { 4 * roots.len() });
    let known = |place| {
        let part = roots.binary_search(&place).ok()?;
        Some((part as u32, &parts[part].1))
    };
    subtree(nodes, triangles, 0, known, &mut top);
    let mut segments: Vec<_> = parts.into_iter().map(|(planned, _)| planned).collect();
    segments.push(top);
    Plans { segments }
}

/// Places of at least [`SEGMENTS`] subtrees that are the whole tree, in their order; those on one level, leaves above it included.
fn level(nodes: &[BinaryNode]) -> Vec<u32> {
    let mut places = vec![0u32];
    while places.len() < SEGMENTS {
        let before = places.len();
        let below = |&place: &u32| match nodes[place as usize].pair() {
            Some(pair) => [Some(2 * pair), Some(2 * pair + 1)],
            None => [Some(place), None],
        };
        places = places.iter().flat_map(below).flatten().collect();
        if places.len() == before {
            break;
        }
    }
    places.sort_unstable();
    places
}

/// Plans the subtree at `root`, but for what is known already. Without recursion: hostile geometry makes deep trees.
fn subtree<'a>(
    nodes: &[BinaryNode],
    triangles: u32,
    root: u32,
    known: impl Fn(u32) -> Option<(u32, &'a Waiting)>,
    planned: &mut Vec<Planned>,
) -> Waiting {
    /// In place of a node: its children's turn is over, now it is the parent's.
    const PARENT: u32 = u32::MAX;
    let mut open = vec![root];
    // Nodes whose parent's turn is still to come; the last two are the children of the next parent. With how long their
    // subtrees are.
    let mut waiting: Vec<(Waiting, u32)> = Vec::new();
    while let Some(place) = open.pop() {
        if place == PARENT {
            let count = waiting.len();
            let [.., (l, length), (r, right_length)] = &mut waiting[..] else { break };
            *length += *right_length + 1;
            let plan = join(l, r);
            planned.push(Planned { bounds: l.bounds, plan, link: *length });
            waiting.truncate(count - 1);
        } else if let Some((part, root)) = known(place) {
            planned.push(Planned { bounds: root.bounds, plan: Plan(0), link: part });
            waiting.push((root.clone(), 1));
        } else if let Some(pair) = nodes[place as usize].pair() {
            let children = [2 * pair, 2 * pair + 1];
            let leaves = children.iter().all(|&child| nodes[child as usize].pair().is_none());
            if leaves && children.iter().all(|&child| known(child).is_none()) {
                // Most leaves stand in such pairs, and there is little to decide.
                let [(left, mut l), (right, r)] =
                    children.map(|child| leaf(&nodes[child as usize], triangles));
                let plan = join(&mut l, &r);
                planned.extend([left, right, Planned { bounds: l.bounds, plan, link: 3 }]);
                waiting.push((l, 3));
            } else {
                open.extend([PARENT, children[1], children[0]]);
            }
        } else {
            let (leaf, root) = leaf(&nodes[place as usize], triangles);
            planned.push(leaf);
            waiting.push((root, 1));
        }
    }
    match waiting.pop() {
        Some((root, _)) => root,
        None => leaf(&BinaryNode::EMPTY, triangles).1,
    }
}

#[inline(always)]
fn leaf(node: &BinaryNode, triangles: u32) -> (Planned, Waiting) {
    let (bounds, primitive) = (node.bounds(), node.primitive());
    let instance = primitive >= triangles;
    let cost = bounds.half_area() * if instance { INSTANCE_COST } else { BLOCK_COST };
    let size = if instance { LANES as u32 + 1 } else { 1 };
    let mut costs = [0.0; WIDTH - 1];
    costs[0] = cost;
    let planned = Planned { bounds, plan: Plan(Plan::LEAF | 7 << 28), link: primitive };
    (planned, Waiting { cost: costs, bounds, size, most: 1 })
}

/// Makes the left child the parent of both, and tells how that is made of them.
#[inline(always)]
fn join(l: &mut Waiting, r: &Waiting) -> Plan {
    let (bounds, size) = (l.bounds.union(&r.bounds), l.size.saturating_add(r.size));
    let (l_most, r_most) = (l.most as usize, r.most as usize);
    let most = (l_most + r_most).min(WIDTH);
    // Of at most i subtrees that are shared out between the children, i in 2..=most.
    let mut forest = [f64::INFINITY; WIDTH + 1];
    let mut lefts = 0;
    for count in 2..=most {
        let (mut cheapest, mut best) = (f64::INFINITY, 0);
        for left in count.saturating_sub(r_most).max(1)..=l_most.min(count - 1) {
            let cost = l.cost[left - 1] + r.cost[count - left - 1];
            // Without a branch, which would follow no pattern.
            let better = cost < cheapest;
            best = select_unpredictable(better, left as u32, best);
            cheapest = select_unpredictable(better, cost, cheapest);
        }
        // Or fewer of them.
        let fewer = forest[count - 1] <= cheapest;
        forest[count] = select_unpredictable(fewer, forest[count - 1], cheapest);
        lefts |= select_unpredictable(fewer, 0, best) << (4 * (count - 2));
    }
    let area = bounds.half_area();
    let as_block = if size as usize <= LANES { area * BLOCK_COST } else { f64::INFINITY };
    let as_node = area * NODE_COST + forest[most];
    let single = as_block.min(as_node);
    l.cost[0] = single;
    // Forests do not get dearer with their number: up to how many one is as good; with more allowed than can be, as with those.
    let last = most.min(WIDTH - 1);
    let mut up_to = 1;
    for (cost, &forest) in l.cost[1..last].iter_mut().zip(&forest[2..]) {
        up_to += u32::from(single <= forest);
        *cost = single.min(forest);
    }
    let up_to = if up_to as usize == last { WIDTH as u32 - 1 } else { up_to };
    (l.bounds, l.size, l.most) = (bounds, size, most as u32);
    Plan(lefts | up_to << 28 | if as_block <= as_node { Plan::LEAF } else { 0 })
}
