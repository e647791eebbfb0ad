//! The data that a page's script works on: pictures, planes, scales, colours.

use super::codec;
use super::escape::short;
use super::input::{ObjectLayer, ValueKind};
use crate::analysis::percentile;
use crate::maps::{ColorMap, View, encode_png, notes, ticks};
use base64::{Engine, engine::general_purpose::STANDARD};
use image::RgbImage;
use image::codecs::jpeg::JpegEncoder;
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;

/// Steps of an embedded colour table.
const STEPS: usize = 513;

/// Quantisation steps of the first layers and of the others.
pub(super) const FINE: u32 = 4096;
pub(super) const COARSE: u32 = 512;

/// Layers that are embedded finely.
pub(super) const FINE_LAYERS: usize = 3;

/// Base64 characters per pixel that all layers of a page may take: 4.1 MB at 640 × 360. Beyond it the layers after the
/// first three get coarser.
const BUDGET: usize = 18;

/// Longest name that is embedded.
const NAME: usize = 120;

/// A picture as a data address: PNG, or JPEG at quality 92 where PNG would need more than 1.2 bytes per pixel. `None`
/// without pixels.
pub(super) fn picture(image: &RgbImage) -> Option<String> {
    let png = encode_png(image).ok().filter(|_| image.width() > 0 && image.height() > 0)?;
    let pixels = image.width() as usize * image.height() as usize;
    if png.len() > pixels * 6 / 5 + 4096 {
        let mut jpeg = Vec::new();
        if JpegEncoder::new_with_quality(&mut jpeg, 92).encode_image(image).is_ok() {
            return Some(format!("data:image/jpeg;base64,{}", STANDARD.encode(jpeg)));
        }
    }
    Some(format!("data:image/png;base64,{}", STANDARD.encode(png)))
}

/// The colour tables that are used, by name.
pub(super) fn tables(maps: impl IntoIterator<Item = ColorMap>) -> Value {
    let tables: Map<String, Value> = maps
        .into_iter()
        .map(|map| (map.name().to_owned(), json!(STANDARD.encode(map.lut(STEPS).concat()))))
        .collect();
    Value::Object(tables)
}

/// Scale, ticks and notes of a view.
pub(super) fn scale(view: &View, map: ColorMap) -> Value {
    let (lo, hi) = (f64::from(view.lo), f64::from(view.hi));
    let ticks: Vec<Value> =
        ticks(lo, hi, 6).into_iter().map(|(value, label)| json!([(value - lo) / (hi - lo), label])).collect();
    let despike = view.despike_above.is_finite().then_some(view.despike_above);
    json!({
        "lo": lo, "hi": hi, "map": map.name(), "ticks": ticks, "notes": notes(view), "despikeAbove": despike,
    })
}

/// A layer's names and reading.
pub(super) fn describe(metric: &str, label: &str, unit: &str, kind: ValueKind, values: &[f32]) -> Value {
    json!({
        "metric": short(metric, NAME),
        "label": short(label, NAME),
        "unit": short(unit, NAME),
        "share": kind == ValueKind::Share,
        "median": percentile(values, 50.0),
    })
}

/// Encodes planes within the budget: each is (values, wanted fine). Returns them in order, and the coarser number of
/// steps used.
pub(super) fn planes(width: u32, height: u32, planes: &[(&[f32], bool)]) -> (Vec<Value>, u32) {
    let budget = (width as usize * height as usize).saturating_mul(BUDGET).max(1 << 16);
    let encode = |wanted: bool, steps| -> Vec<Option<Value>> {
        let one = |(values, fine): &(&[f32], bool)| {
            (*fine == wanted).then(|| codec::amounts(width, height, values, steps))
        };
        planes.iter().map(one).collect()
    };
    let fine = encode(true, FINE);
    let mut steps = COARSE;
    loop {
        let coarse = encode(false, steps);
        let size: usize =
            fine.iter().chain(&coarse).flatten().map(|p| p["png"].as_str().map_or(0, str::len)).sum();
        if size <= budget || steps <= 16 {
            let merged = fine.into_iter().zip(coarse).map(|(a, b)| a.or(b).unwrap_or(Value::Null)).collect();
            return (merged, steps);
        }
        steps /= 2;
    }
}

/// Objects under the pixels: only the names that occur. `Null` when the plane does not fit the picture.
pub(super) fn objects(width: u32, height: u32, layer: &ObjectLayer<'_>) -> Value {
    let mut order: BTreeMap<u32, u16> = BTreeMap::new();
    let mut names = vec![String::new()];
    let ids: Vec<u16> = layer
        .ids
        .iter()
        .map(|id| {
            let Some(name) = layer.names.get(*id as usize) else { return 0 };
            if let Some(place) = order.get(id) {
                return *place;
            }
            let Ok(place) = u16::try_from(names.len()) else { return 0 };
            names.push(short(name, NAME));
            order.insert(*id, place);
            place
        })
        .collect();
    match codec::identifiers(width, height, &ids) {
        Value::Null => Value::Null,
        plane => json!({ "plane": plane, "names": names }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_names_that_occur_are_embedded() {
        let ids = [7, 7, u32::MAX, 2, 9999, 7];
        let names = (0..10).map(|i| format!("object {i}")).collect();
        let value = objects(3, 2, &ObjectLayer { ids: &ids, names });
        assert_eq!(value["names"], json!(["", "object 7", "object 2"]));
        assert_eq!(codec::tests::unpack(&value["plane"]), [1.0, 1.0, 0.0, 2.0, 0.0, 1.0]);
        assert!(objects(5, 5, &ObjectLayer { ids: &ids, names: vec![] }).is_null());
    }

    #[test]
    fn noisy_pictures_become_jpeg_and_empty_ones_nothing() {
        let mut state = 1u32;
        let noisy = RgbImage::from_fn(200, 100, |_, _| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            image::Rgb([(state >> 24) as u8, (state >> 16) as u8, (state >> 8) as u8])
        });
        assert!(picture(&noisy).unwrap().starts_with("data:image/jpeg"));
        assert!(picture(&RgbImage::new(200, 100)).unwrap().starts_with("data:image/png"));
        assert_eq!(picture(&RgbImage::new(0, 0)), None);
    }
}
