//! A glTF 2.0 file in one piece (GLB): meshes with a colour and the raw values at each vertex.
//!
//! Materials are unlit (KHR_materials_unlit, optional), so that viewers show the colours as they are. Attributes beside POSITION:
//! `COLOR_0` (linear RGBA, 16 bits), `_COST` and `_RAYS` (floats).

use crate::error::{Error, Result};
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// The triangles that share an object and a material.
#[derive(Clone, Debug, Default)]
pub struct SurfacePart {
    /// Name of the object: parts of one name become primitives of one mesh.
    pub object: String,
    /// Name of the material.
    pub material: String,
    /// Positions in the world.
    pub positions: Vec<[f32; 3]>,
    /// Counter-clockwise, indices of positions.
    pub triangles: Vec<[u32; 3]>,
    /// Linear RGBA of each vertex.
    pub colors: Vec<[u16; 4]>,
    /// Value of each vertex.
    pub cost: Vec<f32>,
    /// Rays that landed around each vertex.
    pub rays: Vec<f32>,
}

/// A camera to look from.
#[derive(Clone, Copy, Debug)]
pub struct SurfaceCamera {
    /// Camera space (looking along −Z, +Y up) to world space: rows of a 3×4 matrix.
    pub to_world: [[f64; 4]; 3],
    /// Full vertical angle in radians.
    pub yfov: f64,
    /// Width over height.
    pub aspect: f64,
    /// Nearest distance drawn, above 0.
    pub znear: f64,
}

const FLOAT: u32 = 5126;
const USHORT: u32 = 5123;
const UINT: u32 = 5125;

/// The file's JSON and binary parts in the making.
#[derive(Default)]
struct Builder {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Builder {
    /// An array of its own view; returns its accessor. `stride` bytes lie between the starts of elements.
    fn array(&mut self, bytes: &[u8], target: u32, accessor: Value) -> usize {
        self.views.push(json!({
            "buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len(), "target": target,
        }));
        self.bytes.extend_from_slice(bytes);
        let mut accessor = accessor;
        accessor["bufferView"] = json!(self.views.len() - 1);
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    fn part(&mut self, part: &SurfacePart) -> Value {
        let count = part.positions.len();
        let finite = |v: f32| if v.is_finite() { v } else { 0.0 };
        let positions: Vec<u8> =
            part.positions.iter().flatten().flat_map(|c| finite(*c).to_le_bytes()).collect();
        let end = |pick: fn(f32, f32) -> f32| {
            [0, 1, 2].map(|axis| part.positions.iter().map(|p| finite(p[axis])).reduce(pick).unwrap_or(0.0))
        };
        let vertices = 34962;
        let position = self.array(
            &positions,
            vertices,
            json!({ "componentType": FLOAT, "type": "VEC3", "count": count, "min": end(f32::min), "max": end(f32::max) }),
        );
        let colors: Vec<u8> = part.colors.iter().flatten().flat_map(|c| c.to_le_bytes()).collect();
        let color = self.array(
            &colors,
            vertices,
            json!({ "componentType": USHORT, "normalized": true, "type": "VEC4", "count": count }),
        );
        let mut floats = |values: &[f32]| {
            let bytes: Vec<u8> = values.iter().flat_map(|v| finite(*v).to_le_bytes()).collect();
            self.array(&bytes, vertices, json!({ "componentType": FLOAT, "type": "SCALAR", "count": count }))
        };
        let (cost, rays) = (floats(&part.cost), floats(&part.rays));
        let indices: Vec<u8> = part.triangles.iter().flatten().flat_map(|i| i.to_le_bytes()).collect();
        let indices = self.array(
            &indices,
            34963,
            json!({ "componentType": UINT, "type": "SCALAR", "count": 3 * part.triangles.len() }),
        );
        json!({
            "attributes": { "POSITION": position, "COLOR_0": color, "_COST": cost, "_RAYS": rays },
            "indices": indices,
            "material": 0,
            "extras": { "material": part.material },
        })
    }
}

/// The file. Parts without triangles are left out. `extras` is put into the asset, to say what the values are.
///
/// # Errors
/// [`Error::Invalid`] when no part has triangles, or a part's arrays differ in length; [`Error::Limit`] beyond the 4 GiB of the format.
pub fn write_glb(
    parts: &[SurfacePart],
    camera: Option<&SurfaceCamera>,
    generator: &str,
    extras: &Value,
) -> Result<Vec<u8>> {
    let size: usize = parts.iter().map(|p| 28 * p.positions.len() + 12 * p.triangles.len()).sum();
    if size as u64 > u64::from(u32::MAX) - (1 << 24) {
        return Err(Error::Limit {
            place: "GLB".into(),
            what: format!("{} MiB of vertices do not fit the format's 4 GiB", size >> 20),
            advice: "bake on fewer vertices".into(),
        });
    }
    let mut builder = Builder::default();
    let mut objects: BTreeMap<usize, Vec<Value>> = BTreeMap::new();
    let mut first_of = BTreeMap::new();
    for (index, part) in parts.iter().enumerate().filter(|(_, part)| !part.triangles.is_empty()) {
        let count = part.positions.len();
        let whole = [part.colors.len(), part.cost.len(), part.rays.len()].iter().all(|n| *n == count)
            && part.triangles.iter().flatten().all(|i| (*i as usize) < count);
        if !whole {
            return Err(Error::invalid(
                format!("object \"{}\"", part.object),
                "its vertices' values do not belong together",
                "give every vertex a colour, a cost and rays",
            ));
        }
        let primitive = builder.part(part);
        let first = *first_of.entry(part.object.as_str()).or_insert(index);
        objects.entry(first).or_default().push(primitive);
    }
    if objects.is_empty() {
        return Err(Error::invalid("the scene", "has no triangles to bake on", "choose another scene"));
    }
    let mut meshes = Vec::new();
    let mut nodes = Vec::new();
    for (first, primitives) in objects {
        nodes.push(json!({ "name": parts[first].object, "mesh": meshes.len() }));
        meshes.push(json!({ "name": parts[first].object, "primitives": primitives }));
    }
    let mut root = json!({
        "asset": { "version": "2.0", "generator": generator, "extras": extras },
        "extensionsUsed": ["KHR_materials_unlit"],
        "materials": [{
            "name": "cost",
            "doubleSided": true,
            "pbrMetallicRoughness": { "metallicFactor": 0.0, "roughnessFactor": 1.0 },
            "extensions": { "KHR_materials_unlit": {} },
        }],
        "buffers": [{ "byteLength": builder.bytes.len() }],
        "bufferViews": builder.views,
        "accessors": builder.accessors,
        "meshes": meshes,
        "scene": 0,
    });
    if let Some(camera) = camera.filter(|c| c.yfov > 0.0 && c.aspect > 0.0 && c.znear > 0.0) {
        // Column by column.
        let matrix: Vec<f64> = (0..16)
            .map(|k| if k % 4 == 3 { f64::from(k == 15) } else { camera.to_world[k % 4][k / 4] })
            .collect();
        nodes.push(json!({ "name": "camera", "camera": 0, "matrix": matrix }));
        root["cameras"] = json!([{
            "type": "perspective",
            "perspective": { "yfov": camera.yfov, "aspectRatio": camera.aspect, "znear": camera.znear },
        }]);
    }
    root["scenes"] = json!([{ "nodes": (0..nodes.len()).collect::<Vec<_>>() }]);
    root["nodes"] = Value::Array(nodes);
    let mut json = root.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    builder.bytes.resize(builder.bytes.len().next_multiple_of(4), 0);
    let total = 12 + 8 + json.len() + 8 + builder.bytes.len();
    let word = |n: usize| {
        u32::try_from(n).map(u32::to_le_bytes).map_err(|_| Error::Limit {
            place: "GLB".into(),
            what: format!("{n} bytes do not fit the format's 4 GiB"),
            advice: "bake on fewer vertices".into(),
        })
    };
    let mut out = Vec::with_capacity(total);
    out.extend(b"glTF");
    out.extend(2u32.to_le_bytes());
    out.extend(word(total)?);
    for (kind, chunk) in [(b"JSON", &json), (b"BIN\0", &builder.bytes)] {
        out.extend(word(chunk.len())?);
        out.extend(kind);
        out.extend(chunk);
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn part(object: &str) -> SurfacePart {
        SurfacePart {
            object: object.into(),
            material: "clay".into(),
            positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, f32::NAN, 0.0]],
            triangles: vec![[0, 1, 2]],
            colors: vec![[1, 2, 3, 4]; 3],
            cost: vec![1.0, f32::INFINITY, 3.0],
            rays: vec![0.5; 3],
        }
    }

    #[test]
    fn parts_of_an_object_become_one_mesh_and_numbers_stay_finite() {
        let parts = [part("a \"quoted\""), part("b"), SurfacePart::default(), part("a \"quoted\"")];
        let bytes = write_glb(&parts, None, "test", &json!({ "k": 1 })).unwrap();
        assert_eq!(&bytes[..4], b"glTF");
        assert_eq!(u32::from_le_bytes(bytes[8..12].try_into().unwrap()) as usize, bytes.len());
        let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
        let json: Value = serde_json::from_slice(&bytes[20..20 + length]).unwrap();
        assert_eq!(json["meshes"][0]["primitives"].as_array().unwrap().len(), 2);
        assert_eq!(
            (&json["meshes"][1]["name"], &json["nodes"][0]["name"]),
            (&json!("b"), &json!("a \"quoted\""))
        );
        assert_eq!(json["accessors"][0]["max"], json!([1.0, 0.0, 0.0]));
        let view = &json["bufferViews"][2];
        let at = 28 + length + view["byteOffset"].as_u64().unwrap() as usize;
        let cost: Vec<f32> =
            bytes[at..at + 12].chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
        assert_eq!(cost, [1.0, 0.0, 3.0]);
    }

    #[test]
    fn what_is_not_whole_is_refused() {
        let error = |parts: &[SurfacePart]| write_glb(parts, None, "", &Value::Null).unwrap_err().to_string();
        assert!(
            error(&[]).contains("no triangles") && error(&[SurfacePart::default()]).contains("no triangles")
        );
        let mut broken = part("x");
        broken.triangles[0][1] = 9;
        assert!(error(&[broken]).contains("object \"x\""));
        let mut broken = part("x");
        broken.rays.pop();
        assert!(error(&[broken]).contains("object \"x\""));
    }
}
