//! Curves on logarithmic axes, as SVG and as a picture.
//!
//! Hand-made on purpose: two axes, ticks at powers of ten, curves with bars; what charting crates would add are system
//! fonts and some fifty dependencies.

use super::text;
use image::{Rgb, RgbImage};
use std::fmt::Write;

/// A curve of points with vertical bars.
#[derive(Clone, Debug)]
pub struct Curve {
    /// Its name in the legend; none if empty.
    pub name: String,
    /// (x, y, lower and upper end of y's interval); all positive, others are left out.
    pub points: Vec<(f64, f64, [f64; 2])>,
}

/// A plot with logarithmic axes.
#[derive(Clone, Debug)]
pub struct LogPlot {
    /// Above it.
    pub title: String,
    /// Below the horizontal axis.
    pub x_label: String,
    /// Above the vertical axis.
    pub y_label: String,
    /// The curves; colours repeat after eight.
    pub curves: Vec<Curve>,
    /// A horizontal line and its name: a noise floor.
    pub level: Option<(f64, String)>,
    /// Slope of a thin line through the first point, for comparison.
    pub guide: Option<f64>,
}

const SIZE: [f64; 2] = [800.0, 560.0];
/// Left, top, right, bottom.
const MARGIN: [f64; 4] = [86.0, 62.0, 24.0, 58.0];
/// Height of a row of the legend.
const ROW: f64 = 22.0;
/// Okabe and Ito's colours, which colour-blind readers tell apart.
const COLORS: [[u8; 3]; 8] = [
    [0, 114, 178],
    [213, 94, 0],
    [0, 158, 115],
    [204, 121, 167],
    [86, 180, 233],
    [230, 159, 0],
    [60, 60, 60],
    [150, 140, 30],
];
const INK: [u8; 3] = [40, 40, 44];
const FAINT: [u8; 3] = [214, 214, 218];

/// What can be drawn, by either target.
trait Canvas {
    fn line(&mut self, from: [f64; 2], to: [f64; 2], width: f64, color: [u8; 3]);
    fn dot(&mut self, at: [f64; 2], radius: f64, color: [u8; 3]);
    /// `align`: 0 starts at `at`, 0.5 is centred on it, 1 ends at it. `at` is the middle of the line's height.
    fn text(&mut self, at: [f64; 2], align: f64, color: [u8; 3], words: &str);
}

struct Svg(String);

impl Canvas for Svg {
    fn line(&mut self, from: [f64; 2], to: [f64; 2], width: f64, [r, g, b]: [u8; 3]) {
        let _ = writeln!(
            self.0,
            "<line x1=\"{:.1}\" y1=\"{:.1}\" x2=\"{:.1}\" y2=\"{:.1}\" stroke=\"rgb({r},{g},{b})\" stroke-width=\"{width}\"/>",
            from[0], from[1], to[0], to[1]
        );
    }

    fn dot(&mut self, at: [f64; 2], radius: f64, [r, g, b]: [u8; 3]) {
        let _ = writeln!(
            self.0,
            "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"{radius}\" fill=\"rgb({r},{g},{b})\"/>",
            at[0], at[1]
        );
    }

    fn text(&mut self, at: [f64; 2], align: f64, [r, g, b]: [u8; 3], words: &str) {
        let anchor = if align < 0.25 {
            "start"
        } else if align > 0.75 {
            "end"
        } else {
            "middle"
        };
        let safe = words.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
        let _ = writeln!(
            self.0,
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"{anchor}\" dominant-baseline=\"central\" fill=\"rgb({r},{g},{b})\">\
             {safe}</text>",
            at[0], at[1]
        );
    }
}

/// A picture at twice the size.
struct Pixels(RgbImage);

const ZOOM: f64 = 2.0;

impl Canvas for Pixels {
    fn line(&mut self, from: [f64; 2], to: [f64; 2], width: f64, color: [u8; 3]) {
        let long = (to[0] - from[0]).hypot(to[1] - from[1]) * ZOOM;
        let steps = (long.ceil() as u32).clamp(1, 20_000);
        for step in 0..=steps {
            let part = f64::from(step) / f64::from(steps);
            let at = [0, 1].map(|axis| from[axis] + part * (to[axis] - from[axis]));
            self.dot(at, 0.5 * width, color);
        }
    }

    fn dot(&mut self, at: [f64; 2], radius: f64, color: [u8; 3]) {
        let ([x, y], radius) = (at.map(|v| v * ZOOM), (radius * ZOOM).max(0.5));
        for row in (y - radius).floor() as i64..=(y + radius).ceil() as i64 {
            for column in (x - radius).floor() as i64..=(x + radius).ceil() as i64 {
                let inside = (column as f64 + 0.5 - x).hypot(row as f64 + 0.5 - y) <= radius + 0.2;
                if let (true, Ok(u), Ok(v)) = (inside, u32::try_from(column), u32::try_from(row))
                    && let Some(pixel) = self.0.get_pixel_mut_checked(u, v)
                {
                    *pixel = Rgb(color);
                }
            }
        }
    }

    fn text(&mut self, at: [f64; 2], align: f64, color: [u8; 3], words: &str) {
        let scale = 2;
        let left = at[0] * ZOOM - align * f64::from(text::width(words, scale));
        let top = at[1] * ZOOM - f64::from(text::CELL * scale) / 2.0;
        text::draw(&mut self.0, left.max(0.0) as u32, top.max(0.0) as u32, scale, color, words);
    }
}

/// An axis: decades from `lo` to `hi`, mapped to `from`..`to`.
#[derive(Clone, Copy)]
struct Axis {
    lo: f64,
    hi: f64,
    from: f64,
    to: f64,
}

impl Axis {
    fn new(values: impl Iterator<Item = f64>, from: f64, to: f64) -> Self {
        let (lo, hi) = values
            .filter(|v| *v > 0.0 && v.is_finite())
            .map(libm::log10)
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (lo.min(v), hi.max(v)));
        let (lo, hi) = if lo <= hi { (lo, hi) } else { (0.0, 1.0) };
        let room = 0.06 * (hi - lo).max(0.5);
        Self { lo: lo - room, hi: hi + room, from, to }
    }

    fn place(self, value: f64) -> f64 {
        self.from + (libm::log10(value) - self.lo) / (self.hi - self.lo) * (self.to - self.from)
    }

    /// Values and whether they get a label: powers of ten, and 2 and 5 times them where there is room. Where that labels fewer
    /// than three within a decade, even steps.
    fn ticks(self) -> Vec<(f64, bool)> {
        let decades = self.hi - self.lo;
        let mut ticks = Vec::new();
        for exponent in self.lo.floor() as i32..=self.hi.ceil() as i32 {
            for m in [1.0, 2.0, 5.0] {
                let value = m * libm::exp10(f64::from(exponent));
                let at = libm::log10(value);
                if at >= self.lo && at <= self.hi && (m == 1.0 || decades < 4.0) {
                    ticks.push((value, m == 1.0 || decades < 2.0));
                }
            }
        }
        let few = ticks.iter().filter(|tick| tick.1).count() < 3;
        if few && decades < 1.0 { self.even_ticks() } else { ticks }
    }

    fn even_ticks(self) -> Vec<(f64, bool)> {
        let (lo, hi) = (libm::exp10(self.lo), libm::exp10(self.hi));
        let about = (hi - lo) / 4.0;
        let power = libm::exp10(libm::log10(about).floor());
        let step = [1.0, 2.0, 5.0].map(|m| m * power).into_iter().rev().find(|step| *step <= about);
        let step = step.unwrap_or(power);
        let first = (lo / step).ceil();
        (0..=12).map(|k| ((first + f64::from(k)) * step, true)).filter(|tick| tick.0 <= hi).collect()
    }
}

fn number(value: f64) -> String {
    if (1e-2..1e4).contains(&value) {
        format!("{}", (value * 1e6).round() / 1e6)
    } else {
        // As few digits as tell it to three places.
        format!("{:e}", format!("{value:.2e}").parse().unwrap_or(value))
    }
}

impl LogPlot {
    /// As a standalone SVG file.
    pub fn svg(&self) -> String {
        let mut svg = Svg(format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0} {1}\" width=\"{0}\" height=\"{1}\" \
             font-family=\"sans-serif\" font-size=\"14\">\n<rect width=\"{0}\" height=\"{1}\" fill=\"#fff\"/>\n",
            SIZE[0], SIZE[1]
        ));
        self.draw(&mut svg);
        svg.0 + "</svg>\n"
    }

    /// As a picture of 1600 × 1120 pixels.
    pub fn picture(&self) -> RgbImage {
        let size = SIZE.map(|s| (s * ZOOM) as u32);
        let mut pixels = Pixels(RgbImage::from_pixel(size[0], size[1], Rgb([255; 3])));
        self.draw(&mut pixels);
        pixels.0
    }

    fn draw(&self, canvas: &mut dyn Canvas) {
        let [left, top, right, bottom] = [MARGIN[0], MARGIN[1], SIZE[0] - MARGIN[2], SIZE[1] - MARGIN[3]];
        let drawn = |c: &Curve| -> Vec<(f64, f64, [f64; 2])> {
            c.points
                .iter()
                .copied()
                .filter(|p| p.0 > 0.0 && p.1 > 0.0 && p.0.is_finite() && p.1.is_finite())
                .collect()
        };
        let all: Vec<_> = self.curves.iter().flat_map(drawn).collect();
        let x = Axis::new(all.iter().map(|p| p.0), left, right);
        let values = all.iter().flat_map(|p| [p.1, p.2[0], p.2[1]]).chain(self.level.iter().map(|l| l.0));
        // The legend has rows of its own above the curves, up to half of the height.
        let named = self.curves.iter().filter(|curve| !curve.name.is_empty()).count();
        let legend = (ROW * named as f64).min(0.5 * (bottom - top));
        let y = Axis::new(values, bottom, top + legend);
        for (value, named) in x.ticks() {
            let at = x.place(value);
            canvas.line([at, top], [at, bottom], if named { 1.0 } else { 0.5 }, FAINT);
            if named {
                canvas.text([at, bottom + 16.0], 0.5, INK, &number(value));
            }
        }
        for (value, named) in y.ticks() {
            let at = y.place(value);
            canvas.line([left, at], [right, at], if named { 1.0 } else { 0.5 }, FAINT);
            if named {
                canvas.text([left - 8.0, at], 1.0, INK, &number(value));
            }
        }
        canvas.line([left, bottom], [right, bottom], 1.5, INK);
        canvas.line([left, top], [left, bottom], 1.5, INK);
        canvas.text([left, 18.0], 0.0, INK, &self.title);
        canvas.text([left, 44.0], 0.0, INK, &self.y_label);
        canvas.text([0.5 * (left + right), bottom + 40.0], 0.5, INK, &self.x_label);
        if let (Some(slope), Some(first)) = (self.guide, all.first()) {
            let end = |edge: f64| first.1 * libm::pow(libm::exp10(edge) / first.0, slope);
            let (from, to) = ((x.lo, end(x.lo)), (x.hi, end(x.hi)));
            let clip = |(edge, v): (f64, f64)| {
                let v = v.clamp(libm::exp10(y.lo), libm::exp10(y.hi));
                let back = libm::log10(first.0) + (libm::log10(v) - libm::log10(first.1)) / slope;
                (if slope == 0.0 { edge } else { back.clamp(x.lo, x.hi) }, v)
            };
            let [a, b] = [clip(from), clip(to)].map(|(e, v)| [x.place(libm::exp10(e)), y.place(v)]);
            canvas.line(a, b, 1.0, [150, 150, 156]);
        }
        if let Some((level, name)) = &self.level
            && *level > 0.0
        {
            let at = y.place(*level);
            canvas.line([left, at], [right, at], 1.5, [190, 60, 60]);
            canvas.text([right - 4.0, at - 11.0], 1.0, [190, 60, 60], name);
        }
        let mut row = top + 0.5 * ROW;
        for (index, curve) in self.curves.iter().enumerate() {
            let color = COLORS[index % COLORS.len()];
            let points = drawn(curve);
            for pair in points.windows(2) {
                let [a, b] = [pair[0], pair[1]].map(|p| [x.place(p.0), y.place(p.1)]);
                canvas.line(a, b, 2.0, color);
            }
            for (px, py, [lo, hi]) in points {
                let at = x.place(px);
                if lo > 0.0 && hi >= lo {
                    canvas.line([at, y.place(lo)], [at, y.place(hi)], 1.5, color);
                }
                canvas.dot([at, y.place(py)], 4.0, color);
            }
            if curve.name.is_empty() {
                continue;
            }
            canvas.line([right - 30.0, row], [right - 6.0, row], 3.0, color);
            canvas.text([right - 38.0, row], 1.0, INK, &curve.name);
            row += ROW;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plot(points: Vec<(f64, f64, [f64; 2])>) -> LogPlot {
        LogPlot {
            title: "a <b> & c".into(),
            x_label: "seconds".into(),
            y_label: "relMSE".into(),
            curves: vec![Curve { name: "sobol".into(), points }],
            level: Some((1e-4, "floor".into())),
            guide: Some(-1.0),
        }
    }

    #[test]
    fn an_axis_always_has_labels() {
        for (lo, hi) in [
            (344.0, 344.0),
            (1.29, 1.55),
            (0.86, 1.38),
            (1e-7, 1.1e-7),
            (2.1e6, 2.2e6),
            (1.0, 1e9),
            (3.0, 19.0),
        ] {
            let axis = Axis::new([lo, hi].into_iter(), 0.0, 1.0);
            let mut labels: Vec<String> =
                axis.ticks().into_iter().filter(|tick| tick.1).map(|tick| number(tick.0)).collect();
            assert!((3..=12).contains(&labels.len()), "{lo} to {hi}: {labels:?}");
            let count = labels.len();
            labels.dedup();
            assert_eq!(labels.len(), count, "{lo} to {hi}: {labels:?}");
        }
    }

    /// No curve or bar is drawn where the legend is: the names of four configurations were crossed by their curves.
    #[test]
    fn curves_keep_out_of_the_legend() {
        let flat = vec![(1.0, 0.1, [0.05, 0.2]), (10.0, 0.1, [0.05, 0.2])];
        let mut plot = plot(flat.clone());
        plot.guide = None;
        plot.curves = (0..4).map(|i| Curve { name: format!("curve {i}"), points: flat.clone() }).collect();
        let svg = plot.svg();
        let of = |line: &str, name: &str| {
            line.split(&format!(" {name}=\"")).nth(1).and_then(|rest| rest.split('"').next()?.parse().ok())
        };
        let lowest_name = svg
            .lines()
            .filter(|line| line.contains("curve "))
            .filter_map(|line| of(line, "y"))
            .fold(0.0, f64::max);
        let highest_dot = svg.lines().filter_map(|line| of(line, "cy")).fold(f64::INFINITY, f64::min);
        let highest_bar = svg
            .lines()
            .filter(|line| line.contains("stroke-width=\"1.5\"") && !line.contains("rgb(40,40,44)"))
            .filter_map(|line| of(line, "y2"))
            .fold(f64::INFINITY, f64::min);
        assert!(lowest_name > 100.0 && lowest_name + 8.0 < highest_bar.min(highest_dot), "{svg}");
    }

    #[test]
    fn points_lie_where_their_logarithms_say() {
        let axis = Axis { lo: 0.0, hi: 2.0, from: 100.0, to: 300.0 };
        assert_eq!((axis.place(1.0), axis.place(10.0), axis.place(100.0)), (100.0, 200.0, 300.0));
        let points = vec![(0.1, 0.1, [0.05, 0.2]), (1.0, 0.01, [0.005, 0.02]), (10.0, 0.001, [0.001, 0.001])];
        let svg = plot(points).svg();
        let places: Vec<f64> =
            svg.split("cx=\"").skip(1).map(|rest| rest.split('"').next().unwrap().parse().unwrap()).collect();
        assert!((places[1] - places[0] - (places[2] - places[1])).abs() < 0.11, "{places:?}");
        assert!(svg.contains("a &lt;b&gt; &amp; c") && !svg.contains("NaN"));
    }

    #[test]
    fn hostile_numbers_draw_nothing_and_break_nothing() {
        for points in [
            vec![],
            vec![(0.0, 1.0, [0.0, 0.0])],
            vec![(f64::NAN, 1.0, [1.0, 1.0]), (1.0, f64::INFINITY, [-1.0, f64::NAN])],
            vec![(1e-300, 1e300, [1e300, 1e300]), (1e300, 1e-300, [0.0, 0.0])],
        ] {
            let plot = plot(points);
            assert!(!plot.svg().contains("NaN"));
            assert_eq!(plot.picture().dimensions(), (1600, 1120));
        }
    }
}
