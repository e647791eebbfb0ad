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

/// Deflate level: noise compresses as well at the lowest ones.
const LEVEL: u8 = 3;

/// How a quantum is predicted.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Predict {
    /// Mean of the left and upper neighbours: for noisy amounts.
    Mean,
    /// Left neighbour: for identifiers.
    Left,
}

/// Values that the median is taken from, at most about so many.
const MEDIAN_OF: usize = 1 << 18;

/// Rows that a size is estimated from.
const ROWS: usize = 48;

/// How the values of a plane are spread.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spread {
    knee: f64,
    reach: f64,
    signed: bool,
}

impl Spread {
    pub(super) fn of(values: &[f32]) -> Self {
        let finite = || values.iter().copied().filter(|v| v.is_finite());
        let (largest, least) = finite().fold((0.0_f32, 0.0_f32), |(a, b), v| (a.max(v.abs()), b.min(v)));
        // An odd stride does not keep to columns.
        let stride = (values.len() / MEDIAN_OF) | 1;
        let some = values.iter().step_by(stride).copied().filter(|v| v.is_finite());
        let mut sizes: Vec<f32> = some.map(f32::abs).filter(|v| *v > 0.0).collect();
        let middle = sizes.len() / 2;
        let median =
            if sizes.is_empty() { 1.0 } else { *sizes.select_nth_unstable_by(middle, f32::total_cmp).1 };
        let knee = (f64::from(median) / 4.0).max(f64::from(largest) * 1e-6).max(f64::MIN_POSITIVE);
        let reach = (f64::from(largest) / knee).asinh().max(f64::MIN_POSITIVE);
        Self { knee, reach, signed: least < 0.0 }
    }

    /// At most `levels` steps.
    fn quantiser(self, levels: u32) -> Quantiser {
        let levels = levels.clamp(3, 65_000);
        // Of a signed range, an odd number of steps has one at zero.
        let steps = if self.signed { (levels - 1) / 2 * 2 } else { levels - 1 };
        let start = if self.signed { -self.reach } else { 0.0 };
        Quantiser { knee: self.knee, start, scale: f64::from(steps) / (self.reach - start), steps }
    }
}

struct Quantiser {
    knee: f64,
    start: f64,
    scale: f64,
    steps: u32,
}

impl Quantiser {
    fn quantum(&self, v: f32) -> u16 {
        self.quantum_of(curved(v, self.knee))
    }

    /// The same of a value that is curved.
    fn quantum_of(&self, curved: f64) -> u16 {
        if curved.is_finite() {
            let place = (curved - self.start) * self.scale;
            place.round().clamp(0.0, f64::from(self.steps)) as u16
        } else {
            self.steps as u16 + 1
        }
    }
}

/// asinh(v / knee), not finite where v is not. Its error is that of a logarithm, small beside any step, and it takes a third of the time of
/// the library's, which is exact for small values too. Knees are at least a millionth of the largest value, so squares stay in range.
fn curved(v: f32, knee: f64) -> f64 {
    let x = f64::from(v) / knee;
    let size = x.abs();
    (size + (x * x + 1.0).sqrt()).ln().copysign(x)
}

/// A plane of amounts at `levels` steps (2 to 65 000) between its extremes; not-finite values are kept as such. `Null`
/// when it has no pixels.
pub(super) fn amounts(width: u32, height: u32, values: &[f32], levels: u32) -> Value {
    spread_amounts(width, height, values, levels, Spread::of(values))
}

/// [`amounts`] whose spread is known.
pub(super) fn spread_amounts(width: u32, height: u32, values: &[f32], levels: u32, spread: Spread) -> Value {
    let quantiser = spread.quantiser(levels);
    let quanta: Vec<u16> = values.iter().map(|v| quantiser.quantum(*v)).collect();
    match pack(width, height, &quanta, Predict::Mean) {
        Some(png) => json!({
            "png": png,
            "mean": true,
            "steps": quantiser.steps,
            "knee": spread.knee,
            "start": quantiser.start,
            "reach": spread.reach,
        }),
        None => Value::Null,
    }
}

/// About how many base64 characters the plane takes at each of `levels`: the entropy of the differences in some rows.
pub(super) fn estimate(width: u32, values: &[f32], levels: &[u32], spread: Spread) -> Vec<usize> {
    let columns = width.max(1) as usize;
    let rows = values.len() / columns;
    if rows < 2 {
        return vec![values.len() * 4; levels.len()];
    }
    let step = (rows - 1).div_ceil(ROWS);
    let curved = |row: usize| -> Vec<f64> {
        values[row * columns..(row + 1) * columns].iter().map(|v| curved(*v, spread.knee)).collect()
    };
    let pairs: Vec<_> = (1..rows).step_by(step).map(|row| [curved(row - 1), curved(row)]).collect();
    levels
        .iter()
        .map(|levels| {
            let quantiser = spread.quantiser(*levels);
            let mut histogram = [[0_u32; 256]; 2];
            let mut count = 0.0;
            for pair in &pairs {
                let [up, own] = pair
                    .each_ref()
                    .map(|row| row.iter().map(|v| quantiser.quantum_of(*v)).collect::<Vec<u16>>());
                for x in 1..columns {
                    let folded = fold(own[x], own[x - 1].midpoint(up[x]));
                    for (histogram, byte) in histogram.iter_mut().zip(folded.to_le_bytes()) {
                        histogram[usize::from(byte)] += 1;
                    }
                    count += 1.0;
                }
            }
            let bits: f64 = histogram
                .iter()
                .flatten()
                .filter(|n| **n > 0)
                .map(|n| f64::from(*n) * (count / f64::from(*n)).log2())
                .sum();
            // Four characters for three bytes; 3 % for what deflate adds.
            (bits / f64::max(count, 1.0) * values.len() as f64 / 6.0 * 1.03) as usize + 256
        })
        .collect()
}

/// The difference from a guess as an unsigned number.
const fn fold(quantum: u16, guess: u16) -> u16 {
    let difference = quantum.wrapping_sub(guess) as i16;
    ((difference << 1) ^ (difference >> 15)) as u16
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
        [low[i], high[i]] = fold(quanta[i], guess).to_le_bytes();
    }
    let mut png = Vec::new();
    PngEncoder::new_with_quality(&mut png, CompressionType::Level(LEVEL), FilterType::NoFilter)
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
