//! Registers of NEON.

use core::arch::aarch64::*;

use super::register::register;

/// NEON's `f32`.
pub type F32x4 = float32x4_t;
/// NEON's `f64`.
pub type F64x2 = float64x2_t;

register! {
    F32x4: 4 of f32 as u32, masks: uint32x4_t;
    load(from) = vld1q_f32(from);
    store(a, to) = vst1q_f32(to, a);
    load_blocks(start, _step; spans: 0) = vld1q_f32(start);
    store_blocks(a) = vst1q_f32(start, a);
    splat(x) -> Number = vdupq_n_f32(x);
    add(a, b) -> Number = vaddq_f32(a, b);
    sub(a, b) -> Number = vsubq_f32(a, b);
    mul(a, b) -> Number = vmulq_f32(a, b);
    div(a, b) -> Number = vdivq_f32(a, b);
    multiply_subtract(a, b, c) -> Number = vfmaq_f32(vnegq_f32(c), a, b);
    sqrt(a) -> Number = vsqrtq_f32(a);
    floor(a) -> Number = vrndmq_f32(a);
    abs(a) -> Number = vabsq_f32(a);
    neg(a) -> Number = vnegq_f32(a);
    // The instructions `fmin` and `fmax` choose otherwise.
    min(a, b) -> Number = vbslq_f32(vcltq_f32(a, b), a, b);
    max(a, b) -> Number = vbslq_f32(vcgtq_f32(a, b), a, b);
    lt(a, b) -> Mask = vcltq_f32(a, b);
    le(a, b) -> Mask = vcleq_f32(a, b);
    eq(a, b) -> Mask = vceqq_f32(a, b);
    select(mask, a, b) -> Number = vbslq_f32(mask, a, b);
    both(a, b) -> Mask = vandq_u32(a, b);
    either(a, b) -> Mask = vorrq_u32(a, b);
    not(a) -> Mask = vmvnq_u32(a);
    any(a) -> Truth = vmaxvq_u32(a) != 0;
    all(a) -> Truth = vminvq_u32(a) != 0;
    and(a, b) -> Number = vreinterpretq_f32_u32(vandq_u32(vreinterpretq_u32_f32(a), vreinterpretq_u32_f32(b)));
    or(a, b) -> Number = vreinterpretq_f32_u32(vorrq_u32(vreinterpretq_u32_f32(a), vreinterpretq_u32_f32(b)));
    xor(a, b) -> Number = vreinterpretq_f32_u32(veorq_u32(vreinterpretq_u32_f32(a), vreinterpretq_u32_f32(b)));
    add_bits(a, b) -> Number = vreinterpretq_f32_u32(vaddq_u32(vreinterpretq_u32_f32(a), vreinterpretq_u32_f32(b)));
    sub_bits(a, b) -> Number = vreinterpretq_f32_u32(vsubq_u32(vreinterpretq_u32_f32(a), vreinterpretq_u32_f32(b)));
    half_bits(a) -> Number = vreinterpretq_f32_u32(vshrq_n_u32::<1>(vreinterpretq_u32_f32(a)));
    exponent(a) -> Number = vcvtq_f32_s32(vshrq_n_s32::<23>(vreinterpretq_s32_f32(a)));
    power(a) -> Number = vreinterpretq_f32_s32(vshlq_n_s32::<23>(vaddq_s32(vcvtq_s32_f32(a), vdupq_n_s32(127))));
    unpack(a, b) -> Numbers = (vzip1q_f32(a, b), vzip2q_f32(a, b));
    spread(a) -> Number = a;
    align(a) -> Number = a;
    deinterleave(a, b) -> Numbers = (vuzp1q_f32(a, b), vuzp2q_f32(a, b));
    interleave(a, b) -> Numbers = Self::unpack(a, b);
    rotate(a) -> Number = vextq_f32::<1>(a, a);
}

register! {
    F64x2: 2 of f64 as u64, masks: uint64x2_t;
    load(from) = vld1q_f64(from);
    store(a, to) = vst1q_f64(to, a);
    load_blocks(start, _step; spans: 0) = vld1q_f64(start);
    store_blocks(a) = vst1q_f64(start, a);
    splat(x) -> Number = vdupq_n_f64(x);
    add(a, b) -> Number = vaddq_f64(a, b);
    sub(a, b) -> Number = vsubq_f64(a, b);
    mul(a, b) -> Number = vmulq_f64(a, b);
    div(a, b) -> Number = vdivq_f64(a, b);
    multiply_subtract(a, b, c) -> Number = vfmaq_f64(vnegq_f64(c), a, b);
    sqrt(a) -> Number = vsqrtq_f64(a);
    floor(a) -> Number = vrndmq_f64(a);
    abs(a) -> Number = vabsq_f64(a);
    neg(a) -> Number = vnegq_f64(a);
    min(a, b) -> Number = vbslq_f64(vcltq_f64(a, b), a, b);
    max(a, b) -> Number = vbslq_f64(vcgtq_f64(a, b), a, b);
    lt(a, b) -> Mask = vcltq_f64(a, b);
    le(a, b) -> Mask = vcleq_f64(a, b);
    eq(a, b) -> Mask = vceqq_f64(a, b);
    select(mask, a, b) -> Number = vbslq_f64(mask, a, b);
    both(a, b) -> Mask = vandq_u64(a, b);
    either(a, b) -> Mask = vorrq_u64(a, b);
    not(a) -> Mask = vreinterpretq_u64_u32(vmvnq_u32(vreinterpretq_u32_u64(a)));
    any(a) -> Truth = vmaxvq_u32(vreinterpretq_u32_u64(a)) != 0;
    all(a) -> Truth = vminvq_u32(vreinterpretq_u32_u64(a)) != 0;
    and(a, b) -> Number = vreinterpretq_f64_u64(vandq_u64(vreinterpretq_u64_f64(a), vreinterpretq_u64_f64(b)));
    or(a, b) -> Number = vreinterpretq_f64_u64(vorrq_u64(vreinterpretq_u64_f64(a), vreinterpretq_u64_f64(b)));
    xor(a, b) -> Number = vreinterpretq_f64_u64(veorq_u64(vreinterpretq_u64_f64(a), vreinterpretq_u64_f64(b)));
    add_bits(a, b) -> Number = vreinterpretq_f64_u64(vaddq_u64(vreinterpretq_u64_f64(a), vreinterpretq_u64_f64(b)));
    sub_bits(a, b) -> Number = vreinterpretq_f64_u64(vsubq_u64(vreinterpretq_u64_f64(a), vreinterpretq_u64_f64(b)));
    half_bits(a) -> Number = vreinterpretq_f64_u64(vshrq_n_u64::<1>(vreinterpretq_u64_f64(a)));
    exponent(a) -> Number = vcvtq_f64_s64(vshrq_n_s64::<52>(vreinterpretq_s64_f64(a)));
    power(a) -> Number = vreinterpretq_f64_s64(vshlq_n_s64::<52>(vaddq_s64(vcvtq_s64_f64(a), vdupq_n_s64(1023))));
    unpack(a, b) -> Numbers = (vzip1q_f64(a, b), vzip2q_f64(a, b));
    spread(a) -> Number = a;
    align(a) -> Number = a;
    deinterleave(a, b) -> Numbers = (vuzp1q_f64(a, b), vuzp2q_f64(a, b));
    interleave(a, b) -> Numbers = Self::unpack(a, b);
    rotate(a) -> Number = vextq_f64::<1>(a, a);
}
