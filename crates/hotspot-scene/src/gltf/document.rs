//! The parsed file with its buffers: checked access to byte ranges.

use std::borrow::Cow;
use std::cell::{Cell, OnceCell, RefCell};
use std::collections::HashMap;
use std::rc::Rc;

use gltf::buffer::{Source, View};
use serde_json::Value;

use super::meshopt::Compressed;
use super::schema;
use crate::budget::Budget;
use crate::error::{REEXPORT, Result, invalid, limit, unsupported};
use crate::files::{self, Folder};
use crate::notes::{Notes, cut};
use crate::options::LoadOptions;
use crate::uri;

/// A glTF file while it loads.
pub(crate) struct Document<'a> {
    /// The crate's view of the file: its indices are in range, so following them is safe.
    pub(crate) gltf: gltf::Document,
    pub(crate) options: &'a LoadOptions,
    pub(crate) budget: &'a Budget,
    /// KHR_mesh_quantization is in use: positions and normals may be small integers.
    pub(crate) quantized: bool,
    /// `extras.environment` of each scene.
    pub(crate) environments: Vec<Option<Value>>,
    /// The file's animations, mended; empty where they are not asked for.
    pub(crate) animations: Vec<Value>,
    /// What generating tangents has taken so far.
    pub(crate) tangent_effort: Cell<u64>,
    value: Value,
    folder: Option<&'a Folder>,
    bin: Option<&'a [u8]>,
    buffers: Vec<OnceCell<Cow<'a, [u8]>>>,
    /// Compressed buffer views, once decoded.
    views: Vec<OnceCell<Vec<u8>>>,
    /// Packed data of accessors, decoded from elsewhere than their views.
    provided: RefCell<HashMap<usize, Rc<[u8]>>>,
}

impl<'a> Document<'a> {
    /// Checks version, required extensions, structure and indices. `folder` is where relative URIs lead; `None` refuses
    /// them.
    pub(crate) fn new(
        mut value: Value,
        bin: Option<&'a [u8]>,
        folder: Option<&'a Folder>,
        options: &'a LoadOptions,
        budget: &'a Budget,
        notes: &mut Notes,
    ) -> Result<Self> {
        check_version(&value)?;
        super::extensions::check_required(&value)?;
        let list = |key: &str| value.get(key).and_then(Value::as_array).into_iter().flatten();
        let nodes = list("nodes").count() as u64;
        if nodes > options.max_nodes {
            return Err(limit(
                "nodes",
                format!("the file has {nodes} nodes, the limit is {}", options.max_nodes),
                "simplify the scene or raise the limit",
            ));
        }
        super::extensions::note_unknown(&value, "", None, &[], notes);
        let animations = super::animation::take(&mut value, options, notes)?;
        let list = |key: &str| value.get(key).and_then(Value::as_array).into_iter().flatten();
        let environments =
            list("scenes").map(|scene| scene.pointer("/extras/environment").cloned()).collect();
        schema::mend(&mut value)?;
        let root = schema::interpret(&value, budget)?;
        let quantized = root.extensions_used.iter().any(|used| used == "KHR_mesh_quantization");
        let buffers = root.buffers.iter().map(|_| OnceCell::new()).collect();
        let views = root.buffer_views.iter().map(|_| OnceCell::new()).collect();
        let gltf = gltf::Document::from_json_without_validation(root);
        Ok(Self {
            gltf,
            options,
            budget,
            quantized,
            environments,
            animations,
            tangent_effort: Cell::new(0),
            value,
            folder,
            bin,
            buffers,
            views,
            provided: RefCell::default(),
        })
    }

    /// Numbers of an element of a top-level array as f64, which the crate keeps as f32. `key` may lead through several
    /// members: `perspective.yfov`.
    pub(crate) fn exact<const N: usize>(&self, array: &str, index: usize, key: &str) -> Option<[f64; N]> {
        let element = self.value.get(array)?.get(index)?;
        let numbers: Option<Vec<f64>> = match key.split('.').try_fold(element, |value, key| value.get(key))? {
            Value::Array(items) => items.iter().map(Value::as_f64).collect(),
            value => value.as_f64().map(|number| vec![number]),
        };
        numbers?.try_into().ok()
    }

    /// The mended JSON, for what the crate does not know.
    pub(crate) fn json(&self) -> &Value {
        &self.value
    }

    /// Whether the file says that it cannot be read without an extension.
    pub(crate) fn requires(&self, extension: &str) -> bool {
        let required = self.value.get("extensionsRequired").and_then(Value::as_array);
        required.into_iter().flatten().any(|name| name.as_str() == Some(extension))
    }

    /// A member of an element of a top-level array. `key` may lead through several members: `extensions.ACME_fog`.
    pub(crate) fn member(&self, array: &str, index: usize, key: &str) -> Option<&Value> {
        let element = self.value.get(array)?.get(index)?;
        key.split('.').try_fold(element, |value, key| value.get(key))
    }

    /// The element at a path such as `meshes[1].primitives[0]`.
    pub(crate) fn at(&self, path: &str) -> Option<&Value> {
        schema::at(&self.value, path)
    }

    /// Names the extensions on an element that have no effect here. `known` are those its reader takes care of.
    pub(crate) fn note_unknown(&self, path: &str, name: Option<&str>, known: &[&str], notes: &mut Notes) {
        super::extensions::note_unknown(&self.value, path, name, known, notes);
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

    pub(crate) fn buffer(&self, buffer: &gltf::Buffer<'_>) -> Result<&[u8]> {
        let path = format!("buffers[{}]", buffer.index());
        let length = buffer.length();
        if length == 0 {
            return Err(invalid(format!("{path}.byteLength"), "this is missing or 0", REEXPORT));
        }
        let nothing =
            || invalid(path.as_str(), "the buffer has no uri, and the file holds no data for it", REEXPORT);
        let cell = self.buffers.get(buffer.index()).ok_or_else(nothing)?;
        let bytes = match cell.get() {
            Some(bytes) => bytes,
            None => {
                let bytes = match (buffer.source(), self.bin) {
                    (Source::Uri(uri), _) => Cow::Owned(self.fetch(uri, &format!("{path}.uri"))?),
                    (Source::Bin, Some(bin)) if buffer.index() == 0 => Cow::Borrowed(bin),
                    (Source::Bin, _) => return Err(nothing()),
                };
                cell.get_or_init(|| bytes)
            }
        };
        bytes.get(..length).ok_or_else(|| {
            invalid(
                format!("{path}.byteLength"),
                format!("the buffer claims {length} bytes, its data has {}", bytes.len()),
                "the data is damaged or cut short: copy or export it again",
            )
        })
    }

    /// Sets the packed data of an accessor, in place of what its view holds.
    pub(crate) fn provide(&self, accessor: usize, bytes: Rc<[u8]>) {
        self.provided.borrow_mut().insert(accessor, bytes);
    }

    /// What [`Self::provide`] has set.
    pub(crate) fn provided(&self, accessor: usize) -> Option<Rc<[u8]>> {
        self.provided.borrow().get(&accessor).cloned()
    }

    /// The bytes of a buffer view, decompressed where they are compressed.
    pub(crate) fn view(&self, view: &View<'_>) -> Result<&[u8]> {
        if let (Some(compressed), Some(cell)) =
            (Compressed::of(self, view.index()), self.views.get(view.index()))
        {
            return match cell.get() {
                Some(bytes) => Ok(bytes),
                None => {
                    let bytes = compressed.decode(self)?;
                    Ok(cell.get_or_init(|| bytes))
                }
            };
        }
        let bytes = self.buffer(&view.buffer())?;
        let (offset, length) = (view.offset(), view.length());
        offset.checked_add(length).and_then(|end| bytes.get(offset..end)).ok_or_else(|| {
            invalid(
                format!("bufferViews[{}]", view.index()),
                format!(
                    "bytes {offset} + {length} lie beyond the end of buffers[{}], which has {} bytes",
                    view.buffer().index(),
                    bytes.len()
                ),
                REEXPORT,
            )
        })
    }
}

/// Path and name for people: `materials[3] "Velvet"`.
pub(crate) fn label(path: &str, name: Option<&str>) -> String {
    match name {
        Some(name) => format!("{path} \"{}\"", cut(name)),
        None => path.to_owned(),
    }
}

fn check_version(root: &Value) -> Result<()> {
    let remedy = "export the file as glTF 2.0";
    let Some(version) = root.pointer("/asset/version").and_then(Value::as_str) else {
        return Err(invalid("asset.version", "this is missing, so the file is not glTF", remedy));
    };
    let needed = root.pointer("/asset/minVersion").and_then(Value::as_str).unwrap_or("2.0");
    if version.split('.').next() != Some("2") || needed != "2.0" {
        let shown = if needed == "2.0" { version } else { needed };
        return Err(unsupported("asset", format!("the file needs glTF {shown}, only 2.0 is known"), remedy));
    }
    Ok(())
}
