//! The plain twin of the vector tokens: arrays and loops, on any processor.

use super::{F8, Simd, U8};

/// Needs nothing; gives the same bits as every other token.
#[derive(Clone, Copy, Debug, Default)]
pub struct Portable;

#[inline(always)]
fn zip(a: F8, b: F8, f: impl Fn(f32, f32) -> f32) -> F8 {
    F8(core::array::from_fn(
        #[inline(always)]
        |i| f(a.0[i], b.0[i]),
    ))
}

#[inline(always)]
fn zip_integers(a: U8, b: U8, f: impl Fn(u32, u32) -> u32) -> U8 {
    U8(core::array::from_fn(
        #[inline(always)]
        |i| f(a.0[i], b.0[i]),
    ))
}

#[inline(always)]
fn zip_doubles(a: [f64; 8], b: [f64; 8], f: impl Fn(f64, f64) -> f64) -> [f64; 8] {
    core::array::from_fn(
        #[inline(always)]
        |i| f(a[i], b[i]),
    )
}

/// All bits where there is something to say, or none.
#[inline(always)]
fn full(when: bool) -> f32 {
    f32::from_bits(u32::from(when).wrapping_neg())
}

#[inline(always)]
fn zip_bits(a: F8, b: F8, f: impl Fn(u32, u32) -> u32) -> F8 {
    zip(
        a,
        b,
        #[inline(always)]
        |a, b| f32::from_bits(f(a.to_bits(), b.to_bits())),
    )
}

impl Simd for Portable {
    type Vector = F8;
    type Integers = U8;
    type Doubles = [f64; 8];
    const NAME: &'static str = "portable";
    const EMULATED: bool = true;

    #[inline(always)]
    fn vectorize<R>(self, f: impl FnOnce() -> R) -> R {
        f()
    }
    #[inline(always)]
    fn prefetch(self, _from: *const u8) {}
    #[inline(always)]
    fn splat(self, value: f32) -> F8 {
        F8([value; 8])
    }
    #[inline(always)]
    fn load(self, from: &F8) -> F8 {
        *from
    }
    #[inline(always)]
    fn store(self, vector: F8) -> F8 {
        vector
    }
    #[inline(always)]
    fn add(self, a: F8, b: F8) -> F8 {
        zip(a, b, |a, b| a + b)
    }
    #[inline(always)]
    fn sub(self, a: F8, b: F8) -> F8 {
        zip(a, b, |a, b| a - b)
    }
    #[inline(always)]
    fn mul(self, a: F8, b: F8) -> F8 {
        zip(a, b, |a, b| a * b)
    }
    #[inline(always)]
    fn abs(self, a: F8) -> F8 {
        zip(a, a, |a, _| a.abs())
    }
    #[inline(always)]
    fn neg(self, a: F8) -> F8 {
        zip(a, a, |a, _| -a)
    }
    #[inline(always)]
    fn fill(self, bits: bool) -> F8 {
        F8([f32::from_bits(u32::from(bits).wrapping_neg()); 8])
    }
    #[inline(always)]
    fn swap_where(self, mask: F8, a: F8, b: F8) -> (F8, F8) {
        let full = |lane: usize| mask.0[lane].to_bits() != 0;
        let choose =
            |a: F8, b: F8| F8(core::array::from_fn(|lane| if full(lane) { b.0[lane] } else { a.0[lane] }));
        (choose(a, b), choose(b, a))
    }
    #[inline(always)]
    fn min(self, a: F8, b: F8) -> F8 {
        zip(a, b, |a, b| if a < b { a } else { b })
    }
    #[inline(always)]
    fn max(self, a: F8, b: F8) -> F8 {
        zip(a, b, |a, b| if a > b { a } else { b })
    }
    #[inline(always)]
    fn lt(self, a: F8, b: F8) -> u32 {
        let mut bits = 0;
        for lane in 0..8 {
            bits |= u32::from(a.0[lane] < b.0[lane]) << lane;
        }
        bits
    }
    #[inline(always)]
    fn equal(self, numbers: &[u32; 8], value: u32) -> u32 {
        let mut bits = 0;
        for (lane, &number) in numbers.iter().enumerate() {
            bits |= u32::from(number == value) << lane;
        }
        bits
    }
    #[inline(always)]
    fn le(self, a: F8, b: F8) -> u32 {
        let mut bits = 0;
        for lane in 0..8 {
            bits |= u32::from(a.0[lane] <= b.0[lane]) << lane;
        }
        bits
    }

    #[inline(always)]
    fn div(self, a: F8, b: F8) -> F8 {
        zip(a, b, |a, b| a / b)
    }
    #[inline(always)]
    fn sqrt(self, a: F8) -> F8 {
        zip(a, a, |a, _| a.sqrt())
    }
    #[inline(always)]
    fn and(self, a: F8, b: F8) -> F8 {
        zip_bits(a, b, |a, b| a & b)
    }
    #[inline(always)]
    fn or(self, a: F8, b: F8) -> F8 {
        zip_bits(a, b, |a, b| a | b)
    }
    #[inline(always)]
    fn and_not(self, a: F8, b: F8) -> F8 {
        zip_bits(a, b, |a, b| !a & b)
    }
    #[inline(always)]
    fn less(self, a: F8, b: F8) -> F8 {
        zip(a, b, |a, b| full(a < b))
    }
    #[inline(always)]
    fn less_equal(self, a: F8, b: F8) -> F8 {
        zip(a, b, |a, b| full(a <= b))
    }
    #[inline(always)]
    fn select(self, mask: F8, a: F8, b: F8) -> F8 {
        self.swap_where(mask, b, a).0
    }
    #[inline(always)]
    fn signs(self, a: F8) -> u32 {
        let mut bits = 0;
        for lane in 0..8 {
            bits |= a.0[lane].to_bits() >> 31 << lane;
        }
        bits
    }

    #[inline(always)]
    fn splat_integer(self, value: u32) -> U8 {
        U8([value; 8])
    }
    #[inline(always)]
    fn load_integers(self, from: &U8) -> U8 {
        *from
    }
    #[inline(always)]
    fn store_integers(self, vector: U8) -> U8 {
        vector
    }
    #[inline(always)]
    fn add_integers(self, a: U8, b: U8) -> U8 {
        zip_integers(a, b, u32::wrapping_add)
    }
    #[inline(always)]
    fn sub_integers(self, a: U8, b: U8) -> U8 {
        zip_integers(a, b, u32::wrapping_sub)
    }
    #[inline(always)]
    fn mul_integers(self, a: U8, b: U8) -> U8 {
        zip_integers(a, b, u32::wrapping_mul)
    }
    #[inline(always)]
    fn xor_integers(self, a: U8, b: U8) -> U8 {
        zip_integers(a, b, |a, b| a ^ b)
    }
    #[inline(always)]
    fn shift_left<const N: i32>(self, a: U8) -> U8 {
        zip_integers(a, a, |a, _| a << N)
    }
    #[inline(always)]
    fn shift_right<const N: i32>(self, a: U8) -> U8 {
        zip_integers(a, a, |a, _| a >> N)
    }
    #[inline(always)]
    fn reverse_bits(self, a: U8) -> U8 {
        zip_integers(a, a, |a, _| a.reverse_bits())
    }
    #[inline(always)]
    fn equal_integers(self, a: U8, b: U8) -> F8 {
        F8(core::array::from_fn(
            #[inline(always)]
            |i| full(a.0[i] == b.0[i]),
        ))
    }
    #[inline(always)]
    fn to_floats(self, a: U8) -> F8 {
        F8(core::array::from_fn(
            #[inline(always)]
            |i| a.0[i].cast_signed() as f32,
        ))
    }
    #[inline(always)]
    fn truncate(self, a: F8) -> U8 {
        // As the processor does it where a number does not fit.
        U8(core::array::from_fn(
            #[inline(always)]
            |i| {
                let fits = a.0[i] > -2_147_483_649.0 && a.0[i] < 2_147_483_648.0;
                if fits { (a.0[i] as i32).cast_unsigned() } else { 1 << 31 }
            },
        ))
    }
    #[inline(always)]
    fn bits_of(self, a: F8) -> U8 {
        U8(core::array::from_fn(
            #[inline(always)]
            |i| a.0[i].to_bits(),
        ))
    }
    #[inline(always)]
    fn floats_of(self, a: U8) -> F8 {
        F8(core::array::from_fn(
            #[inline(always)]
            |i| f32::from_bits(a.0[i]),
        ))
    }
    #[inline(always)]
    fn permute(self, a: F8, indices: U8) -> F8 {
        F8(core::array::from_fn(
            #[inline(always)]
            |i| a.0[indices.0[i] as usize & 7],
        ))
    }
    #[inline(always)]
    fn read(self, from: &[f32; 8]) -> F8 {
        F8(*from)
    }
    #[inline(always)]
    fn write(self, vector: F8, to: &mut [f32; 8]) {
        *to = vector.0;
    }
    #[inline(always)]
    fn gather(self, from: &[f32], indices: U8) -> F8 {
        let last = super::last_index(from.len());
        F8(core::array::from_fn(
            #[inline(always)]
            |i| from[indices.0[i].min(last) as usize],
        ))
    }
    #[inline(always)]
    fn gather_integers(self, from: &[u32], indices: U8) -> U8 {
        let last = super::last_index(from.len());
        U8(core::array::from_fn(
            #[inline(always)]
            |i| from[indices.0[i].min(last) as usize],
        ))
    }

    #[inline(always)]
    fn gather_fours(self, from: &[f32], first: U8) -> [F8; 4] {
        columns(from, first)
    }
    #[inline(always)]
    fn gather_fours_of_integers(self, from: &[u32], first: U8) -> [U8; 4] {
        let last = super::last_run::<4>(from.len());
        let mut columns = [U8([0; 8]); 4];
        for lane in 0..8 {
            let row = &from[first.0[lane].min(last) as usize..][..4];
            for (column, number) in columns.iter_mut().zip(row) {
                column.0[lane] = *number;
            }
        }
        columns
    }
    #[inline(always)]
    fn gather_eights(self, from: &[f32], first: U8) -> [F8; 8] {
        columns(from, first)
    }

    #[inline(always)]
    fn widen(self, a: F8) -> [f64; 8] {
        core::array::from_fn(
            #[inline(always)]
            |i| f64::from(a.0[i]),
        )
    }
    #[inline(always)]
    fn narrow(self, a: [f64; 8]) -> F8 {
        F8(core::array::from_fn(
            #[inline(always)]
            |i| a[i] as f32,
        ))
    }
    #[inline(always)]
    fn add_doubles(self, a: [f64; 8], b: [f64; 8]) -> [f64; 8] {
        zip_doubles(a, b, |a, b| a + b)
    }
    #[inline(always)]
    fn sub_doubles(self, a: [f64; 8], b: [f64; 8]) -> [f64; 8] {
        zip_doubles(a, b, |a, b| a - b)
    }
    #[inline(always)]
    fn mul_doubles(self, a: [f64; 8], b: [f64; 8]) -> [f64; 8] {
        zip_doubles(a, b, |a, b| a * b)
    }
    #[inline(always)]
    fn sqrt_doubles(self, a: [f64; 8]) -> [f64; 8] {
        zip_doubles(a, a, |a, _| a.sqrt())
    }
    #[inline(always)]
    fn div_doubles(self, a: [f64; 8], b: [f64; 8]) -> [f64; 8] {
        zip_doubles(a, b, |a, b| a / b)
    }
    #[inline(always)]
    fn min_doubles(self, a: [f64; 8], b: [f64; 8]) -> [f64; 8] {
        zip_doubles(a, b, |a, b| if a < b { a } else { b })
    }
}

/// The numbers from each index on: the first ones, the second ones and so on.
#[inline(always)]
fn columns<const N: usize>(from: &[f32], first: U8) -> [F8; N] {
    let last = super::last_run::<N>(from.len());
    let mut columns = [F8([0.0; 8]); N];
    for lane in 0..8 {
        let row = &from[first.0[lane].min(last) as usize..][..N];
        for (column, number) in columns.iter_mut().zip(row) {
            column.0[lane] = *number;
        }
    }
    columns
}
