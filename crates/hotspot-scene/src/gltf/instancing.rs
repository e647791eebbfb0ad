//! `EXT_mesh_gpu_instancing`: a node's mesh drawn many times, placed by accessors.

use gltf::Accessor;
use serde_json::{Map, Value};

use super::accessor::{self, Kind};
use super::document::Document;
use super::graph::{self, Affine};
use crate::error::{REEXPORT, Result, invalid};
use crate::notes::Notes;

/// The extension's name.
pub(crate) const NAME: &str = "EXT_mesh_gpu_instancing";

/// The accessors that place a node's copies.
pub(crate) struct Copies<'d> {
    path: String,
    translations: Option<Accessor<'d>>,
    rotations: Option<Accessor<'d>>,
    scales: Option<Accessor<'d>>,
    pub(crate) count: usize,
}

impl<'d> Copies<'d> {
    /// `None` where the node is drawn once, as usual.
    pub(crate) fn of(doc: &'d Document<'_>, node: usize) -> Result<Option<Self>> {
        let path = format!("nodes[{node}].extensions.{NAME}.attributes");
        let Some(extension) = doc.member("nodes", node, "extensions").and_then(|all| all.get(NAME)) else {
            return Ok(None);
        };
        let Some(attributes) = extension.get("attributes").and_then(Value::as_object) else {
            return Err(invalid(path, "this is missing or not an object", REEXPORT));
        };
        let [translations, rotations, scales] =
            ["TRANSLATION", "ROTATION", "SCALE"].map(|name| attribute(doc, attributes, name, &path));
        let (translations, rotations, scales) = (translations?, rotations?, scales?);
        // Attributes of applications' own count as well: with nothing else, all copies stand at the node.
        let mut all = Vec::new();
        for name in attributes.keys() {
            all.extend(attribute(doc, attributes, name, &path)?.map(|accessor| accessor.count()));
        }
        let Some(count) = all.first().copied() else {
            return Err(invalid(
                path,
                "there are no attributes, so the number of copies is unknown",
                REEXPORT,
            ));
        };
        if let Some(other) = all.iter().find(|other| **other != count) {
            let problem = format!("the attributes disagree: {count} copies, and {other}");
            return Err(invalid(path, problem, REEXPORT));
        }
        Ok(Some(Self { path, translations, rotations, scales, count }))
    }

    /// The copies' transforms, relative to the node.
    pub(crate) fn transforms(&self, doc: &Document<'_>, notes: &mut Notes) -> Result<Vec<Affine>> {
        doc.budget.charge(self.count as u64, 2 * size_of::<Affine>() as u64, &self.path)?;
        let read = |accessor: &Option<Accessor<'_>>, notes: &mut Notes| match accessor {
            Some(accessor) => accessor::vectors::<3>(doc, accessor, Kind::Value, notes),
            None => Ok(Vec::new()),
        };
        let (translations, scales) = (read(&self.translations, notes)?, read(&self.scales, notes)?);
        let rotations = match &self.rotations {
            Some(accessor) => accessor::vectors::<4>(doc, accessor, Kind::Value, notes)?,
            None => Vec::new(),
        };
        let mut turned_nowhere = 0;
        let mut transforms = Vec::with_capacity(self.count);
        for copy in 0..self.count {
            let translation = translations.get(copy).map_or([0.0; 3], |t| t.map(f64::from));
            let scale = scales.get(copy).map_or([1.0; 3], |s| s.map(f64::from));
            let rotation = match rotations.get(copy) {
                Some(q) => {
                    let q = q.map(f64::from);
                    let length = q.iter().map(|c| c * c).sum::<f64>().sqrt();
                    turned_nowhere += u64::from(length == 0.0);
                    if length == 0.0 { [0.0, 0.0, 0.0, 1.0] } else { q.map(|c| c / length) }
                }
                None => [0.0, 0.0, 0.0, 1.0],
            };
            let transform = graph::compose(translation, rotation, scale);
            if !transform.iter().flatten().all(|c| c.is_finite()) {
                return Err(invalid(self.path.as_str(), format!("copy {copy} is not finite"), REEXPORT));
            }
            transforms.push(transform);
        }
        notes.repair("rotation without direction ignored", &self.path, turned_nowhere);
        Ok(transforms)
    }
}

fn attribute<'d>(
    doc: &'d Document<'_>,
    attributes: &Map<String, Value>,
    name: &str,
    path: &str,
) -> Result<Option<Accessor<'d>>> {
    let Some(index) = attributes.get(name) else { return Ok(None) };
    let accessor = index.as_u64().and_then(|index| usize::try_from(index).ok());
    match accessor.and_then(|index| doc.gltf.accessors().nth(index)) {
        Some(accessor) => Ok(Some(accessor)),
        None => Err(invalid(
            format!("{path}.{name}"),
            format!("index {index} is out of range, the file has {} accessors", doc.gltf.accessors().len()),
            REEXPORT,
        )),
    }
}
