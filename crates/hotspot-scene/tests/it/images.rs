//! Images that are damaged or in older formats: what is decoded, and what becomes of a material whose image is left out.

use std::io::Cursor;

use hotspot_scene::{Alpha, Bsdf, LoadError, Scene};
use image::{DynamicImage, ImageFormat, RgbaImage};
use serde_json::json;

use crate::support::*;

/// 3×2 texels, all different, opaque.
fn picture() -> RgbaImage {
    RgbaImage::from_fn(3, 2, |x, y| image::Rgba([80 * x as u8, 90 * y as u8, 250, 255]))
}

fn encoded(format: ImageFormat) -> Vec<u8> {
    let mut out = Cursor::new(Vec::new());
    DynamicImage::from(picture()).into_rgb8().write_to(&mut out, format).unwrap();
    out.into_inner()
}

/// A triangle whose material `m` the MTL statements describe, with one file beside it.
fn obj_with(statements: &str, name: &str, bytes: &[u8]) -> Scene {
    let mtl = format!("newmtl m\n{statements}\n");
    let obj = b"mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3\n";
    load_files(&[("a.obj", obj), ("m.mtl", mtl.as_bytes()), (name, bytes)]).unwrap()
}

#[test]
fn bmp_gif_and_tga_are_read() {
    for (format, name) in
        [(ImageFormat::Bmp, "t.dat"), (ImageFormat::Gif, "t.dat"), (ImageFormat::Tga, "t.TGA")]
    {
        let scene = obj_with(&format!("map_Kd {name}"), name, &encoded(format));
        check(&scene);
        assert!(scene.repairs.is_empty() && scene.unmodelled.is_empty(), "{name}: {scene:?}");
        let texture = &scene.textures[0];
        assert_eq!((texture.width, texture.height), (3, 2), "{format:?}");
        assert_eq!(texture.rgba[..], picture().into_raw()[..], "{format:?}");
    }
    // TGA has no mark, so nothing but its name tells.
    let scene = obj_with("map_Kd t.dat", "t.dat", &encoded(ImageFormat::Tga));
    assert!(scene.textures.is_empty());
    assert_eq!(scene.unmodelled[0].feature, "image format");
    assert_eq!(scene.unmodelled[0].element, "m.mtl line 2");
}

/// The other formats are damaged in the tests of glTF's textures.
#[test]
fn a_damaged_tga_never_panics() {
    let whole = encoded(ImageFormat::Tga);
    for at in 0..whole.len() {
        for change in [1, 2, 8, 128, 255] {
            let mut bytes = whole.clone();
            bytes[at] ^= change;
            let obj = b"mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n";
            let files: [(&str, &[u8]); 3] =
                [("a.obj", obj), ("m.mtl", b"newmtl m\nmap_Kd t.tga\n"), ("t.tga", &bytes)];
            match load_files(&files) {
                Ok(scene) => check(&scene),
                Err(error) => assert!(matches!(error, LoadError::Limit { .. }), "byte {at}: {error}"),
            }
        }
    }
}

#[test]
fn the_first_frame_of_a_gif_is_shown() {
    let mut bytes = Vec::new();
    {
        let mut encoder = image::codecs::gif::GifEncoder::new(&mut bytes);
        for shade in [10, 200] {
            let frame = RgbaImage::from_pixel(2, 2, image::Rgba([shade, shade, shade, 255]));
            encoder.encode_frame(image::Frame::new(frame)).unwrap();
        }
    }
    let scene = obj_with("map_Kd t.gif", "t.gif", &bytes);
    assert_eq!(scene.textures[0].rgba[..4], [10, 10, 10, 255]);
}

#[test]
fn damaged_images_are_left_out_and_named() {
    // Told by the header; found when the texels are decoded; no image at all.
    for (case, length) in [("header", 20), ("texels", 60)] {
        let (mut json, bin) = textured_square();
        json["bufferViews"][4]["byteLength"] = length.into();
        assert_left_out(&load_pair(&json, &bin).unwrap(), case, &["images[0]", "decoded"]);
    }
    let (mut json, bin) = textured_square();
    json["images"][0] = json!({});
    assert_left_out(&load_pair(&json, &bin).unwrap(), "nothing", &["images[0]", "neither"]);
    json["images"][0] = json!({"uri": "data:image/png;base64,A*"});
    assert_left_out(&load_pair(&json, &bin).unwrap(), "base64", &["images[0].uri", "base64"]);
    json["images"][0] = json!({"bufferView": 0});
    let scene = load_pair(&json, &bin).unwrap();
    assert!(scene.textures.is_empty());
    assert_eq!(scene.unmodelled[0].feature, "image format");
    assert!(scene.unmodelled[0].effect.contains("left out"), "{:?}", scene.unmodelled);
    let png = png(&[[9; 4]; 4]);
    let scene = obj_with("map_Kd t.png", "t.png", &png[..60]);
    assert!(scene.textures.is_empty());
    assert_eq!(repaired(&scene, "unreadable image left out"), 1);
    assert!(scene.repairs[0].element.starts_with("m.mtl line 2"), "{:?}", scene.repairs);
}

#[test]
fn a_damaged_image_takes_no_other_along() {
    // Image 0 is damaged where only decoding tells; every slot reads it, but for the roughness, which reads image 1.
    let (mut json, mut bin) = textured_square();
    let whole = png(&[[1, 2, 3, 255]; 4]);
    let start = bin.len();
    bin.extend(&whole);
    push(&mut json["bufferViews"], json!({"buffer": 0, "byteOffset": start, "byteLength": whole.len()}));
    json["buffers"][0]["byteLength"] = bin.len().into();
    push(&mut json["images"], json!({"bufferView": 5, "name": "whole"}));
    push(&mut json["textures"], json!({"source": 1}));
    json["materials"][0] = json!({
        "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicFactor": 0.5, "baseColorFactor": [1, 1, 1, 0.5],
            "metallicRoughnessTexture": {"index": 1}},
        "normalTexture": {"index": 0},
        "emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 0},
        "alphaMode": "BLEND"});
    let whole_file = load_pair(&json, &bin).unwrap();
    assert_eq!(whole_file.textures.len(), 2);
    assert!(whole_file.materials[0].normal_map.is_some() && whole_file.materials[0].is_emissive());
    json["bufferViews"][4]["byteLength"] = 60.into();
    let scene = load_pair(&json, &bin).unwrap();
    check(&scene);
    assert_eq!(scene.textures.len(), 1);
    assert_eq!(scene.textures[0].name, "whole");
    assert_eq!(repaired(&scene, "unreadable image left out"), 1);
    assert_eq!(repaired(&scene, "emission left out with its texture"), 1);
    let material = &scene.materials[0];
    assert!(material.normal_map.is_none() && !material.is_emissive() && material.emission.texture.is_none());
    let Alpha::Blend { alpha } = material.alpha else { panic!("{material:?}") };
    assert!(alpha.texture.is_none() && alpha.factor == 0.5);
    let Bsdf::Mix { weight, base, other } = &material.bsdf else { panic!("{material:?}") };
    assert_eq!(weight.texture.unwrap().0.texture, 0);
    let Bsdf::Substrate { diffuse, roughness, .. } = &**base else { panic!("{base:?}") };
    assert!(diffuse.texture.is_none() && diffuse.factor == [1.0; 3]);
    assert_eq!(roughness.texture.unwrap().0.texture, 0);
    let Bsdf::RoughMetal { f0, roughness } = &**other else { panic!("{other:?}") };
    assert!(f0.texture.is_none());
    assert_eq!(roughness.texture.unwrap().0.texture, 0);
}

#[test]
fn emission_goes_with_a_missing_texture() {
    let (mut json, bin) = textured_square();
    json["images"][0] = json!({"uri": "glow.png"});
    json["materials"][0] = json!({"emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 0}});
    let scene = load_pair(&json, &bin).unwrap();
    assert!(!scene.materials[0].is_emissive());
    assert_eq!(repaired(&scene, "emission left out with its texture"), 1);
    for (statements, count) in [("Ke 1 1 1\nmap_Ke glow.png", 1), ("map_Ke glow.png", 0)] {
        let scene = obj_with(statements, "other.png", b"");
        assert!(!scene.materials[0].is_emissive());
        assert_eq!(repaired(&scene, "emission left out with its texture"), count, "{statements}");
        assert_eq!(repaired(&scene, "missing texture left out"), 1);
    }
    // The factor alone is emission as before.
    let scene = obj_with("Ke 1 1 1", "other.png", b"");
    assert!(scene.materials[0].is_emissive());
}
