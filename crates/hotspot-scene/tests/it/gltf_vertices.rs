//! Vertex colours, and the ways of storing vertices and indices.

use serde_json::{Value, json};

use crate::support::*;

fn with_colors(bytes: &[u8], component: u32, kind: &str) -> hotspot_scene::Scene {
    let scene = load_changed(|json, bin| {
        let index = accessor(json, bin, bytes, component, kind);
        json["accessors"][index]["normalized"] = (component != 5126).into();
        json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = index.into();
    })
    .unwrap();
    check(&scene);
    assert!(scene.unmodelled.is_empty());
    scene
}

#[test]
fn colours_of_all_types_become_linear_rgba() {
    let rgb = with_colors(&floats(&[0.5, 0.25, 0.0].repeat(4)), 5126, "VEC3");
    assert_eq!(rgb.meshes[0].colors.as_ref().unwrap()[3], [0.5, 0.25, 0.0, 1.0]);
    let bytes = with_colors(&[255, 51, 0, 102].repeat(4), 5121, "VEC4");
    assert_eq!(bytes.meshes[0].colors.as_ref().unwrap()[0], [1.0, 0.2, 0.0, 0.4]);
    let shorts: Vec<u8> = [65535u16, 13107, 0].repeat(4).iter().flat_map(|c| c.to_le_bytes()).collect();
    let shorts = with_colors(&shorts, 5123, "VEC3");
    assert_eq!(shorts.meshes[0].colors.as_ref().unwrap()[2], [1.0, 0.2, 0.0, 1.0]);
}

#[test]
fn colours_outside_of_their_range_are_clamped_and_white_is_left_out() {
    let mut values = [1.0f32; 16];
    values[0..4].copy_from_slice(&[-0.5, 2.0, f32::NAN, 0.5]);
    values[5] = f32::INFINITY;
    let scene = with_colors(&floats(&values), 5126, "VEC4");
    assert_eq!(scene.meshes[0].colors.as_ref().unwrap()[..2], [[0.0, 1.0, 1.0, 0.5], [1.0; 4]]);
    assert_eq!(repaired(&scene, "colours clamped"), 2);
    assert!(with_colors(&[255; 16], 5121, "VEC4").meshes[0].colors.is_none());
}

#[test]
fn colours_follow_their_vertices_when_others_are_dropped() {
    let scene = load_changed(|json, bin| {
        let colors: Vec<f32> = (0..4).flat_map(|i| [i as f32 / 4.0; 3]).collect();
        let index = float_accessor(json, bin, &colors, "VEC3");
        json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = index.into();
        bin[12..16].copy_from_slice(&f32::NAN.to_le_bytes());
    })
    .unwrap();
    check(&scene);
    let colors = scene.meshes[0].colors.as_ref().unwrap();
    assert_eq!(colors.iter().map(|c| c[0]).collect::<Vec<_>>(), [0.0, 0.5, 0.75]);
}

#[test]
fn primitives_that_differ_in_colours_alone_do_not_share_a_mesh() {
    let scene = load_changed(|json, bin| {
        let index = float_accessor(json, bin, &[0.5; 12], "VEC3");
        let mut coloured = json["meshes"][0]["primitives"][0].clone();
        coloured["attributes"]["COLOR_0"] = index.into();
        push(&mut json["meshes"][0]["primitives"], coloured);
    })
    .unwrap();
    assert_eq!(scene.meshes.len(), 2);
    assert!(scene.meshes[0].colors.is_none() && scene.meshes[1].colors.is_some());
}

#[test]
fn integer_colours_that_do_not_say_normalized_are_normalised() {
    for (component, bytes) in
        [(5121, [255, 0, 51, 255].repeat(4)), (5123, [255, 255, 0, 0, 51, 51, 255, 255].repeat(4))]
    {
        let scene = load_changed(|json, bin| {
            let index = accessor(json, bin, &bytes, component, "VEC4");
            json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = index.into();
        })
        .unwrap();
        check(&scene);
        assert_eq!(scene.meshes[0].colors.as_ref().unwrap()[0], [1.0, 0.0, 0.2, 1.0]);
        assert_eq!(repaired(&scene, "taken as normalised"), 1);
    }
}

#[test]
fn colours_that_cannot_be_are_refused() {
    for (component, kind, normalized, part) in [
        (5126, "VEC2", false, "accessors[4].type"),
        (5125, "VEC4", false, "accessors[4].componentType"),
        (5122, "VEC4", true, "accessors[4].componentType"),
    ] {
        let result = load_changed(|json, bin| {
            let index = accessor(json, bin, &[0; 64], component, kind);
            json["accessors"][index]["normalized"] = normalized.into();
            json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = index.into();
        });
        assert_refused(result, part, "test.glb", &[part]);
    }
    let result = load_changed(|json, bin| {
        let index = float_accessor(json, bin, &[0.5; 9], "VEC3");
        json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = index.into();
    });
    assert_refused(result, "three colours", "test.glb", &["COLOR_0", "3 for 4"]);
}

#[test]
fn sparse_indices_replace_others_or_zeros() {
    let sparse = |json: &mut Value, bin: &mut Vec<u8>| {
        let places = accessor(json, bin, &[5, 4], 5121, "SCALAR");
        let values = accessor(json, bin, &[1, 0, 3, 0], 5123, "SCALAR");
        let view = |index: usize| json["accessors"][index]["bufferView"].clone();
        let (places, values) = (view(places), view(values));
        json["accessors"][3]["sparse"] = json!({"count": 2,
            "indices": {"bufferView": places, "componentType": 5121}, "values": {"bufferView": values}});
    };
    let scene = load_changed(sparse).unwrap();
    assert_eq!(scene.meshes[0].triangles, [[0, 1, 2], [0, 3, 1]]);
    // Without a view, all others are 0.
    let scene = load_changed(|json, bin| {
        sparse(json, bin);
        json["accessors"][3].as_object_mut().unwrap().remove("bufferView");
    });
    assert_eq!(repaired(&scene.unwrap(), "degenerate"), 1);
    let result = load_changed(|json, bin| {
        sparse(json, bin);
        let last = bin.len() - 2;
        bin[last] = 4;
    });
    assert_refused(result, "index out of range", "test.glb", &["accessors[3].sparse.values", "index 4"]);
}

#[test]
fn all_quantized_positions_normals_and_uvs_are_read() {
    // 100 of -128..127, of 0..255, and so on; normalised or not.
    for (component, size, largest) in
        [(5120, 1, 127.0), (5121, 1, 255.0), (5122, 2, 32767.0), (5123, 2, 65535.0)]
    {
        for normalized in [false, true] {
            let (mut json, mut bin) = textured_square();
            let corner = |n: u8| if size == 1 { vec![n] } else { vec![n, 0] };
            let corners = |list: &[[u8; 3]]| -> Vec<u8> {
                // Padded to four bytes, as the extension demands.
                let padding = vec![0; if size == 1 { 1 } else { 2 }];
                list.iter()
                    .flat_map(|c| [corner(c[0]), corner(c[1]), corner(c[2]), padding.clone()].concat())
                    .collect()
            };
            let bytes = corners(&[[0, 0, 0], [100, 0, 0], [100, 100, 0], [0, 100, 0]]);
            let positions = accessor(&mut json, &mut bin, &bytes, component, "VEC3");
            let normals = corners(&[[0, 0, 100]; 4]);
            let normals = accessor(&mut json, &mut bin, &normals, component, "VEC3");
            for index in [positions, normals] {
                let view = json["accessors"][index]["bufferView"].as_u64().unwrap() as usize;
                json["bufferViews"][view]["byteStride"] = (4 * size).into();
                json["accessors"][index]["count"] = 4.into();
                json["accessors"][index]["normalized"] = normalized.into();
            }
            let uvs: Vec<u8> = [[0, 0], [100, 0], [100, 100], [0, 100]]
                .iter()
                .flat_map(|c: &[u8; 2]| [corner(c[0]), corner(c[1]), vec![0; 4 - 2 * size]].concat())
                .collect();
            let uvs = accessor(&mut json, &mut bin, &uvs, component, "VEC2");
            let view = json["accessors"][uvs]["bufferView"].as_u64().unwrap() as usize;
            json["bufferViews"][view]["byteStride"] = 4.into();
            json["accessors"][uvs]["count"] = 4.into();
            json["accessors"][uvs]["normalized"] = normalized.into();
            json["meshes"][0]["primitives"][0]["attributes"] =
                json!({"POSITION": positions, "NORMAL": normals, "TEXCOORD_0": uvs});
            json["extensionsUsed"] = json!(["KHR_mesh_quantization"]);
            json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
            let scene = load_pair(&json, &bin).unwrap();
            let wanted = if normalized { 100.0f32 / largest } else { 100.0 };
            let mesh = &scene.meshes[0];
            assert_eq!(mesh.positions[2], [wanted, wanted, 0.0], "{component} {normalized}");
            assert_eq!(mesh.normals.as_ref().unwrap()[0], [0.0, 0.0, 1.0]);
            assert_eq!(mesh.uvs.as_ref().unwrap()[2], [wanted, wanted]);
            // Without the extension, only normalised unsigned texture coordinates remain.
            json.as_object_mut().unwrap().remove("extensionsUsed");
            json.as_object_mut().unwrap().remove("extensionsRequired");
            assert_refused(load_pair(&json, &bin), "unquantized", "test.glb", &["componentType"]);
        }
    }
}

#[test]
fn scenes_are_chosen_by_name() {
    use hotspot_scene::{LoadOptions, SceneChoice, load_glb_bytes};
    let (mut json, bin) = square();
    json["nodes"] = json!([{"mesh": 0, "name": "A"}, {"mesh": 0, "name": "B"}]);
    json["scenes"] = json!([{"nodes": [0]}, {"nodes": [1], "name": "Night"}]);
    let load = |name: &str| {
        let options = LoadOptions { scene: Some(SceneChoice::Name(name.into())), ..Default::default() };
        load_glb_bytes("test.glb", &glb(&json, &bin), &options)
    };
    assert_eq!(load("Night").unwrap().objects[0].name, "B");
    assert_refused(load("Day"), "no such name", "test.glb", &["\"Day\"", "#0, #1 \"Night\"", "choose"]);
}
