//! What bends a node's mesh: weights of morph targets, and joints. Each node then has a mesh of its own; nodes that bend
//! the same mesh in the same way share it.

use std::rc::Rc;

use super::document::Document;
use super::graph::Affine;
use super::{morph, skin};
use crate::error::Result;
use crate::notes::Notes;

/// A mesh's vertices on their way from the file to the scene.
pub(crate) struct Vertices {
    pub(crate) positions: Vec<[f32; 3]>,
    pub(crate) normals: Option<Vec<[f32; 3]>>,
    /// x, y, z and the bitangent's sign.
    pub(crate) tangents: Option<Vec<[f32; 4]>>,
}

/// How a node bends its mesh.
#[derive(Clone, Default)]
pub(crate) struct Deformation {
    /// Weights of the morph targets; empty where all are 0. Primitives of fewer targets use the first of them.
    pub(crate) weights: Rc<[f64]>,
    pub(crate) skin: Option<Skin>,
}

/// Joints at their places.
#[derive(Clone)]
pub(crate) struct Skin {
    /// Index in the file.
    pub(crate) index: usize,
    /// Mesh space at rest to world space, for each joint.
    pub(crate) matrices: Rc<[Affine]>,
}

/// Deformed primitives that agree in this are the same.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Key {
    mesh: usize,
    primitive: usize,
    weights: Vec<u64>,
    skin: Option<usize>,
}

impl Deformation {
    /// What tells deformed primitives apart; `None` where nothing is bent.
    pub(crate) fn key(
        &self,
        doc: &Document<'_>,
        primitive: &gltf::Primitive<'_>,
        mesh: usize,
        path: &str,
    ) -> Result<Option<Key>> {
        let mut weights = morph::used(primitive, &self.weights);
        if weights.iter().all(|weight| *weight == 0.0) {
            weights = &[];
        }
        if weights.is_empty() && self.skin.is_none() {
            return Ok(None);
        }
        doc.budget.charge(weights.len() as u64, size_of::<u64>() as u64, path)?;
        let weights = weights.iter().map(|weight| weight.to_bits()).collect();
        let skin = self.skin.as_ref().map(|skin| skin.index);
        Ok(Some(Key { mesh, primitive: primitive.index(), weights, skin }))
    }

    /// Bends the vertices of a primitive. Returns which of them are mirrored; empty where none can be.
    pub(crate) fn apply(
        &self,
        doc: &Document<'_>,
        primitive: &gltf::Primitive<'_>,
        path: &str,
        vertices: &mut Vertices,
        notes: &mut Notes,
    ) -> Result<Vec<bool>> {
        if !self.weights.is_empty() {
            morph::apply(doc, primitive, path, &self.weights, vertices, notes)?;
        }
        match &self.skin {
            Some(skin) => skin::apply(doc, primitive, path, &skin.matrices, vertices, notes),
            None => Ok(Vec::new()),
        }
    }
}

/// Turns triangles round whose corners (most of them) are mirrored, so that the front stays the front.
pub(crate) fn turn_mirrored(triangles: &mut [[u32; 3]], mirrored: &[bool]) {
    if !mirrored.contains(&true) {
        return;
    }
    for triangle in triangles {
        let count = triangle.iter().filter(|corner| mirrored.get(**corner as usize) == Some(&true)).count();
        if count >= 2 {
            triangle.swap(1, 2);
        }
    }
}
