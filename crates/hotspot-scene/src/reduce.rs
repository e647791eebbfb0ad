//! Pictures to smaller ones, by averaging.

use std::sync::LazyLock;

use crate::budget::room_for;
use crate::error::Result;

/// Averages blocks of texels. The colours of a colour texture are averaged as light (decoded from sRGB); alpha, and data such
/// as roughness and normals, as the numbers they are. `size` is at most the picture's on both sides; where it does not
/// divide the picture's, some blocks are one texel wider.
pub(crate) fn reduce(
    picture: &image::RgbaImage,
    size: [u32; 2],
    is_color: bool,
    element: &str,
) -> Result<Vec<u8>> {
    let [width, height] = size.map(|side| side.max(1) as usize);
    let (from_width, from_height) = (picture.width() as usize, picture.height() as usize);
    let start = |i: usize, from: usize, to: usize| (i as u64 * from as u64 / to as u64) as usize;
    let mut out = room_for(4 * width * height, element)?;
    let rows: Vec<&[u8]> = picture.chunks_exact(4 * from_width.max(1)).collect();
    for y in 0..height {
        let band = start(y, from_height, height)..start(y + 1, from_height, height);
        let band = rows.get(band).unwrap_or_default();
        for x in 0..width {
            let block = 4 * start(x, from_width, width)..4 * start(x + 1, from_width, width);
            let mut sums = [0.0f64; 4];
            let mut count = 0.0;
            for texel in
                band.iter().flat_map(|row| row.get(block.clone()).unwrap_or_default().chunks_exact(4))
            {
                for (channel, (sum, byte)) in sums.iter_mut().zip(texel).enumerate() {
                    *sum += if is_color && channel < 3 { decode(*byte) } else { f64::from(*byte) };
                }
                count += 1.0;
            }
            for (channel, sum) in sums.into_iter().enumerate() {
                let mean = sum / f64::max(count, 1.0);
                out.push(if is_color && channel < 3 { encode(mean) } else { mean.round() as u8 });
            }
        }
    }
    Ok(out)
}

/// Light of an sRGB-encoded number in 0..1 (IEC 61966-2-1).
fn light(encoded: f64) -> f64 {
    if encoded <= 0.04045 { encoded / 12.92 } else { libm::pow((encoded + 0.055) / 1.055, 2.4) }
}

fn decode(byte: u8) -> f64 {
    static TABLE: LazyLock<[f64; 256]> = LazyLock::new(|| std::array::from_fn(|i| light(i as f64 / 255.0)));
    TABLE[usize::from(byte)]
}

/// The nearest byte, in terms of the encoded numbers.
fn encode(linear: f64) -> u8 {
    /// The light half-way (when encoded) between each byte and the next.
    static BETWEEN: LazyLock<[f64; 255]> =
        LazyLock::new(|| std::array::from_fn(|i| light((i as f64 + 0.5) / 255.0)));
    // At most 255 of them.
    BETWEEN.partition_point(|between| *between <= linear) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_byte_survives_decoding_and_encoding() {
        for byte in 0..=255 {
            assert_eq!(encode(decode(byte)), byte);
        }
        assert_eq!((encode(-1.0), encode(2.0)), (0, 255));
    }

    #[test]
    fn colours_average_as_light_and_the_rest_as_numbers() {
        let texels = [[0, 0, 255, 0], [255, 0, 255, 255]].concat();
        let picture = image::RgbaImage::from_raw(2, 1, texels).unwrap();
        // Half the light of white is 0.7354 encoded.
        assert_eq!(reduce(&picture, [1, 1], true, "").unwrap(), [188, 0, 255, 128]);
        assert_eq!(reduce(&picture, [1, 1], false, "").unwrap(), [128, 0, 255, 128]);
    }

    #[test]
    fn each_texel_counts_once_where_sizes_do_not_divide() {
        let column = |r: u8| [r, 0, 0, 255];
        let picture =
            image::RgbaImage::from_raw(5, 1, (0..5).flat_map(|i| column(10 * i)).collect()).unwrap();
        let got = reduce(&picture, [2, 1], false, "").unwrap();
        // Columns 0 and 1, then 2 to 4.
        assert_eq!(got, [5, 0, 0, 255, 30, 0, 0, 255]);
    }
}
