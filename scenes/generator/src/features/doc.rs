//! A glTF document in the making: like `gltf_writer`, but open to everything that the format has, in one file each.
//!
//! Elements are JSON, buffers and pictures data URIs. Numbers are written as in `gltf_writer`.

use super::png::{Png, data_uri};
use crate::gltf_writer::{File, look_matrix, numbers, print};
use crate::math::Vec3;
use crate::shapes::Mesh;
use serde_json::{Map, Value, json};

/// Component types of accessors.
pub(super) const U8: u32 = 5121;
pub(super) const U16: u32 = 5123;
pub(super) const F32: u32 = 5126;

/// A document under construction. Elements are referred to by their index.
#[derive(Default)]
pub(super) struct Doc {
    name: &'static str,
    bytes: Vec<u8>,
    lists: Map<String, Value>,
    /// Nodes of scene 0 (others set `scenes` themselves).
    roots: Vec<usize>,
    /// Constant radiance from all around.
    pub(super) environment: Option<[f64; 3]>,
    /// Extensions without which the file would be misread.
    pub(super) required: Vec<&'static str>,
    /// Written in place of the one scene of all root nodes.
    pub(super) scenes: Option<Value>,
    /// Lights of KHR_lights_punctual.
    pub(super) lights: Vec<Value>,
    /// Names of KHR_materials_variants.
    pub(super) variants: Vec<&'static str>,
}

impl Doc {
    pub(super) fn new(name: &'static str) -> Doc {
        Doc { name, ..Doc::default() }
    }

    /// Appends to one of the top-level arrays.
    pub(super) fn push(&mut self, list: &str, value: Value) -> usize {
        let list = self.lists.entry(list).or_insert_with(|| json!([]));
        let array = list.as_array_mut().expect("top-level lists are arrays");
        array.push(value);
        array.len() - 1
    }

    /// Adds members to an element of a top-level array.
    pub(super) fn amend(&mut self, list: &str, index: usize, more: Value) {
        merge(&mut self.lists[list][index], more);
    }

    /// A view of bytes, aligned to four.
    pub(super) fn view(&mut self, bytes: &[u8]) -> usize {
        let start = self.bytes.len();
        self.bytes.extend(bytes);
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.push("bufferViews", json!({ "buffer": 0, "byteOffset": start, "byteLength": bytes.len() }))
    }

    /// An accessor over all of `bytes`; `more` is merged into it.
    pub(super) fn accessor(
        &mut self,
        bytes: &[u8],
        component: u32,
        kind: &str,
        count: usize,
        more: Value,
    ) -> usize {
        let view = self.view(bytes);
        let mut accessor =
            json!({ "bufferView": view, "componentType": component, "type": kind, "count": count });
        merge(&mut accessor, more);
        self.push("accessors", accessor)
    }

    /// An accessor of floats, with bounds (which positions and key times need).
    pub(super) fn floats<const N: usize>(&mut self, rows: &[[f64; N]]) -> usize {
        let bytes: Vec<u8> = rows.iter().flatten().flat_map(|x| (*x as f32 + 0.0).to_le_bytes()).collect();
        let bound = |pick: fn(f32, f32) -> f32| -> Vec<f64> {
            (0..N)
                .map(|n| {
                    let all = rows.iter().map(|row| row[n] as f32 + 0.0);
                    f64::from(all.reduce(pick).expect("accessors are not empty"))
                })
                .collect()
        };
        let bounds = json!({ "min": bound(f32::min), "max": bound(f32::max) });
        self.accessor(&bytes, F32, kind(N), rows.len(), bounds)
    }

    /// An accessor of indices.
    pub(super) fn indices(&mut self, list: &[u32]) -> usize {
        let bytes: Vec<u8> = list.iter().flat_map(|i| (*i as u16).to_le_bytes()).collect();
        self.accessor(&bytes, U16, "SCALAR", list.len(), json!({}))
    }

    /// A primitive without its material.
    pub(super) fn part(&mut self, mesh: &Mesh) -> Value {
        let rows = |list: &[Vec3]| list.iter().map(|p| p.array()).collect::<Vec<_>>();
        let flat: Vec<u32> = mesh.triangles.iter().flatten().copied().collect();
        json!({
            "attributes": {
                "POSITION": self.floats(&rows(&mesh.positions)),
                "NORMAL": self.floats(&rows(&mesh.normals)),
            },
            "indices": self.indices(&flat),
        })
    }

    /// A primitive with texture coordinates.
    pub(super) fn textured(&mut self, mesh: &Mesh, uvs: &[[f64; 2]]) -> Value {
        let mut part = self.part(mesh);
        part["attributes"]["TEXCOORD_0"] = json!(self.floats(uvs));
        part
    }

    /// A mesh of one primitive.
    pub(super) fn mesh(&mut self, part: &Value, material: usize) -> usize {
        let mut part = part.clone();
        part["material"] = json!(material);
        self.push("meshes", json!({ "primitives": [part] }))
    }

    /// A texture in a sampler of its own.
    pub(super) fn texture(&mut self, picture: &Png, sampler: Value) -> usize {
        let source = self.push("images", json!({ "uri": picture.uri() }));
        let sampler = self.push("samplers", sampler);
        self.push("textures", json!({ "source": source, "sampler": sampler }))
    }

    /// A material from its name and its JSON. All are double-sided but those that emit.
    pub(super) fn material(&mut self, name: &str, mut value: Value) -> usize {
        value["name"] = json!(name);
        if value.get("emissiveFactor").is_none() {
            value["doubleSided"] = json!(true);
        }
        self.push("materials", value)
    }

    /// Lambert.
    pub(super) fn matte(&mut self, name: &str, color: [f64; 3]) -> usize {
        self.material(name, matte(color))
    }

    /// A node at the root of scene 0.
    pub(super) fn root(&mut self, node: Value) -> usize {
        let index = self.push("nodes", node);
        self.roots.push(index);
        index
    }

    /// A mesh under a root node, moved.
    pub(super) fn place(&mut self, name: &str, mesh: usize, at: [f64; 3]) -> usize {
        self.root(json!({ "name": name, "mesh": mesh, "translation": numbers(&at) }))
    }

    /// A shape of one material under a root node, moved.
    pub(super) fn add(&mut self, name: &str, shape: &Mesh, material: usize, at: [f64; 3]) -> usize {
        let part = self.part(shape);
        let mesh = self.mesh(&part, material);
        self.place(name, mesh, at)
    }

    /// A perspective camera for pictures of 3:2; `yfov` in degrees.
    pub(super) fn look(&mut self, name: &str, eye: Vec3, target: Vec3, yfov: f64) -> usize {
        let yfov = yfov * (std::f64::consts::PI / 180.0);
        let perspective = json!({ "yfov": yfov, "aspectRatio": 1.5, "znear": 0.01 });
        self.camera(name, eye, target, json!({ "type": "perspective", "perspective": perspective }))
    }

    /// A camera of any type.
    pub(super) fn camera(&mut self, name: &str, eye: Vec3, target: Vec3, mut camera: Value) -> usize {
        camera["name"] = json!(name);
        let camera = self.push("cameras", camera);
        let matrix = numbers(&look_matrix(eye, target));
        self.root(json!({ "name": name, "camera": camera, "matrix": matrix }))
    }

    /// The file.
    pub(super) fn file(self) -> File {
        let mut doc = Value::Object(self.lists);
        doc["asset"] = json!({
            "version": "2.0",
            "generator": "hotspot-scenes",
            "copyright": "CC0-1.0 (public domain)",
        });
        doc["scene"] = json!(0);
        doc["scenes"] = self.scenes.unwrap_or_else(|| json!([{ "name": self.name, "nodes": self.roots }]));
        if let Some(rgb) = self.environment {
            for scene in doc["scenes"].as_array_mut().expect("scenes are an array") {
                scene["extras"] = json!({ "environment": { "constant": numbers(&rgb) } });
            }
        }
        let uri = data_uri("application/octet-stream", &self.bytes);
        doc["buffers"] = json!([{ "uri": uri, "byteLength": self.bytes.len() }]);
        if !self.lights.is_empty() {
            merge(&mut doc, json!({ "extensions": { "KHR_lights_punctual": { "lights": self.lights } } }));
        }
        if !self.variants.is_empty() {
            let names: Vec<Value> = self.variants.iter().map(|name| json!({ "name": name })).collect();
            merge(&mut doc, json!({ "extensions": { "KHR_materials_variants": { "variants": names } } }));
        }
        let mut used = Vec::new();
        extensions(&doc, &mut used);
        used.extend(self.required.iter().map(|name| (*name).to_owned()));
        used.sort_unstable();
        used.dedup();
        if !used.is_empty() {
            doc["extensionsUsed"] = json!(used);
        }
        if !self.required.is_empty() {
            doc["extensionsRequired"] = json!(self.required);
        }
        File { path: format!("features/{}.gltf", self.name), bytes: print(&doc).into_bytes() }
    }
}

/// Names of the extensions in use anywhere below.
fn extensions(value: &Value, out: &mut Vec<String>) {
    match value {
        Value::Array(list) => list.iter().for_each(|item| extensions(item, out)),
        Value::Object(map) => {
            for (key, item) in map {
                if key == "extensions" {
                    out.extend(item.as_object().into_iter().flat_map(|all| all.keys().cloned()));
                }
                extensions(item, out);
            }
        }
        _ => {}
    }
}

/// Adds the members of `more` to those of `value`.
pub(super) fn merge(value: &mut Value, more: Value) {
    let Value::Object(more) = more else { return };
    for (key, item) in more {
        match value.get_mut(&key) {
            Some(old) if old.is_object() => merge(old, item),
            _ => value[key] = item,
        }
    }
}

/// `value` with the members of `more`.
pub(super) fn with(mut value: Value, more: Value) -> Value {
    merge(&mut value, more);
    value
}

/// A Lambertian surface: a dielectric without specular reflection.
pub(super) fn matte(color: [f64; 3]) -> Value {
    with(
        pbr(color, 0.0, 1.0),
        json!({ "extensions": { "KHR_materials_specular": { "specularFactor": 0.0 } } }),
    )
}

/// The core model.
pub(super) fn pbr(color: [f64; 3], metallic: f64, roughness: f64) -> Value {
    json!({ "pbrMetallicRoughness": {
        "baseColorFactor": numbers(&[color[0], color[1], color[2], 1.0]),
        "metallicFactor": metallic,
        "roughnessFactor": roughness,
    } })
}

/// A surface that emits `color` times `strength` and reflects nothing.
pub(super) fn light(color: [f64; 3], strength: f64) -> Value {
    with(
        matte([0.0; 3]),
        json!({
            "emissiveFactor": numbers(&color),
            "extensions": { "KHR_materials_emissive_strength": { "emissiveStrength": strength } },
        }),
    )
}

/// Lambert under a texture.
pub(super) fn painted(texture: usize) -> Value {
    with(matte([1.0; 3]), json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": texture } } }))
}

fn kind(components: usize) -> &'static str {
    match components {
        1 => "SCALAR",
        2 => "VEC2",
        3 => "VEC3",
        4 => "VEC4",
        _ => "MAT4",
    }
}
