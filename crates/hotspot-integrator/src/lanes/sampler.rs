//! Sample points of eight paths at once, each of its own pixel, sample and vertex: those of [`crate::sampler`], bit for bit.

use crate::sampler::{DIMENSIONS, ROW, TABLES, TOGETHER};
use hotspot_bvh::simd::{Floats, Integers, Simd};

/// Which points, lane by lane: a pixel's key, and the number of the sample (below 2^16).
#[derive(Clone, Copy)]
pub(super) struct Points<S: Simd> {
    pub(super) key: Integers<S>,
    pub(super) index: Integers<S>,
    pub(super) table: &'static [u32],
}

/// The table of unscrambled points.
pub(crate) fn points_table() -> &'static [u32] {
    TABLES.as_flattened().as_flattened().as_flattened()
}

impl<S: Simd> Points<S> {
    /// The four numbers of the segment that leads to each lane's vertex; `vertex` at least 1.
    #[inline(always)]
    pub(super) fn segment(self, s: S, vertex: Integers<S>) -> [Floats<S>; 4] {
        // As `sequence` has it.
        let place = (vertex - 1) & (TOGETHER - 1);
        let set = vertex.shift_left::<1>();
        let order = set - place.shift_left::<1>();
        self.all(s, self.rows(place.shift_left::<11>(), order), self.base(set))
    }

    /// The four numbers of the camera's segment.
    #[inline(always)]
    pub(super) fn camera(self, s: S) -> [Floats<S>; 4] {
        let zero = Integers::splat(s, 0);
        self.all(s, self.rows(zero, zero), self.base(zero))
    }

    /// The number for roulette at a vertex.
    #[inline(always)]
    pub(super) fn roulette(self, s: S, vertex: Integers<S>) -> Floats<S> {
        self.choice::<1>(s, vertex)
    }

    /// The number that chooses a mixed material's part there.
    #[inline(always)]
    pub(super) fn part(self, s: S, vertex: Integers<S>) -> Floats<S> {
        self.choice::<2>(s, vertex)
    }

    /// Dimension `D` of a vertex's choices.
    #[inline(always)]
    fn choice<const D: u32>(self, s: S, vertex: Integers<S>) -> Floats<S> {
        let set = vertex.shift_left::<1>() + 1;
        let [high, low] = self.rows(Integers::splat(s, 0), set);
        let (high, low) = (Integers::gather(self.table, high + D), Integers::gather(self.table, low + D));
        dimension(s, high, low, self.base(set), D)
    }

    /// [`Sampler::ray_key`](crate::sampler::Sampler::ray_key).
    #[inline(always)]
    pub(super) fn ray_key(self, ray: Integers<S>) -> Integers<S> {
        let pixel = mix(mix(self.key ^ 0x6c07_8965) ^ 0x9e37_79b9);
        hash_with(ray, hash_with(self.index, pixel))
    }

    #[inline(always)]
    fn seed(self, set: Integers<S>) -> Integers<S> {
        mix(self.key ^ (set * 0x9e37_79b9))
    }

    /// What the dimensions of a set are hashed with.
    #[inline(always)]
    fn base(self, set: Integers<S>) -> Integers<S> {
        self.seed(set) * 0x9c8f_2d3b
    }

    /// Where the two rows of the samples' unscrambled points begin, in the order of set `order`; `table`: where that begins.
    #[inline(always)]
    fn rows(self, table: Integers<S>, order: Integers<S>) -> [Integers<S>; 2] {
        let scramble = hash(self.seed(order) ^ 0x79c6_8e4a);
        let index = owen_scramble(self.index.reverse_bits(), scramble);
        let high = index.shift_right::<24>().shift_left::<2>();
        let low = (index.shift_right::<16>() & 0xff).shift_left::<2>() + ROW;
        [table + high, table + low]
    }

    #[inline(always)]
    fn all(self, s: S, rows: [Integers<S>; 2], base: Integers<S>) -> [Floats<S>; 4] {
        let [a, b, c, d] = Integers::gather_fours(self.table, rows[0]);
        let [e, f, g, h] = Integers::gather_fours(self.table, rows[1]);
        [
            dimension(s, a, e, base, 0),
            dimension(s, b, f, base, 1),
            dimension(s, c, g, base, 2),
            dimension(s, d, h, base, 3),
        ]
    }
}

/// A scrambled number, of the bits that two rows of the table hold.
#[inline(always)]
fn dimension<S: Simd>(s: S, high: Integers<S>, low: Integers<S>, base: Integers<S>, d: u32) -> Floats<S> {
    let scramble = hash(Integers::splat(s, DIMENSIONS[d as usize]) ^ base);
    let bits = owen_scramble(high ^ low, scramble).reverse_bits();
    (bits.shift_right::<9>() | 0x3f80_0000).as_bits() - 1.0
}

/// [`crate::sampler::mix`].
#[inline(always)]
fn mix<S: Simd>(x: Integers<S>) -> Integers<S> {
    let x = (x ^ x.shift_right::<16>()) * 0x7feb_352d;
    let x = (x ^ x.shift_right::<15>()) * 0x846c_a68b;
    x ^ x.shift_right::<16>()
}

/// [`crate::sampler::hash`].
#[inline(always)]
fn hash_with<S: Simd>(word: Integers<S>, state: Integers<S>) -> Integers<S> {
    mix((word + 0x9e37_79b9) ^ mix(state))
}

/// `sobol_burley::parts::hash`.
#[inline(always)]
fn hash<S: Simd>(x: Integers<S>) -> Integers<S> {
    mix(x ^ 0xe6fe_3beb)
}

/// `sobol_burley::parts::owen_scramble_rev`.
#[inline(always)]
fn owen_scramble<S: Simd>(x: Integers<S>, scramble: Integers<S>) -> Integers<S> {
    let x = x ^ (x * 0x3d20_adea);
    let x = (x + scramble) * (scramble.shift_right::<16>() | 1);
    let x = x ^ (x * 0x0552_6c56);
    x ^ (x * 0x53a2_2864)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampler::{Dimensions, PixelSampler, SamplerKind};
    use hotspot_bvh::simd::{Isa, U8, WithSimd, dispatch};

    struct Numbers([u32; 8], [u32; 8], [u32; 8]);

    impl WithSimd for Numbers {
        type Output = ([[f32; 8]; 10], [u32; 8]);
        #[inline(always)]
        fn run<S: Simd>(self, s: S) -> Self::Output {
            let [key, index, vertex] = [self.0, self.1, self.2].map(|n| Integers::load(s, &U8(n)));
            let points = Points { key, index, table: points_table() };
            let [a, b, c, d] = points.segment(s, vertex);
            let [e, f, g, h] = points.camera(s);
            let choices = [points.roulette(s, vertex), points.part(s, vertex)];
            let numbers = [a, b, c, d, e, f, g, h, choices[0], choices[1]].map(|n| n.store().0);
            (numbers, points.ray_key(vertex).store().0)
        }
    }

    #[test]
    fn the_numbers_are_those_of_single_paths() {
        for isa in [Isa::Auto, Isa::Portable] {
            for round in 0..200u32 {
                let of = |lane: usize| round * 8 + lane as u32;
                let pixels: [PixelSampler; 8] = core::array::from_fn(|lane| {
                    PixelSampler::new(SamplerKind::Sobol, of(lane), 3 * of(lane), round & 1, 77)
                });
                let index = core::array::from_fn(|lane| of(lane).wrapping_mul(40_503) & 0xffff);
                let vertex = core::array::from_fn(|lane| 1 + of(lane) % 23);
                let key = core::array::from_fn(|lane| pixels[lane].key());
                let (numbers, keys) = dispatch(isa, Numbers(key, index, vertex));
                for lane in 0..8 {
                    let sampler = pixels[lane].sample(index[lane].into());
                    let segment = sampler.get(Dimensions::segment(vertex[lane]));
                    let camera = sampler.get(Dimensions::segment(0));
                    let [_, choices @ .., _] = sampler.get(Dimensions::choices(vertex[lane]));
                    assert_eq!(keys[lane], sampler.ray_key(vertex[lane]), "round {round}, lane {lane}");
                    let expected = [&segment[..], &camera, &choices].concat();
                    let found: Vec<f32> = numbers.iter().map(|n| n[lane]).collect();
                    assert_eq!(found, expected, "round {round}, lane {lane}");
                }
            }
        }
    }
}
