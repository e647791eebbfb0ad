//! Alpha: cut out, and seen through.

use super::doc::{Doc, matte, merge, painted, with};
use super::png::Png;
use super::stage::{CLAMP, Lit, REPEAT, WHOLE, card, card_uvs, checker, sampler};
use crate::gltf_writer::numbers;
use crate::math::{X, quaternion, sin_cos, v};
use crate::shapes::Mesh;
use serde_json::json;

/// A ring about the origin, front along +z.
fn ring(inner: f64, outer: f64, segments: u32) -> Mesh {
    let mut mesh = Mesh { open: true, ..Mesh::default() };
    for i in 0..segments {
        let (s, c) = sin_cos(f64::from(i) / f64::from(segments));
        for r in [inner, outer] {
            mesh.positions.push(v(c * r, s * r, 0.0));
            mesh.normals.push(v(0.0, 0.0, 1.0));
        }
        let (a, b) = (2 * i, 2 * ((i + 1) % segments));
        mesh.triangles.push([a, a + 1, b + 1]);
        mesh.triangles.push([a, b + 1, b]);
    }
    mesh
}

/// Distance of a texel of a 48 x 48 picture from its centre; the edge is at 1.
fn radius(x: usize, y: usize) -> f64 {
    let at = |i: usize| (i as f64 + 0.5) / 24.0 - 1.0;
    (at(x) * at(x) + at(y) * at(y)).sqrt()
}

/// A ring by MASK and one of triangles, with their shadows; then one slope of alpha at three cutoffs, and a leaf.
pub(super) fn mask() -> Doc {
    let mut doc = Doc::new("alpha-mask");
    doc.stage(Lit::Well);
    let green = [0.16, 0.5, 0.12];
    // Alpha falls through one half at the radii 0.4 and 0.9, steeply, so that the contour is smooth.
    let ramp = |d: f64| (127.5 + 127.5 * (d * 12.0).clamp(-1.0, 1.0) + 0.5).floor() as u8;
    let picture = Png::new(48, 48, |x, y| {
        let r = radius(x, y);
        [255, 255, 255, ramp((r - 0.4).min(0.9 - r))]
    });
    let texture = doc.texture(&picture, sampler(CLAMP, CLAMP, false));
    let tint = json!({ "pbrMetallicRoughness": { "baseColorFactor": numbers(&[green[0], green[1], green[2], 1.0]) } });
    let value = with(with(painted(texture), tint), json!({ "alphaMode": "MASK" }));
    let cut = doc.material("Cut out", value);
    let solid = doc.matte("Leaf green", green);
    let part = doc.textured(&card(0.8, 0.8), &card_uvs(WHOLE));
    let mesh = doc.mesh(&part, cut);
    doc.place("Mask", mesh, [-1.3, 0.6, -1.1]);
    doc.add("Triangles", &ring(0.16, 0.36, 96), solid, [-0.35, 0.6, -1.1]);
    // Alpha 1 in the middle, 0 at the edge: kept within 1 - cutoff.
    let slope =
        Png::new(48, 48, |x, y| [235, 170, 60, ((1.0 - radius(x, y)).max(0.0) * 255.0 + 0.5).floor() as u8]);
    let slope = doc.texture(&slope, sampler(CLAMP, CLAMP, false));
    for (i, cutoff) in [0.25, 0.5, 0.75].into_iter().enumerate() {
        let value = with(painted(slope), json!({ "alphaMode": "MASK", "alphaCutoff": cutoff }));
        let material = doc.material(&format!("Cutoff {cutoff}"), value);
        let part = doc.textured(&card(0.8, 0.8), &card_uvs(WHOLE));
        let mesh = doc.mesh(&part, material);
        doc.place(&format!("Cutoff {cutoff}"), mesh, [(i as f64 - 1.0) * 1.1, 1.52, -1.3]);
    }
    // The same picture OPAQUE: alpha is ignored. And a second ring, leaning, whose shadow falls on the floor.
    let opaque = doc.material("Opaque", painted(slope));
    let part = doc.textured(&card(0.5, 0.5), &card_uvs(WHOLE));
    let mesh = doc.mesh(&part, opaque);
    doc.place("Opaque", mesh, [0.4, 0.35, 0.0]);
    let part = doc.textured(&card(0.7, 0.7), &card_uvs(WHOLE));
    let mesh = doc.mesh(&part, cut);
    let tilt = quaternion(X, -0.17);
    doc.root(json!({
        "name": "Leaning", "mesh": mesh,
        "translation": numbers(&[1.15, 0.4, 0.2]),
        "rotation": numbers(&tilt),
    }));
    doc
}

/// Panes of rising alpha before a checkerboard, a stack of three, and a gradient.
pub(super) fn blend() -> Doc {
    let mut doc = Doc::new("alpha-blend");
    doc.stage(Lit::Well);
    let board = doc.texture(&checker(2, [225, 225, 225], [40, 44, 52]), sampler(REPEAT, REPEAT, true));
    let board = doc.material("Board", painted(board));
    let part = doc.textured(&card(3.4, 1.7), &card_uvs([0.0, 0.0, 10.0, 5.0]));
    let mesh = doc.mesh(&part, board);
    doc.place("Board", mesh, [0.0, 0.88, -0.6]);
    let pane = |color: [f64; 3], alpha: f64| {
        let factor = numbers(&[color[0], color[1], color[2], alpha]);
        let more = json!({ "alphaMode": "BLEND", "pbrMetallicRoughness": { "baseColorFactor": factor } });
        with(matte([1.0; 3]), more)
    };
    let square = doc.part(&card(0.55, 0.55));
    for (i, alpha) in [0.0, 0.25, 0.5, 0.75, 1.0].into_iter().enumerate() {
        let material = doc.material(&format!("Alpha {alpha}"), pane([0.8, 0.15, 0.1], alpha));
        let mesh = doc.mesh(&square, material);
        doc.place(&format!("Alpha {alpha}"), mesh, [(i as f64 - 2.0) * 0.64, 1.42, 0.0]);
    }
    // Three panes one behind the other, each shifted, and a fade from nothing to all.
    for (i, color) in [[0.8, 0.1, 0.1], [0.1, 0.65, 0.15], [0.1, 0.2, 0.8]].into_iter().enumerate() {
        let material = doc.material(&format!("Stack {i}"), pane(color, 0.5));
        let mesh = doc.mesh(&square, material);
        let step = i as f64;
        doc.place(&format!("Stack {i}"), mesh, [-1.05 + 0.24 * step, 0.42 + 0.12 * step, 0.3 - 0.2 * step]);
    }
    let fade = Png::new(32, 1, |x, _| [255, 200, 40, (x * 255 / 31) as u8]);
    let fade = doc.texture(&fade, sampler(CLAMP, CLAMP, false));
    let mut value = painted(fade);
    merge(&mut value, json!({ "alphaMode": "BLEND" }));
    let fade = doc.material("Fade", value);
    let part = doc.textured(&card(1.7, 0.5), &card_uvs(WHOLE));
    let mesh = doc.mesh(&part, fade);
    doc.place("Fade", mesh, [0.7, 0.45, 0.0]);
    doc
}
