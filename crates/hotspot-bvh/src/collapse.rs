//! Turns a binary tree with one triangle per leaf into the 8-wide tree, at the least expected cost.
//!
//! The dynamic program of Ylitie, Karras and Laine, *Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide
//! BVHs* (HPG 2017), section 3.1: for each binary node n and each i, the cheapest way to represent the subtree of n as a
//! forest of at most i wide subtrees; a wide subtree is a leaf block (up to 8 triangles) or a node whose children are a
//! forest of at most 8. Costs are surface areas times [`NODE_COST`] or [`BLOCK_COST`]: a block costs the same however
//! full it is, since its lanes are tested at once. An instance is a leaf of its own.

use crate::binary::BinaryNode;
use crate::huge;
use crate::node::{Bounds, Child, Node};
use crate::tasks;
use crate::triangle::{Block, LANES};
use core::hint::select_unpredictable;

/// Relative cost of visiting a node.
const NODE_COST: f64 = 1.0;
/// Relative cost of testing a leaf block.
const BLOCK_COST: f64 = 0.9;
/// Relative cost of entering an instance: taking the ray there, and a visit of its root.
const INSTANCE_COST: f64 = 3.0;
/// Children per wide node.
const WIDTH: usize = 8;

/// The wide tree.
#[derive(Default)]
pub(crate) struct WideTree {
    pub(crate) nodes: Vec<Node>,
    pub(crate) blocks: Vec<Block>,
    pub(crate) root: Child,
    pub(crate) bounds: Bounds,
}

impl WideTree {
    /// Room for a finished tree, in memory for tracing.
    pub(crate) fn with_capacity(nodes: usize, blocks: usize) -> Self {
        Self { nodes: huge::with_capacity(nodes), blocks: huge::with_capacity(blocks), ..Self::default() }
    }

    /// Takes in another tree's nodes and blocks, and returns where its root is now.
    pub(crate) fn append(&mut self, other: Self) -> Child {
        let (nodes, blocks) = (self.nodes.len() as u32, self.blocks.len() as u32);
        self.nodes.extend(other.nodes.into_iter().map(|mut node| {
            node.children = node.children.map(|child| child.moved(nodes, blocks));
            node
        }));
        self.blocks.extend(other.blocks);
        other.root.moved(nodes, blocks)
    }

    /// Boxes that enclose the tree between them, more closely than one: those of the root's grandchildren.
    pub(crate) fn boxes_near_the_root(&self) -> Vec<Bounds> {
        if self.root.is_leaf() {
            return vec![self.bounds];
        }
        let mut boxes = Vec::new();
        for (bounds, child) in self.nodes[self.root.index()].occupied() {
            if child.is_leaf() {
                boxes.push(bounds);
            } else {
                boxes.extend(self.nodes[child.index()].occupied().map(|(bounds, _)| bounds));
            }
        }
        boxes
    }
}

/// What the dynamic program decides about a binary node, in eight bytes: there are twice as many as triangles.
#[derive(Clone, Copy, Default)]
struct Plan {
    /// For forests of 2..=8, four bits each: how many go to the left child; 0: use one fewer subtrees.
    left: u32,
    /// Bit i: a forest of at most i subtrees, i in 1..=7, is best as one.
    single: u8,
    /// The single subtree is a leaf: a block, or an instance.
    leaf: bool,
}

impl Plan {
    fn left(self, count: usize) -> usize {
        (self.left >> (4 * (count - 1)) & 15) as usize
    }

    fn set_left(&mut self, count: usize, left: usize) {
        let shift = 4 * (count - 1);
        self.left = self.left & !(15 << shift) | (left as u32) << shift;
    }

    fn single(self, count: usize) -> bool {
        self.single >> count & 1 != 0
    }
}

/// What the leaves of a binary tree hold: primitive i is triangle i, or beyond those an instance.
#[derive(Clone, Copy)]
pub(crate) struct Primitives<'a> {
    pub(crate) triangles: &'a [[[f32; 3]; 3]],
}

impl Primitives<'_> {
    fn instance(&self, primitive: u32) -> Option<u32> {
        primitive.checked_sub(self.triangles.len() as u32)
    }
}

/// Collapses the binary tree `nodes` over `primitives`.
pub(crate) fn collapse(nodes: &[BinaryNode], primitives: Primitives<'_>) -> WideTree {
    if nodes.is_empty() {
        return WideTree { nodes: Vec::new(), blocks: Vec::new(), root: Child::EMPTY, bounds: Bounds::EMPTY };
    }
    let planned = plan(nodes, primitives);
    Emitter { primitives, planned: &planned }.run()
}

/// A binary node with what was decided about it. Every child stands before its parent and left subtrees before right ones, so
/// that both passes go through memory from one end to the other: the right child is the one before its parent, the left one
/// before all of the right subtree, and a subtree's leaves lie side by side.
#[derive(Clone, Copy)]
struct Planned {
    bounds: Bounds,
    plan: Plan,
    /// Nodes of the subtree, this one included; 1: a leaf.
    length: u32,
    /// Of a leaf.
    primitive: u32,
}

/// What a parent needs to know of a child.
struct Waiting {
    /// Costs of a forest of at most i + 1 wide subtrees, i below `most`.
    cost: [f64; WIDTH - 1],
    bounds: Bounds,
    /// Triangles below; more than a block holds where there is an instance.
    size: u32,
    length: u32,
    /// Wide subtrees that it can be, at most [`WIDTH`]: with more allowed, costs stay what they are.
    most: usize,
}

/// Without recursion: hostile geometry makes deep trees.
fn plan(nodes: &[BinaryNode], primitives: Primitives<'_>) -> Vec<Planned> {
    /// In place of a node: its children's turn is over, now it is the parent's.
    const PARENT: u32 = u32::MAX;
    let mut planned = huge::with_capacity(nodes.len() - 1);
    let mut open = vec![0u32];
    // Nodes whose parent's turn is still to come; the last two are the children of the next parent.
    let mut waiting: Vec<Waiting> = Vec::new();
    while let Some(place) = open.pop() {
        let mut plan = Plan { leaf: true, single: !0, left: 0 };
        let mut primitive = 0;
        let this = if place != PARENT {
            let node = &nodes[place as usize];
            if let Some(pair) = node.pair() {
                open.extend([PARENT, 2 * pair + 1, 2 * pair]);
                continue;
            }
            primitive = node.primitive();
            leaf(node.bounds(), primitives.instance(primitive).is_some())
        } else if let (Some(r), Some(l)) = (waiting.pop(), waiting.pop()) {
            joined(&l, &r, &mut plan)
        } else {
            break;
        };
        planned.push(Planned { bounds: this.bounds, plan, length: this.length, primitive });
        waiting.push(this);
    }
    planned
}

fn leaf(bounds: Bounds, instance: bool) -> Waiting {
    let cost = bounds.half_area() * if instance { INSTANCE_COST } else { BLOCK_COST };
    let size = if instance { LANES as u32 + 1 } else { 1 };
    Waiting { cost: [cost; WIDTH - 1], bounds, size, length: 1, most: 1 }
}

/// Two children's parent, and how it is made of them.
fn joined(l: &Waiting, r: &Waiting, plan: &mut Plan) -> Waiting {
    let (bounds, size) = (l.bounds.union(&r.bounds), l.size.saturating_add(r.size));
    let most = (l.most + r.most).min(WIDTH);
    // Of at most i subtrees that are shared out between the children, i in 2..=most.
    let mut forest = [f64::INFINITY; WIDTH + 1];
    for count in 2..=most {
        let (mut cheapest, mut best) = (f64::INFINITY, 0);
        for left in count.saturating_sub(r.most).max(1)..=l.most.min(count - 1) {
            let cost = l.cost[left - 1] + r.cost[count - left - 1];
            // Without a branch, which would follow no pattern.
            let better = cost < cheapest;
            best = select_unpredictable(better, left, best);
            cheapest = select_unpredictable(better, cost, cheapest);
        }
        // Or fewer of them.
        let fewer = forest[count - 1] <= cheapest;
        forest[count] = select_unpredictable(fewer, forest[count - 1], cheapest);
        plan.set_left(count, select_unpredictable(fewer, 0, best));
    }
    let area = bounds.half_area();
    let as_block = block_cost(area, size);
    let as_node = area * NODE_COST + forest[most];
    plan.leaf = as_block <= as_node;
    let single = as_block.min(as_node);
    let mut cost = [single; WIDTH - 1];
    plan.single = 0b10;
    for count in 2..=most.min(WIDTH - 1) {
        plan.single |= u8::from(single <= forest[count]) << count;
        cost[count - 1] = single.min(forest[count]);
    }
    // With more allowed, it is as with `most`.
    let last = most.min(WIDTH - 1);
    if plan.single(last) {
        plan.single |= !0 << last;
    }
    Waiting { cost, bounds, size, length: l.length + r.length + 1, most }
}

/// The cost of a leaf block for so many triangles; infinite where they do not fit.
fn block_cost(area: f64, triangles: u32) -> f64 {
    if triangles as usize <= LANES { area * BLOCK_COST } else { f64::INFINITY }
}

/// A wide node to be.
struct Shape {
    children: [Child; WIDTH],
    /// Places in the plan of the occupied slots.
    places: [u32; WIDTH],
    occupied: usize,
}

/// Up to eight places in the plan.
#[derive(Default)]
struct Places {
    places: [u32; WIDTH],
    count: usize,
}

impl Places {
    fn push(&mut self, place: u32) {
        self.places[self.count] = place;
        self.count += 1;
    }

    fn iter(&self) -> impl Iterator<Item = u32> {
        self.places[..self.count].iter().copied()
    }
}

struct Emitter<'a> {
    primitives: Primitives<'a>,
    planned: &'a [Planned],
}

impl Emitter<'_> {
    /// First what there will be, then all of it into memory of the right size: nodes depth first, so that a subtree lies together.
    fn run(self) -> WideTree {
        let root = self.planned.len() - 1;
        let bounds = self.planned[root].bounds;
        let (mut shapes, mut leaves) = (Vec::<Shape>::new(), Vec::new());
        let root = if self.planned[root].plan.leaf {
            self.leaf(root as u32, &mut leaves)
        } else {
            // Place in the plan; parent and slot.
            let mut pending = vec![(root as u32, None)];
            while let Some((place, parent)) = pending.pop() {
                let index = shapes.len() as u32;
                if let Some((parent, slot)) = parent {
                    let parent: &mut Shape = &mut shapes[parent as usize];
                    parent.children[slot as usize] = Child::node(index);
                }
                let (sorted, blocks) = self.sorted(&self.forest(place as usize));
                let mut shape =
                    Shape { children: [Child::EMPTY; WIDTH], places: sorted.places, occupied: sorted.count };
                for (child, place) in shape.children.iter_mut().zip(sorted.iter()) {
                    if self.planned[place as usize].plan.leaf {
                        *child = self.leaf(place, &mut leaves);
                    }
                }
                for slot in (blocks..sorted.count).rev() {
                    let place = sorted.places[slot];
                    if !self.planned[place as usize].plan.leaf {
                        pending.push((place, Some((index, slot as u32))));
                    }
                }
                shapes.push(shape);
            }
            Child::node(0)
        };
        let mut tree = WideTree { root, bounds, ..WideTree::with_capacity(shapes.len(), leaves.len()) };
        tasks::map_into(&mut tree.nodes, &shapes, |_, shape| self.node(shape));
        tasks::map_into(&mut tree.blocks, &leaves, |_, &place| self.block(place as usize));
        tree
    }

    /// Blocks first, and how many they are: any-hit queries try them before they descend. Then by area, largest first.
    fn sorted(&self, roots: &Places) -> (Places, usize) {
        let mut sorted = Places::default();
        let mut blocks = 0;
        let mut areas = [0.0; WIDTH];
        for wants_blocks in [true, false] {
            let start = sorted.count;
            for place in roots.iter() {
                let is_block =
                    self.planned[place as usize].plan.leaf && self.instance(place as usize).is_none();
                if is_block != wants_blocks {
                    continue;
                }
                // Insertion, equals in the order of their coming.
                let area = self.planned[place as usize].bounds.half_area();
                let mut slot = sorted.count;
                sorted.push(place);
                while slot > start && areas[slot - 1] < area {
                    (areas[slot], sorted.places[slot]) = (areas[slot - 1], sorted.places[slot - 1]);
                    slot -= 1;
                }
                (areas[slot], sorted.places[slot]) = (area, place);
            }
            if wants_blocks {
                blocks = sorted.count;
            }
        }
        (sorted, blocks)
    }

    /// The binary nodes that become the children of the wide node made of `place`, from left to right.
    fn forest(&self, place: usize) -> Places {
        let mut roots = Places::default();
        // (place, wide subtrees that it may become, whether it must be split); what waits shares out eight subtrees.
        let mut stack = [(0, 0, false); WIDTH];
        stack[0] = (place, WIDTH, true);
        let mut waiting = 1;
        while waiting > 0 {
            waiting -= 1;
            let (place, mut count, must_split) = stack[waiting];
            let Planned { plan, length, .. } = self.planned[place];
            if length == 1 || (!must_split && plan.single(count)) {
                roots.push(place as u32);
                continue;
            }
            while plan.left(count) == 0 {
                count -= 1;
            }
            let left = plan.left(count);
            let right = place - 1;
            stack[waiting] = (right, count - left, false);
            stack[waiting + 1] = (right - self.planned[right].length as usize, left, false);
            waiting += 2;
        }
        roots
    }

    /// The instance that a place is, if it is one.
    fn instance(&self, place: usize) -> Option<u32> {
        let planned = &self.planned[place];
        if planned.length == 1 { self.primitives.instance(planned.primitive) } else { None }
    }

    /// An instance, or the next block.
    fn leaf(&self, place: u32, blocks: &mut Vec<u32>) -> Child {
        if let Some(instance) = self.instance(place as usize) {
            return Child::instance(instance);
        }
        blocks.push(place);
        Child::leaf(blocks.len() as u32 - 1)
    }

    fn node(&self, shape: &Shape) -> Node {
        let mut node = Node { children: shape.children, ..Node::EMPTY };
        for (slot, &place) in shape.places[..shape.occupied].iter().enumerate() {
            let b = self.planned[place as usize].bounds;
            for axis in 0..3 {
                node.bounds[axis][0].0[slot] = b.min[axis];
                node.bounds[axis][1].0[slot] = b.max[axis];
            }
        }
        node
    }

    fn block(&self, place: usize) -> Block {
        let first = place + 1 - self.planned[place].length as usize;
        let leaves = self.planned[first..=place].iter().filter(|planned| planned.length == 1);
        Block::new(leaves.map(|leaf| (leaf.primitive, self.primitives.triangles[leaf.primitive as usize])))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// SplitMix64, below a limit.
    fn random(state: &mut u64, limit: u32) -> u32 {
        *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = *state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 33) as u32 % limit
    }

    /// A node over `leaves`, split at random; its children, if any, are pushed onto `nodes`.
    fn grow(nodes: &mut Vec<BinaryNode>, leaves: &[BinaryNode], state: &mut u64) -> BinaryNode {
        if let [leaf] = leaves {
            return *leaf;
        }
        let (left, right) = leaves.split_at(1 + random(state, leaves.len() as u32 - 1) as usize);
        let pair = nodes.len();
        nodes.extend([BinaryNode::EMPTY; 2]);
        nodes[pair] = grow(nodes, left, state);
        nodes[pair + 1] = grow(nodes, right, state);
        BinaryNode::parent_of(&nodes[pair], &nodes[pair + 1], pair as u32 / 2)
    }

    /// Box and primitives below a node.
    fn below(nodes: &[BinaryNode], bounds: &[Bounds], n: usize) -> (Bounds, Vec<u32>) {
        let Some(pair) = nodes[n].pair() else {
            let primitive = nodes[n].primitive();
            return (bounds[primitive as usize], vec![primitive]);
        };
        let [(a, mut left), (b, right)] = [0, 1].map(|i| below(nodes, bounds, 2 * pair as usize + i));
        left.extend(right);
        (a.union(&b), left)
    }

    /// The least cost of a forest of at most `most` wide subtrees below node `n`, by trying everything.
    fn least(
        tree: (&[BinaryNode], &[Bounds], Primitives<'_>),
        n: usize,
        most: usize,
        known: &mut [[f64; 9]],
    ) -> f64 {
        if known[n][most].is_nan() {
            let (nodes, bounds, p) = tree;
            let (bounds, own) = below(nodes, bounds, n);
            let area = bounds.half_area();
            let instances = own.iter().any(|i| p.instance(*i).is_some());
            let mut cost = if !instances && own.len() <= LANES { area * BLOCK_COST } else { f64::INFINITY };
            if let Some(pair) = nodes[n].pair() {
                let first = 2 * pair as usize;
                let mut share = |most: usize| {
                    (1..most)
                        .map(|left| {
                            least(tree, first, left, known) + least(tree, first + 1, most - left, known)
                        })
                        .fold(f64::INFINITY, f64::min)
                };
                cost = cost.min(area * NODE_COST + share(WIDTH)).min(share(most));
            } else {
                cost = cost.min(area * INSTANCE_COST);
            }
            known[n][most] = cost;
        }
        known[n][most]
    }

    /// Random trees over random boxes, instances among them: the wide tree holds each primitive once, costs as little as
    /// any, and has its children in their order.
    #[test]
    fn no_wide_tree_costs_less() {
        let mut state = 1;
        for round in 0..400 {
            let count = 1 + random(&mut state, 60);
            let instances = if round % 3 == 0 { random(&mut state, count + 1) } else { 0 };
            let triangles: Vec<[[f32; 3]; 3]> = (instances..count)
                .map(|_| core::array::from_fn(|_| core::array::from_fn(|_| random(&mut state, 1000) as f32)))
                .collect();
            let mut bounds: Vec<Bounds> = triangles.iter().map(|t| Bounds::of_points(t)).collect();
            for _ in 0..instances {
                let mut corner = || core::array::from_fn(|_| random(&mut state, 1000) as f32);
                bounds.push(Bounds::of_points(&[corner(), [500.0; 3]]));
            }
            let primitives = Primitives { triangles: &triangles };
            let mut leaves: Vec<_> = bounds.iter().zip(0..).map(|(b, i)| BinaryNode::leaf(b, i)).collect();
            for last in (1..count).rev() {
                leaves.swap(last as usize, random(&mut state, last + 1) as usize);
            }
            let mut nodes = vec![BinaryNode::EMPTY; 2];
            nodes[0] = grow(&mut nodes, &leaves, &mut state);
            let wide = collapse(&nodes, primitives);

            let mut seen: Vec<u32> = Vec::new();
            let mut cost = 0.0;
            let mut pending = vec![(wide.bounds, wide.root)];
            while let Some((bounds, child)) = pending.pop() {
                if child.is_instance() {
                    seen.push(triangles.len() as u32 + child.index() as u32);
                    cost += bounds.half_area() * INSTANCE_COST;
                } else if child.is_leaf() {
                    let used = |p: &&u32| **p != crate::triangle::NO_PRIMITIVE;
                    seen.extend(wide.blocks[child.index()].primitives.iter().filter(used));
                    cost += bounds.half_area() * BLOCK_COST;
                } else {
                    let slots: Vec<_> = wide.nodes[child.index()].occupied().collect();
                    let rank = |(bounds, child): &(Bounds, Child)| {
                        (!child.is_leaf() || child.is_instance(), -bounds.half_area())
                    };
                    assert!(slots.is_sorted_by_key(rank), "round {round}: {slots:?}");
                    pending.extend(slots);
                    cost += bounds.half_area() * NODE_COST;
                }
            }
            seen.sort_unstable();
            assert_eq!(seen, (0..count).collect::<Vec<_>>(), "round {round}");
            let mut known = vec![[f64::NAN; 9]; nodes.len()];
            let least = least((&nodes, &bounds, primitives), 0, 1, &mut known);
            assert!((cost / least - 1.0).abs() < 1e-9, "round {round}: {cost} where {least} would do");
        }
    }
}
