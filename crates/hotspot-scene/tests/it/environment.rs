//! Environment maps from OpenEXR and Radiance HDR files.

use std::fs;
use std::io::Cursor;

use exr::prelude::*;
use hotspot_scene::{EnvironmentMap, LoadError, LoadOptions, Repair, load_environment};

type Loaded = std::result::Result<(EnvironmentMap, Vec<Repair>), LoadError>;

fn load_bytes(name: &str, bytes: &[u8], options: &LoadOptions) -> Loaded {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    fs::write(&path, bytes).unwrap();
    load_environment(&path, options)
}

fn load(name: &str, bytes: &[u8]) -> Loaded {
    load_bytes(name, bytes, &LoadOptions::default())
}

/// Red grows to the right, green downwards; blue is beyond 1.
fn ramp(x: usize, y: usize) -> [f32; 3] {
    [x as f32, y as f32 * 0.5, 100.0]
}

/// A channel's name, and its value by column and row.
type Stated<'c> = (&'c str, &'c dyn Fn(usize, usize) -> f32);

/// An EXR of one layer with the given channels.
fn exr_of(width: usize, height: usize, encoding: Encoding, channels: &[Stated<'_>], half: bool) -> Vec<u8> {
    let list = channels
        .iter()
        .map(|(name, value)| {
            let texels = (0..width * height).map(|i| value(i % width, i / width));
            let samples = if half {
                FlatSamples::F16(texels.map(f16::from_f32).collect())
            } else {
                FlatSamples::F32(texels.collect())
            };
            AnyChannel::new(*name, samples)
        })
        .collect();
    let layer =
        Layer::new((width, height), LayerAttributes::named("main"), encoding, AnyChannels::sort(list));
    let mut out = Cursor::new(Vec::new());
    Image::from_layer(layer).write().non_parallel().to_buffered(&mut out).unwrap();
    out.into_inner()
}

const LINES: Encoding = Encoding::UNCOMPRESSED;
const ZIP: Encoding = Encoding {
    compression: Compression::ZIP16,
    blocks: Blocks::ScanLines,
    line_order: LineOrder::Increasing,
};
const TILES: Encoding = Encoding {
    compression: Compression::RLE,
    blocks: Blocks::Tiles(Vec2(3, 2)),
    line_order: LineOrder::Increasing,
};

fn ramp_exr(width: usize, height: usize, encoding: Encoding, half: bool) -> Vec<u8> {
    let channel = |c: usize| move |x, y| ramp(x, y)[c];
    let (r, g, b) = (channel(0), channel(1), channel(2));
    exr_of(width, height, encoding, &[("R", &r), ("G", &g), ("B", &b), ("A", &|_, _| 0.5)], half)
}

/// A Radiance picture of texels in rows, not compressed.
fn hdr_of(width: usize, height: usize, header: &str, texel: impl Fn(usize, usize) -> [u8; 4]) -> Vec<u8> {
    let mut out = format!("{header}\n\n-Y {height} +X {width}\n").into_bytes();
    out.extend((0..width * height).flat_map(|i| texel(i % width, i / width)));
    out
}

#[test]
fn exr_keeps_its_rows_and_columns_whatever_its_layout() {
    for (encoding, half) in [(LINES, false), (ZIP, true), (TILES, false), (TILES, true)] {
        let (map, repairs) = load("sky.exr", &ramp_exr(8, 4, encoding, half)).unwrap();
        assert_eq!((map.width, map.height, map.name.as_str()), (8, 4, "sky.exr"));
        assert_eq!((map.rotation, map.scale), (0.0, [1.0; 3]));
        assert!(repairs.is_empty(), "{repairs:?}");
        // The right half of the picture is where x is large, its upper edge comes first.
        for (i, texel) in map.texels.iter().enumerate() {
            assert_eq!(*texel, ramp(i % 8, i / 8));
        }
    }
}

#[test]
fn luminance_alone_is_grey_and_colour_is_preferred() {
    let y: Stated<'_> = ("Y", &|x, _| x as f32);
    let (map, _) = load("sky.exr", &exr_of(4, 2, LINES, &[y], false)).unwrap();
    assert_eq!(map.texels[3], [3.0; 3]);
    let channel: &dyn Fn(usize, usize) -> f32 = &|_, _| 7.0;
    let all = [("R", channel), ("G", channel), ("B", channel), y];
    let (map, _) = load("sky.exr", &exr_of(4, 2, LINES, &all, false)).unwrap();
    assert_eq!(map.texels[3], [7.0; 3]);
    let error = load("sky.exr", &exr_of(4, 2, LINES, &[("depth.Z", channel)], false)).unwrap_err();
    assert!(matches!(error, LoadError::Unsupported { .. }), "{error}");
    assert!(error.to_string().contains("channels R, G and B"));
}

#[test]
fn the_first_layer_with_colours_is_taken() {
    let layer = |name: &str, names: [&str; 3], value: f32| {
        let list = names.iter().map(|n| AnyChannel::new(*n, FlatSamples::F32(vec![value; 8]))).collect();
        Layer::new((4, 2), LayerAttributes::named(name), LINES, AnyChannels::sort(list))
    };
    let layers = [
        layer("normals", ["X", "Y", "Z"], 1.0),
        layer("light", ["R", "G", "B"], 2.0),
        layer("more", ["R", "G", "B"], 3.0),
    ];
    let write = |primaries: Option<f32>| {
        let mut attributes = ImageAttributes::new(IntegerBounds::from_dimensions((4, 2)));
        attributes.chromaticities = primaries.map(|red| attribute::Chromaticities {
            red: Vec2(red, 0.33),
            green: Vec2(0.3, 0.6),
            blue: Vec2(0.15, 0.06),
            white: Vec2(0.3127, 0.329),
        });
        let mut out = Cursor::new(Vec::new());
        let image = Image::from_layers(attributes, Vec::from(layers.clone()));
        image.write().non_parallel().to_buffered(&mut out).unwrap();
        out.into_inner()
    };
    let (map, repairs) = load("sky.exr", &write(None)).unwrap();
    assert_eq!(map.texels[..], [[2.0; 3]; 8]);
    assert!(repairs.is_empty());
    assert!(load("sky.exr", &write(Some(0.64))).unwrap().1.is_empty());
    let (_, repairs) = load("sky.exr", &write(Some(0.7))).unwrap();
    assert!(repairs.len() == 1 && repairs[0].what.contains("Rec.709"), "{repairs:?}");
}

#[test]
fn radiance_pictures_are_decoded_and_exposure_is_undone() {
    // A mantissa of 128 with an exponent of 129 is 1.
    let texel = |x: usize, y: usize| [128, if x == 3 { 64 } else { 0 }, 0, 129 + y as u8];
    for signature in ["#?RADIANCE\nFORMAT=32-bit_rle_rgbe", "#?RGBE\nFORMAT=32-bit_rle_rgbe"] {
        let (map, repairs) = load("sky.hdr", &hdr_of(4, 2, signature, texel)).unwrap();
        assert!(repairs.is_empty());
        assert_eq!((map.width, map.height), (4, 2));
        assert_eq!(map.texels[0], [1.0, 0.0, 0.0]);
        assert_eq!(map.texels[7], [2.0, 1.0, 0.0]);
    }
    let header = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\nEXPOSURE=4";
    assert_eq!(load("sky.hdr", &hdr_of(4, 2, header, texel)).unwrap().0.texels[0], [0.25, 0.0, 0.0]);
    // As the image crate writes it, with run lengths.
    let pixels: Vec<_> = (0..16 * 8).map(|i| image::Rgb([(i % 16) as f32, 0.5, 0.0])).collect();
    let mut out = Vec::new();
    image::codecs::hdr::HdrEncoder::new(&mut out).encode(&pixels, 16, 8).unwrap();
    let (map, _) = load("sky.hdr", &out).unwrap();
    assert_eq!(map.texels[16 + 15], [15.0, 0.5, 0.0]);
    let error = load("sky.hdr", &hdr_of(4, 2, "#?RADIANCE\nFORMAT=32-bit_rle_xyze", texel)).unwrap_err();
    assert!(matches!(error, LoadError::Unsupported { .. }));
    assert!(error.to_string().contains("32-bit_rle_xyze"), "{error}");
}

#[test]
fn broken_texels_and_odd_sizes_are_mended_and_counted() {
    let odd = |x: usize, y: usize| match (x, y) {
        (0, 0) => f32::NAN,
        (1, 0) => -1.0,
        (2, 1) => f32::INFINITY,
        (3, 0) => -0.0,
        _ => 2.0,
    };
    let bytes = exr_of(4, 3, LINES, &[("R", &odd), ("G", &|_, _| 5.0), ("B", &odd)], false);
    let (map, repairs) = load("sky.exr", &bytes).unwrap();
    assert_eq!(map.texels[..3], [[0.0, 5.0, 0.0], [0.0, 5.0, 0.0], [2.0, 5.0, 2.0]]);
    assert!(map.texels.iter().flatten().all(|c| c.is_finite() && *c >= 0.0));
    assert_eq!(repairs.len(), 2);
    assert_eq!((repairs[0].count, repairs[0].what.contains("negative")), (3, true));
    assert!(repairs[1].what.contains("4x3"), "{repairs:?}");
}

#[test]
fn other_files_are_refused_with_advice() {
    let png = crate::support::png(&[[1; 4]; 4]);
    for (name, bytes, parts) in [
        ("a.png", &png[..], ["PNG picture holds no radiance", "OpenEXR"]),
        ("a.jpg", &[0xFF, 0xD8, 0xFF, 0xE0], ["JPEG picture", "Radiance"]),
        ("a.exr", b"text", ["neither OpenEXR nor Radiance", ".hdr"]),
        ("a.hdr", b"", ["neither", ".exr"]),
    ] {
        let error = load(name, bytes).unwrap_err().to_string();
        assert!(error.contains(name) && parts.iter().all(|part| error.contains(part)), "{error}");
    }
    let missing = load_environment("nowhere/sky.exr".as_ref(), &LoadOptions::default()).unwrap_err();
    assert!(matches!(missing, LoadError::Io { .. }));
}

#[test]
fn limits_are_kept_before_anything_is_allocated() {
    let bytes = ramp_exr(8, 4, ZIP, false);
    let refused = |bytes: &[u8], options: LoadOptions, part: &str| {
        let error = load_bytes("sky.exr", bytes, &options).unwrap_err();
        assert!(matches!(error, LoadError::Limit { .. }), "{error}");
        assert!(error.to_string().contains(part), "{error}");
    };
    refused(&bytes, LoadOptions { max_texture_dimension: 7, ..Default::default() }, "8x4");
    refused(&bytes, LoadOptions { max_texture_pixels: 31, ..Default::default() }, "8x4");
    refused(&bytes, LoadOptions { max_memory_bytes: 1000, ..Default::default() }, "memory limit");
    refused(&bytes, LoadOptions { max_file_bytes: 100, ..Default::default() }, "limit for one file");
    let header = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe";
    let huge = format!("{header}\n\n-Y 16384 +X 16384\n");
    refused(huge.as_bytes(), LoadOptions { max_memory_bytes: 1 << 30, ..Default::default() }, "memory limit");
    let huge = format!("{header}\n\n-Y 4000000 +X 4000000\n");
    refused(huge.as_bytes(), LoadOptions::default(), "4000000x4000000");
    // Headers of small files that state a large data window.
    let enlarge = |bytes: &mut [u8], last: u32, chunks: u32| {
        let at = bytes.windows(10).position(|window| window == b"dataWindow").unwrap();
        let most = at + b"dataWindow\0box2i\0".len() + 4 + 8;
        bytes[most..most + 8].copy_from_slice(&[last.to_le_bytes(), last.to_le_bytes()].concat());
        let at = bytes.windows(10).position(|window| window == b"chunkCount").unwrap();
        let count = at + b"chunkCount\0int\0".len() + 4;
        bytes[count..count + 4].copy_from_slice(&chunks.to_le_bytes());
    };
    let mut huge = ramp_exr(8, 4, LINES, false);
    enlarge(&mut huge, 0xF_FFFF, 0x10_0000);
    refused(&huge, LoadOptions::default(), "1048576x1048576");
    enlarge(&mut huge, 0x3FFF_FFFF, 1);
    assert!(load("sky.exr", &huge).unwrap_err().to_string().contains("cannot be read"));
    enlarge(&mut huge, 16383, 16384);
    refused(&huge, LoadOptions { max_memory_bytes: 1 << 30, ..Default::default() }, "memory limit");
    // As many tiles as texels, each with a record.
    let mut tiles = ramp_exr(8, 4, TILES, false);
    let at = tiles.windows(14).position(|window| window == b"tiles\0tiledesc").unwrap();
    let size = at + b"tiles\0tiledesc\0".len() + 4;
    tiles[size..size + 8].copy_from_slice(&[1, 0, 0, 0, 1, 0, 0, 0]);
    enlarge(&mut tiles, 16383, 16384 * 16384);
    refused(&tiles, LoadOptions::default(), "memory limit");
}

#[test]
fn damaged_files_never_panic() {
    let texel = |x: usize, y: usize| [128, x as u8, y as u8, 129];
    let mut run_lengths = Vec::new();
    let pixels: Vec<_> = (0..16 * 8).map(|i| image::Rgb([(i % 16) as f32, 0.5, 0.0])).collect();
    image::codecs::hdr::HdrEncoder::new(&mut run_lengths).encode(&pixels, 16, 8).unwrap();
    let compressed = |compression| Encoding { compression, ..ZIP };
    let tiled = |compression| Encoding { compression, ..TILES };
    let files = [
        ramp_exr(8, 4, LINES, false),
        ramp_exr(16, 8, ZIP, true),
        ramp_exr(16, 8, compressed(Compression::RLE), false),
        ramp_exr(16, 8, compressed(Compression::PIZ), true),
        ramp_exr(16, 8, compressed(Compression::PXR24), false),
        ramp_exr(16, 8, compressed(Compression::B44), true),
        ramp_exr(16, 8, tiled(Compression::ZIP1), false),
        ramp_exr(16, 8, tiled(Compression::PIZ), true),
        hdr_of(8, 4, "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\nEXPOSURE=2", texel),
        run_lengths,
    ];
    let options = LoadOptions { max_memory_bytes: 64 << 20, ..Default::default() };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sky");
    let mut seed = 7u64;
    let mut below = |bound: usize| {
        // Knuth's MMIX generator.
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 33) as usize % bound
    };
    for (kind, whole) in files.iter().enumerate() {
        let (mut loaded, mut refused) = (0, 0);
        for round in 0..300 {
            let mut bytes = whole.clone();
            match round % 4 {
                0 => bytes.truncate(below(bytes.len())),
                1 => {
                    let at = below(bytes.len());
                    bytes[at] = [0, 1, 0x7F, 0x80, 0xFF][below(5)];
                }
                _ => {
                    for _ in 0..1 + below(4) {
                        let at = below(bytes.len());
                        bytes[at] ^= 1 << below(8);
                    }
                }
            }
            fs::write(&path, &bytes).unwrap();
            match load_environment(&path, &options) {
                Ok((map, _)) => {
                    assert_eq!(map.texels.len(), map.width as usize * map.height as usize);
                    assert!(map.texels.iter().flatten().all(|c| c.is_finite() && *c >= 0.0));
                    loaded += 1;
                }
                Err(error) => {
                    assert!(error.to_string().contains("sky"), "{error}");
                    refused += 1;
                }
            }
        }
        assert!(loaded > 0 && refused > 0, "file {kind}: {loaded} {refused}");
    }
}
