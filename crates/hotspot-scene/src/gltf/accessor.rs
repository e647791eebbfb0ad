//! Reading accessors (glTF 2.0, section 3.6.2): typed arrays in byte ranges.
//!
//! Every offset, length, stride and count is checked in u64 before a byte is read.

use super::document::{Document, View, range};
use super::json::Element;
use crate::budget::room_for;
use crate::error::{Result, limit};
use crate::notes::Notes;

/// How a component is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    fn of(accessor: &Element<'_>) -> Result<Self> {
        match accessor.integer("componentType")? {
            Some(5120) => Ok(Self::I8),
            Some(5121) => Ok(Self::U8),
            Some(5122) => Ok(Self::I16),
            Some(5123) => Ok(Self::U16),
            Some(5125) => Ok(Self::U32),
            Some(5126) => Ok(Self::F32),
            Some(other) => Err(accessor.wrong("componentType", format!("{other} is not a component type"))),
            None => Err(accessor.wrong("componentType", "this is missing")),
        }
    }

    fn size(self) -> u64 {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    /// A component as a number; normalised integers map to 0..1 or -1..1. `bytes` has [`Component::size`] bytes.
    fn number(self, bytes: &[u8], normalized: bool) -> f32 {
        let two = || bytes.try_into().unwrap_or_default();
        let four = || bytes.try_into().unwrap_or_default();
        let byte = || bytes.first().copied().unwrap_or_default();
        let (value, largest) = match self {
            Self::I8 => (f32::from(byte() as i8), 127.0),
            Self::U8 => (f32::from(byte()), 255.0),
            Self::I16 => (f32::from(i16::from_le_bytes(two())), 32767.0),
            Self::U16 => (f32::from(u16::from_le_bytes(two())), 65535.0),
            Self::U32 => (u32::from_le_bytes(four()) as f32, 4_294_967_295.0),
            Self::F32 => return f32::from_le_bytes(four()),
        };
        if normalized { (value / largest).max(-1.0) } else { value }
    }

    /// A component as an index.
    fn index(self, bytes: &[u8]) -> u32 {
        match self {
            Self::U8 | Self::I8 => u32::from(bytes.first().copied().unwrap_or_default()),
            Self::U16 | Self::I16 => u32::from(u16::from_le_bytes(bytes.try_into().unwrap_or_default())),
            Self::U32 | Self::F32 => u32::from_le_bytes(bytes.try_into().unwrap_or_default()),
        }
    }
}

/// What an attribute may be stored as.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Positions and normals: floats; integers under KHR_mesh_quantization.
    Vector,
    /// Texture coordinates: floats or normalised unsigned integers; any integers under KHR_mesh_quantization.
    Uv,
}

/// The accessor at `index` as vectors of `N` floats. May hold NaN and infinity, as the file does.
pub(crate) fn vectors<const N: usize>(
    doc: &Document<'_>,
    index: usize,
    kind: Kind,
    notes: &mut Notes,
) -> Result<Vec<[f32; N]>> {
    let accessor = doc.root.item("accessors", index)?;
    let component = Component::of(&accessor)?;
    check_type(&accessor, N)?;
    let normalized = accessor.boolean("normalized")?;
    let allowed = match component {
        Component::F32 => !normalized,
        Component::U32 => false,
        Component::U8 | Component::U16 if kind == Kind::Uv && normalized => true,
        _ => doc.quantized,
    };
    if !allowed {
        return Err(accessor.wrong("componentType", format!("vectors of {N} are not stored as this here")));
    }
    let count = count(doc, &accessor, 4 * N as u64)?;
    let size = component.size() * N as u64;
    let mut out: Vec<[f32; N]> = room_for(count, &accessor.path)?;
    let read = |item: &[u8]| {
        let mut numbers = [0.0; N];
        for (number, bytes) in numbers.iter_mut().zip(item.chunks_exact(component.size() as usize)) {
            *number = component.number(bytes, normalized);
        }
        numbers
    };
    let sparse = accessor.object("sparse")?;
    match doc.view(&accessor, "bufferView")? {
        Some(view) => {
            out.extend(Items::of(&accessor, &view, component, size, count as u64, notes)?.map(read));
        }
        // Zeros, for `sparse` to fill in.
        None if sparse.is_some() => out.resize(count, [0.0; N]),
        None => return Err(accessor.wrong("bufferView", "this is missing, so the accessor has no data")),
    }
    if let Some(sparse) = sparse {
        let (places, values) = sparse_parts(doc, &sparse, count, component, size, notes)?;
        for (place, item) in places.into_iter().zip(values) {
            if let Some(slot) = out.get_mut(place as usize) {
                *slot = read(item);
            }
        }
    }
    Ok(out)
}

/// The accessor at `index` as vertex indices, each below `vertices`.
pub(crate) fn indices(
    doc: &Document<'_>,
    index: usize,
    vertices: usize,
    notes: &mut Notes,
) -> Result<Vec<u32>> {
    let accessor = doc.root.item("accessors", index)?;
    check_type(&accessor, 1)?;
    if accessor.get("sparse").is_some() {
        return Err(accessor.wrong("sparse", "sparse indices are not supported"));
    }
    let count = count(doc, &accessor, 4)?;
    let Some(view) = doc.view(&accessor, "bufferView")? else {
        return Err(accessor.wrong("bufferView", "this is missing, so the accessor has no data"));
    };
    read_indices(&accessor, &view, count, vertices, notes)
}

/// Unsigned integers below `bound`.
fn read_indices(
    element: &Element<'_>,
    view: &View<'_>,
    count: usize,
    bound: usize,
    notes: &mut Notes,
) -> Result<Vec<u32>> {
    let component = Component::of(element)?;
    if !matches!(component, Component::U8 | Component::U16 | Component::U32) {
        return Err(element.wrong("componentType", "indices must be unsigned integers (5121, 5123 or 5125)"));
    }
    let mut out = room_for(count, &element.path)?;
    for item in Items::of(element, view, component, component.size(), count as u64, notes)? {
        let index = component.index(item);
        if index as usize >= bound {
            return Err(element.wrong_here(format!(
                "index {index} at position {} is out of range, there are {bound} items",
                out.len()
            )));
        }
        out.push(index);
    }
    Ok(out)
}

/// Places and values of a sparse accessor.
fn sparse_parts<'a, 'b>(
    doc: &'b Document<'a>,
    sparse: &Element<'a>,
    bound: usize,
    component: Component,
    size: u64,
    notes: &mut Notes,
) -> Result<(Vec<u32>, Items<'b>)> {
    let number = count(doc, sparse, 4)?;
    let part = |key: &str| {
        let part = sparse.object(key)?.ok_or_else(|| sparse.wrong(key, "this is missing"))?;
        let view =
            doc.view(&part, "bufferView")?.ok_or_else(|| part.wrong("bufferView", "this is missing"))?;
        Ok((part, view))
    };
    let (element, view) = part("indices")?;
    let places = read_indices(&element, &view, number, bound, notes)?;
    let (element, view) = part("values")?;
    let values = Items::of(&element, &view, component, size, number as u64, notes)?;
    Ok((places, values))
}

fn check_type(accessor: &Element<'_>, components: usize) -> Result<()> {
    let wanted = match components {
        1 => "SCALAR",
        2 => "VEC2",
        3 => "VEC3",
        _ => "VEC4",
    };
    match accessor.string("type")? {
        Some(found) if found == wanted => Ok(()),
        Some(found) => Err(accessor.wrong("type", format!("the type is {found}, {wanted} is needed here"))),
        None => Err(accessor.wrong("type", "this is missing")),
    }
}

/// How many items, after asking for the memory they need decoded.
fn count(doc: &Document<'_>, element: &Element<'_>, decoded_size: u64) -> Result<usize> {
    let count = element.integer("count")?.ok_or_else(|| element.wrong("count", "this is missing"))?;
    doc.budget.charge(count, decoded_size, &element.path_of("count"))?;
    match usize::try_from(count) {
        Ok(number) if count <= u64::from(u32::MAX) => Ok(number),
        _ => {
            Err(limit(element.path_of("count"), format!("{count} items are more than 2³²"), "split the mesh"))
        }
    }
}

/// The items of a byte range, each of `size` bytes.
struct Items<'b> {
    bytes: &'b [u8],
    size: usize,
    stride: usize,
    left: u64,
}

impl<'b> Items<'b> {
    /// Checks that `count` items lie within `view`.
    fn of(
        element: &Element<'_>,
        view: &View<'b>,
        component: Component,
        size: u64,
        count: u64,
        notes: &mut Notes,
    ) -> Result<Self> {
        let offset = element.integer("byteOffset")?.unwrap_or(0);
        let stride = view.stride.unwrap_or(size);
        if stride < size {
            return Err(element.wrong(
                "bufferView",
                format!("the view's stride of {stride} bytes is less than an item's {size} bytes"),
            ));
        }
        let length = match count {
            0 => Some(0),
            _ => stride.checked_mul(count - 1).and_then(|most| most.checked_add(size)),
        };
        let bytes = length
            .and_then(|length| range(offset, length))
            .and_then(|range| view.bytes.get(range))
            .ok_or_else(|| {
                element.wrong_here(format!(
                    "{count} items of {size} bytes, {stride} apart, from byte {offset} do not fit into the buffer \
                     view's {} bytes",
                    view.bytes.len()
                ))
            })?;
        // We read byte by byte, so it does no harm; others may refuse such a file.
        let aligned = [offset, view.offset, stride].iter().all(|n| n % component.size() == 0);
        notes.repair("misaligned data read anyway", &element.path, u64::from(!aligned));
        // Both are at most 252 or 16 bytes.
        Ok(Self { bytes, size: size as usize, stride: stride as usize, left: count })
    }
}

impl<'b> Iterator for Items<'b> {
    type Item = &'b [u8];

    fn next(&mut self) -> Option<&'b [u8]> {
        self.left = self.left.checked_sub(1)?;
        let item = self.bytes.get(..self.size)?;
        self.bytes = self.bytes.get(self.stride..).unwrap_or_default();
        Some(item)
    }
}
