//! Morph targets (glTF 2.0, sections 3.7.2.2 and 3.7.4): weighted differences added to a mesh's vertices.

use std::collections::HashMap;
use std::rc::Rc;

use serde_json::Value;

use super::accessor::{self, Kind};
use super::deform::Vertices;
use super::document::Document;
use crate::error::{REEXPORT, Result, invalid};
use crate::notes::Notes;

/// Weights that meshes state themselves, by mesh, once they are asked for.
pub(crate) type MeshWeights = HashMap<usize, Rc<[f64]>>;

/// The weights that a node gives to its mesh's targets: animated ones, else the node's, else the mesh's. Empty where all
/// are 0.
pub(crate) fn weights(
    doc: &Document<'_>,
    node: usize,
    mesh: &gltf::Mesh<'_>,
    animated: Option<&[f64]>,
    known: &mut MeshWeights,
) -> Result<Rc<[f64]>> {
    // One more than there are targets still tells that there are too many.
    let most = || mesh.primitives().map(|primitive| primitive.morph_targets().len() + 1).max().unwrap_or(0);
    let collect = |path: &str, stated: &mut dyn Iterator<Item = f64>| -> Result<Rc<[f64]>> {
        let weights: Vec<f64> = stated.take(most()).collect();
        // Twice for a moment.
        doc.budget.charge(weights.len() as u64, 2 * size_of::<f64>() as u64, path)?;
        Ok(if weights.iter().any(|weight| *weight != 0.0) { weights.into() } else { Rc::default() })
    };
    let number = |weight: &Value| weight.as_f64().unwrap_or_default();
    let stated = |array, index| doc.member(array, index, "weights").and_then(Value::as_array);
    if let Some(animated) = animated {
        return collect(&format!("nodes[{node}]"), &mut animated.iter().copied());
    }
    if let Some(stated) = stated("nodes", node) {
        return collect(&format!("nodes[{node}].weights"), &mut stated.iter().map(number));
    }
    let Some(stated) = stated("meshes", mesh.index()) else { return Ok(Rc::default()) };
    if let Some(known) = known.get(&mesh.index()) {
        return Ok(Rc::clone(known));
    }
    let weights = collect(&format!("meshes[{}].weights", mesh.index()), &mut stated.iter().map(number))?;
    known.insert(mesh.index(), Rc::clone(&weights));
    Ok(weights)
}

/// Those of a mesh's weights that belong to targets of the primitive.
pub(crate) fn used<'w>(primitive: &gltf::Primitive<'_>, weights: &'w [f64]) -> &'w [f64] {
    weights.get(..primitive.morph_targets().len()).unwrap_or(weights)
}

/// Adds the targets of a primitive to its vertices.
pub(crate) fn apply(
    doc: &Document<'_>,
    primitive: &gltf::Primitive<'_>,
    path: &str,
    weights: &[f64],
    vertices: &mut Vertices,
    notes: &mut Notes,
) -> Result<()> {
    let count = primitive.morph_targets().len();
    let fits = weights.len() == count || count == 0;
    notes.repair("as many weights as morph targets assumed", path, u64::from(!fits));
    let (mut positions, mut normals, mut tangents) = (Vec::new(), Vec::new(), Vec::new());
    for ((t, target), weight) in primitive.morph_targets().enumerate().zip(used(primitive, weights)) {
        if *weight == 0.0 {
            continue;
        }
        note_others(doc, path, t, notes);
        positions.extend(target.positions().map(|accessor| (accessor, *weight)));
        normals.extend(target.normals().map(|accessor| (accessor, *weight)));
        tangents.extend(target.tangents().map(|accessor| (accessor, *weight)));
    }
    let path = format!("{path}.targets");
    add(doc, &positions, &mut vertices.positions, &path, notes)?;
    if let Some(base) = &mut vertices.normals {
        add(doc, &normals, base, &path, notes)?;
    }
    if let Some(base) = &mut vertices.tangents {
        add(doc, &tangents, base, &path, notes)?;
    }
    Ok(())
}

/// Adds weighted differences to the first three components of `base`. The sum is kept in f64.
fn add<const N: usize>(
    doc: &Document<'_>,
    targets: &[(gltf::Accessor<'_>, f64)],
    base: &mut [[f32; N]],
    path: &str,
    notes: &mut Notes,
) -> Result<()> {
    if targets.is_empty() {
        return Ok(());
    }
    doc.budget.charge(base.len() as u64, 24, path)?;
    let mut sums = vec![[0.0f64; 3]; base.len()];
    for (accessor, weight) in targets {
        let deltas = accessor::vectors::<3>(doc, accessor, Kind::Delta, notes)?;
        if deltas.len() != base.len() {
            return Err(invalid(
                path,
                format!(
                    "accessors[{}] has {} differences for {} vertices",
                    accessor.index(),
                    deltas.len(),
                    base.len()
                ),
                REEXPORT,
            ));
        }
        for (sum, delta) in sums.iter_mut().zip(deltas) {
            for (sum, c) in sum.iter_mut().zip(delta) {
                *sum += weight * f64::from(c);
            }
        }
    }
    for (vertex, sum) in base.iter_mut().zip(sums) {
        for (c, sum) in vertex.iter_mut().zip(sum) {
            *c = (f64::from(*c) + sum) as f32;
        }
    }
    Ok(())
}

/// Names what a target changes beside positions, normals and tangents.
fn note_others(doc: &Document<'_>, path: &str, target: usize, notes: &mut Notes) {
    let target = doc.at(path).and_then(|primitive| primitive.get("targets")?.get(target)?.as_object());
    for attribute in target.into_iter().flat_map(|target| target.keys()) {
        if !matches!(attribute.as_str(), "POSITION" | "NORMAL" | "TANGENT") {
            notes.unmodelled(&format!("morph targets of {attribute}"), path, "its base values are used");
        }
    }
}
