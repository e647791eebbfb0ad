//! From triangles to a tree: obvhs builds the binary tree, [`crate::collapse`] makes it wide.
//!
//! obvhs only decides the topology; all boxes are computed here from the vertices, so that their exactness does not
//! depend on it. It is built without its `parallel` feature: its parallel sorts are unstable, and the tree must not
//! depend on the number of threads.

use crate::collapse::{BinaryNode, BinaryTree, Primitives, WideTree, collapse};
use crate::instance::{Instance, Placed};
use crate::node::{Bounds, Child};
use crate::shuffle::Shuffle;
use crate::simd::Isa;
use crate::{Bvh, BvhError};
use glam::Vec3A;
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::PlocBuilder;

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
}

impl Quality {
    /// Name as shown in outputs.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Fast => "fast",
            Self::Medium => "medium",
            Self::High => "high",
        }
    }

    const fn parameters(self) -> BvhBuildParams {
        match self {
            Self::Fast => BvhBuildParams::very_fast_build(),
            Self::Medium => BvhBuildParams::medium_build(),
            Self::High => BvhBuildParams::slow_build(),
        }
    }
}

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

/// obvhs computes areas in f32; coordinates up to this keep them finite. Larger scenes are scaled for the topology.
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
    let total = instances.len().saturating_add(triangles.len());
    if total >= Child::LIMIT as usize {
        return Err(BvhError::TooManyInstances { count: instances.len() });
    }
    check(triangles, None)?;
    let mut tree = WideTree::default();
    // Each mesh's root, and boxes that enclose it between them.
    let mut roots = Vec::with_capacity(meshes.len());
    for (index, mesh) in meshes.iter().enumerate() {
        let mesh = mesh.as_ref();
        check(mesh, Some(index))?;
        let part = wide_tree(mesh, &[], options);
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
    let top = wide_tree(triangles, &bounds, options);
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

fn check(triangles: &[[[f32; 3]; 3]], mesh: Option<usize>) -> Result<(), BvhError> {
    match triangles.iter().position(|t| !t.iter().flatten().all(|c| c.is_finite())) {
        Some(triangle) => Err(BvhError::NotFinite { mesh, triangle }),
        None => Ok(()),
    }
}

fn wide_tree(triangles: &[[[f32; 3]; 3]], instances: &[Bounds], options: BuildOptions) -> WideTree {
    let mut bounds = Vec::with_capacity(triangles.len() + instances.len());
    bounds.extend(triangles.iter().map(|t| Bounds::of_points(t)));
    bounds.extend_from_slice(instances);
    let largest = bounds.iter().flat_map(|b| [b.min, b.max]).flatten().fold(0.0f32, |m, c| m.max(c.abs()));
    // A power of two, so that scaling does not round.
    let mut scale = 1.0f32;
    while largest * scale > SAFE_COORDINATE {
        scale *= 1.0 / 1024.0;
    }
    let boxes: Vec<Aabb> = bounds
        .iter()
        .map(|b| Aabb::new(Vec3A::from_array(b.min) * scale, Vec3A::from_array(b.max) * scale))
        .collect();
    let parameters = options.quality.parameters();
    let binary = match options.shuffle {
        None => binary_tree(&boxes, parameters),
        Some(seed) => {
            let shuffle = Shuffle::new(seed, boxes.len());
            shuffle.undo(binary_tree(&shuffle.boxes(&boxes), parameters))
        }
    };
    collapse(&binary, Primitives { triangles, bounds: &bounds })
}

fn binary_tree(boxes: &[Aabb], parameters: BvhBuildParams) -> BinaryTree {
    if boxes.is_empty() {
        return BinaryTree { nodes: Vec::new(), order: Vec::new() };
    }
    let mut bvh2 = PlocBuilder::with_capacity(boxes.len()).build(
        parameters.ploc_search_distance,
        boxes,
        (0..boxes.len() as u32).collect(),
        parameters.sort_precision,
        parameters.search_depth_threshold,
    );
    // One triangle per leaf, no collapse: the wide collapse wants all the freedom it can get. The second reinsertion
    // pass of obvhs's presets follows its own collapse; its share is added to the first.
    let ratio = parameters.reinsertion_batch_ratio;
    ReinsertionOptimizer::default().run(&mut bvh2, ratio, None);
    BinaryTree {
        nodes: bvh2.nodes.iter().map(|n| BinaryNode { first: n.first_index, count: n.prim_count }).collect(),
        order: bvh2.primitive_indices,
    }
}
