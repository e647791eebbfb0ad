//! Cameras (glTF 2.0, section 3.10).

use super::document::Document;
use super::graph::Affine;
use super::json::Element;
use crate::error::Result;
use crate::notes::Notes;
use crate::scene::{Camera, Projection};

/// The camera of a node, or `None` where the node's transform leaves nothing to look through (noted).
pub(crate) fn read(
    doc: &Document<'_>,
    node: &Element<'_>,
    to_world: &Affine,
    notes: &mut Notes,
) -> Result<Option<Camera>> {
    let Some((index, camera)) = doc.follow(node, "camera", "cameras")? else { return Ok(None) };
    super::extensions::note_unknown(&camera, &[], notes)?;
    let projection = projection(&camera)?;
    let name = match (node.string("name")?, camera.string("name")?) {
        (Some(name), _) | (None, Some(name)) if !name.is_empty() => name.to_owned(),
        _ => format!("camera {index}"),
    };
    let Some(to_world) = unit_columns(to_world) else {
        notes.repair("camera dropped: its node is scaled to nothing", &node.label(), 1);
        return Ok(None);
    };
    Ok(Some(Camera { name, to_world, projection }))
}

fn projection(camera: &Element<'_>) -> Result<Projection> {
    let kind = camera.string("type")?.unwrap_or_default();
    let lens = match kind {
        "perspective" | "orthographic" => camera.object(kind)?,
        _ => return Err(camera.wrong("type", "the type is neither perspective nor orthographic")),
    };
    let lens = lens.ok_or_else(|| camera.wrong(kind, "this is missing"))?;
    let number = |key: &str| lens.number(key)?.ok_or_else(|| lens.wrong(key, "this is missing"));
    if kind == "perspective" {
        let yfov = number("yfov")?;
        if !(yfov > 0.0 && yfov < std::f64::consts::PI) {
            return Err(lens.wrong("yfov", format!("the angle {yfov} is not between 0 and π")));
        }
        let aspect = lens.number("aspectRatio")?;
        if aspect.is_some_and(|aspect| aspect <= 0.0) {
            return Err(lens.wrong("aspectRatio", "the ratio is not above 0"));
        }
        Ok(Projection::Perspective { yfov, aspect })
    } else {
        // Negative values mirror the picture, which the specification advises against: their size is used.
        let magnification = |key: &str| match number(key)?.abs() {
            0.0 => Err(lens.wrong(key, "the size is 0")),
            size => Ok(size),
        };
        Ok(Projection::Orthographic { xmag: magnification("xmag")?, ymag: magnification("ymag")? })
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
