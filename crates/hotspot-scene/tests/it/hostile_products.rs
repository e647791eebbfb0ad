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
    // Another mesh for each, by its mode or by what it leaves out.
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
