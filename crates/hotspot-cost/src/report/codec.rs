//! Planes of numbers, small enough for a page.
//!
//! Costs span decades and are noisy, so they are quantised evenly in asinh(v / m): linear around zero (zero stays
//! exactly zero), logarithmic above m = a quarter of the median size, so that the *relative* error is bounded. Each
//! quantum is predicted from its neighbours to the left and above; the difference is folded to an unsigned number
//! (zigzag), its low and high bytes stored as two separate 8-bit pictures on top of each other, and that picture as a PNG
//! without filters, whose deflate stream the page inflates with `DecompressionStream`. `viewer.js` holds the inverse.

use base64::{Engine, engine::general_purpose::STANDARD};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use serde_json::{Value, json};

/// How a quantum is predicted.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Predict {
    /// Mean of the left and upper neighbours: for noisy amounts.
    Mean,
    /// Left neighbour: for identifiers.
    Left,
}

/// A plane of amounts at `levels` steps (2 to 65 000) between its extremes; not-finite values are kept as such. `Null`
/// when it has no pixels.
pub(super) fn amounts(width: u32, height: u32, values: &[f32], levels: u32) -> Value {
    let levels = levels.clamp(3, 65_000);
    let finite = || values.iter().copied().filter(|v| v.is_finite());
    let largest = finite().fold(0.0, |a: f32, v| a.max(v.abs()));
    let signed = finite().any(|v| v < 0.0);
    let mut sizes: Vec<f32> = finite().map(f32::abs).filter(|v| *v > 0.0).collect();
    let middle = sizes.len() / 2;
    let median = if sizes.is_empty() { 1.0 } else { *sizes.select_nth_unstable_by(middle, f32::total_cmp).1 };
    let knee = (f64::from(median) / 4.0).max(f64::from(largest) * 1e-6).max(f64::MIN_POSITIVE);
    let reach = (f64::from(largest) / knee).asinh().max(f64::MIN_POSITIVE);
    // Of a signed range, an odd number of steps has one at zero.
    let steps = if signed { (levels - 1) / 2 * 2 } else { levels - 1 };
    let start = if signed { -reach } else { 0.0 };
    let scale = f64::from(steps) / (reach - start);
    let quantum = |v: f32| {
        if v.is_finite() {
            (((f64::from(v) / knee).asinh() - start) * scale).round().clamp(0.0, f64::from(steps)) as u16
        } else {
            steps as u16 + 1
        }
    };
    let quanta: Vec<u16> = values.iter().map(|v| quantum(*v)).collect();
    match pack(width, height, &quanta, Predict::Mean) {
        Some(png) => {
            json!({ "png": png, "mean": true, "steps": steps, "knee": knee, "start": start, "reach": reach })
        }
        None => Value::Null,
    }
}

/// A plane of identifiers.
pub(super) fn identifiers(width: u32, height: u32, values: &[u16]) -> Value {
    match pack(width, height, values, Predict::Left) {
        Some(png) => json!({ "png": png, "mean": false }),
        None => Value::Null,
    }
}

/// Base64 of the PNG; `None` when the plane has no pixels or not `width × height` of them.
fn pack(width: u32, height: u32, quanta: &[u16], predict: Predict) -> Option<String> {
    let (columns, count) = (width as usize, quanta.len());
    if count == 0 || columns.checked_mul(height as usize) != Some(count) {
        return None;
    }
    let mut bytes = vec![0; 2 * count];
    let (low, high) = bytes.split_at_mut(count);
    for i in 0..count {
        let left = (i % columns > 0).then(|| quanta[i - 1]);
        let up = (i >= columns).then(|| quanta[i - columns]);
        let guess = match (left, up) {
            (Some(left), Some(up)) if predict == Predict::Mean => left.midpoint(up),
            (Some(one), _) | (None, Some(one)) => one,
            (None, None) => 0,
        };
        let difference = quanta[i].wrapping_sub(guess) as i16;
        let folded = ((difference << 1) ^ (difference >> 15)) as u16;
        [low[i], high[i]] = folded.to_le_bytes();
    }
    let mut png = Vec::new();
    PngEncoder::new_with_quality(&mut png, CompressionType::Default, FilterType::NoFilter)
        .write_image(&bytes, width, height.checked_mul(2)?, ExtendedColorType::L8)
        .ok()?;
    Some(STANDARD.encode(png))
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// What the page's script does.
    pub(in crate::report) fn unpack(plane: &Value) -> Vec<f32> {
        let png = STANDARD.decode(plane["png"].as_str().unwrap()).unwrap();
        let image = image::load_from_memory(&png).unwrap().to_luma8();
        let (columns, count) = (image.width() as usize, image.len() / 2);
        let (low, high) = image.as_raw().split_at(count);
        let mut quanta = vec![0u16; count];
        for i in 0..count {
            let left = (i % columns > 0).then(|| quanta[i - 1]);
            let up = (i >= columns).then(|| quanta[i - columns]);
            let guess = match (left, up) {
                (Some(left), Some(up)) if plane["mean"] == true => left.midpoint(up),
                (Some(one), _) | (None, Some(one)) => one,
                (None, None) => 0,
            };
            let folded = u16::from_le_bytes([low[i], high[i]]);
            quanta[i] = guess.wrapping_add((folded >> 1) ^ (folded & 1).wrapping_neg());
        }
        let Some(steps) = plane["steps"].as_u64() else { return quanta.into_iter().map(f32::from).collect() };
        let number = |key: &str| plane[key].as_f64().unwrap();
        let value = |q: u16| {
            let part = f64::from(q) / steps as f64;
            let place = number("start") + part * (number("reach") - number("start"));
            if u64::from(q) > steps { f32::NAN } else { (number("knee") * place.sinh()) as f32 }
        };
        quanta.into_iter().map(value).collect()
    }

    #[test]
    fn amounts_come_back_within_the_step() {
        let mut values: Vec<f32> = (0..600).map(|i| (i * 7919 % 601) as f32 * 0.37).collect();
        values[17] = 40_000.0;
        let back = unpack(&amounts(30, 20, &values, 4096));
        for (value, got) in values.iter().zip(back) {
            assert!((got - value).abs() <= value.abs() * 0.003 + 0.05, "{value} {got}");
            assert!(*value != 0.0 || got == 0.0);
        }
    }

    #[test]
    fn signs_zero_and_nan_survive() {
        let values = [-3.0, 0.0, 3.0, f32::NAN, f32::INFINITY, -0.5];
        let back = unpack(&amounts(3, 2, &values, 513));
        assert_eq!(back[1], 0.0);
        assert!((back[0] + back[2]).abs() < 1e-6 && back[0] < -2.99);
        assert!(back[3].is_nan() && back[4].is_nan());
    }

    #[test]
    fn identifiers_are_exact() {
        let ids: Vec<u16> = (0..70).map(|i| [0, 65535, 3, 3, 9][i % 5]).collect();
        let back = unpack(&identifiers(7, 10, &ids));
        assert!(ids.iter().zip(back).all(|(a, b)| f32::from(*a) == b));
    }

    #[test]
    fn hostile_planes() {
        assert!(amounts(0, 0, &[], 100).is_null());
        assert!(amounts(2, 2, &[1.0], 100).is_null());
        assert!(amounts(u32::MAX, u32::MAX, &[1.0], 100).is_null());
        for values in [[f32::NAN; 2], [f32::MAX, f32::MIN], [0.0; 2], [f32::MIN_POSITIVE, 0.0]] {
            for levels in [0, 100, u32::MAX] {
                assert_eq!(unpack(&amounts(2, 1, &values, levels)).len(), 2);
            }
        }
    }
}
