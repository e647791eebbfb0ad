//! Tiny PNG pictures, uncompressed, and data URIs.

use base64::Engine as _;

/// An RGBA picture, row by row from the top.
#[derive(Clone)]
pub(super) struct Png {
    width: usize,
    height: usize,
    texels: Vec<[u8; 4]>,
}

impl Png {
    /// Asks for each texel, (0, 0) being the upper left.
    pub(super) fn new(width: usize, height: usize, texel: impl Fn(usize, usize) -> [u8; 4]) -> Png {
        let texels = (0..width * height).map(|i| texel(i % width, i / width)).collect();
        Png { width, height, texels }
    }

    /// As a data URI. Alpha is written where it matters.
    pub(super) fn uri(&self) -> String {
        data_uri("image/png", &self.encode())
    }

    pub(super) fn encode(&self) -> Vec<u8> {
        let channels = if self.texels.iter().all(|t| t[3] == 255) { 3 } else { 4 };
        let mut raw = Vec::new();
        for row in self.texels.chunks(self.width) {
            raw.push(0);
            raw.extend(row.iter().flat_map(|t| &t[..channels]));
        }
        let mut header = Vec::new();
        header.extend((self.width as u32).to_be_bytes());
        header.extend((self.height as u32).to_be_bytes());
        header.extend([8, if channels == 3 { 2 } else { 6 }, 0, 0, 0]);
        let mut file = b"\x89PNG\r\n\x1a\n".to_vec();
        chunk(&mut file, b"IHDR", &header);
        chunk(&mut file, b"IDAT", &stored(&raw));
        chunk(&mut file, b"IEND", &[]);
        file
    }
}

fn chunk(file: &mut Vec<u8>, name: &[u8; 4], data: &[u8]) {
    file.extend((data.len() as u32).to_be_bytes());
    let start = file.len();
    file.extend(name);
    file.extend(data);
    let sum = crc(&file[start..]);
    file.extend(sum.to_be_bytes());
}

/// CRC-32 as PNG has it (ISO 3309), bit by bit.
fn crc(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0, |sum: u32, byte| {
        (0..8).fold(sum ^ u32::from(*byte), |s, _| (s >> 1) ^ if s & 1 == 1 { 0xedb8_8320 } else { 0 })
    })
}

/// A zlib stream (RFC 1950) of stored blocks.
fn stored(raw: &[u8]) -> Vec<u8> {
    let mut out = vec![0x78, 0x01];
    let blocks = raw.chunks(65535);
    let last = blocks.len() - 1;
    for (i, block) in blocks.enumerate() {
        let length = block.len() as u16;
        out.push(u8::from(i == last));
        out.extend(length.to_le_bytes());
        out.extend((!length).to_le_bytes());
        out.extend(block);
    }
    let (a, b) = raw.iter().fold((1u32, 0u32), |(a, b), byte| {
        let a = (a + u32::from(*byte)) % 65521;
        (a, (b + a) % 65521)
    });
    out.extend((b << 16 | a).to_be_bytes());
    out
}

/// A data URI.
pub(super) fn data_uri(kind: &str, bytes: &[u8]) -> String {
    format!("data:{kind};base64,{}", base64::engine::general_purpose::STANDARD.encode(bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn checksums_match_published_values() {
        assert_eq!(crc(b"123456789"), 0xcbf4_3926);
        // Adler-32 of "Wikipedia", from the article of that name.
        assert_eq!(stored(b"Wikipedia")[16..], 0x11e6_0398_u32.to_be_bytes());
    }
}
