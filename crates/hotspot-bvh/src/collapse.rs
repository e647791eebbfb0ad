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
mod tests {
    use super::*;
    use crate::plan::{BLOCK_COST, INSTANCE_COST, NODE_COST};
    use crate::{BuildOptions, Bvh, Instance, Quality};

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

    /// Primitives below a child of the wide tree.
    fn held(tree: &WideTree, child: Child) -> u32 {
        if child.is_instance() {
            1
        } else if child.is_leaf() {
            let used = tree.blocks[child.index()].primitives.iter().filter(|&&p| p != NO_PRIMITIVE);
            used.count() as u32
        } else {
            tree.nodes[child.index()].occupied().map(|(_, child)| held(tree, child)).sum()
        }
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
                    let used = |p: &&u32| **p != NO_PRIMITIVE;
                    seen.extend(wide.blocks[child.index()].primitives.iter().filter(used));
                    cost += bounds.half_area() * BLOCK_COST;
                } else {
                    let slots: Vec<_> = wide.nodes[child.index()].occupied().collect();
                    let rank = |(bounds, child): &(Bounds, Child)| {
                        let area = bounds.half_area() / f64::from(held(&wide, *child));
                        (!child.is_leaf() || child.is_instance(), -area)
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

    /// Every child word below `root` tells how many boxes or triangles there are; how many nodes and blocks were seen.
    fn assert_numbers(bvh: &Bvh, root: Child) -> [usize; 2] {
        let (mut open, mut seen) = (vec![root], [0; 2]);
        while let Some(child) = open.pop() {
            if child.is_instance() {
                // An instance, or the root of nothing.
                continue;
            }
            let counted = if child.is_leaf() {
                seen[1] += 1;
                bvh.block_triangles(child.index() as u32).count()
            } else {
                seen[0] += 1;
                let node = &bvh.nodes[child.index()];
                assert_eq!(child.node_index(), child.index());
                open.extend(node.occupied().map(|(_, child)| child));
                // As a traversal finds them: unused boxes are inside out.
                node.bounds[0][0].0.iter().zip(node.bounds[0][1].0).filter(|(min, max)| **min <= *max).count()
            };
            assert_eq!(child.number() as usize, counted, "{child:?}");
        }
        seen
    }

    #[test]
    fn children_tell_how_many_there_are() {
        let mut state = 7;
        let mut soup = |count: usize| -> Vec<[[f32; 3]; 3]> {
            (0..count)
                .map(|_| {
                    let corner: [f32; 3] = core::array::from_fn(|_| random(&mut state, 100_000) as f32);
                    core::array::from_fn(|_| {
                        core::array::from_fn(|i| corner[i] + random(&mut state, 3000) as f32)
                    })
                })
                .collect()
        };
        let many = soup(40_000);
        let meshes = [soup(20_000), soup(1), soup(8), soup(9)];
        let instances: Vec<Instance> = (0..300)
            .map(|i| {
                let [x, y] = [f64::from(i % 20), f64::from(i / 20)].map(|c| c * 1e4);
                let to_world = [[1.0, 0.0, 0.0, x], [0.0, 1.0, 0.0, y], [0.0, 0.0, 0.1, 0.0]];
                Instance { mesh: i % 4, to_world }
            })
            .collect();
        let mut parts = 0;
        for threads in [1, 4] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                for quality in [Quality::Fast, Quality::Medium, Quality::High, Quality::Obvhs] {
                    for shuffle in [None, Some(3)] {
                        let options = BuildOptions { quality, shuffle, ..BuildOptions::default() };
                        for count in [0, 1, 2, 7, 8, 9, 100, 5000, many.len()] {
                            let bvh = Bvh::build(&many[..count], options).unwrap();
                            let seen = assert_numbers(&bvh, bvh.root);
                            assert_eq!(seen, [bvh.nodes.len(), bvh.blocks.len()]);
                        }
                        for world in [0, 5, 6000] {
                            let bvh =
                                Bvh::build_instanced(&many[..world], &meshes, &instances, options).unwrap();
                            let mut seen = assert_numbers(&bvh, bvh.root);
                            for placed in &bvh.instances[..4] {
                                let below = assert_numbers(&bvh, placed.root);
                                seen = [seen[0] + below[0], seen[1] + below[1]];
                            }
                            assert_eq!(seen, [bvh.nodes.len(), bvh.blocks.len()]);
                        }
                    }
                }
                // The largest trees are made of several runs where there are several threads.
                parts += u32::from(part_size(&vec![BinaryNode::EMPTY; 2 * many.len()]) < many.len() as u32);
            });
        }
        assert_eq!(parts, 1);
    }

    #[test]
    fn words_keep_their_parts_and_are_in_order_of_kind_and_index() {
        let last = Child::LIMIT - 1;
        let mut before = None;
        for (make, leaf, instance) in [
            (Child::node as fn(u32, u32) -> Child, false, false),
            (Child::leaf, true, false),
            (|index, _| Child::instance(index), true, true),
        ] {
            for index in [0, 1, 2, last - 1, last] {
                let numbers = if instance { 1..=1 } else { 1..=8 };
                let words: Vec<Child> = numbers.map(|number| make(index, number)).collect();
                for (word, number) in words.iter().zip(1..) {
                    assert_eq!((word.is_leaf(), word.is_instance()), (leaf, instance));
                    assert_eq!((word.index(), word.number()), (index as usize, number));
                    assert_eq!(word.offset(224), index as usize * 224);
                    assert!(before < Some(word.0) && *word != Child::EMPTY);
                    let moved = if instance { index / 2 } else { index / 2 + 3 };
                    assert_eq!(make(index / 2, number).moved(3, 3), make(moved, number));
                }
                before = words.last().map(|word| word.0);
            }
        }
        assert!(before < Some(Child::EMPTY.0));
    }
}
