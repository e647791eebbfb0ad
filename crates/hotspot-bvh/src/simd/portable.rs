//! The plain twin of the vector tokens: arrays and loops, on any processor.

use super::{F8, Simd};

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

impl Simd for Portable {
    type Vector = F8;
    const NAME: &'static str = "portable";

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
}
