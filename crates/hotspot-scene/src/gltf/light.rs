//! Punctual lights (KHR_lights_punctual) of nodes.
//!
//! Read from the JSON, in f64. Lights shine along their node's −Z; a node's scale does not change their strength. A light's
//! `range` is not modelled: light does not end.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

use gltf::Node;
use serde_json::Value;

use super::document::{Document, label};
use super::graph::Affine;
use super::member;
use crate::error::{REEXPORT, Result, invalid};
use crate::notes::{Notes, cut};
use crate::scene::{Light, LightKind};

const REFERENCE: &str = "extensions.KHR_lights_punctual.light";
const LIST: &str = "extensions.KHR_lights_punctual.lights";

/// Whether a node names a light.
pub(crate) fn is_on(doc: &Document<'_>, node: usize) -> bool {
    json_of(doc, node).is_some_and(|json| member::at(json, REFERENCE).is_some())
}

fn json_of<'d>(doc: &'d Document<'_>, node: usize) -> Option<&'d Value> {
    doc.json().get("nodes")?.get(node)
}

/// The light of a node; `None` where it has none, or one that does not shine (noted).
pub(crate) fn read(
    doc: &Document<'_>,
    node: &Node<'_>,
    to_world: &Affine,
    notes: &mut Notes,
) -> Result<Option<Light>> {
    let node_path = format!("nodes[{}]", node.index());
    let lights = member::at(doc.json(), LIST).and_then(Value::as_array).map_or(&[][..], Vec::as_slice);
    let Some(json) = json_of(doc, node.index()) else { return Ok(None) };
    let index = member::index(json, &node_path, REFERENCE, lights.len(), "lights")?;
    let Some((index, stated)) = index.and_then(|index| Some((index, lights.get(index)?))) else {
        return Ok(None);
    };
    let path = format!("{LIST}[{index}]");
    let stated_name = stated.get("name").and_then(Value::as_str);
    let element = label(&path, stated_name);
    let intensity = intensity(stated, &path, notes)?;
    if intensity == [0.0; 3] {
        notes.repair("light without intensity dropped", &element, 1);
        return Ok(None);
    }
    let node_label = label(&node_path, node.name());
    let Some(kind) = kind(stated, &path, &element, to_world, &node_label, notes)? else { return Ok(None) };
    if !matches!(kind, LightKind::Directional { .. }) && stated.get("range").is_some() {
        let effect = "the light reaches beyond it, falling with the square of the distance";
        notes.unmodelled("range of a light", &element, effect);
    }
    let name = match (node.name(), stated_name) {
        (Some(name), _) | (None, Some(name)) if !name.is_empty() => cut(name).to_owned(),
        _ => format!("light {index}"),
    };
    Ok(Some(Light { name, kind, intensity }))
}

/// Colour times intensity.
fn intensity(stated: &Value, path: &str, notes: &mut Notes) -> Result<[f32; 3]> {
    let color = member::numbers::<3>(stated, path, "color")?.unwrap_or([1.0; 3]);
    let intensity = member::number(stated, path, "intensity")?.unwrap_or(1.0);
    let negative = intensity < 0.0 || color.iter().any(|c| *c < 0.0);
    notes.repair("negative light set to 0", path, u64::from(negative));
    let product = color.map(|c| (c.max(0.0) * intensity.max(0.0)) as f32);
    if product.iter().all(|c| c.is_finite()) {
        Ok(product)
    } else {
        Err(invalid(format!("{path}.intensity"), "colour times intensity is too large", REEXPORT))
    }
}

/// Where the light shines; `None` for nowhere, or for a kind of light that we do not know (noted).
fn kind(
    stated: &Value,
    path: &str,
    element: &str,
    to_world: &Affine,
    node: &str,
    notes: &mut Notes,
) -> Result<Option<LightKind>> {
    let position = to_world.map(|row| row[3] as f32);
    let shape = stated.get("type").and_then(Value::as_str);
    if shape != Some("directional") && !position.iter().all(|c| c.is_finite()) {
        return Err(invalid(node, "the light is too far away", "move the scene towards its origin"));
    }
    let direction = direction(to_world);
    let nowhere = |notes: &mut Notes| {
        notes.repair("light dropped: its node is scaled to nothing", node, 1);
        Ok(None)
    };
    match shape {
        Some("point") => Ok(Some(LightKind::Point { position })),
        Some("directional") => match direction {
            Some(direction) => Ok(Some(LightKind::Directional { direction })),
            None => nowhere(notes),
        },
        Some("spot") => {
            let Some(direction) = direction else { return nowhere(notes) };
            let Some([cos_inner, cos_outer]) = cone(stated, path, notes)? else { return Ok(None) };
            Ok(Some(LightKind::Spot { position, direction, cos_inner, cos_outer }))
        }
        Some(other) => {
            notes.unmodelled(&format!("light of type {other}"), element, "the light is left out");
            Ok(None)
        }
        None => Err(invalid(format!("{path}.type"), "this is not point, spot or directional", REEXPORT)),
    }
}

/// Unit length, from −Z; `None` where the matrix leaves nothing of it.
fn direction(to_world: &Affine) -> Option<[f32; 3]> {
    let axis = to_world.map(|row| -row[2]);
    let largest = axis.iter().fold(0.0f64, |largest, c| largest.max(c.abs()));
    if largest <= 0.0 {
        return None;
    }
    // Scaled first, so that squares neither overflow nor vanish.
    let axis = axis.map(|c| c / largest);
    let length = axis.iter().map(|c| c * c).sum::<f64>().sqrt();
    // The sum turns -0 into 0.
    Some(axis.map(|c| (c / length + 0.0) as f32))
}

/// Cosines of the inner and outer angle of a spot, the first above the second; `None` for a cone without width (noted).
/// Angles are 0 ≤ inner < outer ≤ π/2.
fn cone(stated: &Value, path: &str, notes: &mut Notes) -> Result<Option<[f32; 2]>> {
    let outer = member::number(stated, path, "spot.outerConeAngle")?.unwrap_or(FRAC_PI_4);
    let inner = member::number(stated, path, "spot.innerConeAngle")?.unwrap_or(0.0);
    let path = format!("{path}.spot");
    if outer <= 0.0 {
        notes.repair("spot without width dropped", &path, 1);
        return Ok(None);
    }
    // Exporters round π/2 to f32, which may round it up.
    notes.repair("outer angle of a spot set to π/2", &path, u64::from(outer > FRAC_PI_2 + 1e-6));
    notes.repair("negative inner angle of a spot set to 0", &path, u64::from(inner < 0.0));
    // With equal angles an exporter means a hard edge, which the specification has no way to say.
    notes.repair("inner angle of a spot set just below its outer one", &path, u64::from(inner >= outer));
    let outer = outer.min(FRAC_PI_2);
    // Below 1, so that there is room above it.
    let cos_outer = (libm::cos(outer) as f32).clamp(0.0, 1.0f32.next_down());
    let cos_inner = libm::cos(inner.clamp(0.0, outer)) as f32;
    Ok(Some([cos_inner.max(cos_outer.next_up()), cos_outer]))
}
