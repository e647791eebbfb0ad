//! Layers as multi-layer EXR files, out and in.
//!
//! Written: one part, scan lines, 32-bit FLOAT, ZIP (16 lines a block), channels in alphabetical order as the format
//! demands; row 0 on top. The file appears complete or not at all: it is written under a temporary name in the same
//! folder, synced and renamed.
//!
//! Read: any flat EXR that holds `cost.*` channels, by whatever software: half and unsigned channels are converted,
//! several parts are merged, tiles and all compressions that the `exr` crate decodes are taken, of mip maps the largest
//! level. Sizes are checked against [`Limits`] before anything is allocated for pixels.

use crate::error::{Error, Result};
use crate::layers::Layers;
use exr::block::UncompressedBlock;
use exr::block::writer::ChunksWriter;
use exr::image::write::layers::{LayersWriter, WritableLayers};
use exr::prelude::{
    AnyChannel, AnyChannels, AttributeValue, Blocks, Compression, Encoding, FlatSamples, Image, Layer,
    LayerAttributes, LineOrder, ReadChannels, ReadLayers, Text,
};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, BufWriter, Read, Seek, Write};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

/// Prefix of this project's own header attributes.
const PREFIX: &str = "hotspot:";

/// What the file says besides its pixels.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Header {
    /// `samplesPerPixel`.
    pub samples_per_pixel: Option<u32>,
    /// `renderTimeSeconds`.
    pub render_seconds: Option<f32>,
    /// `worldToCamera`, as OpenEXR has it: row vectors (p′ = p·M, translation in the last four elements); camera space
    /// left-handed, y up, z forward.
    pub world_to_camera: Option<[f32; 16]>,
    /// `worldToNDC`, row vectors as well; x and y from −1 to 1 over the display window after division by w.
    pub world_to_ndc: Option<[f32; 16]>,
    /// `comments`.
    pub comments: String,
    /// `hotspot:json`: the render's document.
    pub json: String,
    /// Settings by name, stored as `hotspot:<name>`.
    pub settings: BTreeMap<String, String>,
    /// Other text attributes under their own names, such as Cryptomatte's `cryptomatte/…`.
    pub attributes: BTreeMap<String, String>,
}

/// What a file may ask for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Pixels of the picture.
    pub pixels: u64,
    /// Bytes of all channels together, as f32.
    pub bytes: u64,
}

impl Default for Limits {
    /// 2^28 pixels (16384 × 16384) and 8 GiB.
    fn default() -> Self {
        Self { pixels: 1 << 28, bytes: 8 << 30 }
    }
}

/// A file read.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ExrFile {
    /// Its channels. Those of a named part are called `<part>.<channel>`, unless the part's name is already in front.
    pub layers: Layers,
    /// Its header (of the first part).
    pub header: Header,
    /// Parts and channels left out, with the reason.
    pub ignored: Vec<String>,
}

/// Writes `layers` to `path`, replacing what was there only when the new file is complete.
///
/// # Errors
/// [`Error::Io`] when the folder or the file cannot be written; [`Error::Invalid`] without any plane, or when an attribute
/// does not fit the format.
pub fn write(path: &Path, layers: &Layers, header: &Header) -> Result<()> {
    let place = path.display().to_string();
    if layers.planes.is_empty() || layers.pixels() == 0 {
        return Err(Error::invalid(place, "there is nothing to write", "render at least one layer"));
    }
    let io = |source: std::io::Error| Error::Io { action: "write", path: path.to_owned(), source };
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let image = image(layers, header, &place)?;
    let file =
        tempfile::Builder::new().prefix(".hotspot-").suffix(".exr.part").tempfile_in(folder).map_err(io)?;
    let mut writer = BufWriter::new(file);
    write_blocks(&image, &mut writer).map_err(|error| match error {
        exr::error::Error::Io(source) => io(source),
        other => {
            Error::invalid(&place, format!("the picture does not fit the format: {other}"), "report this")
        }
    })?;
    writer.flush().map_err(io)?;
    let file = writer.into_inner().map_err(|error| io(error.into_error()))?;
    allow_reading(file.as_file()).map_err(io)?;
    file.as_file().sync_all().map_err(io)?;
    file.persist(path).map_err(|error| io(error.error))?;
    Ok(())
}

/// Blocks for each thread that are compressed before the next are, and held meanwhile.
const BLOCKS: usize = 4;

/// Compresses and writes all blocks: those of a batch side by side in the caller's thread pool (the library would start one of its own), written
/// in order.
fn write_blocks(
    image: &Image<Layer<AnyChannels<FlatSamples>>>,
    writer: &mut (impl Write + Seek),
) -> exr::error::UnitResult {
    let headers = image.layer_data.infer_headers(&image.attributes);
    let pixels = image.layer_data.create_writer(&headers);
    exr::block::write(writer, headers, true, |meta, chunks| {
        let blocks: Vec<_> = meta.enumerate_ordered_header_block_indices().collect();
        for batch in blocks.chunks(BLOCKS * rayon::current_num_threads()) {
            let compressed: Vec<_> = batch
                .par_iter()
                .map(|&(number, index)| {
                    let data = pixels.extract_uncompressed_block(&meta.headers, index);
                    (number, UncompressedBlock { index, data }.compress_to_chunk(&meta.headers))
                })
                .collect();
            for (number, chunk) in compressed {
                chunks.write_chunk(number, chunk?)?;
            }
        }
        Ok(())
    })
}

/// Temporary files are private to their owner; pictures are as public as other new files commonly are.
fn allow_reading(file: &File) -> std::io::Result<()> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        file.set_permissions(std::fs::Permissions::from_mode(0o644))?;
    }
    #[cfg(not(unix))]
    let _ = file;
    Ok(())
}

fn image(layers: &Layers, header: &Header, place: &str) -> Result<Image<Layer<AnyChannels<FlatSamples>>>> {
    let channels = layers
        .planes
        .iter()
        .map(|(name, plane)| AnyChannel::new(text(name), FlatSamples::F32(plane.clone())));
    let mut attributes = LayerAttributes {
        comments: (!header.comments.is_empty()).then(|| text(&header.comments)),
        world_to_camera: header.world_to_camera,
        world_to_normalized_device: header.world_to_ndc,
        ..LayerAttributes::default()
    };
    let other = &mut attributes.other;
    if let Some(samples) = header.samples_per_pixel {
        let samples = i32::try_from(samples).unwrap_or(i32::MAX);
        other.insert(text("samplesPerPixel"), AttributeValue::I32(samples));
    }
    if let Some(seconds) = header.render_seconds {
        other.insert(text("renderTimeSeconds"), AttributeValue::F32(seconds));
    }
    let own = header.settings.iter().map(|(name, value)| (format!("{PREFIX}{name}"), value));
    let json = (!header.json.is_empty()).then(|| (format!("{PREFIX}json"), &header.json));
    let foreign = header.attributes.iter().map(|(name, value)| (name.clone(), value));
    for (name, value) in own.chain(json).chain(foreign) {
        if name.is_empty() || name.len() > 255 || name.bytes().any(|byte| byte == 0) {
            return Err(Error::invalid(
                place,
                format!("the header cannot hold an attribute named \"{name}\""),
                "use a name of 1 to 255 bytes",
            ));
        }
        other.insert(text(&name), AttributeValue::Text(text(value)));
    }
    let encoding = Encoding {
        compression: Compression::ZIP16,
        blocks: Blocks::ScanLines,
        line_order: LineOrder::Increasing,
    };
    let size = (layers.width as usize, layers.height as usize);
    Ok(Image::from_layer(Layer::new(size, attributes, encoding, AnyChannels::sort(channels.collect()))))
}

/// UTF-8, as OpenEXR recommends; the crate's own conversion takes Latin-1 alone.
fn text(string: &str) -> Text {
    Text::from_slice_unchecked(string.as_bytes())
}

fn string(text: &Text) -> String {
    String::from_utf8_lossy(text.as_slice()).into_owned()
}

/// Reads a file with all its channels.
///
/// # Errors
/// [`Error::Io`] when it cannot be opened or read, [`Error::Invalid`] when it is damaged or no EXR file,
/// [`Error::Unsupported`] when it holds deep pixels alone or a compression without decoder, [`Error::Limit`] when it is
/// larger than `limits`.
pub fn read(path: &Path, limits: &Limits) -> Result<ExrFile> {
    let file =
        File::open(path).map_err(|source| Error::Io { action: "open", path: path.to_owned(), source })?;
    read_from(BufReader::new(file), path, limits)
}

fn read_from(source: impl Read + Seek, path: &Path, limits: &Limits) -> Result<ExrFile> {
    let place = path.display().to_string();
    // The decoder returns errors for the damage it foresees; for what it does not, a panic must not pass.
    catch_unwind(AssertUnwindSafe(|| decode(source, path, &place, limits))).unwrap_or_else(|_| {
        Err(Error::invalid(&place, "the file is damaged: its decoder gave up", "write it again"))
    })
}

fn decode(source: impl Read + Seek, path: &Path, place: &str, limits: &Limits) -> Result<ExrFile> {
    let convert = |error: exr::error::Error| match error {
        exr::error::Error::Io(source) if source.kind() != std::io::ErrorKind::UnexpectedEof => {
            Error::Io { action: "read", path: path.to_owned(), source }
        }
        exr::error::Error::NotSupported(what) => {
            Error::unsupported(place, what, "save it as flat scan lines with ZIP compression")
        }
        other => Error::invalid(place, format!("it does not read as EXR: {other}"), "write it again"),
    };
    let chunks = exr::block::read(source, false).map_err(convert)?;
    check(chunks.headers(), place, limits)?;
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .non_parallel()
        .from_chunks(chunks)
        .map_err(convert)?;
    let mut file = ExrFile::default();
    for (index, layer) in image.layer_data.into_iter().enumerate() {
        let size = (layer.size.width(), layer.size.height());
        if index == 0 {
            // `check` has seen that both fit.
            file.layers = Layers::new(size.0 as u32, size.1 as u32);
            file.header = header(&layer.attributes);
        }
        let part = layer.attributes.layer_name.as_ref().map(string).unwrap_or_default();
        if size != (file.layers.width as usize, file.layers.height as usize) {
            file.ignored
                .push(format!("part \"{part}\": {} × {} differs from the first part", size.0, size.1));
            continue;
        }
        for channel in layer.channel_data.list {
            let name = string(&channel.name);
            let name = if index == 0 || part.is_empty() || name.starts_with(&format!("{part}.")) {
                name
            } else {
                format!("{part}.{name}")
            };
            let plane = match channel.sample_data {
                FlatSamples::F32(values) => values,
                FlatSamples::F16(values) => values.into_iter().map(exr::prelude::f16::to_f32).collect(),
                FlatSamples::U32(values) => values.into_iter().map(|value| value as f32).collect(),
            };
            if file.layers.planes.contains_key(&name) {
                file.ignored.push(format!("channel \"{name}\": there are two of that name"));
            } else if plane.len() == file.layers.pixels() {
                file.layers.planes.insert(name, plane);
            } else {
                file.ignored.push(format!("channel \"{name}\": its size differs from the picture's"));
            }
        }
    }
    Ok(file)
}

/// Refuses what is too large, before pixels are read.
fn check(headers: &[exr::meta::header::Header], place: &str, limits: &Limits) -> Result<()> {
    let mut bytes = 0_u64;
    for header in headers {
        if header.deep {
            return Err(Error::unsupported(place, "it holds deep pixels", "flatten it first"));
        }
        let (width, height) = (header.layer_size.width() as u64, header.layer_size.height() as u64);
        let pixels = width.saturating_mul(height);
        if pixels == 0 || header.channels.list.is_empty() {
            return Err(Error::invalid(place, "it holds no pixels", "write it again"));
        }
        if pixels > limits.pixels || width > u64::from(u32::MAX) || height > u64::from(u32::MAX) {
            return Err(Error::Limit {
                place: place.to_owned(),
                what: format!("{width} × {height} pixels are more than the limit of {}", limits.pixels),
                advice: "crop or scale it down".to_owned(),
            });
        }
        if let Some(channel) =
            header.channels.list.iter().find(|channel| channel.sampling != exr::math::Vec2(1, 1))
        {
            return Err(Error::unsupported(
                place,
                format!("channel \"{}\" is subsampled", string(&channel.name)),
                "save it with one value for each pixel",
            ));
        }
        bytes = bytes.saturating_add(pixels.saturating_mul(4 * header.channels.list.len() as u64));
    }
    if bytes > limits.bytes {
        return Err(Error::Limit {
            place: place.to_owned(),
            what: format!("its channels take {bytes} bytes, more than the limit of {}", limits.bytes),
            advice: "drop channels that are not needed".to_owned(),
        });
    }
    Ok(())
}

fn header(attributes: &LayerAttributes) -> Header {
    let mut header = Header {
        comments: attributes.comments.as_ref().map(string).unwrap_or_default(),
        world_to_camera: attributes.world_to_camera,
        world_to_ndc: attributes.world_to_normalized_device,
        ..Header::default()
    };
    for (name, value) in &attributes.other {
        let name = string(name);
        match (name.as_str(), value) {
            ("samplesPerPixel", AttributeValue::I32(value)) => {
                header.samples_per_pixel = u32::try_from(*value).ok();
            }
            ("samplesPerPixel", AttributeValue::F32(value)) => header.samples_per_pixel = Some(*value as u32),
            ("renderTimeSeconds", AttributeValue::F32(value)) => header.render_seconds = Some(*value),
            (_, AttributeValue::Text(value)) => match name.strip_prefix(PREFIX) {
                Some("json") => header.json = string(value),
                Some(setting) => {
                    header.settings.insert(setting.to_owned(), string(value));
                }
                None => {
                    header.attributes.insert(name, string(value));
                }
            },
            _ => {}
        }
    }
    header
}

#[cfg(test)]
mod tests;
