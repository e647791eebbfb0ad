//! Nodes, cameras and scenes.

use super::doc::{Doc, light};
use super::stage::{Lit, card};
use crate::gltf_writer::numbers;
use crate::math::{Affine, X, Z, quaternion, sin_cos, v};
use crate::shapes::{Mesh, block, cuboid, join, lathe, quad, sphere};
use serde_json::json;

/// A thick letter R, standing on y = 0, 0.8 high.
fn letter_r() -> Mesh {
    join([
        cuboid(v(-0.28, 0.0, -0.12), v(-0.12, 0.8, 0.12)),
        cuboid(v(-0.12, 0.64, -0.12), v(0.24, 0.8, 0.12)),
        cuboid(v(0.1, 0.48, -0.12), v(0.24, 0.64, 0.12)),
        cuboid(v(-0.12, 0.34, -0.12), v(0.24, 0.48, 0.12)),
        cuboid(v(0.02, 0.17, -0.12), v(0.16, 0.34, 0.12)),
        cuboid(v(0.12, 0.0, -0.12), v(0.28, 0.17, 0.12)),
    ])
}

/// A letter; mirrored by its node; mirrored in its data. Each with a one-sided lamp in front of its foot.
pub(super) fn mirrored() -> Doc {
    let mut doc = Doc::new("mirrored-node");
    doc.stage(Lit::Well);
    let paint = doc.matte("Paint", [0.6, 0.3, 0.2]);
    let lamp = doc.material("Lamp", light([0.2, 0.6, 0.8], 1.0));
    let panel = card(0.5, 0.12).at(0.06, -0.14, 0.2);
    let flip = Affine::scale(v(-1.0, 1.0, 1.0));
    let mut mesh = |shape: Mesh, panel: Mesh| {
        let (mut a, mut b) = (doc.part(&shape), doc.part(&panel));
        a["material"] = json!(paint);
        b["material"] = json!(lamp);
        doc.push("meshes", json!({ "primitives": [a, b] }))
    };
    let plain = mesh(letter_r(), panel.clone());
    let twin = mesh(letter_r().moved(flip), panel.moved(flip));
    doc.place("Plain", plain, [-1.05, 0.35, 0.0]);
    doc.root(json!({
        "name": "Mirrored by its node", "mesh": plain,
        "translation": numbers(&[0.0, 0.35, 0.0]), "scale": numbers(&[-1.0, 1.0, 1.0]),
    }));
    doc.place("Mirrored in its data", twin, [1.05, 0.35, 0.0]);
    doc
}

/// A cone with a ball on top, 0.1 wide.
fn pawn() -> Mesh {
    join([lathe(&[(0.05, 0.0), (0.05, 0.0), (0.02, 0.1)], 12), sphere(0.03, 12).at(0.0, 0.11, 0.0)])
}

/// Two hundred nodes of one mesh, in rows that shrink and turn.
pub(super) fn instances() -> Doc {
    let mut doc = Doc::new("instances");
    doc.bare_stage(Lit::Well);
    doc.look("Camera", v(0.0, 2.9, 6.0), v(0.0, 0.25, 0.0), 21.5);
    let paint = doc.matte("Paint", [0.25, 0.45, 0.6]);
    let part = doc.part(&pawn());
    let mesh = doc.mesh(&part, paint);
    for i in 0..200 {
        let (x, z) = (f64::from(i % 20), f64::from(i / 20));
        let size = 2.0 - 0.12 * z;
        let rotation = quaternion(Z, 0.004 * (x - 9.5));
        doc.root(json!({
            "name": format!("Pawn {i}"), "mesh": mesh,
            "translation": numbers(&[(x - 9.5) * 0.165, 0.0, 1.2 - 0.25 * z]),
            "rotation": numbers(&rotation), "scale": numbers(&[size, size * (1.0 + 0.1 * z), size]),
        }));
    }
    doc
}

/// EXT_mesh_gpu_instancing: a ring of leaning pawns in one node; behind it the twin of as many nodes.
pub(super) fn gpu_instancing() -> Doc {
    let mut doc = Doc::new("gpu-instancing");
    doc.required.push("EXT_mesh_gpu_instancing");
    doc.stage(Lit::Well);
    let paint = doc.matte("Paint", [0.6, 0.4, 0.2]);
    let part = doc.part(&pawn());
    let mesh = doc.mesh(&part, paint);
    let place = |i: usize| {
        let (s, c) = sin_cos(i as f64 / 16.0);
        let size = 1.5 + 1.5 * i as f64 / 15.0;
        ([c * 0.6, s * 0.6, 0.0], quaternion(Z, i as f64 / 16.0 - 0.25), [size, size, size * 0.5])
    };
    let (mut moves, mut turns, mut sizes) = (vec![], vec![], vec![]);
    let mut children = Vec::new();
    for i in 0..16 {
        let (at, rotation, scale) = place(i);
        moves.push(at);
        turns.push(rotation);
        sizes.push(scale);
        children.push(doc.push(
            "nodes",
            json!({
                "name": format!("Twin {i}"), "mesh": mesh, "translation": numbers(&at),
                "rotation": numbers(&rotation), "scale": numbers(&scale),
            }),
        ));
    }
    let attributes = json!({
        "TRANSLATION": doc.floats(&moves), "ROTATION": doc.floats(&turns), "SCALE": doc.floats(&sizes),
    });
    // The node's own transform follows.
    doc.root(json!({
        "name": "Instanced", "mesh": mesh, "translation": numbers(&[-0.82, 0.85, 0.0]), "scale": numbers(&[0.8; 3]),
        "extensions": { "EXT_mesh_gpu_instancing": { "attributes": attributes } },
    }));
    doc.root(json!({
        "name": "Nodes", "children": children, "translation": numbers(&[0.82, 0.85, 0.0]), "scale": numbers(&[0.8; 3]),
    }));
    doc
}

/// An orthographic camera: cubes going back in a row are of one size, and no side of them is seen but the top.
pub(super) fn orthographic() -> Doc {
    let mut doc = Doc::new("orthographic");
    doc.bare_stage(Lit::Well);
    let camera = json!({ "type": "orthographic", "orthographic": { "xmag": 1.8, "ymag": 1.2, "znear": 0.1, "zfar": 50.0 } });
    doc.camera("Camera", v(0.0, 2.75, 6.0), v(0.0, 0.4, 0.0), camera);
    let part = doc.part(&block(0.4, 0.4, 0.4));
    for i in 0..5 {
        let t = f64::from(i) / 4.0;
        let material = doc.matte(&format!("Paint {i}"), [0.7 - 0.5 * t, 0.3, 0.2 + 0.5 * t]);
        let mesh = doc.mesh(&part, material);
        doc.place(&format!("Cube {i}"), mesh, [(f64::from(i) - 2.0) * 0.65, 0.0, 1.4 - 0.6 * f64::from(i)]);
    }
    doc
}

/// Scene "Day" (default) with a red cube, scene "Night" with a blue ball and a lamp; cameras "Front" and "Above".
pub(super) fn scenes_cameras() -> Doc {
    let mut doc = Doc::new("scenes-cameras");
    let red = doc.matte("Red", [0.7, 0.1, 0.06]);
    let blue = doc.matte("Blue", [0.1, 0.2, 0.7]);
    let floor = doc.matte("Floor", [0.4, 0.4, 0.38]);
    let floor = doc.add("Floor", &quad(v(-3.0, 0.0, 3.0), X * 6.0, Z * -6.0), floor, [0.0; 3]);
    let cube = doc.add("Cube", &block(0.9, 0.9, 0.9), red, [0.0; 3]);
    let ball = doc.add("Ball", &sphere(0.5, 32), blue, [0.0, 0.5, 0.0]);
    let warm = doc.material("Lamp", light([1.0, 0.6, 0.25], 12.0));
    let lamp = doc.add("Lamp", &sphere(0.12, 16), warm, [-1.0, 0.5, 0.5]);
    let front = doc.look("Front", v(1.7, 1.5, 4.6), v(0.0, 0.4, 0.0), 24.0);
    let above = doc.look("Above", v(0.0, 5.0, 1.2), v(0.0, 0.0, 0.0), 28.0);
    doc.lights = vec![json!({ "type": "directional", "intensity": 2.5 })];
    let sun = doc.root(json!({
        "name": "Sun", "rotation": numbers(&quaternion(v(1.0, 0.4, 0.0).unit(), -0.15)),
        "extensions": { "KHR_lights_punctual": { "light": 0 } },
    }));
    doc.environment = Some([0.1; 3]);
    doc.scenes = Some(json!([
        { "name": "Day", "nodes": [floor, cube, sun, front, above] },
        { "name": "Night", "nodes": [floor, ball, lamp, front, above] },
    ]));
    doc
}
