//! AVX2 lanes. All `unsafe` of the workspace's vector code is in this file.
//!
//! Invariant that every block relies on: a value of type [`Avx2`] exists only where [`Avx2::detect`] found AVX2, BMI1,
//! BMI2, LZCNT and POPCNT at run time (its field is private), so calling functions compiled for them is sound.

#![expect(unsafe_code, reason = "vector intrinsics; the safe twin is portable.rs")]

use super::{F8, Simd};
use core::arch::x86_64::{
    __m256, _CMP_LE_OQ, _CMP_LT_OQ, _MM_HINT_T0, _mm_prefetch, _mm256_add_ps, _mm256_and_ps,
    _mm256_andnot_ps, _mm256_castsi256_ps, _mm256_cmp_ps, _mm256_cmpeq_epi32, _mm256_load_ps,
    _mm256_loadu_si256, _mm256_max_ps, _mm256_min_ps, _mm256_movemask_ps, _mm256_mul_ps, _mm256_set1_epi32,
    _mm256_set1_ps, _mm256_store_ps, _mm256_sub_ps, _mm256_xor_ps,
};

/// Proof that the processor has AVX2, BMI1, BMI2, LZCNT and POPCNT.
#[derive(Clone, Copy, Debug)]
pub struct Avx2(());

impl Avx2 {
    /// The token, where the processor has the instructions. The answer is cached by the standard library.
    #[inline]
    pub fn detect() -> Option<Self> {
        (is_x86_feature_detected!("avx2")
            && is_x86_feature_detected!("bmi1")
            && is_x86_feature_detected!("bmi2")
            && is_x86_feature_detected!("lzcnt")
            && is_x86_feature_detected!("popcnt"))
        .then_some(Self(()))
    }
}

/// Compiles the closure for AVX2. FMA is left out on purpose: without it no compiler may contract a·b + c, and all
/// instruction sets give the same bits.
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
#[inline]
fn with_avx2<R>(f: impl FnOnce() -> R) -> R {
    f()
}

impl Simd for Avx2 {
    type Vector = __m256;
    const NAME: &'static str = "avx2";

    #[inline(always)]
    fn vectorize<R>(self, f: impl FnOnce() -> R) -> R {
        // SAFETY: `self` proves that the features exist (see the file's invariant).
        unsafe { with_avx2(f) }
    }
    #[inline(always)]
    fn prefetch(self, from: *const u8) {
        for line in 0..4 {
            // SAFETY: prefetching has no effect on memory, at any address; `wrapping_add` makes no claim about it.
            unsafe { _mm_prefetch::<_MM_HINT_T0>(from.wrapping_add(64 * line).cast()) };
        }
    }
    #[inline(always)]
    fn splat(self, value: f32) -> __m256 {
        // SAFETY: `self` proves AVX2.
        unsafe { _mm256_set1_ps(value) }
    }
    #[inline(always)]
    fn load(self, from: &F8) -> __m256 {
        // SAFETY: `self` proves AVX2; a reference to F8 is valid for 32 bytes and aligned to 32.
        unsafe { _mm256_load_ps(from.0.as_ptr()) }
    }
    #[inline(always)]
    fn store(self, vector: __m256) -> F8 {
        let mut to = F8([0.0; 8]);
        // SAFETY: `self` proves AVX2; `to` is valid for 32 bytes and aligned to 32.
        unsafe { _mm256_store_ps(to.0.as_mut_ptr(), vector) };
        to
    }
    #[inline(always)]
    fn add(self, a: __m256, b: __m256) -> __m256 {
        // SAFETY: `self` proves AVX2.
        unsafe { _mm256_add_ps(a, b) }
    }
    #[inline(always)]
    fn sub(self, a: __m256, b: __m256) -> __m256 {
        // SAFETY: `self` proves AVX2.
        unsafe { _mm256_sub_ps(a, b) }
    }
    #[inline(always)]
    fn mul(self, a: __m256, b: __m256) -> __m256 {
        // SAFETY: `self` proves AVX2.
        unsafe { _mm256_mul_ps(a, b) }
    }
    #[inline(always)]
    fn abs(self, a: __m256) -> __m256 {
        // SAFETY: `self` proves AVX2.
        unsafe { _mm256_andnot_ps(_mm256_set1_ps(-0.0), a) }
    }
    #[inline(always)]
    fn neg(self, a: __m256) -> __m256 {
        // SAFETY: `self` proves AVX2.
        unsafe { _mm256_xor_ps(_mm256_set1_ps(-0.0), a) }
    }
    #[inline(always)]
    fn fill(self, bits: bool) -> __m256 {
        self.splat(f32::from_bits(u32::from(bits).wrapping_neg()))
    }
    #[inline(always)]
    fn swap_where(self, mask: __m256, a: __m256, b: __m256) -> (__m256, __m256) {
        // Three steps of one cycle each; a blend takes as long, and there would be two.
        // SAFETY: `self` proves AVX2.
        unsafe {
            let differ = _mm256_and_ps(_mm256_xor_ps(a, b), mask);
            (_mm256_xor_ps(a, differ), _mm256_xor_ps(b, differ))
        }
    }
    #[inline(always)]
    fn min(self, a: __m256, b: __m256) -> __m256 {
        // SAFETY: `self` proves AVX2.
        unsafe { _mm256_min_ps(a, b) }
    }
    #[inline(always)]
    fn max(self, a: __m256, b: __m256) -> __m256 {
        // SAFETY: `self` proves AVX2.
        unsafe { _mm256_max_ps(a, b) }
    }
    #[inline(always)]
    fn lt(self, a: __m256, b: __m256) -> u32 {
        // SAFETY: `self` proves AVX2.
        unsafe { _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LT_OQ>(a, b)).cast_unsigned() }
    }
    #[inline(always)]
    fn equal(self, numbers: &[u32; 8], value: u32) -> u32 {
        // SAFETY: `self` proves AVX2; the reference is valid for 32 bytes, and unaligned loads ask for nothing else.
        unsafe {
            let numbers = _mm256_loadu_si256(numbers.as_ptr().cast());
            let equal = _mm256_cmpeq_epi32(numbers, _mm256_set1_epi32(value.cast_signed()));
            _mm256_movemask_ps(_mm256_castsi256_ps(equal)).cast_unsigned()
        }
    }
    #[inline(always)]
    fn le(self, a: __m256, b: __m256) -> u32 {
        // SAFETY: `self` proves AVX2.
        unsafe { _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(a, b)).cast_unsigned() }
    }
}
