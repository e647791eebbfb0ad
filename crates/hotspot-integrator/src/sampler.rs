//! Sample points: Owen-scrambled Sobol, or independent.
//!
//! Points come in sets of four dimensions ([`Dimensions`] says what each is for). Within a set, the samples of a pixel
//! are four dimensions of one Owen-scrambled, shuffled Sobol sequence (Burley, *Practical Hash-based Owen
//! Scrambling*, JCGT 2020; Laine–Karras hash as improved in the `sobol_burley` crate). Four segments in a row share a sequence
//! of sixteen dimensions; all other sets, and pixels, are randomised against each other by their seed (padding). A point depends on (pixel, sample index, set, seed) alone, so any range of
//! samples can be rendered anywhere.
//!
//! # Which number is used for what
//!
//! Numbers of one set are stratified jointly best, so a set holds what one term of the path integral depends on most. The
//! light that a vertex sends on towards the camera is a function of the direction that led to the vertex and of the point
//! chosen on a light; the direction sampled *at* the vertex belongs to the next term. Hence one set per segment
//! ([`Dimensions::segment`]): the pair that made the direction (the position on the film, or the BSDF's sample at the vertex
//! before), and the pair of the light sample where it lands. A path of n vertices uses n + 1 of them. Light of two bounces and more
//! depends on the directions before as well, so segments 1 to 4, 5 to 8, and so on take the same points of one sequence, dimensions
//! 0 to 3, 4 to 7, 8 to 11 and 12 to 15 of it.
//!
//! | set | 0, 1 | 2, 3 |
//! |---|---|---|
//! | segment 0 | position on the film | light at the first vertex |
//! | segment k | BSDF direction at vertex k − 1 | light at vertex k |
//! | choices k | –, roulette at vertex k | part of a mixed material at vertex k, – |
//!
//! Where a BSDF has several lobes, the first number of its pair chooses the lobe and what remains of it is stretched and used
//! on, so that lobe and direction are stratified as one; likewise the light's pair chooses the light first
//! ([`light`](crate::light)). Roulette and mixtures have numbers of their own: they decide about everything that follows.
//!
//! The pair 0, 1 of the film and of segments 1, 5, … is a (0, 2)-sequence: 2^k samples put one point into each cell of every
//! 2^a × 2^b grid, a + b = k. Later pairs and sets jointly are nets of lesser quality. All this holds best for powers of two samples;
//! other numbers are as right but less even.
//!
//! The points of a set by itself are those of `sobol_burley::sample_4d`, bit for bit (a test compares them); only the work is arranged for a
//! renderer: the unscrambled points come from two tables, and the hashes of a set are made once per pixel.

use hotspot_bvh::simd::{Portable, Simd};
use sobol_burley::parts;
use std::sync::LazyLock;

/// Four Sobol dimensions of indices below 2^16, bits reversed as in `sobol_burley`: the exclusive or of one row
/// by the index's high byte (reversed: the low bits come first) and one by its low byte.
pub(crate) type Table = [[[u32; 4]; 256]; 2];

/// Numbers in a half of a [`Table`].
pub(crate) const ROW: u32 = 4 * 256;

/// Segments that share a sequence.
pub(crate) const TOGETHER: u32 = 4;

/// Tables of the Sobol dimensions of those segments, in their order: four each. Sets by themselves take the first.
pub(crate) static TABLES: LazyLock<[Table; TOGETHER as usize]> = LazyLock::new(|| {
    core::array::from_fn(|place| {
        let row = |reversed: u32| [0, 1, 2, 3].map(|d| parts::sobol_rev(reversed, 4 * place as u32 + d));
        [24, 16].map(|shift| core::array::from_fn(|byte| row((byte as u32) << shift)))
    })
});

/// Which of [`TABLES`] a set takes, and the set that gives the order of its points: sets of one sequence have it in common.
#[inline(always)]
const fn sequence(set: u32) -> (u32, u32) {
    if set == 0 || set % 2 == 1 {
        return (0, set);
    }
    let place = (set / 2 - 1) % TOGETHER;
    (place, set - 2 * place)
}

/// Sets whose hashes are kept per pixel (eight vertices deep); deeper ones are hashed each time.
const KEPT: usize = 16;

/// Of the sets that are kept: [`sequence`]'s table, and what a pixel's key is mixed with for the seed of the set and of that which gives
/// the order of its points.
const SEQUENCES: ([u32; KEPT], [[u32; KEPT]; 2]) = {
    let (mut tables, mut seeds) = ([0; KEPT], [[0; KEPT]; 2]);
    let mut set = 0;
    while set < KEPT {
        let (table, order) = sequence(set as u32);
        tables[set] = table;
        seeds[0][set] = salt_of(set as u32);
        seeds[1][set] = salt_of(order);
        set += 1;
    }
    (tables, seeds)
};

/// The scrambles of the sets that are kept, as [`Scrambles`] has them.
#[derive(Clone, Copy)]
struct Kept {
    indices: [u32; KEPT],
    dimensions: [[u32; 4]; KEPT],
}

impl Kept {
    /// Not inlined: within a kernel the compiler may not see that it can hash several at once.
    #[inline(never)]
    fn of<S: Simd>(simd: S, key: u32) -> Self {
        simd.vectorize(
            #[inline(always)]
            || Self::new(key),
        )
    }

    /// Hash by hash for all sets rather than set by set, in loops that are as simple as can be, so that the compiler does several at
    /// once: a pixel is visited for few samples at a time, twice where it has halves.
    #[inline(always)]
    fn new(key: u32) -> Self {
        let (_, [sets, orders]) = SEQUENCES;
        let (mut bases, mut indices) = ([0; KEPT], [0; KEPT]);
        for (base, salt) in bases.iter_mut().zip(sets) {
            *base = base_of_seed(mix(key ^ salt));
        }
        for (index, salt) in indices.iter_mut().zip(orders) {
            *index = index_of_seed(mix(key ^ salt));
        }
        let mut dimensions = [DIMENSIONS; KEPT];
        for (dimensions, base) in dimensions.iter_mut().zip(bases) {
            for d in dimensions {
                *d = parts::hash(*d ^ base);
            }
        }
        Self { indices, dimensions }
    }
}

/// What `sobol_burley` hashes the dimensions of a set with.
pub(crate) const DIMENSIONS: [u32; 4] = [0x912f_69ba, 0x174f_18ab, 0x691e_72ca, 0xb40c_c1b8];

/// The scrambles of a set: of the index, and of the four dimensions; and which table they are of.
#[derive(Clone, Copy, Debug)]
struct Scrambles {
    table: u32,
    index: u32,
    dimensions: [u32; 4],
}

impl Scrambles {
    #[inline(always)]
    fn new(key: u32, set: u32) -> Self {
        let (table, order) = sequence(set);
        Self { table, index: index_of_seed(seed_of(key, order)), ..Self::of_seed(seed_of(key, set)) }
    }

    /// As `sobol_burley` derives them from its seed.
    #[inline(always)]
    fn of_seed(seed: u32) -> Self {
        let mut dimensions = DIMENSIONS;
        for d in &mut dimensions {
            *d = parts::hash(*d ^ base_of_seed(seed));
        }
        Self { table: 0, index: index_of_seed(seed), dimensions }
    }
}

#[inline(always)]
const fn base_of_seed(seed: u32) -> u32 {
    seed.wrapping_mul(0x9c8f_2d3b)
}

#[inline(always)]
fn index_of_seed(seed: u32) -> u32 {
    parts::hash(seed ^ 0x79c6_8e4a)
}

/// The seed of a set, from a pixel's key.
#[inline(always)]
const fn seed_of(key: u32, set: u32) -> u32 {
    mix(key ^ salt_of(set))
}

#[inline(always)]
const fn salt_of(set: u32) -> u32 {
    set.wrapping_mul(0x9e37_79b9)
}

#[inline(always)]
fn sobol(tables: &[Table; TOGETHER as usize], index: u32, scrambles: &Scrambles) -> [f32; 4] {
    let index = parts::owen_scramble_rev(index.reverse_bits(), scrambles.index);
    let table = &tables[scrambles.table as usize];
    let high = &table[0][(index >> 24) as usize];
    let low = &table[1][(index >> 16 & 0xff) as usize];
    let mut points = [0.0; 4];
    for i in 0..4 {
        let scrambled = parts::owen_scramble_rev(high[i] ^ low[i], scrambles.dimensions[i]);
        points[i] = parts::u32_to_f32_norm(scrambled.reverse_bits());
    }
    points
}

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

/// Sets of dimensions, two for each surface vertex, counted from 0 at the camera ray's hit. What each number is for, and why,
/// stands in the module's documentation.
pub(crate) struct Dimensions;

impl Dimensions {
    /// 0, 1: the direction that leads to the vertex (the position on the film for vertex 0, the BSDF's direction at the vertex
    /// before for others); 2, 3: the light sampled at the vertex (choice and position).
    #[inline(always)]
    pub(crate) const fn segment(vertex: u32) -> u32 {
        2 * vertex
    }

    /// 0: unused; 1: roulette; 2: choice of a mixed material's part; 3: unused.
    #[inline(always)]
    pub(crate) const fn choices(vertex: u32) -> u32 {
        1 + 2 * vertex
    }
}

/// The points of one pixel's samples.
#[derive(Clone, Copy)]
pub(crate) struct PixelSampler {
    kind: SamplerKind,
    key: u32,
    tables: &'static [Table; TOGETHER as usize],
    kept: Kept,
}

/// The points of one sample.
#[derive(Clone, Copy)]
pub(crate) struct Sampler<'a> {
    pixel: &'a PixelSampler,
    block: u32,
    index: u32,
}

/// What the points of a pixel go by.
#[inline(always)]
pub(crate) const fn pixel_key([x, y, half]: [u32; 3], seed: u64) -> u32 {
    hash(x, hash(y, hash(half, hash(seed as u32, (seed >> 32) as u32 ^ 0x5bd1_e995))))
}

impl PixelSampler {
    /// The points of a pixel. Halves get sequences of their own.
    pub(crate) fn new(kind: SamplerKind, x: u32, y: u32, half: u32, seed: u64) -> Self {
        Self::of(Portable, kind, [x, y, half], seed)
    }

    /// The same, for an instruction set.
    #[inline(always)]
    pub(crate) fn of<S: Simd>(simd: S, kind: SamplerKind, [x, y, half]: [u32; 3], seed: u64) -> Self {
        let key = pixel_key([x, y, half], seed);
        Self { kind, key, tables: &TABLES, kept: Kept::of(simd, key) }
    }

    /// What the points of the pixel go by.
    #[cfg(test)]
    pub(crate) const fn key(&self) -> u32 {
        self.key
    }

    /// The points of sample `index`. A Sobol sequence is exact to 2^16 samples; each further block of 2^16 has a
    /// scramble of its own.
    #[inline(always)]
    pub(crate) fn sample(&self, index: u64) -> Sampler<'_> {
        Sampler { pixel: self, block: (index >> 16) as u32, index: index as u32 & 0xffff }
    }
}

impl Sampler<'_> {
    /// Four numbers in [0, 1) of set `set`.
    #[inline(always)]
    pub(crate) fn get(&self, set: u32) -> [f32; 4] {
        let pixel = self.pixel;
        if pixel.kind == SamplerKind::Sobol && self.block == 0 && (set as usize) < KEPT {
            let set = set as usize;
            let (index, dimensions) = (pixel.kept.indices[set], pixel.kept.dimensions[set]);
            sobol(pixel.tables, self.index, &Scrambles { table: SEQUENCES.0[set], index, dimensions })
        } else {
            self.uncommon(set)
        }
    }

    /// A number of 32 bits for ray `ray` of this sample, different for each pixel, half and seed.
    #[inline(always)]
    pub(crate) fn ray_key(&self, ray: u32) -> u32 {
        hash(ray, hash(self.index, hash(self.block, self.pixel.key ^ 0x6c07_8965)))
    }

    #[cold]
    #[inline(never)]
    fn uncommon(&self, set: u32) -> [f32; 4] {
        let pixel = self.pixel;
        let key = if self.block == 0 { pixel.key } else { hash(self.block, pixel.key) };
        match pixel.kind {
            SamplerKind::Sobol => sobol(pixel.tables, self.index, &Scrambles::new(key, set)),
            SamplerKind::Independent => independent(seed_of(key, set), self.index),
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
mod strata;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_points_are_those_of_the_crate() {
        for seed in [0, 1, 77, 0xdead_beef] {
            for index in (0..1 << 16).step_by(7) {
                let ours = sobol(&TABLES, index, &Scrambles::of_seed(seed));
                assert_eq!(ours, sobol_burley::sample_4d(index, 0, seed), "seed {seed}, index {index}");
            }
        }
        // Kept and uncommon sets, and blocks beyond the first, take the same route.
        let pixel = PixelSampler::new(SamplerKind::Sobol, 3, 4, 0, 5);
        for (index, key) in [(9, pixel.key), ((1 << 16) + 9, hash(1, pixel.key))] {
            for set in [0, 1, 2, KEPT as u32 - 1, KEPT as u32 + 2, 42] {
                let expected = sobol_burley::sample_4d(9, 0, seed_of(key, set));
                assert_eq!(pixel.sample(index).get(set), expected, "set {set}, index {index}");
            }
        }
    }

    /// Segments that share a sequence: its first sixteen dimensions, of one index, each with a scramble of its own.
    #[test]
    fn segments_share_a_sequence() {
        let pixel = PixelSampler::new(SamplerKind::Sobol, 3, 4, 0, 5);
        for vertex in 1..=20 {
            let set = Dimensions::segment(vertex);
            let first = Dimensions::segment((vertex - 1) / 4 * 4 + 1);
            for number in [0, 9, 1000, (1 << 16) - 1] {
                let order = Scrambles::of_seed(seed_of(pixel.key, first)).index;
                let index = parts::owen_scramble_rev(u32::reverse_bits(number), order);
                let scrambles = Scrambles::of_seed(seed_of(pixel.key, set)).dimensions;
                let expected = [0, 1, 2, 3].map(|d| {
                    let unscrambled = parts::sobol_rev(index, (vertex - 1) % 4 * 4 + d);
                    let scrambled = parts::owen_scramble_rev(unscrambled, scrambles[d as usize]);
                    parts::u32_to_f32_norm(scrambled.reverse_bits())
                });
                assert_eq!(pixel.sample(number.into()).get(set), expected, "vertex {vertex}, {number}");
            }
        }
    }

    /// Elementary intervals: 2^k samples of a Sobol pair put exactly one point into each cell of every 2^a × 2^b grid,
    /// a + b = k, for the pairs that matter most (film; first BSDF; the others are (t, m, 2)-nets).
    #[test]
    fn the_named_pairs_are_stratified() {
        for set in [0, 1, 5].map(Dimensions::segment) {
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
