//! The collapse against trying everything, and what its child words say.

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
                    .map(|left| least(tree, first, left, known) + least(tree, first + 1, most - left, known))
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
                        let bvh = Bvh::build_instanced(&many[..world], &meshes, &instances, options).unwrap();
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
