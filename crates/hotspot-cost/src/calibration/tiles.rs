//! Tiles of a picture with what was counted in them and the time they took.

use crate::counter::Counter;
use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::recorder::CostPixel;
use serde::{Deserialize, Serialize};

/// Edge of a tile in pixels. Time is fitted per tile: single pixels are too noisy, whole pictures too few.
pub const TILE: u32 = 8;

/// Splits of the repeats into halves are at most so many.
const MOST_SPLITS: usize = 16;

/// What a tile's time is explained by, per path.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Term {
    /// 1: what each path costs whatever it meets.
    Path,
    /// Camera and bounce rays.
    RaysTrace,
    /// Shadow rays.
    RaysShadow,
    /// Nodes visited.
    Nodes,
    /// Child boxes tested.
    Boxes,
    /// Leaf blocks tested.
    Leaves,
    /// Triangles tested.
    Shapes,
    /// Rays transformed into an instance's space.
    Instances,
    /// BSDF evaluations and samplings.
    Bsdf,
    /// Texture look-ups.
    Texture,
    /// Bytes of texels touched.
    TextureBytes,
    /// Alpha tests.
    AlphaTests,
}

impl Term {
    /// Number of terms.
    pub const COUNT: usize = 12;

    /// All of them, in index order.
    pub const ALL: [Self; Self::COUNT] = [
        Self::Path,
        Self::RaysTrace,
        Self::RaysShadow,
        Self::Nodes,
        Self::Boxes,
        Self::Leaves,
        Self::Shapes,
        Self::Instances,
        Self::Bsdf,
        Self::Texture,
        Self::TextureBytes,
        Self::AlphaTests,
    ];

    /// Name in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Path => "path",
            Self::RaysTrace => "rays_trace",
            Self::RaysShadow => "rays_shadow",
            Self::Nodes => "nodes",
            Self::Boxes => "boxes",
            Self::Leaves => "leaves",
            Self::Shapes => "shapes",
            Self::Instances => "instances",
            Self::Bsdf => "bsdf",
            Self::Texture => "texture",
            Self::TextureBytes => "texture_bytes",
            Self::AlphaTests => "alpha_tests",
        }
    }

    /// Its sum over the paths of a pixel.
    pub const fn sum(self, pixel: &CostPixel) -> f64 {
        let counter = match self {
            Self::Path => return pixel.samples as f64,
            Self::RaysTrace => {
                return (pixel.get(Counter::Rays) - pixel.get(Counter::RaysShadow)) as f64;
            }
            Self::RaysShadow => Counter::RaysShadow,
            Self::Nodes => Counter::Nodes,
            Self::Boxes => Counter::Boxes,
            Self::Leaves => Counter::Leaves,
            Self::Shapes => Counter::Shapes,
            Self::Instances => Counter::Instances,
            Self::Bsdf => Counter::Bsdf,
            Self::Texture => Counter::Texture,
            Self::TextureBytes => Counter::TextureBytes,
            Self::AlphaTests => Counter::AlphaTests,
        };
        pixel.get(counter) as f64
    }
}

/// One tile: means per path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tile {
    /// Column of tiles.
    pub column: u32,
    /// Row of tiles.
    pub row: u32,
    /// Counts, in the order of [`Term::ALL`].
    pub terms: [f64; Term::COUNT],
    /// Nanoseconds of one thread, from all repeats.
    pub ns: f64,
    /// Variance of `ns` by what the repeats differ in.
    pub noise: f64,
}

/// A scene's tiles.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tiles {
    /// Whole tiles per row; what is left over at the right and bottom edges is not used.
    pub columns: u32,
    /// Rows of tiles.
    pub rows: u32,
    /// Row by row from the top.
    pub tiles: Vec<Tile>,
    /// Speed of each repeat: its time over that of the median repeat, for the median pixel.
    pub drift: Vec<f64>,
}

impl Tiles {
    /// Mean time per path in nanoseconds; 0 without tiles.
    pub fn mean_ns(&self) -> f64 {
        if self.tiles.is_empty() {
            return 0.0;
        }
        self.tiles.iter().map(|tile| tile.ns).sum::<f64>() / self.tiles.len() as f64
    }
}

/// Timed runs of one scene, all of the same paths, that did not count.
#[derive(Clone, Debug)]
pub struct Timings {
    width: u32,
    height: u32,
    /// Nanoseconds per path for each pixel.
    repeats: Vec<Vec<f32>>,
}

impl Timings {
    /// None yet, for a picture of this size.
    pub const fn new(width: u32, height: u32) -> Self {
        Self { width, height, repeats: Vec::new() }
    }

    /// Adds a run.
    ///
    /// # Errors
    /// [`Error::Invalid`] when the frame has another size, or a pixel without time.
    pub fn add(&mut self, frame: &Frame) -> Result<()> {
        self.check(frame)?;
        let mut plane = Vec::with_capacity(self.width as usize * self.height as usize);
        for (x, y) in frame.pixels() {
            let pixel = frame.cost_total(x, y);
            if pixel.time_samples == 0 {
                return Err(Error::invalid(
                    format!("pixel ({x}, {y})"),
                    "no time was measured",
                    "gather time in the timed runs",
                ));
            }
            plane.push((pixel.time_ns as f64 / pixel.time_samples as f64) as f32);
        }
        self.repeats.push(plane);
        Ok(())
    }

    fn check(&self, frame: &Frame) -> Result<()> {
        let desc = frame.desc();
        if (desc.width, desc.height) == (self.width, self.height) {
            return Ok(());
        }
        Err(Error::invalid(
            "calibration",
            format!(
                "a run of {} x {} pixels among runs of {} x {}",
                desc.width, desc.height, self.width, self.height
            ),
            "time and count at one size",
        ))
    }

    /// Tiles with the counts of `counted`, which traced the same paths.
    ///
    /// A pixel's time is the median over the repeats, each first divided by its own speed (the median over pixels of its time
    /// over the pixel's median time), so that neither a thread that was interrupted in one pixel nor a machine that runs slower
    /// for a while shows.
    ///
    /// # Errors
    /// [`Error::Invalid`] with fewer than four repeats, another size, no whole tile, or a pixel without counts.
    pub fn tiles(&self, counted: &Frame) -> Result<Tiles> {
        self.check(counted)?;
        if self.repeats.len() < 4 {
            return Err(Error::invalid(
                "calibration",
                format!("{} repeats, and the median of each half needs two", self.repeats.len()),
                "time at least four",
            ));
        }
        let (columns, rows) = (self.width / TILE, self.height / TILE);
        if columns == 0 || rows == 0 {
            return Err(Error::invalid(
                "calibration",
                format!("{} x {} pixels hold no tile of {TILE} x {TILE}", self.width, self.height),
                "render larger",
            ));
        }
        let drift = self.drift();
        let all: Vec<usize> = (0..self.repeats.len()).collect();
        let plane = self.median_plane(&all, &drift);
        let mut tiles = Vec::with_capacity((columns * rows) as usize);
        for (row, column) in (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column))) {
            let mut terms = [0.0; Term::COUNT];
            let mut paths = 0.0;
            for (x, y) in pixels(column, row) {
                let pixel = counted.cost_total(x, y);
                if pixel.samples == 0 {
                    return Err(Error::invalid(
                        format!("pixel ({x}, {y})"),
                        "nothing was counted",
                        "gather cost in the counting run",
                    ));
                }
                paths += pixel.samples as f64;
                for (sum, term) in terms.iter_mut().zip(Term::ALL) {
                    *sum += term.sum(&pixel);
                }
            }
            let ns = self.tile_mean(&plane, counted, column, row);
            tiles.push(Tile { column, row, terms: terms.map(|sum| sum / paths), ns, noise: 0.0 });
        }
        let splits = self.splits();
        for [a, b] in &splits {
            let [a, b] = [a, b].map(|of| self.median_plane(of, &drift));
            for tile in &mut tiles {
                let mean = |plane: &[f32]| self.tile_mean(plane, counted, tile.column, tile.row);
                tile.noise += (mean(&a) - mean(&b)).powi(2) / (4.0 * splits.len() as f64);
            }
        }
        Ok(Tiles { columns, rows, tiles, drift })
    }

    /// Two halves of the repeats, in several ways, each as often with a neighbour as with one far off: those from the k-th on,
    /// round and round, against the rest (an odd one is left out). The halves' medians differ by 4 times the variance of the
    /// median of all, as means of independent runs would; by more where halves are small and the noise has heavy tails.
    fn splits(&self) -> Vec<[Vec<usize>; 2]> {
        let (count, half) = (self.repeats.len(), self.repeats.len() / 2);
        // Half way round the halves change places.
        let ways = if count % 2 == 0 { half } else { count };
        let taken = ways.min(MOST_SPLITS);
        let part = |from: usize| (from..from + half).map(|r| r % count).collect();
        (0..taken).map(|k| k * ways / taken).map(|from| [part(from), part(from + half)]).collect()
    }

    /// Mean of a plane over the paths of a tile.
    fn tile_mean(&self, plane: &[f32], counted: &Frame, column: u32, row: u32) -> f64 {
        let (mut sum, mut paths) = (0.0, 0.0);
        for (x, y) in pixels(column, row) {
            let samples = counted.cost_total(x, y).samples as f64;
            sum += f64::from(plane[(y * self.width + x) as usize]) * samples;
            paths += samples;
        }
        sum / paths
    }

    /// Each repeat's time over the median repeat's, for the median pixel.
    fn drift(&self) -> Vec<f64> {
        let even = vec![1.0; self.repeats.len()];
        let all: Vec<usize> = (0..self.repeats.len()).collect();
        let typical = self.median_plane(&all, &even);
        let speed = |plane: &Vec<f32>| {
            let mut ratios: Vec<f64> = plane
                .iter()
                .zip(&typical)
                .filter(|(_, typical)| **typical > 0.0)
                .map(|(ns, typical)| f64::from(ns / typical))
                .collect();
            if ratios.is_empty() { 1.0 } else { median(&mut ratios).max(f64::MIN_POSITIVE) }
        };
        self.repeats.iter().map(speed).collect()
    }

    fn median_plane(&self, repeats: &[usize], drift: &[f64]) -> Vec<f32> {
        let mut values = vec![0.0; repeats.len()];
        (0..self.width as usize * self.height as usize)
            .map(|pixel| {
                for (value, r) in values.iter_mut().zip(repeats) {
                    *value = f64::from(self.repeats[*r][pixel]) / drift[*r];
                }
                median(&mut values) as f32
            })
            .collect()
    }
}

fn pixels(column: u32, row: u32) -> impl Iterator<Item = (u32, u32)> {
    (0..TILE * TILE).map(move |i| (column * TILE + i % TILE, row * TILE + i / TILE))
}

/// The median, between the two middle values of an even number; 0 of none.
fn median(values: &mut [f64]) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    let n = values.len();
    match n {
        0 => 0.0,
        _ if n % 2 == 1 => values[n / 2],
        _ => 0.5 * (values[n / 2 - 1] + values[n / 2]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::FrameDesc;
    use crate::testing::random_frame;

    /// A frame of clock readings: `ns(x, y)` per path.
    fn timed(width: u32, height: u32, ns: impl Fn(u32, u32) -> u64) -> Frame {
        let mut frame = Frame::new(FrameDesc::new(width, height));
        for tile in frame.tiles_mut() {
            for (x, y) in tile.rect().pixels() {
                tile.add_time(x, y, 0, 4 * ns(x, y), 4);
            }
        }
        frame
    }

    #[test]
    fn interruptions_and_drift_do_not_show() {
        let mut timings = Timings::new(21, 16);
        let ns = |x: u32, y: u32| 1000 + 10 * u64::from(x) + u64::from(y);
        for r in 0..6 {
            // Each repeat runs at its own speed, and is interrupted in another pixel.
            let speed = 100 + 7 * r;
            timings
                .add(&timed(21, 16, |x, y| {
                    ns(x, y) * speed / 100
                        + if u64::from(x + 3 * y) % 6 == r && y == 1 { 4_000_000 } else { 0 }
                }))
                .unwrap();
        }
        let counted = random_frame(FrameDesc::new(21, 16), 2, 1);
        let tiles = timings.tiles(&counted).unwrap();
        assert_eq!((tiles.columns, tiles.rows, tiles.tiles.len()), (2, 2, 4));
        for tile in &tiles.tiles {
            let mean = |f: &dyn Fn(u32, u32) -> f64| {
                pixels(tile.column, tile.row).map(|(x, y)| f(x, y)).sum::<f64>() / 64.0
            };
            let expected = mean(&|x, y| ns(x, y) as f64);
            // The median repeat is the one at 117.5 % of the first; whole nanoseconds were rounded.
            assert!((tile.ns / expected - 1.175).abs() < 3e-3, "{} for {expected}", tile.ns);
            assert!(tile.noise.sqrt() < 3e-3 * expected, "{} for {expected}", tile.noise.sqrt());
            let nodes = mean(&|x, y| counted.cost(x, y, 0).unwrap().get(Counter::Nodes) as f64) / 2.0;
            assert!((tile.terms[Term::Nodes as usize] - nodes).abs() < 1e-12);
            assert_eq!(tile.terms[0], 1.0);
        }
        assert!((tiles.drift[5] / tiles.drift[0] - 1.35).abs() < 2e-3, "{:?}", tiles.drift);
    }

    /// Runs with independent noise: the variance that their differences show is that of the tiles' times about the truth. The
    /// standard deviation of the ratio is about 10 % for 160 tiles of 6 runs (13 % of 5); the seed is fixed.
    #[test]
    fn the_noise_is_that_of_the_tiles_times() {
        for repeats in [5, 6, 20] {
            let mut random = crate::testing::Random::new(21);
            let mut timings = Timings::new(128, 80);
            for _ in 0..repeats {
                let noise: Vec<f64> = (0..160).map(|_| random.normal()).collect();
                // A tile's pixels are late together.
                let ns = |x: u32, y: u32| 1e6 + 2e4 * noise[(y / TILE * 16 + x / TILE) as usize];
                timings.add(&timed(128, 80, |x, y| ns(x, y) as u64)).unwrap();
            }
            let tiles = timings.tiles(&random_frame(FrameDesc::new(128, 80), 1, 1)).unwrap();
            let mean = tiles.mean_ns();
            let spread: f64 = tiles.tiles.iter().map(|t| (t.ns - mean).powi(2)).sum();
            let noise: f64 = tiles.tiles.iter().map(|t| t.noise).sum();
            assert!((0.7..1.4).contains(&(noise / spread)), "{repeats}: {}", noise / spread);
        }
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        let counted = random_frame(FrameDesc::new(16, 8), 1, 1);
        let mut timings = Timings::new(16, 8);
        assert!(timings.add(&timed(8, 8, |_, _| 5)).is_err());
        assert!(timings.add(&Frame::new(FrameDesc::new(16, 8))).is_err());
        for _ in 0..3 {
            timings.add(&timed(16, 8, |_, _| 5)).unwrap();
        }
        assert!(timings.tiles(&counted).is_err());
        timings.add(&timed(16, 8, |_, _| 5)).unwrap();
        assert!(timings.tiles(&counted).is_ok());
        assert!(timings.tiles(&Frame::new(FrameDesc::new(16, 8))).is_err());
        let mut narrow = Timings::new(7, 8);
        for _ in 0..4 {
            narrow.add(&timed(7, 8, |_, _| 5)).unwrap();
        }
        assert!(narrow.tiles(&random_frame(FrameDesc::new(7, 8), 1, 1)).is_err());
    }

    #[test]
    fn terms_are_in_index_order() {
        for (index, term) in Term::ALL.into_iter().enumerate() {
            assert_eq!(term as usize, index);
            assert_eq!(serde_json::to_value(term).unwrap(), term.name());
        }
    }
}
