//! From triangles to a tree: [`crate::ploc`] builds a binary one with a primitive per leaf, [`crate::reinsertion`] betters it,
//! [`crate::collapse`] makes it wide.
//!
//! Boxes are minima and maxima of coordinates all the way, hence exact. Where coordinates are so large that areas would
//! overflow, or the tree is a shuffled one, the first two see scaled and turned boxes and only decide the topology.

use crate::binary::BinaryNode;
use crate::collapse::{Primitives, WideTree, collapse};
use crate::instance::{Instance, Placed};
use crate::node::{Bounds, Child};
use crate::shuffle::Shuffle;
use crate::simd::Isa;
use crate::{Bvh, BvhError, ploc, reinsertion, tasks};

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

    const fn parameters(self) -> Parameters {
        match self {
            Self::Fast => Parameters { distance: 2, reinserted: 0.01 },
            Self::Medium => Parameters { distance: 6, reinserted: 0.05 },
            Self::High => Parameters { distance: 14, reinserted: 0.2 },
        }
    }
}

/// What a quality stands for.
struct Parameters {
    /// How far nodes search for a neighbour to merge with.
    distance: usize,
    /// The share of nodes that are moved to a better place in the first round.
    reinserted: f32,
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
    let finite = |t: &[[f32; 3]; 3]| t.iter().flatten().all(|c| c.is_finite());
    // Without an early end, so that it is a loop of vectors.
    let all = |chunk: &[[[f32; 3]; 3]]| {
        chunk.as_flattened().as_flattened().iter().fold(true, |all, c| all & c.is_finite())
    };
    if tasks::fold(triangles, || true, all, |a, b| a && b) {
        return Ok(());
    }
    match triangles.iter().position(|t| !finite(t)) {
        Some(triangle) => Err(BvhError::NotFinite { mesh, triangle }),
        None => Ok(()),
    }
}

/// The tree over triangles and, numbered behind them, instances.
fn wide_tree(triangles: &[[[f32; 3]; 3]], instances: &[Bounds], options: BuildOptions) -> WideTree {
    let bounds = |primitive: u32| match triangles.get(primitive as usize) {
        Some(triangle) => Bounds::of_points(triangle),
        None => instances[primitive as usize - triangles.len()],
    };
    let mut leaves = tasks::map(triangles, |i, t| BinaryNode::leaf(&Bounds::of_points(t), i as u32));
    leaves.extend(
        instances.iter().zip(triangles.len() as u32..).map(|(bounds, i)| BinaryNode::leaf(bounds, i)),
    );
    let parameters = options.quality.parameters();
    let largest = tasks::fold(&leaves, || 0.0, largest_coordinate, f32::max);
    let as_they_are = largest <= SAFE_COORDINATE && options.shuffle.is_none();
    if !as_they_are {
        // A power of two, so that scaling does not round.
        let mut scale = 1.0f32;
        while largest * scale > SAFE_COORDINATE {
            scale *= 1.0 / 1024.0;
        }
        let shuffle = options.shuffle.map(|seed| Shuffle::new(seed, leaves.len()));
        let order = |place: u32| shuffle.as_ref().map_or(place, |s| s.order()[place as usize]);
        let turned = |b: &Bounds| shuffle.as_ref().map_or(*b, |s| s.turned(b));
        leaves = tasks::map(&leaves, |place, _| {
            let primitive = order(place as u32);
            BinaryNode::leaf(&turned(&bounds(primitive)).scaled(scale), primitive)
        });
    }
    let mut nodes = ploc::build(leaves, parameters.distance);
    reinsertion::optimize(&mut nodes, parameters.reinserted);
    if !as_they_are {
        for node in &mut nodes {
            if node.pair().is_none() {
                node.set_bounds(&bounds(node.primitive()));
            }
        }
    }
    collapse(&nodes, Primitives { triangles })
}

fn largest_coordinate(leaves: &[BinaryNode]) -> f32 {
    leaves.iter().fold(0.0, |largest, leaf| leaf.largest_coordinate().max(largest))
}
