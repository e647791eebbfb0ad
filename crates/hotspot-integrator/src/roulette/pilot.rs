//! Paths before the render, that find the gain of roulette for efficiency ([`Survival`](super::Survival)).
//!
//! For some pixels they tell how much their samples vary and how many rays one casts, and for each vertex from the second on what
//! the path found after it and the rays that it cast there. All in relation to the pixel: light over the weight of the first
//! scattering, squares over that of the pixel's mean. Variance is that of the mean of some samples, times their number: stratified points
//! take away a part of it that longer paths would not.

use super::LEAST_BASE;
use crate::camera::FilmCamera;
use crate::class::{FullClass, Learning};
use crate::path::{PathSettings, Start, trace};
use crate::sampler::{Dimensions, PixelSampler, SamplerKind};
use crate::scene::RenderScene;
use hotspot_bvh::simd::{Simd, WithSimd, dispatch};
use hotspot_probe::{NoProbe, Probe, Spawner};
use rayon::prelude::*;
use std::ops::Range;

/// Gains are kept within these.
const GAINS: (f32, f32) = (1.0, 8.0);
/// What the estimate is multiplied by. It errs low, by what few paths miss of rare light and by what more samples than a pilot's
/// take from the variance by being stratified; and twice the best gain costs less (1 to 3 % on four scenes) than half of it (10 to 25 %).
const MARGIN: f64 = 1.5;
/// Pixels that are asked, and how many of them one thread takes at a time.
const PIXELS: u32 = 128;
const BATCH: u32 = 8;
/// Samples of each half of one. Not the render's number: a render stopped early is the same as a shorter one.
const SAMPLES: u32 = 16;
/// Share of the frame's mean at which a pixel's error begins to count in relation to that instead of to its own.
const FLOOR: f64 = 0.3;
/// From one of the pixels to the next, along the edges of the frame: Roberts' R2 sequence, the reciprocals of the plastic number and of its
/// square. (Equal steps from pixel to pixel, row after row, could all be in one column.)
const STEPS: [f64; 2] = [0.754_877_666_246_692_8, 0.569_840_290_998_053_3];
/// A seed of its own: the render is independent of what its roulette was learned from, and the gain is the same for all its seeds, so
/// that renders of several seeds are of one kind.
const SEED: u64 = 0x0b5e_55ed_6a1b_1e5f;

/// What to find a gain for.
pub(crate) struct Pilot<'a> {
    pub(crate) scene: &'a RenderScene,
    pub(crate) camera: FilmCamera,
    /// Of the frame, in pixels.
    pub(crate) size: (u32, u32),
    pub(crate) sampler: SamplerKind,
    /// With the survival to begin with.
    pub(crate) path: PathSettings<'a>,
}

impl Pilot<'_> {
    /// The gain for the scene: two rounds, since what the rest of a path brings and costs depends on it. Runs in the caller's thread
    /// pool; the result does not depend on the number of threads. `None` where nothing scatters any light.
    pub(crate) fn gain(mut self) -> Option<f32> {
        if self.path.max_depth < 2 {
            return None;
        }
        let first = gain_of(&self.round(0))?;
        self.path.roulette.gain = Some(first);
        let second = gain_of(&self.round(1));
        Some(second.map_or(first, |second| (first * second).sqrt()))
    }

    fn round(&self, round: u64) -> Vec<PixelSums> {
        let parts: Vec<Vec<PixelSums>> = (0..PIXELS / BATCH)
            .into_par_iter()
            .map(|batch| {
                let numbers = batch * BATCH..(batch + 1) * BATCH;
                dispatch(self.scene.bvh.isa(), Job { pilot: self, numbers, round })
            })
            .collect();
        parts.concat()
    }
}

/// Pixel `number` of the pilot's in a frame of this size, evenly over it.
fn pixel(number: u32, (width, height): (u32, u32)) -> (u32, u32) {
    let at = |step: f64, edge: u32| ((0.5 + step * f64::from(number)).fract() * f64::from(edge)) as u32;
    (at(STEPS[0], width), at(STEPS[1], height))
}

struct Job<'a> {
    pilot: &'a Pilot<'a>,
    numbers: Range<u32>,
    round: u64,
}

impl WithSimd for Job<'_> {
    type Output = Vec<PixelSums>;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Vec<PixelSums> {
        simd.vectorize(
            #[inline(always)]
            || {
                let Self { pilot, numbers, round } = self;
                let mut listener = Listener::new(pilot.path.max_depth);
                let mut pixels = Vec::new();
                for (x, y) in numbers.map(|number| pixel(number, pilot.size)) {
                    let mut sums = PixelSums::default();
                    let mut found = [0.0; 2];
                    for (half, found) in found.iter_mut().enumerate() {
                        let seed = SEED + round;
                        let points = PixelSampler::new(pilot.sampler, x, y, half as u32, seed);
                        for index in 0..SAMPLES {
                            let sampler = points.sample(index.into());
                            let [u, v, light @ ..] = sampler.get(Dimensions::segment(0));
                            let ray = pilot.camera.ray_of((x, y), [u, v], pilot.size);
                            listener.clear();
                            // The class that every scene can take: for so few paths another kernel would take too long to compile.
                            trace::<S, _, Learning<FullClass>, false>(
                                simd,
                                pilot.scene,
                                &pilot.path,
                                Start::new(ray, light),
                                &sampler,
                                &mut listener,
                            );
                            sums.add(&listener);
                            *found += listener.found / f64::from(SAMPLES);
                        }
                    }
                    sums.end(found);
                    pixels.push(sums);
                }
                pixels
            },
        )
    }
}

/// What the paths of a pixel found out.
#[derive(Clone, Copy, Debug, Default)]
struct PixelSums {
    paths: f64,
    rays: f64,
    /// Weights of the first scattering of the paths that have one, and their number.
    bases: f64,
    based: f64,
    /// Over the vertices from the second on: the square of what was found after them, for a throughput of 1, and the rays cast
    /// after them.
    later_squares: f64,
    later_rays: f64,
    /// Of a sample, over the weight of the first scattering.
    mean: f64,
    variance: f64,
}

impl PixelSums {
    fn add(&mut self, path: &Listener) {
        self.paths += 1.0;
        self.rays += f64::from(path.rays);
        if let Some(first) = path.vertices.first() {
            self.bases += f64::from(first.throughput);
            self.based += 1.0;
        }
        for vertex in path.vertices.iter().skip(1) {
            let later = (path.found - vertex.found) / f64::from(vertex.throughput);
            self.later_squares += later * later;
            self.later_rays += f64::from(path.rays - vertex.rays);
        }
    }

    /// `found`: means of the halves.
    fn end(&mut self, found: [f64; 2]) {
        let base = (self.bases / self.based.max(1.0)).max(LEAST_BASE.into());
        let [a, b] = found.map(|mean| mean / base);
        self.mean = 0.5 * (a + b);
        self.variance = 0.5 * (a - b) * (a - b) * (0.5 * self.paths);
    }
}

/// Means over pixels: variance of a sample, rays of one, and over all later vertices the squares of what was found after them and
/// the rays cast after them.
struct Means {
    variance: f64,
    rays: f64,
    later_squares: f64,
    later_rays: f64,
}

impl Means {
    fn of(pixels: &[PixelSums]) -> Self {
        let count = pixels.len() as f64;
        let mean = |of: &dyn Fn(&PixelSums) -> f64| pixels.iter().map(of).sum::<f64>() / count;
        let floor = FLOOR * mean(&|p| p.mean);
        let relative = |p: &PixelSums, square: f64| square / (p.mean * p.mean + floor * floor);
        Self {
            variance: mean(&|p| relative(p, p.variance)),
            rays: mean(&|p| p.rays / p.paths),
            later_squares: mean(&|p| relative(p, p.later_squares)),
            later_rays: mean(&|p| p.later_rays),
        }
    }
}

/// The formula of the module above, with a margin.
fn gain_of(pixels: &[PixelSums]) -> Option<f32> {
    let Means { variance, rays, later_squares, later_rays } = Means::of(pixels);
    let gain = (MARGIN * (later_squares / later_rays * (rays / variance)).sqrt()) as f32;
    (gain > 0.0 && gain.is_finite()).then(|| gain.clamp(GAINS.0, GAINS.1))
}

/// Listens to one path.
struct Listener {
    max_depth: u32,
    rays: u32,
    /// Luminance, without what the camera sees shining.
    found: f64,
    /// Those that the path went on from.
    vertices: Vec<Vertex>,
}

struct Vertex {
    throughput: f32,
    /// Rays cast and luminance found until then.
    rays: u32,
    found: f64,
}

impl Listener {
    fn new(max_depth: u32) -> Self {
        Self { max_depth, rays: 0, found: 0.0, vertices: Vec::new() }
    }

    fn clear(&mut self) {
        (self.rays, self.found) = (0, 0.0);
        self.vertices.clear();
    }
}

impl Probe for Listener {
    const ON: bool = true;
    type Ray<'r> = NoProbe;

    #[inline(always)]
    fn ray(&mut self, _by: Spawner) -> NoProbe {
        self.rays += 1;
        NoProbe
    }

    #[inline(always)]
    fn untraced(&mut self, _by: Spawner) {
        self.rays += 1;
    }

    #[inline(always)]
    fn bsdf(&mut self, _evaluations: u32) {}

    #[inline(always)]
    fn texture(&mut self, _lookups: u32, _bytes: u32) {}

    #[inline(always)]
    fn light(&mut self, left: u32, luminance: f32) {
        if left < self.max_depth && luminance.is_finite() {
            self.found += f64::from(luminance);
        }
    }

    #[inline(always)]
    fn scattered(&mut self, throughput: f32) {
        if throughput > 0.0 {
            self.vertices.push(Vertex { throughput, rays: self.rays, found: self.found });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{PrepareOptions, Roulette, Settings};
    use std::path::Path;

    #[test]
    fn the_gain_is_that_of_the_formula() {
        // Later squares 12 for a mean of 2, so 12 / (4 + 0.36) in relation to the pixel; the variance likewise.
        let pixel = PixelSums {
            paths: 8.0,
            rays: 48.0,
            bases: 4.0,
            based: 8.0,
            later_squares: 12.0,
            later_rays: 9.0,
            mean: 2.0,
            variance: 2.0,
        };
        let gain = gain_of(&[pixel; 3]).unwrap();
        assert!((gain - 1.5 * (12.0f32 / 9.0 * 6.0 / 2.0).sqrt()).abs() < 1e-6, "{gain}");
        assert_eq!(gain_of(&[PixelSums { later_squares: 1e9, ..pixel }]), Some(GAINS.1));
        assert_eq!(gain_of(&[PixelSums { later_squares: 0.0, ..pixel }]), None);
        assert_eq!(gain_of(&[PixelSums { variance: 0.0, ..pixel }]), None);
        assert_eq!(gain_of(&[PixelSums { later_squares: f64::NAN, ..pixel }]), None);
        // In relation to each pixel, but for what is dark beside the mean of all.
        let bright = PixelSums { later_squares: 1200.0, mean: 20.0, variance: 200.0, ..pixel };
        let floor = (0.3f64 * 8.0).powi(2);
        let means = Means::of(&[pixel, pixel, bright]);
        let expected = (2.0 * 2.0 / (4.0 + floor) + 200.0 / (400.0 + floor)) / 3.0;
        assert!((means.variance - expected).abs() < 1e-12, "{}", means.variance);
        assert!((means.later_squares - 6.0 * expected).abs() < 1e-12, "{}", means.later_squares);
        let mut halves = PixelSums { mean: 0.0, variance: 0.0, ..pixel };
        halves.end([1.0, 2.0]);
        assert_eq!((halves.mean, halves.variance), (3.0, 0.5 * 4.0 * 4.0));
    }

    /// In whatever frame: no column or row of an eighth of it without pixels, none with more than twice its share.
    #[test]
    fn pixels_lie_all_over_the_frame() {
        for size in [(256, 256), (320, 180), (1920, 1080), (300, 200), (8, 8), (1, 1), (1, 999)] {
            let pixels: Vec<(u32, u32)> = (0..PIXELS).map(|number| pixel(number, size)).collect();
            assert!(pixels.iter().all(|(x, y)| *x < size.0 && *y < size.1));
            for (of, edge) in [
                (pixels.iter().map(|p| p.0).collect::<Vec<_>>(), size.0),
                (pixels.iter().map(|p| p.1).collect(), size.1),
            ] {
                for part in (0..8).filter(|_| edge >= 8) {
                    let inside = of.iter().filter(|x| **x * 8 / edge == part).count() as u32;
                    assert!(
                        (PIXELS / 16..=PIXELS / 4).contains(&inside),
                        "{size:?}: {inside} in part {part}"
                    );
                }
            }
        }
    }

    /// Variance times rays is at the gain that was found within 15 % of the least that any gain has, and gains far from it are
    /// worse than that. The seeds are fixed.
    #[test]
    fn the_gain_that_is_found_is_about_the_best() {
        let file =
            Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/cornell-box-red/cornell-box-red.gltf");
        let loaded = hotspot_scene::load(&file, &Default::default()).unwrap();
        let camera = loaded.cameras[0].clone();
        let scene = RenderScene::prepare(&loaded, PrepareOptions::default()).unwrap();
        let mut settings = Settings::new(64, 64);
        settings.roulette = Roulette::Efficient;
        let film = settings.film_camera(&camera);
        let guides = settings.guides(&scene, Some(&film));
        let found = settings.path(true, &guides).roulette.gain.unwrap();
        let price = |gain: f32| {
            let mut path = settings.path(true, &guides);
            path.roulette.gain = Some(gain);
            let pilot =
                Pilot { scene: &scene, camera: film, size: (64, 64), sampler: settings.sampler, path };
            let pixels: Vec<PixelSums> = (2..10).flat_map(|round| pilot.round(round)).collect();
            let means = Means::of(&pixels);
            means.variance * means.rays
        };
        let prices = [0.3, 0.6, 1.0, 1.5, 2.0, 3.0, 4.0, 8.0, 1e3].map(price);
        let least = prices.into_iter().fold(f64::INFINITY, f64::min);
        let paid = price(found);
        assert!(paid < 1.15 * least, "{paid} at {found}, {prices:?}");
        assert!(prices[0] > 1.15 * least && prices[8] > 1.15 * least, "{prices:?}");
    }
}
