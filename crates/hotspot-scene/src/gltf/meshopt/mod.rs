//! `EXT_meshopt_compression` and `KHR_meshopt_compression`: buffer views that hold a compressed stream.
//!
//! Written from the extensions' specification (appendices A and B). The crates there are either C++ or tie a dependency to
//! one exact version. Where a file has uncompressed data beside the stream, the stream is what is read.

mod attributes;
mod filters;
mod indices;
mod reader;
#[cfg(test)]
mod tests;

use serde_json::Value;

use super::document::Document;
use crate::budget::room_for;
use crate::error::{REEXPORT, Result, invalid};

/// The extensions' names. Both share one form; the second allows more.
pub(crate) const NAMES: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];

/// A compressed buffer view.
pub(crate) struct Compressed<'v> {
    extension: &'v Value,
    path: String,
}

impl<'v> Compressed<'v> {
    /// `None` where the buffer view is a plain one.
    pub(crate) fn of(doc: &'v Document<'_>, view: usize) -> Option<Self> {
        let extensions = doc.member("bufferViews", view, "extensions")?;
        NAMES.iter().find_map(|name| {
            let extension = extensions.get(name)?;
            Some(Self { extension, path: format!("bufferViews[{view}].extensions.{name}") })
        })
    }

    /// The view's bytes: `count` elements of `byteStride` bytes.
    pub(crate) fn decode(&self, doc: &Document<'_>) -> Result<Vec<u8>> {
        let (count, stride) = (self.number("count")?, self.number("byteStride")?);
        let offset = if self.extension.get("byteOffset").is_some() { self.number("byteOffset")? } else { 0 };
        let length = self.number("byteLength")?;
        let buffer = self.number("buffer")?;
        let bytes = match doc.gltf.buffers().nth(buffer) {
            Some(buffer) => doc.buffer(&buffer)?,
            None => {
                let count = doc.gltf.buffers().len();
                return Err(
                    self.wrong("buffer", format!("{buffer} is out of range, the file has {count} buffers"))
                );
            }
        };
        let source = offset.checked_add(length).and_then(|end| bytes.get(offset..end)).ok_or_else(|| {
            let problem = format!(
                "bytes {offset} + {length} lie beyond the end of buffers[{buffer}], which has {} bytes",
                bytes.len()
            );
            invalid(self.path.as_str(), problem, REEXPORT)
        })?;
        doc.budget.charge(count as u64, stride as u64, &self.path)?;
        let broken = |broken: &str| invalid(self.path.as_str(), broken, REEXPORT);
        let size = count.checked_mul(stride).ok_or_else(|| broken("the view is too large"))?;
        let mode = self.extension.get("mode").and_then(Value::as_str).unwrap_or_default();
        let filter = self.extension.get("filter").map_or(Some("NONE"), Value::as_str).unwrap_or_default();
        let allowed = match mode {
            "ATTRIBUTES" => stride > 0 && stride % 4 == 0 && stride <= 256,
            "TRIANGLES" | "INDICES" => (stride == 2 || stride == 4) && filter == "NONE",
            _ => return Err(self.wrong("mode", format!("\"{mode}\" is not among the values allowed here"))),
        };
        let allowed = allowed
            && match filter {
                "NONE" | "EXPONENTIAL" => true,
                "OCTAHEDRAL" | "COLOR" => stride == 4 || stride == 8,
                "QUATERNION" => stride == 8,
                _ => {
                    let problem = format!("\"{filter}\" is not among the values allowed here");
                    return Err(self.wrong("filter", problem));
                }
            };
        if !allowed {
            let problem = format!("elements of {stride} bytes do not go with {mode} and the filter {filter}");
            return Err(self.wrong("byteStride", problem));
        }
        let mut out = room_for(size, &self.path)?;
        match mode {
            "ATTRIBUTES" => attributes::decode(source, count, stride, &mut out).map_err(broken)?,
            "TRIANGLES" => indices::triangles(source, count, stride, &mut out).map_err(broken)?,
            _ => indices::sequence(source, count, stride, &mut out).map_err(broken)?,
        }
        match filter {
            "OCTAHEDRAL" => filters::octahedral(&mut out, stride),
            "QUATERNION" => filters::quaternion(&mut out),
            "EXPONENTIAL" => filters::exponential(&mut out),
            "COLOR" => filters::color(&mut out, stride),
            _ => {}
        }
        Ok(out)
    }

    fn number(&self, key: &str) -> Result<usize> {
        let number = self.extension.get(key).and_then(Value::as_u64);
        number
            .and_then(|number| usize::try_from(number).ok())
            .ok_or_else(|| self.wrong(key, "this is missing or not a whole number".into()))
    }

    fn wrong(&self, key: &str, problem: String) -> crate::LoadError {
        invalid(format!("{}.{key}", self.path), problem, REEXPORT)
    }
}
