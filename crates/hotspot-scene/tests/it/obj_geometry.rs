//! OBJ geometry: objects and groups, smoothing groups, vertex colours, polygons with holes.

use hotspot_scene::{Bsdf, LoadError, LoadOptions, Mesh, Scene, load};

use crate::support::*;

fn obj(text: &str) -> Scene {
    let scene = load_files(&[("a.obj", text.as_bytes())]).unwrap();
    check(&scene);
    scene
}

fn objects(text: &str) -> Vec<String> {
    let scene = obj(&format!("v 0 0 0\nv 1 0 0\nv 0 1 0\n{text}"));
    scene.objects.into_iter().map(|object| object.name).collect()
}

#[test]
fn o_names_objects_and_g_parts_them() {
    assert_eq!(objects("f 1 2 3\n"), ["a"]);
    assert_eq!(objects("g A\nf 1 2 3\ng B\nf 1 2 3\ng A\nf 1 2 3\n"), ["A", "B"]);
    assert_eq!(objects("o X\nf 1 2 3\no Y\nf 1 2 3\n"), ["X", "Y"]);
    // Within objects; wheels of different cars are different objects.
    assert_eq!(
        objects("o Car\ng Wheel\nf 1 2 3\no Van\ng Wheel\nf 1 2 3\nf 1 2 3\n"),
        ["Car/Wheel", "Van/Wheel"]
    );
    // 3ds Max states both, with one name; a new object ends the group before it.
    assert_eq!(objects("o Box\ng Box\nf 1 2 3\no Ball\nf 1 2 3\n"), ["Box", "Ball"]);
    assert_eq!(objects("g\nf 1 2 3\n"), ["default"]);
    // Materials make parts, not objects.
    let scene = obj("v 0 0 0\nv 1 0 0\nv 0 1 0\no A\nusemtl x\nf 1 2 3\nusemtl y\nf 1 2 3\n");
    assert_eq!((scene.objects.len(), scene.instances.len(), scene.materials.len()), (1, 2, 2));
}

/// A unit cube's corners and faces, counter-clockwise seen from outside.
const CUBE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n";
const SIDES: [&str; 6] =
    ["f 4 3 2 1\n", "f 5 6 7 8\n", "f 1 2 6 5\n", "f 3 4 8 7\n", "f 2 3 7 6\n", "f 4 1 5 8\n"];

/// The normal of every vertex at a position.
fn normals_at(mesh: &Mesh, position: [f32; 3]) -> Vec<[f32; 3]> {
    let normals = mesh.normals.as_ref().unwrap();
    let at = mesh.positions.iter().zip(normals).filter(|(p, _)| **p == position);
    at.map(|(_, normal)| *normal).collect()
}

fn assert_near(a: [f32; 3], b: [f32; 3]) {
    assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6), "{a:?} {b:?}");
}

#[test]
fn one_smoothing_group_rounds_a_cube_evenly() {
    let scene = obj(&format!("{CUBE}s 1\n{}", SIDES.concat()));
    let mesh = &scene.meshes[0];
    assert_eq!((mesh.positions.len(), mesh.triangles.len()), (8, 12));
    // By angle: straight out at every corner, though diagonals end at some corners and not at others.
    for (position, normal) in mesh.positions.iter().zip(mesh.normals.as_ref().unwrap()) {
        let wanted = position.map(|c| (2.0 * c - 1.0) / 3f32.sqrt());
        assert_near(*normal, wanted);
    }
    assert!(scene.unmodelled.is_empty());
    // However the sides are split.
    let split = obj(&format!(
        "{CUBE}s 1\n{}f 5 6 7\nf 5 7 8\nf 1 2 5\nf 2 6 5\nf 3 4 8\nf 3 8 7\nf 2 3 7 6\nf 4 1 5 8\n",
        SIDES[0]
    ));
    for (position, normal) in split.meshes[0].positions.iter().zip(split.meshes[0].normals.as_ref().unwrap())
    {
        assert_near(*normal, normals_at(mesh, *position)[0]);
    }
}

#[test]
fn edges_between_smoothing_groups_are_hard() {
    // Bottom and top and two sides in one group each; one side is off, one has none at all.
    let text = format!(
        "{}{CUBE}s 1\n{}s 2\n{}{}s off\n{}s 0\n{}",
        // Before any `s`.
        "",
        SIDES[2],
        SIDES[4],
        SIDES[3],
        SIDES[5],
        SIDES[0],
    );
    let scene = obj(&text);
    let smooth: Vec<&Mesh> = scene.meshes.iter().filter(|mesh| mesh.normals.is_some()).collect();
    assert_eq!((scene.meshes.len(), smooth.len(), scene.objects.len()), (2, 1, 1));
    // (1, 0, 1) belongs to the side of group 1 (y = 0) and to one of group 2 (x = 1).
    let mut normals = normals_at(smooth[0], [1.0, 0.0, 1.0]);
    normals.sort_by(|a, b| a[0].total_cmp(&b[0]));
    assert_eq!(normals.len(), 2);
    assert_near(normals[0], [0.0, -1.0, 0.0]);
    assert_near(normals[1], [1.0, 0.0, 0.0]);
    // (1, 1, 1) lies between the two of group 2.
    let normals = normals_at(smooth[0], [1.0, 1.0, 1.0]);
    assert_eq!(normals.len(), 1);
    assert_near(normals[0], [0.5f32.sqrt(), 0.5f32.sqrt(), 0.0]);
}

#[test]
fn smoothing_reaches_across_materials_and_objects_but_not_over_stated_normals() {
    let text = format!(
        "{CUBE}vn 0 0 1\ns 1\no A\nusemtl x\n{}usemtl y\n{}o B\nf 5//1 6//1 7//1 8//1\n",
        SIDES[2], SIDES[4]
    );
    let scene = obj(&text);
    let half = 0.5f32.sqrt();
    assert_eq!(scene.meshes.len(), 3);
    for mesh in &scene.meshes[..2] {
        assert_near(normals_at(mesh, [1.0, 0.0, 1.0])[0], [half, -half, 0.0]);
    }
    assert!(scene.meshes[2].normals.as_ref().unwrap().iter().all(|n| *n == [0.0, 0.0, 1.0]));
}

#[test]
fn smoothing_of_folded_and_broken_faces_gives_unit_normals() {
    // A face and its back, a sliver without area, a corner that is not a number: `check` looks at the normals.
    let scene =
        obj("v 0 0 0\nv 1 0 0\nv 0 1 0\nv nan 0 0\nv 2 0 0\ns 7\nf 1 2 3\nf 3 2 1\nf 1 2 5\nf 1 2 4\n");
    assert_eq!(scene.meshes[0].triangles.len(), 2);
    let huge = obj("v 0 0 0\nv 3e38 0 0\nv 0 3e38 0\nv 0 1e-40 0\nv 1e-40 0 0\ns 1\nf 1 2 3\nf 1 5 4\n");
    assert_eq!(huge.meshes[0].triangles.len(), 2);
    assert_near(huge.meshes[0].normals.as_ref().unwrap()[0], [0.0, 0.0, 1.0]);
}

#[test]
fn vertex_colours_are_decoded_and_cost_nothing_without() {
    let scene = obj("v 0 0 0 1 0 0.5\nv 1 0 0 0.735357 0 0\nv 0 1 0\nv 1 1 0 1 1 1 1\nf 1 2 3\nf 3 2 4\n");
    let colors = scene.meshes[0].colors.as_ref().unwrap();
    // sRGB 0.5 is 0.2140, 0.735357 is a half.
    assert!((colors[0][2] - 0.214_041_14).abs() < 1e-6 && (colors[1][0] - 0.5).abs() < 1e-5, "{colors:?}");
    assert_eq!((colors[0][0], colors[0][3]), (1.0, 1.0));
    assert_eq!(colors[2..], [[1.0; 4]; 2]);
    // Without a material, the colours are all there is.
    let Bsdf::Matte { reflectance } = scene.materials[0].bsdf else { panic!() };
    assert_eq!(reflectance.factor, [1.0; 3]);
    // All white, or on vertices of another object.
    let text = "v 0 0 0 1 1 1\nv 1 0 0 1 1 1\nv 0 1 0\nv 1 1 0 0 0 0\no A\nf 1 2 3\no B\nf 1 2 4\n";
    let is_some: Vec<bool> = obj(text).meshes.iter().map(|mesh| mesh.colors.is_some()).collect();
    assert_eq!(is_some, [false, true]);
    // A fourth number is a weight.
    let weighted = obj("v 0 0 0 1\nv 1 0 0 2\nv 0 1 0 1 0\nf 1 2 3\n");
    assert!(weighted.meshes[0].colors.is_none());
    assert_eq!(weighted.unmodelled[0].feature, "weights of vertices");
    assert_eq!(weighted.meshes[0].positions[1], [1.0, 0.0, 0.0]);
}

#[test]
fn vertex_colours_out_of_range_are_mended() {
    let bytes = obj("v 0 0 0 255 0 51\nv 1 0 0 1 1 1\nv 0 1 0 0 0 0\nf 1 2 3\n");
    let colors = bytes.meshes[0].colors.as_ref().unwrap();
    // sRGB 51 / 255 = 0.2.
    assert!(colors[0][0] == 1.0 && (colors[0][2] - 0.033_104_77).abs() < 1e-6, "{colors:?}");
    assert_eq!(repaired(&bytes, "0..255"), 2);
    let clamped = obj("v 0 0 0 1.01 -1 nan\nv 1 0 0 0 0 0\nv 0 1 0\nf 1 2 3\n");
    assert_eq!(clamped.meshes[0].colors.as_ref().unwrap()[0], [1.0, 0.0, 1.0, 1.0]);
    assert_eq!(repaired(&clamped, "clamped to 0..1"), 1);
    // They stay with their vertices when others go.
    let scene = obj("v nan 0 0 0 0 0\nv 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 1\nf 1 2 3\nf 2 3 4\n");
    let wanted = [[1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0]];
    assert_eq!(scene.meshes[0].colors.as_ref().unwrap()[..], wanted);
}

#[test]
fn a_hole_reached_by_a_bridge_stays_open() {
    // A square of side 4 with a hole of side 2, cut open along a bridge: as one polygon, in three planes, both ways round.
    let outline = "1 2 3 4 1 5 8 7 6 5";
    let corners = [[0, 0], [4, 0], [4, 4], [0, 4], [1, 1], [3, 1], [3, 3], [1, 3]];
    for plane in 0..3 {
        for reversed in [false, true] {
            let mut text = String::new();
            for [x, y] in corners {
                let mut position = [x, y, 0];
                position.rotate_right(plane);
                text.push_str(&format!("v {} {} {}\n", position[0], position[1], position[2]));
            }
            let mut words: Vec<&str> = outline.split(' ').collect();
            if reversed {
                words.reverse();
            }
            let scene = obj(&format!("{text}f {}\n", words.join(" ")));
            assert_eq!(repaired(&scene, "concave"), 0);
            let mesh = &scene.meshes[0];
            let axis = (2 + plane) % 3;
            let mut area = 0.0;
            for triangle in &mesh.triangles {
                let [a, b, c] = triangle.map(|i| {
                    let mut p = mesh.positions[i as usize];
                    p.rotate_left((axis + 1) % 3);
                    p
                });
                let twice = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
                assert!(if reversed { twice < 0.0 } else { twice > 0.0 });
                area += twice.abs() / 2.0;
                let centre = [0, 1].map(|k| (a[k] + b[k] + c[k]) / 3.0);
                assert!(centre.iter().any(|c| (c - 2.0).abs() > 1.0 - 1e-3), "{centre:?} lies in the hole");
            }
            assert_eq!(area, 12.0, "{plane} {reversed}");
        }
    }
}

#[test]
fn what_is_not_drawn_is_named_once() {
    let scene = obj(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nvp 0 0\nvp 1 1\ncurv 0 1 1 2\ncurv 0 1 1 2\nsurf 0 1 0 1 1 2 3\nl 1 2\nl 2 3\n\
         p 1\np 2\nf 1 2 3\n",
    );
    let named: Vec<_> = scene.unmodelled.iter().map(|u| u.element.as_str()).collect();
    assert_eq!(named, ["vp", "curv", "surf", "l", "p"]);
}

#[test]
fn memory_is_announced_for_every_kind_of_statement() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.obj");
    let start = "v 0 0 0 1 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\ns 1\nf 1 2 3\n";
    let statements = [
        ("v 0 0 0\n", 2_000),
        ("v 0 0 0 1 1 1\n", 2_000),
        ("vt 0 0\n", 4_000),
        ("vn 0 0 1\n", 2_000),
        ("f 1 2 3\n", 2_000),
        ("f 1/1/1 2/1/1 3/1/1\n", 2_000),
        ("g a\nf 1 2 3\ng b\nf 1 2 3\n", 1_000),
    ];
    for (statement, times) in statements {
        let text = format!("{start}{}", statement.repeat(times));
        std::fs::write(&path, &text).unwrap();
        // Room for the file, but not for what it states.
        let options = LoadOptions { max_memory_bytes: text.len() as u64 + 30_000, ..Default::default() };
        assert!(matches!(load(&path, &options), Err(LoadError::Limit { .. })), "{statement:?}");
    }
    let names: String = (0..100).map(|i| format!("o {i}\nusemtl {i}\nmtllib {i}\nf 1 2 3\n")).collect();
    let text = format!("{start}{names}");
    std::fs::write(&path, &text).unwrap();
    let options = LoadOptions { max_memory_bytes: text.len() as u64 + 100_000, ..Default::default() };
    assert!(matches!(load(&path, &options), Err(LoadError::Limit { .. })));
    check(&load(&path, &LoadOptions::default()).unwrap());
    // A mesh of one triangle is small, but it is a mesh.
    let names: String = (0..1000).map(|i| format!("o {i}\nf 1 2 3\n")).collect();
    let text = format!("{}{names}", start.replace("s 1\n", ""));
    std::fs::write(&path, &text).unwrap();
    let options = LoadOptions { max_memory_bytes: text.len() as u64 + 1_300_000, ..Default::default() };
    assert!(matches!(load(&path, &options), Err(LoadError::Limit { .. })));
}
