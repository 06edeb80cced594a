//! Angles by quarter turns.
//!
//! Small angles by Cody and Waite: pi/2 is cut into parts whose products with the count are exact.
//! Large ones by Payne and Hanek (Radian reduction for trigonometric functions, 1983): of the
//! product with 2/pi only the bits that matter, in integers.

use super::primitives::Elementary;
use crate::{Mask, Real, lit};

/// An angle from 0 as quarter turns, modulo 4, and what is left, between -pi/4 and pi/4 (a little
/// more where the count was rounded the other way), in two parts.
#[inline(always)]
pub fn quarters<R: Elementary>(x: R) -> (R, R, R) {
    let limit = if R::IS_WIDE {
        lit!(1_600_000.0)
    } else {
        lit!(3200.0)
    };
    // 2/pi.
    let n = (x * lit!(core::f64::consts::FRAC_2_PI) + lit!(0.5)).floor();
    let [a, b, c, d]: [R; 4] = if R::IS_WIDE {
        [
            lit!(1.570_796_326_734_125_6),
            lit!(6.077_100_506_303_966e-11),
            lit!(2.022_266_248_711_166_5e-21),
            lit!(8.478_427_660_368_9e-32),
        ]
    } else {
        [
            lit!(1.570_556_640_625),
            lit!(0.000_239_670_276_641_845_7),
            lit!(1.589_069_142_937_660_2e-8),
            lit!(2.563_344_151_594_519e-12),
        ]
    };
    let left = (x - n * a).guard();
    let part = (n * b).guard();
    // In `f64` the difference has more digits than the type.
    let (left, rest) = if R::IS_WIDE {
        left.two_sum(-part)
    } else {
        ((left - part).guard(), lit!(0.0))
    };
    let (high, low) = left.two_sum(-(n * c).guard());
    let low = if R::IS_WIDE { low + rest } else { low } - n * d;
    let sum = (high + low).guard();
    let mut parts = (modulo_4(n), sum, (high - sum) + low);
    let large = x.gt(limit);
    if large.any() {
        let (q, high, low) = x.reduce_large();
        parts = (
            R::select(large, q, parts.0),
            R::select(large, high, parts.1),
            R::select(large, low, parts.2),
        );
    }
    parts
}

/// A whole number modulo 4.
#[inline(always)]
fn modulo_4<R: Real>(n: R) -> R {
    n - (n * lit!(0.25)).floor() * lit!(4.0)
}

/// A fraction of a quarter turn in two parts, as an angle.
#[inline(always)]
fn times_quarter<R: Elementary>(high: R, low: R) -> (R, R) {
    let (quarter, rest): (R, R) = if R::IS_WIDE {
        (
            lit!(core::f64::consts::FRAC_PI_2),
            lit!(6.123_233_995_736_766e-17),
        )
    } else {
        (
            lit!(1.570_796_370_506_286_6),
            lit!(-4.371_138_828_673_793e-8),
        )
    };
    let (product, error) = high.two_product(quarter);
    let error = error + (high * rest + low * quarter);
    let sum = (product + error).guard();
    (sum, (product - sum) + error)
}

/// The upper half of a product. Few shading languages have it.
#[inline(always)]
fn product_high(a: u32, b: u32) -> u32 {
    let (a1, a0, b1, b0) = (a >> 16, a & 0xffff, b >> 16, b & 0xffff);
    let low = a0 * b0;
    let middle = a1 * b0 + (low >> 16);
    let other = a0 * b1 + (middle & 0xffff);
    a1 * b1 + (middle >> 16) + (other >> 16)
}

/// 2/pi in words, behind two words of zeros.
const TWO_OVER_PI: [u32; 46] = [
    0,
    0,
    0xa2f9_836e,
    0x4e44_1529,
    0xfc27_57d1,
    0xf534_ddc0,
    0xdb62_9599,
    0x3c43_9041,
    0xfe51_63ab,
    0xdebb_c561,
    0xb724_6e3a,
    0x424d_d2e0,
    0x0649_2eea,
    0x09d1_921c,
    0xfe1d_eb1c,
    0xb129_a73e,
    0xe882_35f5,
    0x2ebb_4484,
    0xe99c_7026,
    0xb45f_7e41,
    0x3991_d639,
    0x8353_39f4,
    0x9c84_5f8b,
    0xbdf9_283b,
    0x1ff8_97ff,
    0xde05_980f,
    0xef2f_118b,
    0x5a0a_6d1f,
    0x6d36_7ecf,
    0x27cb_09b7,
    0x4f46_3f66,
    0x9e5f_ea2d,
    0x7527_bac7,
    0xebe5_f17b,
    0x3d07_39f7,
    0x8a52_92ea,
    0x6bfb_5fb1,
    0x1f8d_5d08,
    0x5603_3046,
    0xfc7b_6bab,
    0xf0cf_bc20,
    0x9af4_361d,
    0xa9e3_9161,
    0x5ee6_1b08,
    0x6599_855f,
    0x14a0_6840,
];

/// Four words of 2/pi from `word` on, which is from 1 to 5: as far as arguments of `f32` reach. By
/// choices, which cost a shader less than a table: it would copy that into memory for each use.
#[inline(always)]
fn four_words(word: u32) -> [u32; 4] {
    const W: [u32; 46] = TWO_OVER_PI;
    let choose = |holds: bool, a: u32, b: u32| if holds { a } else { b };
    let (odd, two, last) = (word & 1 == 0, word == 3 || word == 4, word == 5);
    let a = choose(two, W[3], W[1]);
    let b = choose(two, W[4], W[2]);
    let c = choose(two, W[5], W[3]);
    let d = choose(two, W[6], W[4]);
    let e = choose(two, W[7], W[5]);
    [
        choose(last, W[5], choose(odd, b, a)),
        choose(last, W[6], choose(odd, c, b)),
        choose(last, W[7], choose(odd, d, c)),
        choose(last, W[8], choose(odd, e, d)),
    ]
}

/// The words' bits from `shift` on, which is from 0 to 31.
#[inline(always)]
fn shifted(high: u32, low: u32, shift: u32) -> u32 {
    // Twice, since no shift is by 32.
    (high << shift) | ((low >> 1) >> (31 - shift))
}

/// [`Elementary::reduce_large`] of `f32`.
#[inline(always)]
pub fn single(x: f32) -> (f32, f32, f32) {
    let bits = x.to_bits();
    let significand = (bits & 0x007f_ffff) | 0x0080_0000;
    // x = significand * 2^exponent, the exponent from -12 to 104. Bits of 2/pi before the one of
    // weight 2^(2 - exponent) are whole turns.
    let from = (bits >> 23).wrapping_sub(150 - 62);
    let (word, shift) = (from >> 5, from & 31);
    let [w0, w1, w2, w3] = four_words(word);
    let a = shifted(w0, w1, shift);
    let b = shifted(w1, w2, shift);
    let c = shifted(w2, w3, shift);
    // The product modulo 2^96; two bits before the point.
    let low = significand.wrapping_mul(c);
    let middle = significand
        .wrapping_mul(b)
        .wrapping_add(product_high(significand, c));
    let carry = u32::from(middle < product_high(significand, c));
    let high = significand
        .wrapping_mul(a)
        .wrapping_add(product_high(significand, b))
        .wrapping_add(carry);
    let half = (high >> 29) & 1;
    let quarters = ((high >> 30) + half) & 3;
    let mut fraction = [
        (high << 2) | (middle >> 30),
        (middle << 2) | (low >> 30),
        low << 2,
    ];
    // Above a half, what is missing to the next quarter.
    if half == 1 {
        fraction = [!fraction[0], !fraction[1], !fraction[2]];
    }
    let first: f32 = (fraction[0] >> 8) as f32 * 5.960_464_5e-8;
    let second = ((fraction[0] & 0xff) << 16 | fraction[1] >> 16) as f32 * 3.552_713_7e-15;
    let third = ((fraction[1] & 0xffff) << 8 | fraction[2] >> 24) as f32 * 2.117_582_4e-22;
    let (sum, error) = first.two_sum(second);
    let (high, low) = times_quarter(sum, error + third);
    let negative = half == 1;
    (
        quarters as f32,
        f32::select(negative, -high, high),
        f32::select(negative, -low, low),
    )
}

/// [`Elementary::reduce_large`] of `f64`.
#[inline(always)]
pub fn double(x: f64) -> (f64, f64, f64) {
    let (e, m) = x.decompose();
    // The significand's 53 bits in two words: x = significand * 2^exponent, the exponent from -33
    // to 971.
    let whole = m * 9_007_199_254_740_992.0;
    let upper = (whole * 2.328_306_436_538_696_3e-10).floor();
    let significand = [(whole - upper * 4_294_967_296.0) as u32, upper as u32];
    let from = (crate::to_i32(e as f32) + 9) as u32;
    let (word, shift) = ((from >> 5) as usize, from & 31);
    // Seven words of 2/pi, the last first; their product modulo 2^224, two bits before the point.
    let mut product = [0_u32; 7];
    let mut i = 0;
    while i < 7 {
        let at = word + 6 - i;
        let before = TWO_OVER_PI[at];
        let digits = shifted(before, TWO_OVER_PI[at + 1], shift);
        let mut j = 0;
        while j < 2 {
            let mut value = significand[j].wrapping_mul(digits);
            let mut next = product_high(significand[j], digits);
            let mut place = i + j;
            while place < 7 {
                let sum = product[place].wrapping_add(value);
                let carry = u32::from(sum < value);
                product[place] = sum;
                // Less than 2^32: the upper half of a product is at most 2^32 - 2.
                value = next.wrapping_add(carry);
                next = 0;
                place += 1;
            }
            j += 1;
        }
        i += 1;
    }
    let half = (product[6] >> 29) & 1;
    let quarters = ((product[6] >> 30) + half) & 3;
    let flip = if half == 1 { u32::MAX } else { 0 };
    let word = |i: usize| (((product[i] << 2) | (product[i - 1] >> 30)) ^ flip) as f64;
    let a = word(6) * 2.328_306_436_538_696_3e-10;
    let b = word(5) * 5.421_010_862_427_522e-20;
    let c = word(4) * 1.262_177_448_353_619e-29;
    let d = word(3) * 2.938_735_877_055_719e-39;
    let (sum, error) = a.two_sum(b);
    let (sum, rest) = sum.two_sum(error + c);
    let (high, low) = times_quarter(sum, rest + d);
    let negative = half == 1;
    (
        quarters as f64,
        f64::select(negative, -high, high),
        f64::select(negative, -low, low),
    )
}
