//! Files that name other files: only regular ones inside the scene's folder are read. Without a buffer there is no scene;
//! without an image there is one texture less.

use std::fs;

use hotspot_scene::{LoadError, LoadOptions, load};
use serde_json::{Value, json};

use crate::support::*;

/// `square` with its buffer at `uri`.
fn gltf_with_buffer(uri: &str) -> (Value, Vec<u8>) {
    let (mut json, bin) = square();
    json["buffers"][0]["uri"] = uri.into();
    (json, bin)
}

fn gltf_with_image(uri: &str) -> (Value, Vec<u8>) {
    let (mut json, bin) = textured_square();
    json["images"][0] = json!({"uri": uri});
    (json, bin)
}

#[test]
fn buffers_load_from_files_and_data_uris() {
    for (uri, file) in [("b%20%C3%A9.bin", "b é.bin"), ("sub/b.bin", "sub/b.bin"), ("./x/../b.bin", "b.bin")]
    {
        let (json, bin) = gltf_with_buffer(uri);
        let text = json.to_string();
        let files = [("a.gltf", text.as_bytes()), (file, &bin), ("x/y", b"")];
        let scene = load_files(&files).unwrap_or_else(|e| panic!("{uri}: {e}"));
        check(&scene);
        assert_eq!(scene.name, "a");
    }
    let (_, bin) = square();
    let encoded = base64::Engine::encode(&base64::engine::general_purpose::STANDARD, bin);
    let (json, _) = gltf_with_buffer(&format!("data:application/octet-stream;base64,{encoded}"));
    check(&load_files(&[("a.gltf", json.to_string().as_bytes())]).unwrap());
}

#[test]
fn names_that_lead_outside_are_refused() {
    let cases = [
        ("../b.bin", "leads out"),
        ("sub/../../b.bin", "leads out"),
        ("%2e%2e/b.bin", "leads out"),
        ("..%5Cb.bin", "leads out"),
        ("/etc/passwd", "absolute"),
        ("file:///etc/passwd", "address"),
        ("FILE:///etc/passwd", "address"),
        ("http://example.com/b.bin", "address"),
        ("//example.com/b.bin", "absolute"),
        ("C:/b.bin", "absolute"),
        ("%2Fetc%2Fpasswd", "absolute"),
        ("", "not a file name"),
        ("b%00.bin", "not a file name"),
        ("b%FF.bin", "UTF-8"),
        ("missing.bin", "cannot find"),
        ("a.gltf/b.bin", "cannot find"),
        ("sub", "not a regular file"),
        (".", "not a regular file"),
    ];
    for (uri, part) in cases {
        let (json, _) = gltf_with_buffer(uri);
        let text = json.to_string();
        let result = load_files(&[("a.gltf", text.as_bytes()), ("sub/x", b"")]);
        assert_refused(result, uri, "a.gltf", &["buffers[0].uri", part]);
        let (json, bin) = gltf_with_image(uri);
        let container = glb(&json, &bin);
        let secret = png(&[[1; 4]; 4]);
        let scene = load_files(&[("in/a.gltf", &container), ("in/sub/x", b""), ("b.bin", &secret)]).unwrap();
        assert_left_out(&scene, uri, &["images[0].uri", part]);
    }
}

#[test]
fn a_scene_in_memory_reaches_no_file() {
    let (json, bin) = gltf_with_image("Cargo.toml");
    let scene = load_pair(&json, &bin).unwrap();
    assert_left_out(&scene, "in memory", &["images[0].uri", "no folder"]);
    let (mut json, _) = square();
    json["buffers"][0]["uri"] = "Cargo.toml".into();
    assert_refused(load_pair(&json, &bin), "in memory", "test.glb", &["buffers[0].uri", "no folder"]);
}

#[test]
fn an_image_over_the_size_limit_is_refused_not_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let (json, bin) = gltf_with_image("t.png");
    let scene = folder.path().join("a.glb");
    let bytes = glb(&json, &bin);
    fs::write(&scene, &bytes).unwrap();
    fs::write(folder.path().join("t.png"), vec![0; bytes.len() + 1]).unwrap();
    let options = LoadOptions { max_file_bytes: bytes.len() as u64, ..Default::default() };
    let result = load(&scene, &options);
    assert!(matches!(result, Err(LoadError::Limit { .. })), "{result:?}");
    assert_refused(result, "large image", "a.glb", &["images[0].uri", "t.png", "limit"]);
}

#[test]
fn mtllib_of_dev_zero_and_its_like_are_never_read() {
    for name in ["/dev/zero", "../secret.mtl", "C:\\secret.mtl", "file:///secret.mtl", "sub/../../secret.mtl"]
    {
        let obj = format!("v 0 0 0\nmtllib {name}\n");
        let scene = load_files(&[("in/a.obj", obj.as_bytes()), ("secret.mtl", b"newmtl")]).unwrap();
        assert_eq!(repaired(&scene, "material library left out"), 1, "{name}");
        let mtl = format!("newmtl m\nKd 0 0 0\nmap_Kd {name}\n");
        let obj = b"mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n";
        let files: [(&str, &[u8]); 3] =
            [("in/a.obj", obj), ("in/m.mtl", mtl.as_bytes()), ("secret.mtl", b"newmtl")];
        let scene = load_files(&files).unwrap();
        assert_eq!(repaired(&scene, "texture left out"), 1, "{name}");
        assert!(scene.textures.is_empty(), "{name}");
    }
    // A folder where a picture should be.
    let obj = b"mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n";
    let files: [(&str, &[u8]); 3] = [("a.obj", obj), ("m.mtl", b"newmtl m\nmap_Kd sub\n"), ("sub/x", b"")];
    assert_left_out(&load_files(&files).unwrap(), "folder", &["m.mtl line 2", "not a regular file"]);
    assert_refused(
        load_files(&[("a.obj", b"mtllib sub\n"), ("sub/x", b"")]),
        "folder",
        "a.obj",
        &["line 1", "not a regular file"],
    );
}

#[test]
fn the_scene_itself_must_be_a_regular_file_of_a_known_kind() {
    let folder = tempfile::tempdir().unwrap();
    let missing = folder.path().join("missing.gltf");
    let options = LoadOptions::default();
    assert!(matches!(load(&missing, &options), Err(LoadError::Io { .. })));
    assert_refused(load(&missing, &options), "missing", text(&missing), &["check the name"]);
    assert_refused(load(folder.path(), &options), "folder", text(folder.path()), &["not a regular file"]);
    let result = load_files(&[("a.ply", b"ply\n")]);
    assert!(matches!(result, Err(LoadError::Unsupported { .. })));
    // Content decides where the extension does not.
    let (json, bin) = square();
    check(&load_files(&[("a.bin", &glb(&json, &bin))]).unwrap());
}

#[test]
fn a_file_over_the_size_limit_is_not_read() {
    let folder = tempfile::tempdir().unwrap();
    let (json, bin) = square();
    let path = folder.path().join("a.glb");
    let bytes = glb(&json, &bin);
    fs::write(&path, &bytes).unwrap();
    let options = LoadOptions { max_file_bytes: bytes.len() as u64 - 1, ..Default::default() };
    let result = load(&path, &options);
    assert!(matches!(result, Err(LoadError::Limit { .. })));
    let options = LoadOptions { max_file_bytes: bytes.len() as u64, ..Default::default() };
    check(&load(&path, &options).unwrap());
    // Sparse: takes no room on the disk.
    let huge = folder.path().join("huge.glb");
    fs::File::create(&huge).unwrap().set_len(1 << 40).unwrap();
    let result = load(&huge, &LoadOptions::default());
    assert_refused(result, "1 TiB", "huge.glb", &["1024.0 GiB", "4.0 GiB"]);
}

#[cfg(unix)]
#[test]
fn links_that_lead_outside_devices_and_pipes_are_refused() {
    let outside = tempfile::tempdir().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let (json, bin) = gltf_with_buffer("link.bin");
    let scene = folder.path().join("a.gltf");
    let link = folder.path().join("link.bin");
    fs::write(&scene, json.to_string()).unwrap();
    let options = LoadOptions::default();

    fs::write(outside.path().join("b.bin"), &bin).unwrap();
    std::os::unix::fs::symlink(outside.path().join("b.bin"), &link).unwrap();
    assert_refused(load(&scene, &options), "link", "a.gltf", &["buffers[0].uri", "symbolic link"]);

    // A link that stays inside is fine.
    fs::remove_file(&link).unwrap();
    fs::write(folder.path().join("real.bin"), &bin).unwrap();
    std::os::unix::fs::symlink("real.bin", &link).unwrap();
    check(&load(&scene, &options).unwrap());

    // An image behind a link that leads outside is not read, though it is a picture.
    fs::write(outside.path().join("t.png"), png(&[[1; 4]; 4])).unwrap();
    std::os::unix::fs::symlink(outside.path().join("t.png"), folder.path().join("t.png")).unwrap();
    let (textured, whole) = gltf_with_image("t.png");
    let linked = folder.path().join("linked.glb");
    fs::write(&linked, glb(&textured, &whole)).unwrap();
    assert_left_out(&load(&linked, &options).unwrap(), "link", &["images[0].uri", "symbolic link"]);

    // A pipe without a writer would block an open for ever.
    fs::remove_file(&link).unwrap();
    let made = std::process::Command::new("mkfifo").arg(&link).status();
    if made.is_ok_and(|status| status.success()) {
        assert_refused(load(&scene, &options), "pipe", "a.gltf", &["buffers[0].uri", "not a regular file"]);
        let (textured, whole) = gltf_with_image("link.bin");
        fs::write(&linked, glb(&textured, &whole)).unwrap();
        assert_left_out(&load(&linked, &options).unwrap(), "pipe", &["not a regular file"]);
    }
    assert_refused(load("/dev/zero".as_ref(), &options), "device", "/dev/zero", &["not a regular file"]);
}
