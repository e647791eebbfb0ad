//! Geometry, nodes, cameras and textures of well-formed glTF.

use hotspot_scene::{
    Bsdf, Environment, LoadOptions, Projection, Scene, SceneChoice, TextureRef, Wrap, load_glb_bytes,
};
use serde_json::{Value, json};

use crate::support::*;

/// The triangles of the first mesh as positions.
fn corners(scene: &Scene) -> Vec<[[f32; 3]; 3]> {
    let mesh = &scene.meshes[0];
    mesh.triangles.iter().map(|t| t.map(|i| mesh.positions[i as usize])).collect()
}

/// z of the (unnormalised) geometric normals: the sign says which side is the front.
fn facing(scene: &Scene) -> Vec<f32> {
    let z = |[a, b, c]: [[f32; 3]; 3]| (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    corners(scene).into_iter().map(z).collect()
}

#[test]
fn strips_fans_and_lists_without_indices_face_the_same_way() {
    let primitive = |json: &mut Value, mode: u64| {
        json["meshes"][0]["primitives"][0] =
            json!({"attributes": {"POSITION": 0}, "mode": mode, "material": 0});
    };
    // A fan around the first corner of the square.
    let fan = load_changed(|json, _| primitive(json, 6)).unwrap();
    assert_eq!(fan.meshes[0].triangles, [[1, 2, 0], [2, 3, 0]]);
    assert_eq!(facing(&fan), [1.0, 1.0]);
    // A strip goes zigzag: corners 3 and 4 change places.
    let strip = load_changed(|json, bin| {
        primitive(json, 5);
        bin.splice(24..48, floats(&[0.0, 1.0, 0.0, 1.0, 1.0, 0.0]));
    })
    .unwrap();
    assert_eq!(strip.meshes[0].triangles, [[0, 1, 2], [1, 3, 2]]);
    assert_eq!(facing(&strip), [1.0, 1.0]);
    // A list drops the vertex that completes no triangle.
    let list = load_changed(|json, _| primitive(json, 4)).unwrap();
    assert_eq!(list.meshes[0].triangles, [[0, 1, 2]]);
    assert_eq!(repaired(&list, "incomplete"), 1);
}

#[test]
fn points_and_lines_are_named() {
    for (mode, feature) in [(0, "points"), (1, "lines"), (2, "lines"), (3, "lines")] {
        let scene = load_changed(|json, _| json["meshes"][0]["primitives"][0]["mode"] = mode.into()).unwrap();
        assert!(scene.instances.is_empty() && scene.objects.is_empty());
        assert_eq!(scene.unmodelled[0].feature, feature);
        assert_eq!(scene.unmodelled[0].element, "meshes[0].primitives[0]");
    }
}

#[test]
fn strides_offsets_and_byte_indices_are_followed() {
    let scene = load_changed(|json, bin| {
        // Interleaved position (12), padding (4); indices as bytes.
        let start = bin.len();
        for corner in SQUARE.chunks(3) {
            bin.extend(floats(corner));
            bin.extend([0xFF; 4]);
        }
        let indices = bin.len();
        bin.extend([9, 2, 1, 0, 0, 3, 2]);
        json["bufferViews"][0] =
            json!({"buffer": 0, "byteOffset": start, "byteLength": 64, "byteStride": 16});
        json["bufferViews"][3] = json!({"buffer": 0, "byteOffset": indices, "byteLength": 7});
        json["accessors"][3] =
            json!({"bufferView": 3, "byteOffset": 1, "componentType": 5121, "count": 6, "type": "SCALAR"});
        json["buffers"][0]["byteLength"] = bin.len().into();
    })
    .unwrap();
    assert_eq!(scene.meshes[0].positions.concat(), SQUARE);
    assert_eq!(scene.meshes[0].triangles, [[2, 1, 0], [0, 3, 2]]);
    assert!(scene.repairs.is_empty());
}

#[test]
fn quantized_positions_and_normalised_uvs_become_floats() {
    let (mut json, mut bin) = textured_square();
    let start = bin.len();
    for corner in [[0i16, 0, 0], [32767, 0, 0], [32767, 32767, 0], [-32768, 32767, 0]] {
        bin.extend(corner.iter().flat_map(|c| c.to_le_bytes()));
        bin.extend([0; 2]);
    }
    bin.extend([0, 255, 255, 255, 255, 0, 0, 51]);
    json["bufferViews"][0] = json!({"buffer": 0, "byteOffset": start, "byteLength": 32, "byteStride": 8});
    json["bufferViews"][2] = json!({"buffer": 0, "byteOffset": start + 32, "byteLength": 8});
    json["accessors"][0]["componentType"] = 5122.into();
    json["accessors"][0]["normalized"] = true.into();
    json["accessors"][2]["componentType"] = 5121.into();
    json["accessors"][2]["normalized"] = true.into();
    json["buffers"][0]["byteLength"] = bin.len().into();
    json["extensionsUsed"] = json!(["KHR_mesh_quantization"]);
    json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    let scene = load_pair(&json, &bin).unwrap();
    assert_eq!(scene.meshes[0].positions[2..], [[1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]]);
    assert_eq!(scene.meshes[0].uvs.as_ref().unwrap()[3], [0.0, 0.2]);
}

#[test]
fn sparse_accessors_replace_values() {
    let scene = load_changed(|json, bin| {
        let start = bin.len();
        bin.extend([2, 0]);
        bin.extend(1u16.to_le_bytes());
        bin.extend(floats(&[5.0, 6.0, 7.0]));
        push(&mut json["bufferViews"], json!({"buffer": 0, "byteOffset": start, "byteLength": 2}));
        push(&mut json["bufferViews"], json!({"buffer": 0, "byteOffset": start + 4, "byteLength": 12}));
        json["accessors"][0]["sparse"] = json!({"count": 1,
            "indices": {"bufferView": 4, "componentType": 5123}, "values": {"bufferView": 5}});
        json["buffers"][0]["byteLength"] = bin.len().into();
    })
    .unwrap();
    assert_eq!(scene.meshes[0].positions[2], [5.0, 6.0, 7.0]);
    assert_eq!(scene.meshes[0].positions[1], [1.0, 0.0, 0.0]);
}

#[test]
fn degenerate_triangles_and_bad_normals_are_mended_and_counted() {
    let scene = load_changed(|_, bin| {
        // The second triangle uses corner 0 twice; normal 1 is zero, normal 2 is long.
        bin[136..138].copy_from_slice(&0u16.to_le_bytes());
        bin.splice(60..84, floats(&[0.0, 0.0, 0.0, 0.0, 0.0, 10.0]));
    })
    .unwrap();
    check(&scene);
    assert_eq!(scene.meshes[0].triangles, [[0, 1, 2]]);
    assert_eq!(repaired(&scene, "degenerate"), 1);
    assert_eq!(repaired(&scene, "normals replaced"), 1);
}

#[test]
fn uvs_are_kept_for_textures_only() {
    assert!(load_changed(|_, _| {}).unwrap().meshes[0].uvs.is_none());
    let (json, bin) = textured_square();
    let scene = load_pair(&json, &bin).unwrap();
    assert_eq!(scene.meshes[0].uvs.as_ref().unwrap()[1], [1.0, 1.0]);
    assert_eq!(scene.textures[0].rgba[..8], [255, 0, 0, 64, 0, 255, 0, 255]);
}

#[test]
fn transforms_multiply_down_the_tree() {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let scene = load_changed(|json, _| {
        json["nodes"] = json!([
            {"translation": [10, 0, 0], "rotation": [0, 0, half, half], "children": [1, 2]},
            {"name": "A", "mesh": 0, "translation": [1, 2, 3], "scale": [2, 3, -4]},
            // Column-major: the translation stands last.
            {"name": "B", "mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 1, 2, 3, 1]}
        ]);
    })
    .unwrap();
    // A quarter turn about z takes x to y and y to -x.
    let wanted = [
        [[0.0, -3.0, 0.0, 8.0], [2.0, 0.0, 0.0, 1.0], [0.0, 0.0, -4.0, 3.0]],
        [[0.0, -1.0, 0.0, 8.0], [1.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 3.0]],
    ];
    for (instance, wanted) in scene.instances.iter().zip(wanted) {
        for (got, wanted) in instance.to_world.iter().flatten().zip(wanted.iter().flatten()) {
            assert!((got - wanted).abs() < 1e-12, "{:?}", instance.to_world);
        }
    }
    assert_eq!(scene.meshes.len(), 1);
    assert_eq!(scene.objects.iter().map(|o| o.name.as_str()).collect::<Vec<_>>(), ["A", "B"]);
}

#[test]
fn singular_and_odd_transforms_do_no_harm() {
    let scene = load_changed(|json, _| {
        json["nodes"] = json!([{"mesh": 0, "scale": [0, 0, 0]}, {"mesh": 0, "rotation": [0, 0, 0, 0]},
            {"mesh": 0, "rotation": [0, 0, 0, 2]}, {"camera": 0, "scale": [0, 1, 1]}]);
        json["scenes"][0]["nodes"] = json!([0, 1, 2, 3]);
        json["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 1}}]);
    })
    .unwrap();
    check(&scene);
    assert_eq!(scene.instances.len(), 3);
    assert_eq!(repaired(&scene, "rotation"), 2);
    assert_eq!(repaired(&scene, "camera dropped"), 1);
    assert_eq!(scene.instances[2].to_world[0][0], 1.0);
}

#[test]
fn names_come_from_node_mesh_or_index_and_are_unique() {
    let scene = load_changed(|json, _| {
        json["nodes"] =
            json!([{"mesh": 0}, {"mesh": 0, "name": "Quad"}, {"mesh": 1}, {"mesh": 1, "name": ""}]);
        let mut second = json["meshes"][0].clone();
        second.as_object_mut().unwrap().remove("name");
        push(&mut json["meshes"], second);
        json["scenes"][0]["nodes"] = json!([0, 1, 2, 3]);
    })
    .unwrap();
    let names: Vec<_> = scene.objects.iter().map(|o| o.name.as_str()).collect();
    assert_eq!(names, ["Quad", "Quad #2", "node 2", "node 3"]);
    // Two glTF meshes over the same accessors are one mesh.
    assert_eq!(scene.meshes.len(), 1);
}

#[test]
fn scenes_are_chosen_and_the_others_named() {
    let (mut json, bin) = square();
    json["nodes"] = json!([{"mesh": 0, "name": "A"}, {"mesh": 0, "name": "B"}]);
    json["scenes"] = json!([{"nodes": [0]}, {"nodes": [1], "name": "Night"}]);
    let name = |json: &Value, scene: Option<usize>| {
        let options = LoadOptions { scene: scene.map(SceneChoice::Index), ..Default::default() };
        let scene = load_glb_bytes("test.glb", &glb(json, &bin), &options).unwrap();
        (scene.objects[0].name.clone(), scene.unmodelled.first().map(|u| u.effect.clone()))
    };
    assert_eq!(name(&json, None).0, "A");
    assert_eq!(name(&json, Some(1)), ("B".into(), Some("only scenes[1] \"Night\" is drawn".into())));
    json["scene"] = 1.into();
    assert_eq!(name(&json, None).0, "B");
    // Without scenes, all roots are drawn.
    json["scene"] = Value::Null;
    json["scenes"] = Value::Null;
    json["nodes"] = json!([{"mesh": 0, "name": "child"}, {"children": [0]}]);
    assert_eq!(name(&json, None), ("child".into(), None));
}

#[test]
fn cameras_have_unit_axes() {
    let scene = load_changed(|json, _| {
        json["cameras"] = json!([
            {"type": "perspective", "perspective": {"yfov": 0.5, "aspectRatio": 1.5, "znear": 0.1}},
            {"name": "Top", "type": "orthographic", "orthographic": {"xmag": 2, "ymag": -1, "znear": 0, "zfar": 9}}]);
        json["nodes"] = json!([{"camera": 0, "scale": [2, 3, 4], "translation": [1, 2, 3]},
            {"camera": 1}, {"camera": 1, "name": "Side"}, {"camera": 1}]);
        json["scenes"][0]["nodes"] = json!([0, 1, 2, 3]);
    })
    .unwrap();
    let names: Vec<_> = scene.cameras.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["camera 0", "Top", "Side", "Top #2"]);
    assert_eq!(scene.cameras[0].projection, Projection::Perspective { yfov: 0.5, aspect: Some(1.5) });
    assert_eq!(scene.cameras[1].projection, Projection::Orthographic { xmag: 2.0, ymag: 1.0 });
    assert_eq!(scene.cameras[0].to_world, [[1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 2.0], [0.0, 0.0, 1.0, 3.0]]);
}

#[test]
fn the_environment_convention_is_read() {
    let with = |extras: Value| load_changed(|json, _| json["scenes"][0]["extras"] = extras).unwrap();
    let scene = with(json!({"environment": {"constant": [1, 2.5, 0]}}));
    assert!(matches!(scene.environment, Some(Environment::Constant([1.0, 2.5, 0.0]))));
    assert!(with(json!(7)).environment.is_none());
    assert_eq!(with(json!({"environment": {"map": "sky.hdr"}})).unmodelled[0].feature, "environment");
}

/// The texture of the only material's diffuse colour.
fn diffuse_texture(scene: &Scene) -> TextureRef {
    match &scene.materials[0].bsdf {
        Bsdf::Substrate { diffuse, .. } => diffuse.texture.unwrap(),
        other => panic!("{other:?}"),
    }
}

#[test]
fn samplers_and_texture_transforms_are_read() {
    let (mut json, bin) = textured_square();
    json["samplers"] = json!([{"wrapS": 33071, "wrapT": 33648, "magFilter": 9728}]);
    json["textures"][0]["sampler"] = 0.into();
    // The specification's example: the lower left quadrant, turned by 90 degrees.
    json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["extensions"] = json!({
        "KHR_texture_transform": {"offset": [0, 1], "rotation": std::f64::consts::FRAC_PI_2, "scale": [0.5, 0.5]}});
    let texture = diffuse_texture(&load_pair(&json, &bin).unwrap());
    assert_eq!((texture.wrap, texture.nearest), ([Wrap::Clamp, Wrap::Mirror], true));
    for (uv, wanted) in [([0.0, 0.0], [0.0, 1.0]), ([1.0, 1.0], [0.5, 0.5]), ([1.0, 0.0], [0.0, 0.5])] {
        let got = texture.transform.map(|m| m[0] * uv[0] + m[1] * uv[1] + m[2]);
        assert!(
            (got[0] - wanted[0]).abs() < 1e-6f32 && (got[1] - wanted[1]).abs() < 1e-6f32,
            "{uv:?} {got:?}"
        );
    }
}

#[test]
fn equal_images_are_one_texture_and_unused_ones_are_not_read() {
    let (mut json, bin) = textured_square();
    let view = json["images"][0].clone();
    json["images"] = json!([view, view, {"uri": "nowhere.png"}]);
    json["textures"] = json!([{"source": 0}, {"source": 1}, {"source": 2}]);
    json["materials"][0]["emissiveFactor"] = json!([1, 1, 1]);
    json["materials"][0]["emissiveTexture"] = json!({"index": 1});
    // Without effect: neither read nor missed.
    json["materials"][0]["occlusionTexture"] = json!({"index": 2});
    json["materials"][0]["normalTexture"] = json!({"index": 2, "scale": 0});
    push(&mut json["materials"], json!({"emissiveTexture": {"index": 2}, "emissiveFactor": [1, 1, 1]}));
    let scene = load_pair(&json, &bin).unwrap();
    assert_eq!(scene.textures.len(), 1);
    assert_eq!(scene.materials.len(), 1);
    assert!(scene.unmodelled.is_empty());
}

#[test]
fn sixteen_bit_images_are_reduced_and_grey_ones_widened() {
    let (mut json, mut bin) = textured_square();
    let image = image::ImageBuffer::<image::Luma<u16>, _>::from_raw(1, 1, vec![0x8000u16]).unwrap();
    let mut picture = std::io::Cursor::new(Vec::new());
    image.write_to(&mut picture, image::ImageFormat::Png).unwrap();
    let start = bin.len();
    bin.extend(picture.get_ref());
    json["bufferViews"][4] = json!({"buffer": 0, "byteOffset": start, "byteLength": bin.len() - start});
    json["buffers"][0]["byteLength"] = bin.len().into();
    let scene = load_pair(&json, &bin).unwrap();
    assert_eq!(scene.textures[0].rgba[..], [128, 128, 128, 255]);
    assert_eq!(repaired(&scene, "16-bit"), 1);
}

#[test]
fn textures_read_two_sets_of_texture_coordinates() {
    let (mut json, bin) = textured_square();
    json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["texCoord"] = 1.into();
    let scene = load_pair(&json, &bin).unwrap();
    assert_eq!(repaired(&scene, "no TEXCOORD_1"), 1);
    json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_1"] = 2.into();
    let scene = load_pair(&json, &bin).unwrap();
    assert!(scene.meshes[0].uvs.is_some() && scene.repairs.is_empty());
    assert!(scene.meshes[0].second_uvs.is_none());
    // A texture that wants another set reads the second one; only a third set is left out and named.
    json["materials"][0]["emissiveFactor"] = json!([1, 1, 1]);
    json["materials"][0]["emissiveTexture"] = json!({"index": 0});
    push(&mut json["accessors"], json!({"bufferView": 4, "componentType": 5126, "count": 4, "type": "VEC2"}));
    let uvs = floats(&[0.0, 0.5, 0.25, f32::NAN, 1.0, 0.0, 0.0, 0.0]);
    let view = json["bufferViews"].as_array().unwrap().len();
    push(&mut json["bufferViews"], json!({"buffer": 0, "byteOffset": bin.len(), "byteLength": 32}));
    let bin = [bin, uvs].concat();
    json["buffers"][0]["byteLength"] = bin.len().into();
    json["accessors"][4]["bufferView"] = view.into();
    json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = 4.into();
    let scene = load_pair(&json, &bin).unwrap();
    let mesh = &scene.meshes[0];
    assert_eq!(mesh.uvs.as_ref().unwrap()[1], [1.0, 1.0]);
    assert_eq!(mesh.second_uvs.as_ref().unwrap()[..2], [[0.0, 0.5], [0.0, 0.0]]);
    assert_eq!(repaired(&scene, "NaN texture coordinates"), 1);
    assert!(scene.materials[0].emission.texture.unwrap().second_uvs);
    assert!(!diffuse_texture(&scene).second_uvs);
    assert!(scene.unmodelled.is_empty());
    json["materials"][0]["pbrMetallicRoughness"]["metallicRoughnessTexture"] =
        json!({"index": 0, "texCoord": 2});
    let scene = load_pair(&json, &bin).unwrap();
    assert!(scene.materials[0].emission.texture.is_none());
    assert!(scene.unmodelled[0].feature.starts_with("emissiveTexture"));
}

#[test]
fn what_is_not_modelled_is_named_with_its_element() {
    let scene = load_changed(|json, _| {
        json["extensionsUsed"] =
            json!(["KHR_lights_punctual", "KHR_materials_sheen", "ACME_fog", "ACME_unused"]);
        json["extensions"] = json!({"KHR_lights_punctual": {"lights": [{"type": "point", "range": 3}]}});
        json["nodes"] = json!([{"mesh": 0, "skin": 0, "name": "Man", "extensions": {"ACME_fog": {}}},
            {"name": "Lamp", "extensions": {"KHR_lights_punctual": {"light": 0}}}]);
        json["scenes"][0]["nodes"] = json!([0, 1]);
        json["skins"] = json!([{"joints": [0]}]);
        json["animations"] = json!([{"name": "Walk", "channels": [], "samplers": []}]);
        json["materials"][0]["extensions"] = json!({"KHR_materials_sheen": {"sheenColorFactor": [1, 0, 0]}});
        let primitive = &mut json["meshes"][0]["primitives"][0];
        primitive["attributes"]["COLOR_0"] = 1.into();
        primitive["targets"] = json!([{"POSITION": 0}]);
    })
    .unwrap();
    let named: Vec<_> = scene.unmodelled.iter().map(|u| format!("{} @ {}", u.feature, u.element)).collect();
    assert_eq!(
        named,
        [
            "animation @ animations[0] \"Walk\"",
            "ACME_fog @ nodes[0] \"Man\"",
            "KHR_materials_sheen @ materials[0] \"Paint\"",
            "range of a light @ extensions.KHR_lights_punctual.lights[0]",
        ]
    );
}
