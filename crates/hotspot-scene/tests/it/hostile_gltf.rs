//! Malformed glTF: each case is refused with file and element, or mended and counted.

use hotspot_scene::{LoadError, LoadOptions, SceneChoice, load_glb_bytes};
use serde_json::{Value, json};

use crate::support::*;

/// A change to [`square`], and what the message must hold.
type Case = (&'static str, fn(&mut Value), &'static [&'static str]);

const REFUSED: &[Case] = &[
    (
        "count 2^62",
        |j| j["accessors"][0]["count"] = (1u64 << 62).into(),
        &["accessors[0].count", "memory limit"],
    ),
    ("count 2^64 - 1", |j| j["accessors"][3]["count"] = u64::MAX.into(), &["accessors[3].count"]),
    ("count beyond the view", |j| j["accessors"][0]["count"] = 5.into(), &["accessors[0]", "do not fit"]),
    ("negative count", |j| j["accessors"][0]["count"] = (-1).into(), &["accessors[0].count", "-1"]),
    ("fractional count", |j| j["accessors"][0]["count"] = 1.5.into(), &["accessors[0].count"]),
    ("count as text", |j| j["accessors"][0]["count"] = "4".into(), &["accessors[0].count"]),
    ("wrong type", |j| j["accessors"][0]["type"] = "VEC2".into(), &["accessors[0].type", "VEC3"]),
    ("unknown type", |j| j["accessors"][0]["type"] = "VEC9".into(), &["accessors[0].type"]),
    (
        "positions of integers",
        |j| j["accessors"][0]["componentType"] = 5123.into(),
        &["accessors[0].componentType"],
    ),
    (
        "unknown component",
        |j| j["accessors"][0]["componentType"] = 5124.into(),
        &["accessors[0].componentType"],
    ),
    (
        "float indices",
        |j| j["accessors"][3]["componentType"] = 5126.into(),
        &["accessors[3].componentType", "unsigned"],
    ),
    ("signed indices", |j| j["accessors"][3]["componentType"] = 5122.into(), &["accessors[3].componentType"]),
    (
        "stride below the item",
        |j| j["bufferViews"][0]["byteStride"] = 8.into(),
        &["accessors[0].bufferView", "stride"],
    ),
    ("stride 0", |j| j["bufferViews"][0]["byteStride"] = 0.into(), &["bufferViews[0].byteStride"]),
    ("stride 253", |j| j["bufferViews"][0]["byteStride"] = 253.into(), &["bufferViews[0].byteStride"]),
    (
        "stride past the end",
        |j| j["bufferViews"][0]["byteStride"] = 16.into(),
        &["accessors[0]", "do not fit"],
    ),
    ("offset past the end", |j| j["accessors"][0]["byteOffset"] = 4.into(), &["accessors[0]", "do not fit"]),
    (
        "offset 2^64 - 1",
        |j| j["accessors"][0]["byteOffset"] = u64::MAX.into(),
        &["accessors[0]", "do not fit"],
    ),
    (
        "view past the end",
        |j| j["bufferViews"][3]["byteOffset"] = 132.into(),
        &["bufferViews[3]", "beyond the end"],
    ),
    ("view length 2^63", |j| j["bufferViews"][3]["byteLength"] = (1u64 << 63).into(), &["bufferViews[3]"]),
    ("view overflows", |j| j["bufferViews"][3]["byteOffset"] = u64::MAX.into(), &["bufferViews[3]"]),
    (
        "buffer longer than its data",
        |j| j["buffers"][0]["byteLength"] = 4096.into(),
        &["buffers[0].byteLength"],
    ),
    ("buffer without length", |j| j["buffers"][0] = json!({}), &["buffers[0].byteLength", "missing"]),
    ("no such view", |j| j["accessors"][0]["bufferView"] = 99.into(), &["accessors[0].bufferView", "99"]),
    ("no view", |j| j["accessors"][0]["bufferView"] = Value::Null, &["accessors[0].bufferView", "missing"]),
    ("no such buffer", |j| j["bufferViews"][0]["buffer"] = 1.into(), &["bufferViews[0].buffer"]),
    (
        "no such accessor",
        |j| j["meshes"][0]["primitives"][0]["indices"] = 4.into(),
        &["primitives[0].indices"],
    ),
    (
        "no such material",
        |j| j["meshes"][0]["primitives"][0]["material"] = 1.into(),
        &["primitives[0].material"],
    ),
    ("no such mesh", |j| j["nodes"][0]["mesh"] = 1.into(), &["nodes[0].mesh"]),
    ("no such child", |j| j["nodes"][0]["children"] = json!([7]), &["nodes[0].children[0]"]),
    ("no such root", |j| j["scenes"][0]["nodes"] = json!([3]), &["scenes[0].nodes[0]"]),
    ("no such scene", |j| j["scene"] = 1.into(), &["scene", "1 scenes"]),
    ("unknown mode", |j| j["meshes"][0]["primitives"][0]["mode"] = 7.into(), &["primitives[0].mode"]),
    ("attributes as array", |j| j["meshes"][0]["primitives"][0]["attributes"] = json!([]), &["attributes"]),
    ("fewer normals", |j| j["accessors"][1]["count"] = 3.into(), &["attributes.NORMAL", "3 for 4"]),
    ("node as number", |j| j["nodes"][0] = 5.into(), &["nodes[0]", "not an object"]),
    ("nodes as object", |j| j["nodes"] = json!({}), &["nodes", "not an array"]),
    ("matrix of 15", |j| j["nodes"][0]["matrix"] = vec![1.0; 15].into(), &["nodes[0].matrix", "15"]),
    (
        "overflowing transform",
        |j| {
            j["nodes"] =
                json!([{"scale": [1e300, 1, 1], "children": [1]}, {"mesh": 0, "scale": [1e300, 1, 1]}]);
        },
        &["nodes[1]", "overflows"],
    ),
    (
        "a node as its own child",
        |j| j["nodes"][0]["children"] = json!([0]),
        &["nodes[0].children", "second time"],
    ),
    (
        "a cycle of two",
        |j| {
            j["nodes"] = json!([{"children": [1]}, {"children": [0]}]);
        },
        &["nodes[1].children", "nodes[0]"],
    ),
    (
        "a cycle and no scenes",
        |j| {
            j["nodes"] = json!([{"children": [1]}, {"children": [0]}]);
            j["scenes"] = Value::Null;
            j["scene"] = Value::Null;
        },
        &["nodes", "cycle"],
    ),
    (
        "2^40 shared children",
        |j| {
            let twice = |i: usize| json!({"children": [i + 1, i + 1]});
            j["nodes"] = (0..40).map(twice).chain([json!({"mesh": 0})]).collect();
        },
        &["nodes[0].children", "second time"],
    ),
    ("a root named twice", |j| j["scenes"][0]["nodes"] = json!([0, 0]), &["scenes[0].nodes"]),
    ("no asset", |j| j["asset"] = Value::Null, &["asset"]),
    ("glTF 1.0", |j| j["asset"]["version"] = "1.0".into(), &["asset", "1.0"]),
    ("required unknown", |j| j["extensionsRequired"] = json!(["ACME_fog"]), &["ACME_fog", "optional"]),
    (
        "ior below 0",
        |j| j["materials"][0]["extensions"]["KHR_materials_ior"]["ior"] = (-1).into(),
        &["materials[0].extensions.KHR_materials_ior.ior"],
    ),
    (
        "base colour beyond f32",
        |j| {
            j["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = json!([1e300, 0, 0, 1]);
        },
        &["materials[0].pbrMetallicRoughness.baseColorFactor"],
    ),
    (
        "emission beyond f32",
        |j| {
            j["materials"][0]["emissiveFactor"] = json!([1e30, 0, 0]);
            j["materials"][0]["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"] =
                1e30.into();
        },
        &["materials[0].emissiveFactor"],
    ),
    ("alpha mode", |j| j["materials"][0]["alphaMode"] = "GLOW".into(), &["materials[0].alphaMode"]),
    (
        "negative environment",
        |j| j["scenes"][0]["extras"]["environment"]["constant"] = json!([1, -1, 1]),
        &["scenes[0].extras.environment.constant"],
    ),
    (
        "environment of two",
        |j| j["scenes"][0]["extras"]["environment"]["constant"] = json!([1, 1]),
        &["scenes[0].extras.environment.constant"],
    ),
    (
        "yfov of π",
        |j| {
            j["nodes"][0]["camera"] = 0.into();
            j["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 3.15}}]);
        },
        &["cameras[0].perspective.yfov"],
    ),
    (
        "xmag of 0",
        |j| {
            j["nodes"][0]["camera"] = 0.into();
            j["cameras"] = json!([{"type": "orthographic", "orthographic": {"xmag": 0, "ymag": 1}}]);
        },
        &["cameras[0].orthographic.xmag"],
    ),
    (
        "sparse place out of range",
        |j| {
            j["accessors"][0]["sparse"] = json!({"count": 6, "indices": {"bufferView": 3, "componentType": 5123},
            "values": {"bufferView": 0}});
            j["accessors"][0]["count"] = 3.into();
        },
        &["accessors[0].sparse.indices", "index 3"],
    ),
    (
        "sparse without values",
        |j| {
            j["accessors"][0]["sparse"] =
                json!({"count": 1, "indices": {"bufferView": 3, "componentType": 5123}});
        },
        &["accessors[0].sparse.values"],
    ),
];

/// Beyond 32 bits, where the schema's types would cut the number off.
const CUT_OFF: &[Case] = &[
    ("mesh 2^32", |j| j["nodes"][0]["mesh"] = (1u64 << 32).into(), &["nodes[0].mesh", "4294967296"]),
    ("child 2^32 + 1", |j| j["nodes"][0]["children"] = json!([(1u64 << 32) + 1]), &["nodes[0].children[0]"]),
    (
        "position 2^32",
        |j| j["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = (1u64 << 32).into(),
        &["primitives[0].attributes.POSITION"],
    ),
    (
        "component 2^32 + 5126",
        |j| j["accessors"][0]["componentType"] = ((1u64 << 32) + 5126).into(),
        &["accessors[0].componentType"],
    ),
    (
        "mode 2^32 + 4",
        |j| j["meshes"][0]["primitives"][0]["mode"] = ((1u64 << 32) + 4).into(),
        &["primitives[0].mode"],
    ),
    (
        "position out of range",
        |j| j["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = 4.into(),
        &["primitives[0].attributes.POSITION", "4 accessors"],
    ),
    (
        "normal out of range",
        |j| j["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = 4.into(),
        &["primitives[0].attributes"],
    ),
    (
        "camera without its lens",
        |j| {
            j["nodes"][0]["camera"] = 0.into();
            j["cameras"] = json!([{"type": "perspective", "orthographic": {"xmag": 1, "ymag": 1}}]);
        },
        &["cameras[0].type"],
    ),
];

#[test]
fn indices_are_neither_cut_off_nor_followed_out_of_range() {
    for (case, change, parts) in CUT_OFF {
        assert_refused(load_changed(|json, _| change(json)), case, "test.glb", parts);
    }
}

#[test]
fn what_the_schema_is_strict_about_and_others_accept_loads() {
    let scene = load_changed(|json, _| {
        json["accessors"][0]["count"] = 4.0.into();
        json["accessors"][3]["componentType"] = 5123.0.into();
        json["accessors"][0]["min"] = json!(["x"]);
        json["accessors"][0]["extras"] = json!([1e300, {"a": null}]);
        json["nodes"][0]["mesh"] = 0.0.into();
        json["nodes"][0]["rotation"] = Value::Null;
        json["nodes"][0]["extras"] = 7.into();
        json["meshes"][0]["primitives"][0]["targets"] = Value::Null;
        json["meshes"][0]["primitives"][0]["attributes"]["_HEAT"] = 2.into();
        json["meshes"][0]["primitives"][0]["attributes"]["heat"] = 2.into();
        push(&mut json["meshes"], json!({}));
        push(&mut json["scenes"], json!({}));
        json["cameras"] =
            json!([{"type": "orthographic", "orthographic": {"xmag": 1, "ymag": 1, "zfar": 1e10}}]);
        json["nodes"][0]["camera"] = 0.into();
        json["animations"] = json!([7]);
    })
    .unwrap();
    check(&scene);
    assert_eq!((scene.instances.len(), scene.cameras.len(), scene.repairs.len()), (1, 1, 0));
}

#[test]
fn sparse_places_need_not_be_sorted() {
    let scene = load_changed(|json, bin| {
        let start = bin.len();
        bin.extend([3, 1, 2, 0]);
        bin.extend(floats(&[3.0, 9.0, 9.0, 1.0, 9.0, 9.0, 2.0, 9.0, 9.0]));
        push(&mut json["bufferViews"], json!({"buffer": 0, "byteOffset": start, "byteLength": 3}));
        push(&mut json["bufferViews"], json!({"buffer": 0, "byteOffset": start + 4, "byteLength": 36}));
        json["accessors"][0]["sparse"] = json!({"count": 3,
            "indices": {"bufferView": 4, "componentType": 5121}, "values": {"bufferView": 5}});
        json["buffers"][0]["byteLength"] = bin.len().into();
    })
    .unwrap();
    let x: Vec<f32> = scene.meshes[0].positions.iter().map(|p| p[0]).collect();
    assert_eq!(x, [0.0, 1.0, 2.0, 3.0]);
}

#[test]
fn malformed_files_are_refused_by_name() {
    for (case, change, parts) in REFUSED {
        let result = load_changed(|json, _| change(json));
        assert_refused(result, case, "test.glb", parts);
    }
}

#[test]
fn the_unchanged_file_loads() {
    let scene = load_changed(|_, _| {}).unwrap();
    check(&scene);
    assert_eq!((scene.repairs.len(), scene.unmodelled.len()), (0, 0));
    assert_eq!(scene.meshes[0].triangles, [[0, 1, 2], [0, 2, 3]]);
}

#[test]
fn an_index_out_of_range_names_its_accessor_and_place() {
    let result = load_changed(|_, bin| bin[132] = 4);
    assert_refused(result, "index 4 of 4", "test.glb", &["accessors[3]", "index 4 at position 2"]);
    assert!(matches!(load_changed(|_, bin| bin[132] = 4), Err(LoadError::Invalid { .. })));
}

#[test]
fn empty_accessors_drop_their_primitive() {
    for accessor in [0, 3] {
        let scene = load_changed(|json, _| {
            json["accessors"][accessor]["count"] = 0.into();
            if accessor == 0 {
                json["meshes"][0]["primitives"][0] = json!({"attributes": {"POSITION": 0}});
            }
        })
        .unwrap();
        assert_eq!((scene.instances.len(), scene.meshes.len()), (0, 0));
        assert_eq!(repaired(&scene, "primitive without triangles dropped"), 1);
    }
}

#[test]
fn broken_positions_cost_their_triangles_only() {
    for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        // Vertex 3, which the second triangle alone uses.
        let scene = load_changed(|_, bin| bin[40..44].copy_from_slice(&value.to_le_bytes())).unwrap();
        check(&scene);
        assert_eq!(scene.meshes[0].triangles.len(), 1);
        assert_eq!(repaired(&scene, "infinite or NaN corners"), 1);
        assert!(scene.repairs[0].element.contains("meshes[0].primitives[0]"));
    }
}

#[test]
fn misalignment_is_mended() {
    let scene = load_changed(|json, bin| {
        bin.insert(0, 0);
        for i in 0..4 {
            let offset = json["bufferViews"][i]["byteOffset"].as_u64().unwrap();
            json["bufferViews"][i]["byteOffset"] = (offset + 1).into();
        }
        json["buffers"][0]["byteLength"] = 141.into();
    })
    .unwrap();
    assert_eq!(scene.meshes[0].positions[2], [1.0, 1.0, 0.0]);
    assert_eq!(repaired(&scene, "misaligned"), 3);
}

#[test]
fn containers_that_lie_are_refused() {
    let whole = {
        let (json, bin) = square();
        glb(&json, &bin)
    };
    let with = |offset: usize, value: u32| {
        let mut bytes = whole.clone();
        bytes[offset..offset + 4].copy_from_slice(&value.to_le_bytes());
        bytes
    };
    let claims = [b"glTF".as_slice(), &2u32.to_le_bytes(), &u32::MAX.to_le_bytes()].concat();
    let cases: [(&str, Vec<u8>, &[&str]); 11] = [
        ("empty", Vec::new(), &["GLB header"]),
        ("magic alone", b"glTF".to_vec(), &["GLB header", "12"]),
        ("shorter than its header", whole[..11].to_vec(), &["GLB header", "11 bytes"]),
        ("12 bytes that claim 4 GiB", claims, &["GLB header", "4294967295"]),
        ("length below the header", with(8, 11), &["GLB header"]),
        ("header alone", [&whole[..8], &12u32.to_le_bytes()].concat(), &["GLB chunk 0", "no JSON"]),
        ("version 1", with(4, 1), &["GLB header", "version 1"]),
        ("JSON chunk of 4 GiB", with(12, u32::MAX), &["GLB chunk 0", "4294967295"]),
        ("first chunk of another type", with(16, 7), &["GLB chunk 0", "0x7"]),
        ("cut within a chunk header", with(8, 18), &["GLB chunk 0"]),
        ("not a GLB", b"glTg00000000".to_vec(), &["GLB header"]),
    ];
    for (case, bytes, parts) in cases {
        let result = load_glb_bytes("test.glb", &bytes, &LoadOptions::default());
        assert_refused(result, case, "test.glb", parts);
    }
    let mut longer = whole;
    longer.extend([0; 5]);
    let scene = load_glb_bytes("test.glb", &longer, &LoadOptions::default()).unwrap();
    assert_eq!(repaired(&scene, "after the end of the GLB"), 5);
}

#[test]
fn json_that_is_none_is_refused() {
    let deep = "[".repeat(100_000);
    let cases: [(&str, &[u8], &str); 5] = [
        ("text", b"hello", "line 1"),
        ("array", b"[]", "not an object"),
        ("not UTF-8", b"{\"asset\": \"\xFF\"}", "line 1"),
        ("too deep", deep.as_bytes(), "recursion"),
        ("a number beyond f64", b"{\"a\": 1e999}", "out of range"),
    ];
    for (case, bytes, part) in cases {
        assert_refused(load_files(&[("a.gltf", bytes)]), case, "a.gltf", &[part]);
    }
}

#[test]
fn limits_are_kept() {
    let (json, bin) = square();
    let whole = glb(&json, &bin);
    let cases: [(&str, LoadOptions, &str); 4] = [
        ("memory", LoadOptions { max_memory_bytes: 2000, ..Default::default() }, "memory limit"),
        ("nodes", LoadOptions { max_nodes: 0, ..Default::default() }, "1 nodes"),
        ("instances", LoadOptions { max_instances: 0, ..Default::default() }, "more than 0"),
        ("scene", LoadOptions { scene: Some(SceneChoice::Index(3)), ..Default::default() }, "scene #3"),
    ];
    for (case, options, part) in cases {
        assert_refused(load_glb_bytes("test.glb", &whole, &options), case, "test.glb", &[part]);
    }
    let (json, bin) = textured_square();
    let whole = glb(&json, &bin);
    let cases: [(&str, LoadOptions); 2] = [
        ("image side", LoadOptions { max_texture_dimension: 1, ..Default::default() }),
        ("image texels", LoadOptions { max_texture_pixels: 3, ..Default::default() }),
    ];
    for (case, options) in cases {
        let result = load_glb_bytes("test.glb", &whole, &options);
        assert!(matches!(result, Err(LoadError::Limit { .. })), "{case}");
        assert_refused(result, case, "test.glb", &["images[0]"]);
    }
}

#[test]
fn wrong_references_to_images_are_refused_by_name() {
    let cases: [Case; 4] = [
        ("view out of range", |j| j["images"][0]["bufferView"] = 5.into(), &["images[0].bufferView", "5"]),
        ("view past the end", |j| j["bufferViews"][4]["byteLength"] = 9999.into(), &["bufferViews[4]"]),
        ("no such texture", |j| j["textures"] = json!([]), &["baseColorTexture.index"]),
        (
            "wrap mode",
            |j| {
                j["samplers"] = json!([{"wrapS": 1}]);
                j["textures"][0]["sampler"] = 0.into();
            },
            &["samplers[0].wrapS"],
        ),
    ];
    for (case, change, parts) in cases {
        let (mut json, bin) = textured_square();
        change(&mut json);
        assert_refused(load_pair(&json, &bin), case, "test.glb", parts);
    }
}

#[test]
fn a_huge_image_is_refused_before_it_is_decoded() {
    // A valid header that claims 100000 x 100000 texels, then nothing.
    let mut picture = png(&[[0; 4]; 4]);
    picture[16..20].copy_from_slice(&100_000u32.to_be_bytes());
    picture[20..24].copy_from_slice(&100_000u32.to_be_bytes());
    // The header's checksum (CRC-32 of type and fields), bit by bit.
    let mut crc = u32::MAX;
    for byte in &picture[12..29] {
        crc ^= u32::from(*byte);
        for _ in 0..8 {
            crc = (crc >> 1) ^ (0xEDB8_8320 & 0u32.wrapping_sub(crc & 1));
        }
    }
    picture[29..33].copy_from_slice(&(!crc).to_be_bytes());
    let (mut json, mut bin) = textured_square();
    let start = bin.len();
    bin.extend(&picture);
    json["bufferViews"][4] = json!({"buffer": 0, "byteOffset": start, "byteLength": picture.len()});
    json["buffers"][0]["byteLength"] = bin.len().into();
    let result = load_pair(&json, &bin);
    assert!(matches!(result, Err(LoadError::Limit { .. })), "{result:?}");
    assert_refused(result, "huge", "test.glb", &["images[0]", "100000x100000", "16384"]);
}

#[test]
fn a_mesh_of_many_primitives_on_many_nodes_meets_the_instance_cap() {
    // Lines count too: they draw nothing, but each takes time.
    for mode in [1, 4] {
        let (mut json, bin) = square();
        let mut primitive = json["meshes"][0]["primitives"][0].clone();
        primitive["mode"] = mode.into();
        json["meshes"][0]["primitives"] = vec![primitive; 100].into();
        json["nodes"] = vec![json!({"mesh": 0}); 100].into();
        json["scenes"][0]["nodes"] = (0..100).collect();
        let options = LoadOptions { max_instances: 9_999, ..Default::default() };
        let result = load_glb_bytes("test.glb", &glb(&json, &bin), &options);
        assert_refused(result, "10000 primitives", "test.glb", &["9999"]);
    }
}

#[test]
fn a_deep_chain_of_nodes_loads() {
    let scene = load_changed(|json, _| {
        let count = 200_000;
        let node = |i: usize| {
            if i + 1 == count {
                json!({"mesh": 0})
            } else {
                json!({"children": [i + 1], "translation": [1, 0, 0]})
            }
        };
        json["nodes"] = (0..count).map(node).collect();
    })
    .unwrap();
    assert_eq!(scene.instances[0].to_world[0][3], 199_999.0);
}
