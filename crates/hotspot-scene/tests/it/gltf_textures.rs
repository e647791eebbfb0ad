//! Image formats of glTF textures, and textures that are reduced to fit their budget.

use std::io::Cursor;

use hotspot_scene::{Bsdf, LoadError, LoadOptions, Scene, load_glb_bytes};
use image::{ImageFormat, RgbaImage};
use serde_json::{Value, json};

use crate::support::*;

/// The textured square with other images; texture n is of image n.
fn with_images(images: &[Vec<u8>]) -> (Value, Vec<u8>) {
    let (mut json, mut bin) = textured_square();
    json["images"] = json!([]);
    json["textures"] = json!([]);
    for (i, image) in images.iter().enumerate() {
        let view = json["bufferViews"].as_array().unwrap().len();
        push(
            &mut json["bufferViews"],
            json!({"buffer": 0, "byteOffset": bin.len(), "byteLength": image.len()}),
        );
        bin.extend(image);
        push(&mut json["images"], json!({"bufferView": view, "name": format!("picture {i}")}));
        push(&mut json["textures"], json!({"source": i}));
    }
    json["buffers"][0]["byteLength"] = bin.len().into();
    (json, bin)
}

fn load_with(json: &Value, bin: &[u8], options: &LoadOptions) -> Result<Scene, LoadError> {
    load_glb_bytes("test.glb", &glb(json, bin), options)
}

fn encode(picture: &RgbaImage, format: ImageFormat) -> Vec<u8> {
    let mut out = Cursor::new(Vec::new());
    picture.write_to(&mut out, format).unwrap();
    out.into_inner()
}

/// A square picture of `side` texels, by column and row.
fn picture(side: u32, texel: impl Fn(u32, u32) -> [u8; 4]) -> RgbaImage {
    RgbaImage::from_fn(side, side, |x, y| image::Rgba(texel(x, y)))
}

#[test]
fn webp_is_read_and_preferred() {
    let webp = encode(&picture(2, |x, _| [10 * x as u8, 2, 3, 200]), ImageFormat::WebP);
    let (mut json, bin) = with_images(&[png(&[[9; 4]; 4]), webp]);
    json["textures"] = json!([{"source": 0, "extensions": {"EXT_texture_webp": {"source": 1}}}]);
    json["extensionsRequired"] = json!(["EXT_texture_webp"]);
    let scene = load_pair(&json, &bin).unwrap();
    assert!(scene.unmodelled.is_empty() && scene.repairs.is_empty());
    assert_eq!(scene.textures.len(), 1);
    assert_eq!(scene.textures[0].name, "picture 1");
    assert_eq!(scene.textures[0].rgba[..8], [0, 2, 3, 200, 10, 2, 3, 200]);
    json["textures"][0]["extensions"]["EXT_texture_webp"]["source"] = 2.into();
    let parts = ["textures[0].extensions.EXT_texture_webp.source", "2 images"];
    assert_refused(load_pair(&json, &bin), "webp index", "test.glb", &parts);
}

#[test]
fn formats_that_are_not_read_are_replaced_named_or_refused() {
    for name in ["KHR_texture_basisu", "EXT_texture_avif", "MSFT_texture_dds"] {
        let (mut json, bin) = with_images(&[png(&[[9; 4]; 4]), b"not a picture that we know".to_vec()]);
        json["textures"] = json!([{"source": 0, "extensions": { name: {"source": 1}}}]);
        json["extensionsRequired"] = json!([name]);
        let scene = load_pair(&json, &bin).unwrap();
        assert_eq!((scene.textures.len(), scene.unmodelled.len()), (1, 0));
        json["textures"][0].as_object_mut().unwrap().remove("source");
        let parts = [&format!("textures[0].extensions.{name}"), "PNG, JPEG or WebP"];
        assert_refused(load_pair(&json, &bin), name, "test.glb", &parts);
        json.as_object_mut().unwrap().remove("extensionsRequired");
        let scene = load_pair(&json, &bin).unwrap();
        assert!(scene.textures.is_empty());
        assert_eq!(scene.unmodelled[0].feature, name);
        assert_eq!(scene.unmodelled[0].element, "textures[0]");
        // Required and unused is no fault.
        json["extensionsRequired"] = json!([name]);
        json["materials"] = json!([{}]);
        assert!(load_pair(&json, &bin).is_ok());
    }
}

/// A PNG chunk with its checksum (CRC-32), bit by bit.
fn chunk(kind: &[u8; 4], payload: &[u8]) -> Vec<u8> {
    let body = [kind, payload].concat();
    let mut crc = u32::MAX;
    for byte in &body {
        crc ^= u32::from(*byte);
        for _ in 0..8 {
            crc = (crc >> 1) ^ (0xEDB8_8320 & 0u32.wrapping_sub(crc & 1));
        }
    }
    [&(payload.len() as u32).to_be_bytes()[..], &body, &(!crc).to_be_bytes()].concat()
}

/// A palette PNG of 2×2 texels (entries 0, 1, 2, 0), interlaced, entry 1 half transparent.
fn interlaced_palette() -> Vec<u8> {
    // Adam7: pass 1 holds (0, 0), pass 6 (1, 0), pass 7 the second row; each row starts with its filter.
    let rows = [0, 0, 0, 1, 0, 2, 0];
    let (mut a, mut b) = (1u32, 0u32);
    for byte in rows {
        a += byte;
        b += a;
    }
    let rows = rows.map(|byte| byte as u8);
    // One stored block.
    let length = rows.len() as u16;
    let mut zlib = vec![0x78, 0x01, 0x01];
    zlib.extend(length.to_le_bytes());
    zlib.extend((!length).to_le_bytes());
    zlib.extend(rows);
    zlib.extend(((b << 16) | a).to_be_bytes());
    let header = [2u32.to_be_bytes(), 2u32.to_be_bytes()].concat();
    [
        b"\x89PNG\r\n\x1a\n".to_vec(),
        chunk(b"IHDR", &[&header[..], &[8, 3, 0, 0, 1]].concat()),
        chunk(b"PLTE", &[255, 0, 0, 0, 255, 0, 0, 0, 255]),
        chunk(b"tRNS", &[255, 128]),
        chunk(b"IDAT", &zlib),
        chunk(b"IEND", &[]),
    ]
    .concat()
}

/// A JPEG of 8×8 texels with four components, all of them 128: each block is the codes for "no difference" and "no more".
fn cmyk() -> Vec<u8> {
    let segment = |marker: u8, payload: &[u8]| {
        [&[0xFF, marker][..], &(payload.len() as u16 + 2).to_be_bytes(), payload].concat()
    };
    let table = |class: u8| {
        let mut table = vec![class, 1];
        table.extend([0; 15]);
        table.push(0);
        table
    };
    let components: Vec<u8> = (1..=4).flat_map(|id| [id, 0x11, 0]).collect();
    let scans: Vec<u8> = (1..=4).flat_map(|id| [id, 0]).collect();
    [
        vec![0xFF, 0xD8],
        segment(0xEE, b"Adobe\0\x64\0\0\0\0\0"),
        segment(0xDB, &[&[0][..], &[1; 64]].concat()),
        segment(0xC0, &[&[8, 0, 8, 0, 8, 4][..], &components].concat()),
        segment(0xC4, &table(0x00)),
        segment(0xC4, &table(0x10)),
        segment(0xDA, &[&[4][..], &scans, &[0, 63, 0]].concat()),
        vec![0x00, 0xFF, 0xD9],
    ]
    .concat()
}

#[test]
fn palettes_interlacing_and_other_colour_spaces_are_decoded() {
    let (json, bin) = with_images(&[interlaced_palette()]);
    let scene = load_pair(&json, &bin).unwrap();
    let wanted = [[255, 0, 0, 255], [0, 255, 0, 128], [0, 0, 255, 255], [255, 0, 0, 255]].concat();
    assert_eq!(scene.textures[0].rgba[..], wanted);
    let (json, bin) = with_images(&[cmyk()]);
    let scene = load_pair(&json, &bin).unwrap();
    assert_eq!((scene.textures[0].width, scene.textures[0].height), (8, 8));
    for texel in scene.textures[0].rgba.chunks_exact(4) {
        // Half the ink in each colour and half in black: a quarter is left.
        assert!(texel[..3].iter().all(|c| (62..=66).contains(c)) && texel[3] == 255, "{texel:?}");
    }
    let grey = image::GrayImage::from_pixel(8, 8, image::Luma([77]));
    let mut out = Cursor::new(Vec::new());
    grey.write_to(&mut out, ImageFormat::Jpeg).unwrap();
    let (json, bin) = with_images(&[out.into_inner()]);
    assert_eq!(load_pair(&json, &bin).unwrap().textures[0].rgba[..4], [77, 77, 77, 255]);
}

#[test]
fn textures_beyond_the_budget_are_halved_largest_first() {
    // Columns of black and white, alpha from 0 to 255 by rows; 64, 16 and 16 texels.
    let stripes = |side: u32| picture(side, |x, y| [255 * (x % 2) as u8, 0, 255, 255 * (y % 2) as u8]);
    let images = [8, 4].map(|side| encode(&stripes(side), ImageFormat::Png));
    let (mut json, bin) = with_images(&images);
    json["materials"][0]["normalTexture"] = json!({"index": 1});
    let load = |max_texture_bytes: u64| {
        load_with(&json, &bin, &LoadOptions { max_texture_bytes, ..Default::default() })
    };
    let sizes = |scene: &Scene| scene.textures.iter().map(|t| (t.width, t.height)).collect::<Vec<_>>();
    let whole = load(4 * 80).unwrap();
    assert_eq!(sizes(&whole), [(8, 8), (4, 4)]);
    assert!(whole.unmodelled.is_empty());
    // One byte less: the larger one is halved.
    let scene = load(4 * 80 - 1).unwrap();
    assert_eq!(sizes(&scene), [(4, 4), (4, 4)]);
    assert_eq!(scene.unmodelled.len(), 1);
    assert_eq!(scene.unmodelled[0].feature, "texture resolution");
    assert_eq!(scene.unmodelled[0].element, "images[0] \"picture 0\"");
    let effect = "reduced from 8x8 to 4x4 to fit the texture budget of 319 bytes";
    assert_eq!(scene.unmodelled[0].effect, effect);
    // Half of white's light is 188 encoded; alpha is a number.
    assert_eq!(scene.textures[0].rgba[..4], [188, 0, 255, 128]);
    assert_eq!(scene.textures[1].rgba, whole.textures[1].rgba);
    // Then of equals the first, then the other: data is averaged as numbers.
    assert_eq!(sizes(&load(4 * 20).unwrap()), [(2, 2), (4, 4)]);
    let scene = load(4 * 8).unwrap();
    assert_eq!(sizes(&scene), [(2, 2), (2, 2)]);
    assert_eq!(scene.textures[1].rgba[..4], [128, 0, 255, 128]);
    assert_eq!(sizes(&load(4 * 2).unwrap()), [(1, 1), (1, 1)]);
    assert!(matches!(load(7), Err(LoadError::Limit { .. })));
    assert_refused(load(0), "no budget", "test.glb", &["images[0]", "texture budget of 0 bytes"]);
    // An image that is a colour and data at once is a colour.
    json["materials"][0]["normalTexture"] = json!({"index": 0});
    let options = LoadOptions { max_texture_bytes: 4 * 16, ..Default::default() };
    assert_eq!(load_with(&json, &bin, &options).unwrap().textures[0].rgba[..4], [188, 0, 255, 128]);
}

#[test]
fn textures_of_obj_files_keep_the_budget_too() {
    let folder = tempfile::tempdir().unwrap();
    let image = encode(&picture(4, |x, _| [255 * (x % 2) as u8, 0, 0, 255]), ImageFormat::Png);
    std::fs::write(folder.path().join("t.png"), image).unwrap();
    std::fs::write(folder.path().join("m.mtl"), "newmtl m\nmap_Kd t.png\n").unwrap();
    let path = folder.path().join("a.obj");
    std::fs::write(&path, "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl m\nf 1/1 2/1 3/1\n")
        .unwrap();
    let scene = hotspot_scene::load(&path, &LoadOptions { max_texture_bytes: 16, ..Default::default() });
    let scene = scene.unwrap();
    assert_eq!(scene.textures[0].rgba[..], [188, 0, 0, 255].repeat(4));
    assert_eq!(scene.unmodelled[0].feature, "texture resolution");
}

#[test]
fn textures_are_reduced_to_what_the_memory_limit_leaves() {
    let image = encode(&picture(1024, |_, _| [1, 2, 3, 255]), ImageFormat::Png);
    let (json, bin) = with_images(&[image]);
    // Decoding takes 12 bytes a texel, the texture 4.
    for (mebibytes, side) in [(17, 1024), (15, 512)] {
        let options = LoadOptions { max_memory_bytes: mebibytes << 20, ..Default::default() };
        assert_eq!(load_with(&json, &bin, &options).unwrap().textures[0].width, side);
    }
    let options = LoadOptions { max_memory_bytes: 11 << 20, ..Default::default() };
    assert_refused(load_with(&json, &bin, &options), "no room", "test.glb", &["memory limit"]);
}

#[test]
fn damaged_pictures_of_every_format_never_panic() {
    let texels = picture(16, |x, y| [(x * 16) as u8, (y * 16) as u8, (x * y) as u8, 255 - x as u8]);
    let of_rgb = |format| {
        let mut out = Cursor::new(Vec::new());
        image::DynamicImage::from(texels.clone()).into_rgb8().write_to(&mut out, format).unwrap();
        out.into_inner()
    };
    let pictures = [
        of_rgb(ImageFormat::Bmp),
        of_rgb(ImageFormat::Gif),
        of_rgb(ImageFormat::Jpeg),
        encode(&texels, ImageFormat::Bmp),
        encode(&texels, ImageFormat::Png),
        encode(&texels, ImageFormat::WebP),
        interlaced_palette(),
        cmyk(),
    ];
    let options = LoadOptions { max_memory_bytes: 16 << 20, ..Default::default() };
    let mut seed = 1u64;
    let mut below = |bound: usize| {
        // Knuth's MMIX generator.
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 33) as usize % bound
    };
    for whole in pictures {
        let mut loaded = 0;
        for round in 0..400 {
            let mut bytes = whole.clone();
            if round % 4 == 0 {
                bytes.truncate(below(bytes.len()));
            } else {
                for _ in 0..1 + below(3) {
                    let at = below(bytes.len());
                    bytes[at] ^= 1 << below(8);
                }
            }
            let (json, bin) = with_images(&[bytes]);
            match load_with(&json, &bin, &options) {
                Ok(scene) => {
                    check(&scene);
                    loaded += scene.textures.len();
                }
                Err(error) => {
                    // A damaged size.
                    assert!(matches!(error, LoadError::Limit { .. }), "{error}");
                    assert!(error.place().element.starts_with("images[0]"), "{error}");
                }
            }
        }
        assert!(loaded < 400, "nothing was damaged");
    }
}

#[test]
fn a_slot_of_the_wrong_type_is_refused_by_name() {
    let cases = [
        (json!({"index": 0, "texCoord": -1}), "texCoord"),
        (json!({"index": 0, "texCoord": 4294967296u64}), "texCoord"),
        (json!({"index": 0, "extensions": {"KHR_texture_transform": {"offset": [1]}}}), "offset"),
        (json!({"index": 0, "extensions": {"KHR_texture_transform": {"texCoord": "x"}}}), "texCoord"),
        (json!({}), "index"),
        (json!([]), "normalTexture"),
        (json!({"index": 1}), "index"),
    ];
    for (slot, part) in cases {
        let (mut json, bin) = textured_square();
        json["materials"][0]["normalTexture"] = slot;
        let result = load_pair(&json, &bin);
        assert_refused(result, part, "test.glb", &["materials[0].normalTexture", part]);
    }
    // The base colour is read as before.
    let (json, bin) = textured_square();
    let Bsdf::Substrate { diffuse, .. } = &load_pair(&json, &bin).unwrap().materials[0].bsdf else {
        panic!()
    };
    assert!(diffuse.texture.is_some());
}
