//! Which binary nodes become nodes and leaf blocks of the 8-wide tree, at the least expected cost.
//!
//! The dynamic program of Ylitie, Karras and Laine, *Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide
//! BVHs* (HPG 2017), section 3.1: for each binary node n and each i, the cheapest way to represent the subtree of n as a
//! forest of at most i wide subtrees; a wide subtree is a leaf block (up to 8 triangles) or a node whose children are a
//! forest of at most 8. Costs are surface areas times [`NODE_COST`] or [`BLOCK_COST`]: a block costs the same however
//! full it is, since its lanes are tested at once. An instance is a leaf of its own.

use crate::binary::{BinaryNode, WARM, warm};
use crate::node::Bounds;
use crate::tasks;
use crate::triangle::LANES;
use core::hint::select_unpredictable;
use core::sync::atomic::{AtomicU32, Ordering::Relaxed};
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

/// What was decided about each inner node, by its pair of children. Subtrees are planned side by side, each setting its own.
pub(crate) struct Plans(Vec<AtomicU32>);

impl Plans {
    /// That of the inner node whose children are `pair`.
    #[inline(always)]
    pub(crate) fn of_pair(&self, pair: u32) -> Plan {
        Plan(self.0[pair as usize].load(Relaxed))
    }

    /// That of any node.
    #[inline(always)]
    pub(crate) fn of(&self, node: &BinaryNode) -> Plan {
        node.pair().map_or(Plan(Plan::LEAF | 7 << 28), |pair| self.of_pair(pair))
    }

    #[inline(always)]
    fn set(&self, pair: u32, plan: Plan) {
        self.0[pair as usize].store(plan.0, Relaxed);
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

/// Parts of the tree that are worked on side by side, about, where there is a pool to share them.
const PARTS: u32 = 128;
/// Leaves of a part, at least.
const SMALLEST: u32 = 256;

/// Leaves below a node up to which it is better not to split the work on it; everything, where it is not to be shared.
pub(crate) fn part_size(nodes: &[BinaryNode]) -> u32 {
    let leaves = nodes.len() as u32 / 2;
    if tasks::worthwhile(leaves as usize) { (leaves / PARTS).max(SMALLEST) } else { u32::MAX }
}

/// Plans the binary tree `nodes`, which is not empty; primitives from `triangles` on are instances.
pub(crate) fn plan(nodes: &[BinaryNode], triangles: u32) -> Plans {
    let plans = Plans((0..nodes.len() / 2).map(|_| AtomicU32::new(0)).collect());
    let limit = part_size(nodes);
    // Places of the parts' roots.
    let mut roots = Vec::new();
    let mut open = vec![0];
    while let Some(place) = open.pop() {
        let node = &nodes[place as usize];
        match node.pair().filter(|_| node.leaves() > limit) {
            Some(pair) => open.extend([2 * pair, 2 * pair + 1]),
            None => roots.push(place),
        }
    }
    let part = |root| {
        let small = |place: u32| {
            (nodes[place as usize].leaves() <= WARM).then(|| {
                warm(nodes, place);
                subtree(nodes, triangles, place, |_| None, &plans)
            })
        };
        subtree(nodes, triangles, root, small, &plans)
    };
    if let [root] = roots[..] {
        part(root);
        return plans;
    }
    // Where the small ones are as good as done by the time the last is begun: the largest first.
    roots.sort_unstable_by_key(|&place| (!nodes[place as usize].leaves(), place));
    let parts = roots.par_iter().with_max_len(1);
    let mut parts: Vec<(u32, Waiting)> = parts.map(|&root| (root, part(root))).collect();
    parts.sort_unstable_by_key(|(place, _)| *place);
    let known = |place| {
        let part = parts.binary_search_by_key(&place, |(place, _)| *place).ok()?;
        Some(parts[part].1.clone())
    };
    subtree(nodes, triangles, 0, known, &plans);
    plans
}

/// Plans the subtree at `root`, but for what is known already. Without recursion: hostile geometry makes deep trees.
fn subtree(
    nodes: &[BinaryNode],
    triangles: u32,
    root: u32,
    known: impl Fn(u32) -> Option<Waiting>,
    plans: &Plans,
) -> Waiting {
    /// In place of a node: the turn of this pair is over, now it is their parent's.
    const PARENT: u32 = 1 << 31;
    let mut open = vec![root];
    // Nodes whose parent's turn is still to come; the last two are the children of the next parent.
    let mut waiting: Vec<Waiting> = Vec::new();
    while let Some(place) = open.pop() {
        if place & PARENT != 0 {
            let count = waiting.len();
            let [.., l, r] = &mut waiting[..] else { break };
            plans.set(place & !PARENT, join(l, r));
            waiting.truncate(count - 1);
        } else if let Some(root) = known(place) {
            waiting.push(root);
        } else if let Some(pair) = nodes[place as usize].pair() {
            let children = [2 * pair, 2 * pair + 1];
            let leaves = children.iter().all(|&child| nodes[child as usize].pair().is_none());
            if leaves {
                // Most leaves stand in such pairs, and there is little to decide.
                let [mut l, r] = children.map(|child| leaf(&nodes[child as usize], triangles));
                plans.set(pair, join(&mut l, &r));
                waiting.push(l);
            } else {
                open.extend([pair | PARENT, children[1], children[0]]);
            }
        } else {
            waiting.push(leaf(&nodes[place as usize], triangles));
        }
    }
    match waiting.pop() {
        Some(root) => root,
        None => leaf(&BinaryNode::EMPTY, triangles),
    }
}

#[inline(always)]
fn leaf(node: &BinaryNode, triangles: u32) -> Waiting {
    let (bounds, primitive) = (node.bounds(), node.primitive());
    let instance = primitive >= triangles;
    let cost = bounds.half_area() * if instance { INSTANCE_COST } else { BLOCK_COST };
    let size = if instance { LANES as u32 + 1 } else { 1 };
    let mut costs = [0.0; WIDTH - 1];
    costs[0] = cost;
    Waiting { cost: costs, bounds, size, most: 1 }
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
