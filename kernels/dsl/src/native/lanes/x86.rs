//! Registers of AVX2 and of AVX-512.

#[cfg(target_arch = "x86")]
use core::arch::x86::*;
#[cfg(target_arch = "x86_64")]
use core::arch::x86_64::*;

use super::register::register;

/// AVX2's `f32`.
pub type F32x8 = __m256;
/// AVX2's `f64`.
pub type F64x4 = __m256d;
/// AVX-512's `f32`.
pub type F32x16 = __m512;
/// AVX-512's `f64`.
pub type F64x8 = __m512d;

register! {
    F32x8: 8 of f32 as u32, masks: Self;
    load(from) = _mm256_loadu_ps(from);
    store(a, to) = _mm256_storeu_ps(to, a);
    load_blocks(start, step; spans: 1) = {
        let first = _mm256_castps128_ps256(_mm_loadu_ps(start));
        _mm256_insertf128_ps::<1>(first, _mm_loadu_ps(start.add(step)))
    };
    store_blocks(a) = {
        _mm_storeu_ps(start, _mm256_castps256_ps128(a));
        _mm_storeu_ps(start.add(step), _mm256_extractf128_ps::<1>(a));
    };
    splat(x) -> Number = _mm256_set1_ps(x);
    add(a, b) -> Number = _mm256_add_ps(a, b);
    sub(a, b) -> Number = _mm256_sub_ps(a, b);
    mul(a, b) -> Number = _mm256_mul_ps(a, b);
    div(a, b) -> Number = _mm256_div_ps(a, b);
    multiply_subtract(a, b, c) -> Number = _mm256_fmsub_ps(a, b, c);
    sqrt(a) -> Number = _mm256_sqrt_ps(a);
    floor(a) -> Number = _mm256_floor_ps(a);
    abs(a) -> Number = _mm256_and_ps(a, Self::bits::<0x7fff_ffff>());
    neg(a) -> Number = _mm256_xor_ps(a, Self::bits::<0x8000_0000>());
    min(a, b) -> Number = _mm256_min_ps(a, b);
    max(a, b) -> Number = _mm256_max_ps(a, b);
    lt(a, b) -> Mask = _mm256_cmp_ps::<_CMP_LT_OQ>(a, b);
    le(a, b) -> Mask = _mm256_cmp_ps::<_CMP_LE_OQ>(a, b);
    eq(a, b) -> Mask = _mm256_cmp_ps::<_CMP_EQ_OQ>(a, b);
    select(mask, a, b) -> Number = _mm256_blendv_ps(b, a, mask);
    both(a, b) -> Mask = _mm256_and_ps(a, b);
    either(a, b) -> Mask = _mm256_or_ps(a, b);
    not(a) -> Mask = _mm256_xor_ps(a, Self::bits::<0xffff_ffff>());
    any(a) -> Truth = _mm256_movemask_ps(a) != 0;
    all(a) -> Truth = _mm256_movemask_ps(a) == 0xff;
    and(a, b) -> Number = _mm256_and_ps(a, b);
    or(a, b) -> Number = _mm256_or_ps(a, b);
    xor(a, b) -> Number = _mm256_xor_ps(a, b);
    add_bits(a, b) -> Number = _mm256_castsi256_ps(_mm256_add_epi32(_mm256_castps_si256(a), _mm256_castps_si256(b)));
    sub_bits(a, b) -> Number = _mm256_castsi256_ps(_mm256_sub_epi32(_mm256_castps_si256(a), _mm256_castps_si256(b)));
    half_bits(a) -> Number = _mm256_castsi256_ps(_mm256_srli_epi32::<1>(_mm256_castps_si256(a)));
    exponent(a) -> Number = _mm256_cvtepi32_ps(_mm256_srai_epi32::<23>(_mm256_castps_si256(a)));
    power(a) -> Number = {
        let biased = _mm256_add_epi32(_mm256_cvttps_epi32(a), _mm256_set1_epi32(127));
        _mm256_castsi256_ps(_mm256_slli_epi32::<23>(biased))
    };
    unpack(a, b) -> Numbers = (_mm256_unpacklo_ps(a, b), _mm256_unpackhi_ps(a, b));
    spread(a) -> Number = _mm256_permutevar8x32_ps(a, _mm256_setr_epi32(0, 2, 4, 6, 1, 3, 5, 7));
    align(a) -> Number = _mm256_permutevar8x32_ps(a, _mm256_setr_epi32(0, 4, 1, 5, 2, 6, 3, 7));
    deinterleave(a, b) -> Numbers = {
        // By blocks first: two of `a`, two of `b`.
        let order = _mm256_setr_epi32(0, 1, 4, 5, 2, 3, 6, 7);
        (
            _mm256_permutevar8x32_ps(_mm256_shuffle_ps::<0b10_00_10_00>(a, b), order),
            _mm256_permutevar8x32_ps(_mm256_shuffle_ps::<0b11_01_11_01>(a, b), order),
        )
    };
    interleave(a, b) -> Numbers = {
        let (low, high) = Self::unpack(a, b);
        (_mm256_permute2f128_ps::<0x20>(low, high), _mm256_permute2f128_ps::<0x31>(low, high))
    };
    rotate(a) -> Number = _mm256_permute_ps::<0b00_11_10_01>(a);
}

register! {
    F64x4: 4 of f64 as u64, masks: Self;
    load(from) = _mm256_loadu_pd(from);
    store(a, to) = _mm256_storeu_pd(to, a);
    load_blocks(start, step; spans: 1) = {
        let first = _mm256_castpd128_pd256(_mm_loadu_pd(start));
        _mm256_insertf128_pd::<1>(first, _mm_loadu_pd(start.add(step)))
    };
    store_blocks(a) = {
        _mm_storeu_pd(start, _mm256_castpd256_pd128(a));
        _mm_storeu_pd(start.add(step), _mm256_extractf128_pd::<1>(a));
    };
    splat(x) -> Number = _mm256_set1_pd(x);
    add(a, b) -> Number = _mm256_add_pd(a, b);
    sub(a, b) -> Number = _mm256_sub_pd(a, b);
    mul(a, b) -> Number = _mm256_mul_pd(a, b);
    div(a, b) -> Number = _mm256_div_pd(a, b);
    multiply_subtract(a, b, c) -> Number = _mm256_fmsub_pd(a, b, c);
    sqrt(a) -> Number = _mm256_sqrt_pd(a);
    floor(a) -> Number = _mm256_floor_pd(a);
    abs(a) -> Number = _mm256_and_pd(a, Self::bits::<0x7fff_ffff_ffff_ffff>());
    neg(a) -> Number = _mm256_xor_pd(a, Self::bits::<0x8000_0000_0000_0000>());
    min(a, b) -> Number = _mm256_min_pd(a, b);
    max(a, b) -> Number = _mm256_max_pd(a, b);
    lt(a, b) -> Mask = _mm256_cmp_pd::<_CMP_LT_OQ>(a, b);
    le(a, b) -> Mask = _mm256_cmp_pd::<_CMP_LE_OQ>(a, b);
    eq(a, b) -> Mask = _mm256_cmp_pd::<_CMP_EQ_OQ>(a, b);
    select(mask, a, b) -> Number = _mm256_blendv_pd(b, a, mask);
    both(a, b) -> Mask = _mm256_and_pd(a, b);
    either(a, b) -> Mask = _mm256_or_pd(a, b);
    not(a) -> Mask = _mm256_xor_pd(a, Self::bits::<0xffff_ffff_ffff_ffff>());
    any(a) -> Truth = _mm256_movemask_pd(a) != 0;
    all(a) -> Truth = _mm256_movemask_pd(a) == 0xf;
    and(a, b) -> Number = _mm256_and_pd(a, b);
    or(a, b) -> Number = _mm256_or_pd(a, b);
    xor(a, b) -> Number = _mm256_xor_pd(a, b);
    add_bits(a, b) -> Number = _mm256_castsi256_pd(_mm256_add_epi64(_mm256_castpd_si256(a), _mm256_castpd_si256(b)));
    sub_bits(a, b) -> Number = _mm256_castsi256_pd(_mm256_sub_epi64(_mm256_castpd_si256(a), _mm256_castpd_si256(b)));
    half_bits(a) -> Number = _mm256_castsi256_pd(_mm256_srli_epi64::<1>(_mm256_castpd_si256(a)));
    exponent(a) -> Number = {
        // There is neither a signed shift of 64-bit integers nor their conversion: 2048 more, as the digits of 2^52.
        let unsigned = _mm256_castpd_si256(Self::xor(a, Self::bits::<0x8000_0000_0000_0000>()));
        let digits = _mm256_castsi256_pd(_mm256_srli_epi64::<52>(unsigned));
        let number = Self::or(digits, Self::bits::<0x4330_0000_0000_0000>());
        Self::sub(number, _mm256_set1_pd(4_503_599_627_370_496.0 + 2048.0))
    };
    power(a) -> Number = {
        // The last digits of a sum with 2^52 * 1.5 are the integer.
        let digits = _mm256_castpd_si256(Self::add(a, _mm256_set1_pd(6_755_399_441_055_744.0)));
        let biased = _mm256_add_epi64(digits, _mm256_set1_epi64x(1023));
        _mm256_castsi256_pd(_mm256_slli_epi64::<52>(biased))
    };
    unpack(a, b) -> Numbers = (_mm256_unpacklo_pd(a, b), _mm256_unpackhi_pd(a, b));
    spread(a) -> Number = _mm256_permute4x64_pd::<0b11_01_10_00>(a);
    align(a) -> Number = _mm256_permute4x64_pd::<0b11_01_10_00>(a);
    deinterleave(a, b) -> Numbers = {
        let (even, odd) = Self::unpack(a, b);
        (Self::spread(even), Self::spread(odd))
    };
    interleave(a, b) -> Numbers = {
        let (low, high) = Self::unpack(a, b);
        (_mm256_permute2f128_pd::<0x20>(low, high), _mm256_permute2f128_pd::<0x31>(low, high))
    };
    rotate(a) -> Number = _mm256_permute_pd::<0b0101>(a);
}

register! {
    F32x16: 16 of f32 as u32, masks: __mmask16;
    load(from) = _mm512_loadu_ps(from);
    store(a, to) = _mm512_storeu_ps(to, a);
    load_blocks(start, step; spans: 3) = {
        let all = _mm512_castps128_ps512(_mm_loadu_ps(start));
        let all = _mm512_insertf32x4::<1>(all, _mm_loadu_ps(start.add(step)));
        let all = _mm512_insertf32x4::<2>(all, _mm_loadu_ps(start.add(2 * step)));
        _mm512_insertf32x4::<3>(all, _mm_loadu_ps(start.add(3 * step)))
    };
    store_blocks(a) = {
        _mm_storeu_ps(start, _mm512_castps512_ps128(a));
        _mm_storeu_ps(start.add(step), _mm512_extractf32x4_ps::<1>(a));
        _mm_storeu_ps(start.add(2 * step), _mm512_extractf32x4_ps::<2>(a));
        _mm_storeu_ps(start.add(3 * step), _mm512_extractf32x4_ps::<3>(a));
    };
    splat(x) -> Number = _mm512_set1_ps(x);
    add(a, b) -> Number = _mm512_add_ps(a, b);
    sub(a, b) -> Number = _mm512_sub_ps(a, b);
    mul(a, b) -> Number = _mm512_mul_ps(a, b);
    div(a, b) -> Number = _mm512_div_ps(a, b);
    multiply_subtract(a, b, c) -> Number = _mm512_fmsub_ps(a, b, c);
    sqrt(a) -> Number = _mm512_sqrt_ps(a);
    floor(a) -> Number = _mm512_roundscale_ps::<{ _MM_FROUND_TO_NEG_INF | _MM_FROUND_NO_EXC }>(a);
    abs(a) -> Number = _mm512_and_ps(a, Self::bits::<0x7fff_ffff>());
    neg(a) -> Number = _mm512_xor_ps(a, Self::bits::<0x8000_0000>());
    min(a, b) -> Number = _mm512_min_ps(a, b);
    max(a, b) -> Number = _mm512_max_ps(a, b);
    lt(a, b) -> Mask = _mm512_cmp_ps_mask::<_CMP_LT_OQ>(a, b);
    le(a, b) -> Mask = _mm512_cmp_ps_mask::<_CMP_LE_OQ>(a, b);
    eq(a, b) -> Mask = _mm512_cmp_ps_mask::<_CMP_EQ_OQ>(a, b);
    select(mask, a, b) -> Number = _mm512_mask_blend_ps(mask, b, a);
    both(a, b) -> Mask = a & b;
    either(a, b) -> Mask = a | b;
    not(a) -> Mask = !a;
    any(a) -> Truth = a != 0;
    all(a) -> Truth = a == 0xffff;
    and(a, b) -> Number = _mm512_and_ps(a, b);
    or(a, b) -> Number = _mm512_or_ps(a, b);
    xor(a, b) -> Number = _mm512_xor_ps(a, b);
    add_bits(a, b) -> Number = _mm512_castsi512_ps(_mm512_add_epi32(_mm512_castps_si512(a), _mm512_castps_si512(b)));
    sub_bits(a, b) -> Number = _mm512_castsi512_ps(_mm512_sub_epi32(_mm512_castps_si512(a), _mm512_castps_si512(b)));
    half_bits(a) -> Number = _mm512_castsi512_ps(_mm512_srli_epi32::<1>(_mm512_castps_si512(a)));
    exponent(a) -> Number = _mm512_cvtepi32_ps(_mm512_srai_epi32::<23>(_mm512_castps_si512(a)));
    power(a) -> Number = {
        let biased = _mm512_add_epi32(_mm512_cvttps_epi32(a), _mm512_set1_epi32(127));
        _mm512_castsi512_ps(_mm512_slli_epi32::<23>(biased))
    };
    unpack(a, b) -> Numbers = (_mm512_unpacklo_ps(a, b), _mm512_unpackhi_ps(a, b));
    spread(a) -> Number = {
        let order = _mm512_setr_epi32(0, 4, 8, 12, 1, 5, 9, 13, 2, 6, 10, 14, 3, 7, 11, 15);
        _mm512_permutexvar_ps(order, a)
    };
    align(a) -> Number = Self::spread(a);
    deinterleave(a, b) -> Numbers = {
        let even = _mm512_setr_epi32(0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20, 22, 24, 26, 28, 30);
        let odd = _mm512_setr_epi32(1, 3, 5, 7, 9, 11, 13, 15, 17, 19, 21, 23, 25, 27, 29, 31);
        (_mm512_permutex2var_ps(a, even, b), _mm512_permutex2var_ps(a, odd, b))
    };
    interleave(a, b) -> Numbers = {
        let low = _mm512_setr_epi32(0, 16, 1, 17, 2, 18, 3, 19, 4, 20, 5, 21, 6, 22, 7, 23);
        let high = _mm512_setr_epi32(8, 24, 9, 25, 10, 26, 11, 27, 12, 28, 13, 29, 14, 30, 15, 31);
        (_mm512_permutex2var_ps(a, low, b), _mm512_permutex2var_ps(a, high, b))
    };
    rotate(a) -> Number = _mm512_permute_ps::<0b00_11_10_01>(a);
}

register! {
    F64x8: 8 of f64 as u64, masks: __mmask8;
    load(from) = _mm512_loadu_pd(from);
    store(a, to) = _mm512_storeu_pd(to, a);
    load_blocks(start, step; spans: 3) = {
        let all = _mm512_castpd128_pd512(_mm_loadu_pd(start));
        let all = _mm512_insertf64x2::<1>(all, _mm_loadu_pd(start.add(step)));
        let all = _mm512_insertf64x2::<2>(all, _mm_loadu_pd(start.add(2 * step)));
        _mm512_insertf64x2::<3>(all, _mm_loadu_pd(start.add(3 * step)))
    };
    store_blocks(a) = {
        _mm_storeu_pd(start, _mm512_castpd512_pd128(a));
        _mm_storeu_pd(start.add(step), _mm512_extractf64x2_pd::<1>(a));
        _mm_storeu_pd(start.add(2 * step), _mm512_extractf64x2_pd::<2>(a));
        _mm_storeu_pd(start.add(3 * step), _mm512_extractf64x2_pd::<3>(a));
    };
    splat(x) -> Number = _mm512_set1_pd(x);
    add(a, b) -> Number = _mm512_add_pd(a, b);
    sub(a, b) -> Number = _mm512_sub_pd(a, b);
    mul(a, b) -> Number = _mm512_mul_pd(a, b);
    div(a, b) -> Number = _mm512_div_pd(a, b);
    multiply_subtract(a, b, c) -> Number = _mm512_fmsub_pd(a, b, c);
    sqrt(a) -> Number = _mm512_sqrt_pd(a);
    floor(a) -> Number = _mm512_roundscale_pd::<{ _MM_FROUND_TO_NEG_INF | _MM_FROUND_NO_EXC }>(a);
    abs(a) -> Number = _mm512_and_pd(a, Self::bits::<0x7fff_ffff_ffff_ffff>());
    neg(a) -> Number = _mm512_xor_pd(a, Self::bits::<0x8000_0000_0000_0000>());
    min(a, b) -> Number = _mm512_min_pd(a, b);
    max(a, b) -> Number = _mm512_max_pd(a, b);
    lt(a, b) -> Mask = _mm512_cmp_pd_mask::<_CMP_LT_OQ>(a, b);
    le(a, b) -> Mask = _mm512_cmp_pd_mask::<_CMP_LE_OQ>(a, b);
    eq(a, b) -> Mask = _mm512_cmp_pd_mask::<_CMP_EQ_OQ>(a, b);
    select(mask, a, b) -> Number = _mm512_mask_blend_pd(mask, b, a);
    both(a, b) -> Mask = a & b;
    either(a, b) -> Mask = a | b;
    not(a) -> Mask = !a;
    any(a) -> Truth = a != 0;
    all(a) -> Truth = a == 0xff;
    and(a, b) -> Number = _mm512_and_pd(a, b);
    or(a, b) -> Number = _mm512_or_pd(a, b);
    xor(a, b) -> Number = _mm512_xor_pd(a, b);
    add_bits(a, b) -> Number = _mm512_castsi512_pd(_mm512_add_epi64(_mm512_castpd_si512(a), _mm512_castpd_si512(b)));
    sub_bits(a, b) -> Number = _mm512_castsi512_pd(_mm512_sub_epi64(_mm512_castpd_si512(a), _mm512_castpd_si512(b)));
    half_bits(a) -> Number = _mm512_castsi512_pd(_mm512_srli_epi64::<1>(_mm512_castpd_si512(a)));
    exponent(a) -> Number = _mm512_cvtepi64_pd(_mm512_srai_epi64::<52>(_mm512_castpd_si512(a)));
    power(a) -> Number = {
        let biased = _mm512_add_epi64(_mm512_cvttpd_epi64(a), _mm512_set1_epi64(1023));
        _mm512_castsi512_pd(_mm512_slli_epi64::<52>(biased))
    };
    unpack(a, b) -> Numbers = (_mm512_unpacklo_pd(a, b), _mm512_unpackhi_pd(a, b));
    spread(a) -> Number = _mm512_permutexvar_pd(_mm512_setr_epi64(0, 4, 1, 5, 2, 6, 3, 7), a);
    align(a) -> Number = _mm512_permutexvar_pd(_mm512_setr_epi64(0, 2, 4, 6, 1, 3, 5, 7), a);
    deinterleave(a, b) -> Numbers = {
        let (even, odd) = (
            _mm512_setr_epi64(0, 2, 4, 6, 8, 10, 12, 14),
            _mm512_setr_epi64(1, 3, 5, 7, 9, 11, 13, 15),
        );
        (_mm512_permutex2var_pd(a, even, b), _mm512_permutex2var_pd(a, odd, b))
    };
    interleave(a, b) -> Numbers = {
        let (low, high) = (
            _mm512_setr_epi64(0, 8, 1, 9, 2, 10, 3, 11),
            _mm512_setr_epi64(4, 12, 5, 13, 6, 14, 7, 15),
        );
        (_mm512_permutex2var_pd(a, low, b), _mm512_permutex2var_pd(a, high, b))
    };
    rotate(a) -> Number = _mm512_permute_pd::<0b0101_0101>(a);
}
