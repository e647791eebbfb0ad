//! Sample points: Owen-scrambled Sobol, or independent.
//!
//! Points come in sets of four dimensions ([`Dimensions`] says what each is for). Within a set, the samples of a pixel
//! are the first four dimensions of one Owen-scrambled, shuffled Sobol sequence (Burley, *Practical Hash-based Owen
//! Scrambling*, JCGT 2020; Laine–Karras hash as improved in the `sobol_burley` crate); sets and pixels are randomised
//! against each other by their seed (padding). A point depends on (pixel, sample index, set, seed) alone, so any range of
//! samples can be rendered anywhere.

use sobol_burley::sample_4d;

/// Which points to use.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum SamplerKind {
    /// Owen-scrambled Sobol.
    #[default]
    Sobol,
    /// Independent uniform numbers, for comparison.
    Independent,
}

impl SamplerKind {
    /// Name as shown in outputs and understood on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Sobol => "sobol",
            Self::Independent => "independent",
        }
    }
}

/// Sets of dimensions. A path uses set [`Dimensions::CAMERA`], then two sets at each surface vertex.
pub(crate) struct Dimensions;

impl Dimensions {
    /// 0, 1: position on the film; 2, 3: unused (a lens would use them).
    pub(crate) const CAMERA: u32 = 0;

    /// 0, 1: BSDF direction; 2, 3: light (choice and position).
    #[inline(always)]
    pub(crate) const fn directions(vertex: u32) -> u32 {
        1 + 2 * vertex
    }

    /// 0: choice of lobe; 1: roulette; 2: choice of a mixed material's part; 3: unused.
    #[inline(always)]
    pub(crate) const fn choices(vertex: u32) -> u32 {
        2 + 2 * vertex
    }
}

/// The points of one pixel's samples.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PixelSampler {
    kind: SamplerKind,
    key: u32,
}

/// The points of one sample.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sampler {
    kind: SamplerKind,
    key: u32,
    index: u32,
}

impl PixelSampler {
    /// The points of a pixel. Halves get sequences of their own.
    pub(crate) fn new(kind: SamplerKind, x: u32, y: u32, half: u32, seed: u64) -> Self {
        let key = hash(x, hash(y, hash(half, hash(seed as u32, (seed >> 32) as u32 ^ 0x5bd1_e995))));
        Self { kind, key }
    }

    /// The points of sample `index`. A Sobol sequence is exact to 2^16 samples; each further block of 2^16 has a
    /// scramble of its own.
    #[inline(always)]
    pub(crate) fn sample(&self, index: u64) -> Sampler {
        let block = (index >> 16) as u32;
        let key = if block == 0 { self.key } else { hash(block, self.key) };
        Sampler { kind: self.kind, key, index: index as u32 & 0xffff }
    }
}

impl Sampler {
    /// Four numbers in [0, 1) of set `set`.
    #[inline(always)]
    pub(crate) fn get(&self, set: u32) -> [f32; 4] {
        let seed = mix(self.key ^ set.wrapping_mul(0x9e37_79b9));
        match self.kind {
            SamplerKind::Sobol => sample_4d(self.index, 0, seed),
            SamplerKind::Independent => independent(seed, self.index),
        }
    }
}

#[inline(always)]
fn independent(seed: u32, index: u32) -> [f32; 4] {
    // pcg4d of Jarzynski and Olano, *Hash Functions for GPU Rendering* (JCGT 2020).
    let mut v = [seed, index, seed ^ 0xa511_e9b3, index ^ 0x63d8_3595]
        .map(|x| x.wrapping_mul(1_664_525).wrapping_add(1_013_904_223));
    for _ in 0..2 {
        v[0] = v[0].wrapping_add(v[1].wrapping_mul(v[3]));
        v[1] = v[1].wrapping_add(v[2].wrapping_mul(v[0]));
        v[2] = v[2].wrapping_add(v[0].wrapping_mul(v[1]));
        v[3] = v[3].wrapping_add(v[1].wrapping_mul(v[2]));
        v = v.map(|x| x ^ (x >> 16));
    }
    v.map(|x| (x >> 8) as f32 * (1.0 / 16_777_216.0))
}

/// A bijective scrambler of 32 bits (`lowbias32` constants of Wellons' hash prospector).
#[inline(always)]
pub(crate) const fn mix(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x7feb_352d);
    x ^= x >> 15;
    x = x.wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

/// Adds a word to a running hash.
#[inline(always)]
pub(crate) const fn hash(word: u32, state: u32) -> u32 {
    mix(word.wrapping_add(0x9e37_79b9) ^ mix(state))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Elementary intervals: 2^k samples of a Sobol pair put exactly one point into each cell of every 2^a × 2^b grid,
    /// a + b = k, for the pairs that matter (film; BSDF; the light pair is a (t, m, 2)-net with small t).
    #[test]
    fn the_named_pairs_are_stratified() {
        for set in [Dimensions::CAMERA, Dimensions::directions(0), Dimensions::directions(3)] {
            let pixel = PixelSampler::new(SamplerKind::Sobol, 17, 4, 0, 9);
            let points: Vec<_> = (0..256).map(|i| pixel.sample(i).get(set)).collect();
            for a in 0..=8u32 {
                let (columns, rows) = (1usize << a, 1usize << (8 - a));
                let mut seen = vec![false; 256];
                for p in &points {
                    let cell = (p[0] * columns as f32) as usize * rows + (p[1] * rows as f32) as usize;
                    assert!(!core::mem::replace(&mut seen[cell], true), "set {set}: {columns} x {rows}");
                }
            }
        }
    }

    #[test]
    fn numbers_are_uniform_and_below_one() {
        for kind in [SamplerKind::Sobol, SamplerKind::Independent] {
            let mut sum = [0.0f64; 4];
            let pixel = PixelSampler::new(kind, 1, 2, 0, 3);
            for i in 0..70_000 {
                for (s, v) in sum.iter_mut().zip(pixel.sample(i).get(5)) {
                    assert!((0.0..1.0).contains(&v));
                    *s += f64::from(v);
                }
            }
            // Standard error 0.289 / sqrt(70000) = 0.0011; five of them.
            assert!(sum.iter().all(|s| (s / 70_000.0 - 0.5).abs() < 0.0055), "{kind:?} {sum:?}");
        }
    }

    #[test]
    fn halves_pixels_and_blocks_have_their_own_points() {
        let first =
            |x, half, index| PixelSampler::new(SamplerKind::Sobol, x, 0, half, 0).sample(index).get(1);
        assert_ne!(first(0, 0, 0), first(1, 0, 0));
        assert_ne!(first(0, 0, 0), first(0, 1, 0));
        assert_ne!(first(0, 0, 0), first(0, 0, 1 << 16));
    }
}
