//! Cameras (glTF 2.0, section 3.10).

use gltf::Node;
use gltf::json::camera::Type;
use gltf::json::validation::Checked;

use super::document::{Document, label};
use super::graph::Affine;
use crate::error::{REEXPORT, Result, invalid};
use crate::notes::{Notes, cut};
use crate::scene::{Camera, Projection};

/// The camera of a node, or `None` where the node's transform leaves nothing to look through (noted).
pub(crate) fn read(
    doc: &Document<'_>,
    node: &Node<'_>,
    to_world: &Affine,
    notes: &mut Notes,
) -> Result<Option<Camera>> {
    let Some(camera) = node.camera() else { return Ok(None) };
    let index = camera.index();
    doc.note_unknown(&format!("cameras[{index}]"), camera.name(), &[], notes);
    let projection = projection(doc, index)?;
    let name = match (node.name(), camera.name()) {
        (Some(name), _) | (None, Some(name)) if !name.is_empty() => cut(name).to_owned(),
        _ => format!("camera {index}"),
    };
    let Some(to_world) = unit_columns(to_world) else {
        let node = label(&format!("nodes[{}]", node.index()), node.name());
        notes.repair("camera dropped: its node is scaled to nothing", &node, 1);
        return Ok(None);
    };
    Ok(Some(Camera { name, to_world, projection }))
}

/// `gltf::Camera::projection` panics where the type's own member is missing, so the JSON type is asked.
fn projection(doc: &Document<'_>, index: usize) -> Result<Projection> {
    let path = format!("cameras[{index}]");
    let wrong = |key: &str, problem: &str| Err(invalid(format!("{path}.{key}"), problem, REEXPORT));
    // Numbers are taken as f64, and stand in the file where the crate found them.
    let number = |key: &str| doc.exact::<1>("cameras", index, key).map(|[number]| number);
    let Some(camera) = doc.gltf.as_json().cameras.get(index) else {
        return wrong("type", "there is no such camera");
    };
    match (camera.type_, &camera.perspective, &camera.orthographic) {
        (Checked::Valid(Type::Perspective), Some(_), _) => {
            let yfov = number("perspective.yfov").unwrap_or_default();
            if !(yfov > 0.0 && yfov < std::f64::consts::PI) {
                return wrong("perspective.yfov", &format!("the angle {yfov} is not between 0 and π"));
            }
            let aspect = number("perspective.aspectRatio");
            if aspect.is_some_and(|aspect| aspect <= 0.0) {
                return wrong("perspective.aspectRatio", "the ratio is not above 0");
            }
            Ok(Projection::Perspective { yfov, aspect })
        }
        (Checked::Valid(Type::Orthographic), _, Some(_)) => {
            // Negative values mirror the picture, which the specification advises against: their size is used.
            let [xmag, ymag] =
                ["xmag", "ymag"].map(|key| number(&format!("orthographic.{key}")).unwrap_or_default().abs());
            match (xmag, ymag) {
                (0.0, _) => wrong("orthographic.xmag", "the size is 0"),
                (_, 0.0) => wrong("orthographic.ymag", "the size is 0"),
                _ => Ok(Projection::Orthographic { xmag, ymag }),
            }
        }
        _ => wrong("type", "the camera has no member of the name of its type"),
    }
}

/// The matrix with its three axes scaled to length 1: scaling a camera does not scale what it sees.
fn unit_columns(m: &Affine) -> Option<Affine> {
    let mut out = *m;
    for column in 0..3 {
        let largest = m.iter().fold(0.0f64, |largest, row| largest.max(row[column].abs()));
        if largest <= 0.0 {
            return None;
        }
        let length = m.iter().map(|row| (row[column] / largest).powi(2)).sum::<f64>().sqrt();
        for row in &mut out {
            row[column] = row[column] / largest / length;
        }
    }
    Some(out)
}
