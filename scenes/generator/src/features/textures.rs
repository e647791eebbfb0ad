//! Textures: how they are looked up, and what they say.

use super::doc::{Doc, light, matte, merge, painted, pbr, with};
use super::png::Png;
use super::stage::{CLAMP, Lit, MIRROR, REPEAT, WHOLE, card, card_uvs, checker, letter, sampler};
use crate::gltf_writer::numbers;
use crate::math::{sin_cos, v};
use crate::shapes::{Mesh, sheet, sphere};
use serde_json::json;

/// Six cards; the lower ones show the picture's surroundings too. Wraps differ across and down on the last.
pub(super) fn wrap() -> Doc {
    let mut doc = Doc::new("texture-wrap");
    doc.stage(Lit::Well);
    let around = [-0.75, -0.5, 1.75, 2.0];
    let cards = [
        ("Bilinear", REPEAT, REPEAT, false, [0.0, 0.0, 0.5, 0.5]),
        ("Nearest", REPEAT, REPEAT, true, [0.0, 0.0, 0.5, 0.5]),
        ("Clamp", CLAMP, CLAMP, false, around),
        ("Repeat", REPEAT, REPEAT, false, around),
        ("Mirror", MIRROR, MIRROR, false, around),
        ("Mirror across, clamp down", MIRROR, CLAMP, false, around),
    ];
    let square = card(0.82, 0.82);
    for (i, (name, s, t, nearest, span)) in cards.into_iter().enumerate() {
        let texture = doc.texture(&letter(), sampler(s, t, nearest));
        let material = doc.material(name, painted(texture));
        let part = doc.textured(&square, &card_uvs(span));
        let mesh = doc.mesh(&part, material);
        let (x, y) = ((i % 3) as f64, if i < 3 { 1.36 } else { 0.46 });
        doc.place(name, mesh, [(x - 1.0) * 1.0, y, 0.0]);
    }
    doc
}

/// A dome over the part of a unit square from (u0, v0) to (u1, v1), v downwards, with texture coordinates.
fn dome([u0, v0, u1, v1]: [f64; 4], steps: [usize; 2]) -> (Mesh, Vec<[f64; 2]>) {
    let at = |u: f64, w: f64| [u0 + (u1 - u0) * u, v1 + (v0 - v1) * w];
    let surface = |u: f64, w: f64| {
        let [tu, tv] = at(u, w);
        let ((sx, cx), (sy, cy)) = (sin_cos((tu - 0.5) * 0.28), sin_cos((0.5 - tv) * 0.2));
        v(sx * cy, sy, cx * cy - 1.0) * 0.95
    };
    let mut mesh = sheet(steps[0], steps[1], surface);
    // The sphere's own normals, so that parts meet without a seam.
    for (n, p) in mesh.normals.iter_mut().zip(&mesh.positions) {
        *n = (*p + v(0.0, 0.0, 0.95)).unit();
    }
    let row = steps[1] + 1;
    let uvs = (0..mesh.positions.len())
        .map(|i| at((i / row) as f64 / steps[0] as f64, (i % row) as f64 / steps[1] as f64))
        .collect();
    (mesh, uvs)
}

/// Left: roughness rising to the right, metallic rows and dielectric rows, from a texture. Right: by factors.
pub(super) fn metallic_roughness() -> Doc {
    const ROUGHNESS: [u8; 4] = [40, 90, 150, 230];
    const METALLIC: [u8; 3] = [255, 128, 0];
    let base = [0.85, 0.55, 0.25];
    let mut doc = Doc::new("metallic-roughness-texture");
    doc.stage(Lit::Well);
    // Red is not to be read.
    let picture = Png::new(4, 3, |x, y| [255, ROUGHNESS[x], METALLIC[y], 255]);
    let texture = doc.texture(&picture, sampler(CLAMP, CLAMP, true));
    let factors = json!({ "pbrMetallicRoughness": { "metallicRoughnessTexture": { "index": texture } } });
    let material = doc.material("Textured", with(pbr(base, 1.0, 1.0), factors));
    let (mesh, uvs) = dome(WHOLE, [16, 12]);
    let part = doc.textured(&mesh, &uvs);
    let mesh = doc.mesh(&part, material);
    doc.place("By texture", mesh, [-0.8, 0.8, 0.0]);
    let mut parts = Vec::new();
    for (y, metallic) in METALLIC.into_iter().enumerate() {
        for (x, roughness) in ROUGHNESS.into_iter().enumerate() {
            let value = pbr(base, f64::from(metallic) / 255.0, f64::from(roughness) / 255.0);
            let material = doc.material(&format!("Factors {x} {y}"), value);
            let (x, y) = (x as f64 / 4.0, y as f64 / 3.0);
            let (mesh, _) = dome([x, y, x + 0.25, y + 1.0 / 3.0], [4, 4]);
            let mut part = doc.part(&mesh);
            part["material"] = json!(material);
            parts.push(part);
        }
    }
    let mesh = doc.push("meshes", json!({ "primitives": parts }));
    doc.place("By factors", mesh, [0.8, 0.8, 0.0]);
    doc
}

/// Decodes an sRGB value (IEC 61966-2-1) by means that every machine rounds alike.
fn linear(srgb: u8) -> f64 {
    let c = f64::from(srgb) / 255.0;
    if c <= 0.04045 {
        return c / 12.92;
    }
    // x^2.4 is x² times the fifth root of x²; Newton's method from above converges to the last bit.
    let x = (c + 0.055) / 1.055;
    let square = x * x;
    let mut root = 1.0;
    for _ in 0..60 {
        root = (4.0 * root + square / (root * root * root * root)) / 5.0;
    }
    square * root
}

/// A sign whose texture is a light; its twin is of plain lights.
pub(super) fn emissive() -> Doc {
    const COLORS: [[u8; 3]; 8] = [
        [255, 60, 30],
        [255, 188, 0],
        [60, 220, 90],
        [0, 0, 0],
        [40, 120, 255],
        [188, 188, 188],
        [255, 255, 255],
        [180, 40, 200],
    ];
    let mut doc = Doc::new("emissive-texture");
    doc.stage(Lit::Dim);
    doc.environment = Some([0.25; 3]);
    let picture = Png::new(4, 2, |x, y| {
        let [r, g, b] = COLORS[y * 4 + x];
        [r, g, b, 255]
    });
    let texture = doc.texture(&picture, sampler(CLAMP, CLAMP, true));
    let glow = json!({ "emissiveTexture": { "index": texture } });
    let material = doc.material("Sign", with(light([1.0; 3], 0.5), glow));
    let part = doc.textured(&card(1.4, 0.7), &card_uvs(WHOLE));
    let mesh = doc.mesh(&part, material);
    doc.place("By texture", mesh, [-0.8, 0.75, -0.4]);
    let mut parts = Vec::new();
    for (i, color) in COLORS.into_iter().enumerate() {
        let material = doc.material(&format!("Field {i}"), light(color.map(linear), 0.5));
        let (x, y) = ((i % 4) as f64, (i / 4) as f64);
        let mesh = card(0.35, 0.35).at((x - 1.5) * 0.35, (0.5 - y) * 0.35, 0.0);
        let mut part = doc.part(&mesh);
        part["material"] = json!(material);
        parts.push(part);
    }
    let mesh = doc.push("meshes", json!({ "primitives": parts }));
    doc.place("By factors", mesh, [0.8, 0.75, -0.4]);
    // Balls that tell what light arrives.
    let white = doc.matte("White", [0.8; 3]);
    let part = doc.part(&sphere(0.14, 24));
    let ball = doc.mesh(&part, white);
    doc.place("Left ball", ball, [-0.8, 0.14, 0.35]);
    doc.place("Right ball", ball, [0.8, 0.14, 0.35]);
    doc
}

/// Upper row: KHR_texture_transform. Lower row: the same by the coordinates themselves.
pub(super) fn transform() -> Doc {
    let mut doc = Doc::new("texture-transform");
    doc.stage(Lit::Well);
    let texture = doc.texture(&letter(), sampler(REPEAT, REPEAT, false));
    let plain = doc.material("Plain", painted(texture));
    let square = card(0.74, 0.74);
    // Offset, rotation in turns, scale.
    let cases = [
        ("offset", [0.25, 0.125], 0.0, [1.0, 1.0]),
        ("rotation", [0.0, 0.0], 1.0 / 12.0, [1.0, 1.0]),
        ("scale", [0.0, 0.0], 0.0, [2.0, 1.5]),
        ("all", [0.3, 0.4], 1.0 / 12.0, [1.5, 0.75]),
    ];
    for (i, (name, offset, turns, scale)) in cases.into_iter().enumerate() {
        let x = (i as f64 - 1.5) * 0.84;
        let transform = json!({
            "offset": numbers(&offset),
            "rotation": turns * std::f64::consts::TAU,
            "scale": numbers(&scale),
        });
        let mut value = painted(texture);
        let info = json!({ "extensions": { "KHR_texture_transform": transform } });
        merge(&mut value["pbrMetallicRoughness"]["baseColorTexture"], info);
        let material = doc.material(&format!("Transform {name}"), value);
        let part = doc.textured(&square, &card_uvs(WHOLE));
        let mesh = doc.mesh(&part, material);
        doc.place(&format!("Transform {name}"), mesh, [x, 1.36, 0.0]);
        // Scaled, turned counter-clockwise as seen with v downwards, moved: the extension's order and sense.
        let (s, c) = sin_cos(turns);
        let uvs = card_uvs(WHOLE).map(|[u, w]| {
            let (u, w) = (u * scale[0], w * scale[1]);
            [c * u + s * w + offset[0], c * w - s * u + offset[1]]
        });
        let part = doc.textured(&square, &uvs);
        let mesh = doc.mesh(&part, plain);
        doc.place(&format!("Coordinates {name}"), mesh, [x, 0.48, 0.0]);
    }
    doc
}

/// The same picture by the first and by the second coordinates; and each of two textures by its own.
pub(super) fn second_uvs() -> Doc {
    let mut doc = Doc::new("second-uvs");
    doc.stage(Lit::Well);
    let texture = doc.texture(&letter(), sampler(CLAMP, CLAMP, false));
    let square = card(0.95, 0.95);
    let whole = card_uvs(WHOLE);
    let elsewhere = card_uvs([0.0, 0.0, 4.0, 4.0]);
    let first = doc.material("First", painted(texture));
    let mut value = painted(texture);
    value["pbrMetallicRoughness"]["baseColorTexture"]["texCoord"] = json!(1);
    let second = doc.material("Second", value);
    let part = doc.textured(&square, &whole);
    let mesh = doc.mesh(&part, first);
    doc.place("First coordinates", mesh, [-1.08, 0.8, 0.0]);
    let mut part = doc.textured(&square, &elsewhere);
    part["attributes"]["TEXCOORD_1"] = json!(doc.floats(&whole));
    let mesh = doc.mesh(&part, second);
    doc.place("Second coordinates", mesh, [0.0, 0.8, 0.0]);
    // A tiled base under one glowing disc.
    let tiles = doc.texture(&checker(2, [200, 200, 210], [60, 70, 90]), sampler(REPEAT, REPEAT, true));
    let glow = Png::new(16, 16, |x, y| {
        let (dx, dy) = (2 * x as i32 - 15, 2 * y as i32 - 15);
        if dx * dx + dy * dy < 100 { [255, 140, 30, 255] } else { [0, 0, 0, 255] }
    });
    let glow = doc.texture(&glow, sampler(CLAMP, CLAMP, false));
    let mut value = painted(tiles);
    merge(&mut value, matte([1.0; 3]));
    merge(
        &mut value,
        json!({
            "emissiveFactor": numbers(&[1.0; 3]),
            "emissiveTexture": { "index": glow, "texCoord": 1 },
        }),
    );
    let both = doc.material("Both", value);
    let mut part = doc.textured(&square, &elsewhere);
    part["attributes"]["TEXCOORD_1"] = json!(doc.floats(&whole));
    let mesh = doc.mesh(&part, both);
    doc.place("Both", mesh, [1.08, 0.8, 0.0]);
    doc
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_decodes_as_published() {
        assert_eq!(linear(0), 0.0);
        assert!((linear(188) - 0.502_886).abs() < 1e-5, "{}", linear(188));
        assert!((linear(255) - 1.0).abs() < 1e-12);
        assert!((linear(10) - 10.0 / 255.0 / 12.92).abs() < 1e-12);
    }

    #[test]
    fn domes_face_the_viewer() {
        let (mesh, uvs) = dome(WHOLE, [4, 4]);
        let t = mesh.triangles[0].map(|i| mesh.positions[i as usize]);
        let front = (t[1] - t[0]).cross(t[2] - t[0]);
        assert!(front.z > 0.0);
        // The upper left corner of the dome shows that of the picture.
        let corner = uvs.iter().position(|uv| *uv == [0.0, 0.0]).unwrap();
        assert!(mesh.positions[corner].x < 0.0 && mesh.positions[corner].y > 0.0);
    }
}
