//! Lights: emission, punctual lights, surroundings.

use super::doc::{Doc, light, merge, pbr};
use super::stage::{card, turned};
use crate::gltf_writer::numbers;
use crate::math::{Dice, X, Y, Z, v};
use crate::shapes::{Mesh, block, cuboid, cylinder, join, quad, sphere};
use serde_json::json;

/// Three bays side by side, open to the front; `roofs` says which have one. Seen from the height `eye`.
fn bays(doc: &mut Doc, roofs: [bool; 3], eye: f64) {
    let wall = doc.matte("Bay", [0.62, 0.62, 0.6]);
    let mut parts: Vec<Mesh> =
        vec![cuboid(v(-1.8, -0.1, -0.9), v(1.8, 0.0, 0.9)), cuboid(v(-1.8, 0.0, -1.0), v(1.8, 1.6, -0.9))];
    for i in 0..4 {
        let x = -1.8 + 1.2 * f64::from(i);
        parts.push(cuboid(v(x - 0.02, 0.0, -0.9), v(x + 0.02, 1.6, 0.9)));
    }
    for (i, _) in roofs.into_iter().enumerate().filter(|(_, roof)| *roof) {
        let x = -1.8 + 1.2 * i as f64;
        parts.push(cuboid(v(x, 1.6, -1.0), v(x + 1.2, 1.66, 0.9)));
    }
    doc.add("Bays", &join(parts), wall, [0.0; 3]);
    doc.look("Camera", v(0.0, eye, 7.0), v(0.0, 0.76, 0.0), 19.4);
}

/// Ceiling lamps of equal power: strength 1 and a large area, 4 and a quarter of it, 16 and a sixteenth.
pub(super) fn emissive_strength() -> Doc {
    let mut doc = Doc::new("emissive-strength");
    bays(&mut doc, [true; 3], 0.95);
    doc.environment = Some([0.02; 3]);
    let white = doc.matte("White", [0.8; 3]);
    let ball = doc.part(&sphere(0.2, 24));
    let ball = doc.mesh(&ball, white);
    for (i, strength) in [1.0, 4.0, 16.0].into_iter().enumerate() {
        let edge = 0.8 / f64::sqrt(strength);
        let lamp = doc.material(&format!("Strength {strength}"), light([1.0, 0.9, 0.75], strength));
        let x = (i as f64 - 1.0) * 1.2;
        let panel = quad(v(-edge / 2.0, 0.0, -edge / 2.0), X * edge, Z * edge);
        doc.add(&format!("Strength {strength}"), &panel, lamp, [x, 1.59, 0.0]);
        doc.place(&format!("Ball {i}"), ball, [x, 0.2, 0.0]);
    }
    doc
}

/// A panel between two walls: one-sided to the left, one-sided to the right, double-sided.
pub(super) fn emissive_sides() -> Doc {
    let mut doc = Doc::new("emissive-sides");
    bays(&mut doc, [true; 3], 0.95);
    doc.environment = Some([0.02; 3]);
    let one = doc.material("One side", light([0.6, 0.8, 1.0], 3.0));
    let mut value = light([0.6, 0.8, 1.0], 3.0);
    merge(&mut value, json!({ "doubleSided": true }));
    let both = doc.material("Both sides", value);
    let panel = turned(card(0.7, 0.8), Y, 0.25);
    doc.add("To the left", &panel.clone().flipped(), one, [-1.2, 0.75, 0.0]);
    doc.add("To the right", &panel, one, [-0.25, 0.75, 0.0]);
    doc.add("To both sides", &panel, both, [1.2, 0.75, 0.0]);
    doc
}

/// A point light, a spot and the sun, each in its bay over a pole; only the third has no roof.
pub(super) fn punctual() -> Doc {
    let mut doc = Doc::new("lights-punctual");
    bays(&mut doc, [true, true, false], 2.3);
    doc.environment = Some([0.15; 3]);
    let pole = doc.matte("Pole", [0.75, 0.3, 0.2]);
    let part = doc.part(&cylinder(0.07, 0.5, 0.0, 24));
    let pole = doc.mesh(&part, pole);
    for i in 0..3 {
        doc.place(&format!("Pole {i}"), pole, [(f64::from(i) - 1.0) * 1.2 + 0.15, 0.0, 0.1]);
    }
    doc.lights = vec![
        json!({ "name": "Lamp", "type": "point", "color": [1.0, 0.85, 0.6], "intensity": 0.8 }),
        json!({
            "name": "Spot", "type": "spot", "color": [0.7, 0.85, 1.0], "intensity": 12.0,
            // The edge is soft between radii 0.25 and 0.5 at the floor, 1.5 below.
            "spot": { "innerConeAngle": 0.165148677, "outerConeAngle": 0.321750554 },
        }),
        json!({ "name": "Sun", "type": "directional", "color": [1.0, 0.95, 0.85], "intensity": 2.5 }),
    ];
    let lit = |light: usize| json!({ "KHR_lights_punctual": { "light": light } });
    doc.root(json!({ "name": "Point", "translation": [-1.45, 1.1, 0.1], "extensions": lit(0) }));
    // Down: -Z turned to -Y. A light's node may be scaled.
    let quarter = 0.5f64.sqrt();
    let down = numbers(&[-quarter, 0.0, 0.0, quarter]);
    doc.root(json!({
        "name": "Spot", "translation": [0.0, 1.5, 0.1], "rotation": down, "scale": [2.0, 2.0, 2.0], "extensions": lit(1),
    }));
    // From the upper left and a little from the front, so that it falls into the open bay alone.
    let (back, up) = (v(-0.5, 1.0, 0.12).unit(), Z);
    let right = up.cross(back).unit();
    let up = back.cross(right);
    let columns: Vec<f64> =
        [right, up, back].iter().flat_map(|c| [c.x, c.y, c.z, 0.0]).chain([0.0, 0.0, 0.0, 1.0]).collect();
    doc.root(json!({ "name": "Sun", "matrix": numbers(&columns), "extensions": lit(2) }));
    doc
}

/// For `--env features/sky.hdr`: balls of mirror, metal, matte and a pole whose shadow tells where the sun is.
pub(super) fn environment() -> Doc {
    let mut doc = Doc::new("environment");
    let ground = doc.matte("Ground", [0.4, 0.39, 0.36]);
    doc.add("Ground", &quad(v(-5.0, 0.0, 5.0), X * 10.0, Z * -10.0), ground, [0.0; 3]);
    let ball = doc.part(&sphere(0.45, 40));
    let materials = [
        ("Mirror", doc.material("Mirror", pbr([0.95; 3], 1.0, 0.0))),
        ("Metal", doc.material("Metal", pbr([0.9; 3], 1.0, 0.35))),
        ("Matte", doc.matte("Matte", [0.75; 3])),
    ];
    for (i, (name, material)) in materials.into_iter().enumerate() {
        let mesh = doc.mesh(&ball, material);
        doc.place(name, mesh, [(i as f64 - 1.0) * 1.05, 0.45, -0.2]);
    }
    let red = doc.matte("Red", [0.7, 0.1, 0.06]);
    doc.add("Block", &block(0.1, 0.5, 0.1), red, [0.4, 0.0, 0.7]);
    doc.look("Camera", v(0.0, 0.9, 6.0), v(0.0, 0.85, 0.0), 21.5);
    doc
}

/// A ceiling of 216 panels in six colours, of all sizes and strengths: 432 triangles that shine.
pub(super) fn many() -> Doc {
    let mut doc = Doc::new("many-lights");
    let floor = doc.matte("Floor", [0.5, 0.5, 0.48]);
    let wall = doc.matte("Wall", [0.55, 0.52, 0.5]);
    doc.add("Floor", &quad(v(-3.0, 0.0, 2.5), X * 6.0, Z * -4.0), floor, [0.0; 3]);
    doc.add("Wall", &quad(v(-3.0, 0.0, -1.5), X * 6.0, Y * 3.0), wall, [0.0; 3]);
    let mut dice = Dice::new(11);
    let colors = [
        [1.0, 0.35, 0.2],
        [0.9, 0.8, 0.25],
        [0.3, 0.9, 0.35],
        [0.25, 0.75, 1.0],
        [0.35, 0.3, 1.0],
        [1.0, 0.9, 0.8],
    ];
    for (i, color) in colors.into_iter().enumerate() {
        let panels = (0..36).map(|k| {
            // A grid of 18 x 12 places, dealt to the colours in turn.
            let place = 6 * k + i;
            let (x, z) = ((place % 18) as f64, (place / 18) as f64);
            let (width, depth) = (dice.range(0.04, 0.18), dice.range(0.04, 0.18));
            let corner = v(-2.2 + 0.25 * x, dice.range(1.6, 2.3), -1.2 + 0.2 * z);
            quad(corner, X * width, Z * depth)
        });
        let strength = 5.0 + 5.0 * i as f64;
        let material = doc.material(&format!("Panels {i}"), light(color, strength));
        doc.add(&format!("Panels {i}"), &join(panels), material, [0.0; 3]);
    }
    let plaster = doc.matte("Plaster", [0.7, 0.7, 0.68]);
    let lacquer = doc.material("Lacquer", pbr([0.4, 0.1, 0.08], 0.0, 0.3));
    doc.add("Block", &block(0.7, 0.9, 0.7), plaster, [-0.85, 0.0, -0.4]);
    doc.add("Ball", &sphere(0.42, 20), lacquer, [0.25, 0.42, 0.3]);
    doc.add("Pole", &cylinder(0.08, 1.1, 0.0, 16), plaster, [1.15, 0.0, -0.1]);
    doc.look("Camera", v(0.0, 1.1, 6.0), v(0.0, 0.76, 0.0), 21.5);
    doc
}
