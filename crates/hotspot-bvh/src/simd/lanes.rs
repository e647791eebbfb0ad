//! Eight numbers at a time with operators, so that formulas in lanes read like those for one number.
//!
//! Each value carries the token of its instruction set, which takes no room. All operations are those of [`Simd`], lane by lane;
//! what is written in the same order as for single numbers gives the same bits.

use super::{F8, Simd, U8};
use core::ops::{Add, BitAnd, BitOr, BitXor, Div, Mul, Neg, Sub};

/// Eight f32.
#[derive(Clone, Copy)]
pub struct Floats<S: Simd>(S, S::Vector);

/// Eight u32; sums and products wrap.
#[derive(Clone, Copy)]
pub struct Integers<S: Simd>(S, S::Integers);

/// Eight f64.
#[derive(Clone, Copy)]
pub struct Doubles<S: Simd>(S, S::Doubles);

/// Eight answers.
#[derive(Clone, Copy)]
pub struct Mask<S: Simd>(S, S::Vector);

/// Eight vectors of three f32.
#[derive(Clone, Copy)]
pub struct Vectors<S: Simd> {
    /// First components.
    pub x: Floats<S>,
    /// Second components.
    pub y: Floats<S>,
    /// Third components.
    pub z: Floats<S>,
}

/// Of each set of lanes, as bits: their numbers, in order, and then 0.
static SET_BITS: [U8; 256] = {
    let mut all = [U8([0; 8]); 256];
    let mut bits = 0;
    while bits < 256 {
        let (mut lane, mut place) = (0, 0);
        while lane < 8 {
            if bits >> lane & 1 != 0 {
                all[bits].0[place] = lane;
                place += 1;
            }
            lane += 1;
        }
        bits += 1;
    }
    all
};

/// Lane by lane between two of a type.
macro_rules! operators {
    ($type:ident: $($operator:ident $method:ident $function:ident),*) => {$(
        impl<S: Simd> $operator for $type<S> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(self.0, self.0.$function(self.1, other.1))
            }
        }
    )*};
}

operators!(Floats: Add add add, Sub sub sub, Mul mul mul, Div div div);
operators!(Integers: Add add add_integers, Sub sub sub_integers, Mul mul mul_integers);
operators!(Doubles: Add add add_doubles, Sub sub sub_doubles, Mul mul mul_doubles, Div div div_doubles);
operators!(Mask: BitAnd bitand and, BitOr bitor or);

impl<S: Simd> Neg for Floats<S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(self.0, self.0.neg(self.1))
    }
}

/// The same with one number for all lanes.
macro_rules! operators_with_numbers {
    ($type:ident, $number:ty: $($operator:ident $method:ident),*) => {$(
        impl<S: Simd> $operator<$number> for $type<S> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: $number) -> Self {
                self.$method(Self::splat(self.0, other))
            }
        }
    )*};
}

operators_with_numbers!(Floats, f32: Add add, Sub sub, Mul mul);
operators_with_numbers!(Integers, u32: Add add, Sub sub, Mul mul, BitAnd bitand, BitOr bitor, BitXor bitxor);

impl<S: Simd> Sub<Floats<S>> for f32 {
    type Output = Floats<S>;
    #[inline(always)]
    fn sub(self, other: Floats<S>) -> Floats<S> {
        Floats::splat(other.0, self) - other
    }
}

impl<S: Simd> Div<Floats<S>> for f32 {
    type Output = Floats<S>;
    #[inline(always)]
    fn div(self, other: Floats<S>) -> Floats<S> {
        Floats::splat(other.0, self) / other
    }
}

impl<S: Simd> Floats<S> {
    /// All lanes the same.
    #[inline(always)]
    pub fn splat(s: S, value: f32) -> Self {
        Self(s, s.splat(value))
    }

    /// From memory.
    #[inline(always)]
    pub fn load(s: S, from: &F8) -> Self {
        Self(s, s.load(from))
    }

    /// To memory.
    #[inline(always)]
    pub fn store(self) -> F8 {
        self.0.store(self.1)
    }

    /// The entries of a table of eight with these indices, of which the three lowest bits count.
    #[inline(always)]
    pub fn look_up(table: &F8, indices: Integers<S>) -> Self {
        Self::load(indices.0, table).permuted(indices)
    }

    /// Lane i gets lane `indices[i]`.
    #[inline(always)]
    #[must_use]
    pub fn permuted(self, indices: Integers<S>) -> Self {
        Self(self.0, self.0.permute(self.1, indices.1))
    }

    /// The eight numbers of a list from this place on.
    ///
    /// # Panics
    /// Where there are fewer.
    #[inline(always)]
    pub fn read(s: S, from: &[f32], at: usize) -> Self {
        Self(s, s.read(from[at..].first_chunk().expect("eight are left")))
    }

    /// To a list from this place on.
    ///
    /// # Panics
    /// Where it ends before.
    #[inline(always)]
    pub fn write(self, to: &mut [f32], at: usize) {
        self.0.write(self.1, to[at..].first_chunk_mut().expect("eight are left"));
    }

    /// The entries of a table with these indices ([`Simd::gather`]).
    ///
    /// # Panics
    /// Without entries.
    #[inline(always)]
    pub fn gather(from: &[f32], indices: Integers<S>) -> Self {
        Self(indices.0, indices.0.gather(from, indices.1))
    }

    /// Four entries of a table from each index on ([`Simd::gather_fours`]).
    ///
    /// # Panics
    /// With fewer entries.
    #[inline(always)]
    pub fn gather_fours(from: &[f32], first: Integers<S>) -> [Self; 4] {
        let s = first.0;
        let [a, b, c, d] = s.gather_fours(from, first.1);
        [Self(s, a), Self(s, b), Self(s, c), Self(s, d)]
    }

    /// Eight entries of a table from each index on ([`Simd::gather_eights`]).
    ///
    /// # Panics
    /// With fewer entries.
    #[inline(always)]
    pub fn gather_eights(from: &[f32], first: Integers<S>) -> [Self; 8] {
        let s = first.0;
        let [a, b, c, d, e, f, g, h] = s.gather_eights(from, first.1);
        [Self(s, a), Self(s, b), Self(s, c), Self(s, d), Self(s, e), Self(s, f), Self(s, g), Self(s, h)]
    }

    /// Without sign.
    #[inline(always)]
    pub fn abs(self) -> Self {
        Self(self.0, self.0.abs(self.1))
    }

    /// √.
    #[inline(always)]
    pub fn sqrt(self) -> Self {
        Self(self.0, self.0.sqrt(self.1))
    }

    /// `self < other ? self : other`.
    #[inline(always)]
    pub fn min(self, other: Self) -> Self {
        Self(self.0, self.0.min(self.1, other.1))
    }

    /// `self > other ? self : other`.
    #[inline(always)]
    pub fn max(self, other: Self) -> Self {
        Self(self.0, self.0.max(self.1, other.1))
    }

    /// Where `self` < `other`; nowhere for NaN.
    #[inline(always)]
    pub fn less(self, other: Self) -> Mask<S> {
        Mask(self.0, self.0.less(self.1, other.1))
    }

    /// Where `self` ≤ `other`; nowhere for NaN.
    #[inline(always)]
    pub fn less_equal(self, other: Self) -> Mask<S> {
        Mask(self.0, self.0.less_equal(self.1, other.1))
    }

    /// Where it is `number` (either zero where that is 0).
    #[inline(always)]
    pub fn is(self, number: f32) -> Mask<S> {
        let number = Self::splat(self.0, number);
        self.less_equal(number) & number.less_equal(self)
    }

    /// With the signs of `other`.
    #[inline(always)]
    pub fn copysign(self, other: Self) -> Self {
        let sign = self.0.splat(-0.0);
        let magnitude = self.0.and_not(sign, self.1);
        Self(self.0, self.0.or(magnitude, self.0.and(sign, other.1)))
    }

    /// Without fractions, of lanes that are at least 0 and below 2^31.
    #[inline(always)]
    pub fn truncate(self) -> Integers<S> {
        Integers(self.0, self.0.truncate(self.1))
    }

    /// Exactly.
    #[inline(always)]
    pub fn widen(self) -> Doubles<S> {
        Doubles(self.0, self.0.widen(self.1))
    }

    /// The same bits.
    #[inline(always)]
    pub fn bits(self) -> Integers<S> {
        Integers(self.0, self.0.bits_of(self.1))
    }
}

impl<S: Simd> Integers<S> {
    /// All lanes the same.
    #[inline(always)]
    pub fn splat(s: S, value: u32) -> Self {
        Self(s, s.splat_integer(value))
    }

    /// From memory.
    #[inline(always)]
    pub fn load(s: S, from: &U8) -> Self {
        Self(s, s.load_integers(from))
    }

    /// To memory.
    #[inline(always)]
    pub fn store(self) -> U8 {
        self.0.store_integers(self.1)
    }

    /// The numbers of the lanes whose bit is set, in order; then others.
    #[inline(always)]
    pub fn of_set_bits(s: S, bits: u32) -> Self {
        Self::load(s, &SET_BITS[bits as usize & 0xff])
    }

    /// The entries of a table with these indices ([`Simd::gather_integers`]).
    ///
    /// # Panics
    /// Without entries.
    #[inline(always)]
    pub fn gather(from: &[u32], indices: Self) -> Self {
        Self(indices.0, indices.0.gather_integers(from, indices.1))
    }

    /// Four entries of a table from each index on ([`Simd::gather_fours`]).
    ///
    /// # Panics
    /// With fewer entries.
    #[inline(always)]
    pub fn gather_fours(from: &[u32], first: Self) -> [Self; 4] {
        let s = first.0;
        let [a, b, c, d] = s.gather_fours_of_integers(from, first.1);
        [Self(s, a), Self(s, b), Self(s, c), Self(s, d)]
    }

    /// Lane i gets lane `indices[i]`.
    #[inline(always)]
    #[must_use]
    pub fn permuted(self, indices: Self) -> Self {
        self.as_bits().permuted(indices).bits()
    }

    /// << N.
    #[inline(always)]
    #[must_use]
    pub fn shift_left<const N: i32>(self) -> Self {
        Self(self.0, self.0.shift_left::<N>(self.1))
    }

    /// >> N.
    #[inline(always)]
    #[must_use]
    pub fn shift_right<const N: i32>(self) -> Self {
        Self(self.0, self.0.shift_right::<N>(self.1))
    }

    /// The lowest bit becomes the highest.
    #[inline(always)]
    #[must_use]
    pub fn reverse_bits(self) -> Self {
        Self(self.0, self.0.reverse_bits(self.1))
    }

    /// Where both are the same.
    #[inline(always)]
    pub fn equal(self, other: Self) -> Mask<S> {
        Mask(self.0, self.0.equal_integers(self.1, other.1))
    }

    /// Where it is `number`.
    #[inline(always)]
    pub fn is(self, number: u32) -> Mask<S> {
        self.equal(Self::splat(self.0, number))
    }

    /// The numbers, of lanes below 2^31.
    #[inline(always)]
    pub fn to_floats(self) -> Floats<S> {
        Floats(self.0, self.0.to_floats(self.1))
    }

    /// The floats of these bits.
    #[inline(always)]
    pub fn as_bits(self) -> Floats<S> {
        Floats(self.0, self.0.floats_of(self.1))
    }

    /// `self` where `mask`, else `other`.
    #[inline(always)]
    #[must_use]
    pub fn or_where_not(self, mask: Mask<S>, other: Self) -> Self {
        mask.select(self.as_bits(), other.as_bits()).bits()
    }
}

impl<S: Simd> BitXor for Integers<S> {
    type Output = Self;
    #[inline(always)]
    fn bitxor(self, other: Self) -> Self {
        Self(self.0, self.0.xor_integers(self.1, other.1))
    }
}

impl<S: Simd> BitAnd for Integers<S> {
    type Output = Self;
    #[inline(always)]
    fn bitand(self, other: Self) -> Self {
        let s = self.0;
        Self(s, s.bits_of(s.and(s.floats_of(self.1), s.floats_of(other.1))))
    }
}

impl<S: Simd> BitOr for Integers<S> {
    type Output = Self;
    #[inline(always)]
    fn bitor(self, other: Self) -> Self {
        let s = self.0;
        Self(s, s.bits_of(s.or(s.floats_of(self.1), s.floats_of(other.1))))
    }
}

impl<S: Simd> Doubles<S> {
    /// To the nearest f32.
    #[inline(always)]
    pub fn narrow(self) -> Floats<S> {
        Floats(self.0, self.0.narrow(self.1))
    }

    /// √.
    #[inline(always)]
    #[must_use]
    pub fn sqrt(self) -> Self {
        Self(self.0, self.0.sqrt_doubles(self.1))
    }

    /// `self < other ? self : other`.
    #[inline(always)]
    #[must_use]
    pub fn min(self, other: Self) -> Self {
        Self(self.0, self.0.min_doubles(self.1, other.1))
    }
}

impl<S: Simd> Mask<S> {
    /// The same answer in all lanes.
    #[inline(always)]
    pub fn splat(s: S, answer: bool) -> Self {
        Self(s, s.fill(answer))
    }

    /// Lanes i where bit i is set.
    #[inline(always)]
    pub fn of_bits(s: S, bits: u32) -> Self {
        let lanes = Integers::load(s, &U8([1, 2, 4, 8, 16, 32, 64, 128]));
        (Integers::splat(s, bits) & lanes).equal(lanes)
    }

    /// Bit i for lane i.
    #[inline(always)]
    pub fn bits(self) -> u32 {
        self.0.signs(self.1)
    }

    /// `a` where so, `b` where not.
    #[inline(always)]
    pub fn select(self, a: Floats<S>, b: Floats<S>) -> Floats<S> {
        Floats(self.0, self.0.select(self.1, a.1, b.1))
    }

    /// `a` where so, 0 where not.
    #[inline(always)]
    pub fn or_zero(self, a: Floats<S>) -> Floats<S> {
        Floats(self.0, self.0.and(self.1, a.1))
    }

    /// Those of `self` that are not of `other`.
    #[inline(always)]
    #[must_use]
    pub fn without(self, other: Self) -> Self {
        Self(self.0, self.0.and_not(other.1, self.1))
    }
}

impl<S: Simd> Vectors<S> {
    /// From components.
    #[inline(always)]
    pub fn new(x: Floats<S>, y: Floats<S>, z: Floats<S>) -> Self {
        Self { x, y, z }
    }

    /// All lanes the same.
    #[inline(always)]
    pub fn splat(s: S, [x, y, z]: [f32; 3]) -> Self {
        Self::new(Floats::splat(s, x), Floats::splat(s, y), Floats::splat(s, z))
    }

    /// From memory.
    #[inline(always)]
    pub fn load(s: S, [x, y, z]: &[F8; 3]) -> Self {
        Self::new(Floats::load(s, x), Floats::load(s, y), Floats::load(s, z))
    }

    /// To memory.
    #[inline(always)]
    pub fn store(self) -> [F8; 3] {
        [self.x.store(), self.y.store(), self.z.store()]
    }

    /// Three entries of a table from each index on; there is a fourth behind all that are asked for.
    ///
    /// # Panics
    /// With fewer than four entries.
    #[inline(always)]
    pub fn gather(from: &[f32], first: Integers<S>) -> Self {
        let [x, y, z, _] = Floats::gather_fours(from, first);
        Self::new(x, y, z)
    }

    /// Three vectors whose nine components stand in a table from each index on.
    ///
    /// # Panics
    /// With fewer than eight entries; of eight, the last component is anything.
    #[inline(always)]
    pub fn gather_three(from: &[f32], first: Integers<S>) -> [Self; 3] {
        let [ax, ay, az, bx, by, bz, cx, cy] = Floats::gather_eights(from, first);
        let cz = Floats::gather(from, first + 8);
        [Self::new(ax, ay, az), Self::new(bx, by, bz), Self::new(cx, cy, cz)]
    }

    /// The entries of three tables of eight.
    #[inline(always)]
    pub fn look_up([x, y, z]: &[F8; 3], indices: Integers<S>) -> Self {
        Self::new(Floats::look_up(x, indices), Floats::look_up(y, indices), Floats::look_up(z, indices))
    }

    /// Scalar product, added up in order.
    #[inline(always)]
    pub fn dot(self, other: Self) -> Floats<S> {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    /// Vector product.
    #[inline(always)]
    #[must_use]
    pub fn cross(self, other: Self) -> Self {
        Self::new(
            self.y * other.z - other.y * self.z,
            self.z * other.x - other.z * self.x,
            self.x * other.y - other.x * self.y,
        )
    }

    /// Times a number for each lane.
    #[inline(always)]
    #[must_use]
    pub fn scaled(self, by: Floats<S>) -> Self {
        Self::new(self.x * by, self.y * by, self.z * by)
    }

    /// Lane i gets lane `indices[i]`.
    #[inline(always)]
    #[must_use]
    pub fn permuted(self, indices: Integers<S>) -> Self {
        Self::new(self.x.permuted(indices), self.y.permuted(indices), self.z.permuted(indices))
    }

    /// Without signs.
    #[inline(always)]
    #[must_use]
    pub fn abs(self) -> Self {
        Self::new(self.x.abs(), self.y.abs(), self.z.abs())
    }

    /// `self` where `mask`, else `other`.
    #[inline(always)]
    #[must_use]
    pub fn or_where_not(self, mask: Mask<S>, other: Self) -> Self {
        Self::new(mask.select(self.x, other.x), mask.select(self.y, other.y), mask.select(self.z, other.z))
    }

    /// `self` where `mask`, else 0.
    #[inline(always)]
    #[must_use]
    pub fn or_zero(self, mask: Mask<S>) -> Self {
        Self::new(mask.or_zero(self.x), mask.or_zero(self.y), mask.or_zero(self.z))
    }

    /// Where any component is not 0 (or NaN).
    #[inline(always)]
    pub fn any(self) -> Mask<S> {
        Mask::splat(self.x.0, true).without(self.x.is(0.0) & self.y.is(0.0) & self.z.is(0.0))
    }
}

/// Component by component.
macro_rules! vector_operators {
    ($($operator:ident $method:ident),*) => {$(
        impl<S: Simd> $operator for Vectors<S> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self::new(self.x.$method(other.x), self.y.$method(other.y), self.z.$method(other.z))
            }
        }
    )*};
}

vector_operators!(Add add, Sub sub, Mul mul);

impl<S: Simd> Neg for Vectors<S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self::new(-self.x, -self.y, -self.z)
    }
}

/// The numbers of the lanes whose bit is set, in order.
pub struct Lanes(pub u32);

impl Iterator for Lanes {
    type Item = usize;

    #[inline(always)]
    fn next(&mut self) -> Option<usize> {
        if self.0 == 0 {
            return None;
        }
        // The same number; so that the compiler knows that there are eight.
        let lane = self.0.trailing_zeros() as usize & 7;
        self.0 &= self.0 - 1;
        Some(lane)
    }
}

/// A lane of vectors in memory.
#[inline(always)]
pub fn vector(vectors: &[F8; 3], lane: usize) -> [f32; 3] {
    [vectors[0].0[lane], vectors[1].0[lane], vectors[2].0[lane]]
}

/// Sets a lane of vectors in memory.
#[inline(always)]
pub fn set_vector(vectors: &mut [F8; 3], lane: usize, [x, y, z]: [f32; 3]) {
    vectors[0].0[lane] = x;
    vectors[1].0[lane] = y;
    vectors[2].0[lane] = z;
}
