//! OBJ and MTL.

use hotspot_scene::{Alpha, Bsdf, Channel, Color, Scene, Wrap};

use crate::support::*;

const CORNERS: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 1\n";

fn obj(text: &str) -> Scene {
    let text = format!("{CORNERS}{text}");
    let scene = load_files(&[("a.obj", text.as_bytes())]).unwrap();
    check(&scene);
    scene
}

/// A triangle with a material of the given statements.
fn with_mtl(statements: &str) -> Scene {
    let text = format!("mtllib m.mtl\n{CORNERS}usemtl m\nf 1/1 2/2 3/3\n");
    let mtl = format!("newmtl m\n{statements}\n");
    let picture = png(&[[1; 4], [2; 4], [3; 4], [255; 4]]);
    let scene =
        load_files(&[("a.obj", text.as_bytes()), ("m.mtl", mtl.as_bytes()), ("a b.png", &picture)]).unwrap();
    check(&scene);
    scene
}

fn refused(text: &str, parts: &[&str]) {
    let text = format!("{CORNERS}{text}");
    assert_refused(load_files(&[("a.obj", text.as_bytes())]), &text, "a.obj", parts);
}

#[test]
fn polygons_negative_indices_continuations_and_crlf() {
    let scene = obj("f 1 2 3 4\r\nf -4 -3 -2\r\nf 1 2 \\\r\n 3\r\n");
    assert_eq!(scene.meshes[0].triangles, [[0, 1, 2], [0, 2, 3], [0, 1, 2], [0, 1, 2]]);
    assert_eq!(scene.meshes[0].positions.concat(), SQUARE);
    assert!(scene.meshes[0].normals.is_none() && scene.meshes[0].uvs.is_none());
    assert_eq!((scene.objects[0].name.as_str(), scene.name.as_str()), ("a", "a"));
    assert_eq!(repaired(&scene, "no material"), 1);
    // A face may come before its vertices.
    let early = load_files(&[("a.obj", b"f 1 2 3\nv 0 0 0\nv 1 0 0\nv 0 1 0\n")]).unwrap();
    assert_eq!(early.meshes[0].triangles.len(), 1);
}

#[test]
fn objects_groups_and_materials_split_and_meet_again() {
    let scene = obj("o A\nusemtl x\nf 1 2 3\nusemtl y\nf 1 3 4\ng B C\nf 1 2 4\no A\nusemtl x\nf 2 3 4\n");
    let names: Vec<_> = scene.objects.iter().map(|o| o.name.as_str()).collect();
    assert_eq!(names, ["A", "A/B C"]);
    let shape: Vec<_> = scene
        .instances
        .iter()
        .map(|i| (i.object, i.material, scene.meshes[i.mesh as usize].triangles.len()))
        .collect();
    assert_eq!(shape, [(0, 0, 2), (0, 1, 1), (1, 1, 1)]);
    assert_eq!(repaired(&scene, "material not found"), 2);
}

#[test]
fn faces_with_and_without_normals_mix() {
    let scene = obj("f 1//1 2//1 3//1\nf 1 3 4\nf 1//1 3//1 4\n");
    let normals: Vec<_> = scene.meshes.iter().map(|m| (m.normals.is_some(), m.triangles.len())).collect();
    assert_eq!(normals, [(true, 1), (false, 2)]);
}

#[test]
fn faces_with_and_without_texture_coordinates_mix_in_one_group() {
    let faces =
        "f 1/1 2/2 3/3\nf 1 3 4\nf 1/1 3 4/4\nf 1/1/1 3/3/1 4//1\nf 1//1 3/3/1 4/4/1\nf 2/2 3/3 4/4\n";
    let text = format!("mtllib m.mtl\n{CORNERS}o A\nusemtl m\n{faces}");
    let picture = png(&[[1; 4]; 4]);
    let mtl = b"newmtl m\nmap_Kd t.png\n";
    let scene = load_files(&[("a.obj", text.as_bytes()), ("m.mtl", mtl), ("t.png", &picture)]).unwrap();
    check(&scene);
    // Flat and smooth faces are two meshes of one object.
    assert_eq!((scene.objects.len(), scene.materials.len()), (1, 1));
    let shape: Vec<_> = scene.meshes.iter().map(|m| (m.normals.is_some(), m.triangles.len())).collect();
    assert_eq!(shape, [(false, 4), (true, 2)]);
    assert_eq!(repaired(&scene, "corners without texture coordinates"), 4 + 2);
    let mut seen = 0;
    for mesh in &scene.meshes {
        for (position, uv) in mesh.positions.iter().zip(mesh.uvs.as_ref().unwrap()) {
            // Every corner states its own position, or nothing.
            assert!(*uv == [position[0], 1.0 - position[1]] || *uv == [0.0; 2], "{position:?} {uv:?}");
            seen += usize::from(*uv != [0.0; 2]);
        }
    }
    assert!(seen >= 4);
    // Without the texture, corners that differ in texture coordinates alone are one vertex.
    let plain = obj("f 1/1 2/2 3/3\nf 1/2 3/3 4/4\n");
    assert_eq!((plain.meshes[0].positions.len(), plain.meshes[0].uvs.is_none()), (4, true));
}

#[test]
fn faces_may_come_before_their_vertices_in_any_group() {
    let text = "o A\nf 1 2 3\no B\nf 2 3 4\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 1\n";
    let scene = load_files(&[("a.obj", text.as_bytes())]).unwrap();
    check(&scene);
    assert_eq!(scene.objects.len(), 2);
    assert_eq!(scene.meshes[1].positions[2], [1.0; 3]);
}

#[test]
fn numbers_after_a_position_do_no_harm() {
    let scene = obj("v 2 0 0 0\nv 2 1 0 0.5\nv 3 1 0 1 1\nv 3 0 0 1 1 1\nv 4 0 0 1 1 1 1 1 1\nf 5 8 7 6\n");
    assert_eq!(scene.meshes[0].positions.len(), 4);
    assert_eq!(scene.meshes[0].positions[3], [2.0, 1.0, 0.0]);
}

#[test]
fn concave_polygons_are_clipped() {
    // An L of area 3, once either way round; a fan around the last corner would leave it.
    let text = "v 0 0 5\nv 2 0 5\nv 2 1 5\nv 1 1 5\nv 1 2 5\nv 0 2 5\nf 6 7 8 9 10 5\nf 10 9 8 7 6 5\n";
    let scene = obj(text);
    let mesh = &scene.meshes[0];
    let area = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    };
    let areas: Vec<f32> = mesh.triangles.iter().map(area).collect();
    let sum = |sign: f32| areas.iter().filter(|a| **a * sign > 0.0).sum::<f32>() / 2.0;
    assert_eq!((areas.len(), sum(1.0), sum(-1.0)), (8, 3.0, -3.0));
    assert_eq!(repaired(&scene, "concave"), 0);
    // Crossing itself.
    let bow = obj("v 0 0 0\nv 2 2 0\nv 2 0 0\nv 0 1 0\nf 5 6 7 8\n");
    assert_eq!(repaired(&bow, "concave polygon split as a fan"), 1);
}

#[test]
fn broken_faces_are_refused_with_their_line() {
    refused("f 1 2 5\n", &["line 10", "index 5 is out of range", "4 positions"]);
    refused("f 1 2 0\n", &["line 10", "index 0"]);
    refused("f 1 2 -5\n", &["line 10", "index -5"]);
    refused("f 1/5 2/1 3/1\n", &["line 10", "index 5", "texture coordinates"]);
    refused("f 1//2 2//2 3//2\n", &["line 10", "index 2", "normals"]);
    refused("f 1 2 x\n", &["line 10", "\"x\""]);
    refused("f 1/1/1/1 2 3\n", &["line 10", "1/1/1/1"]);
    refused("f /1 /1 /1\n", &["line 10"]);
    refused("f 1 2 99999999999999999999\n", &["line 10"]);
    refused("f 1 2 9223372036854775807\n", &["line 10", "out of range"]);
    refused("f 1 2 4294967296\n", &["line 10", "out of range"]);
    refused("v 1 2\n", &["line 10", "3 numbers"]);
    refused("v 1 2 abc\n", &["line 10", "\"abc\" is not a number"]);
    refused(&format!("f {}\n", "1 ".repeat(600_000)), &["line 10", "longer than"]);
    assert_refused(load_files(&[("a.obj", b"hello\nworld\n")]), "text", "a.obj", &["line 1"]);
}

#[test]
fn repairs_are_counted() {
    let scene = obj("v nan 0 0\nv 1e999 0 0\nf 1 2 5\nf 1 2 6\nf 1 2 3\nf 1 2\nf 1 1 2\nhello\nhello\n");
    assert_eq!(scene.meshes[0].triangles.len(), 1);
    assert_eq!(repaired(&scene, "infinite or NaN corners"), 2);
    assert_eq!(repaired(&scene, "fewer than three"), 1);
    assert_eq!(repaired(&scene, "degenerate"), 1);
    assert_eq!(repaired(&scene, "unknown statements"), 2);
    assert_eq!(repaired(&obj("mtllib none.mtl\nf 1 2 3\n"), "missing material library"), 1);
    let named: Vec<_> =
        obj("l 1 2\np 1\ncurv 0 1 1 2\nv 0 0 0 1 1 1\n").unmodelled.into_iter().map(|u| u.feature).collect();
    assert_eq!(named, ["lines", "points", "free-form curves and surfaces"]);
}

#[test]
fn mtl_colours_become_matte_substrate_and_mirror() {
    let Bsdf::Matte { reflectance } = with_mtl("Kd 0.1 0.2 0.3\nKs 0 0 0").materials[0].bsdf.clone() else {
        panic!()
    };
    assert_eq!(reflectance, Color::constant([0.1, 0.2, 0.3]));
    let scene = with_mtl("Kd 0.5\nKs 0.25 0.25 0.25\nNs 30\nillum 2");
    let Bsdf::Substrate { diffuse, specular, roughness, .. } = scene.materials[0].bsdf.clone() else {
        panic!()
    };
    assert_eq!((diffuse.factor, specular.factor), ([0.5; 3], [0.25; 3]));
    // roughness^2 = alpha = sqrt(2 / 32)
    assert!((roughness.factor - 0.5).abs() < 1e-7, "{roughness:?}");
    for model in [3, 5] {
        let scene = with_mtl(&format!("Kd 0 0 0\nKs 0.9 0.9 0.9\nillum {model}"));
        let Bsdf::Mirror { reflectance } = scene.materials[0].bsdf.clone() else { panic!() };
        assert_eq!(reflectance.factor, [0.9; 3]);
    }
    assert_eq!(with_mtl("Ke 5 6 7").materials[0].emission.factor, [5.0, 6.0, 7.0]);
}

#[test]
fn mtl_opacity_is_blended() {
    let alpha = |text: &str| with_mtl(text).materials[0].alpha;
    assert!(matches!(alpha("d 0.25"), Alpha::Blend { alpha } if alpha.factor == 0.25));
    assert!(matches!(alpha("Tr 0.25"), Alpha::Blend { alpha } if alpha.factor == 0.75));
    assert_eq!(alpha("d 1"), Alpha::Opaque);
    let Alpha::Blend { alpha } = alpha("map_d a b.png") else { panic!() };
    assert_eq!(alpha.texture.unwrap().1, Channel::A);
}

#[test]
fn mtl_textures_are_read_and_flipped() {
    let scene = with_mtl("map_Kd -clamp on -s 2 3 1 -o 0.5 0.25 a b.png");
    let Bsdf::Matte { reflectance } = scene.materials[0].bsdf.clone() else { panic!() };
    assert_eq!(reflectance.factor, [1.0; 3]);
    let texture = reflectance.texture.unwrap();
    assert_eq!(texture.wrap, [Wrap::Clamp; 2]);
    assert_eq!(scene.textures[0].name, "a b.png");
    // vt (1, 1) is the upper right corner: (1, 0) here.
    assert_eq!(scene.meshes[0].uvs.as_ref().unwrap()[2], [1.0, 0.0]);
    // In OBJ's terms v' = 3 * 1 + 0.25; from the upper edge 1 - v'.
    let got = texture.transform.map(|m| m[0] * 1.0 + m[1] * 0.0 + m[2]);
    assert_eq!(got, [2.5, 1.0 - 3.25]);
    let missing = with_mtl("Kd 0.5 0.5 0.5\nmap_Kd none.png");
    assert_eq!(repaired(&missing, "missing texture"), 1);
    assert!(missing.meshes[0].uvs.is_none());
}

#[test]
fn broken_mtl_statements_are_ignored_naming_file_and_line() {
    let text = format!("mtllib m.mtl\n{CORNERS}usemtl m\nf 1 2 3\n");
    for (statement, part) in [
        ("Kd red", "\"red\""),
        ("Kd", "no value"),
        ("d -halo", "no value"),
        ("Ns nan", "finite"),
        ("Ns 1.#QNAN", "finite"),
        ("Kd 1 inf 0", "finite"),
        ("map_Kd -clamp on", "no file"),
    ] {
        let mtl = format!("newmtl m\n{statement}\nKe 3 3 3\n");
        let scene = load_files(&[("a.obj", text.as_bytes()), ("m.mtl", mtl.as_bytes())]).unwrap();
        check(&scene);
        let [repair] = &scene.repairs[..] else { panic!("{statement}: {:?}", scene.repairs) };
        assert_eq!((repair.element.as_str(), repair.count), ("m.mtl line 2", 1));
        assert!(repair.what.contains("ignored") && repair.what.contains(part), "{statement}: {repair:?}");
        // The rest of the material counts, beside the default.
        let material = &scene.materials[0];
        let Bsdf::Matte { reflectance } = &material.bsdf else { panic!("{statement}") };
        assert_eq!((reflectance.factor, material.emission.factor), ([0.8; 3], [3.0; 3]), "{statement}");
    }
    let scene = with_mtl("Kd 2 -1 0\nbump a b.png\nTf 0.5 0.5 0.5\nKs spectral x.rfl\nmap_Ns a b.png");
    assert_eq!(repaired(&scene, "clamped"), 2);
    let named: Vec<_> = scene.unmodelled.iter().map(|u| u.feature.as_str()).collect();
    assert_eq!(named, ["bump", "Ks spectral", "map_Ns", "Tf"]);
    // A keyword alone, as openMVS writes it.
    let scene = with_mtl("map_Kd\nKd 0.5 0.5 0.5");
    assert_eq!(repaired(&scene, "without a name"), 1);
    // A picture in no format that is known.
    let scene = with_mtl("map_Kd m.mtl\nKd 0.5 0.5 0.5");
    assert_eq!(scene.unmodelled[0].feature, "image format");
    assert!(scene.textures.is_empty());
}
