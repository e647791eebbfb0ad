//! Text in pictures: the public-domain 8×8 bitmap font, scaled by whole factors.

use font8x8::legacy::{BASIC_LEGACY, LATIN_LEGACY};
use image::{Rgb, RgbImage};

/// Edge of a character at scale 1, in pixels.
pub(crate) const CELL: u32 = 8;

/// Rows of a character, each with its leftmost pixel in the lowest bit. What the font lacks is a question mark.
fn glyph(c: char) -> [u8; 8] {
    let code = c as usize;
    match code {
        0x20..=0x7e => BASIC_LEGACY[code],
        0xa0..=0xff => LATIN_LEGACY[code - 0xa0],
        // Greek mu, written by keyboards where the micro sign is meant.
        0x3bc => LATIN_LEGACY[0xb5 - 0xa0],
        _ => BASIC_LEGACY['?' as usize],
    }
}

/// Width of a line in pixels.
pub(crate) fn width(text: &str, scale: u32) -> u32 {
    (text.chars().count() as u32).saturating_mul(CELL * scale)
}

/// Draws a line with its top left corner at (x, y); what lies outside the picture is left out.
pub(crate) fn draw(image: &mut RgbImage, x: u32, y: u32, scale: u32, color: [u8; 3], text: &str) {
    for (i, c) in text.chars().enumerate() {
        let left = x.saturating_add((i as u32).saturating_mul(CELL * scale));
        if left >= image.width() {
            return;
        }
        for (row, bits) in glyph(c).into_iter().enumerate() {
            for column in (0..8).filter(|column| bits >> column & 1 == 1) {
                fill(image, left + column * scale, y + row as u32 * scale, scale, scale, color);
            }
        }
    }
}

/// Fills a rectangle as far as it lies in the picture.
pub(crate) fn fill(image: &mut RgbImage, x: u32, y: u32, width: u32, height: u32, color: [u8; 3]) {
    for row in y..y.saturating_add(height).min(image.height()) {
        for column in x..x.saturating_add(width).min(image.width()) {
            image.put_pixel(column, row, Rgb(color));
        }
    }
}

/// Breaks a text into lines of at most `columns` characters, at spaces where there are any.
pub(crate) fn wrap(text: &str, columns: usize) -> Vec<String> {
    let columns = columns.max(1);
    let mut lines: Vec<String> = Vec::new();
    let mut length = 0;
    for word in text.split_whitespace() {
        let letters: Vec<char> = word.chars().collect();
        for (i, piece) in letters.chunks(columns).enumerate() {
            let fits = i == 0 && length > 0 && length + 1 + piece.len() <= columns;
            match lines.last_mut() {
                Some(line) if fits => {
                    line.push(' ');
                    line.extend(piece);
                    length += 1 + piece.len();
                }
                _ => {
                    lines.push(piece.iter().collect());
                    length = piece.len();
                }
            }
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wraps_at_spaces_and_cuts_long_words() {
        assert_eq!(wrap("one two three", 7), ["one two", "three"]);
        assert_eq!(wrap("abcdefghij kl", 4), ["abcd", "efgh", "ij", "kl"]);
        assert!(wrap("", 5).is_empty());
        assert_eq!(wrap("ab", 0), ["a", "b"]);
    }

    #[test]
    fn draws_ink_and_stays_inside() {
        let mut image = RgbImage::new(20, 10);
        draw(&mut image, 0, 0, 1, [255; 3], "I\u{b5}\u{1F525} and much more than fits");
        assert!(image.pixels().filter(|p| p.0 == [255; 3]).count() > 20);
        draw(&mut image, u32::MAX, 4, 4, [255; 3], "x");
        fill(&mut image, 5, 5, u32::MAX, u32::MAX, [1, 2, 3]);
        assert_eq!(image.get_pixel(19, 9).0, [1, 2, 3]);
        assert_eq!(width("abc", 2), 48);
    }
}
