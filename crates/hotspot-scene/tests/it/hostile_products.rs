//! Small files whose parts multiply: what one element states is not to be copied for each of thousands of others.

use hotspot_scene::{LoadOptions, load_glb_bytes};
use serde_json::{Value, json};

use crate::support::*;

/// Loads under a memory limit of 64 MiB.
fn load_small(json: &Value, bin: &[u8]) -> Result<hotspot_scene::Scene, hotspot_scene::LoadError> {
    let options = LoadOptions { max_memory_bytes: 64 << 20, ..Default::default() };
    load_glb_bytes("test.glb", &glb(json, bin), &options)
}

#[test]
fn weights_without_targets_cost_nothing() {
    let (mut json, bin) = square();
    let primitive = json["meshes"][0]["primitives"][0].clone();
    json["meshes"][0]["primitives"] = vec![primitive; 1_000].into();
    json["meshes"][0]["weights"] = vec![1; 100_000].into();
    let scene = load_small(&json, &bin).unwrap();
    check(&scene);
    // Nothing is bent: all share one mesh.
    assert_eq!((scene.meshes.len(), scene.instances.len()), (1, 1_000));
}

#[test]
fn weights_of_targets_are_charged_for_each_bent_primitive() {
    let (mut json, mut bin) = square();
    let target = json!({"POSITION": float_accessor(&mut json, &mut bin, &[0.0; 12], "VEC3")});
    json["meshes"][0]["primitives"][0]["targets"] = vec![target; 1_000].into();
    json["meshes"][0]["weights"] = vec![1; 1_000].into();
    json["nodes"] = vec![json!({"mesh": 0}); 10_000].into();
    json["scenes"][0]["nodes"] = (0..10_000).collect::<Vec<_>>().into();
    let result = load_small(&json, &bin);
    assert_refused(result, "weights", "test.glb", &["meshes[0].primitives[0]", "memory limit"]);
}

#[test]
fn long_names_are_cut() {
    let (mut json, bin) = square();
    let long = "ü".repeat(100_000);
    let mut primitive = json["meshes"][0]["primitives"][0].clone();
    json["meshes"][0]["name"] = long.as_str().into();
    json["materials"][0]["name"] = long.as_str().into();
    json["cameras"] =
        json!([{"type": "perspective", "name": long, "perspective": {"yfov": 1.0, "znear": 0.1}}]);
    // A second mesh, by its mode.
    primitive["mode"] = 5.into();
    push(&mut json["meshes"][0]["primitives"], primitive);
    json["nodes"] = vec![json!({"mesh": 0, "camera": 0}); 1_000].into();
    json["scenes"][0]["nodes"] = (0..1_000).collect::<Vec<_>>().into();
    let scene = load_small(&json, &bin).unwrap();
    check(&scene);
    assert_eq!((scene.objects.len(), scene.cameras.len(), scene.meshes.len()), (1_000, 1_000, 2));
    assert_eq!(scene.materials[0].name, "ü".repeat(200));
    let objects = scene.objects.iter().map(|object| &object.name);
    let cameras = scene.cameras.iter().map(|camera| &camera.name);
    for name in objects.chain(cameras).chain(scene.meshes.iter().map(|mesh| &mesh.name)) {
        assert!((200..210).contains(&name.chars().count()), "{} characters", name.chars().count());
    }
}

#[test]
fn the_effort_of_tangents_adds_up_over_a_file() {
    let (mut json, mut bin) = textured_square();
    json["materials"][0]["normalTexture"] = json!({"index": 0});
    // A fan of triangles around its first corner, whose sum of squares is a third of what a file may take.
    let triangles = 8_200u16;
    let rim = (0..=triangles).map(|i| f32::from(i) / f32::from(triangles));
    let positions: Vec<f32> = [0.0; 3].into_iter().chain(rim.clone().flat_map(|x| [x, 1.0, 0.0])).collect();
    let uvs: Vec<f32> = [0.0; 2].into_iter().chain(rim.flat_map(|x| [x, 1.0])).collect();
    let normals = [0.0, 0.0, 1.0].repeat(positions.len() / 3);
    let indices: Vec<u8> = (1..=triangles).flat_map(|i| [0, i + 1, i]).flat_map(u16::to_le_bytes).collect();
    let normals = float_accessor(&mut json, &mut bin, &normals, "VEC3");
    let uvs = float_accessor(&mut json, &mut bin, &uvs, "VEC2");
    let indices = accessor(&mut json, &mut bin, &indices, 5123, "SCALAR");
    let primitives = (0..5).map(|_| {
        let positions = float_accessor(&mut json, &mut bin, &positions, "VEC3");
        json!({"attributes": {"POSITION": positions, "NORMAL": normals, "TEXCOORD_0": uvs},
            "indices": indices, "material": 0})
    });
    let primitives: Vec<Value> = primitives.collect();
    json["meshes"][0]["primitives"] = primitives.into();
    let scene = load_pair(&json, &bin).unwrap();
    check(&scene);
    assert_eq!(scene.meshes.iter().filter(|mesh| mesh.tangents.is_some()).count(), 2);
    assert_eq!(repaired(&scene, "too many triangles meet in a vertex: normal map left out"), 3);
}
