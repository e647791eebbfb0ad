//! `KHR_draco_mesh_compression`: primitives whose indices and attributes lie in one compressed stream.
//!
//! What is decoded takes the place of the accessors' data; the accessors still say what the numbers mean. Where a file has
//! uncompressed data beside the stream, the stream is what is read.

use draco_core::{DecodeLimits, DecoderBuffer, Mesh, MeshDecoder};
use gltf::accessor::DataType;
use gltf::mesh::Mode;
use serde_json::Value;

use super::document::Document;
use crate::LoadError;
use crate::error::{REEXPORT, Result, invalid, unsupported};
use crate::notes::Notes;

const NAME: &str = "KHR_draco_mesh_compression";

/// Bytes that the decoder holds for a triangle and for a vertex at most, beside the attributes.
const BYTES_PER_TRIANGLE: u64 = 256;
const BYTES_PER_VERTEX: u64 = 128;

/// The buffer view of a primitive's stream, as the file states it; `None` where the primitive is a plain one.
pub(crate) fn stream(doc: &Document<'_>, path: &str) -> Option<u64> {
    let extension = doc.at(path)?.get("extensions")?.get(NAME)?;
    Some(extension.get("bufferView").and_then(Value::as_u64).unwrap_or(u64::MAX))
}

/// Decodes a primitive's stream: its attributes go to the document, in place of the accessors' data; the indices (three for
/// each triangle) are returned.
pub(crate) fn decode(
    doc: &Document<'_>,
    primitive: &gltf::Primitive<'_>,
    path: &str,
    notes: &mut Notes,
) -> Result<Vec<u32>> {
    let element = format!("{path}.extensions.{NAME}");
    if primitive.mode() != Mode::Triangles {
        return Err(unsupported(
            element,
            "compressed strips are not supported",
            "export the mesh as a list of triangles",
        ));
    }
    let index = stream(doc, path).and_then(|index| usize::try_from(index).ok());
    let Some(view) = index.and_then(|index| doc.gltf.views().nth(index)) else {
        let count = doc.gltf.views().len();
        return Err(invalid(
            format!("{element}.bufferView"),
            format!("this is missing or out of range, the file has {count} buffer views"),
            REEXPORT,
        ));
    };
    let left = doc.budget.left();
    let limits = DecodeLimits::default()
        .with_max_faces(left / BYTES_PER_TRIANGLE)
        .with_max_points(left / BYTES_PER_VERTEX)
        .with_max_decoded_bytes(left / 2);
    let mut mesh = Mesh::new();
    let mut buffer = DecoderBuffer::new(doc.view(&view)?).with_limits(limits);
    MeshDecoder::new().decode(&mut buffer, &mut mesh).map_err(|error| {
        let advice = "export the file again, or without mesh compression";
        invalid(element.as_str(), format!("the stream cannot be decoded ({error})"), advice)
    })?;
    doc.budget.charge(mesh.num_faces() as u64, BYTES_PER_TRIANGLE, &element)?;
    doc.budget.charge(mesh.num_points() as u64, BYTES_PER_VERTEX, &element)?;
    provide(doc, &mesh, path, &element, notes)?;
    let points = mesh.num_points();
    let indices: Vec<u32> = mesh.faces().iter().flatten().map(|point| point.0).collect();
    match indices.iter().find(|index| **index as usize >= points) {
        None => Ok(indices),
        Some(index) => {
            let problem = format!("index {index} is out of range, there are {points} vertices");
            Err(invalid(element, problem, REEXPORT))
        }
    }
}

/// Hands the decoded attributes to the accessors that stand for them.
fn provide(doc: &Document<'_>, mesh: &Mesh, path: &str, element: &str, notes: &mut Notes) -> Result<()> {
    let wrong = |name: &str, problem: String| -> LoadError {
        invalid(format!("{element}.attributes.{name}"), problem, REEXPORT)
    };
    let primitive = doc.at(path);
    let list = primitive.and_then(|p| p.get("extensions")?.get(NAME)?.get("attributes")?.as_object());
    let Some(list) = list else {
        return Err(invalid(format!("{element}.attributes"), "this is missing or not an object", REEXPORT));
    };
    let points = mesh.num_points();
    for (name, id) in list {
        let accessor = primitive.and_then(|p| p.get("attributes")?.get(name)?.as_u64());
        let accessor = accessor.and_then(|index| usize::try_from(index).ok());
        let Some(accessor) = accessor.and_then(|index| doc.gltf.accessors().nth(index)) else {
            return Err(wrong(name, "the primitive has no such attribute".into()));
        };
        let id = id.as_u64().and_then(|id| u32::try_from(id).ok());
        let Some(attribute) = id.and_then(|id| mesh.attribute_by_unique_id(id)) else {
            return Err(wrong(name, "the stream has no such attribute".into()));
        };
        let components = accessor.dimensions().multiplicity();
        if usize::from(attribute.num_components()) != components {
            let found = attribute.num_components();
            return Err(wrong(name, format!("the stream has {found} components, the accessor {components}")));
        }
        let differs = accessor.count() != points;
        notes.repair("count of an accessor taken from compressed data", path, u64::from(differs));
        doc.budget.charge(points as u64, 8 * components as u64, element)?;
        let values = attribute.read_f32s(points, components);
        let mut bytes = Vec::with_capacity(values.len() * accessor.data_type().size());
        // Whole numbers of 16 bits are exact as floats, and a cast holds at the ends of its range.
        for value in values {
            match accessor.data_type() {
                DataType::I8 => bytes.extend((value as i8).to_le_bytes()),
                DataType::U8 => bytes.extend((value as u8).to_le_bytes()),
                DataType::I16 => bytes.extend((value as i16).to_le_bytes()),
                DataType::U16 => bytes.extend((value as u16).to_le_bytes()),
                DataType::U32 => bytes.extend((value as u32).to_le_bytes()),
                DataType::F32 => bytes.extend(value.to_le_bytes()),
            }
        }
        doc.provide(accessor.index(), bytes.into());
    }
    Ok(())
}
