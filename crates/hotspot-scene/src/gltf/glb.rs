//! The GLB container (glTF 2.0, section 4): a 12-byte header, then chunks of length, type and payload.

use crate::error::{Result, invalid, unsupported};
use crate::notes::Notes;

const MAGIC: &[u8] = b"glTF";
const JSON: u32 = 0x4E4F_534A;
const BIN: u32 = 0x004E_4942;

/// The payloads of a GLB file.
#[derive(Debug)]
pub(crate) struct Glb<'a> {
    pub(crate) json: &'a [u8],
    pub(crate) bin: Option<&'a [u8]>,
}

pub(crate) fn is_glb(bytes: &[u8]) -> bool {
    bytes.starts_with(MAGIC)
}

/// Takes a GLB file apart, trusting none of its lengths.
pub(crate) fn parse<'a>(bytes: &'a [u8], notes: &mut Notes) -> Result<Glb<'a>> {
    let wrong = |element: &str, problem: String| {
        invalid(element, problem, "the file is damaged or cut short: copy or export it again")
    };
    let header = |problem: String| wrong("GLB header", problem);
    if !is_glb(bytes) {
        return Err(header("the file does not start with \"glTF\"".into()));
    }
    let (Some(version), Some(length)) = (u32_at(bytes, 4), u32_at(bytes, 8)) else {
        return Err(header(format!("the file has {} bytes, the header alone has 12", bytes.len())));
    };
    if version != 2 {
        return Err(unsupported(
            "GLB header",
            format!("the container has version {version}, only 2 is known"),
            "export the file as glTF 2.0",
        ));
    }
    let length = length as usize;
    let Some(body) = bytes.get(12..length) else {
        return Err(header(format!("it claims {length} bytes, the file has {}", bytes.len())));
    };
    notes.repair("bytes after the end of the GLB ignored", "GLB header", (bytes.len() - length) as u64);

    let mut rest = body;
    let mut json = None;
    let mut bin = None;
    for number in 0usize.. {
        if rest.is_empty() {
            break;
        }
        let element = format!("GLB chunk {number}");
        let (Some(size), Some(kind)) = (u32_at(rest, 0), u32_at(rest, 4)) else {
            return Err(wrong(&element, format!("{} bytes are left, a chunk needs 8", rest.len())));
        };
        let after = rest.get(8..).unwrap_or_default();
        let size = size as usize;
        let Some(payload) = after.get(..size) else {
            return Err(wrong(&element, format!("it claims {size} bytes, {} are left", after.len())));
        };
        match (number, kind) {
            (0, JSON) => json = Some(payload),
            (0, _) => return Err(wrong(&element, format!("its type is {kind:#x} instead of JSON"))),
            (1, BIN) => bin = Some(payload),
            // Chunks of other types must be ignored, says the specification.
            _ => {}
        }
        rest = after.get(size..).unwrap_or_default();
    }
    let json = json.ok_or_else(|| wrong("GLB chunk 0", "there is no JSON".into()))?;
    Ok(Glb { json, bin })
}

/// A GLB file of JSON and a binary chunk.
pub(crate) fn write(json: &serde_json::Value, bin: Option<&[u8]>) -> Result<Vec<u8>> {
    let mut text = serde_json::to_vec(json).unwrap_or_default();
    text.resize(text.len().next_multiple_of(4), b' ');
    let padded = bin.map(|bin| bin.len().next_multiple_of(4));
    let length = 12 + 8 + text.len() + padded.map_or(0, |length| 8 + length);
    let field = |length: usize| u32::try_from(length).map_err(|_| super::rewrite::too_long(length));
    let mut out = Vec::with_capacity(length);
    out.extend(MAGIC);
    out.extend(2u32.to_le_bytes());
    out.extend(field(length)?.to_le_bytes());
    out.extend(field(text.len())?.to_le_bytes());
    out.extend(JSON.to_le_bytes());
    out.extend(&text);
    if let (Some(bin), Some(padded)) = (bin, padded) {
        out.extend(field(padded)?.to_le_bytes());
        out.extend(BIN.to_le_bytes());
        out.extend(bin);
        out.resize(length, 0);
    }
    Ok(out)
}

fn u32_at(bytes: &[u8], offset: usize) -> Option<u32> {
    let field = bytes.get(offset..offset.checked_add(4)?)?;
    Some(u32::from_le_bytes(field.try_into().ok()?))
}
