//! Skins.

use std::f64::consts::FRAC_1_SQRT_2;

use hotspot_scene::Scene;
use serde_json::{Value, json};

use crate::support::*;

const IDENTITY: [f32; 16] = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];

/// A bar of two squares along y: x = 0, 1 and y = 0, 1, 2, facing +z. The lower joint stands at the origin, the upper one at
/// (0, 1, 0). The lowest corners follow the first, the uppermost the second, those between half of each.
fn bar() -> (Value, Vec<u8>) {
    let (mut json, mut bin) = square();
    let corners: Vec<f32> = (0..6).flat_map(|i| [(i % 2) as f32, (i / 2) as f32, 0.0]).collect();
    let positions = float_accessor(&mut json, &mut bin, &corners, "VEC3");
    let normals = float_accessor(&mut json, &mut bin, &[0.0, 0.0, 1.0].repeat(6), "VEC3");
    let indices: Vec<u8> = vec![0, 1, 3, 0, 3, 2, 2, 3, 5, 2, 5, 4];
    let indices = accessor(&mut json, &mut bin, &indices, 5121, "SCALAR");
    let joints = accessor(&mut json, &mut bin, &[0, 1, 0, 0].repeat(6), 5121, "VEC4");
    let weights = [[1.0, 0.0], [1.0, 0.0], [0.5, 0.5], [0.5, 0.5], [0.0, 1.0], [0.0, 1.0]];
    let weights: Vec<f32> = weights.iter().flat_map(|[a, b]| [*a, *b, 0.0, 0.0]).collect();
    let weights = float_accessor(&mut json, &mut bin, &weights, "VEC4");
    let mut down = IDENTITY;
    down[13] = -1.0;
    let inverse = float_accessor(&mut json, &mut bin, &[IDENTITY, down].concat(), "MAT4");
    json["meshes"][0]["primitives"][0] = json!({"attributes": {"POSITION": positions, "NORMAL": normals,
        "JOINTS_0": joints, "WEIGHTS_0": weights}, "indices": indices, "material": 0});
    json["skins"] = json!([{"joints": [1, 2], "inverseBindMatrices": inverse}]);
    // The node of the mesh stands far away, which is not to matter.
    json["nodes"] = json!([
        {"name": "Bar", "mesh": 0, "skin": 0, "translation": [100, 0, 0]},
        {"name": "Lower", "children": [2]},
        {"name": "Upper", "translation": [0, 1, 0]}
    ]);
    json["scenes"][0]["nodes"] = json!([0, 1]);
    (json, bin)
}

fn load_bar(change: impl FnOnce(&mut Value, &mut Vec<u8>)) -> Scene {
    let (mut json, mut bin) = bar();
    change(&mut json, &mut bin);
    let scene = load_pair(&json, &bin).unwrap();
    check(&scene);
    scene
}

const IDENTITY_ROWS: [[f64; 4]; 3] = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

#[test]
fn at_rest_the_bar_is_straight_wherever_its_node_stands() {
    let scene = load_bar(|_, _| {});
    assert_eq!(scene.meshes[0].positions[4..], [[0.0, 2.0, 0.0], [1.0, 2.0, 0.0]]);
    assert_eq!(scene.instances[0].to_world, IDENTITY_ROWS);
    assert_eq!(scene.meshes[0].name, "Quad of Bar");
    assert!(scene.unmodelled.is_empty() && scene.repairs.is_empty());
}

#[test]
fn a_bent_bar_has_known_corners() {
    // The upper joint turns by 90 degrees about z: x to y, y to -x, around (0, 1).
    let scene =
        load_bar(|json, _| json["nodes"][2]["rotation"] = json!([0, 0, FRAC_1_SQRT_2, FRAC_1_SQRT_2]));
    let wanted = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        // Half way between where the two joints put it: (0, 1) and (0, 1); (1, 1) and (0, 2).
        [0.0, 1.0, 0.0],
        [0.5, 1.5, 0.0],
        [-1.0, 1.0, 0.0],
        [-1.0, 2.0, 0.0],
    ];
    assert_close(&scene.meshes[0].positions.concat(), &wanted.concat(), 1e-6);
    // About x: the upper normals turn from z to -y, those between by the mean matrix, of which the inverse transpose
    // leaves 45 degrees.
    let scene =
        load_bar(|json, _| json["nodes"][2]["rotation"] = json!([FRAC_1_SQRT_2, 0, 0, FRAC_1_SQRT_2]));
    let normals = scene.meshes[0].normals.as_ref().unwrap();
    assert_close(&normals[0], &[0.0, 0.0, 1.0], 1e-6);
    assert_close(&normals[2], &[0.0, -FRAC_1_SQRT_2, FRAC_1_SQRT_2], 1e-6);
    assert_close(&normals[4], &[0.0, -1.0, 0.0], 1e-6);
}

#[test]
fn normals_go_by_the_inverse_transpose_and_mirrored_joints_turn_triangles() {
    // A slanted normal (1, 0, 1) on a joint that doubles x: (1/2, 0, 1).
    let scale = |scale: Value| {
        load_bar(|json, bin| {
            json["nodes"][1]["scale"] = scale;
            let at = json["bufferViews"][5]["byteOffset"].as_u64().unwrap() as usize;
            bin[at..at + 72].copy_from_slice(&floats(&[1.0, 0.0, 1.0].repeat(6)));
        })
    };
    let length = 1.25f64.sqrt();
    let scene = scale(json!([2, 1, 1]));
    let mesh = &scene.meshes[0];
    assert_eq!(mesh.positions[1], [2.0, 0.0, 0.0]);
    assert_close(&mesh.normals.as_ref().unwrap()[0], &[0.5 / length, 0.0, 1.0 / length], 1e-6);
    assert_eq!(mesh.triangles[0], [0, 1, 3]);
    // Mirrored: the front stays where the normals point.
    let scene = scale(json!([-2, 1, 1]));
    let mesh = &scene.meshes[0];
    assert_close(&mesh.normals.as_ref().unwrap()[0], &[-0.5 / length, 0.0, 1.0 / length], 1e-6);
    assert_eq!(mesh.triangles[0], [0, 3, 1]);
}

#[test]
fn joints_outside_of_the_scene_stand_along_their_own_parents() {
    let scene = load_bar(|json, _| {
        json["scenes"][0]["nodes"] = json!([0]);
        json["nodes"][1]["translation"] = json!([0, 0, 7]);
        push(&mut json["nodes"], json!({"children": [1], "scale": [1, 1, 2]}));
    });
    assert_eq!(scene.meshes[0].positions[5], [1.0, 2.0, 14.0]);
}

#[test]
fn nodes_of_one_mesh_and_skin_share_the_result_and_objects_stay_apart() {
    let scene = load_bar(|json, _| {
        push(&mut json["nodes"], json!({"mesh": 0, "skin": 0, "name": "Twin"}));
        push(&mut json["nodes"], json!({"mesh": 0, "name": "Unbent", "translation": [5, 0, 0]}));
        json["scenes"][0]["nodes"] = json!([0, 1, 3, 4]);
        json["nodes"][2]["translation"] = json!([0, 3, 0]);
    });
    let meshes: Vec<_> = scene.instances.iter().map(|i| i.mesh).collect();
    assert_eq!(meshes, [0, 0, 1]);
    assert_eq!(scene.objects.len(), 3);
    assert_eq!(scene.meshes[1].positions[4], [0.0, 2.0, 0.0]);
    assert_eq!(scene.instances[2].to_world[0][3], 5.0);
}

#[test]
fn second_sets_short_joints_and_bytes_of_weight_are_read() {
    let scene = load_bar(|json, bin| {
        // All weight in a second set, on the upper joint, stored as u16 and u8.
        let none = accessor(json, bin, &[0; 24], 5121, "VEC4");
        json["accessors"][none]["normalized"] = true.into();
        let joints: Vec<u8> = [1u16, 0, 0, 0].repeat(6).iter().flat_map(|j| j.to_le_bytes()).collect();
        let joints = accessor(json, bin, &joints, 5123, "VEC4");
        let weights = accessor(json, bin, &[255, 0, 0, 0].repeat(6), 5121, "VEC4");
        json["accessors"][weights]["normalized"] = true.into();
        let attributes = &mut json["meshes"][0]["primitives"][0]["attributes"];
        attributes["WEIGHTS_0"] = none.into();
        attributes["JOINTS_1"] = joints.into();
        attributes["WEIGHTS_1"] = weights.into();
        json["nodes"][2]["translation"] = json!([0, 1, 4]);
    });
    assert_eq!(scene.meshes[0].positions[1], [1.0, 0.0, 4.0]);
    assert!(scene.repairs.is_empty());
}

#[test]
fn weights_are_mended_and_counted() {
    let scene = load_bar(|json, bin| {
        let mut weights = [0.0f32; 24];
        weights[0..2].copy_from_slice(&[2.0, 2.0]);
        weights[4] = f32::NAN;
        weights[5] = 1.0;
        weights[8..10].copy_from_slice(&[-1.0, 0.999]);
        let weights = float_accessor(json, bin, &weights, "VEC4");
        json["meshes"][0]["primitives"][0]["attributes"]["WEIGHTS_0"] = weights.into();
        json["nodes"][2]["translation"] = json!([0, 1, 4]);
    });
    let z: Vec<_> = scene.meshes[0].positions.iter().map(|p| p[2]).collect();
    assert_eq!(z, [2.0, 4.0, 4.0, 0.0, 0.0, 0.0]);
    assert_eq!(repaired(&scene, "negative or NaN weights"), 2);
    assert_eq!(repaired(&scene, "scaled to the sum 1"), 1);
    assert_eq!(repaired(&scene, "vertices without joints"), 3);
}

#[test]
fn a_skin_on_a_mesh_without_joints_leaves_it_where_its_node_stands() {
    let scene = load_bar(|json, _| {
        let attributes = json["meshes"][0]["primitives"][0]["attributes"].as_object_mut().unwrap();
        attributes.remove("JOINTS_0");
        attributes.remove("WEIGHTS_0");
    });
    assert_eq!(scene.instances[0].to_world[0][3], 100.0);
    assert_eq!(repaired(&scene, "no JOINTS_0"), 1);
}

#[test]
fn morph_targets_come_before_joints() {
    let scene = load_bar(|json, bin| {
        let lift = float_accessor(json, bin, &[0.0, 0.0, 1.0].repeat(6), "VEC3");
        json["meshes"][0]["primitives"][0]["targets"] = json!([{"POSITION": lift}]);
        json["nodes"][0]["weights"] = json!([2]);
        json["nodes"][1]["scale"] = json!([1, 1, 10]);
    });
    assert_eq!(scene.meshes[0].positions[0], [0.0, 0.0, 20.0]);
}

#[test]
fn broken_skins_are_refused_by_name() {
    type Change = fn(&mut Value, &mut Vec<u8>);
    let cases: [(&str, Change, &[&str]); 9] = [
        ("no joints", |j, _| j["skins"][0]["joints"] = json!([]), &["skins[0].joints"]),
        ("no such joint", |j, _| j["skins"][0]["joints"][1] = 9.into(), &["skins[0].joints[1]", "9"]),
        ("no such skin", |j, _| j["nodes"][0]["skin"] = 9.into(), &["nodes[0].skin", "9"]),
        ("too few matrices", |j, _| j["accessors"][9]["count"] = 1.into(), &["skins[0]", "1 matrices for 2"]),
        (
            "matrices of another type",
            |j, _| j["accessors"][9]["type"] = "VEC4".into(),
            &["accessors[9].type"],
        ),
        (
            "joint beyond the skin",
            |j, bin| {
                let at = j["bufferViews"][7]["byteOffset"].as_u64().unwrap() as usize;
                bin[at] = 2;
            },
            &["JOINTS_0", "vertex 0", "joint 2"],
        ),
        (
            "weights alone",
            |j, _| {
                j["meshes"][0]["primitives"][0]["attributes"].as_object_mut().unwrap().remove("JOINTS_0");
            },
            &["JOINTS_0", "missing"],
        ),
        (
            "a cycle of joints",
            |j, _| {
                j["scenes"][0]["nodes"] = json!([0]);
                j["nodes"][2]["children"] = json!([1]);
            },
            &["skins[0].joints[0]", "cycle"],
        ),
        (
            "a joint of two parents",
            |j, _| {
                j["scenes"][0]["nodes"] = json!([0]);
                push(&mut j["nodes"], json!({"children": [1]}));
                push(&mut j["nodes"], json!({"children": [1]}));
            },
            &["skins[0].joints[0]", "two parents"],
        ),
    ];
    for (case, change, parts) in cases {
        let (mut json, mut bin) = bar();
        change(&mut json, &mut bin);
        assert_refused(load_pair(&json, &bin), case, "test.glb", parts);
    }
}
