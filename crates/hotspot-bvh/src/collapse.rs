//! Turns a binary tree with one triangle per leaf into the 8-wide tree, at the least expected cost.
//!
//! The dynamic program of Ylitie, Karras and Laine, *Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide
//! BVHs* (HPG 2017), section 3.1: for each binary node n and each i, the cheapest way to represent the subtree of n as a
//! forest of at most i wide subtrees; a wide subtree is a leaf block (up to 8 triangles) or a node whose children are a
//! forest of at most 8. Costs are surface areas times [`NODE_COST`] or [`BLOCK_COST`]: a block costs the same however
//! full it is, since its lanes are tested at once. An instance is a leaf of its own.

use crate::huge;
use crate::node::{Bounds, Child, Node};
use crate::triangle::{Block, LANES};

/// Relative cost of visiting a node.
const NODE_COST: f64 = 1.0;
/// Relative cost of testing a leaf block.
const BLOCK_COST: f64 = 0.9;
/// Relative cost of entering an instance: taking the ray there, and a visit of its root.
const INSTANCE_COST: f64 = 3.0;
/// Children per wide node.
const WIDTH: usize = 8;

/// A binary tree: children of an inner node are `first` and `first + 1`; a leaf holds the primitives
/// `order[first..first + count]`.
pub(crate) struct BinaryTree {
    pub(crate) nodes: Vec<BinaryNode>,
    pub(crate) order: Vec<u32>,
}

/// A node of the binary tree; `count` is 0 for inner nodes.
#[derive(Clone, Copy)]
pub(crate) struct BinaryNode {
    pub(crate) first: u32,
    pub(crate) count: u32,
}

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

/// What the leaves of a binary tree hold: primitive i is triangle i, or beyond those an instance, given by its box.
#[derive(Clone, Copy)]
pub(crate) struct Primitives<'a> {
    pub(crate) triangles: &'a [[[f32; 3]; 3]],
    pub(crate) instances: &'a [Bounds],
}

impl Primitives<'_> {
    fn bounds(&self, primitive: u32) -> Bounds {
        match self.instance(primitive) {
            Some(instance) => self.instances[instance as usize],
            None => Bounds::of_points(&self.triangles[primitive as usize]),
        }
    }

    fn instance(&self, primitive: u32) -> Option<u32> {
        primitive.checked_sub(self.triangles.len() as u32)
    }
}

/// Collapses `tree` over `primitives`.
pub(crate) fn collapse(tree: &BinaryTree, primitives: Primitives<'_>) -> WideTree {
    if tree.order.is_empty() {
        return WideTree { nodes: Vec::new(), blocks: Vec::new(), root: Child::EMPTY, bounds: Bounds::EMPTY };
    }
    let after_children = children_first(tree);
    let mut bounds = vec![Bounds::EMPTY; tree.nodes.len()];
    // Triangles below; more than a block holds where there is an instance.
    let mut sizes = vec![0u32; tree.nodes.len()];
    for &n in &after_children {
        let n = n as usize;
        let node = tree.nodes[n];
        if node.count > 0 {
            for &primitive in leaf_primitives(tree, node) {
                bounds[n] = bounds[n].union(&primitives.bounds(primitive));
                let size = if primitives.instance(primitive).is_some() { LANES as u32 + 1 } else { 1 };
                sizes[n] += size;
            }
        } else {
            let (l, r) = (node.first as usize, node.first as usize + 1);
            bounds[n] = bounds[l].union(&bounds[r]);
            sizes[n] = sizes[l].saturating_add(sizes[r]);
        }
    }
    let plans = plan(tree, &after_children, &bounds, &sizes);
    Emitter { tree, primitives, bounds: &bounds, plans: &plans, nodes: Vec::new(), blocks: Vec::new() }.run()
}

fn leaf_primitives(tree: &BinaryTree, node: BinaryNode) -> &[u32] {
    &tree.order[node.first as usize..(node.first + node.count) as usize]
}

/// Node indices, every child before its parent, without recursion: hostile geometry makes deep trees.
fn children_first(tree: &BinaryTree) -> Vec<u32> {
    let mut order = Vec::with_capacity(tree.nodes.len());
    let mut stack = vec![0u32];
    while let Some(n) = stack.pop() {
        order.push(n);
        let node = tree.nodes[n as usize];
        if node.count == 0 {
            stack.extend([node.first, node.first + 1]);
        }
    }
    order.reverse();
    order
}

fn plan(tree: &BinaryTree, after_children: &[u32], bounds: &[Bounds], sizes: &[u32]) -> Vec<Plan> {
    let mut plans = vec![Plan::default(); tree.nodes.len()];
    // Costs of a forest of at most i + 1 wide subtrees, i in 0..7, of nodes whose parent's turn is still to come. Parents
    // follow upon the subtrees of their children, so the last two are those of the node's children.
    let mut waiting: Vec<[f64; WIDTH - 1]> = Vec::new();
    for &n in after_children {
        let n = n as usize;
        let node = tree.nodes[n];
        let area = bounds[n].half_area();
        let as_block = if sizes[n] as usize <= LANES { area * BLOCK_COST } else { f64::INFINITY };
        let mut plan = Plan { leaf: true, ..Plan::default() };
        let mut cost = [f64::INFINITY; WIDTH - 1];
        if node.count > 0 {
            cost = [as_block.min(area * INSTANCE_COST); WIDTH - 1];
        } else if let (Some(r), Some(l)) = (waiting.pop(), waiting.pop()) {
            let mut forest = [f64::INFINITY; WIDTH + 1];
            for (count, cheapest) in forest.iter_mut().enumerate().skip(2) {
                for left in 1..count {
                    if left < WIDTH && count - left < WIDTH {
                        let cost = l[left - 1] + r[count - left - 1];
                        if cost < *cheapest {
                            *cheapest = cost;
                            plan.set_left(count, left);
                        }
                    }
                }
            }
            // The cheapest forest of at most 8 for the children of a node.
            for count in 3..=WIDTH {
                if forest[count - 1] <= forest[count] {
                    forest[count] = forest[count - 1];
                    plan.set_left(count, 0);
                }
            }
            let as_node = area * NODE_COST + forest[WIDTH];
            plan.leaf = as_block <= as_node;
            cost[0] = as_block.min(as_node);
            let single = cost[0];
            for (cost, &forest) in cost[1..].iter_mut().zip(&forest[2..]) {
                *cost = single.min(forest);
            }
        }
        for count in 1..WIDTH {
            plan.single |= u8::from(cost[0] <= cost[count - 1]) << count;
        }
        plans[n] = plan;
        waiting.push(cost);
    }
    plans
}

struct Emitter<'a> {
    tree: &'a BinaryTree,
    primitives: Primitives<'a>,
    bounds: &'a [Bounds],
    plans: &'a [Plan],
    nodes: Vec<Node>,
    blocks: Vec<Block>,
}

impl Emitter<'_> {
    fn run(mut self) -> WideTree {
        let bounds = self.bounds[0];
        let root = if self.plans[0].leaf {
            self.leaf(0)
        } else {
            // Depth first, so that a subtree lies together: (binary node, its wide node's parent and slot).
            let mut pending = vec![(0usize, None)];
            while let Some((binary, parent)) = pending.pop() {
                let index = self.nodes.len() as u32;
                self.nodes.push(Node::EMPTY);
                if let Some((parent, slot)) = parent {
                    let parent: &mut Node = &mut self.nodes[parent as usize];
                    parent.children[slot as usize] = Child::node(index);
                }
                let roots = self.forest(binary);
                // Blocks first: any-hit queries try them before they descend. Then by area, largest first.
                let is_block = |&n: &usize| self.plans[n].leaf && self.instance(n).is_none();
                let mut sorted: Vec<usize> = roots.iter().copied().filter(is_block).collect();
                let leaves = sorted.len();
                sorted.extend(roots.iter().copied().filter(|n| !is_block(n)));
                let by_area = |a: &usize, b: &usize| {
                    self.bounds[*b].half_area().total_cmp(&self.bounds[*a].half_area())
                };
                sorted[..leaves].sort_by(by_area);
                sorted[leaves..].sort_by(by_area);
                for (slot, &child) in sorted.iter().enumerate() {
                    let b = self.bounds[child];
                    for axis in 0..3 {
                        self.nodes[index as usize].bounds[axis][0].0[slot] = b.min[axis];
                        self.nodes[index as usize].bounds[axis][1].0[slot] = b.max[axis];
                    }
                    if self.plans[child].leaf {
                        let leaf = self.leaf(child);
                        self.nodes[index as usize].children[slot] = leaf;
                    }
                }
                for (slot, &child) in sorted.iter().enumerate().skip(leaves).rev() {
                    if !self.plans[child].leaf {
                        pending.push((child, Some((index, slot as u32))));
                    }
                }
            }
            Child::node(0)
        };
        WideTree { nodes: self.nodes, blocks: self.blocks, root, bounds }
    }

    /// The binary nodes that become the children of the wide node made of `binary`, from left to right.
    fn forest(&self, binary: usize) -> Vec<usize> {
        let mut roots = Vec::with_capacity(WIDTH);
        // (binary node, wide subtrees that it may become, whether it must be split)
        let mut stack = vec![(binary, WIDTH, true)];
        while let Some((n, mut count, must_split)) = stack.pop() {
            let plan = self.plans[n];
            if self.tree.nodes[n].count > 0 || (!must_split && plan.single(count)) {
                roots.push(n);
                continue;
            }
            while plan.left(count) == 0 {
                count -= 1;
            }
            let left = plan.left(count);
            let first = self.tree.nodes[n].first as usize;
            stack.push((first + 1, count - left, false));
            stack.push((first, left, false));
        }
        roots
    }

    /// The instance that a binary node is, if it is one.
    fn instance(&self, binary: usize) -> Option<u32> {
        let node = self.tree.nodes[binary];
        if node.count == 0 {
            return None;
        }
        self.primitives.instance(*leaf_primitives(self.tree, node).first()?)
    }

    fn leaf(&mut self, binary: usize) -> Child {
        if let Some(instance) = self.instance(binary) {
            return Child::instance(instance);
        }
        let mut primitives = Vec::with_capacity(LANES);
        let mut stack = vec![binary];
        while let Some(n) = stack.pop() {
            let node = self.tree.nodes[n];
            if node.count > 0 {
                primitives.extend_from_slice(leaf_primitives(self.tree, node));
            } else {
                stack.extend([node.first as usize + 1, node.first as usize]);
            }
        }
        let index = self.blocks.len() as u32;
        self.blocks
            .push(Block::new(primitives.into_iter().map(|p| (p, self.primitives.triangles[p as usize]))));
        Child::leaf(index)
    }
}
