//! AVX2 lanes. All `unsafe` of the workspace's vector code is in this file.
//!
//! Invariant that every block relies on: a value of type [`Avx2`] exists only where [`Avx2::detect`] found AVX2, BMI1,
//! BMI2, LZCNT and POPCNT at run time (its field is private), so calling functions compiled for them is sound.

#![expect(unsafe_code, reason = "vector intrinsics; the safe twin is portable.rs")]

use super::{F8, Simd, U8};
use core::arch::x86_64::{
    __m256, __m256d, __m256i, _CMP_LE_OQ, _CMP_LT_OQ, _MM_HINT_T0, _mm_loadu_ps, _mm_prefetch, _mm_setr_epi8,
    _mm256_add_epi32, _mm256_add_pd, _mm256_add_ps, _mm256_and_ps, _mm256_and_si256, _mm256_andnot_ps,
    _mm256_blendv_ps, _mm256_broadcastsi128_si256, _mm256_castps_si256, _mm256_castps128_ps256,
    _mm256_castps256_ps128, _mm256_castsi256_ps, _mm256_cmp_ps, _mm256_cmpeq_epi32, _mm256_cvtepi32_ps,
    _mm256_cvtpd_ps, _mm256_cvtps_pd, _mm256_cvttps_epi32, _mm256_div_pd, _mm256_div_ps,
    _mm256_extractf128_ps, _mm256_i32gather_epi32, _mm256_i32gather_ps, _mm256_insertf128_ps, _mm256_load_ps,
    _mm256_load_si256, _mm256_loadu_ps, _mm256_loadu_si256, _mm256_max_ps, _mm256_min_epu32, _mm256_min_pd,
    _mm256_min_ps, _mm256_movemask_ps, _mm256_mul_pd, _mm256_mul_ps, _mm256_mullo_epi32, _mm256_or_ps,
    _mm256_or_si256, _mm256_permutevar8x32_ps, _mm256_set_m128, _mm256_set1_epi8, _mm256_set1_epi32,
    _mm256_set1_ps, _mm256_shuffle_epi8, _mm256_shuffle_ps, _mm256_slli_epi32, _mm256_sqrt_pd,
    _mm256_sqrt_ps, _mm256_srli_epi32, _mm256_store_ps, _mm256_store_si256, _mm256_storeu_ps,
    _mm256_sub_epi32, _mm256_sub_pd, _mm256_sub_ps, _mm256_unpackhi_ps, _mm256_unpacklo_ps, _mm256_xor_ps,
    _mm256_xor_si256,
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

/// The four numbers from each index on: the first ones, the second ones and so on.
///
/// # Safety
/// The processor has AVX2, and four numbers can be read from each index on.
#[inline(always)]
unsafe fn columns_of_fours(from: *const f32, first: &[u32; 8]) -> [__m256; 4] {
    // Loops and closures would be calls without the instruction set.
    // SAFETY: as this function's.
    unsafe {
        let a = _mm256_castps128_ps256(_mm_loadu_ps(from.add(first[0] as usize)));
        let b = _mm256_castps128_ps256(_mm_loadu_ps(from.add(first[1] as usize)));
        let c = _mm256_castps128_ps256(_mm_loadu_ps(from.add(first[2] as usize)));
        let d = _mm256_castps128_ps256(_mm_loadu_ps(from.add(first[3] as usize)));
        let a = _mm256_insertf128_ps::<1>(a, _mm_loadu_ps(from.add(first[4] as usize)));
        let b = _mm256_insertf128_ps::<1>(b, _mm_loadu_ps(from.add(first[5] as usize)));
        let c = _mm256_insertf128_ps::<1>(c, _mm_loadu_ps(from.add(first[6] as usize)));
        let d = _mm256_insertf128_ps::<1>(d, _mm_loadu_ps(from.add(first[7] as usize)));
        let (ab, cd) = (_mm256_unpacklo_ps(a, b), _mm256_unpacklo_ps(c, d));
        let (ab_high, cd_high) = (_mm256_unpackhi_ps(a, b), _mm256_unpackhi_ps(c, d));
        [
            _mm256_shuffle_ps::<0b01_00_01_00>(ab, cd),
            _mm256_shuffle_ps::<0b11_10_11_10>(ab, cd),
            _mm256_shuffle_ps::<0b01_00_01_00>(ab_high, cd_high),
            _mm256_shuffle_ps::<0b11_10_11_10>(ab_high, cd_high),
        ]
    }
}

impl Simd for Avx2 {
    type Vector = __m256;
    type Integers = __m256i;
    type Doubles = [__m256d; 2];
    const NAME: &'static str = "avx2";
    const EMULATED: bool = false;

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

    #[inline(always)]
    fn div(self, a: __m256, b: __m256) -> __m256 {
        // SAFETY: `self` proves AVX2.
        unsafe { _mm256_div_ps(a, b) }
    }
    #[inline(always)]
    fn sqrt(self, a: __m256) -> __m256 {
        // SAFETY: `self` proves AVX2.
        unsafe { _mm256_sqrt_ps(a) }
    }
    #[inline(always)]
    fn and(self, a: __m256, b: __m256) -> __m256 {
        // SAFETY: `self` proves AVX2.
        unsafe { _mm256_and_ps(a, b) }
    }
    #[inline(always)]
    fn or(self, a: __m256, b: __m256) -> __m256 {
        // SAFETY: `self` proves AVX2.
        unsafe { _mm256_or_ps(a, b) }
    }
    #[inline(always)]
    fn and_not(self, a: __m256, b: __m256) -> __m256 {
        // SAFETY: `self` proves AVX2.
        unsafe { _mm256_andnot_ps(a, b) }
    }
    #[inline(always)]
    fn less(self, a: __m256, b: __m256) -> __m256 {
        // SAFETY: `self` proves AVX2.
        unsafe { _mm256_cmp_ps::<_CMP_LT_OQ>(a, b) }
    }
    #[inline(always)]
    fn less_equal(self, a: __m256, b: __m256) -> __m256 {
        // SAFETY: `self` proves AVX2.
        unsafe { _mm256_cmp_ps::<_CMP_LE_OQ>(a, b) }
    }
    #[inline(always)]
    fn select(self, mask: __m256, a: __m256, b: __m256) -> __m256 {
        // SAFETY: `self` proves AVX2.
        unsafe { _mm256_blendv_ps(b, a, mask) }
    }
    #[inline(always)]
    fn signs(self, a: __m256) -> u32 {
        // SAFETY: `self` proves AVX2.
        unsafe { _mm256_movemask_ps(a).cast_unsigned() }
    }

    #[inline(always)]
    fn splat_integer(self, value: u32) -> __m256i {
        // SAFETY: `self` proves AVX2.
        unsafe { _mm256_set1_epi32(value.cast_signed()) }
    }
    #[inline(always)]
    fn load_integers(self, from: &U8) -> __m256i {
        // SAFETY: `self` proves AVX2; a reference to U8 is valid for 32 bytes and aligned to 32.
        unsafe { _mm256_load_si256(from.0.as_ptr().cast()) }
    }
    #[inline(always)]
    fn store_integers(self, vector: __m256i) -> U8 {
        let mut to = U8([0; 8]);
        // SAFETY: `self` proves AVX2; `to` is valid for 32 bytes and aligned to 32.
        unsafe { _mm256_store_si256(to.0.as_mut_ptr().cast(), vector) };
        to
    }
    #[inline(always)]
    fn xor_integers(self, a: __m256i, b: __m256i) -> __m256i {
        // SAFETY: `self` proves AVX2.
        unsafe { _mm256_xor_si256(a, b) }
    }
    #[inline(always)]
    fn shift_left<const N: i32>(self, a: __m256i) -> __m256i {
        // SAFETY: `self` proves AVX2.
        unsafe { _mm256_slli_epi32::<N>(a) }
    }
    #[inline(always)]
    fn shift_right<const N: i32>(self, a: __m256i) -> __m256i {
        // SAFETY: `self` proves AVX2.
        unsafe { _mm256_srli_epi32::<N>(a) }
    }
    #[inline(always)]
    fn reverse_bits(self, a: __m256i) -> __m256i {
        // The halves of each byte are looked up, reversed; then the bytes of each number.
        // SAFETY: `self` proves AVX2.
        unsafe {
            let low = _mm256_set1_epi8(0x0f);
            let reversed = _mm256_broadcastsi128_si256(_mm_setr_epi8(
                0, 8, 4, 12, 2, 10, 6, 14, 1, 9, 5, 13, 3, 11, 7, 15,
            ));
            let order = _mm256_broadcastsi128_si256(_mm_setr_epi8(
                3, 2, 1, 0, 7, 6, 5, 4, 11, 10, 9, 8, 15, 14, 13, 12,
            ));
            let lower = _mm256_shuffle_epi8(reversed, _mm256_and_si256(a, low));
            let upper = _mm256_shuffle_epi8(reversed, _mm256_and_si256(_mm256_srli_epi32::<4>(a), low));
            _mm256_shuffle_epi8(_mm256_or_si256(_mm256_slli_epi32::<4>(lower), upper), order)
        }
    }
    #[inline(always)]
    fn equal_integers(self, a: __m256i, b: __m256i) -> __m256 {
        // SAFETY: `self` proves AVX2.
        unsafe { _mm256_castsi256_ps(_mm256_cmpeq_epi32(a, b)) }
    }
    #[inline(always)]
    fn permute(self, a: __m256, indices: __m256i) -> __m256 {
        // SAFETY: `self` proves AVX2.
        unsafe { _mm256_permutevar8x32_ps(a, indices) }
    }
    #[inline(always)]
    fn read(self, from: &[f32; 8]) -> __m256 {
        // SAFETY: `self` proves AVX2; the reference is valid for 32 bytes, and unaligned loads ask for nothing else.
        unsafe { _mm256_loadu_ps(from.as_ptr()) }
    }
    #[inline(always)]
    fn write(self, vector: __m256, to: &mut [f32; 8]) {
        // SAFETY: `self` proves AVX2; the reference is valid for 32 bytes, and unaligned stores ask for nothing else.
        unsafe { _mm256_storeu_ps(to.as_mut_ptr(), vector) }
    }
    #[inline(always)]
    fn gather(self, from: &[f32], indices: __m256i) -> __m256 {
        let last = super::last_index(from.len());
        // SAFETY: `self` proves AVX2; no index is beyond the last entry, which is below 2^31.
        unsafe {
            let indices = _mm256_min_epu32(indices, _mm256_set1_epi32(last.cast_signed()));
            _mm256_i32gather_ps::<4>(from.as_ptr(), indices)
        }
    }
    #[inline(always)]
    fn gather_integers(self, from: &[u32], indices: __m256i) -> __m256i {
        let last = super::last_index(from.len());
        // SAFETY: `self` proves AVX2; no index is beyond the last entry, which is below 2^31.
        unsafe {
            let indices = _mm256_min_epu32(indices, _mm256_set1_epi32(last.cast_signed()));
            _mm256_i32gather_epi32::<4>(from.as_ptr().cast(), indices)
        }
    }
    #[inline(always)]
    fn gather_fours(self, from: &[f32], first: __m256i) -> [__m256; 4] {
        let last = super::last_run::<4>(from.len());
        // SAFETY: `self` proves AVX2; from no index on are there fewer than four entries.
        unsafe {
            let first = _mm256_min_epu32(first, _mm256_set1_epi32(last.cast_signed()));
            let U8(first) = self.store_integers(first);
            columns_of_fours(from.as_ptr(), &first)
        }
    }
    #[inline(always)]
    fn gather_fours_of_integers(self, from: &[u32], first: __m256i) -> [__m256i; 4] {
        let last = super::last_run::<4>(from.len());
        // SAFETY: `self` proves AVX2; from no index on are there fewer than four entries, of the size of a float and any bits.
        unsafe {
            let first = _mm256_min_epu32(first, _mm256_set1_epi32(last.cast_signed()));
            let U8(first) = self.store_integers(first);
            let [a, b, c, d] = columns_of_fours(from.as_ptr().cast(), &first);
            [self.bits_of(a), self.bits_of(b), self.bits_of(c), self.bits_of(d)]
        }
    }
    #[inline(always)]
    fn gather_eights(self, from: &[f32], first: __m256i) -> [__m256; 8] {
        let last = super::last_run::<8>(from.len());
        // SAFETY: `self` proves AVX2; from no index on are there fewer than eight entries.
        unsafe {
            let first = _mm256_min_epu32(first, _mm256_set1_epi32(last.cast_signed()));
            let U8(first) = self.store_integers(first);
            let [a, b, c, d] = columns_of_fours(from.as_ptr(), &first);
            let [e, f, g, h] = columns_of_fours(from.as_ptr().add(4), &first);
            [a, b, c, d, e, f, g, h]
        }
    }

    #[inline(always)]
    fn widen(self, a: __m256) -> [__m256d; 2] {
        // SAFETY: `self` proves AVX2.
        unsafe {
            [_mm256_cvtps_pd(_mm256_castps256_ps128(a)), _mm256_cvtps_pd(_mm256_extractf128_ps::<1>(a))]
        }
    }
    #[inline(always)]
    fn narrow(self, [low, high]: [__m256d; 2]) -> __m256 {
        // SAFETY: `self` proves AVX2.
        unsafe { _mm256_set_m128(_mm256_cvtpd_ps(high), _mm256_cvtpd_ps(low)) }
    }
    #[inline(always)]
    fn add_integers(self, a: __m256i, b: __m256i) -> __m256i {
        // SAFETY: `self` proves AVX2.
        unsafe { _mm256_add_epi32(a, b) }
    }
    #[inline(always)]
    fn sub_integers(self, a: __m256i, b: __m256i) -> __m256i {
        // SAFETY: `self` proves AVX2.
        unsafe { _mm256_sub_epi32(a, b) }
    }
    #[inline(always)]
    fn mul_integers(self, a: __m256i, b: __m256i) -> __m256i {
        // SAFETY: `self` proves AVX2.
        unsafe { _mm256_mullo_epi32(a, b) }
    }
    #[inline(always)]
    fn to_floats(self, a: __m256i) -> __m256 {
        // SAFETY: `self` proves AVX2.
        unsafe { _mm256_cvtepi32_ps(a) }
    }
    #[inline(always)]
    fn truncate(self, a: __m256) -> __m256i {
        // SAFETY: `self` proves AVX2.
        unsafe { _mm256_cvttps_epi32(a) }
    }
    #[inline(always)]
    fn bits_of(self, a: __m256) -> __m256i {
        // SAFETY: `self` proves AVX2.
        unsafe { _mm256_castps_si256(a) }
    }
    #[inline(always)]
    fn floats_of(self, a: __m256i) -> __m256 {
        // SAFETY: `self` proves AVX2.
        unsafe { _mm256_castsi256_ps(a) }
    }
    #[inline(always)]
    fn add_doubles(self, a: [__m256d; 2], b: [__m256d; 2]) -> [__m256d; 2] {
        // SAFETY: `self` proves AVX2.
        unsafe { [_mm256_add_pd(a[0], b[0]), _mm256_add_pd(a[1], b[1])] }
    }
    #[inline(always)]
    fn sub_doubles(self, a: [__m256d; 2], b: [__m256d; 2]) -> [__m256d; 2] {
        // SAFETY: `self` proves AVX2.
        unsafe { [_mm256_sub_pd(a[0], b[0]), _mm256_sub_pd(a[1], b[1])] }
    }
    #[inline(always)]
    fn mul_doubles(self, a: [__m256d; 2], b: [__m256d; 2]) -> [__m256d; 2] {
        // SAFETY: `self` proves AVX2.
        unsafe { [_mm256_mul_pd(a[0], b[0]), _mm256_mul_pd(a[1], b[1])] }
    }
    #[inline(always)]
    fn sqrt_doubles(self, a: [__m256d; 2]) -> [__m256d; 2] {
        // SAFETY: `self` proves AVX2.
        unsafe { [_mm256_sqrt_pd(a[0]), _mm256_sqrt_pd(a[1])] }
    }
    #[inline(always)]
    fn div_doubles(self, a: [__m256d; 2], b: [__m256d; 2]) -> [__m256d; 2] {
        // SAFETY: `self` proves AVX2.
        unsafe { [_mm256_div_pd(a[0], b[0]), _mm256_div_pd(a[1], b[1])] }
    }
    #[inline(always)]
    fn min_doubles(self, a: [__m256d; 2], b: [__m256d; 2]) -> [__m256d; 2] {
        // SAFETY: `self` proves AVX2.
        unsafe { [_mm256_min_pd(a[0], b[0]), _mm256_min_pd(a[1], b[1])] }
    }
}
