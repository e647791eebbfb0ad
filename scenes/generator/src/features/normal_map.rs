//! Normal maps: bumps lit from the upper left.

use super::doc::{Doc, matte, with};
use super::png::Png;
use super::stage::{CLAMP, Lit, WHOLE, card, card_uvs, sampler};
use crate::gltf_writer::numbers;
use crate::math::{Vec3, Z, v};
use crate::shapes::sheet;
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

/// The bumps' height above a card of edge 1.
fn height(u: f64, up: f64) -> f64 {
    let d = offset(u, up) * (STEEP / RADIUS);
    if d.length() >= STEEP {
        return 0.0;
    }
    ((1.0 - d.dot(d)).sqrt() - (1.0 - STEEP * STEEP).sqrt()) * RADIUS / STEEP / BUMPS
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
    let solid = sheet(24, 24, |u, up| v(u - 0.5, up - 0.5, height(u, up)) * edge);
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
