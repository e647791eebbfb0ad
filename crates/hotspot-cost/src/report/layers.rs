//! The data that a page's script works on: pictures, planes, scales, colours.

use super::codec;
use super::escape::short;
use super::input::{ObjectLayer, ValueKind};
use crate::analysis::percentile;
use crate::maps::{ColorMap, SPIKE, View, encode_png, notes, ticks};
use base64::{Engine, engine::general_purpose::STANDARD};
use image::RgbImage;
use image::codecs::jpeg::JpegEncoder;
use rayon::prelude::*;
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;

/// Steps of an embedded colour table.
const STEPS: usize = 513;

/// Quantisation steps of the first layers; the others have 512 at most.
const FINE: u32 = 4096;

/// Layers that are embedded finely.
pub(super) const FINE_LAYERS: usize = 3;

/// Base64 characters per pixel that all layers of a page may take: 4.1 MB at 640 × 360. Beyond it layers get coarser.
const BUDGET: usize = 18;

/// Base64 characters per pixel that layers, pictures and flags of a page may take together: 4.8 MB at 640 × 360.
const PAGE: usize = 21;

/// And at most so many: with the pictures and texts a page stays below 12 MB.
const MOST: usize = 9_600_000;

/// Above this number of pixels the coarse layers are embedded at a lower resolution, and pictures as JPEG.
const LARGE: usize = 1 << 20;

/// Longest name that is embedded.
const NAME: usize = 120;

/// A picture as a data address: PNG, or JPEG at quality 92 where PNG would need more than 1.2 bytes per pixel and for large
/// pictures. `None` without pixels.
pub(super) fn picture(image: &RgbImage) -> Option<String> {
    let pixels = image.width() as usize * image.height() as usize;
    let png = if pixels > LARGE { None } else { Some(encode_png(image).ok().filter(|_| pixels > 0)?) };
    if png.as_ref().is_none_or(|png| png.len() > pixels * 6 / 5 + 4096) {
        let mut jpeg = Vec::new();
        if JpegEncoder::new_with_quality(&mut jpeg, 92).encode_image(image).is_ok() {
            return Some(format!("data:image/jpeg;base64,{}", STANDARD.encode(jpeg)));
        }
    }
    let png = png.or_else(|| encode_png(image).ok())?;
    Some(format!("data:image/png;base64,{}", STANDARD.encode(png)))
}

/// All colour tables, by name: the reader may choose another.
pub(super) fn tables() -> Value {
    let tables: Map<String, Value> = ColorMap::ALL
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
        "spike": SPIKE,
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

/// How planes are embedded: steps and edge of the square of pixels that become one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Grain {
    pub(super) steps: u32,
    pub(super) shrink: u32,
}

/// What to say where a layer is embedded at a lower resolution.
pub(super) fn shrink_note(plane: &Value) -> Option<String> {
    let shrink = plane["shrink"].as_u64()?;
    Some(format!("on this page at 1/{shrink} resolution: means of {shrink}x{shrink} pixels"))
}

/// Adds [`shrink_note`] to a scale's notes.
pub(super) fn note_shrink(scale: &mut Value, plane: &Value) {
    if let (Some(note), Some(notes)) = (shrink_note(plane), scale["notes"].as_array_mut()) {
        notes.push(note.into());
    }
}

/// From fine to coarse: the grains of the first layers and of the others.
fn ladder(pixels: usize) -> Vec<[Grain; 2]> {
    let grain = |steps, shrink| Grain { steps, shrink };
    if pixels <= LARGE {
        // Below 64 steps a map shows bands: fewer pixels with more steps say more.
        let small = [
            [(FINE, 1), (512, 1)],
            [(FINE, 1), (256, 1)],
            [(FINE, 1), (128, 1)],
            [(FINE, 1), (64, 1)],
            [(FINE, 1), (512, 2)],
            [(2048, 1), (256, 2)],
            [(1024, 1), (128, 2)],
            [(512, 1), (128, 2)],
            [(256, 1), (64, 2)],
            [(256, 1), (64, 4)],
            [(64, 1), (64, 8)],
        ];
        return small.into_iter().map(|grains| grains.map(|(steps, shrink)| grain(steps, shrink))).collect();
    }
    let large = [
        [(4096, 1), (512, 2)],
        [(2048, 1), (256, 2)],
        [(1024, 1), (256, 2)],
        [(1024, 1), (128, 2)],
        [(512, 1), (128, 2)],
        [(512, 1), (64, 2)],
        [(512, 1), (128, 4)],
        [(256, 1), (128, 4)],
        [(256, 1), (64, 4)],
        [(512, 2), (128, 4)],
        [(256, 2), (128, 8)],
        [(256, 4), (64, 8)],
        [(256, 8), (64, 16)],
        [(64, 16), (32, 32)],
    ];
    large.into_iter().map(|grains| grains.map(|(steps, shrink)| grain(steps, shrink))).collect()
}

/// Encodes planes within the budget, that gets smaller when `others`, the characters that the page's pictures and flags take,
/// are many: each is (values, wanted fine). Returns them in order, and the grains used for those wanted fine and for the others.
pub(super) fn planes(
    (width, height): (u32, u32),
    planes: &[(&[f32], bool)],
    others: usize,
) -> (Vec<Value>, [Grain; 2]) {
    let pixels = width as usize * height as usize;
    let left = pixels.saturating_mul(PAGE).saturating_sub(others);
    let budget = pixels.saturating_mul(BUDGET).min(left).clamp(1 << 16, MOST);
    let ladder = ladder(pixels);
    let levels =
        |fine: bool| -> Vec<u32> { ladder.iter().map(|grains| grain_of(*grains, fine).steps).collect() };
    let known = parallel(planes, |(values, fine)| {
        let spread = codec::Spread::of(values);
        (spread, codec::estimate(width, values, &levels(*fine), spread))
    });
    let expected = |rung: usize| -> usize {
        let sizes = planes.iter().zip(&known).map(|((_, fine), (_, sizes))| {
            let shrink = grain_of(ladder[rung], *fine).shrink as usize;
            // Means are less noisy: that saves about a bit of six to seven.
            if shrink == 1 { sizes[rung] } else { sizes[rung] * 17 / 20 / (shrink * shrink) }
        });
        sizes.sum()
    };
    let encode = |rung: usize| {
        let jobs: Vec<_> = planes.iter().zip(&known).collect();
        parallel(&jobs, |((values, fine), (spread, _))| {
            encoded(width, height, values, grain_of(ladder[rung], *fine), *spread)
        })
    };
    let last = ladder.len() - 1;
    let rung = (0..last).find(|rung| expected(*rung) <= budget).unwrap_or(last);
    let out = encode(rung);
    let size: usize = out.iter().map(|p| p["png"].as_str().map_or(0, str::len)).sum();
    if size <= budget || rung == last {
        return (out, ladder[rung]);
    }
    // The estimate was too low: by as much lower is the next choice.
    let next = (rung + 1..last)
        .find(|next| expected(*next) as f64 * size as f64 <= budget as f64 * expected(rung) as f64)
        .unwrap_or(last);
    (encode(next), ladder[next])
}

const fn grain_of([fine, coarse]: [Grain; 2], wanted_fine: bool) -> Grain {
    if wanted_fine { fine } else { coarse }
}

fn encoded(width: u32, height: u32, values: &[f32], grain: Grain, spread: codec::Spread) -> Value {
    if grain.shrink == 1 || values.len() != width as usize * height as usize {
        return codec::spread_amounts(width, height, values, grain.steps, spread);
    }
    let small = shrunk(width, values, grain.shrink);
    let size = [width, height].map(|length| length.div_ceil(grain.shrink));
    let mut value = codec::amounts(size[0], size[1], &small, grain.steps);
    if !value.is_null() {
        value["shrink"] = grain.shrink.into();
    }
    value
}

/// Means over squares of pixels, of what is finite in them.
fn shrunk(width: u32, values: &[f32], by: u32) -> Vec<f32> {
    let (columns, by) = (width as usize, by as usize);
    let mut out = Vec::new();
    for rows in values.chunks(columns * by) {
        let mut sums = vec![(0.0_f64, 0_u32); columns.div_ceil(by)];
        for row in rows.chunks(columns) {
            for (sum, square) in sums.iter_mut().zip(row.chunks(by)) {
                for value in square.iter().filter(|value| value.is_finite()) {
                    sum.0 += f64::from(*value);
                    sum.1 += 1;
                }
            }
        }
        // Without any it is 0/0, not a number either.
        out.extend(sums.into_iter().map(|(sum, count)| (sum / f64::from(count)) as f32));
    }
    out
}

/// `work` over the items in the caller's thread pool; the results in order.
pub(super) fn parallel<T: Sync, R: Send>(items: &[T], work: impl Fn(&T) -> R + Sync) -> Vec<R> {
    items.par_iter().with_max_len(1).map(&work).collect()
}

/// Objects under the pixels: only the names that occur, with the indices that ledgers know them by. `Null` when the plane does not fit the picture.
pub(super) fn objects(width: u32, height: u32, layer: &ObjectLayer<'_>) -> Value {
    let mut order: BTreeMap<u32, u16> = BTreeMap::new();
    let mut names = vec![String::new()];
    let mut ids_of = vec![Value::Null];
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
            ids_of.push(json!(id));
            order.insert(*id, place);
            place
        })
        .collect();
    match codec::identifiers(width, height, &ids) {
        Value::Null => Value::Null,
        plane => json!({ "plane": plane, "names": names, "ids": ids_of }),
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
        assert_eq!(value["ids"], json!([null, 7, 2]));
        assert_eq!(codec::tests::unpack(&value["plane"]), [1.0, 1.0, 0.0, 2.0, 0.0, 1.0]);
        assert!(objects(5, 5, &ObjectLayer { ids: &ids, names: vec![] }).is_null());
    }

    #[test]
    fn shrunk_planes_are_means_of_squares() {
        let values = [1.0, 3.0, 10.0, 5.0, 7.0, f32::NAN, f32::NAN, 2.0, 6.0];
        let small = shrunk(3, &values, 2);
        assert_eq!((small[0], small[1], small[2], small[3]), (4.0, 10.0, 2.0, 6.0));
        assert!(shrunk(1, &[f32::NAN, f32::INFINITY], 2)[0].is_nan());
    }

    /// As many layers as a comparison has, all noise, beside pictures that take their part: the page keeps its size, by fewer
    /// pixels before there are fewer than 64 steps.
    #[test]
    fn many_noisy_layers_leave_room_for_the_pictures() {
        let mut random = crate::testing::Random::new(1);
        let pixels = 160 * 90;
        let noise: Vec<Vec<f32>> =
            (0..44).map(|_| (0..pixels).map(|_| random.normal() as f32).collect()).collect();
        let wanted: Vec<(&[f32], bool)> =
            noise.iter().enumerate().map(|(i, plane)| (plane.as_slice(), i < 3)).collect();
        for others in [0, 8 * pixels] {
            let (encoded, [fine, coarse]) = planes((160, 90), &wanted, others);
            let size: usize = encoded.iter().map(|p| p["png"].as_str().unwrap().len()).sum();
            assert!(size + others <= PAGE * pixels, "{size} and {others} of {}", PAGE * pixels);
            assert!(fine.steps >= 64 && coarse.steps >= 64 && coarse.shrink > 1, "{fine:?} {coarse:?}");
        }
    }

    #[test]
    fn large_planes_come_at_a_lower_resolution_and_say_so() {
        let values: Vec<f32> =
            (0..1201_usize * 901).map(|i| (i % 1201) as f32 + (i * 7919 % 61) as f32).collect();
        let wanted = [(values.as_slice(), true), (values.as_slice(), false)];
        let (encoded, [fine, coarse]) = planes((1201, 901), &wanted, 0);
        assert_eq!((fine.shrink, coarse.shrink), (1, 2));
        assert!(shrink_note(&encoded[0]).is_none() && shrink_note(&encoded[1]).unwrap().contains("2x2"));
        assert_eq!(codec::tests::unpack(&encoded[0]).len(), 1201 * 901);
        let small = codec::tests::unpack(&encoded[1]);
        assert_eq!(small.len(), 601 * 451);
        for (got, want) in small.iter().zip(shrunk(1201, &values, 2)) {
            assert!((got - want).abs() <= 0.03 * want + 2.0, "{got} {want}");
        }
        let sizes = codec::estimate(1201, &values, &[4096], codec::Spread::of(&values));
        let size = encoded[0]["png"].as_str().unwrap().len();
        assert!(size <= sizes[0] * 5 / 4, "{size} {sizes:?}");
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
