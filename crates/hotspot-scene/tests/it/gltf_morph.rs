//! Morph targets.

use serde_json::{Value, json};

use crate::support::*;

/// Two targets: the first lifts the last corner by 2 and tilts all normals, the second moves everything along x.
fn morphing(json: &mut Value, bin: &mut Vec<u8>) {
    let mut lift = [0.0; 12];
    lift[11] = 2.0;
    let lift = float_accessor(json, bin, &lift, "VEC3");
    let tilt = float_accessor(json, bin, &[1.0, 0.0, 0.0].repeat(4), "VEC3");
    let shift = float_accessor(json, bin, &[1.0, 0.0, 0.0].repeat(4), "VEC3");
    json["meshes"][0]["primitives"][0]["targets"] =
        json!([{"POSITION": lift, "NORMAL": tilt}, {"POSITION": shift}]);
}

#[test]
fn targets_are_added_by_the_nodes_weights_or_the_meshs() {
    let scene = load_changed(|json, bin| {
        morphing(json, bin);
        json["meshes"][0]["weights"] = json!([1, 0]);
        json["nodes"] = json!([{"mesh": 0}, {"mesh": 0, "weights": [0.5, -3]}, {"mesh": 0, "weights": [0, 0]},
            {"mesh": 0, "weights": [0.5, -3.0]}]);
        json["scenes"][0]["nodes"] = json!([0, 1, 2, 3]);
    })
    .unwrap();
    check(&scene);
    let of = |node: usize| &scene.meshes[scene.instances[node].mesh as usize];
    assert_eq!(of(0).positions[3], [0.0, 1.0, 2.0]);
    assert_eq!(of(0).positions[..3].concat(), SQUARE[..9]);
    assert_eq!(of(1).positions[3], [-3.0, 1.0, 1.0]);
    assert_eq!(of(2).positions.concat(), SQUARE);
    // Equal weights share a mesh: three in all.
    assert_eq!(scene.meshes.len(), 3);
    assert_eq!(scene.instances[1].mesh, scene.instances[3].mesh);
    let half = std::f32::consts::FRAC_1_SQRT_2;
    assert_close(&of(0).normals.as_ref().unwrap()[0], &[half, 0.0, half], 1e-6);
    assert!(scene.unmodelled.is_empty() && scene.repairs.is_empty());
}

#[test]
fn without_weights_the_base_shape_is_shared() {
    let scene = load_changed(|json, bin| {
        morphing(json, bin);
        json["nodes"] = json!([{"mesh": 0}, {"mesh": 0}]);
        json["scenes"][0]["nodes"] = json!([0, 1]);
    })
    .unwrap();
    assert_eq!((scene.meshes.len(), scene.meshes[0].positions.concat()), (1, SQUARE.to_vec()));
    assert_eq!(scene.meshes[0].name, "Quad");
}

#[test]
fn targets_may_be_sparse_empty_or_of_other_attributes() {
    let scene = load_changed(|json, bin| {
        morphing(json, bin);
        let colors = float_accessor(json, bin, &[0.0; 12], "VEC3");
        json["meshes"][0]["primitives"][0]["targets"][0]["COLOR_0"] = colors.into();
        // No data at all: zeros.
        push(&mut json["accessors"], json!({"componentType": 5126, "count": 4, "type": "VEC3"}));
        json["meshes"][0]["primitives"][0]["targets"][1]["POSITION"] = 8.into();
        json["nodes"][0]["weights"] = json!([1, 1, 1]);
    })
    .unwrap();
    assert_eq!(scene.meshes[0].positions[3], [0.0, 1.0, 2.0]);
    assert_eq!(scene.unmodelled.len(), 1);
    assert_eq!(scene.unmodelled[0].feature, "morph targets of COLOR_0");
    assert_eq!(repaired(&scene, "as many weights"), 1);
}

#[test]
fn broken_targets_are_refused_where_they_matter() {
    let with = |weights: Value, change: fn(&mut Value)| {
        load_changed(|json, bin| {
            morphing(json, bin);
            json["nodes"][0]["weights"] = weights;
            change(json);
        })
    };
    let short: fn(&mut Value) = |json| json["accessors"][4]["count"] = 3.into();
    let result = with(json!([1, 0]), short);
    assert_refused(result, "short", "test.glb", &["targets", "accessors[4]", "3 differences for 4"]);
    // The weight 0 makes a target irrelevant.
    assert!(with(json!([0, 1]), short).is_ok());
    let result = with(json!([1, 0]), |json| {
        json["meshes"][0]["primitives"][0]["targets"][0]["POSITION"] = 99.into();
    });
    assert_refused(result, "out of range", "test.glb", &["targets[0]", "out of range"]);
    // Differences may be NaN as positions may: the triangles go.
    let scene = load_changed(|json, bin| {
        let delta = float_accessor(json, bin, &[f32::NAN; 12], "VEC3");
        json["meshes"][0]["primitives"][0]["targets"] = json!([{"POSITION": delta}]);
        json["nodes"][0]["weights"] = json!([1e300]);
    })
    .unwrap();
    assert!(scene.instances.is_empty());
}
