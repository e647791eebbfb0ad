//! Skins (glTF 2.0, section 3.7.3): vertices that follow joints, bent once and for all into world space.

use std::rc::Rc;

use gltf::Semantic;

use super::accessor::{self, Kind};
use super::animation::Poses;
use super::deform::{Skin, Vertices};
use super::document::Document;
use super::graph::{self, Affine, Placed};
use crate::error::{REEXPORT, Result, invalid};
use crate::notes::Notes;

/// Joints and where they stand. Worked out for the joints that are asked for: they need not belong to the scene.
pub(crate) struct Skins {
    /// By node.
    to_world: Vec<Option<Affine>>,
    /// By node, once a joint outside of the scene is met.
    parents: Option<Vec<Parent>>,
    /// By skin.
    known: Vec<Option<Rc<[Affine]>>>,
}

#[derive(Clone, Copy)]
enum Parent {
    None,
    One(usize),
    Several,
}

impl Skins {
    /// `placed` are the nodes of the scene.
    pub(crate) fn new(doc: &Document<'_>, placed: &[Placed]) -> Result<Self> {
        let nodes = doc.gltf.nodes().len();
        doc.budget.charge(nodes as u64, size_of::<Option<Affine>>() as u64, "nodes")?;
        let mut to_world = vec![None; nodes];
        for placed in placed {
            if let Some(slot) = to_world.get_mut(placed.node) {
                *slot = Some(placed.to_world);
            }
        }
        Ok(Self { to_world, parents: None, known: vec![None; doc.gltf.skins().len()] })
    }

    /// The skin at `index` with its joints where they stand.
    pub(crate) fn get(
        &mut self,
        doc: &Document<'_>,
        poses: &Poses,
        index: usize,
        notes: &mut Notes,
    ) -> Result<Skin> {
        if let Some(Some(matrices)) = self.known.get(index) {
            return Ok(Skin { index, matrices: matrices.clone() });
        }
        let path = format!("skins[{index}]");
        let Some(skin) = doc.gltf.as_json().skins.get(index) else {
            return Err(invalid(path, "there is no such skin", REEXPORT));
        };
        if skin.joints.is_empty() {
            return Err(invalid(format!("{path}.joints"), "the skin has no joints", REEXPORT));
        }
        doc.budget.charge(skin.joints.len() as u64, 2 * size_of::<Affine>() as u64, &path)?;
        let inverse = match skin.inverse_bind_matrices {
            Some(accessor) => Some(inverse_bind_matrices(doc, accessor.value(), &path, notes)?),
            None => None,
        };
        if let Some(inverse) = &inverse
            && inverse.len() < skin.joints.len()
        {
            return Err(invalid(
                format!("{path}.inverseBindMatrices"),
                format!("there are {} matrices for {} joints", inverse.len(), skin.joints.len()),
                REEXPORT,
            ));
        }
        let mut matrices = Vec::with_capacity(skin.joints.len());
        for (j, joint) in skin.joints.iter().enumerate() {
            let joint = self.place(doc, poses, joint.value(), &format!("{path}.joints[{j}]"), notes)?;
            matrices.push(match inverse.as_ref().and_then(|inverse| inverse.get(j)) {
                Some(inverse) => graph::multiply(&joint, inverse),
                None => joint,
            });
        }
        let matrices: Rc<[Affine]> = matrices.into();
        if let Some(slot) = self.known.get_mut(index) {
            *slot = Some(matrices.clone());
        }
        Ok(Skin { index, matrices })
    }

    /// Where a node stands, along its own parents where the scene does not reach it.
    fn place(
        &mut self,
        doc: &Document<'_>,
        poses: &Poses,
        node: usize,
        path: &str,
        notes: &mut Notes,
    ) -> Result<Affine> {
        let mut chain = Vec::new();
        let mut next = node;
        let mut matrix = loop {
            match self.to_world.get(next) {
                Some(Some(known)) => break *known,
                Some(None) => {}
                None => return Err(invalid(path, format!("nodes[{next}] does not exist"), REEXPORT)),
            }
            chain.push(next);
            if chain.len() > self.to_world.len() {
                return Err(invalid(path, "the joint's parents form a cycle", "give the tree a root"));
            }
            match self.parents.get_or_insert_with(|| parents(doc)).get(next) {
                Some(Parent::One(parent)) => next = *parent,
                Some(Parent::Several) => {
                    return Err(invalid(
                        path,
                        format!("nodes[{next}], which carries the joint, is a child of two parents"),
                        "give every node one parent",
                    ));
                }
                Some(Parent::None) | None => break graph::IDENTITY,
            }
        };
        while let Some(index) = chain.pop() {
            let Some(element) = doc.gltf.nodes().nth(index) else { continue };
            matrix = graph::multiply(&matrix, &graph::local(doc, poses, &element, notes));
            if !matrix.iter().flatten().all(|c| c.is_finite()) {
                return Err(invalid(
                    format!("nodes[{index}]"),
                    "the transform of the node overflows",
                    REEXPORT,
                ));
            }
            if let Some(slot) = self.to_world.get_mut(index) {
                *slot = Some(matrix);
            }
        }
        Ok(matrix)
    }
}

fn parents(doc: &Document<'_>) -> Vec<Parent> {
    let mut parents = vec![Parent::None; doc.gltf.nodes().len()];
    for node in doc.gltf.nodes() {
        for child in node.children() {
            if let Some(parent) = parents.get_mut(child.index()) {
                *parent = match parent {
                    Parent::None => Parent::One(node.index()),
                    Parent::One(_) | Parent::Several => Parent::Several,
                };
            }
        }
    }
    parents
}

fn inverse_bind_matrices(
    doc: &Document<'_>,
    accessor: usize,
    path: &str,
    notes: &mut Notes,
) -> Result<Vec<Affine>> {
    let path = format!("{path}.inverseBindMatrices");
    let Some(accessor) = doc.gltf.accessors().nth(accessor) else { return Ok(Vec::new()) };
    let stated = accessor::vectors::<16>(doc, &accessor, Kind::Float, notes)?;
    doc.budget.charge(stated.len() as u64, size_of::<Affine>() as u64, &path)?;
    let mut projective = 0;
    let mut matrices = Vec::with_capacity(stated.len());
    for matrix in stated {
        let m = matrix.map(f64::from);
        if !m.iter().all(|c| c.is_finite()) {
            return Err(invalid(path, "a matrix is not finite", REEXPORT));
        }
        let [a, b, c, d] = [0, 4, 8, 12].map(|i| [m[i], m[i + 1], m[i + 2], m[i + 3]]);
        projective += u64::from([a[3], b[3], c[3], d[3]] != [0.0, 0.0, 0.0, 1.0]);
        matrices.push([0, 1, 2].map(|row| [a[row], b[row], c[row], d[row]]));
    }
    notes.repair("projective part of a matrix ignored", &path, projective);
    Ok(matrices)
}

/// True when a primitive says how it follows joints.
pub(crate) fn is_bound(primitive: &gltf::Primitive<'_>) -> bool {
    primitive.get(&Semantic::Joints(0)).is_some() || primitive.get(&Semantic::Weights(0)).is_some()
}

/// Joints and weights of all vertices: one set of four for each `JOINTS_n`.
struct Influences {
    sets: Vec<Set>,
}

/// Four joints and their weights for each vertex.
struct Set {
    joints: Vec<[f32; 4]>,
    weights: Vec<[f32; 4]>,
}

impl Influences {
    fn read(
        doc: &Document<'_>,
        primitive: &gltf::Primitive<'_>,
        path: &str,
        vertices: usize,
        notes: &mut Notes,
    ) -> Result<Self> {
        let mut sets = Vec::new();
        for set in 0u32.. {
            let joints = primitive.get(&Semantic::Joints(set));
            let weights = primitive.get(&Semantic::Weights(set));
            let (joints, weights) = match (joints, weights) {
                (None, None) => break,
                (Some(joints), Some(weights)) => (joints, weights),
                (joints, _) => {
                    let missing = if joints.is_some() { "WEIGHTS" } else { "JOINTS" };
                    let path = format!("{path}.attributes.{missing}_{set}");
                    return Err(invalid(path, "this is missing: joints and weights go together", REEXPORT));
                }
            };
            let joints = accessor::vectors::<4>(doc, &joints, Kind::Joint, notes)?;
            let weights = accessor::vectors::<4>(doc, &weights, Kind::Share, notes)?;
            for (name, count) in [("JOINTS", joints.len()), ("WEIGHTS", weights.len())] {
                if count != vertices {
                    return Err(invalid(
                        format!("{path}.attributes.{name}_{set}"),
                        format!("there are {count} for {vertices} positions"),
                        REEXPORT,
                    ));
                }
            }
            sets.push(Set { joints, weights });
        }
        Ok(Self { sets })
    }

    /// Joint and weight of what moves a vertex.
    fn of(&self, vertex: usize) -> impl Iterator<Item = (f32, f32)> {
        self.sets.iter().flat_map(move |set| {
            let joints = set.joints.get(vertex).copied().unwrap_or_default();
            let weights = set.weights.get(vertex).copied().unwrap_or_default();
            joints.into_iter().zip(weights)
        })
    }
}

/// Sums of weights may be off by what rounding four of them to 8 bits leaves.
const WEIGHT_TOLERANCE: f64 = 0.01;

/// Bends the vertices of a primitive into world space. Returns which of them are mirrored.
pub(crate) fn apply(
    doc: &Document<'_>,
    primitive: &gltf::Primitive<'_>,
    path: &str,
    joints: &[Affine],
    vertices: &mut Vertices,
    notes: &mut Notes,
) -> Result<Vec<bool>> {
    let count = vertices.positions.len();
    let influences = Influences::read(doc, primitive, path, count, notes)?;
    doc.budget.charge(count as u64, 1, path)?;
    let mut mirrored = vec![false; count];
    let (mut unusable, mut off, mut free) = (0, 0, 0);
    for (v, position) in vertices.positions.iter_mut().enumerate() {
        let mut sum = 0.0;
        let mut matrix = [[0.0f64; 4]; 3];
        for (joint, weight) in influences.of(v) {
            if weight == 0.0 {
                continue;
            }
            if !(weight > 0.0 && weight.is_finite()) {
                unusable += 1;
                continue;
            }
            add(&mut matrix, at(joints, joint, v, path)?, f64::from(weight));
            sum += f64::from(weight);
        }
        off += u64::from(sum > 0.0 && (sum - 1.0).abs() > WEIGHT_TOLERANCE);
        if sum > 0.0 {
            for c in matrix.iter_mut().flatten() {
                *c /= sum;
            }
        } else {
            // Nothing holds it: the joint that stands first does.
            free += 1;
            let first = influences.of(v).next().map_or(0.0, |(joint, _)| joint);
            matrix = *at(joints, first, v, path)?;
        }
        let p = position.map(f64::from);
        *position = matrix.map(|m| (m[0] * p[0] + m[1] * p[1] + m[2] * p[2] + m[3]) as f32);
        let (cofactors, determinant) = cofactors(&matrix);
        let sign = if determinant < 0.0 { -1.0 } else { 1.0 };
        if let Some(flag) = mirrored.get_mut(v) {
            *flag = determinant < 0.0;
        }
        // The inverse transpose is the cofactors over the determinant; the length does not matter.
        if let Some(normal) = vertices.normals.as_mut().and_then(|normals| normals.get_mut(v)) {
            *normal = shortened(product(&cofactors, normal.map(f64::from)).map(|c| c * sign));
        }
        if let Some(tangent) = vertices.tangents.as_mut().and_then(|tangents| tangents.get_mut(v)) {
            let [x, y, z, w] = tangent.map(f64::from);
            let linear = matrix.map(|row| [row[0], row[1], row[2]]);
            let [x, y, z] = shortened(product(&linear, [x, y, z]));
            *tangent = [x, y, z, (w * sign) as f32];
        }
    }
    notes.repair("negative or NaN weights of joints set to 0", path, unusable);
    notes.repair("weights of joints scaled to the sum 1", path, off);
    notes.repair("vertices without joints follow their first one", path, free);
    Ok(mirrored)
}

fn at<'j>(joints: &'j [Affine], joint: f32, vertex: usize, path: &str) -> Result<&'j Affine> {
    // Whole numbers below 2¹⁶.
    joints.get(joint as usize).ok_or_else(|| {
        invalid(
            format!("{path}.attributes.JOINTS_0"),
            format!("vertex {vertex} follows joint {joint}, the skin has {}", joints.len()),
            REEXPORT,
        )
    })
}

fn add(sum: &mut Affine, matrix: &Affine, weight: f64) {
    for (sum, c) in sum.iter_mut().flatten().zip(matrix.iter().flatten()) {
        *sum += weight * c;
    }
}

/// The cofactors of the linear part, and its determinant.
fn cofactors(m: &Affine) -> ([[f64; 3]; 3], f64) {
    let cross = |a: &[f64; 4], b: &[f64; 4]| {
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    };
    let rows = [cross(&m[1], &m[2]), cross(&m[2], &m[0]), cross(&m[0], &m[1])];
    let determinant = m[0][0] * rows[0][0] + m[0][1] * rows[0][1] + m[0][2] * rows[0][2];
    (rows, determinant)
}

fn product(m: &[[f64; 3]; 3], v: [f64; 3]) -> [f64; 3] {
    m.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

/// The direction of a vector, within f32's range.
fn shortened(v: [f64; 3]) -> [f32; 3] {
    let largest = v.iter().fold(0.0f64, |largest, c| largest.max(c.abs()));
    v.map(|c| (if largest > 0.0 { c / largest } else { 0.0 }) as f32)
}
