//! From triangles to a tree: obvhs builds the binary tree, [`crate::collapse`] makes it wide.
//!
//! obvhs only decides the topology; all boxes are computed here from the vertices, so that their exactness does not
//! depend on it. It is built without its `parallel` feature: its parallel sorts are unstable, and the tree must not
//! depend on the number of threads.

use crate::collapse::{BinaryNode, BinaryTree, collapse};
use crate::node::{Bounds, Child};
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
}

/// obvhs computes areas in f32; coordinates up to this keep them finite. Larger scenes are scaled for the topology.
const SAFE_COORDINATE: f32 = 1e15;

pub(crate) fn build(triangles: &[[[f32; 3]; 3]], options: BuildOptions) -> Result<Bvh, BvhError> {
    if triangles.len() >= Child::LIMIT as usize {
        return Err(BvhError::TooManyTriangles { count: triangles.len() });
    }
    if let Some(index) = triangles.iter().position(|t| !t.iter().flatten().all(|c| c.is_finite())) {
        return Err(BvhError::NotFinite { triangle: index });
    }
    let largest = triangles.iter().flatten().flatten().fold(0.0f32, |m, c| m.max(c.abs()));
    // A power of two, so that scaling does not round.
    let mut scale = 1.0f32;
    while largest * scale > SAFE_COORDINATE {
        scale *= 1.0 / 1024.0;
    }
    let boxes: Vec<Aabb> = triangles
        .iter()
        .map(|t| {
            let b = Bounds::of_points(t);
            Aabb::new(Vec3A::from_array(b.min) * scale, Vec3A::from_array(b.max) * scale)
        })
        .collect();
    let wide = collapse(&binary_tree(&boxes, options.quality.parameters()), triangles);
    Ok(Bvh {
        nodes: wide.nodes,
        blocks: wide.blocks,
        root: wide.root,
        bounds: wide.bounds,
        triangles: triangles.len(),
        isa: options.isa.resolve(),
    })
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
