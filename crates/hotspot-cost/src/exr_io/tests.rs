use super::*;
use crate::testing::random_frame;
use crate::{FrameDesc, LayerOptions};
use exr::prelude::{Vec2, WritableImage, f16};

fn sample() -> (Layers, Header) {
    let frame = random_frame(FrameDesc { intervals: true, ..FrameDesc::new(37, 19) }, 2, 3);
    let mut layers = Layers::from_frame(&frame, &LayerOptions { var: true, ..LayerOptions::default() });
    layers.insert("CryptoObject00.r", vec![f32::from_bits(0x1234_5678); 37 * 19]);
    let header = Header {
        samples_per_pixel: Some(4),
        render_seconds: Some(1.25),
        world_to_camera: Some(std::array::from_fn(|index| index as f32)),
        world_to_ndc: Some(std::array::from_fn(|index| -(index as f32))),
        comments: "Möbel, 木".to_owned(),
        json: format!("{{\"schema\": \"hotspot-render/1\", \"scene\": \"{}\"}}", "ü".repeat(100_000)),
        settings: [("max-depth".to_owned(), "15".to_owned())].into(),
        attributes: [("cryptomatte/abc/name".to_owned(), "CryptoObject".to_owned())].into(),
    };
    (layers, header)
}

fn folder() -> tempfile::TempDir {
    tempfile::tempdir().unwrap()
}

#[test]
fn what_is_written_is_read_back_bit_for_bit() {
    let folder = folder();
    let path = folder.path().join("a.exr");
    let (layers, header) = sample();
    for _ in 0..2 {
        // The second time it replaces the first.
        write(&path, &layers, &header).unwrap();
    }
    let file = read(&path, &Limits::default()).unwrap();
    assert_eq!(file, ExrFile { layers, header, ignored: Vec::new() });
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "temporary files are left");
}

#[test]
fn the_file_has_the_format_agreed_on() {
    let folder = folder();
    let path = folder.path().join("a.exr");
    let (layers, header) = sample();
    write(&path, &layers, &header).unwrap();
    let chunks = exr::block::read(BufReader::new(File::open(&path).unwrap()), true).unwrap();
    let [header] = chunks.headers() else { panic!("one part") };
    assert_eq!(header.compression, Compression::ZIP16);
    assert_eq!(header.blocks, exr::meta::BlockDescription::ScanLines);
    let names: Vec<String> = header.channels.list.iter().map(|channel| string(&channel.name)).collect();
    let mut sorted = names.clone();
    sorted.sort();
    assert_eq!(names, sorted);
    assert!(
        header
            .channels
            .list
            .iter()
            .all(|channel| channel.sample_type == exr::meta::attribute::SampleType::F32)
    );
    for name in ["R", "G", "B", "A", "samples", "cost.nodes_shadow", "half.red", "cause.roulette"] {
        assert!(names.contains(&name.to_owned()), "{name}");
    }
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        assert_eq!(path.metadata().unwrap().permissions().mode() & 0o777, 0o644);
    }
}

#[test]
fn errors_name_the_file() {
    let folder = folder();
    let path = folder.path().join("missing").join("a.exr");
    let (layers, header) = sample();
    let error = write(&path, &layers, &header).unwrap_err();
    assert!(
        matches!(error, Error::Io { action: "write", .. }) && error.to_string().contains("a.exr"),
        "{error}"
    );
    let error = read(&path, &Limits::default()).unwrap_err();
    assert!(
        matches!(error, Error::Io { action: "open", .. }) && error.to_string().contains("a.exr"),
        "{error}"
    );
    let path = folder.path().join("b.exr");
    assert!(matches!(write(&path, &Layers::new(3, 3), &header), Err(Error::Invalid { .. })));
    let long = Header { settings: [("x".repeat(300), String::new())].into(), ..header };
    assert!(matches!(write(&path, &layers, &long), Err(Error::Invalid { .. })));
    assert!(!path.exists());
}

#[test]
fn limits_hold_before_pixels_are_read() {
    let folder = folder();
    let path = folder.path().join("a.exr");
    let (layers, header) = sample();
    write(&path, &layers, &header).unwrap();
    let bytes = 37 * 19 * 4 * layers.planes.len() as u64;
    assert!(read(&path, &Limits { pixels: 37 * 19, bytes }).is_ok());
    for limits in [Limits { pixels: 37 * 19 - 1, bytes }, Limits { pixels: 37 * 19, bytes: bytes - 1 }] {
        assert!(matches!(read(&path, &limits), Err(Error::Limit { .. })));
    }
}

#[test]
fn damaged_files_never_panic() {
    let folder = folder();
    let path = folder.path().join("a.exr");
    let mut layers = Layers::new(20, 20);
    layers.insert("cost.nodes", (0..400).map(|index| (index * index) as f32).collect());
    layers.insert("R", vec![0.5; 400]);
    write(&path, &layers, &Header::default()).unwrap();
    let good = std::fs::read(&path).unwrap();
    let limits = Limits { pixels: 1 << 20, bytes: 1 << 24 };
    let attempt = |bytes: &[u8]| read_from(std::io::Cursor::new(bytes), &path, &limits);
    assert!(attempt(&good).is_ok());
    for length in 0..good.len() {
        let outcome = attempt(&good[..length]);
        assert!(outcome.is_err(), "{length} of {} bytes read as {outcome:?}", good.len());
    }
    for index in 0..good.len() {
        for value in [0x00, 0x7f, 0xff, good[index] ^ 1] {
            let mut bad = good.clone();
            bad[index] = value;
            if let Ok(file) = attempt(&bad) {
                let pixels = file.layers.pixels();
                assert!(file.layers.planes.values().all(|plane| plane.len() == pixels));
            }
        }
    }
    for text in [&b""[..], b"not an EXR file at all", &[0x76, 0x2f, 0x31, 0x01]] {
        assert!(matches!(attempt(text), Err(Error::Invalid { .. })));
    }
}

/// A layer of another program.
fn foreign(name: Option<&str>, size: Vec2<usize>, encoding: Encoding) -> Layer<AnyChannels<FlatSamples>> {
    let count = size.area();
    let channels = vec![
        AnyChannel::new("cost.rays", FlatSamples::F16((0..count).map(|i| f16::from_f32(i as f32)).collect())),
        AnyChannel::new("cost.nodes", FlatSamples::U32((0..count).map(|i| 3 * i as u32).collect())),
        AnyChannel::new("cost.shapes", FlatSamples::F32((0..count).map(|i| 0.5 * i as f32).collect())),
    ];
    let attributes = LayerAttributes { layer_name: name.map(text), ..LayerAttributes::default() };
    Layer::new(size, attributes, encoding, AnyChannels::sort(channels.into_iter().collect()))
}

/// More blocks than are compressed at once, the last of them smaller; as the library writes them one by one.
#[test]
fn blocks_are_written_as_the_library_writes_them() {
    let mut layers = Layers::new(5, 16 * BLOCKS as u32 + 37);
    layers.insert("cost.nodes", (0..layers.pixels()).map(|i| (i * 7919 % 1013) as f32).collect());
    layers.insert("R", (0..layers.pixels()).map(|i| (i as f32).sin()).collect());
    let image = image(&layers, &sample().1, "here").unwrap();
    let mut expected = std::io::Cursor::new(Vec::new());
    image.write().non_parallel().to_buffered(&mut expected).unwrap();
    for threads in [1, 3] {
        let mut found = std::io::Cursor::new(Vec::new());
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| write_blocks(&image, &mut found)).unwrap();
        assert!(found.into_inner() == *expected.get_ref(), "{threads} threads");
    }
}

#[test]
fn other_programs_files_are_read() {
    let folder = folder();
    let path = folder.path().join("a.exr");
    let encodings = [
        Encoding { compression: Compression::Uncompressed, ..Encoding::default() },
        Encoding { compression: Compression::RLE, ..Encoding::default() },
        Encoding { compression: Compression::PIZ, ..Encoding::default() },
        Encoding {
            compression: Compression::ZIP1,
            blocks: Blocks::Tiles(Vec2(16, 16)),
            line_order: LineOrder::Unspecified,
        },
    ];
    for encoding in encodings {
        Image::from_layer(foreign(None, Vec2(21, 18), encoding))
            .write()
            .non_parallel()
            .to_file(&path)
            .unwrap();
        let file = read(&path, &Limits::default()).unwrap();
        assert_eq!((file.layers.width, file.layers.height), (21, 18), "{encoding:?}");
        for (name, factor) in [("cost.rays", 1.0), ("cost.nodes", 3.0), ("cost.shapes", 0.5)] {
            let plane = file.layers.plane(name).unwrap();
            assert!(
                plane.iter().enumerate().all(|(i, value)| *value == factor * i as f32),
                "{encoding:?} {name}"
            );
        }
        assert_eq!(file.header, Header::default());
    }
}

#[test]
fn parts_are_merged_and_what_does_not_fit_is_named() {
    let folder = folder();
    let path = folder.path().join("a.exr");
    let part = |name, width| foreign(Some(name), Vec2(width, 4), Encoding::default());
    let layers = [part("main", 5), part("left", 5), part("small", 3)];
    let window = exr::meta::attribute::IntegerBounds::from_dimensions(Vec2(5, 4));
    let attributes = exr::meta::header::ImageAttributes::new(window);
    Image::from_layers(attributes, layers.to_vec()).write().non_parallel().to_file(&path).unwrap();
    let file = read(&path, &Limits::default()).unwrap();
    let names: Vec<&str> = file.layers.planes.keys().map(String::as_str).collect();
    assert_eq!(
        names,
        ["cost.nodes", "cost.rays", "cost.shapes", "left.cost.nodes", "left.cost.rays", "left.cost.shapes"]
    );
    assert_eq!(file.ignored, ["part \"small\": 3 × 4 differs from the first part"]);
}

/// For a look with other software: set `HOTSPOT_EXR_OUT` to a file name.
#[test]
fn a_file_for_other_readers() {
    let Some(path) = std::env::var_os("HOTSPOT_EXR_OUT") else { return };
    let (mut layers, header) = sample();
    layers.insert("cost.ramp", (0..37 * 19).map(|index| index as f32).collect());
    write(Path::new(&path), &layers, &header).unwrap();
}
