//! `EXT_mesh_gpu_instancing`.

use std::f64::consts::FRAC_1_SQRT_2;

use hotspot_scene::{LoadError, LoadOptions, Scene, load_glb_bytes};
use serde_json::{Value, json};

use crate::support::*;

/// Three copies on a node that stands at x = 10: moved, turned by 90 degrees about z (as 8-bit integers), scaled.
fn copies() -> (Value, Vec<u8>) {
    let (mut json, mut bin) = square();
    let translations = [0.0, 0.0, 0.0, 1.0, 2.0, 3.0, 0.0, 0.0, 5.0];
    let translations = float_accessor(&mut json, &mut bin, &translations, "VEC3");
    let rotations = [0i8, 0, 0, 127, 0, 0, 90, 90, 0, 0, 0, 127].map(|c| c as u8);
    let rotations = accessor(&mut json, &mut bin, &rotations, 5120, "VEC4");
    json["accessors"][rotations]["normalized"] = true.into();
    let scales = float_accessor(&mut json, &mut bin, &[1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 2.0, 3.0, -4.0], "VEC3");
    let ids = float_accessor(&mut json, &mut bin, &[0.0, 1.0, 2.0], "SCALAR");
    json["nodes"][0]["translation"] = json!([10, 0, 0]);
    json["nodes"][0]["extensions"] = json!({"EXT_mesh_gpu_instancing": {"attributes":
        {"TRANSLATION": translations, "ROTATION": rotations, "SCALE": scales, "_ID": ids}}});
    json["extensionsUsed"] = json!(["EXT_mesh_gpu_instancing"]);
    json["extensionsRequired"] = json!(["EXT_mesh_gpu_instancing"]);
    (json, bin)
}

fn load_copies(change: impl FnOnce(&mut Value)) -> Result<Scene, LoadError> {
    let (mut json, bin) = copies();
    change(&mut json);
    load_pair(&json, &bin)
}

#[test]
fn copies_share_mesh_and_object() {
    let scene = load_copies(|_| {}).unwrap();
    check(&scene);
    assert!(scene.unmodelled.is_empty() && scene.repairs.is_empty());
    assert_eq!((scene.meshes.len(), scene.objects.len(), scene.instances.len()), (1, 1, 3));
    assert!(scene.instances.iter().all(|i| (i.mesh, i.object, i.material) == (0, 0, 0)));
    let wanted = [
        [[1.0, 0.0, 0.0, 10.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]],
        [[0.0, -1.0, 0.0, 11.0], [1.0, 0.0, 0.0, 2.0], [0.0, 0.0, 1.0, 3.0]],
        [[2.0, 0.0, 0.0, 10.0], [0.0, 3.0, 0.0, 0.0], [0.0, 0.0, -4.0, 5.0]],
    ];
    for (instance, wanted) in scene.instances.iter().zip(wanted) {
        assert_close(&instance.to_world.concat(), &wanted.concat(), 1e-12);
    }
}

#[test]
fn copies_follow_their_node() {
    let scene = load_copies(|json| {
        json["nodes"][0]["rotation"] = json!([0, 0, FRAC_1_SQRT_2, FRAC_1_SQRT_2]);
        // Another primitive is copied as well.
        let primitive = json["meshes"][0]["primitives"][0].clone();
        push(&mut json["meshes"][0]["primitives"], primitive);
    })
    .unwrap();
    assert_eq!((scene.instances.len(), scene.objects.len()), (6, 1));
    let place = scene.instances[1].to_world.map(|row| row[3]);
    assert_close(&place, &[8.0, 1.0, 3.0], 1e-12);
}

#[test]
fn attributes_of_applications_alone_only_count() {
    let scene = load_copies(|json| {
        let attributes = &mut json["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"];
        *attributes = json!({"_ID": attributes["_ID"]});
    })
    .unwrap();
    assert_eq!(scene.instances.len(), 3);
    assert!(scene.instances.iter().all(|i| i.to_world[0][3] == 10.0));
}

#[test]
fn broken_copies_are_refused_by_name() {
    type Change = fn(&mut Value);
    let cases: [(&str, Change, &[&str]); 5] = [
        ("no attributes", |e| *e = json!({}), &["EXT_mesh_gpu_instancing.attributes", "missing"]),
        ("empty attributes", |e| e["attributes"] = json!({}), &["number of copies"]),
        ("no such accessor", |e| e["attributes"]["SCALE"] = 99.into(), &["attributes.SCALE", "99"]),
        ("other counts", |e| e["attributes"]["SCALE"] = 0.into(), &["disagree"]),
        ("another type", |e| e["attributes"]["SCALE"] = 7.into(), &["accessors[7].type"]),
    ];
    for (case, change, parts) in cases {
        let result =
            load_copies(|json| change(&mut json["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]));
        assert_refused(result, case, "test.glb", parts);
    }
}

#[test]
fn the_limit_counts_copies() {
    let (json, bin) = copies();
    let whole = glb(&json, &bin);
    let load = |most| {
        let options = LoadOptions { max_instances: most, ..Default::default() };
        load_glb_bytes("test.glb", &whole, &options)
    };
    assert!(load(3).is_ok());
    assert_refused(load(2), "three copies", "test.glb", &["more than 2"]);
}
