//! Vertex colours: the attribute `COLOR_0` (glTF 2.0, section 3.7.2.1), linear RGB or RGBA.

use gltf::Accessor;
use gltf::accessor::Dimensions;

use super::accessor::{self, Kind};
use super::document::Document;
use crate::error::Result;
use crate::notes::Notes;

/// Linear RGBA, each in 0..1; `None` where all are white and opaque, which changes nothing.
pub(crate) fn read(
    doc: &Document<'_>,
    accessor: &Accessor<'_>,
    path: &str,
    notes: &mut Notes,
) -> Result<Option<Vec<[f32; 4]>>> {
    let mut colors = if accessor.dimensions() == Dimensions::Vec3 {
        let colors = accessor::vectors::<3>(doc, accessor, Kind::Share, notes)?;
        doc.budget.charge(colors.len() as u64, 16, path)?;
        colors.into_iter().map(|[r, g, b]| [r, g, b, 1.0]).collect()
    } else {
        accessor::vectors::<4>(doc, accessor, Kind::Share, notes)?
    };
    let mut outside = 0;
    for color in &mut colors {
        let clamped = color.map(|c| if c.is_nan() { 1.0 } else { c.clamp(0.0, 1.0) });
        outside += u64::from(clamped != *color);
        *color = clamped;
    }
    notes.repair("vertex colours clamped to 0..1", path, outside);
    Ok(colors.iter().any(|color| *color != [1.0; 4]).then_some(colors))
}
