//! Filters: what the elements of mode 0 stand for. In place; formulas in appendix B of the extensions' specification.

/// Signed numbers of one or two bytes.
fn components(element: &[u8], stride: usize) -> [i32; 4] {
    let at = |i: usize| element.get(i).copied().unwrap_or(0);
    std::array::from_fn(|i| match stride {
        4 => i32::from(at(i) as i8),
        _ => i32::from(i16::from_le_bytes([at(2 * i), at(2 * i + 1)])),
    })
}

/// Numbers cut to one or two bytes.
fn store(element: &mut [u8], stride: usize, values: [i32; 4]) {
    match stride {
        4 => element.iter_mut().zip(values).for_each(|(byte, value)| *byte = value as u8),
        _ => {
            let pairs = element.as_chunks_mut::<2>().0;
            pairs.iter_mut().zip(values).for_each(|(pair, value)| *pair = (value as u16).to_le_bytes());
        }
    }
}

/// Nearest whole number, halves away from zero; 0 for NaN.
fn round(value: f32) -> i32 {
    value.round() as i32
}

/// Unit vectors from points on an octahedron; the fourth component passes. `stride` is 4 or 8.
pub(super) fn octahedral(data: &mut [u8], stride: usize) {
    let largest = if stride == 4 { 127.0 } else { 32767.0 };
    for element in data.chunks_exact_mut(stride) {
        let [x, y, one, rest] = components(element, stride);
        let (x, y) = (x as f32 / one as f32, y as f32 / one as f32);
        let z = 1.0 - x.abs() - y.abs();
        // The lower half is folded out.
        let fold = z.min(0.0);
        let (x, y) = (x - fold.copysign(x), y - fold.copysign(y));
        let length = (x * x + y * y + z * z).sqrt();
        let [x, y, z] = [x, y, z].map(|c| round(c / length * largest));
        store(element, stride, [x, y, z, rest]);
    }
}

/// Unit quaternions from their three smaller components. Elements have 8 bytes.
pub(super) fn quaternion(data: &mut [u8]) {
    for element in data.chunks_exact_mut(8) {
        let [a, b, c, scale] = components(element, 8);
        let one = (scale | 3) as f32;
        let [a, b, c] = [a, b, c].map(|c| c as f32 / one * std::f32::consts::FRAC_1_SQRT_2);
        let largest = (1.0 - a * a - b * b - c * c).max(0.0).sqrt();
        let mut out = [largest, a, b, c].map(|c| round(c * 32767.0));
        // The largest component was left out at this place, the others follow it in a circle.
        out.rotate_right((scale & 3) as usize);
        store(element, 8, out);
    }
}

/// Floats from eight bits of exponent and 24 of mantissa.
pub(super) fn exponential(data: &mut [u8]) {
    for word in data.as_chunks_mut::<4>().0 {
        let stored = i32::from_le_bytes(*word);
        let (exponent, mantissa) = (stored >> 24, (stored << 8) >> 8);
        // Exact in f64: -128..127 lies well within its exponents.
        let scale = f64::from_bits(((exponent + 1023) as u64) << 52);
        *word = ((f64::from(mantissa) * scale) as f32).to_le_bytes();
    }
}

/// RGBA from luma and chroma. `stride` is 4 or 8.
pub(super) fn color(data: &mut [u8], stride: usize) {
    let (largest, mask) = if stride == 4 { (255.0, 0xFF) } else { (65535.0, 0xFFFF) };
    for element in data.chunks_exact_mut(stride) {
        let [y, co, cg, alpha] = components(element, stride);
        let (y, alpha) = (y & mask, alpha & mask);
        // The highest bit of alpha tells how many bits there are.
        let all = if alpha == 0 { 1 } else { (2 << alpha.ilog2()) - 1 };
        let short = alpha & (all >> 1);
        let alpha = (short << 1) | (short & 1);
        let scale = largest / all as f32;
        let out = [y + co - cg, y + cg, y - co - cg, alpha].map(|c| round(c as f32 * scale));
        store(element, stride, out);
    }
}
