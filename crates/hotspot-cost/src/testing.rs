//! What several tests share.

use crate::{Cause, Frame, FrameDesc, PathEnd};
use hotspot_probe::{NONE, Probe, RayKind, RayProbe, Spawner};

/// A small repeatable generator (SplitMix64).
pub(crate) struct Random(u64);

impl Random {
    pub(crate) const fn new(seed: u64) -> Self {
        Self(seed)
    }

    pub(crate) const fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// In [0, 1).
    pub(crate) fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 * 2.0_f64.powi(-53)
    }

    /// In 0 .. below.
    pub(crate) fn below(&mut self, below: u32) -> u32 {
        (self.unit() * f64::from(below)) as u32
    }

    /// Standard normal (Box and Muller).
    pub(crate) fn normal(&mut self) -> f64 {
        (-2.0 * (1.0 - self.unit()).ln()).sqrt() * (std::f64::consts::TAU * self.unit()).cos()
    }
}

pub(crate) const SHADOW: Spawner =
    Spawner { object: 0, material: 0, bounce: 0, kind: RayKind::Shadow, light: 1 };

/// Records one path of random length and cost.
pub(crate) fn random_path(frame: &mut Frame, x: u32, y: u32, half: usize, random: &mut Random, cost: u32) {
    let desc = *frame.desc();
    let tile = (y / desc.tile * desc.width.div_ceil(desc.tile) + x / desc.tile) as usize;
    let tile = &mut frame.tiles_mut()[tile];
    let bright = random.below(4) > 0;
    let radiance = if bright { random.unit() as f32 } else { 0.0 };
    tile.film_mut(x, y, half).add([radiance, 0.5 * radiance, 0.25 * radiance]);
    if !desc.cost {
        return;
    }
    let mut pixel = tile.pixel(x, y, half);
    let mut path = pixel.path();
    for _ in 0..=random.below(4) {
        for by in [Spawner::CAMERA, SHADOW] {
            let mut ray = path.ray(by);
            for _ in 0..random.below(cost + 1) {
                ray.node(0, 5);
            }
            ray.leaf(0, random.below(cost + 1));
            ray.finish(random.below(2) == 0);
        }
        path.bsdf(2);
        path.texture(1, 16);
    }
    let cause =
        [Cause::Escaped, Cause::Absorbed, Cause::Roulette, Cause::DepthLimit][random.below(4) as usize];
    let first_object = if random.below(5) == 0 { NONE } else { x / 8 };
    path.end(PathEnd { cause, throughput: random.unit() as f32, brought_radiance: bright, first_object });
    tile.add_time(x, y, half, 1500, 1);
}

/// A frame of random paths.
pub(crate) fn random_frame(desc: FrameDesc, spp: u32, seed: u64) -> Frame {
    let mut frame = Frame::new(desc);
    let mut random = Random::new(seed);
    for (x, y) in frame.pixels() {
        for half in 0..frame.halves() {
            for _ in 0..spp {
                random_path(&mut frame, x, y, half, &mut random, 1 + x % 8);
            }
        }
    }
    frame
}
