//! Environment maps from files: equirectangular OpenEXR and Radiance HDR.

use std::cell::RefCell;
use std::io::Cursor;
use std::path::Path;

use exr::block::reader::Reader;
use exr::meta::BlockDescription;
use exr::meta::header::Header;
use exr::prelude::{ReadChannels, ReadLayers, ReadSpecificChannel, Vec2};
use image::ImageDecoder;
use image::codecs::hdr::HdrDecoder;

use crate::budget::{Budget, room_for};
use crate::error::{LoadError, Result, invalid, limit, unsupported};
use crate::files;
use crate::notes::Notes;
use crate::options::LoadOptions;
use crate::scene::{EnvironmentMap, Repair};

/// x and y of red, green, blue and white (ITU-R BT.709).
const REC709: [[f32; 2]; 4] = [[0.64, 0.33], [0.3, 0.6], [0.15, 0.06], [0.3127, 0.329]];

const DAMAGED: &str = "the file is damaged or cut short: copy or export it again";

/// Loads an equirectangular picture of radiance, recognised by content: OpenEXR (scan lines or tiles; of its first layer
/// with channels R, G, B, else of its first with a luminance Y) or Radiance HDR (RGBE; divided by its EXPOSURE, as the
/// format asks for). It comes unrotated and unscaled; which way it lies is said at [`EnvironmentMap`].
///
/// Texels that are negative, NaN or infinite in some channel are given 0 there and counted among the repairs. A picture that
/// is not twice as wide as high is taken for one all the same, and one of other primaries for Rec.709; both are noted there.
///
/// # Errors
/// [`LoadError`] names the file and what to do: where it cannot be read, is damaged, is another kind of file (PNG and JPEG
/// hold no radiance), or asks for more than `options` grants (`max_file_bytes`, `max_texture_dimension`,
/// `max_texture_pixels`, `max_memory_bytes`).
pub fn load_environment(
    path: &Path,
    options: &LoadOptions,
) -> std::result::Result<(EnvironmentMap, Vec<Repair>), LoadError> {
    read(path, options).map_err(|error| error.in_file(path))
}

/// Texels in rows from the top.
struct Picture {
    width: usize,
    height: usize,
    texels: Vec<[f32; 3]>,
}

fn read(path: &Path, options: &LoadOptions) -> Result<(EnvironmentMap, Vec<Repair>)> {
    let budget = Budget::new(options.max_memory_bytes);
    let bytes = files::read(path, options.max_file_bytes, &budget, "")?;
    let mut notes = Notes::default();
    let Picture { width, height, mut texels } = if bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01]) {
        open_exr(&bytes, options, &budget, &mut notes)?
    } else if bytes.starts_with(b"#?") {
        radiance(&bytes, options, &budget)?
    } else if let Ok(format) = image::guess_format(&bytes) {
        return Err(unsupported(
            "",
            format!("a {} picture holds no radiance, so it cannot light a scene", kind(format)),
            "use an equirectangular OpenEXR (.exr) or Radiance (.hdr) file",
        ));
    } else {
        return Err(unsupported(
            "",
            "this is neither OpenEXR nor Radiance HDR",
            "use an equirectangular .exr or .hdr file",
        ));
    };
    let mut broken = 0u64;
    for texel in &mut texels {
        let mended = texel.map(|c| if c.is_finite() { c.max(0.0) } else { 0.0 });
        // -0 is no fault.
        broken += u64::from(texel.iter().any(|c| !(c.is_finite() && *c >= 0.0)));
        *texel = mended;
    }
    notes.repair("negative, NaN or infinite texels set to 0", "", broken);
    if width != 2 * height {
        let what = format!("picture of {width}x{height} texels stretched to twice as wide as high");
        notes.repair(&what, "", 1);
    }
    // The copy into shared memory.
    budget.charge(texels.len() as u64, 12, "")?;
    let map = EnvironmentMap {
        name: path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned()),
        // Within the limit, which is a u32.
        width: width as u32,
        height: height as u32,
        texels: texels.into(),
        rotation: 0.0,
        scale: [1.0; 3],
    };
    Ok((map, notes.into_lists().1))
}

fn kind(format: image::ImageFormat) -> String {
    let extension = format.extensions_str().first().copied().unwrap_or_default();
    if extension == "jpg" { "JPEG".into() } else { extension.to_uppercase() }
}

/// Checks a size that a header states, and announces `bytes` a texel.
fn check_size(width: usize, height: usize, bytes: u64, options: &LoadOptions, budget: &Budget) -> Result<()> {
    let most = options.max_texture_dimension;
    let fits = width.max(height) <= most as usize;
    let texels = (width as u64).saturating_mul(height as u64);
    if !fits || texels > options.max_texture_pixels {
        return Err(limit(
            "",
            format!(
                "the picture has {width}x{height} texels, the limit is {most} per side and {} in all",
                options.max_texture_pixels
            ),
            "use a smaller picture",
        ));
    }
    if texels == 0 {
        return Err(invalid("", format!("the picture has {width}x{height} texels"), DAMAGED));
    }
    budget.charge(texels, bytes, "")
}

fn radiance(bytes: &[u8], options: &LoadOptions, budget: &Budget) -> Result<Picture> {
    let broken = |error: image::ImageError| match error {
        image::ImageError::Unsupported(error) => {
            unsupported("", format!("the HDR file cannot be read ({error})"), "convert it to OpenEXR")
        }
        error => invalid("", format!("the HDR file cannot be read ({error})"), DAMAGED),
    };
    // Not strict: the strict mode knows one of the two usual first lines.
    let decoder = HdrDecoder::new_nonstrict(Cursor::new(bytes)).map_err(broken)?;
    let metadata = decoder.metadata();
    let (width, height) = (metadata.width as usize, metadata.height as usize);
    // As bytes and as texels.
    check_size(width, height, 24, options, budget)?;
    let count = width * height;
    let mut decoded = room_for(12 * count, "")?;
    decoded.resize(12 * count, 0);
    decoder.read_image(&mut decoded).map_err(broken)?;
    let exposure = metadata.exposure.filter(|e| e.is_finite() && *e > 0.0).unwrap_or(1.0);
    let mut texels = room_for(count, "")?;
    texels.extend(decoded.as_chunks::<12>().0.iter().map(|texel| {
        let (channels, _) = texel.as_chunks::<4>();
        std::array::from_fn(|c| channels.get(c).map_or(0.0, |bytes| f32::from_ne_bytes(*bytes)) / exposure)
    }));
    Ok(Picture { width, height, texels })
}

fn open_exr(bytes: &[u8], options: &LoadOptions, budget: &Budget, notes: &mut Notes) -> Result<Picture> {
    let reader = exr::block::read(Cursor::new(bytes), false).map_err(broken_exr)?;
    let has = |header: &Header, names: &[&str]| {
        let stated = &header.channels.list;
        !header.deep && names.iter().all(|name| stated.iter().any(|channel| channel.name.eq(name)))
    };
    let first = |names: &[&str]| reader.headers().iter().find(|header| has(header, names));
    let (header, is_color) = match (first(&["R", "G", "B"]), first(&["Y"])) {
        (Some(header), _) => (header, true),
        (None, Some(header)) => (header, false),
        _ => {
            return Err(unsupported(
                "",
                "no layer of the OpenEXR file has channels R, G and B, or Y",
                "export the picture with the channels R, G and B",
            ));
        }
    };
    let Vec2(width, height) = header.layer_size;
    let display = header.shared_attributes.display_window;
    let cropped =
        display.size != header.layer_size || display.position != header.own_attributes.layer_position;
    notes.repair("data window of the picture taken for the whole", "", u64::from(cropped));
    let foreign = header.shared_attributes.chromaticities.as_ref().is_some_and(|stated| {
        let stated = [stated.red, stated.green, stated.blue, stated.white].map(|Vec2(x, y)| [x, y]);
        stated.iter().flatten().zip(REC709.iter().flatten()).any(|(got, wanted)| (got - wanted).abs() > 2e-3)
    });
    notes.repair("colours of other primaries taken for Rec.709", "", u64::from(foreign && is_color));
    check_size(width, height, 12, options, budget)?;
    for header in reader.headers() {
        charge_blocks(header, budget)?;
    }
    let mut texels = room_for(width * height, "")?;
    texels.resize(width * height, [0.0f32; 3]);
    let texels = if is_color { color(reader, texels) } else { grey(reader, texels) }.map_err(broken_exr)?;
    if texels.len() != width * height {
        return Err(invalid("", "the OpenEXR file contradicts its header", DAMAGED));
    }
    Ok(Picture { width, height, texels })
}

fn broken_exr(error: exr::error::Error) -> LoadError {
    match error {
        exr::error::Error::NotSupported(what) => unsupported(
            "",
            format!("the OpenEXR file cannot be read ({what})"),
            "export it with ZIP compression",
        ),
        error => invalid("", format!("the OpenEXR file cannot be read ({error})"), DAMAGED),
    }
}

/// Announces what the decoder holds for a layer: a record for each of its blocks, also of those that are not read, and a block
/// while it is decompressed.
fn charge_blocks(header: &Header, budget: &Budget) -> Result<()> {
    let Vec2(width, height) = header.layer_size;
    let Vec2(block_width, block_height) = match &header.blocks {
        BlockDescription::ScanLines => Vec2(width, header.compression.scan_lines_per_block()),
        BlockDescription::Tiles(tiles) => tiles.tile_size,
    };
    let blocks = |size: usize, block: usize| size.div_ceil(block.max(1)).max(1) as u64;
    // Smaller versions take up to three times as much again, where both sides shrink on their own.
    let levels = if matches!(header.blocks, BlockDescription::ScanLines) { 1 } else { 4 };
    let count =
        blocks(width, block_width).saturating_mul(blocks(height, block_height)).saturating_mul(levels);
    budget.charge(count.saturating_add(64), 128, "")?;
    let texels = (block_width.min(width) as u64).saturating_mul(block_height.min(height) as u64);
    budget.charge(texels.saturating_mul(header.channels.bytes_per_pixel as u64), 4, "")
}

type Bytes<'b> = Reader<Cursor<&'b [u8]>>;

fn color(reader: Bytes<'_>, texels: Vec<[f32; 3]>) -> exr::error::Result<Vec<[f32; 3]>> {
    let texels = RefCell::new(texels);
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .specific_channels()
        .required("R")
        .required("G")
        .required("B")
        .collect_pixels(
            |size: Vec2<usize>, _: &_| (size.width(), texels.take()),
            |store, at, (r, g, b): (f32, f32, f32)| set(store, at, [r, g, b]),
        )
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_chunks(reader)?;
    Ok(image.layer_data.channel_data.pixels.1)
}

fn grey(reader: Bytes<'_>, texels: Vec<[f32; 3]>) -> exr::error::Result<Vec<[f32; 3]>> {
    let texels = RefCell::new(texels);
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .specific_channels()
        .required("Y")
        .collect_pixels(
            |size: Vec2<usize>, _: &_| (size.width(), texels.take()),
            |store, at, (y,): (f32,)| set(store, at, [y; 3]),
        )
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_chunks(reader)?;
    Ok(image.layer_data.channel_data.pixels.1)
}

/// Sets a texel of a picture and its width.
fn set((width, texels): &mut (usize, Vec<[f32; 3]>), Vec2(x, y): Vec2<usize>, texel: [f32; 3]) {
    if let Some(slot) = texels.get_mut(y * *width + x) {
        *slot = texel;
    }
}
