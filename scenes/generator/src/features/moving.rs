//! What moves: animation, skins, morph targets. Stages show where things must be.

use super::doc::{Doc, U8};
use super::stage::{Lit, card};
use crate::gltf_writer::numbers;
use crate::math::{Affine, Vec3, Y, Z, quaternion, sin_cos, v};
use crate::shapes::{Mesh, block, sheet};
use serde_json::json;

/// Three cubes on rails, keys at 0, 1 and 2 s at x = -1.2, 0 and 1.2: LINEAR, STEP, CUBICSPLINE (tangents 0: slow at the keys).
/// Ticks every 0.3. A fourth turns by a quarter a second.
pub(super) fn animation() -> Doc {
    let mut doc = Doc::new("animation");
    doc.stage(Lit::Well);
    let tick = doc.matte("Tick", [0.08; 3]);
    let part = doc.part(&card(0.015, 1.5));
    let mesh = doc.mesh(&part, tick);
    for i in -4..=4 {
        doc.place(&format!("Tick {}", i + 4), mesh, [f64::from(i) * 0.3, 0.95, -0.2]);
    }
    let times = doc.floats(&[[0.0], [1.0], [2.0]]);
    let part = doc.part(&block(0.26, 0.26, 0.26));
    let mut channels = Vec::new();
    let mut samplers = Vec::new();
    for (i, (mode, color)) in
        [("LINEAR", [0.7, 0.12, 0.08]), ("STEP", [0.1, 0.5, 0.15]), ("CUBICSPLINE", [0.1, 0.2, 0.7])]
            .into_iter()
            .enumerate()
    {
        let material = doc.matte(mode, color);
        let mesh = doc.mesh(&part, material);
        let y = 1.4 - 0.45 * i as f64;
        let node = doc.place(mode, mesh, [-1.2, y, 0.0]);
        let keys = [-1.2, 0.0, 1.2].map(|x| [x, y, 0.0]);
        let output = if mode == "CUBICSPLINE" {
            let still = [0.0; 3];
            let list: Vec<[f64; 3]> = keys.into_iter().flat_map(|key| [still, key, still]).collect();
            doc.floats(&list)
        } else {
            doc.floats(&keys)
        };
        samplers.push(json!({ "input": times, "output": output, "interpolation": mode }));
        channels.push(json!({ "sampler": i, "target": { "node": node, "path": "translation" } }));
    }
    let yellow = doc.matte("Turning", [0.75, 0.55, 0.1]);
    let part = doc.part(&block(0.9, 0.16, 0.16).at(0.0, -0.08, 0.0));
    let mesh = doc.mesh(&part, yellow);
    let node = doc.place("Turning", mesh, [0.0, 0.2, 0.3]);
    let output = doc.floats(&[0.0, 0.25, 0.5].map(|turns| quaternion(Y, turns)));
    samplers.push(json!({ "input": times, "output": output }));
    channels.push(json!({ "sampler": 3, "target": { "node": node, "path": "rotation" } }));
    doc.push("animations", json!({ "name": "Move", "samplers": samplers, "channels": channels }));
    doc
}

/// The four long sides of a bar along y from 0 to 1, 0.2 thick, in `n` steps.
fn bar(n: usize) -> Mesh {
    let mut all = Mesh { open: true, ..Mesh::default() };
    for i in 0..4 {
        let side = sheet(1, n, |u, w| v(0.2 * (u - 0.5), w, 0.1));
        all.add(&side.moved(Affine::rotate(Y, f64::from(i) * 0.25)));
    }
    all
}

/// A bar of two joints: at rest, its upper joint turned by an eighth, and by a quarter under blended weights.
pub(super) fn skin() -> Doc {
    let mut doc = Doc::new("skin");
    doc.stage(Lit::Well);
    let shape = bar(16);
    let paint = doc.matte("Paint", [0.65, 0.4, 0.25]);
    let part = doc.part(&shape);
    let joints: Vec<u8> = shape.positions.iter().flat_map(|_| [0, 1, 0, 0]).collect();
    let joints = doc.accessor(&joints, U8, "VEC4", shape.positions.len(), json!({}));
    let share = |soft: bool, y: f64| {
        let t: f64 = if soft {
            (y - 0.25) * 2.0
        } else if y > 0.5 {
            1.0
        } else {
            0.0
        };
        t.clamp(0.0, 1.0)
    };
    let weights = |soft: bool, doc: &mut Doc| {
        let rows: Vec<[f64; 4]> =
            shape.positions.iter().map(|p| [1.0 - share(soft, p.y), share(soft, p.y), 0.0, 0.0]).collect();
        doc.floats(&rows)
    };
    let (hard, soft) = (weights(false, &mut doc), weights(true, &mut doc));
    // Inverse bind matrices: the lower joint at the foot, the upper one in the middle.
    let matrix = |y: f64| {
        let mut m = [0.0; 16];
        for i in 0..4 {
            m[i * 5] = 1.0;
        }
        m[13] = -y;
        m
    };
    let inverse = doc.floats(&[matrix(0.0), matrix(0.5)]);
    let plain = doc.mesh(&part, paint);
    doc.place("Plain twin", plain, [-1.3, 0.2, 0.0]);
    for (i, (name, weights, turns)) in
        [("Rest", hard, 0.0), ("Bent by an eighth", hard, -0.125), ("Bent softly by a quarter", soft, -0.25)]
            .into_iter()
            .enumerate()
    {
        let mut part = part.clone();
        part["attributes"]["JOINTS_0"] = json!(joints);
        part["attributes"]["WEIGHTS_0"] = json!(weights);
        let mesh = doc.mesh(&part, paint);
        let upper = doc.push(
            "nodes",
            json!({ "name": format!("{name}, upper"), "translation": [0.0, 0.5, 0.0], "rotation": numbers(&quaternion(Z, turns)) }),
        );
        let x = [-0.75, -0.2, 0.6][i];
        let lower = doc.root(json!({
            "name": format!("{name}, lower"), "translation": numbers(&[x, 0.2, 0.0]), "children": [upper],
        }));
        let skin = doc.push(
            "skins",
            json!({ "joints": [lower, upper], "inverseBindMatrices": inverse, "skeleton": lower }),
        );
        // Where the node of a skinned mesh stands says nothing.
        doc.root(json!({ "name": name, "mesh": mesh, "skin": skin, "translation": [9.0, 9.0, 9.0] }));
    }
    // Where the middle of the ends must be.
    let mark = doc.matte("Mark", [0.08; 3]);
    let part = doc.part(&block(0.06, 0.06, 0.06).at(0.0, -0.03, 0.0));
    let mark = doc.mesh(&part, mark);
    let (s, c) = sin_cos(0.125);
    for (i, end) in
        [v(-0.75, 1.2, 0.0), v(-0.2 + 0.5 * s, 0.7 + 0.5 * c, 0.0), v(1.1, 0.7, 0.0)].into_iter().enumerate()
    {
        doc.place(&format!("Mark {i}"), mark, end.array());
    }
    doc
}

/// A bump that grows by a morph target: weights 0, 0.5 and 1 of one mesh, then two targets at once; below, plain twins.
pub(super) fn morph() -> Doc {
    let mut doc = Doc::new("morph");
    doc.stage(Lit::Well);
    let shape = |bump: f64, slope: f64| {
        sheet(10, 10, |u, w| {
            let d = 4.0 * ((u - 0.5) * (u - 0.5) + (w - 0.5) * (w - 0.5));
            let t = (1.0 - d).max(0.0);
            v(u - 0.5 + slope * (w - 0.5), w - 0.5, bump * t * t * (3.0 - 2.0 * t)) * 0.6
        })
    };
    let base = shape(0.0, 0.0);
    let differences = |to: &Mesh, normals: bool| -> Vec<[f64; 3]> {
        let pick = |m: &Mesh| -> Vec<Vec3> { if normals { m.normals.clone() } else { m.positions.clone() } };
        pick(to).into_iter().zip(pick(&base)).map(|(a, b)| (a - b).array()).collect()
    };
    let (bump, slope) = (shape(0.6, 0.0), shape(0.0, 0.5));
    let paint = doc.matte("Paint", [0.5, 0.55, 0.3]);
    let mut part = doc.part(&base);
    part["material"] = json!(paint);
    part["targets"] = json!([
        { "POSITION": doc.floats(&differences(&bump, false)), "NORMAL": doc.floats(&differences(&bump, true)) },
        { "POSITION": doc.floats(&differences(&slope, false)), "NORMAL": doc.floats(&differences(&slope, true)) },
    ]);
    // The mesh's own weights show where the node has none.
    let mesh = doc.push("meshes", json!({ "primitives": [part], "weights": [1.0, 0.0] }));
    let cases = [
        ("Weight 0", Some([0.0, 0.0]), shape(0.0, 0.0)),
        ("Weight 0.5", Some([0.5, 0.0]), shape(0.3, 0.0)),
        ("Weight 1 of the mesh", None, shape(0.6, 0.0)),
        ("Both", Some([0.5, 1.0]), shape(0.3, 0.5)),
    ];
    let rotation = numbers(&quaternion(Y, 0.06));
    for (i, (name, weights, twin)) in cases.into_iter().enumerate() {
        let x = (i as f64 - 1.5) * 0.84;
        let mut node = json!({
            "name": name, "mesh": mesh, "translation": numbers(&[x, 1.36, 0.0]), "rotation": rotation,
        });
        if let Some(weights) = weights {
            node["weights"] = json!(weights);
        }
        doc.root(node);
        // Interpolated normals are not quite those of the shape between: the twin of a half has the mean of the two.
        let part = doc.part(&twin);
        let mesh = doc.mesh(&part, paint);
        doc.root(json!({
            "name": format!("{name}, twin"), "mesh": mesh, "translation": numbers(&[x, 0.5, 0.0]), "rotation": rotation,
        }));
    }

    doc
}
