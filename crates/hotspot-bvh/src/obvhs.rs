//! The tree of the crate obvhs, at its medium settings: a second builder to compare ours with.
//!
//! It is built without its `parallel` feature: its parallel sorts are unstable, and the tree must not depend on the number of
//! threads.

use crate::binary::{BinaryNode, BinaryTree, Parents};
use glam::Vec3A;
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::PlocBuilder;

/// The tree over `count` leaves, which `leaf` makes.
pub(crate) fn build(count: usize, leaf: impl Fn(u32) -> BinaryNode) -> BinaryTree {
    if count == 0 {
        return BinaryTree { nodes: Vec::new(), parents: Parents::new(0) };
    }
    let boxes: Vec<Aabb> = (0..count as u32)
        .map(|index| {
            let bounds = leaf(index).bounds();
            Aabb::new(Vec3A::from_array(bounds.min), Vec3A::from_array(bounds.max))
        })
        .collect();
    let parameters = BvhBuildParams::medium_build();
    let mut theirs = PlocBuilder::with_capacity(count).build(
        parameters.ploc_search_distance,
        &boxes,
        (0..count as u32).collect(),
        parameters.sort_precision,
        parameters.search_depth_threshold,
    );
    // One triangle per leaf, no collapse: ours wants all the freedom it can get. The second reinsertion of their preset
    // follows their own collapse; its share is added to the first.
    ReinsertionOptimizer::default().run(&mut theirs, parameters.reinsertion_batch_ratio, None);
    let mut tree = BinaryTree { nodes: vec![BinaryNode::EMPTY; 2 * count], parents: Parents::new(count) };
    let mut inner = Vec::with_capacity(count);
    let mut open = vec![(0, 0)];
    let mut pair = 0;
    while let Some((index, place)) = open.pop() {
        let node = &theirs.nodes[index as usize];
        if node.prim_count > 0 {
            tree.nodes[place as usize] = leaf(theirs.primitive_indices[node.first_index as usize]);
            continue;
        }
        pair += 1;
        inner.push((place, pair));
        open.extend([(node.first_index, 2 * pair), (node.first_index + 1, 2 * pair + 1)]);
    }
    // Children come after their parents there.
    for (place, pair) in inner.into_iter().rev() {
        let children = 2 * pair as usize;
        let node = BinaryNode::parent_of(&tree.nodes[children], &tree.nodes[children + 1], pair);
        tree.put(place, &node);
    }
    tree
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::binary::tests::{Boxes, assert_whole};

    #[test]
    fn the_tree_is_whole() {
        for count in [1, 2, 3, 100, 1000] {
            let leaves = Boxes::new(count as u64).leaves(count, 0.1);
            assert_eq!(assert_whole(&build(count, |i| leaves[i as usize])), count as u32);
        }
        assert!(build(0, |_| BinaryNode::EMPTY).nodes.is_empty());
    }
}
