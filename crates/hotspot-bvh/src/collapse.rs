//! Turns a binary tree with one triangle per leaf into the 8-wide tree that [`crate::plan`] found to be the cheapest.

use crate::binary::{BinaryNode, WARM, warm};
use crate::node::{Bounds, Child, Node};
use crate::plan::{Plans, WIDTH, part_size, plan};
use crate::triangle::{Block, LANES, NO_PRIMITIVE};
use crate::{huge, tasks};
use rayon::prelude::*;

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

/// Nodes or blocks that are worth a task of their own: each is hundreds of bytes.
const HEAVY: usize = 64;

/// What the leaves of a binary tree hold: primitive i is triangle i, or beyond those an instance.
#[derive(Clone, Copy)]
pub(crate) struct Primitives<'a> {
    pub(crate) triangles: &'a [[[f32; 3]; 3]],
}

impl Primitives<'_> {
    fn instance(&self, primitive: u32) -> Option<u32> {
        primitive.checked_sub(self.triangles.len() as u32)
    }

    /// The block of these triangles; unused lanes come last.
    fn block(&self, primitives: &[u32; LANES]) -> Block {
        let used = primitives.iter().filter(|&&primitive| primitive != NO_PRIMITIVE);
        Block::new(used.map(|&p| (p, self.triangles[p as usize])))
    }
}

/// Collapses the binary tree `nodes` over `primitives`.
pub(crate) fn collapse(nodes: &[BinaryNode], primitives: Primitives<'_>) -> WideTree {
    if nodes.is_empty() {
        return WideTree { nodes: Vec::new(), blocks: Vec::new(), root: Child::EMPTY, bounds: Bounds::EMPTY };
    }
    let plans = plan(nodes, primitives.triangles.len() as u32);
    Emitter { primitives, nodes, plans: &plans }.run()
}

/// A wide node to be.
struct Shape {
    /// Nodes and blocks are numbered within the run.
    children: [Child; WIDTH],
    /// What the occupied slots are made of.
    places: [u32; WIDTH],
    /// Occupied slots.
    count: u32,
}

/// Up to eight places in the binary tree.
#[derive(Clone, Copy, Default)]
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

/// Nodes and blocks that follow each other in the wide tree.
#[derive(Default)]
struct Run {
    shapes: Vec<Shape>,
    /// Triangles of blocks. Listed before any is read: more of those that are far away are then waited for at once.
    leaves: Vec<[u32; LANES]>,
    /// Where what is still to be made of this run begins; it is nothing else then.
    root: Option<u32>,
}

/// A slot of a node to be.
#[derive(Clone, Copy)]
struct Slot {
    run: usize,
    index: usize,
    slot: usize,
}

/// A slot that holds the first node of another run.
struct Bridge {
    from: Slot,
    to: usize,
}

struct Emitter<'a> {
    primitives: Primitives<'a>,
    nodes: &'a [BinaryNode],
    plans: &'a Plans,
}

impl Emitter<'_> {
    /// First what there will be, then all of it into memory of the right size: nodes depth first, so that a subtree lies together.
    /// Subtrees of some size are runs of their own, made side by side, and what lies between them are others.
    fn run(self) -> WideTree {
        let root = &self.nodes[0];
        let bounds = root.bounds();
        let part = part_size(self.nodes);
        // What is only the top, is small.
        let first = if part < u32::MAX { Run::default() } else { self.room(0) };
        let (mut runs, mut bridges) = (vec![first], Vec::new());
        let root = if self.plans.of(root).is_leaf() {
            self.leaf(0, &mut runs[0].leaves)
        } else {
            self.subtree(0, part, &mut runs, &mut bridges);
            // Its number is known when its node is.
            Child::EMPTY
        };
        if runs.len() > 1 {
            runs.par_iter_mut().with_max_len(1).for_each(|run| {
                if let Some(root) = run.root.take() {
                    let mut own = vec![self.room(root)];
                    self.subtree(root, u32::MAX, &mut own, &mut Vec::new());
                    *run = own.swap_remove(0);
                }
            });
        }
        let starts = |length: fn(&Run) -> usize| {
            let ends = runs.iter().scan(0, |sum, run| {
                *sum += length(run);
                Some(*sum)
            });
            core::iter::once(0).chain(ends).collect::<Vec<_>>()
        };
        let (nodes, blocks) = (starts(|run| run.shapes.len()), starts(|run| run.leaves.len()));
        for Bridge { from, to } in bridges {
            // What follows comes later, so the difference is not negative.
            let child = Child::node((nodes[to] - nodes[from.run]) as u32, runs[to].shapes[0].count);
            runs[from.run].shapes[from.index].children[from.slot] = child;
        }
        let root = match runs.iter().find_map(|run| run.shapes.first()) {
            Some(shape) => Child::node(0, shape.count),
            None => root,
        };
        let last = runs.len();
        let mut tree = WideTree { root, bounds, ..WideTree::with_capacity(nodes[last], blocks[last]) };
        tasks::flatten_into(&mut tree.nodes, &nodes, HEAVY, |run, index| {
            let mut node = self.node(&runs[run].shapes[index]);
            node.children = node.children.map(|child| child.moved(nodes[run] as u32, blocks[run] as u32));
            node
        });
        tasks::flatten_into(&mut tree.blocks, &blocks, HEAVY, |run, index| {
            self.primitives.block(&runs[run].leaves[index])
        });
        tree
    }

    /// A run with room for what is below `place`, as it mostly is.
    fn room(&self, place: u32) -> Run {
        let leaves = (self.nodes[place as usize].leaves() as usize).min(self.nodes.len() / 2);
        Run {
            shapes: huge::with_capacity(leaves / 16 + 1),
            leaves: huge::with_capacity(leaves / 4 + 1),
            root: None,
        }
    }

    /// Makes the nodes of the wide subtree at `root`, depth first, at the end of the last run. Subtrees of up to `part` leaves
    /// become runs that are still to be made.
    fn subtree(&self, root: u32, part: u32, runs: &mut Vec<Run>, bridges: &mut Vec<Bridge>) {
        // What to make, and the slot that leads there.
        let mut pending: Vec<(u32, Option<Slot>)> = vec![(root, None)];
        // How much is pending where a subtree has been warmed; less: it is done.
        let mut warmed = usize::MAX;
        while let Some((place, from)) = pending.pop() {
            let small = part < u32::MAX && self.nodes[place as usize].leaves() <= part;
            let mut last = runs.len() - 1;
            if small || runs[last].root.is_some() {
                runs.push(Run { root: small.then_some(place), ..Run::default() });
                last += 1;
            }
            let run = &mut runs[last];
            let index = run.shapes.len();
            if let Some(from) = from.filter(|from| from.run != last) {
                bridges.push(Bridge { from, to: last });
            }
            if small {
                continue;
            }
            if pending.len() < warmed {
                warmed = usize::MAX;
                if self.nodes[place as usize].leaves() <= WARM {
                    warmed = pending.len();
                    warm(self.nodes, place);
                }
            }
            let (places, blocks) = self.sorted(&self.forest(place));
            let count = places.count as u32;
            if let Some(from) = from.filter(|from| from.run == last) {
                run.shapes[from.index].children[from.slot] = Child::node(index as u32, count);
            }
            let mut children = [Child::EMPTY; WIDTH];
            for (child, place) in children.iter_mut().zip(places.iter()) {
                if self.plans.of(&self.nodes[place as usize]).is_leaf() {
                    *child = self.leaf(place, &mut run.leaves);
                }
            }
            for slot in (blocks..places.count).rev() {
                if children[slot] == Child::EMPTY {
                    pending.push((places.places[slot], Some(Slot { run: last, index, slot })));
                }
            }
            run.shapes.push(Shape { children, places: places.places, count });
        }
    }

    /// Blocks first, and how many they are: any-hit queries try them before they descend. Then by area per triangle, largest first:
    /// what is large is likely to block the ray, and what holds little is soon searched. (An instance counts as one triangle.)
    fn sorted(&self, roots: &Places) -> (Places, usize) {
        let mut sorted = Places::default();
        let mut blocks = 0;
        let mut ranks = [0.0; WIDTH];
        for wants_blocks in [true, false] {
            let start = sorted.count;
            for place in roots.iter() {
                let node = &self.nodes[place as usize];
                let is_block = self.plans.of(node).is_leaf() && self.instance(node).is_none();
                if is_block != wants_blocks {
                    continue;
                }
                // Insertion, equals in the order of their coming.
                let rank = node.bounds().half_area() / f64::from(node.leaves().max(1));
                let mut slot = sorted.count;
                sorted.push(place);
                while slot > start && ranks[slot - 1] < rank {
                    (ranks[slot], sorted.places[slot]) = (ranks[slot - 1], sorted.places[slot - 1]);
                    slot -= 1;
                }
                (ranks[slot], sorted.places[slot]) = (rank, place);
            }
            if wants_blocks {
                blocks = sorted.count;
            }
        }
        (sorted, blocks)
    }

    /// The binary nodes that become the children of the wide node made of `place`, from left to right.
    fn forest(&self, place: u32) -> Places {
        let mut roots = Places::default();
        // (place, wide subtrees that it may become, whether it must be split); what waits shares out eight subtrees.
        let mut stack = [(place, WIDTH, true); WIDTH];
        let mut waiting = 1;
        while waiting > 0 {
            waiting -= 1;
            let (place, mut count, must_split) = stack[waiting];
            let Some(pair) = self.nodes[place as usize].pair() else {
                roots.push(place);
                continue;
            };
            let plan = self.plans.of_pair(pair);
            if !must_split && plan.single(count) {
                roots.push(place);
                continue;
            }
            while plan.left(count) == 0 {
                count -= 1;
            }
            let left = plan.left(count);
            stack[waiting] = (2 * pair + 1, count - left, false);
            stack[waiting + 1] = (2 * pair, left, false);
            waiting += 2;
        }
        roots
    }

    /// The instance that a node is, if it is one.
    fn instance(&self, node: &BinaryNode) -> Option<u32> {
        if node.pair().is_some() { None } else { self.primitives.instance(node.primitive()) }
    }

    /// An instance, or the next block.
    fn leaf(&self, place: u32, blocks: &mut Vec<[u32; LANES]>) -> Child {
        if let Some(instance) = self.instance(&self.nodes[place as usize]) {
            return Child::instance(instance);
        }
        let (primitives, count) = self.block(place);
        blocks.push(primitives);
        Child::leaf(blocks.len() as u32 - 1, count)
    }

    fn node(&self, shape: &Shape) -> Node {
        let mut node = Node { children: shape.children, ..Node::EMPTY };
        for (slot, child) in shape.children.iter().enumerate() {
            if *child == Child::EMPTY {
                break;
            }
            let b = self.nodes[shape.places[slot] as usize].bounds();
            for axis in 0..3 {
                node.bounds[axis][0].0[slot] = b.min[axis];
                node.bounds[axis][1].0[slot] = b.max[axis];
            }
        }
        node
    }

    /// The triangles below a place, from left to right, and how many they are.
    fn block(&self, place: u32) -> ([u32; LANES], u32) {
        let mut primitives = [NO_PRIMITIVE; LANES];
        let mut count = 0;
        let mut stack = [place; LANES];
        let mut waiting = 1;
        while waiting > 0 {
            waiting -= 1;
            let node = &self.nodes[stack[waiting] as usize];
            if let Some(pair) = node.pair() {
                (stack[waiting], stack[waiting + 1]) = (2 * pair + 1, 2 * pair);
                waiting += 2;
            } else {
                primitives[count] = node.primitive();
                count += 1;
            }
        }
        (primitives, count as u32)
    }
}

#[cfg(test)]
mod tests;
