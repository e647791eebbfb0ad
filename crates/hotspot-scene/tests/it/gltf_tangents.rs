//! Tangents of meshes whose material has a normal map.

use hotspot_scene::{LoadError, Scene};
use serde_json::{Value, json};

use crate::support::*;

fn load_bumpy(change: impl FnOnce(&mut Value, &mut Vec<u8>)) -> Result<Scene, LoadError> {
    let (mut json, mut bin) = textured_square();
    json["materials"][0]["normalTexture"] = json!({"index": 0});
    change(&mut json, &mut bin);
    let scene = load_pair(&json, &bin);
    scene.iter().for_each(check);
    scene
}

#[test]
fn tangents_are_generated_for_normal_maps_alone() {
    let scene = load_bumpy(|_, _| {}).unwrap();
    assert_eq!(scene.meshes[0].tangents.as_ref().unwrap()[..], [[1.0, 0.0, 0.0, 1.0]; 4]);
    let (json, bin) = textured_square();
    assert!(load_pair(&json, &bin).unwrap().meshes[0].tangents.is_none());
}

#[test]
fn the_files_tangents_are_used_and_mended() {
    let values = [0.0, 2.0, 0.0, -1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.5, 0.0, 1.0, 0.0, 1.0];
    let change = |json: &mut Value, bin: &mut Vec<u8>| {
        let index = float_accessor(json, bin, &values, "VEC4");
        json["meshes"][0]["primitives"][0]["attributes"]["TANGENT"] = index.into();
    };
    let scene = load_bumpy(change).unwrap();
    let tangents = scene.meshes[0].tangents.as_ref().unwrap();
    assert_eq!(tangents[0], [0.0, 1.0, 0.0, -1.0]);
    assert_eq!(tangents[1][2], 0.0);
    assert_eq!(tangents[2..], [[0.0, 1.0, 0.0, 1.0]; 2]);
    assert_eq!(repaired(&scene, "tangents replaced"), 1);
    assert_eq!(repaired(&scene, "signs of tangents"), 1);
    // Without normals, the file's tangents count no more: flat normals, and tangents to go with them.
    let scene = load_bumpy(|json, bin| {
        change(json, bin);
        json["meshes"][0]["primitives"][0]["attributes"].as_object_mut().unwrap().remove("NORMAL");
    })
    .unwrap();
    let mesh = &scene.meshes[0];
    assert_eq!(mesh.normals.as_ref().unwrap()[..], [[0.0, 0.0, 1.0]; 6]);
    assert_eq!(mesh.tangents.as_ref().unwrap()[..], [[1.0, 0.0, 0.0, 1.0]; 6]);
}

#[test]
fn a_map_that_reads_the_second_coordinates_has_their_tangents() {
    let scene = load_bumpy(|json, bin| {
        // Mirrored left to right.
        let index = float_accessor(json, bin, &[1.0, 1.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0], "VEC2");
        json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_1"] = index.into();
        json["materials"][0]["normalTexture"]["texCoord"] = 1.into();
    })
    .unwrap();
    assert_eq!(scene.meshes[0].tangents.as_ref().unwrap()[..], [[-1.0, 0.0, 0.0, -1.0]; 4]);
}

#[test]
fn without_texture_coordinates_the_map_is_left_out() {
    let scene = load_bumpy(|json, _| {
        json["meshes"][0]["primitives"][0]["attributes"].as_object_mut().unwrap().remove("TEXCOORD_0");
    })
    .unwrap();
    assert!(scene.meshes[0].tangents.is_none());
    assert_eq!(repaired(&scene, "normal map left out"), 1);
}
