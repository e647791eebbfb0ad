//! Reading accessors (glTF 2.0, section 3.6.2): typed arrays in byte ranges.
//!
//! The crate's `ItemIter` decodes. Its `Iter`, which would also find the bytes, computes their ranges without checks
//! (count 0 and 2⁶² overflow) and skips sparse places that are not sorted: the range is ours, checked before a byte is read.

use std::array;

use gltf::Accessor;
use gltf::accessor::sparse::Sparse;
use gltf::accessor::util::{Item, ItemIter, SparseIndicesIter};
use gltf::accessor::{DataType, Dimensions};
use gltf::buffer::View;

use super::document::Document;
use crate::LoadError;
use crate::budget::room_for;
use crate::error::{REEXPORT, Result, invalid, limit};
use crate::notes::Notes;

/// What an attribute may be stored as.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Positions and normals: floats; integers under KHR_mesh_quantization.
    Vector,
    /// Texture coordinates: floats or normalised unsigned integers; any integers under KHR_mesh_quantization.
    Uv,
    /// Differences that morph targets add: as [`Kind::Vector`]; zeros where the accessor has no data.
    Delta,
    /// Vertex colours and the weights of joints: floats or unsigned integers, which are normalised whether
    /// the file says so or not.
    Share,
    /// Numbers of joints: unsigned integers, not normalised.
    Joint,
    /// Values of animations and placements of copies: floats or normalised integers.
    Value,
    /// Points in time and matrices: floats.
    Float,
}

/// An accessor as vectors of `N` floats. May hold NaN and infinity, as the file does.
pub(crate) fn vectors<const N: usize>(
    doc: &Document<'_>,
    accessor: &Accessor<'_>,
    kind: Kind,
    notes: &mut Notes,
) -> Result<Vec<[f32; N]>> {
    let path = path(accessor);
    let (data, mut normalized) = (accessor.data_type(), accessor.normalized());
    check_type(accessor, N)?;
    let unsigned = matches!(data, DataType::U8 | DataType::U16);
    if kind == Kind::Share && unsigned && !normalized {
        // Nothing else can be meant by integers here.
        notes.repair("integers without `normalized` taken as normalised", &path, 1);
        normalized = true;
    }
    let allowed = match (data, kind) {
        (DataType::F32, _) => !normalized && kind != Kind::Joint,
        (DataType::U32, _) | (_, Kind::Float) => false,
        (_, Kind::Joint) => unsigned && !normalized,
        (_, Kind::Share) => unsigned,
        (_, Kind::Value) => normalized,
        (_, Kind::Uv) if unsigned && normalized => true,
        (_, Kind::Vector | Kind::Uv | Kind::Delta) => doc.quantized,
    };
    if !allowed {
        return Err(wrong(&path, "componentType", format!("vectors of {N} are not stored as this here")));
    }
    let provided = doc.provided(accessor.index());
    let item = data.size() * N;
    let count = provided.as_ref().map_or(accessor.count(), |bytes| bytes.len() / item);
    announce(doc, count, 4 * N as u64, &path)?;
    let mut out: Vec<[f32; N]> = room_for(count, &path)?;
    let sparse = accessor.sparse();
    if let Some(bytes) = &provided {
        Items { bytes, item, stride: item, count }.vectors(data, normalized, &mut out);
        return Ok(out);
    }
    match accessor.view() {
        Some(view) => {
            let place = Place { path: &path, offset: accessor.offset(), item, alignment: data.size() };
            place.items(doc, &view, count, notes)?.vectors(data, normalized, &mut out);
        }
        // Zeros, for `sparse` to fill in.
        None if sparse.is_some() || kind == Kind::Delta => out.resize(count, [0.0; N]),
        None => return Err(wrong(&path, "bufferView", "this is missing, so the accessor has no data")),
    }
    if let Some(sparse) = sparse {
        let number = sparse.count();
        announce(doc, number, 4 + 4 * N as u64, &format!("{path}.sparse"))?;
        let places = sparse_places(doc, &sparse, count, &path, notes)?;
        let (values, path_of) = (sparse.values(), format!("{path}.sparse.values"));
        let place =
            Place { path: &path_of, offset: values.offset(), item: data.size() * N, alignment: data.size() };
        let mut new = room_for(number, &path_of)?;
        place.items(doc, &values.view(), number, notes)?.vectors(data, normalized, &mut new);
        for (place, item) in places.into_iter().zip(new) {
            if let Some(slot) = out.get_mut(place as usize) {
                *slot = item;
            }
        }
    }
    Ok(out)
}

/// An accessor as vertex indices, each below `vertices`.
pub(crate) fn indices(
    doc: &Document<'_>,
    accessor: &Accessor<'_>,
    vertices: usize,
    notes: &mut Notes,
) -> Result<Vec<u32>> {
    let path = path(accessor);
    check_type(accessor, 1)?;
    let data = accessor.data_type();
    if !matches!(data, DataType::U8 | DataType::U16 | DataType::U32) {
        return Err(wrong(&path, "componentType", "indices must be unsigned integers (5121, 5123 or 5125)"));
    }
    let count = accessor.count();
    announce(doc, count, 4, &path)?;
    let sparse = accessor.sparse();
    let mut out = match accessor.view() {
        Some(view) => {
            let place =
                Place { path: &path, offset: accessor.offset(), item: data.size(), alignment: data.size() };
            place.items(doc, &view, count, notes)?.indices(vertices, &path)?
        }
        // Zeros, for `sparse` to fill in.
        None if sparse.is_some() && (vertices > 0 || count == 0) => {
            let mut zeros = room_for(count, &path)?;
            zeros.resize(count, 0);
            zeros
        }
        None => return Err(wrong(&path, "bufferView", "this is missing, so the accessor has no data")),
    };
    if let Some(sparse) = sparse {
        let number = sparse.count();
        announce(doc, number, 8, &format!("{path}.sparse"))?;
        let places = sparse_places(doc, &sparse, count, &path, notes)?;
        let (values, path_of) = (sparse.values(), format!("{path}.sparse.values"));
        let place =
            Place { path: &path_of, offset: values.offset(), item: data.size(), alignment: data.size() };
        let new = place.items(doc, &values.view(), number, notes)?.indices(vertices, &path_of)?;
        for (place, item) in places.into_iter().zip(new) {
            if let Some(slot) = out.get_mut(place as usize) {
                *slot = item;
            }
        }
    }
    Ok(out)
}

/// Which of an accessor's `count` items its sparse part replaces.
fn sparse_places(
    doc: &Document<'_>,
    sparse: &Sparse<'_>,
    count: usize,
    path: &str,
    notes: &mut Notes,
) -> Result<Vec<u32>> {
    let (indices, path) = (sparse.indices(), format!("{path}.sparse.indices"));
    let size = indices.index_type().size();
    let place = Place { path: &path, offset: indices.offset(), item: size, alignment: size };
    place.items(doc, &indices.view(), sparse.count(), notes)?.indices(count, &path)
}

fn path(accessor: &Accessor<'_>) -> String {
    format!("accessors[{}]", accessor.index())
}

fn wrong(path: &str, key: &str, problem: impl Into<String>) -> LoadError {
    invalid(format!("{path}.{key}"), problem, REEXPORT)
}

fn check_type(accessor: &Accessor<'_>, components: usize) -> Result<()> {
    let (wanted, name) = match components {
        1 => (Dimensions::Scalar, "SCALAR"),
        2 => (Dimensions::Vec2, "VEC2"),
        3 => (Dimensions::Vec3, "VEC3"),
        4 => (Dimensions::Vec4, "VEC4"),
        _ => (Dimensions::Mat4, "MAT4"),
    };
    match accessor.dimensions() {
        found if found == wanted => Ok(()),
        found => Err(wrong(&path(accessor), "type", format!("the type is {found:?}, {name} is needed here"))),
    }
}

/// Asks for the memory that `count` items need decoded.
fn announce(doc: &Document<'_>, count: usize, decoded_size: u64, path: &str) -> Result<()> {
    let element = format!("{path}.count");
    doc.budget.charge(count as u64, decoded_size, &element)?;
    if u32::try_from(count).is_err() {
        return Err(limit(element, format!("{count} items are more than 2³²"), "split the mesh"));
    }
    Ok(())
}

/// Where items lie within a view.
struct Place<'p> {
    path: &'p str,
    offset: usize,
    /// Bytes of an item.
    item: usize,
    alignment: usize,
}

impl Place<'_> {
    /// Checks that `count` items lie within `view`.
    fn items<'b>(
        &self,
        doc: &'b Document<'_>,
        view: &View<'_>,
        count: usize,
        notes: &mut Notes,
    ) -> Result<Items<'b>> {
        let Self { path, offset, item, alignment } = *self;
        let bytes = doc.view(view)?;
        let stride = view.stride().unwrap_or(item);
        if stride < item {
            return Err(wrong(
                path,
                "bufferView",
                format!("the view's stride of {stride} bytes is less than an item's {item} bytes"),
            ));
        }
        let length = match count {
            0 => Some(0),
            _ => stride.checked_mul(count - 1).and_then(|most| most.checked_add(item)),
        };
        let range = length.and_then(|length| Some(offset..offset.checked_add(length)?));
        let items = range.and_then(|range| bytes.get(range)).ok_or_else(|| {
            invalid(
                path,
                format!(
                    "{count} items of {item} bytes, {stride} apart, from byte {offset} do not fit into the buffer view's \
                     {} bytes",
                    bytes.len()
                ),
                REEXPORT,
            )
        })?;
        // The decoder reads byte by byte, so it does no harm; others may refuse such a file.
        let aligned = [offset, view.offset(), stride].iter().all(|n| n % alignment == 0);
        notes.repair("misaligned data read anyway", path, u64::from(!aligned));
        Ok(Items { bytes: items, item, stride, count })
    }
}

/// Exactly `count` items of `item` bytes, the starts of which are `stride` bytes apart.
struct Items<'b> {
    bytes: &'b [u8],
    item: usize,
    stride: usize,
    count: usize,
}

impl Items<'_> {
    /// Appends all items; normalised integers map to 0..1 or -1..1.
    fn vectors<const N: usize>(&self, data: DataType, normalized: bool, out: &mut Vec<[f32; N]>) {
        let scale = move |largest: f32| {
            move |value: f32| if normalized { (value / largest).max(-1.0) } else { value }
        };
        let (i8s, u8s, i16s, u16s) = (scale(127.0), scale(255.0), scale(32767.0), scale(65535.0));
        match data {
            DataType::I8 => out.extend(self.decode(|n: i8| i8s(f32::from(n)))),
            DataType::U8 => out.extend(self.decode(|n: u8| u8s(f32::from(n)))),
            DataType::I16 => out.extend(self.decode(|n: i16| i16s(f32::from(n)))),
            DataType::U16 => out.extend(self.decode(|n: u16| u16s(f32::from(n)))),
            // Refused by the caller.
            DataType::U32 => {}
            DataType::F32 => out.extend(self.decode(|n: f32| n)),
        }
    }

    /// Each component is a column of its own, with the items' stride.
    fn decode<T: Item, const N: usize>(&self, number: impl Fn(T) -> f32) -> impl Iterator<Item = [f32; N]> {
        let component = self.item / N;
        let mut columns: [_; N] = array::from_fn(|column| {
            ItemIter::<T>::new(self.bytes.get(column * component..).unwrap_or_default(), self.stride)
        });
        (0..self.count).map(move |_| array::from_fn(|c| number(columns[c].next().unwrap_or_else(T::zero))))
    }

    /// Unsigned integers, each below `bound`.
    fn indices(&self, bound: usize, path: &str) -> Result<Vec<u32>> {
        let items = match self.item {
            1 => SparseIndicesIter::U8(ItemIter::new(self.bytes, self.stride)),
            2 => SparseIndicesIter::U16(ItemIter::new(self.bytes, self.stride)),
            _ => SparseIndicesIter::U32(ItemIter::new(self.bytes, self.stride)),
        };
        let mut out = room_for(self.count, path)?;
        for index in items {
            if index as usize >= bound {
                let position = out.len();
                return Err(invalid(
                    path,
                    format!("index {index} at position {position} is out of range, there are {bound} items"),
                    REEXPORT,
                ));
            }
            out.push(index);
        }
        Ok(out)
    }
}
