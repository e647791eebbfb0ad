//! Modes 1 and 2: vertex indices, of triangles that share edges with recent ones, or of any order.

use super::reader::{Broken, CUT, Decoded, Reader};

/// The sixteen last things, the latest at 0.
struct Recent<T> {
    items: [T; 16],
    next: usize,
}

impl<T: Copy> Recent<T> {
    /// `nothing` stands where nothing was written yet.
    fn new(nothing: T) -> Self {
        Self { items: [nothing; 16], next: 0 }
    }

    fn push(&mut self, item: T) {
        if let Some(slot) = self.items.get_mut(self.next) {
            *slot = item;
        }
        self.next = (self.next + 1) & 15;
    }

    fn get(&self, age: u8) -> Option<T> {
        self.items.get((self.next + 15 - usize::from(age & 15)) & 15).copied()
    }
}

/// What the triangles so far leave behind.
struct State<'s> {
    data: Reader<'s>,
    /// The next vertex that was not met yet.
    next: u32,
    /// The last index that was stored as a difference.
    last: u32,
    edges: Recent<Option<[u32; 2]>>,
    vertices: Recent<Option<u32>>,
}

const NOTHING: Broken = "the compressed triangles refer to an edge or vertex before the first";

impl State<'_> {
    fn fresh(&mut self) -> u32 {
        let vertex = self.next;
        self.next = self.next.wrapping_add(1);
        vertex
    }

    fn stored(&mut self) -> Decoded<u32> {
        self.last = self.last.wrapping_add(zigzag(self.data.varint()?));
        Ok(self.last)
    }

    fn recent(&self, age: u8) -> Decoded<u32> {
        self.vertices.get(age).flatten().ok_or(NOTHING)
    }

    /// A vertex of a triangle without a known edge, and whether it is to be remembered.
    fn vertex(&mut self, code: u8) -> Decoded<(u32, bool)> {
        match code {
            0 => Ok((self.fresh(), true)),
            15 => Ok((self.stored()?, true)),
            _ => Ok((self.recent(code - 1)?, false)),
        }
    }

    fn triangle(&mut self, code: u8, table: &[u8]) -> Decoded<[u32; 3]> {
        let (high, low) = (code >> 4, code & 15);
        if high < 15 {
            let [a, b] = self.edges.get(high).flatten().ok_or(NOTHING)?;
            let (c, new) = match low {
                0 => (self.fresh(), true),
                13 | 14 => {
                    self.last = if low == 13 { self.last.wrapping_sub(1) } else { self.last.wrapping_add(1) };
                    (self.last, true)
                }
                15 => (self.stored()?, true),
                _ => (self.recent(low)?, false),
            };
            self.edges.push(Some([c, b]));
            self.edges.push(Some([a, c]));
            if new {
                self.vertices.push(Some(c));
            }
            return Ok([a, b, c]);
        }
        let codes = match low {
            14 | 15 => self.data.byte()?,
            _ => table.get(usize::from(low)).copied().unwrap_or(0),
        };
        if low >= 14 && codes == 0 {
            self.next = 0;
        }
        let a = if low == 15 { self.stored()? } else { self.fresh() };
        let (b, new_b) = self.vertex(codes >> 4)?;
        let (c, new_c) = self.vertex(codes & 15)?;
        for edge in [[b, a], [c, b], [a, c]] {
            self.edges.push(Some(edge));
        }
        for (vertex, new) in [(a, true), (b, new_b), (c, new_c)] {
            if new {
                self.vertices.push(Some(vertex));
            }
        }
        Ok([a, b, c])
    }
}

fn zigzag(value: u32) -> u32 {
    (value >> 1) ^ (value & 1).wrapping_neg()
}

fn write(index: u32, stride: usize, out: &mut Vec<u8>) {
    match stride {
        2 => out.extend((index as u16).to_le_bytes()),
        _ => out.extend(index.to_le_bytes()),
    }
}

/// Mode 1: appends `count` indices of `stride` bytes (2 or 4), three for each triangle.
pub(super) fn triangles(source: &[u8], count: usize, stride: usize, out: &mut Vec<u8>) -> Decoded<()> {
    if !count.is_multiple_of(3) {
        return Err("the number of compressed indices is not a multiple of three");
    }
    let mut reader = Reader { rest: source };
    if reader.byte()? != 0xE1 {
        return Err("the compressed triangles begin with an unknown byte");
    }
    let codes = reader.take(count / 3)?;
    let end = reader.rest.len().checked_sub(16).ok_or(CUT)?;
    let (data, table) = reader.rest.split_at_checked(end).ok_or(CUT)?;
    let nibbles_fit = table.iter().all(|byte| byte >> 4 != 15 && byte & 15 != 15);
    if !nibbles_fit {
        return Err("the table of the compressed triangles holds a code that is not allowed");
    }
    let mut state = State {
        data: Reader { rest: data },
        next: 0,
        last: 0,
        edges: Recent::new(None),
        vertices: Recent::new(None),
    };
    for code in codes {
        for index in state.triangle(*code, table)? {
            write(index, stride, out);
        }
    }
    state.data.finish()
}

/// Mode 2: appends `count` indices of `stride` bytes (2 or 4).
pub(super) fn sequence(source: &[u8], count: usize, stride: usize, out: &mut Vec<u8>) -> Decoded<()> {
    let end = source.len().checked_sub(4).ok_or(CUT)?;
    let mut reader = Reader { rest: source.get(..end).ok_or(CUT)? };
    if reader.byte()? != 0xD1 {
        return Err("the compressed indices begin with an unknown byte");
    }
    let mut last = [0u32; 2];
    for _ in 0..count {
        let value = reader.varint()?;
        let [even, odd] = &mut last;
        let baseline = if value & 1 == 0 { even } else { odd };
        *baseline = baseline.wrapping_add(zigzag(value >> 1));
        write(*baseline, stride, out);
    }
    reader.finish()
}
