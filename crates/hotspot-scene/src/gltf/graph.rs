//! The node tree (glTF 2.0, section 3.5): which nodes a scene reaches, and where they stand.
//!
//! The walk keeps its own stack and visits each node once, so neither depth nor cycles nor shared children hurt.

use gltf::Node;

use super::animation::Poses;
use super::document::Document;
use crate::error::{REEXPORT, Result, invalid};
use crate::notes::Notes;

/// Rows of a 3×4 affine matrix.
pub(crate) type Affine = [[f64; 4]; 3];

pub(crate) const IDENTITY: Affine = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

/// A node that the scene reaches.
pub(crate) struct Placed {
    pub(crate) node: usize,
    pub(crate) to_world: Affine,
}

impl Placed {
    /// World transforms of copies whose transforms are relative to the node.
    pub(crate) fn copies(&self, copies: &[Affine]) -> Result<Vec<Affine>> {
        let to_world: Vec<Affine> = copies.iter().map(|copy| multiply(&self.to_world, copy)).collect();
        if to_world.iter().flatten().flatten().all(|c| c.is_finite()) {
            Ok(to_world)
        } else {
            let path = format!("nodes[{}]", self.node);
            Err(invalid(path, "the transform of a copy overflows", REEXPORT))
        }
    }
}

/// All nodes below `roots`, parents before children, in file order.
pub(crate) fn walk(
    doc: &Document<'_>,
    poses: &Poses,
    roots: &[usize],
    roots_path: &str,
    notes: &mut Notes,
) -> Result<Vec<Placed>> {
    let nodes = doc.gltf.nodes().len();
    doc.budget.charge(nodes as u64, 2 * size_of::<Placed>() as u64 + 128, "nodes")?;
    let mut seen = vec![false; nodes];
    let mut placed = Vec::new();
    let mut stack = Vec::new();
    push(&mut stack, &mut seen, roots, IDENTITY, roots_path)?;
    while let Some(Placed { node, to_world: parent }) = stack.pop() {
        let Some(element) = doc.gltf.nodes().nth(node) else { continue };
        let to_world = multiply(&parent, &local(doc, poses, &element, notes));
        if !to_world.iter().flatten().all(|c| c.is_finite()) {
            return Err(invalid(format!("nodes[{node}]"), "the transform of the node overflows", REEXPORT));
        }
        let children: Vec<usize> = element.children().map(|child| child.index()).collect();
        push(&mut stack, &mut seen, &children, to_world, &format!("nodes[{node}].children"))?;
        placed.push(Placed { node, to_world });
    }
    Ok(placed)
}

fn push(
    stack: &mut Vec<Placed>,
    seen: &mut [bool],
    nodes: &[usize],
    to_world: Affine,
    path: &str,
) -> Result<()> {
    let first = stack.len();
    for node in nodes {
        if seen.get_mut(*node).is_none_or(|seen| std::mem::replace(seen, true)) {
            return Err(invalid(
                path,
                format!("nodes[{node}] is reached a second time: a cycle, or a child of two parents"),
                "give every node one parent (copy nodes that are to appear twice)",
            ));
        }
        stack.push(Placed { node: *node, to_world });
    }
    // The stack hands out the last first.
    if let Some(added) = stack.get_mut(first..) {
        added.reverse();
    }
    Ok(())
}

/// Nodes that are no node's child, for files without scenes.
pub(crate) fn roots(doc: &Document<'_>) -> Result<Vec<usize>> {
    let count = doc.gltf.nodes().len();
    let mut is_child = vec![false; count];
    for child in doc.gltf.nodes().flat_map(|node| node.children()) {
        if let Some(flag) = is_child.get_mut(child.index()) {
            *flag = true;
        }
    }
    let roots: Vec<usize> =
        is_child.iter().enumerate().filter(|(_, child)| !**child).map(|(i, _)| i).collect();
    if roots.is_empty() && count > 0 {
        return Err(invalid(
            "nodes",
            "every node is another's child: the nodes form a cycle",
            "give the tree a root",
        ));
    }
    Ok(roots)
}

/// The node's own transform, in f64 (the crate rounds to f32, which adds up down the tree), at the chosen point in time.
pub(crate) fn local(doc: &Document<'_>, poses: &Poses, node: &Node<'_>, notes: &mut Notes) -> Affine {
    let index = node.index();
    let pose = poses.of(index);
    if let Some(m) = doc.exact::<16>("nodes", index, "matrix") {
        let [a, b, c, d] = [0, 4, 8, 12].map(|i| [m[i], m[i + 1], m[i + 2], m[i + 3]]);
        let affine = [a[3], b[3], c[3], d[3]] == [0.0, 0.0, 0.0, 1.0];
        let path = format!("nodes[{index}].matrix");
        notes.repair("projective part of a matrix ignored", &path, u64::from(!affine));
        notes.repair("animation of a node with a matrix ignored", &path, u64::from(pose.moves()));
        return [0, 1, 2].map(|row| [a[row], b[row], c[row], d[row]]);
    }
    let translation =
        pose.translation.or_else(|| doc.exact("nodes", index, "translation")).unwrap_or([0.0; 3]);
    let scale = pose.scale.or_else(|| doc.exact("nodes", index, "scale")).unwrap_or([1.0; 3]);
    let rotation = match pose.rotation {
        Some(rotation) => rotation,
        None => rotation(doc.exact("nodes", index, "rotation"), index, notes),
    };
    compose(translation, rotation, scale)
}

/// The matrix that scales, then rotates by a unit quaternion, then translates.
pub(crate) fn compose(translation: [f64; 3], [x, y, z, w]: [f64; 4], scale: [f64; 3]) -> Affine {
    let rows = [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
        [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
        [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)],
    ];
    [0, 1, 2].map(|i| [rows[i][0] * scale[0], rows[i][1] * scale[1], rows[i][2] * scale[2], translation[i]])
}

/// The unit quaternion of a node.
fn rotation(stated: Option<[f64; 4]>, node: usize, notes: &mut Notes) -> [f64; 4] {
    let Some(q) = stated else { return [0.0, 0.0, 0.0, 1.0] };
    let length = q.iter().map(|c| c * c).sum::<f64>().sqrt();
    // Exporters round to f32: that much is no fault, and left as it is.
    if (length - 1.0).abs() <= 1e-5 {
        return q;
    }
    let path = format!("nodes[{node}].rotation");
    if length > 0.0 && length.is_finite() {
        notes.repair("rotation normalised", &path, 1);
        q.map(|c| c / length)
    } else {
        notes.repair("rotation without direction ignored", &path, 1);
        [0.0, 0.0, 0.0, 1.0]
    }
}

/// `a * b`: first b, then a.
pub(crate) fn multiply(a: &Affine, b: &Affine) -> Affine {
    a.map(|row| {
        let mut out = [0.0, 0.0, 0.0, row[3]];
        for (factor, other) in row.iter().zip(b) {
            for (sum, c) in out.iter_mut().zip(other) {
                *sum += factor * c;
            }
        }
        out
    })
}
