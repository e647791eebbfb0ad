//! Mode 0, attributes: differences between elements, byte by byte, with as many bits as each sixteen of them need.

use super::reader::{CUT, Decoded, Reader};

/// Elements whose differences share their bits.
const GROUP: usize = 16;
/// Most elements of a block.
const BLOCK: usize = 256;

/// Version 0 of the stream stores no tables: byte differences, and these bits.
const BITS_OF_VERSION_0: [u8; 4] = [0, 2, 4, 8];

/// Appends `count` elements of `stride` bytes (a multiple of 4 up to 256).
pub(super) fn decode(source: &[u8], count: usize, stride: usize, out: &mut Vec<u8>) -> Decoded<()> {
    let (header, rest) = source.split_first().ok_or(CUT)?;
    let first_version = match header {
        0xA0 => true,
        0xA1 => false,
        _ => return Err("the compressed attributes begin with an unknown byte"),
    };
    let channels = if first_version { 0 } else { stride / 4 };
    let tail = stride + channels;
    let padded = tail.max(if first_version { 32 } else { 24 });
    let end = rest.len().checked_sub(padded).ok_or(CUT)?;
    let (data, tail_block) = rest.split_at_checked(end).ok_or(CUT)?;
    let tail_block = tail_block.get(padded - tail..).ok_or(CUT)?;
    let (baseline, channels) = tail_block.split_at_checked(stride).ok_or(CUT)?;
    let mut previous: Vec<[u8; 4]> = baseline.as_chunks::<4>().0.to_vec();
    let mut reader = Reader { rest: data };
    let most = ((8192 / stride) & !(GROUP - 1)).min(BLOCK);
    out.resize(count * stride, 0);
    for block in out.chunks_mut(most * stride) {
        let elements = block.len() / stride;
        let control = if first_version { &[][..] } else { reader.take(stride / 4)? };
        for (k, previous) in previous.iter_mut().enumerate() {
            let mut planes = [[0u8; BLOCK]; 4];
            let control = control.get(k).copied();
            for (j, plane) in planes.iter_mut().enumerate() {
                match control.map(|control| (control >> (2 * j)) & 3) {
                    None => groups(&mut reader, elements, BITS_OF_VERSION_0, plane)?,
                    Some(0) => groups(&mut reader, elements, [0, 1, 2, 4], plane)?,
                    Some(1) => groups(&mut reader, elements, [1, 2, 4, 8], plane)?,
                    Some(2) => {}
                    Some(_) => {
                        let literal = reader.take(elements)?;
                        plane.iter_mut().zip(literal).for_each(|(to, from)| *to = *from);
                    }
                }
            }
            let channel = Channel::of(channels.get(k).copied().unwrap_or(0))?;
            for (e, element) in block.chunks_exact_mut(stride).enumerate() {
                let delta = planes.map(|plane| plane.get(e).copied().unwrap_or(0));
                *previous = channel.add(*previous, delta);
                if let Some(slot) = element.get_mut(4 * k..4 * k + 4) {
                    slot.copy_from_slice(previous);
                }
            }
        }
    }
    reader.finish()
}

/// Reads the differences of one byte of all elements of a block.
fn groups(reader: &mut Reader<'_>, elements: usize, bits: [u8; 4], plane: &mut [u8]) -> Decoded<()> {
    let count = elements.div_ceil(GROUP);
    let header = reader.take(count.div_ceil(4))?;
    for (g, group) in plane.chunks_mut(GROUP).take(count).enumerate() {
        let mode = header.get(g / 4).map_or(0, |byte| (byte >> (2 * (g % 4))) & 3);
        let bits = bits.get(usize::from(mode)).copied().unwrap_or(0);
        match bits {
            0 => group.fill(0),
            8 => group.copy_from_slice(reader.take(GROUP)?),
            _ => sentinels(reader, bits, group)?,
        }
    }
    Ok(())
}

/// Numbers of 1, 2 or 4 bits; one with all bits set stands for a byte that follows the sixteen.
fn sentinels(reader: &mut Reader<'_>, bits: u8, group: &mut [u8]) -> Decoded<()> {
    let packed = reader.take(2 * usize::from(bits))?;
    let sentinel = (1u8 << bits) - 1;
    let per_byte = 8 / usize::from(bits);
    for (i, value) in group.iter_mut().enumerate() {
        let byte = packed.get(i / per_byte).copied().unwrap_or(0);
        let place = (i % per_byte) as u8 * bits;
        // Single bits lie from the lowest up, the others from the highest down.
        let shift = if bits == 1 { place } else { 8 - bits - place };
        *value = (byte >> shift) & sentinel;
        if *value == sentinel {
            *value = reader.byte()?;
        }
    }
    Ok(())
}

/// How four bytes of an element follow from those of the one before.
#[derive(Clone, Copy)]
enum Channel {
    Bytes,
    Pairs,
    /// Exclusive or, after turning the difference by so many bits.
    Xor(u32),
}

impl Channel {
    fn of(stored: u8) -> Decoded<Self> {
        match (stored & 15, stored >> 4) {
            (0, 0) => Ok(Self::Bytes),
            (1, 0) => Ok(Self::Pairs),
            (2, turn) => Ok(Self::Xor(u32::from(turn))),
            _ => Err("the compressed attributes use an unknown kind of difference"),
        }
    }

    fn add(self, previous: [u8; 4], delta: [u8; 4]) -> [u8; 4] {
        match self {
            Self::Bytes => {
                let mut out = previous;
                for (byte, delta) in out.iter_mut().zip(delta) {
                    // Zigzag: the lowest bit is the sign.
                    *byte = byte.wrapping_add((delta >> 1) ^ (delta & 1).wrapping_neg());
                }
                out
            }
            Self::Pairs => {
                let [a, b, c, d] = delta;
                let [p, q, r, s] = previous;
                let add = |previous: [u8; 2], delta: [u8; 2]| {
                    let delta = u16::from_le_bytes(delta);
                    let delta = (delta >> 1) ^ (delta & 1).wrapping_neg();
                    u16::from_le_bytes(previous).wrapping_add(delta).to_le_bytes()
                };
                let ([a, b], [c, d]) = (add([p, q], [a, b]), add([r, s], [c, d]));
                [a, b, c, d]
            }
            Self::Xor(turn) => {
                let delta = u32::from_le_bytes(delta).rotate_right(turn);
                (u32::from_le_bytes(previous) ^ delta).to_le_bytes()
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_specifications_example_of_four_bits_is_decoded() {
        let stored = [0x17, 0x5F, 0xF0, 0xBC, 0x77, 0xA9, 0x21, 0x00, 0x34, 0xB5];
        let mut reader = Reader { rest: &stored };
        let mut group = [0; GROUP];
        sentinels(&mut reader, 4, &mut group).unwrap();
        assert!(reader.finish().is_ok());
        let mut value = [0u8; 4];
        let deltas = group.map(|delta| {
            let before = value[0];
            value = Channel::Bytes.add(value, [delta, 0, 0, 0]);
            value[0].wrapping_sub(before) as i8
        });
        assert_eq!(deltas, [-1, -4, -3, 26, -91, 0, -6, 6, -4, -4, 5, -5, 1, -1, 0, 0]);
    }
}
