//! A scene under construction, and its glTF 2.0 form: `NAME.gltf` + `NAME.bin`, or one `NAME.glb`.
//!
//! Positions and normals are 32-bit floats, indices 16 bits where they suffice; nothing is interleaved. Lengths are
//! metres, emission is radiance. JSON keys come in a fixed order and number arrays on one line, by a printer of our
//! own, so that the bytes do not depend on how serde_json was built.

use crate::math::{Affine, Vec3, Y, sin_cos};
use crate::shapes::Mesh;
use serde_json::{Map, Value, json};

/// How a surface scatters, or emits.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Surface {
    /// Lambert.
    Matte([f64; 3]),
    /// Diffuse base under a glossy coat: base colour, roughness, index of refraction, specularFactor.
    Substrate { base: [f64; 3], roughness: f64, ior: f64, specular: f64 },
    /// Metallic 1; roughness 0 is a perfect mirror.
    Metal { base: [f64; 3], roughness: f64 },
    /// Emits this radiance from its front.
    Light { base: [f64; 3], radiance: [f64; 3] },
    /// Smooth dielectric: solid with a volume, else a thin pane.
    Glass { base: [f64; 3], ior: f64, solid: bool },
}

/// The usual coat: index of refraction 1.5, full specular factor.
pub(crate) fn substrate(base: [f64; 3], roughness: f64) -> Surface {
    Surface::Substrate { base, roughness, ior: 1.5, specular: 1.0 }
}

/// An index into the scene's materials.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct MaterialId(usize);

/// An index into the scene's meshes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MeshId(usize);

/// Where a node stands, in glTF's two ways of writing it.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Place {
    Here,
    Trs { translation: Vec3, rotation: [f64; 4], scale: f64 },
    Matrix(Affine),
}

impl Place {
    pub(crate) fn at(t: Vec3) -> Place {
        Place::Trs { translation: t, rotation: [0.0, 0.0, 0.0, 1.0], scale: 1.0 }
    }

    /// Turned about the vertical by `turns`, then moved.
    pub(crate) fn turned(t: Vec3, turns: f64) -> Place {
        let (s, c) = sin_cos(turns * 0.5);
        Place::Trs { translation: t, rotation: [0.0, s, 0.0, c], scale: 1.0 }
    }
}

struct Node {
    name: String,
    mesh: MeshId,
    place: Place,
}

struct NamedMesh {
    name: String,
    parts: Vec<(Mesh, MaterialId)>,
}

struct Camera {
    matrix: [f64; 16],
    yfov: f64,
    aspect: f64,
}

/// A scene: materials, meshes, nodes, one camera.
pub(crate) struct Scene {
    pub(crate) name: &'static str,
    materials: Vec<(String, Surface)>,
    meshes: Vec<NamedMesh>,
    nodes: Vec<Node>,
    camera: Option<Camera>,
    pub(crate) environment: Option<[f64; 3]>,
}

/// A file to be written: its path below the scenes folder, and its content.
pub(crate) struct File {
    pub(crate) path: String,
    pub(crate) bytes: Vec<u8>,
}

impl Scene {
    pub(crate) fn new(name: &'static str) -> Scene {
        Scene { name, materials: vec![], meshes: vec![], nodes: vec![], camera: None, environment: None }
    }

    pub(crate) fn material(&mut self, name: &str, surface: Surface) -> MaterialId {
        assert!(self.materials.iter().all(|(n, _)| n != name), "two materials named {name}");
        self.materials.push((name.into(), surface));
        MaterialId(self.materials.len() - 1)
    }

    /// Adds a mesh of several materials, without placing it.
    pub(crate) fn mesh(&mut self, name: &str, parts: Vec<(Mesh, MaterialId)>) -> MeshId {
        assert!(self.meshes.iter().all(|m| m.name != name), "two meshes named {name}");
        self.meshes.push(NamedMesh { name: name.into(), parts });
        MeshId(self.meshes.len() - 1)
    }

    pub(crate) fn node(&mut self, name: &str, mesh: MeshId, place: Place) {
        assert!(self.nodes.iter().all(|n| n.name != name), "two nodes named {name}");
        self.nodes.push(Node { name: name.into(), mesh, place });
    }

    /// One mesh of one material under a node of the same name.
    pub(crate) fn add(&mut self, name: &str, mesh: Mesh, material: MaterialId) {
        self.place(name, vec![(mesh, material)], Place::Here);
    }

    /// One mesh under a node of the same name.
    pub(crate) fn place(&mut self, name: &str, parts: Vec<(Mesh, MaterialId)>, place: Place) {
        let mesh = self.mesh(name, parts);
        self.node(name, mesh, place);
    }

    /// A camera at `eye` looking at `target`; `yfov` in degrees.
    pub(crate) fn look(&mut self, eye: Vec3, target: Vec3, yfov: f64, aspect: f64) {
        let matrix = look_matrix(eye, target);
        self.camera = Some(Camera { matrix, yfov: yfov * (std::f64::consts::PI / 180.0), aspect });
    }

    /// Triangles as placed in the scene.
    pub(crate) fn triangles(&self) -> usize {
        let of = |m: &NamedMesh| m.parts.iter().map(|(p, _)| p.triangles.len()).sum::<usize>();
        self.nodes.iter().map(|n| of(&self.meshes[n.mesh.0])).sum()
    }

    /// Triangles as stored in the file.
    pub(crate) fn stored_triangles(&self) -> usize {
        self.meshes.iter().flat_map(|m| &m.parts).map(|(p, _)| p.triangles.len()).sum()
    }

    pub(crate) fn gltf(&self) -> Vec<File> {
        let name = self.name;
        let (mut doc, bin) = self.document();
        doc["buffers"] = json!([{ "uri": format!("{name}.bin"), "byteLength": bin.len() }]);
        vec![
            File { path: format!("{name}/{name}.gltf"), bytes: print(&doc).into_bytes() },
            File { path: format!("{name}/{name}.bin"), bytes: bin },
        ]
    }

    pub(crate) fn glb(&self) -> Vec<File> {
        let name = self.name;
        let (mut doc, mut bin) = self.document();
        doc["buffers"] = json!([{ "byteLength": bin.len() }]);
        // Nobody reads it here: without the line breaks and indents.
        let mut text: Vec<u8> = print(&doc).lines().map(str::trim_start).collect::<String>().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        bin.resize(bin.len().next_multiple_of(4), 0);
        let mut bytes = b"glTF".to_vec();
        let word = |bytes: &mut Vec<u8>, n: usize| bytes.extend((n as u32).to_le_bytes());
        word(&mut bytes, 2);
        word(&mut bytes, 12 + 8 + text.len() + 8 + bin.len());
        word(&mut bytes, text.len());
        bytes.extend(b"JSON");
        bytes.extend(text);
        word(&mut bytes, bin.len());
        bytes.extend(b"BIN\0");
        bytes.extend(bin);
        vec![File { path: format!("{name}/{name}.glb"), bytes }]
    }

    /// The JSON without its buffers, and the one buffer.
    fn document(&self) -> (Value, Vec<u8>) {
        let mut buffer = Buffer::default();
        let meshes: Vec<Value> = self
            .meshes
            .iter()
            .map(|mesh| {
                let primitives: Vec<Value> = mesh
                    .parts
                    .iter()
                    .map(|(part, material)| {
                        json!({
                            "attributes": {
                                "POSITION": buffer.vectors(&part.positions, true),
                                "NORMAL": buffer.vectors(&part.normals, false),
                            },
                            "indices": buffer.indices(part),
                            "material": material.0,
                            "mode": 4,
                        })
                    })
                    .collect();
                json!({ "name": mesh.name, "primitives": primitives })
            })
            .collect();
        let mut nodes: Vec<Value> = self
            .nodes
            .iter()
            .map(|node| {
                let mut value = json!({ "name": node.name, "mesh": node.mesh.0 });
                match node.place {
                    Place::Here => {}
                    Place::Trs { translation, rotation, scale } => {
                        if translation != Vec3::default() {
                            value["translation"] = numbers(&translation.array());
                        }
                        if rotation[3] != 1.0 {
                            value["rotation"] = numbers(&rotation);
                        }
                        if scale != 1.0 {
                            value["scale"] = numbers(&[scale; 3]);
                        }
                    }
                    Place::Matrix(m) => {
                        let columns = [(m.x, 0.0), (m.y, 0.0), (m.z, 0.0), (m.t, 1.0)];
                        let flat: Vec<f64> = columns.iter().flat_map(|(p, w)| [p.x, p.y, p.z, *w]).collect();
                        value["matrix"] = numbers(&flat);
                    }
                }
                value
            })
            .collect();
        let mut doc = json!({
            "asset": {
                "version": "2.0",
                "generator": "hotspot-scenes",
                "copyright": "CC0-1.0 (public domain)",
            },
            "scene": 0,
            "scenes": [{ "name": self.name }],
            "materials": self.materials.iter().map(|(n, s)| material_json(n, *s)).collect::<Vec<_>>(),
            "meshes": meshes,
            "accessors": buffer.accessors,
            "bufferViews": buffer.views,
        });
        if let Some(camera) = &self.camera {
            nodes.push(json!({ "name": "Camera", "camera": 0, "matrix": numbers(&camera.matrix) }));
            doc["cameras"] = json!([{
                "name": "Camera",
                "type": "perspective",
                "perspective": { "yfov": camera.yfov, "aspectRatio": camera.aspect, "znear": 0.01 },
            }]);
        }
        doc["scenes"][0]["nodes"] = json!((0..nodes.len()).collect::<Vec<_>>());
        doc["nodes"] = Value::Array(nodes);
        if let Some(rgb) = self.environment {
            doc["scenes"][0]["extras"] = json!({ "environment": { "constant": numbers(&rgb) } });
        }
        let mut used: Vec<&str> = self.materials.iter().flat_map(|(_, s)| extensions(*s)).collect();
        used.sort_unstable();
        used.dedup();
        doc["extensionsUsed"] = json!(used);
        (doc, buffer.bytes)
    }
}

/// The columns of a camera's matrix: at `eye`, looking at `target`, upright.
pub(crate) fn look_matrix(eye: Vec3, target: Vec3) -> [f64; 16] {
    let back = (eye - target).unit();
    let right = Y.cross(back).unit();
    let up = back.cross(right);
    let columns = [(right, 0.0), (up, 0.0), (back, 0.0), (eye, 1.0)];
    let mut matrix = [0.0; 16];
    for (c, (p, w)) in columns.into_iter().enumerate() {
        matrix[c * 4..c * 4 + 4].copy_from_slice(&[p.x, p.y, p.z, w]);
    }
    matrix
}

fn extensions(surface: Surface) -> Vec<&'static str> {
    match surface {
        Surface::Matte(_) => vec!["KHR_materials_specular"],
        Surface::Substrate { .. } => vec!["KHR_materials_specular", "KHR_materials_ior"],
        Surface::Metal { .. } => vec![],
        Surface::Light { .. } => vec!["KHR_materials_specular", "KHR_materials_emissive_strength"],
        Surface::Glass { solid, .. } => {
            let mut list = vec!["KHR_materials_transmission", "KHR_materials_ior"];
            if solid {
                list.push("KHR_materials_volume");
            }
            list
        }
    }
}

fn material_json(name: &str, surface: Surface) -> Value {
    let pbr = |base: [f64; 3], metallic: f64, roughness: f64| {
        json!({
            "baseColorFactor": numbers(&[base[0], base[1], base[2], 1.0]),
            "metallicFactor": metallic,
            "roughnessFactor": roughness,
        })
    };
    let matte = json!({ "specularFactor": 0.0 });
    let mut material = json!({ "name": name });
    if !matches!(surface, Surface::Light { .. }) {
        material["doubleSided"] = json!(true);
    }
    match surface {
        Surface::Matte(base) => {
            material["pbrMetallicRoughness"] = pbr(base, 0.0, 1.0);
            material["extensions"] = json!({ "KHR_materials_specular": matte });
        }
        Surface::Substrate { base, roughness, ior, specular } => {
            material["pbrMetallicRoughness"] = pbr(base, 0.0, roughness);
            material["extensions"] = json!({
                "KHR_materials_ior": { "ior": ior },
                "KHR_materials_specular": { "specularFactor": specular },
            });
        }
        Surface::Metal { base, roughness } => {
            material["pbrMetallicRoughness"] = pbr(base, 1.0, roughness);
        }
        Surface::Light { base, radiance } => {
            // The factor may not exceed 1: the largest component goes into the strength.
            let strength = radiance.into_iter().fold(0.0, f64::max);
            let factor = radiance.map(|r| (r / strength * 1e7 + 0.5).floor() / 1e7);
            material["pbrMetallicRoughness"] = pbr(base, 0.0, 1.0);
            material["emissiveFactor"] = numbers(&factor);
            material["extensions"] = json!({
                "KHR_materials_emissive_strength": { "emissiveStrength": strength },
                "KHR_materials_specular": matte,
            });
        }
        Surface::Glass { base, ior, solid } => {
            material["pbrMetallicRoughness"] = pbr(base, 0.0, 0.0);
            let mut list = json!({
                "KHR_materials_ior": { "ior": ior },
                "KHR_materials_transmission": { "transmissionFactor": 1.0 },
            });
            if solid {
                list["KHR_materials_volume"] = json!({ "thicknessFactor": 1.0 });
            }
            material["extensions"] = list;
        }
    }
    material
}

/// Numbers rounded to a billionth, and without a negative zero.
pub(crate) fn numbers(list: &[f64]) -> Value {
    let round = |x: &f64| (x * 1e9 + 0.5).floor() / 1e9 + 0.0;
    Value::Array(list.iter().map(|x| json!(round(x))).collect())
}

#[derive(Default)]
struct Buffer {
    bytes: Vec<u8>,
    accessors: Vec<Value>,
    views: Vec<Value>,
}

impl Buffer {
    fn view(&mut self, start: usize, target: u32) -> usize {
        let length = self.bytes.len() - start;
        self.views.push(json!({ "buffer": 0, "byteOffset": start, "byteLength": length, "target": target }));
        while !self.bytes.len().is_multiple_of(4) {
            self.bytes.push(0);
        }
        self.views.len() - 1
    }

    fn vectors(&mut self, points: &[Vec3], bounds: bool) -> usize {
        let start = self.bytes.len();
        let (mut lo, mut hi) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for p in points {
            for (axis, x) in p.array().into_iter().enumerate() {
                let x = x as f32 + 0.0;
                lo[axis] = lo[axis].min(x);
                hi[axis] = hi[axis].max(x);
                self.bytes.extend(x.to_le_bytes());
            }
        }
        let view = self.view(start, 34962);
        let mut accessor =
            json!({ "bufferView": view, "componentType": 5126, "count": points.len(), "type": "VEC3" });
        if bounds {
            accessor["min"] = json!(lo.map(f64::from));
            accessor["max"] = json!(hi.map(f64::from));
        }
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    fn indices(&mut self, mesh: &Mesh) -> usize {
        let start = self.bytes.len();
        // The largest 16-bit index is the restart marker, which glTF forbids.
        let short = mesh.positions.len() <= 65535;
        for i in mesh.triangles.iter().flatten() {
            if short {
                self.bytes.extend((*i as u16).to_le_bytes());
            } else {
                self.bytes.extend(i.to_le_bytes());
            }
        }
        let view = self.view(start, 34963);
        self.accessors.push(json!({
            "bufferView": view,
            "componentType": if short { 5123 } else { 5125 },
            "count": mesh.triangles.len() * 3,
            "type": "SCALAR",
        }));
        self.accessors.len() - 1
    }
}

/// The order in which a reader wants to see the keys; unlisted ones follow alphabetically.
const KEY_ORDER: [&str; 25] = [
    "name",
    "asset",
    "version",
    "extensionsUsed",
    "scene",
    "scenes",
    "cameras",
    "nodes",
    "meshes",
    "materials",
    "mesh",
    "camera",
    "bufferView",
    "buffer",
    "type",
    "componentType",
    "count",
    "pbrMetallicRoughness",
    "emissiveFactor",
    "POSITION",
    "attributes",
    "indices",
    "extensions",
    "accessors",
    "bufferViews",
];

/// Pretty JSON: two spaces, arrays of scalars on one line.
pub(crate) fn print(value: &Value) -> String {
    let mut text = String::new();
    print_value(value, 0, &mut text);
    text.push('\n');
    text
}

/// A value without parts; floats as Rust prints them, which no dependency can change.
fn scalar(value: &Value) -> String {
    match value.as_f64() {
        Some(x) if value.is_f64() => format!("{x:?}"),
        _ => value.to_string(),
    }
}

fn print_value(value: &Value, depth: usize, out: &mut String) {
    let flat = |v: &Value| !v.is_array() && !v.is_object();
    match value {
        Value::Array(list) if list.iter().all(flat) => {
            let items: Vec<String> = list.iter().map(scalar).collect();
            out.push_str(&format!("[{}]", items.join(", ")));
        }
        Value::Array(list) => print_items(list.iter().map(|v| (String::new(), v)), "[]", depth, out),
        Value::Object(map) => {
            print_items(
                sorted(map).into_iter().map(|(k, v)| (format!("{}: ", json!(k)), v)),
                "{}",
                depth,
                out,
            );
        }
        other => out.push_str(&scalar(other)),
    }
}

fn print_items<'a>(
    items: impl Iterator<Item = (String, &'a Value)>,
    brackets: &str,
    depth: usize,
    out: &mut String,
) {
    let (open, close) = brackets.split_at(1);
    out.push_str(open);
    for (i, (label, item)) in items.enumerate() {
        if i > 0 {
            out.push(',');
        }
        out.push('\n');
        out.push_str(&"  ".repeat(depth + 1));
        out.push_str(&label);
        print_value(item, depth + 1, out);
    }
    out.push('\n');
    out.push_str(&"  ".repeat(depth));
    out.push_str(close);
}

fn sorted(map: &Map<String, Value>) -> Vec<(&String, &Value)> {
    let rank = |key: &str| KEY_ORDER.iter().position(|k| *k == key).unwrap_or(KEY_ORDER.len());
    let mut list: Vec<(&String, &Value)> = map.iter().collect();
    list.sort_by(|a, b| rank(a.0).cmp(&rank(b.0)).then_with(|| a.0.cmp(b.0)));
    list
}
