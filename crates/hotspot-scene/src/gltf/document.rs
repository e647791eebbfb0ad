//! The parsed file with its buffers: checked access to elements and byte ranges.

use std::borrow::Cow;
use std::cell::OnceCell;

use serde_json::Value;

use super::json::{Element, whole};
use crate::budget::Budget;
use crate::error::{REEXPORT, Result, invalid, limit, unsupported};
use crate::files::{self, Folder};
use crate::notes::Notes;
use crate::options::LoadOptions;
use crate::uri;

/// Parses JSON after estimating from above what the tree will take.
pub(crate) fn parse_json(bytes: &[u8], budget: &Budget, notes: &mut Notes) -> Result<Value> {
    let text = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    notes.repair("byte order mark before the JSON ignored", "", u64::from(text.len() != bytes.len()));
    budget.charge(json_memory(text), 1, "the JSON as a whole")?;
    let value: Value = serde_json::from_slice(text).map_err(|error| {
        invalid(
            format!("line {}, column {}", error.line(), error.column()),
            format!("this is not valid JSON ({error})"),
            "the file is damaged or cut short: copy or export it again",
        )
    })?;
    if value.is_object() {
        Ok(value)
    } else {
        Err(invalid("the JSON as a whole", "this is not an object", "check that the file is glTF 2.0"))
    }
}

/// An upper bound for the parsed tree in bytes. An array element takes 32 bytes, up to twice that while its vector grows;
/// the first entry of an object takes a whole node of a B-tree (below 700 bytes), further ones 56 bytes in nodes at least
/// half full, and an allocation for the key. Text is copied.
fn json_memory(text: &[u8]) -> u64 {
    let mut bytes = text.len() as u64;
    let (mut quoted, mut escaped) = (false, false);
    // A bit for each level, 1 for an object. The parser gives up at 128 levels, so that what is shifted out is not missed.
    let mut levels = 0u128;
    for byte in text {
        match byte {
            _ if escaped => escaped = false,
            b'\\' if quoted => escaped = true,
            b'"' => quoted = !quoted,
            _ if quoted => {}
            b'{' => {
                bytes = bytes.saturating_add(700);
                levels = (levels << 1) | 1;
            }
            b'[' => {
                bytes = bytes.saturating_add(128);
                levels <<= 1;
            }
            b'}' | b']' => levels >>= 1,
            b',' => bytes = bytes.saturating_add(if levels & 1 == 1 { 160 } else { 64 }),
            _ => {}
        }
    }
    bytes
}

/// A glTF file while it loads.
pub(crate) struct Document<'a> {
    pub(crate) root: Element<'a>,
    pub(crate) options: &'a LoadOptions,
    pub(crate) budget: &'a Budget,
    /// KHR_mesh_quantization is in use: positions and normals may be small integers.
    pub(crate) quantized: bool,
    folder: Option<&'a Folder>,
    bin: Option<&'a [u8]>,
    buffers: Vec<OnceCell<Cow<'a, [u8]>>>,
}

/// A range of a buffer.
pub(crate) struct View<'b> {
    pub(crate) bytes: &'b [u8],
    /// Offset within the buffer, for alignment.
    pub(crate) offset: u64,
    pub(crate) stride: Option<u64>,
}

impl<'a> Document<'a> {
    /// Checks version and required extensions. `folder` is where relative URIs lead; `None` refuses them.
    pub(crate) fn new(
        json: &'a Value,
        bin: Option<&'a [u8]>,
        folder: Option<&'a Folder>,
        options: &'a LoadOptions,
        budget: &'a Budget,
    ) -> Result<Self> {
        let root = Element::new(json, String::new());
        check_version(&root)?;
        super::extensions::check_required(&root)?;
        let nodes = root.array("nodes")?.len() as u64;
        if nodes > options.max_nodes {
            return Err(limit(
                "nodes",
                format!("the file has {nodes} nodes, the limit is {}", options.max_nodes),
                "simplify the scene or raise the limit",
            ));
        }
        let uses = |name: &str| -> Result<bool> {
            Ok(root.array("extensionsUsed")?.iter().any(|used| used.as_str() == Some(name)))
        };
        let quantized = uses("KHR_mesh_quantization")?;
        let buffers = root.array("buffers")?.iter().map(|_| OnceCell::new()).collect();
        Ok(Self { root, options, budget, quantized, folder, bin, buffers })
    }

    /// How many elements a top-level array has.
    pub(crate) fn count(&self, key: &str) -> Result<usize> {
        Ok(self.root.array(key)?.len())
    }

    /// The element that member `key` of `element` refers to, in the top-level array `things`.
    pub(crate) fn follow(
        &self,
        element: &Element<'_>,
        key: &str,
        things: &str,
    ) -> Result<Option<(usize, Element<'a>)>> {
        match element.index(key, self.count(things)?, things)? {
            Some(index) => Ok(Some((index, self.root.item(things, index)?))),
            None => Ok(None),
        }
    }

    /// The indices in an array member, each one of the top-level array `things`.
    pub(crate) fn indices(&self, element: &Element<'_>, key: &str, things: &str) -> Result<Vec<usize>> {
        let count = self.count(things)?;
        let check = |(i, value): (usize, &Value)| {
            whole(value).and_then(|n| usize::try_from(n).ok()).filter(|n| *n < count).ok_or_else(|| {
                invalid(
                    format!("{}[{i}]", element.path_of(key)),
                    format!("this is not an index of one of the {count} {things}"),
                    REEXPORT,
                )
            })
        };
        element.array(key)?.iter().enumerate().map(check).collect()
    }

    /// What a URI leads to: embedded data, or a file of the folder.
    pub(crate) fn fetch(&self, uri: &str, element: &str) -> Result<Vec<u8>> {
        if uri::is_data(uri) {
            return uri::decode_data(uri, self.budget, element);
        }
        let name = uri::decode_path(uri, element)?;
        let folder =
            self.folder.ok_or_else(|| files::outside(&name, "a scene in memory has no folder", element))?;
        files::read(&folder.demand(&name, element)?, self.options.max_file_bytes, self.budget, element)
    }

    fn buffer(&self, index: usize) -> Result<&[u8]> {
        let element = self.root.item("buffers", index)?;
        let length =
            element.integer("byteLength")?.ok_or_else(|| element.wrong("byteLength", "this is missing"))?;
        let cell = self.buffers.get(index).ok_or_else(|| element.wrong_here("there is no such buffer"))?;
        let bytes = match cell.get() {
            Some(bytes) => bytes,
            None => {
                let bytes = match (element.string("uri")?, self.bin) {
                    (Some(uri), _) => Cow::Owned(self.fetch(uri, &element.path_of("uri"))?),
                    (None, Some(bin)) if index == 0 => Cow::Borrowed(bin),
                    (None, _) => {
                        return Err(
                            element.wrong_here("the buffer has no uri, and the file holds no data for it")
                        );
                    }
                };
                cell.get_or_init(|| bytes)
            }
        };
        usize::try_from(length).ok().and_then(|length| bytes.get(..length)).ok_or_else(|| {
            invalid(
                element.path_of("byteLength"),
                format!("the buffer claims {length} bytes, its data has {}", bytes.len()),
                "the data is damaged or cut short: copy or export it again",
            )
        })
    }

    /// The bytes of the buffer view that member `key` of `element` refers to.
    pub(crate) fn view(&self, element: &Element<'_>, key: &str) -> Result<Option<View<'_>>> {
        let Some((_, view)) = self.follow(element, key, "bufferViews")? else { return Ok(None) };
        let Some((buffer, _)) = self.follow(&view, "buffer", "buffers")? else {
            return Err(view.wrong("buffer", "this is missing"));
        };
        let bytes = self.buffer(buffer)?;
        let offset = view.integer("byteOffset")?.unwrap_or(0);
        let length =
            view.integer("byteLength")?.ok_or_else(|| view.wrong("byteLength", "this is missing"))?;
        let stride = view.integer("byteStride")?;
        if stride.is_some_and(|stride| !(4..=252).contains(&stride)) {
            return Err(view.wrong("byteStride", "the stride is not in 4 to 252"));
        }
        let range = range(offset, length).and_then(|range| bytes.get(range)).ok_or_else(|| {
            view.wrong_here(format!(
                "bytes {offset} + {length} lie beyond the end of buffers[{buffer}], which has {} bytes",
                bytes.len()
            ))
        })?;
        Ok(Some(View { bytes: range, offset, stride }))
    }
}

/// `offset .. offset + length`, unless that overflows.
pub(crate) fn range(offset: u64, length: u64) -> Option<std::ops::Range<usize>> {
    let end = offset.checked_add(length)?;
    Some(usize::try_from(offset).ok()?..usize::try_from(end).ok()?)
}

fn check_version(root: &Element<'_>) -> Result<()> {
    let remedy = "export the file as glTF 2.0";
    let Some(asset) = root.object("asset")? else {
        return Err(invalid("asset", "this is missing, so the file is not glTF", remedy));
    };
    let Some(version) = asset.string("version")? else {
        return Err(invalid("asset.version", "this is missing, so the file is not glTF", remedy));
    };
    let needed = asset.string("minVersion")?.unwrap_or("2.0");
    if version.split('.').next() != Some("2") || needed != "2.0" {
        let shown = if needed == "2.0" { version } else { needed };
        return Err(unsupported("asset", format!("the file needs glTF {shown}, only 2.0 is known"), remedy));
    }
    Ok(())
}
