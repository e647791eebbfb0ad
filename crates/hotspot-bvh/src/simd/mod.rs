//! Eight lanes of f32, in one vocabulary for every instruction set.
//!
//! [`Simd`] is a token: holding one proves that the processor has the instructions behind it. Algorithms are written
//! once, generic over the token, and inlined into [`Simd::vectorize`], which compiles them for that instruction set.
//! [`Portable`] is the plain twin; every operation is elementwise IEEE arithmetic without contraction, and `min`/`max`
//! follow the rule of x86 (`a < b ? a : b`, `a > b ? a : b`: the second operand when either is NaN), so all tokens give
//! the same bits.

#[cfg(target_arch = "x86_64")]
mod avx2;
mod lanes;
mod portable;

#[cfg(target_arch = "x86_64")]
pub use avx2::Avx2;
pub use lanes::{Doubles, Floats, Integers, Lanes, Mask, Vectors, set_vector, vector};
pub use portable::Portable;

/// Eight floats, aligned for vector loads.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(32))]
pub struct F8(pub [f32; 8]);

/// Eight whole numbers, aligned for vector loads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C, align(32))]
pub struct U8(pub [u32; 8]);

/// Proof that an instruction set is available, and its operations on eight lanes. [`Floats`] and its kin give them operators.
pub trait Simd: Copy + Send + Sync + 'static {
    /// Eight f32 in registers.
    type Vector: Copy;
    /// Eight u32 in registers.
    type Integers: Copy;
    /// Eight f64 in registers.
    type Doubles: Copy;

    /// Name as shown in outputs: `portable`, `avx2`.
    const NAME: &'static str;
    /// Whether it has no vectors, so that what is done to eight lanes is done eight times.
    const EMULATED: bool;

    /// Runs `f` compiled for this instruction set. `f` and all it calls must be `#[inline(always)]` to profit.
    fn vectorize<R>(self, f: impl FnOnce() -> R) -> R;

    /// Asks for four cache lines that will soon be read; any address will do.
    fn prefetch(self, from: *const u8);
    /// All lanes the same.
    fn splat(self, value: f32) -> Self::Vector;
    /// From memory.
    fn load(self, from: &F8) -> Self::Vector;
    /// To memory.
    fn store(self, vector: Self::Vector) -> F8;
    /// a + b.
    fn add(self, a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// a − b.
    fn sub(self, a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// a · b.
    fn mul(self, a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// |a|: without its sign.
    fn abs(self, a: Self::Vector) -> Self::Vector;
    /// −a: with the other sign.
    fn neg(self, a: Self::Vector) -> Self::Vector;
    /// All bits of all lanes, or none.
    fn fill(self, bits: bool) -> Self::Vector;
    /// `(a, b)`; where a lane of `mask` is full of bits, `(b, a)`.
    fn swap_where(self, mask: Self::Vector, a: Self::Vector, b: Self::Vector)
    -> (Self::Vector, Self::Vector);
    /// `a < b ? a : b`.
    fn min(self, a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// `a > b ? a : b`.
    fn max(self, a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// Bit i is set where lane i of a ≤ lane i of b; never for NaN.
    fn le(self, a: Self::Vector, b: Self::Vector) -> u32;
    /// Bit i is set where lane i of a < lane i of b; never for NaN.
    fn lt(self, a: Self::Vector, b: Self::Vector) -> u32;
    /// Bit i is set where number i is `value`.
    fn equal(self, numbers: &[u32; 8], value: u32) -> u32;

    /// a / b.
    fn div(self, a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// √a.
    fn sqrt(self, a: Self::Vector) -> Self::Vector;
    /// Bits that both have.
    fn and(self, a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// Bits that one of both has.
    fn or(self, a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// Bits of b that a has not.
    fn and_not(self, a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// All bits of the lanes where a < b, none of the others; never for NaN.
    fn less(self, a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// The same where a ≤ b.
    fn less_equal(self, a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// `a` where a lane of `mask` is full of bits, `b` where it is empty.
    fn select(self, mask: Self::Vector, a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// The sign of lane i as bit i.
    fn signs(self, a: Self::Vector) -> u32;

    /// All lanes the same.
    fn splat_integer(self, value: u32) -> Self::Integers;
    /// From memory.
    fn load_integers(self, from: &U8) -> Self::Integers;
    /// To memory.
    fn store_integers(self, vector: Self::Integers) -> U8;
    /// a + b, wrapping.
    fn add_integers(self, a: Self::Integers, b: Self::Integers) -> Self::Integers;
    /// a − b, wrapping.
    fn sub_integers(self, a: Self::Integers, b: Self::Integers) -> Self::Integers;
    /// a · b, wrapping.
    fn mul_integers(self, a: Self::Integers, b: Self::Integers) -> Self::Integers;
    /// Bits that one of both has and the other has not.
    fn xor_integers(self, a: Self::Integers, b: Self::Integers) -> Self::Integers;
    /// a << N.
    fn shift_left<const N: i32>(self, a: Self::Integers) -> Self::Integers;
    /// a >> N.
    fn shift_right<const N: i32>(self, a: Self::Integers) -> Self::Integers;
    /// The lowest bit becomes the highest.
    fn reverse_bits(self, a: Self::Integers) -> Self::Integers;
    /// All bits of the lanes where a = b.
    fn equal_integers(self, a: Self::Integers, b: Self::Integers) -> Self::Vector;
    /// The numbers, of lanes below 2^31.
    fn to_floats(self, a: Self::Integers) -> Self::Vector;
    /// Without their fractions, of lanes that are at least 0 and below 2^31; of others anything.
    fn truncate(self, a: Self::Vector) -> Self::Integers;
    /// The same bits.
    fn bits_of(self, a: Self::Vector) -> Self::Integers;
    /// The same bits.
    fn floats_of(self, a: Self::Integers) -> Self::Vector;
    /// Lane i gets lane `indices[i]` of a: of each index its three lowest bits.
    fn permute(self, a: Self::Vector, indices: Self::Integers) -> Self::Vector;
    /// From memory of any alignment.
    fn read(self, from: &[f32; 8]) -> Self::Vector;
    /// To memory of any alignment.
    fn write(self, vector: Self::Vector, to: &mut [f32; 8]);
    /// The entries with these indices, the last one for indices beyond.
    ///
    /// # Panics
    /// Without entries, or with 2^31 and more.
    fn gather(self, from: &[f32], indices: Self::Integers) -> Self::Vector;
    /// As [`Simd::gather`].
    ///
    /// # Panics
    /// Without entries, or with 2^31 and more.
    fn gather_integers(self, from: &[u32], indices: Self::Integers) -> Self::Integers;
    /// The four entries from each index on, first entries first; the last four for indices beyond. Much faster than four gathers.
    ///
    /// # Panics
    /// With fewer than four entries, or with 2^31 and more.
    fn gather_fours(self, from: &[f32], first: Self::Integers) -> [Self::Vector; 4];
    /// The same of whole numbers.
    ///
    /// # Panics
    /// As [`Simd::gather_fours`].
    fn gather_fours_of_integers(self, from: &[u32], first: Self::Integers) -> [Self::Integers; 4];
    /// As [`Simd::gather_fours`] for eight entries.
    ///
    /// # Panics
    /// With fewer than eight entries, or with 2^31 and more.
    fn gather_eights(self, from: &[f32], first: Self::Integers) -> [Self::Vector; 8];

    /// Exactly.
    fn widen(self, a: Self::Vector) -> Self::Doubles;
    /// To the nearest f32.
    fn narrow(self, a: Self::Doubles) -> Self::Vector;
    /// a + b.
    fn add_doubles(self, a: Self::Doubles, b: Self::Doubles) -> Self::Doubles;
    /// a − b.
    fn sub_doubles(self, a: Self::Doubles, b: Self::Doubles) -> Self::Doubles;
    /// a · b.
    fn mul_doubles(self, a: Self::Doubles, b: Self::Doubles) -> Self::Doubles;
    /// √a.
    fn sqrt_doubles(self, a: Self::Doubles) -> Self::Doubles;
    /// a / b.
    fn div_doubles(self, a: Self::Doubles, b: Self::Doubles) -> Self::Doubles;
    /// `a < b ? a : b`.
    fn min_doubles(self, a: Self::Doubles, b: Self::Doubles) -> Self::Doubles;
}

/// The last index of a table that lanes gather from.
#[inline(always)]
fn last_index(len: usize) -> u32 {
    last_run::<1>(len)
}

/// The last index from which on a table of this length has so many entries.
#[inline(always)]
fn last_run<const N: usize>(len: usize) -> u32 {
    assert!(len >= N && len <= i32::MAX as usize, "lanes gather from tables of {N} to 2^31 - 1 entries");
    (len - N) as u32
}

/// An algorithm that runs under any [`Simd`] token; see [`dispatch`].
pub trait WithSimd {
    /// What it returns.
    type Output;
    /// The algorithm. Mark it `#[inline(always)]`.
    fn run<S: Simd>(self, simd: S) -> Self::Output;
}

/// Which instruction set to use.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Isa {
    /// The best that the processor has.
    #[default]
    Auto,
    /// Plain Rust, on any processor.
    Portable,
    /// AVX2; falls back to portable where it is missing.
    Avx2,
}

impl Isa {
    /// The instruction set that will really run.
    pub fn resolve(self) -> Self {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Auto | Self::Avx2 if Avx2::detect().is_some() => Self::Avx2,
            _ => Self::Portable,
        }
    }

    /// Name of the instruction set that will really run: `portable`, `avx2`.
    pub fn name(self) -> &'static str {
        match self.resolve() {
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => Avx2::NAME,
            _ => Portable::NAME,
        }
    }
}

/// Runs an algorithm under the instruction set `isa`, compiled for it. Choose once, outside hot loops.
#[inline]
pub fn dispatch<W: WithSimd>(isa: Isa, work: W) -> W::Output {
    #[cfg(target_arch = "x86_64")]
    if isa != Isa::Portable
        && let Some(avx2) = Avx2::detect()
    {
        return avx2.vectorize(
            #[inline(always)]
            || work.run(avx2),
        );
    }
    let _ = isa;
    work.run(Portable)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What those of whole numbers and doubles give, on every pair of awkward values, must be the same bits as well.
    #[test]
    fn whole_numbers_and_doubles_agree_bit_for_bit() {
        struct Ops(U8, U8, F8, F8);
        impl WithSimd for Ops {
            type Output = ([[u32; 8]; 16], [[u32; 8]; 18], [[u32; 8]; 12], u32);
            #[inline(always)]
            fn run<S: Simd>(self, s: S) -> Self::Output {
                let (a, b) = (s.load_integers(&self.0), s.load_integers(&self.1));
                let table = self.0.0;
                let small = s.shift_right::<4>(a);
                let [w, x, y, z] = s.gather_fours_of_integers(&table, s.shift_right::<29>(b));
                let integers = [
                    w,
                    x,
                    y,
                    z,
                    s.add_integers(a, b),
                    s.sub_integers(a, b),
                    s.mul_integers(a, b),
                    s.xor_integers(a, b),
                    s.shift_left::<5>(a),
                    small,
                    s.reverse_bits(a),
                    s.bits_of(s.equal_integers(a, b)),
                    s.bits_of(s.to_floats(s.shift_right::<1>(a))),
                    s.gather_integers(&table, s.shift_right::<29>(b)),
                    s.gather_integers(&table[..3], b),
                    s.truncate(s.load(&self.3)),
                ];
                let (x, y) = (s.load(&self.2), s.load(&self.3));
                let (p, q) = (s.widen(x), s.widen(y));
                let mut memory = [0.0; 9];
                s.write(y, memory[1..].first_chunk_mut().expect("eight"));
                let floats = [
                    s.div(x, y),
                    s.sqrt(x),
                    s.and(x, y),
                    s.or(x, y),
                    s.and_not(x, y),
                    s.less(x, y),
                    s.less_equal(x, y),
                    s.select(s.less(x, y), x, y),
                    s.gather(&self.2.0, s.shift_right::<29>(b)),
                    s.permute(x, b),
                    s.read(memory[1..].first_chunk().expect("eight")),
                    s.narrow(s.add_doubles(p, q)),
                    s.narrow(s.sub_doubles(p, q)),
                    s.narrow(s.mul_doubles(p, q)),
                    s.narrow(s.div_doubles(p, q)),
                    s.narrow(s.sqrt_doubles(q)),
                    s.narrow(s.min_doubles(p, q)),
                    s.floats_of(b),
                ];
                // As above, of a NaN only that it is one counts; masks are full of bits and stay so.
                let bits = |f: f32| if f.is_nan() { 0x7fc0_0000 } else { f.to_bits() };
                let integers = integers.map(|v| s.store_integers(v).0);
                let rows: [f32; 13] = core::array::from_fn(|i| f32::from_bits(self.1.0[i & 7] ^ i as u32));
                let [c, d, e, f] = s.gather_fours(&rows, s.shift_right::<28>(b));
                let [g, h, i, j, k, l, m, n] = s.gather_eights(&rows, s.shift_right::<29>(a));
                let rows = [c, d, e, f, g, h, i, j, k, l, m, n];
                let floats = floats.map(|v| s.store(v).0.map(bits));
                // All bits of these count: they may be whole numbers.
                let rows = rows.map(|v| s.store(v).0.map(f32::to_bits));
                (integers, floats, rows, s.signs(s.less(x, y)))
            }
        }
        let numbers = [0, 1, 2, 0x7fff_ffff, 0x8000_0000, u32::MAX, 0xdead_beef, 77];
        let floats = [0.0, -0.0, 1.0, -3.5, f32::NAN, f32::INFINITY, 1e-42, 3.3e38];
        for turn in 0..8 {
            let mut other = (numbers, floats);
            other.0.rotate_left(turn);
            other.1.rotate_left(turn);
            let ops = || Ops(U8(numbers), U8(other.0), F8(floats), F8(other.1));
            assert_eq!(dispatch(Isa::Portable, ops()), dispatch(Isa::Auto, ops()), "turned by {turn}");
        }
    }

    /// Every operation on every pair of awkward values must give the same bits under every token.
    #[test]
    fn all_instruction_sets_agree_bit_for_bit() {
        struct Ops(F8, F8);
        impl WithSimd for Ops {
            type Output = ([[u32; 8]; 11], u32, u32, [u32; 2]);
            #[inline(always)]
            fn run<S: Simd>(self, s: S) -> Self::Output {
                let (a, b) = (s.load(&self.0), s.load(&self.1));
                let arithmetic = [s.add(a, b), s.sub(a, b), s.mul(a, b), s.min(a, b), s.max(a, b)];
                let [sum, difference, product, min, max] = arithmetic;
                let (straight, crossed) =
                    (s.swap_where(s.fill(false), a, b), s.swap_where(s.fill(true), a, b));
                let swapped = [straight.0, straight.1, crossed.0, crossed.1];
                let [p, q, r, t] = swapped;
                let results = [sum, difference, product, min, max, s.abs(a), s.neg(b), p, q, r, t];
                // The payload of a NaN is not defined by IEEE arithmetic; that it is one is.
                let bits = |f: f32| if f.is_nan() { 0x7fc0_0000 } else { f.to_bits() };
                let [numbers, others] = [self.0, self.1].map(|f| f.0.map(f32::to_bits));
                let equal = [numbers, others].map(|n| s.equal(&n, numbers[0]));
                (results.map(|v| s.store(v).0.map(bits)), s.le(a, b), s.lt(a, b), equal)
            }
        }
        let awkward = [
            0.0,
            -0.0,
            1.0,
            -1.0,
            f32::NAN,
            f32::INFINITY,
            f32::NEG_INFINITY,
            f32::MIN_POSITIVE,
            1e-42,
            3.3e38,
        ];
        for &x in &awkward {
            for &y in &awkward {
                let (a, b) = (F8([x, 1.0, y, x, 0.1, y, x, 7.0]), F8([y, x, 1.0, y, 0.3, x, x, y]));
                assert_eq!(dispatch(Isa::Portable, Ops(a, b)), dispatch(Isa::Auto, Ops(a, b)), "{x} {y}");
            }
        }
    }
}
