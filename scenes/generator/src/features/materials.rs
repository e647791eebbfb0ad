//! Materials: metal, glass, coats, unlit, variants.

use super::doc::{Doc, matte, painted, pbr, with};
use super::stage::{CLAMP, Lit, REPEAT, WHOLE, card, card_uvs, checker, letter, sampler};
use crate::gltf_writer::numbers;
use crate::shapes::{block, sphere};
use serde_json::{Value, json};

/// Spheres in rows, the first at the upper left.
fn spheres(doc: &mut Doc, radius: f64, rows: &[Vec<(String, Value)>]) {
    let part = doc.part(&sphere(radius, 32));
    for (y, row) in rows.iter().enumerate() {
        for (x, (name, value)) in row.iter().enumerate() {
            let material = doc.material(name, value.clone());
            let mesh = doc.mesh(&part, material);
            let pitch = (3.0 / row.len() as f64).min(0.9);
            let x = (x as f64 - (row.len() - 1) as f64 / 2.0) * pitch;
            let y = (rows.len() - 1 - y) as f64;
            let at = if rows.len() == 1 { 0.7 } else { 0.42 + 0.95 * y };
            doc.place(name, mesh, [x, at, 0.0]);
        }
    }
}

/// A checkerboard across the back, for what is seen through and in things.
fn board(doc: &mut Doc, z: f64) {
    let board = doc.texture(&checker(2, [215, 215, 215], [50, 60, 80]), sampler(REPEAT, REPEAT, true));
    let board = doc.material("Board", painted(board));
    let part = doc.textured(&card(4.2, 2.1), &card_uvs([0.0, 0.0, 10.0, 5.0]));
    let mesh = doc.mesh(&part, board);
    doc.place("Board", mesh, [0.0, 1.05, z]);
}

/// Above: gold from mirror to rough. Below: from dielectric to metal.
pub(super) fn metal() -> Doc {
    let mut doc = Doc::new("metal");
    doc.stage(Lit::Well);
    let gold = [1.0, 0.77, 0.34];
    let rough = [0.0, 0.15, 0.35, 0.6, 1.0].map(|r| (format!("Gold, roughness {r}"), pbr(gold, 1.0, r)));
    let share = [0.0, 0.25, 0.5, 0.75, 1.0].map(|m| (format!("Metallic {m}"), pbr([0.8, 0.1, 0.1], m, 0.3)));
    spheres(&mut doc, 0.28, &[rough.to_vec(), share.to_vec()]);
    doc
}

/// Glass of index 1.5 that transmits all.
fn clear(color: [f64; 3], volume: Option<Value>) -> Value {
    let mut value = with(
        pbr(color, 0.0, 0.0),
        json!({ "extensions": {
            "KHR_materials_ior": { "ior": 1.5 },
            "KHR_materials_transmission": { "transmissionFactor": 1.0 },
        } }),
    );
    if let Some(volume) = volume {
        value["extensions"]["KHR_materials_volume"] = volume;
    }
    value
}

/// Above: solid, thin, tinted at its surface, tinted inside. Below: the same tinted glass of growing thickness.
pub(super) fn glass() -> Doc {
    let mut doc = Doc::new("glass");
    doc.stage(Lit::Well);
    board(&mut doc, -0.9);
    let amber = json!({
        "thicknessFactor": 1.0, "attenuationDistance": 0.25, "attenuationColor": [0.9, 0.5, 0.12],
    });
    let row = [
        ("Solid", clear([1.0; 3], Some(json!({ "thicknessFactor": 0.5 })))),
        ("Thin", clear([1.0; 3], None)),
        ("Green thin", clear([0.35, 0.85, 0.4], None)),
        ("Amber inside", clear([1.0; 3], Some(amber.clone()))),
    ];
    let part = doc.part(&sphere(0.34, 36));
    for (i, (name, value)) in row.into_iter().enumerate() {
        let material = doc.material(name, value);
        let mesh = doc.mesh(&part, material);
        doc.place(name, mesh, [(i as f64 - 1.5) * 0.82, 1.4, 0.0]);
    }
    let slab = doc.material("Amber slab", clear([1.0; 3], Some(amber)));
    for (i, thickness) in [0.0625, 0.125, 0.25, 0.5, 1.0].into_iter().enumerate() {
        let name = format!("Slab {thickness} m");
        doc.add(&name, &block(0.42, 0.6, thickness), slab, [(i as f64 - 2.0) * 0.6, 0.05, -0.2]);
    }
    doc
}

/// Panes of growing transmission before a board; below, tinted ones.
pub(super) fn transmission() -> Doc {
    let mut doc = Doc::new("transmission");
    doc.stage(Lit::Well);
    board(&mut doc, -0.6);
    let pane = doc.part(&card(0.55, 0.7));
    for (y, color) in [[0.9, 0.9, 0.9], [0.9, 0.35, 0.2]].into_iter().enumerate() {
        for (x, share) in [0.0, 0.25, 0.5, 0.75, 1.0].into_iter().enumerate() {
            let value = with(
                pbr(color, 0.0, 0.0),
                json!({ "extensions": { "KHR_materials_transmission": { "transmissionFactor": share } } }),
            );
            let name = format!("{} {share}", if y == 0 { "White" } else { "Red" });
            let material = doc.material(&name, value);
            let mesh = doc.mesh(&pane, material);
            doc.place(&name, mesh, [(x as f64 - 2.0) * 0.64, 1.42 - 0.95 * y as f64, 0.0]);
        }
    }
    doc
}

/// KHR_materials_specular above, KHR_materials_ior below, on black so that the coat alone is seen.
pub(super) fn specular_ior() -> Doc {
    let mut doc = Doc::new("specular-ior");
    doc.stage(Lit::Well);
    let coat =
        |extensions: Value| with(pbr([0.02, 0.02, 0.025], 0.0, 0.15), json!({ "extensions": extensions }));
    let specular = |value: Value| coat(json!({ "KHR_materials_specular": value }));
    let above = vec![
        ("Factor 0".to_owned(), specular(json!({ "specularFactor": 0.0 }))),
        ("Factor 0.5".to_owned(), specular(json!({ "specularFactor": 0.5 }))),
        ("Factor 1".to_owned(), specular(json!({ "specularFactor": 1.0 }))),
        ("Red".to_owned(), specular(json!({ "specularColorFactor": numbers(&[2.0, 0.2, 0.1]) }))),
        ("Blue".to_owned(), specular(json!({ "specularColorFactor": numbers(&[0.1, 0.4, 4.0]) }))),
    ];
    let below = [1.0, 1.2, 1.5, 2.0, 3.0]
        .map(|ior| (format!("Index {ior}"), coat(json!({ "KHR_materials_ior": { "ior": ior } }))))
        .to_vec();
    spheres(&mut doc, 0.28, &[above, below]);
    doc
}

/// The coat by roughness, at an index of 1.5 above and of 2 below, on a coated floor.
pub(super) fn substrate() -> Doc {
    let mut doc = Doc::new("substrate");
    doc.stage(Lit::Well);
    let coat = |color: [f64; 3], roughness: f64, ior: f64| {
        with(pbr(color, 0.0, roughness), json!({ "extensions": { "KHR_materials_ior": { "ior": ior } } }))
    };
    let row = |color: [f64; 3], ior: f64| {
        [0.07, 0.15, 0.25, 0.35, 0.5]
            .map(|r| (format!("Index {ior}, roughness {r}"), coat(color, r, ior)))
            .to_vec()
    };
    spheres(&mut doc, 0.28, &[row([0.55, 0.12, 0.1], 1.5), row([0.1, 0.3, 0.5], 2.0)]);
    let tray = doc.material("Tray", coat([0.3, 0.28, 0.1], 0.2, 2.0));
    doc.add("Tray", &block(3.2, 0.1, 1.6), tray, [0.0; 3]);
    doc
}

/// Above: KHR_materials_pbrSpecularGlossiness. Below: the metallic-roughness material that is the same here.
pub(super) fn specular_glossiness() -> Doc {
    let mut doc = Doc::new("specular-glossiness");
    doc.stage(Lit::Well);
    let blue = [0.12, 0.3, 0.65];
    let glossy = |color: [f64; 3], specular: f64, gloss: f64| {
        json!({ "extensions": { "KHR_materials_pbrSpecularGlossiness": {
            "diffuseFactor": numbers(&[color[0], color[1], color[2], 1.0]),
            "specularFactor": numbers(&[specular; 3]),
            "glossinessFactor": gloss,
        } } })
    };
    let mut above: Vec<(String, Value)> =
        [0.0, 0.4, 0.7, 0.9].map(|g| (format!("Glossiness {g}"), glossy(blue, 0.04, g))).to_vec();
    above.push(("Specular 0".into(), glossy(blue, 0.0, 0.7)));
    let mut below: Vec<(String, Value)> = [0.0, 0.4, 0.7, 0.9]
        .map(|g| (format!("Roughness {}", numbers(&[1.0 - g])[0]), pbr(blue, 0.0, 1.0 - g)))
        .to_vec();
    below.push(("Matte".into(), matte(blue)));
    spheres(&mut doc, 0.28, &[above, below]);
    doc
}

/// In dim light: unlit things show their colours in full, matte ones do not.
pub(super) fn unlit() -> Doc {
    let mut doc = Doc::new("unlit");
    doc.stage(Lit::Dim);
    doc.environment = Some([0.5; 3]);
    let shown = |value: Value| {
        let mut value = value;
        value["extensions"] = json!({ "KHR_materials_unlit": {} });
        value
    };
    let texture = doc.texture(&letter(), sampler(CLAMP, CLAMP, false));
    let orange = [0.55, 0.2, 0.04];
    let materials = [
        ("Unlit picture", shown(painted(texture))),
        ("Matte picture", painted(texture)),
        ("Unlit orange", shown(pbr(orange, 0.0, 1.0))),
        ("Matte orange", matte(orange)),
    ];
    let square = doc.textured(&card(0.72, 0.72), &card_uvs(WHOLE));
    let ball = doc.part(&sphere(0.34, 32));
    for (i, (name, value)) in materials.into_iter().enumerate() {
        let material = doc.material(name, value);
        let mesh = doc.mesh(if i < 2 { &square } else { &ball }, material);
        doc.place(name, mesh, [(i as f64 - 1.5) * 0.84, 0.7, 0.0]);
    }
    doc
}

/// A ball that has a material in each of three variants, and a plain one without; samples beside it.
pub(super) fn variants() -> Doc {
    let mut doc = Doc::new("material-variants");
    doc.stage(Lit::Well);
    doc.variants = vec!["Beach", "Street", "Night"];
    let plain = doc.matte("Plain", [0.6; 3]);
    let materials = [
        doc.matte("Beach yellow", [0.85, 0.6, 0.08]),
        doc.matte("Street red", [0.7, 0.06, 0.05]),
        doc.material("Night chrome", pbr([0.9, 0.9, 0.92], 1.0, 0.0)),
    ];
    let mut part = doc.part(&sphere(0.42, 36));
    let mappings: Vec<Value> =
        materials.iter().enumerate().map(|(i, m)| json!({ "material": m, "variants": [i] })).collect();
    part["extensions"] = json!({ "KHR_materials_variants": { "mappings": mappings } });
    let ball = doc.mesh(&part, plain);
    doc.place("Changing", ball, [0.0, 0.98, 0.0]);
    doc.add("Pedestal", &block(0.8, 0.56, 0.8), plain, [0.0; 3]);
    // What each variant looks like.
    let small = doc.part(&sphere(0.16, 24));
    for (material, (name, x)) in
        materials.into_iter().zip([("Beach", -1.3), ("Street", -0.9), ("Night", 0.9)])
    {
        let mesh = doc.mesh(&small, material);
        doc.place(&format!("{name} sample"), mesh, [x, 0.16, 0.3]);
    }
    doc
}
