//! From triangles to a tree: [`crate::ploc`] builds a binary one with a primitive per leaf, [`crate::reinsertion`] betters it,
//! [`crate::collapse`] makes it wide.
//!
//! Boxes are minima and maxima of coordinates all the way, hence exact. Where coordinates are so large that areas would
//! overflow, or the tree is a shuffled one, the first two see scaled and turned boxes and only decide the topology.

use crate::binary::{BinaryNode, BinaryTree};
use crate::collapse::{Primitives, WideTree, collapse};
use crate::instance::{Instance, Placed};
use crate::node::{Bounds, Child};
use crate::shuffle::Shuffle;
use crate::simd::Isa;
use crate::{Bvh, BvhError, obvhs, ploc, reinsertion, tasks};
use core::ops::Range;

/// How much time to spend on the tree.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Quality {
    /// For previews.
    Fast,
    /// For most renders.
    #[default]
    Medium,
    /// For long renders.
    High,
    /// By the crate obvhs at its medium settings, for comparison: twice the time of [`Quality::Medium`].
    Obvhs,
}

impl Quality {
    /// Name as shown in outputs.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Fast => "fast",
            Self::Medium => "medium",
            Self::High => "high",
            Self::Obvhs => "obvhs",
        }
    }

    /// The binary tree over `count` leaves, which `leaf` makes, more than once.
    fn binary_tree(self, count: usize, leaf: impl Fn(u32) -> BinaryNode + Sync + Send) -> BinaryTree {
        // How far nodes search for a neighbour to merge with, and the share of nodes that are moved to a better place in
        // the first round.
        let (distance, reinserted) = match self {
            Self::Fast => (2, 0.01),
            Self::Medium => (6, 0.03),
            Self::High => (14, 0.2),
            Self::Obvhs => return obvhs::build(count, leaf),
        };
        // Small trees, which are built in no time, are bettered as far as can be.
        let share = f32::max(reinserted, SMALL / count as f32);
        let mut tree = ploc::build(count, leaf, distance);
        reinsertion::optimize(&mut tree, share.min(1.0));
        tree
    }
}

/// Leaves up to which all nodes are looked at in the first round; of more leaves at least so many and their parents.
const SMALL: f32 = 2048.0;

/// How to build and traverse.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct BuildOptions {
    /// How much time to spend on the tree.
    pub quality: Quality,
    /// Instruction set of the traversal; all give the same hits and counts.
    pub isa: Isa,
    /// Builds another tree of the same quality, one for each number: hits are the same, counts are not. `None`: the tree
    /// that everyone gets. Builds of
    /// several show how much of a cost is the luck of the tree (`shuffle.rs`).
    pub shuffle: Option<u64>,
}

/// Topologies are chosen by areas in f32; coordinates up to this keep them finite. Larger scenes are scaled for the topology.
const SAFE_COORDINATE: f32 = 1e15;

pub(crate) fn build<M: AsRef<[[[f32; 3]; 3]]>>(
    triangles: &[[[f32; 3]; 3]],
    meshes: &[M],
    instances: &[Instance],
    options: BuildOptions,
) -> Result<Bvh, BvhError> {
    let count = meshes.iter().fold(triangles.len(), |sum, mesh| sum.saturating_add(mesh.as_ref().len()));
    if count >= Child::LIMIT as usize {
        return Err(BvhError::TooManyTriangles { count });
    }
    // Inner nodes are fewer than that, however the tree turns out.
    let total = instances.len().saturating_add(count);
    if total >= Child::LIMIT as usize {
        return Err(BvhError::TooManyInstances { count: instances.len() });
    }
    let mut largest = check(triangles, None)?;
    let mut tree = WideTree::default();
    // Each mesh's root, and boxes that enclose it between them.
    let mut roots = Vec::with_capacity(meshes.len());
    for (index, mesh) in meshes.iter().enumerate() {
        let mesh = mesh.as_ref();
        let largest = check(mesh, Some(index))?;
        let part = wide_tree(mesh, &[], largest, options);
        let boxes = part.boxes_near_the_root();
        roots.push((tree.append(part), boxes));
    }
    let mut placed = Vec::with_capacity(instances.len());
    for (index, instance) in instances.iter().enumerate() {
        let (root, boxes) =
            roots.get(instance.mesh as usize).ok_or(BvhError::NoSuchMesh { instance: index })?;
        if *root == Child::EMPTY {
            return Err(BvhError::EmptyMesh { instance: index });
        }
        let instance = Placed::new(*root, boxes, &instance.to_world);
        placed.push(instance.ok_or(BvhError::NotInvertible { instance: index })?);
    }
    let bounds: Vec<Bounds> = placed.iter().map(|p| p.bounds).collect();
    for b in &bounds {
        largest = b.min.iter().chain(&b.max).fold(largest, |largest, c| largest.max(c.abs()));
    }
    let top = wide_tree(triangles, &bounds, largest, options);
    let bounds = top.bounds;
    let (whole, root) = if tree.blocks.is_empty() {
        let root = top.root;
        (top, root)
    } else {
        let mut whole =
            WideTree::with_capacity(tree.nodes.len() + top.nodes.len(), tree.blocks.len() + top.blocks.len());
        // First: nothing moves, so that the roots above stay true.
        whole.append(tree);
        let root = whole.append(top);
        (whole, root)
    };
    Ok(Bvh {
        nodes: whole.nodes,
        blocks: whole.blocks,
        root,
        instances: placed,
        bounds,
        triangles: count,
        isa: options.isa.resolve(),
    })
}

/// The largest magnitude of a coordinate.
fn check(triangles: &[[[f32; 3]; 3]], mesh: Option<usize>) -> Result<f32, BvhError> {
    // Magnitudes are in the order of their bits, and what is not finite comes last.
    let largest_of = |range: Range<u32>| {
        let coordinates = triangles[range.start as usize..range.end as usize].as_flattened().as_flattened();
        coordinates.iter().fold(0, |largest, c| (c.to_bits() & i32::MAX as u32).cast_signed().max(largest))
    };
    let largest = tasks::fold(triangles.len() as u32, || 0, largest_of, i32::max);
    let largest = f32::from_bits(largest.cast_unsigned());
    if largest.is_finite() {
        return Ok(largest);
    }
    let triangle = triangles.iter().position(|t| !t.iter().flatten().all(|c| c.is_finite()));
    Err(BvhError::NotFinite { mesh, triangle: triangle.unwrap_or_default() })
}

/// The tree over triangles and, numbered behind them, instances, all of whose coordinates are at most `largest` in magnitude.
fn wide_tree(
    triangles: &[[[f32; 3]; 3]],
    instances: &[Bounds],
    largest: f32,
    options: BuildOptions,
) -> WideTree {
    let count = triangles.len() + instances.len();
    let bounds = |primitive: u32| match triangles.get(primitive as usize) {
        Some(triangle) => Bounds::of_points(triangle),
        None => instances[primitive as usize - triangles.len()],
    };
    let tree = if largest <= SAFE_COORDINATE && options.shuffle.is_none() {
        let leaf = |i: u32| match triangles.get(i as usize) {
            Some(triangle) => BinaryNode::of_triangle(triangle, i),
            None => BinaryNode::leaf(&bounds(i), i),
        };
        options.quality.binary_tree(count, leaf)
    } else {
        // A power of two, so that scaling does not round.
        let mut scale = 1.0f32;
        while largest * scale > SAFE_COORDINATE {
            scale *= 1.0 / 1024.0;
        }
        let shuffle = options.shuffle.map(|seed| Shuffle::new(seed, count));
        let leaf = |i: u32| {
            let (primitive, bounds) = match &shuffle {
                Some(shuffle) => {
                    let primitive = shuffle.order()[i as usize];
                    (primitive, shuffle.turned(&bounds(primitive)))
                }
                None => (i, bounds(i)),
            };
            BinaryNode::leaf(&bounds.scaled(scale), primitive)
        };
        let mut tree = options.quality.binary_tree(count, leaf);
        tree.set_bounds(bounds);
        tree
    };
    // Only the nodes are wanted from here on.
    let nodes = tree.nodes;
    collapse(&nodes, Primitives { triangles })
}
