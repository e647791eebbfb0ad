//! The strip below a heat map: what it shows, on which scale, and what the view altered.

use super::colormap::SIGNAL;
use super::heat::HeatOptions;
use super::numbers::{compact, ordinal, pixels, ticks};
use super::text::{self, CELL};
use super::view::{SPIKE, View};
use image::RgbImage;

const BACKGROUND: [u8; 3] = [24, 25, 28];
const BRIGHT: [u8; 3] = [240, 240, 240];
const DIM: [u8; 3] = [178, 182, 189];

/// Narrowest strip: 25 characters. Pictures below it get a wider canvas.
const MIN_WIDTH: u32 = 216;

/// Longest text of a caller that is drawn.
const MAX_TEXT: usize = 160;

/// A strip laid out for a picture.
pub(crate) struct Legend {
    /// Width of the canvas that picture and strip share.
    pub(crate) width: u32,
    /// Height of the strip.
    pub(crate) height: u32,
    scale: u32,
    lines: Vec<(String, [u8; 3])>,
    title_lines: usize,
}

impl Legend {
    /// Lays the strip out for a view's width.
    pub(crate) fn new(view: &View, options: &HeatOptions) -> Self {
        let width = view.size.0.max(MIN_WIDTH);
        let scale = match width {
            0..400 => 1,
            400..1400 => 2,
            1400..2800 => 3,
            _ => 4,
        };
        let columns = ((width - 2 * pad(scale)) / (CELL * scale)) as usize;
        let mut lines = Vec::new();
        let mut add = |text: String, color| {
            let short: String = text.chars().take(MAX_TEXT).collect();
            lines.extend(text::wrap(&short, columns).into_iter().map(|line| (line, color)));
            lines.len()
        };
        // "Rays" rather than "Rays [rays]".
        let named = options.label.to_lowercase().contains(&options.unit.to_lowercase());
        let unit = if named { String::new() } else { format!(" [{}]", options.unit) };
        let title_lines = add(format!("{}{unit}", options.label), BRIGHT);
        for note in notes(view) {
            add(note, DIM);
        }
        let text_height = lines.len() as u32 * line_height(scale);
        let height = text_height + bar_height(scale) + 2 * CELL * scale + 2 * pad(scale);
        Self { width, height, scale, lines, title_lines }
    }

    /// Draws it with its top at row `top`.
    pub(crate) fn draw(&self, image: &mut RgbImage, top: u32, view: &View, lut: &[[u8; 3]]) {
        let (scale, pad) = (self.scale, pad(self.scale));
        text::fill(image, 0, top, self.width, self.height, BACKGROUND);
        let mut y = top + pad;
        let (title, rest) = self.lines.split_at(self.title_lines);
        for (line, color) in title {
            text::draw(image, pad, y, scale, *color, line);
            y += line_height(scale);
        }
        let bar = self.width - 2 * pad;
        for x in 0..bar {
            let color = lut.get(x as usize * lut.len() / bar as usize).copied().unwrap_or(SIGNAL);
            text::fill(image, pad + x, y, 1, bar_height(scale), color);
        }
        self.draw_ticks(image, y + bar_height(scale), bar, view);
        y += bar_height(scale) + 2 * CELL * scale;
        for (line, color) in rest {
            text::draw(image, pad, y, scale, *color, line);
            y += line_height(scale);
        }
    }

    fn draw_ticks(&self, image: &mut RgbImage, y: u32, bar: u32, view: &View) {
        let (scale, pad) = (self.scale, pad(self.scale));
        let (lo, hi) = (f64::from(view.lo), f64::from(view.hi));
        let wanted = (bar / (CELL * scale * 7)).clamp(4, 10) as usize;
        let mut free = 0;
        for (value, label) in ticks(lo, hi, wanted) {
            let x = pad + (((value - lo) / (hi - lo)).clamp(0.0, 1.0) * f64::from(bar - 1)) as u32;
            let width = text::width(&label, scale);
            let left = x.saturating_sub(width / 2).min(self.width.saturating_sub(width + 1));
            if left < free {
                continue;
            }
            text::fill(image, x.saturating_sub(scale / 2), y, scale, CELL * scale / 2, DIM);
            text::draw(image, left, y + CELL * scale * 5 / 8, scale, BRIGHT, &label);
            free = left + width + CELL * scale;
        }
    }
}

/// What a view altered, in sentences: its scale, what was clipped and despiked, what is not finite.
pub fn notes(view: &View) -> Vec<String> {
    let range = format!("scale {} to {}", compact(view.lo.into()), compact(view.hi.into()));
    let mut notes = vec![match view.clip_percentile {
        Some(p) => format!("{range}: clipped at the {} percentile, {}", ordinal(p), pixels(view.clipped)),
        None if view.clipped > 0 => format!("{range}: fixed, {} outside", pixels(view.clipped)),
        None => format!("{range}: nothing clipped"),
    }];
    if view.despiked > 0 {
        let above = format!(
            "despiked: 3x3 median in {} above the 99.9th percentile",
            pixels(view.despiked - view.spikes)
        );
        notes.push(match view.spikes {
            0 => above,
            spikes => format!("{above} and in {} above {SPIKE} times their 3x3 median", pixels(spikes)),
        });
    } else if view.despike_above.is_finite() {
        notes.push("despiked: no pixel needed it".into());
    }
    if view.nonfinite > 0 {
        notes.push(format!("not a finite number: {}, drawn magenta", pixels(view.nonfinite)));
    }
    notes
}

const fn pad(scale: u32) -> u32 {
    CELL * scale
}

const fn line_height(scale: u32) -> u32 {
    CELL * scale * 3 / 2
}

const fn bar_height(scale: u32) -> u32 {
    CELL * scale * 5 / 4
}
