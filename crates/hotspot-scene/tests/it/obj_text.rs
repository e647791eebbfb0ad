//! OBJ and MTL as text: line ends, encodings, numbers and names of many programs.

use hotspot_scene::{Bsdf, Scene};

use crate::support::*;

const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

fn load(obj: &[u8]) -> Scene {
    let scene = load_files(&[("a.obj", obj)]).unwrap();
    check(&scene);
    scene
}

fn refused(text: &str, parts: &[&str]) {
    assert_refused(load_files(&[("a.obj", text.as_bytes())]), text, "a.obj", parts);
}

#[test]
fn line_ends_tabs_comments_and_a_missing_newline_change_nothing() {
    let text =
        format!("{SQUARE}\no A # not a comment \nf  1\t2 3 4 # a comment 9 \n\n # f 9 9 9\nf 1 2 \\\n  3  ");
    for end in ["\n", "\r\n", "\r"] {
        let scene = load(format!("\u{FEFF}{}", text.replace('\n', end)).as_bytes());
        assert_eq!(scene.meshes[0].triangles, [[0, 1, 2], [0, 2, 3], [0, 1, 2]], "{end:?}");
        assert_eq!(scene.objects[0].name, "A # not a comment");
        // Lines are counted alike.
        let broken = format!("{}{end}f 1 2 7", text.replace('\n', end));
        refused(&broken, &["line 12", "index 7"]);
    }
    refused("\u{FEFF}v 1 2 x", &["line 1", "\"x\""]);
}

#[test]
fn numbers_in_all_spellings() {
    let scene = load(b"v 1. .5 1e-3\nv +2 -.0 1E+2\nv 0,25 1,5 -3,0\nf 1 2 3\n");
    let wanted = [[1.0, 0.5, 1e-3], [2.0, 0.0, 100.0], [0.25, 1.5, -3.0]];
    assert_eq!(scene.meshes[0].positions, wanted);
    assert_eq!(repaired(&scene, "decimal commas"), 3);
    assert_eq!(scene.repairs.iter().find(|r| r.what.contains("commas")).unwrap().element, "line 3 and on");
    // Commas that part numbers are no decimal commas.
    refused("v 1,2,3 4 5\n", &["line 1", "\"1,2,3\" is not a number"]);
    refused("v 1,5 2,5\n", &["line 1", "3 numbers"]);
    // What C libraries of Windows print for NaN and infinity.
    let text = format!(
        "{SQUARE}v 1.#QNAN 0 0\nv -1.#IND 0 0\nv 0 1.#INF 0\nv nan inf -inf\nf 1 2 5 6\nf 1 7 8\nf 1 2 3\n"
    );
    let scene = load(text.as_bytes());
    assert_eq!(scene.meshes[0].triangles.len(), 1);
    assert_eq!(repaired(&scene, "infinite or NaN corners"), 3);
}

#[test]
fn names_hold_spaces_unicode_and_bytes_of_old_encodings() {
    let mtl = "newmtl Stein grün #2\nKd 0.1 0.1 0.1\nnewmtl 木\nKd 0.2 0.2 0.2\n";
    let obj = format!(
        "mtllib mein material.mtl\n{SQUARE}o Wände  und #1\nusemtl Stein grün #2\nf 1 2 3\nusemtl 木 # tree\nf 1 3 4\n"
    );
    let files: [(&str, &[u8]); 2] = [("a.obj", obj.as_bytes()), ("mein material.mtl", mtl.as_bytes())];
    let scene = load_files(&files).unwrap();
    assert_eq!(scene.objects[0].name, "Wände  und #1");
    let reflectances: Vec<f32> = scene
        .materials
        .iter()
        .map(|m| match m.bsdf {
            Bsdf::Matte { reflectance } => reflectance.factor[0],
            _ => panic!(),
        })
        .collect();
    assert_eq!((reflectances, scene.repairs.len()), (vec![0.1, 0.2], 0));

    // Latin-1 and Shift-JIS (whose second byte may be a backslash, at the end of a line): different names stay different.
    let names: [&[u8]; 3] = [b"W\xE4nde", b"\x95\x5C", b"\x95\x85\xA0"];
    let (mut obj, mut mtl) = (b"mtllib m.mtl\n".to_vec(), Vec::new());
    obj.extend(SQUARE.as_bytes());
    for (i, name) in names.iter().enumerate() {
        obj.extend([b"o ", *name, b"\nusemtl ", *name, b"\nf 1 2 3\n"].concat());
        mtl.extend([b"newmtl ", *name, format!("\nKd 0.{i} 0 0\n").as_bytes()].concat());
    }
    let scene = load_files(&[("a.obj", &obj), ("m.mtl", &mtl)]).unwrap();
    check(&scene);
    assert_eq!((scene.objects.len(), scene.materials.len()), (3, 3));
    assert_eq!(scene.objects[0].name, "Wände");
    assert_eq!(repaired(&scene, "Latin-1"), 6 + 3);
    assert_eq!(repaired(&scene, "material not found"), 0);
}

#[test]
fn utf16_of_both_orders_is_read() {
    let text = format!("\u{FEFF}{SQUARE}o Wände \u{1F3E0}\nf 1 2 3\n");
    for order in [u16::to_le_bytes, u16::to_be_bytes] {
        let mut bytes: Vec<u8> = text.encode_utf16().flat_map(order).collect();
        assert_eq!(load(&bytes).objects[0].name, "Wände \u{1F3E0}");
        // Half a unit more.
        bytes.push(0xD8);
        assert_eq!(load(&bytes).meshes[0].triangles.len(), 1);
    }
}

#[test]
fn libraries_are_found_as_written_elsewhere_and_in_another_case() {
    let obj = |name: &str| format!("usemtl m\nmtllib {name}\n{SQUARE}f 1 2 3\n");
    let mtl = b"newmtl m\nKd 0.5 0 0\n";
    for (name, path, elsewhere) in [
        ("m.mtl", "m.mtl", 0),
        ("./m.mtl", "m.mtl", 0),
        ("sub\\m.mtl", "sub/m.mtl", 0),
        ("a b.mtl", "a b.mtl", 0),
        ("missing.mtl m.mtl # both", "m.mtl", 0),
        ("M.MTL", "m.mtl", 1),
        ("C:\\models\\m.mtl", "m.mtl", 1),
        ("/home/someone/m.mtl", "m.mtl", 1),
        ("../m.mtl", "m.mtl", 1),
    ] {
        let scene = load_files(&[("a.obj", obj(name).as_bytes()), (path, mtl)]).unwrap();
        assert_eq!(repaired(&scene, "material not found"), 0, "{name}");
        assert_eq!(repaired(&scene, "library found by its name alone"), elsewhere, "{name}");
    }
    // Several statements; the first definition counts, and a file that is named twice is read once.
    let text =
        format!("mtllib m.mtl\nmtllib n.mtl\nmtllib m.mtl\n{SQUARE}usemtl m\nf 1 2 3\nusemtl n\nf 1 3 4\n");
    let other = b"newmtl m\nKd 0 0 0\nnewmtl n\nKd 0 0 0\n";
    let scene = load_files(&[("a.obj", text.as_bytes()), ("m.mtl", mtl), ("n.mtl", other)]).unwrap();
    let Bsdf::Matte { reflectance } = scene.materials[0].bsdf else { panic!() };
    assert_eq!(reflectance.factor, [0.5, 0.0, 0.0]);
    assert_eq!((repaired(&scene, "second definition"), repaired(&scene, "not found")), (1, 0));
}

#[test]
fn textures_are_found_beside_the_mtl_the_obj_and_by_their_last_name() {
    let picture = png(&[[9; 4]; 4]);
    for (name, path, elsewhere) in [
        ("t.png", "mtl/t.png", 0),
        ("t.png", "t.png", 0),
        ("../tex/t.png", "tex/t.png", 0),
        ("tex\\t.png", "tex/t.png", 0),
        ("T.PNG", "mtl/t.png", 1),
        ("t.png", "mtl/T.Png", 1),
        ("/t.png", "mtl/t.png", 1),
        ("D:\\art\\Bild 1.png", "mtl/bild 1.png", 1),
        ("/home/someone/t.png", "t.png", 1),
        ("../../t.png", "t.png", 1),
    ] {
        let obj = format!("mtllib mtl/m.mtl\n{SQUARE}vt 0 0\nusemtl m\nf 1/1 2/1 3/1\n");
        let mtl = format!("newmtl m\nmap_Kd {name}\n");
        let files: [(&str, &[u8]); 3] =
            [("a.obj", obj.as_bytes()), ("mtl/m.mtl", mtl.as_bytes()), (path, &picture)];
        let scene = load_files(&files).unwrap();
        check(&scene);
        assert_eq!(scene.textures.len(), 1, "{name} at {path}");
        assert_eq!(repaired(&scene, "texture found by its name alone"), elsewhere, "{name} at {path}");
    }
}
