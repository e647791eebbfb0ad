//! Geometry: vertex colours, and the ways to store the same shape.

use super::doc::{Doc, F32, U8, U16, matte, with};
use super::stage::{Lit, card};
use crate::gltf_writer::numbers;
use crate::math::{Vec3, Y, Z, quaternion, sin_cos, smoothstep, v};
use crate::shapes::{Mesh, join, sheet, sphere};
use serde_json::json;

/// Vertex colours are linear and multiply the base colour. Above: floats, bytes and shorts. Below: the same by factors;
/// and a wheel of colours.
pub(super) fn vertex_colors() -> Doc {
    const BYTES: [[u8; 3]; 4] = [[51, 51, 51], [255, 51, 26], [51, 204, 77], [128, 153, 255]];
    let mut doc = Doc::new("vertex-colors");
    doc.stage(Lit::Well);
    // Four fields, each of one colour.
    let field = |i: usize| card(0.4, 0.4).at((i % 2) as f64 * 0.4 - 0.2, 0.2 - (i / 2) as f64 * 0.4, 0.0);
    let quilt = join((0..4).map(field));
    let white = doc.matte("White", [1.0; 3]);
    // Bytes of alpha 0: opaque all the same, since the material is.
    let all: Vec<[u8; 3]> = BYTES.iter().flat_map(|c| [*c; 4]).collect();
    let floats: Vec<[f64; 3]> = all.iter().map(|c| c.map(|c| f64::from(c) / 255.0)).collect();
    let bytes: Vec<u8> = all.iter().flat_map(|c| [c[0], c[1], c[2], 0]).collect();
    let shorts: Vec<u8> = all
        .iter()
        .flat_map(|c| [c[0], c[1], c[2], 255])
        .flat_map(|c| (u16::from(c) * 257).to_le_bytes())
        .collect();
    let normalized = json!({ "normalized": true });
    let accessors = [
        ("Floats", doc.floats(&floats)),
        ("Bytes", doc.accessor(&bytes, U8, "VEC4", all.len(), normalized.clone())),
        ("Shorts", doc.accessor(&shorts, U16, "VEC4", all.len(), normalized)),
    ];
    let part = doc.part(&quilt);
    for (i, (name, accessor)) in accessors.into_iter().enumerate() {
        let mut part = part.clone();
        part["attributes"]["COLOR_0"] = json!(accessor);
        let mesh = doc.mesh(&part, white);
        doc.place(name, mesh, [(i as f64 - 1.0) * 1.0, 1.37, 0.0]);
    }
    let mut fields = Vec::new();
    for (i, color) in BYTES.into_iter().enumerate() {
        let material = doc.matte(&format!("Field {i}"), color.map(|c| f64::from(c) / 255.0));
        let mut part = doc.part(&field(i));
        part["material"] = json!(material);
        fields.push(part);
    }
    let mesh = doc.push("meshes", json!({ "primitives": fields }));
    doc.place("Factors", mesh, [-1.0, 0.47, 0.0]);
    // A wheel, white in the middle; once under white, once under a grey base colour.
    let mut wheel = Mesh { open: true, ..Mesh::default() };
    let mut colors = vec![[1.0; 3]];
    wheel.positions.push(Vec3::default());
    for i in 0..36u32 {
        let turn = f64::from(i) / 36.0;
        let (s, c) = sin_cos(turn);
        wheel.positions.push(v(c, s, 0.0) * 0.42);
        colors.push([0.0, 1.0 / 3.0, 2.0 / 3.0].map(|hue| {
            let apart = (turn - hue).abs();
            (2.0 - 6.0 * apart.min(1.0 - apart)).clamp(0.0, 1.0)
        }));
        wheel.triangles.push([0, i + 1, (i + 1) % 36 + 1]);
    }
    wheel.normals = vec![Z; wheel.positions.len()];
    let mut part = doc.part(&wheel);
    part["attributes"]["COLOR_0"] = json!(doc.floats(&colors));
    let mesh = doc.mesh(&part, white);
    doc.place("Wheel", mesh, [0.0, 0.47, 0.0]);
    let grey = doc.matte("Grey", [0.3; 3]);
    let mesh = doc.mesh(&part, grey);
    doc.place("Wheel under grey", mesh, [1.0, 0.47, 0.0]);
    doc
}

/// A hilly sheet facing the viewer.
fn hills(height: f64) -> Mesh {
    sheet(16, 16, |u, w| {
        let d = (u - 0.5) * (u - 0.5) + (w - 0.5) * (w - 0.5);
        v(u - 0.5, w - 0.5, height * (1.0 - smoothstep(0.0, 0.25, d)))
    })
}

/// A flat sheet whose middle is raised by a sparse accessor, one that is sparse over nothing, and the plain twin.
pub(super) fn sparse() -> Doc {
    let mut doc = Doc::new("sparse-accessor");
    doc.stage(Lit::Well);
    let paint = doc.matte("Paint", [0.3, 0.55, 0.6]);
    let (flat, raised) = (hills(0.0), hills(0.35));
    let twin = doc.part(&raised);
    let moved: Vec<usize> = (0..flat.positions.len()).filter(|i| raised.positions[*i].z != 0.0).collect();
    let indices: Vec<u8> = moved.iter().flat_map(|i| (*i as u16).to_le_bytes()).collect();
    let bytes = |points: &mut dyn Iterator<Item = Vec3>| -> Vec<u8> {
        points.flat_map(|p| p.array()).flat_map(|x| (x as f32).to_le_bytes()).collect()
    };
    let values = bytes(&mut moved.iter().map(|i| raised.positions[*i]));
    let (indices, values) = (doc.view(&indices), doc.view(&values));
    let base = doc.view(&bytes(&mut flat.positions.iter().copied()));
    let mut part = twin.clone();
    let bounds = |z: f64| json!({ "min": [-0.5, -0.5, 0.0], "max": [0.5, 0.5, z] });
    let peak = f64::from(0.35f32);
    part["attributes"]["POSITION"] = json!(doc.push(
        "accessors",
        with(
            bounds(peak),
            json!({
                "bufferView": base, "componentType": F32, "type": "VEC3", "count": flat.positions.len(),
                "sparse": {
                    "count": moved.len(),
                    "indices": { "bufferView": indices, "componentType": U16 },
                    "values": { "bufferView": values },
                },
            })
        )
    ));
    let sparse = doc.mesh(&part, paint);
    let plain = doc.mesh(&twin, paint);
    // No bufferView: zeros, replaced at all four corners.
    let corners = card(0.8, 0.8);
    let values = doc.view(&bytes(&mut corners.positions.iter().copied()));
    let indices = doc.view(&[0, 1, 2, 3]);
    let mut part = doc.part(&corners);
    part["attributes"]["POSITION"] = json!(doc.push(
        "accessors",
        json!({
            "componentType": F32, "type": "VEC3", "count": 4, "min": numbers(&[-0.4, -0.4, 0.0]), "max": numbers(&[0.4, 0.4, 0.0]),
            "sparse": {
                "count": 4,
                "indices": { "bufferView": indices, "componentType": U8 },
                "values": { "bufferView": values },
            },
        })
    ));
    let zeros = doc.mesh(&part, paint);
    let turn = |mesh: usize, name: &str, x: f64| {
        // A little from the side, so that the hill is seen.
        let rotation = numbers(&quaternion(Y, 0.07));
        json!({ "name": name, "mesh": mesh, "translation": numbers(&[x, 0.8, 0.0]), "rotation": rotation })
    };
    doc.root(turn(sparse, "Sparse", -1.1));
    doc.root(turn(plain, "Plain", 0.0));
    doc.root(turn(zeros, "Sparse over nothing", 1.1));
    doc
}

/// KHR_mesh_quantization: a ball of bytes, one of shorts, and the plain twin.
pub(super) fn quantization() -> Doc {
    let mut doc = Doc::new("mesh-quantization");
    doc.required.push("KHR_mesh_quantization");
    doc.stage(Lit::Well);
    let paint = doc.matte("Paint", [0.6, 0.35, 0.5]);
    let ball = sphere(0.48, 32);
    let plain = doc.part(&ball);
    let round = |x: f64, most: f64| (x * most + 0.5).floor();
    let normals: Vec<u8> = ball
        .normals
        .iter()
        .flat_map(|n| n.array().map(|x| round(x, 127.0) as i8 as u8).into_iter().chain([0]))
        .collect();
    let view = doc.view(&normals);
    doc.amend("bufferViews", view, json!({ "byteStride": 4 }));
    let normal = doc.push(
        "accessors",
        json!({ "bufferView": view, "componentType": 5120, "normalized": true, "type": "VEC3", "count": ball.normals.len() }),
    );
    // Signed shorts, normalized, scaled by the node; and unsigned bytes as they are, moved by it too.
    let shorts: Vec<[i16; 3]> =
        ball.positions.iter().map(|p| p.array().map(|x| round(x / 0.48, 32767.0) as i16)).collect();
    let bytes: Vec<[u8; 3]> =
        ball.positions.iter().map(|p| p.array().map(|x| round(x / 0.96 + 0.5, 255.0) as u8)).collect();
    let data: Vec<u8> =
        shorts.iter().flat_map(|p| [p[0], p[1], p[2], 0]).flat_map(i16::to_le_bytes).collect();
    let view = doc.view(&data);
    doc.amend("bufferViews", view, json!({ "byteStride": 8 }));
    let bound = |pick: fn(i64, i64) -> i64, all: &[[i64; 3]]| -> Vec<i64> {
        (0..3).map(|n| all.iter().map(|p| p[n]).reduce(pick).expect("a ball has vertices")).collect()
    };
    let wide: Vec<[i64; 3]> = shorts.iter().map(|p| p.map(i64::from)).collect();
    let short = doc.push(
        "accessors",
        json!({
            "bufferView": view, "componentType": 5122, "normalized": true, "type": "VEC3", "count": shorts.len(),
            "min": bound(i64::min, &wide), "max": bound(i64::max, &wide),
        }),
    );
    let data: Vec<u8> = bytes.iter().flat_map(|p| [p[0], p[1], p[2], 0]).collect();
    let view = doc.view(&data);
    doc.amend("bufferViews", view, json!({ "byteStride": 4 }));
    let wide: Vec<[i64; 3]> = bytes.iter().map(|p| p.map(i64::from)).collect();
    let byte = doc.push(
        "accessors",
        json!({
            "bufferView": view, "componentType": U8, "type": "VEC3", "count": bytes.len(),
            "min": bound(i64::min, &wide), "max": bound(i64::max, &wide),
        }),
    );
    let mut meshes = vec![doc.mesh(&plain, paint)];
    for position in [short, byte] {
        let mut part = plain.clone();
        part["attributes"] = json!({ "POSITION": position, "NORMAL": normal });
        meshes.push(doc.mesh(&part, paint));
    }
    doc.place("Plain", meshes[0], [0.0, 0.75, 0.0]);
    doc.root(json!({
        "name": "Shorts", "mesh": meshes[1], "translation": [-1.1, 0.75, 0.0], "scale": numbers(&[0.48; 3]),
    }));
    doc.root(json!({
        "name": "Bytes", "mesh": meshes[2], "translation": numbers(&[1.1 - 0.48, 0.75 - 0.48, -0.48]), "scale": numbers(&[0.96 / 255.0; 3]),
    }));
    doc
}

/// Above: strips and a fan, without normals and indices. Below: the same as a list of triangles.
pub(super) fn strips_fans() -> Doc {
    let mut doc = Doc::new("strips-fans");
    doc.stage(Lit::Well);
    // Single-sided lights would be dark if a strip's odd triangles were not turned round: these emit a little.
    let glow = json!({ "emissiveFactor": numbers(&[0.1, 0.25, 0.1]) });
    let paint = doc.material("Paint", with(matte([0.7, 0.55, 0.2]), glow));
    let ribbon: Vec<[f64; 3]> = (0..18)
        .map(|i| {
            let x = f64::from(i / 2) / 8.0;
            let (s, _) = sin_cos(x);
            [x * 1.5 - 0.75, 0.2 * s + if i % 2 == 0 { 0.2 } else { -0.2 }, 0.25 * s]
        })
        .collect();
    let star: Vec<[f64; 3]> = (0..12)
        .map(|i| {
            if i == 0 {
                return [0.0, 0.0, 0.25];
            }
            let (s, c) = sin_cos(0.25 + f64::from(i - 1) / 10.0);
            let r = if i % 2 == 1 { 0.42 } else { 0.2 };
            [c * r, s * r, 0.0]
        })
        .collect();
    let (strip, fan) = (doc.floats(&ribbon), doc.floats(&star));
    let strip_list: Vec<u32> =
        (0..16).flat_map(|i| if i % 2 == 0 { [i, i + 1, i + 2] } else { [i, i + 2, i + 1] }).collect();
    let fan_list: Vec<u32> = (1..11).flat_map(|i| [0, i, i + 1]).collect();
    let (strip_list, fan_list) = (doc.indices(&strip_list), doc.indices(&fan_list));
    for (name, position, mode, list, at) in [
        ("Strip", strip, 5, None, [-0.75, 1.35, 0.0]),
        ("Fan", fan, 6, None, [0.75, 1.35, 0.0]),
        ("Strip as triangles", strip, 4, Some(strip_list), [-0.75, 0.5, 0.0]),
        ("Fan as triangles", fan, 4, Some(fan_list), [0.75, 0.5, 0.0]),
    ] {
        let mut part = json!({ "attributes": { "POSITION": position }, "mode": mode });
        if let Some(list) = list {
            part["indices"] = json!(list);
        }
        let mesh = doc.mesh(&part, paint);
        doc.place(name, mesh, at);
    }
    doc
}
