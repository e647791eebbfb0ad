//! Reads back what the generator writes, as a loader would, and checks it. The lengths are metres.

use serde_json::Value;
use std::collections::HashMap;

fn document(files: &[crate::gltf_writer::File]) -> (Value, Vec<u8>) {
    if files.len() == 1 {
        let b = &files[0].bytes;
        let word = |at: usize| u32::from_le_bytes(b[at..at + 4].try_into().unwrap()) as usize;
        assert_eq!((&b[..4], word(4), word(8)), (&b"glTF"[..], 2, b.len()));
        let json = word(12);
        assert_eq!((&b[16..20], json % 4), (&b"JSON"[..], 0));
        let bin = 20 + json + 8;
        assert_eq!((word(20 + json), &b[bin - 4..bin]), (b.len() - bin, &b"BIN\0"[..]));
        (serde_json::from_slice(&b[20..20 + json]).unwrap(), b[bin..].to_vec())
    } else {
        (serde_json::from_slice(&files[0].bytes).unwrap(), files[1].bytes.clone())
    }
}

fn index(v: &Value) -> usize {
    v.as_u64().expect("an index") as usize
}

/// The bytes of an accessor, its item size checked against the format's alignment rules.
fn bytes<'a>(doc: &Value, bin: &'a [u8], accessor: usize, item: usize, align: usize) -> &'a [u8] {
    let a = &doc["accessors"][accessor];
    let view = &doc["bufferViews"][index(&a["bufferView"])];
    let (start, length) = (index(&view["byteOffset"]), index(&view["byteLength"]));
    assert_eq!(start % align, 0);
    assert_eq!(length, index(&a["count"]) * item);
    &bin[start..start + length]
}

fn vectors(doc: &Value, bin: &[u8], accessor: usize) -> Vec<[f32; 3]> {
    let raw = bytes(doc, bin, accessor, 12, 4);
    let floats: Vec<f32> = raw.chunks(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
    floats.chunks(3).map(|c| [c[0], c[1], c[2]]).collect()
}

fn indices(doc: &Value, bin: &[u8], accessor: usize) -> Vec<usize> {
    let short = doc["accessors"][accessor]["componentType"] == 5123;
    let size = if short { 2 } else { 4 };
    bytes(doc, bin, accessor, size, 4)
        .chunks(size)
        .map(|b| b.iter().rev().fold(0, |n, byte| n << 8 | usize::from(*byte)))
        .collect()
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[test]
fn files_are_valid() {
    for scene in crate::all() {
        let name = scene.name;
        if name == "obj-still-life" {
            continue;
        }
        let (doc, bin) = document(&scene.files);
        assert_eq!(index(&doc["buffers"][0]["byteLength"]), bin.len(), "{name}");
        assert_eq!(doc["asset"]["version"], "2.0");
        let mut stored = 0;
        for mesh in doc["meshes"].as_array().unwrap() {
            let label = format!("{name}: {}", mesh["name"]);
            for primitive in mesh["primitives"].as_array().unwrap() {
                let at = index(&primitive["attributes"]["POSITION"]);
                let positions = vectors(&doc, &bin, at);
                let normals = vectors(&doc, &bin, index(&primitive["attributes"]["NORMAL"]));
                let list = indices(&doc, &bin, index(&primitive["indices"]));
                assert_eq!(positions.len(), normals.len(), "{label}");
                assert!(list.iter().all(|i| *i < positions.len()), "{label}");
                assert!(index(&primitive["material"]) < doc["materials"].as_array().unwrap().len());
                let mut used = vec![false; positions.len()];
                list.iter().for_each(|i| used[*i] = true);
                assert!(used.iter().all(|u| *u), "{label}: unused vertices");
                for axis in 0..3 {
                    let all = || positions.iter().map(|p| p[axis]);
                    let (lo, hi) = (all().fold(f32::MAX, f32::min), all().fold(f32::MIN, f32::max));
                    assert_eq!(doc["accessors"][at]["min"][axis], f64::from(lo), "{label}");
                    assert_eq!(doc["accessors"][at]["max"][axis], f64::from(hi), "{label}");
                }
                for n in &normals {
                    let n = n.map(f64::from);
                    assert!((dot(n, n).sqrt() - 1.0).abs() < 1e-6, "{label}: {n:?}");
                }
                let mut against = 0;
                for t in list.chunks(3) {
                    let [a, b, c] = [t[0], t[1], t[2]].map(|i| positions[i].map(f64::from));
                    assert!(a.iter().all(|x| x.is_finite()), "{label}");
                    let edge = |p: [f64; 3], q: [f64; 3]| [q[0] - p[0], q[1] - p[1], q[2] - p[2]];
                    let g = cross(edge(a, b), edge(a, c));
                    assert!(dot(g, g) > 0.0, "{label}: triangle without area {a:?} {b:?} {c:?}");
                    against += t.iter().filter(|i| dot(g, normals[**i].map(f64::from)) <= 0.0).count();
                }
                assert_eq!(against, 0, "{label}: normals against the winding");
                stored += list.len() / 3;
            }
        }
        assert_eq!(stored, scene.stored, "{name}");
        let mut materials_used = vec![false; doc["materials"].as_array().unwrap().len()];
        for primitive in
            doc["meshes"].as_array().unwrap().iter().flat_map(|m| m["primitives"].as_array().unwrap())
        {
            materials_used[index(&primitive["material"])] = true;
        }
        for (material, used) in doc["materials"].as_array().unwrap().iter().zip(materials_used) {
            assert!(used, "{name}: material {} is not used", material["name"]);
            let light = material.get("emissiveFactor").is_some();
            assert_eq!(material.get("doubleSided").is_none(), light, "{name}: {}", material["name"]);
        }
        let cameras = doc["nodes"].as_array().unwrap().iter().filter(|n| n["name"] == "Camera").count();
        assert_eq!(cameras, 1, "{name}");
    }
}

#[test]
fn sizes_stay_small() {
    let mut total = 0;
    for scene in crate::all() {
        for file in &scene.files {
            total += file.bytes.len();
            if file.path == "demo/demo.glb" {
                assert!(file.bytes.len() < 700_000, "{}", file.bytes.len());
            }
            assert!(file.bytes.len() < 1_500_000, "{}", file.path);
        }
    }
    assert!(total < 4_000_000, "{total}");
}

#[test]
fn the_pairs_differ_only_where_they_should() {
    let files: HashMap<String, Vec<u8>> =
        crate::all().into_iter().flat_map(|s| s.files).map(|f| (f.path, f.bytes)).collect();
    let text = |path: &str| String::from_utf8(files[path].clone()).unwrap();
    let differing = |a: &str, b: &str| {
        let (a, b) = (text(a), text(b));
        a.lines().zip(b.lines()).filter(|(x, y)| x != y).count()
            + a.lines().count().abs_diff(b.lines().count())
    };
    // Its own name, its buffer's name, and the difference.
    assert_eq!(
        differing("cornell-box-red/cornell-box-red.gltf", "cornell-box-blue/cornell-box-blue.gltf"),
        3
    );
    assert_eq!(
        differing("mirror-gap-wide/mirror-gap-wide.gltf", "mirror-gap-narrow/mirror-gap-narrow.gltf"),
        3
    );
    for (a, b) in [
        ("cornell-box-red", "cornell-box-blue"),
        ("mirror-gap-wide", "mirror-gap-narrow"),
        ("white-room-substrate", "white-room-matte"),
    ] {
        assert!(files[&format!("{a}/{a}.bin")] == files[&format!("{b}/{b}.bin")], "{a} and {b}");
    }
}

/// Solids are watertight and wound outwards once their parts are put together.
#[test]
fn solids_of_the_scenes_are_closed() {
    let creature = crate::creature::creature(1.0);
    let (wood, rest) = crate::furniture::chair();
    let (shade, cord) = crate::furniture::pendant(0.2, 0.15, 1.0);
    let (pot, stems, _) = crate::furniture::plant(1.2, 9, 5);
    let (flesh, stalk) = crate::furniture::fruit(0.04, 18);
    let (twigs, buds) = crate::furniture::twigs(5, 0.6, 1);
    for (name, mesh) in [
        ("skin", creature.skin),
        ("spines", creature.spines),
        ("eyes", creature.eyes),
        ("chair", wood),
        ("shade", shade),
        ("cord", cord),
        ("pot", pot),
        ("stems", stems),
        ("fruit", flesh),
        ("stalk", stalk),
        ("twigs", twigs),
        ("buds", buds),
        ("vase", crate::furniture::vase(0.3, 0.1, 24)),
        ("bowl", crate::furniture::bowl(0.1, 0.08, 24)),
        ("legs", crate::furniture::table_legs(1.5, 0.8, 0.7)),
        ("frame", crate::furniture::frame(1.0, 0.8, 0.05, 0.03)),
    ] {
        assert!(!mesh.open, "{name}");
        assert!(mesh.volume() > 0.0, "{name}");
        assert!(crate::shapes::watertight(&mesh), "{name} leaks");
    }
    assert!(rest.open);
}

#[test]
fn the_obj_counts_from_one_and_stays_in_range() {
    let output = crate::still_life::output();
    let text = String::from_utf8(output.files[0].bytes.clone()).unwrap();
    let materials = String::from_utf8(output.files[1].bytes.clone()).unwrap();
    let mut seen = [0_i64; 3];
    let mut triangles = 0;
    for line in text.lines() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => seen[0] += 1,
            Some("vt") => seen[1] += 1,
            Some("vn") => seen[2] += 1,
            Some("usemtl") => {
                let name = words.next().unwrap();
                assert!(materials.lines().any(|l| l == format!("newmtl {name}")), "{name}");
            }
            Some("f") => {
                let corners: Vec<&str> = words.collect();
                triangles += corners.len() - 2;
                for corner in corners {
                    for (slot, number) in corner.split('/').enumerate().filter(|(_, n)| !n.is_empty()) {
                        let n: i64 = number.parse().unwrap();
                        assert!((1..=seen[slot]).contains(&n) || (-seen[slot]..0).contains(&n), "{line}");
                    }
                }
            }
            _ => {}
        }
    }
    assert_eq!(triangles, output.triangles);
}
