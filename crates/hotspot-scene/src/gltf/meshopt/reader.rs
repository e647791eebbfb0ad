//! Compressed streams as bytes and variable-length numbers.

/// Why a stream cannot be decoded.
pub(super) type Broken = &'static str;

/// What decoding gives.
pub(super) type Decoded<T> = Result<T, Broken>;

pub(super) const CUT: Broken = "the compressed stream is cut short";

/// Reads a stream from front to back.
pub(super) struct Reader<'s> {
    pub(super) rest: &'s [u8],
}

impl<'s> Reader<'s> {
    pub(super) fn take(&mut self, count: usize) -> Decoded<&'s [u8]> {
        let (taken, rest) = self.rest.split_at_checked(count).ok_or(CUT)?;
        self.rest = rest;
        Ok(taken)
    }

    pub(super) fn byte(&mut self) -> Decoded<u8> {
        let (byte, rest) = self.rest.split_first().ok_or(CUT)?;
        self.rest = rest;
        Ok(*byte)
    }

    /// Unsigned LEB128 of at most five bytes; what exceeds 32 bits is cut off.
    pub(super) fn varint(&mut self) -> Decoded<u32> {
        let mut value = 0u32;
        for shift in [0, 7, 14, 21, 28] {
            let byte = self.byte()?;
            value |= u32::from(byte & 0x7F) << shift;
            if byte & 0x80 == 0 {
                return Ok(value);
            }
        }
        Err("a number in the compressed stream is longer than five bytes")
    }

    pub(super) fn finish(&self) -> Decoded<()> {
        if self.rest.is_empty() { Ok(()) } else { Err("the compressed stream holds more than it should") }
    }
}
