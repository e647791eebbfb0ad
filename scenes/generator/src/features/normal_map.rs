//! Normal maps: bumps lit from the upper left.

use super::doc::{Doc, matte, with};
use super::png::Png;
use super::stage::{CLAMP, Lit, WHOLE, card, card_uvs, sampler};
use crate::gltf_writer::numbers;
use crate::math::{Affine, Vec3, Z, sin_cos, v};
use crate::shapes::Mesh;
use serde_json::json;

/// Bumps per edge of a card, and their radius where the pitch is 1. They are caps of spheres, `STEEP` at their rim.
const BUMPS: f64 = 3.0;
const RADIUS: f64 = 0.42;
const STEEP: f64 = 0.7;

/// Offset from the nearest bump's centre, where the pitch is 1; y upwards.
fn offset(u: f64, up: f64) -> Vec3 {
    let cell = |x: f64| {
        let x = x * BUMPS;
        x - x.floor() - 0.5
    };
    v(cell(u), cell(up), 0.0)
}

/// The bumps' normal at (u, up) in 0..1.
fn normal(u: f64, up: f64) -> Vec3 {
    let d = offset(u, up) * (STEEP / RADIUS);
    if d.length() >= STEEP { Z } else { d + Z * (1.0 - d.dot(d)).sqrt() }
}

/// A card of edge 1 with bumps of triangles on it.
fn solid() -> Mesh {
    const RINGS: u32 = 4;
    const SEGMENTS: u32 = 18;
    let mut all = card(1.0, 1.0);
    for cell in 0..9 {
        let centre = v(
            f64::from(cell % 3) - 1.0,
            f64::from(cell / 3) - 1.0,
            -(1.0 - STEEP * STEEP).sqrt() * RADIUS / STEEP,
        );
        let mut cap = Mesh { open: true, ..Mesh::default() };
        let mut vertex = |n: Vec3| {
            cap.positions.push((centre + n * (RADIUS / STEEP)) * (1.0 / BUMPS));
            cap.normals.push(n);
        };
        vertex(Z);
        for ring in 1..=RINGS {
            let r = STEEP * f64::from(ring) / f64::from(RINGS);
            for j in 0..SEGMENTS {
                let (s, c) = sin_cos(f64::from(j) / f64::from(SEGMENTS));
                vertex(v(c * r, s * r, (1.0 - r * r).sqrt()));
            }
        }
        for j in 0..SEGMENTS {
            let at = |ring: u32, j: u32| 1 + (ring - 1) * SEGMENTS + j % SEGMENTS;
            cap.triangles.push([0, at(1, j), at(1, j + 1)]);
            for ring in 1..RINGS {
                cap.triangles.push([at(ring, j), at(ring + 1, j), at(ring + 1, j + 1)]);
                cap.triangles.push([at(ring, j), at(ring + 1, j + 1), at(ring, j + 1)]);
            }
        }
        all.add(&cap);
    }
    all
}

/// Above: bumps of triangles, of a map, of a map with tangents in the file. Below: mirrored node, mirrored
/// coordinates, scale 0.4.
pub(super) fn doc() -> Doc {
    let mut doc = Doc::new("normal-map");
    doc.stage(Lit::Well);
    let paint = [0.72, 0.62, 0.5];
    let n = 48;
    let picture = Png::new(n, n, |x, y| {
        let at = |i: usize| (i as f64 + 0.5) / n as f64;
        let n = normal(at(x), 1.0 - at(y));
        let code = |c: f64| (c * 127.5 + 127.5 + 0.5).floor() as u8;
        [code(n.x), code(n.y), code(n.z), 255]
    });
    let texture = doc.texture(&picture, sampler(CLAMP, CLAMP, false));
    let mapped = doc.material("Mapped", with(matte(paint), json!({ "normalTexture": { "index": texture } })));
    let weak = json!({ "normalTexture": { "index": texture, "scale": 0.4 } });
    let weak = doc.material("Weakly mapped", with(matte(paint), weak));
    let plain = doc.matte("Plain", paint);
    let edge = 0.84;
    let at = |i: usize| [(i % 3) as f64 - 1.0, if i < 3 { 1.38 } else { 0.47 }, 0.0];
    let solid = solid().moved(Affine::scale(v(edge, edge, edge)));
    doc.add("Triangles", &solid, plain, at(0));
    let square = card(edge, edge);
    let part = doc.textured(&square, &card_uvs(WHOLE));
    let mesh = doc.mesh(&part, mapped);
    doc.place("Map", mesh, at(1));
    let weak = doc.mesh(&part, weak);
    let mut with_tangents = part.clone();
    with_tangents["attributes"]["TANGENT"] = json!(doc.floats(&[[1.0, 0.0, 0.0, 1.0]; 4]));
    let tangents = doc.mesh(&with_tangents, mapped);
    doc.place("Tangents", tangents, at(2));
    doc.root(json!({
        "name": "Mirrored node", "mesh": mesh,
        "translation": numbers(&at(3)), "scale": numbers(&[-1.0, 1.0, 1.0]),
    }));
    // The picture runs from right to left: the tangents' handedness comes from the coordinates.
    let part = doc.textured(&square, &card_uvs([1.0, 0.0, 0.0, 1.0]));
    let mirrored = doc.mesh(&part, mapped);
    doc.place("Mirrored coordinates", mirrored, at(4));
    doc.place("Scale 0.4", weak, at(5));
    doc
}
