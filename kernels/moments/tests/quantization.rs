//! Optimised quantisation and what stores it, by what it must do.

#[allow(dead_code, reason = "shared with the other tests")]
mod common;
mod validity;

use common::{Distribution, distribution};
use hankel_dsl::Real;
use hankel_dsl::glam::{Vec2, Vec3, Vec4};
use hankel_dsl::native::describe::TexelFormat;
use hankel_moments::{
    Fixed4, Fixed6, FixedPoint, Moments4, Moments6, Packed6, Quantized4, Quantized6, Rectangle4,
    Rectangle6, dequantize_symmetric_4, dequantize_symmetric_6, dequantize_unit_4,
    dequantize_unit_6, from_unorm, pack_10, pack_16, quantize_symmetric_4, quantize_symmetric_6,
    quantize_unit_4, quantize_unit_6, to_unorm, unpack_10, unpack_16,
};
use proptest::prelude::*;
use proptest::test_runner::{RngAlgorithm, TestRng};
use validity::is_moments;

fn four<R: Real>(x: &[R]) -> Moments4<R> {
    let &[b1, b2, b3, b4] = x else {
        panic!("four moments")
    };
    Moments4 { b1, b2, b3, b4 }
}

fn six<R: Real>(x: &[R]) -> Moments6<R> {
    let &[b1, b2, b3, b4, b5, b6] = x else {
        panic!("six moments")
    };
    Moments6 {
        b1,
        b2,
        b3,
        b4,
        b5,
        b6,
    }
}

fn channels_4<R: Real>(x: &[R]) -> Quantized4<R> {
    let &[r, g, b, a] = x else {
        panic!("four channels")
    };
    Quantized4 { r, g, b, a }
}

fn channels_6<R: Real>(x: &[R]) -> Quantized6<R> {
    let &[r0, g0, b0, r1, g1, b1] = x else {
        panic!("six channels")
    };
    Quantized6 {
        r0,
        g0,
        b0,
        r1,
        g1,
        b1,
    }
}

/// The numbers of a structure of moments or channels, in order.
trait Numbers<T> {
    fn numbers(self) -> Vec<T>;
}

macro_rules! numbers {
    ($($type:ty, $item:ty: $($field:ident)*;)*) => {$(
        impl Numbers<$item> for $type {
            fn numbers(self) -> Vec<$item> {
                vec![$(self.$field),*]
            }
        }
    )*};
}

numbers! {
    Moments4<f32>, f32: b1 b2 b3 b4;
    Moments4<f64>, f64: b1 b2 b3 b4;
    Moments6<f32>, f32: b1 b2 b3 b4 b5 b6;
    Moments6<f64>, f64: b1 b2 b3 b4 b5 b6;
    Quantized4<f32>, f32: r g b a;
    Quantized4<f64>, f64: r g b a;
    Quantized6<f32>, f32: r0 g0 b0 r1 g1 b1;
    Quantized6<f64>, f64: r0 g0 b0 r1 g1 b1;
    Fixed4, u32: r g b a;
    Fixed6, u32: r0 g0 b0 r1 g1 b1;
}

/// A transform over plain lists of numbers of one type.
#[derive(Clone, Copy)]
struct Transform<T> {
    quantize: fn(&[T]) -> Vec<T>,
    dequantize: fn(&[T]) -> Vec<T>,
    /// Anything, brought into the moments' and the channels' range.
    clamped: fn(&[T]) -> Vec<T>,
    saturated: fn(&[T]) -> Vec<T>,
}

/// The four published transforms, in the order of [`EXPECTED`].
macro_rules! transforms {
    ($float:ty) => {
        [
            Transform::<$float> {
                quantize: |x| quantize_unit_4(four(x)).numbers(),
                dequantize: |x| dequantize_unit_4(channels_4(x)).numbers(),
                clamped: |x| four(x).clamped().numbers(),
                saturated: |x| channels_4(x).saturated().numbers(),
            },
            Transform::<$float> {
                quantize: |x| quantize_symmetric_4(four(x)).numbers(),
                dequantize: |x| dequantize_symmetric_4(channels_4(x)).numbers(),
                clamped: |x| four(x).clamped().numbers(),
                saturated: |x| channels_4(x).saturated().numbers(),
            },
            Transform::<$float> {
                quantize: |x| quantize_unit_6(six(x)).numbers(),
                dequantize: |x| dequantize_unit_6(channels_6(x)).numbers(),
                clamped: |x| six(x).clamped().numbers(),
                saturated: |x| channels_6(x).saturated().numbers(),
            },
            Transform::<$float> {
                quantize: |x| quantize_symmetric_6(six(x)).numbers(),
                dequantize: |x| dequantize_symmetric_6(channels_6(x)).numbers(),
                clamped: |x| six(x).clamped().numbers(),
                saturated: |x| channels_6(x).saturated().numbers(),
            },
        ]
    };
}

/// What is known of a transform.
struct Expected {
    moments: usize,
    /// The depths' range starts here and ends at 1.
    low: f64,
    /// Bits of entropy that it gains, as published for [0, 1].
    gain: f64,
    /// How far the curve may leave the unit cube: what the published digits leave.
    beyond: f64,
    /// Of there and back: what the digits of the inverse leave.
    identity: f64,
}

const EXPECTED: [Expected; 4] = [
    Expected {
        moments: 4,
        low: 0.0,
        gain: 12.28,
        beyond: 5e-7,
        identity: 1e-9,
    },
    Expected {
        moments: 4,
        low: -1.0,
        gain: 12.21,
        beyond: 1e-15,
        identity: 1e-14,
    },
    Expected {
        moments: 6,
        low: 0.0,
        gain: 30.51,
        beyond: 1e-7,
        identity: 1e-11,
    },
    Expected {
        moments: 6,
        low: -1.0,
        gain: 30.51,
        beyond: 6e-9,
        identity: 1e-13,
    },
];

fn published() -> impl Iterator<Item = (Transform<f64>, Expected)> {
    transforms!(f64).into_iter().zip(EXPECTED)
}

/// The moments of one depth.
fn powers(z: f64, count: usize) -> Vec<f64> {
    (1..=count as i32).map(|n| z.powi(n)).collect()
}

/// By elimination; `rows` may as well be columns.
fn determinant(mut rows: Vec<Vec<f64>>) -> f64 {
    let mut determinant = 1.0;
    for i in 0..rows.len() {
        let pivot = (i..rows.len())
            .max_by(|a, b| rows[*a][i].abs().total_cmp(&rows[*b][i].abs()))
            .unwrap();
        if pivot != i {
            rows.swap(i, pivot);
            determinant = -determinant;
        }
        determinant *= rows[i][i];
        let (upper, lower) = rows.split_at_mut(i + 1);
        let upper = &upper[i];
        for row in lower {
            let factor = row[i] / upper[i];
            for (x, u) in row.iter_mut().zip(upper) {
                *x -= factor * u;
            }
        }
    }
    determinant
}

/// log2 of the volume that the transform makes of a unit cube.
fn log2_volume(t: Transform<f64>, count: usize) -> f64 {
    let origin = (t.quantize)(&vec![0.0; count]);
    let columns = (0..count)
        .map(|i| {
            let mut unit = vec![0.0; count];
            unit[i] = 1.0;
            let image = (t.quantize)(&unit);
            image.iter().zip(&origin).map(|(x, o)| x - o).collect()
        })
        .collect();
    determinant(columns).abs().log2()
}

/// Stretching the depths' range by s stretches the j-th moment by s^j.
fn gain(t: Transform<f64>, e: &Expected) -> f64 {
    let orders = (e.moments * (e.moments + 1) / 2) as f64;
    log2_volume(t, e.moments) + orders * (1.0 - e.low).log2()
}

#[test]
fn the_curve_of_depths_fills_the_cube_and_stays_in_it() {
    for (t, e) in published() {
        let (mut least, mut most) = (vec![9.0_f64; e.moments], vec![-9.0_f64; e.moments]);
        for i in 0..=100_000 {
            let z = e.low + (1.0 - e.low) * f64::from(i) / 100_000.0;
            for (c, x) in (t.quantize)(&powers(z, e.moments)).into_iter().enumerate() {
                least[c] = least[c].min(x);
                most[c] = most[c].max(x);
            }
        }
        for c in 0..e.moments {
            assert!(least[c] >= -e.beyond && least[c] < 1e-5, "{least:?}");
            assert!(most[c] <= 1.0 + e.beyond && most[c] > 0.9999, "{most:?}");
        }
    }
}

#[test]
fn the_gain_is_the_published_one() {
    for (t, e) in published() {
        let gain = gain(t, &e);
        assert!((gain - e.gain).abs() < 0.005, "{gain}");
    }
}

/// The set of valid moments of depths in [0, 1] has the volume of \[MSM\], Proposition 19; times the
/// transform's determinant, it is the share of the cube that decodes to valid moments. Points drawn
/// from the cube find that share by another road.
#[test]
fn as_much_of_the_cube_is_valid_as_the_published_volumes_say() {
    let mut rng = TestRng::deterministic_rng(RngAlgorithm::ChaCha);
    for (t, e) in published() {
        let factorial = |n: usize| (1..=n).map(|i| i as f64).product::<f64>();
        let volume: f64 = (1..=e.moments)
            .map(|j| factorial(j - 1).powi(2) / factorial(2 * j - 1))
            .product();
        let bits = if e.moments == 4 { 14.62 } else { 35.357 };
        assert!((-volume.log2() - bits).abs() < 0.005, "{volume}");
        let expected = volume * gain(t, &e).exp2();
        let draws = 200_000;
        let valid = (0..draws)
            .filter(|_| {
                let q: Vec<f64> = (0..e.moments).map(|_| rng.random()).collect();
                is_moments(&(t.dequantize)(&q), e.low)
            })
            .count();
        let share = valid as f64 / f64::from(draws);
        let deviation = (expected * (1.0 - expected) / f64::from(draws)).sqrt();
        println!("{} of depths from {}: {share}", e.moments, e.low);
        assert!(
            (share - expected).abs() < 4.0 * deviation,
            "{share} {expected}"
        );
    }
}

/// Moments of `d`, moved from [0, 1] to [low, 1].
fn moments(d: &Distribution, low: f64, count: usize) -> Vec<f64> {
    let d = d.map(|z| low + (1.0 - low) * z);
    (1..=count as i32).map(|n| d.moment(n)).collect()
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn back_and_forth_is_the_identity(
        d in distribution(7),
        q in prop::array::uniform6(0.0..=1.0_f64),
    ) {
        for (t, e) in published() {
            let m = moments(&d, e.low, e.moments);
            for (a, b) in (t.dequantize)(&(t.quantize)(&m)).iter().zip(&m) {
                prop_assert!((a - b).abs() < e.identity, "{a} {b}");
            }
            // The transforms stretch what the inverses' digits leave.
            let stretch = if e.low == 0.0 { 1e4 } else { 1e2 };
            let q = &q[..e.moments];
            for (a, b) in (t.quantize)(&(t.dequantize)(q)).iter().zip(q) {
                prop_assert!((a - b).abs() < e.identity * stretch, "{a} {b}");
            }
        }
    }

    /// Valid moments lie in the cube, not only those of single depths.
    #[test]
    fn channels_of_distributions_are_in_range(d in distribution(7)) {
        for (t, e) in published() {
            for x in (t.quantize)(&moments(&d, e.low, e.moments)) {
                prop_assert!(x > -1e-6 && x < 1.0 + 1e-6, "{x}");
            }
        }
    }

    /// A filter may run before or after.
    #[test]
    fn filtering_commutes(a in distribution(4), b in distribution(4), w in 0.0..=1.0_f64) {
        for (t, e) in published() {
            let (a, b) = (moments(&a, e.low, e.moments), moments(&b, e.low, e.moments));
            let mix = |a: &[f64], b: &[f64]| -> Vec<f64> {
                a.iter().zip(b).map(|(a, b)| (1.0 - w) * a + w * b).collect()
            };
            let before = (t.quantize)(&mix(&a, &b));
            let after = mix(&(t.quantize)(&a), &(t.quantize)(&b));
            for (x, y) in before.iter().zip(&after) {
                prop_assert!((x - y).abs() < 1e-11, "{x} {y}");
            }
        }
    }

    /// Any bits at all, NaN and infinity too, once they are clamped as the kernels do.
    #[test]
    fn nothing_makes_a_channel_or_a_moment_other_than_finite(
        bits in prop::array::uniform6(extreme()),
    ) {
        for (t, e) in transforms!(f64).into_iter().zip(EXPECTED) {
            let x = &bits.map(f64::from_bits)[..e.moments];
            for y in (t.quantize)(&(t.clamped)(x)) {
                prop_assert!(y.abs() < 1e4, "{y}");
            }
            for y in (t.dequantize)(&(t.saturated)(x)) {
                prop_assert!(y.abs() < 3.0, "{y}");
            }
        }
        for (t, e) in transforms!(f32).into_iter().zip(EXPECTED) {
            let x = &bits.map(|b| f32::from_bits((b >> 32) as u32))[..e.moments];
            for y in (t.quantize)(&(t.clamped)(x)) {
                prop_assert!(y.abs() < 1e4, "{y}");
            }
            for y in (t.dequantize)(&(t.saturated)(x)) {
                prop_assert!(y.abs() < 3.0, "{y}");
            }
        }
    }
}

/// Bits of an f64, whose upper half are those of an f32; extreme ones often.
fn extreme() -> impl Strategy<Value = u64> {
    let special = [
        f32::MAX,
        f32::MIN,
        f32::MIN_POSITIVE,
        f32::from_bits(1),
        -0.0,
        f32::INFINITY,
        f32::NEG_INFINITY,
        f32::NAN,
    ]
    .map(|x| u64::from(x.to_bits()) << 32);
    let doubles = [
        f64::MAX,
        f64::MIN,
        f64::from_bits(1),
        f64::INFINITY,
        f64::NAN,
    ];
    prop_oneof![
        any::<u64>(),
        prop::sample::select(special.to_vec()),
        prop::sample::select(doubles.map(f64::to_bits).to_vec()),
    ]
}

/// In f32 the transforms for [0, 1] magnify the moments' own rounding; those for [-1, 1] hardly.
#[test]
fn what_f32_leaves_of_a_channel() {
    let mut worst = Vec::new();
    for ((t, exact), e) in transforms!(f32)
        .into_iter()
        .zip(transforms!(f64))
        .zip(EXPECTED)
    {
        let mut most = 0.0_f64;
        for i in 0..=100_000 {
            let z = (e.low + (1.0 - e.low) * f64::from(i) / 100_000.0) as f32;
            let single: Vec<f32> = match e.moments {
                4 => Moments4::of_depth(z).numbers(),
                _ => Moments6::of_depth(z).numbers(),
            };
            let right = (exact.quantize)(&powers(z.into(), e.moments));
            for (x, y) in (t.quantize)(&single).into_iter().zip(right) {
                most = most.max((f64::from(x) - y).abs());
            }
        }
        worst.push(most);
    }
    println!("{worst:?}");
    for (most, documented) in worst.iter().zip([1.5e-5, 2.3e-7, 6.3e-4, 3.4e-6]) {
        assert!(*most <= documented, "{worst:?}");
    }
}

/// Every integer survives, at both precisions; so do the ends, exactly.
#[test]
fn every_step_of_a_normalised_integer_survives() {
    fn check<R: Real + PartialEq + std::fmt::Debug, const BITS: usize>(exact: impl Fn(u32) -> R) {
        let most = (1_u32 << BITS) - 1;
        for n in 0..=most {
            let x = from_unorm::<R, BITS>(exact(n));
            assert_eq!(to_unorm::<R, BITS>(x), exact(n), "{n} of {BITS} bits");
        }
        assert_eq!(from_unorm::<R, BITS>(exact(0)), exact(0));
        assert_eq!(from_unorm::<R, BITS>(exact(most)), exact(1));
    }
    macro_rules! each {
        ($($bits:literal)*) => {$(
            check::<f32, $bits>(|n| n as f32);
            check::<f64, $bits>(f64::from);
        )*};
    }
    each!(1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16);
}

#[test]
fn a_half_rounds_up_and_just_below_it_does_not() {
    // The usual floor(x + 1/2) gets this wrong.
    let below = 0.5_f32.next_down();
    assert_eq!(to_unorm::<f32, 1>(below), 0.0);
    assert_eq!(to_unorm::<f32, 1>(0.5), 1.0);
    assert_eq!(to_unorm::<f64, 10>(0.5), 512.0);
    for x in [f32::NAN, f32::NEG_INFINITY, -1e-30, f32::MIN] {
        assert_eq!(to_unorm::<f32, 10>(x), 0.0);
    }
    for x in [f32::INFINITY, 1.0, 1.0 + 1e-6, f32::MAX] {
        assert_eq!(to_unorm::<f32, 10>(x), 1023.0);
    }
}

/// Within half a step in the transform's channels, so within that times the inverse in the moments.
fn moments_after_storage(
    t: Transform<f64>,
    count: usize,
    bits: i32,
    m: &[f64],
    stored: &[f64],
) -> Result<(), TestCaseError> {
    let half = 0.5 / (2.0_f64.powi(bits) - 1.0);
    let origin = (t.dequantize)(&vec![0.0; count]);
    let columns: Vec<Vec<f64>> = (0..count)
        .map(|i| {
            let mut unit = vec![0.0; count];
            unit[i] = 1.0;
            (t.dequantize)(&unit)
        })
        .collect();
    let back = (t.dequantize)(stored);
    for j in 0..count {
        let row: f64 = columns.iter().map(|c| (c[j] - origin[j]).abs()).sum();
        prop_assert!((back[j] - m[j]).abs() <= half * row + 2e-7, "{j}");
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// As the textures that store it round, ties apart: those round to even.
    #[test]
    fn to_16_bits_as_a_texture(x in prop::array::uniform4(-0.5..1.5_f32)) {
        let mut texel = [0; 8];
        TexelFormat::Rgba16Unorm.store(&mut texel, Vec4::from_array(x));
        for (x, n) in x.into_iter().zip(texel.chunks_exact(2)) {
            let n = u16::from_le_bytes([n[0], n[1]]);
            let scaled = Real::saturate(x) * 65535.0;
            if scaled.fract() != 0.5 {
                prop_assert_eq!(to_unorm::<f32, 16>(x), f32::from(n));
            }
        }
    }

    #[test]
    fn storage_costs_half_a_step(d in distribution(7)) {
        for (t, e) in published() {
            let m = moments(&d, e.low, e.moments);
            let q = (t.quantize)(&m);
            let (ten, sixteen) = if e.moments == 4 {
                let q = channels_4(&q);
                (q.stored::<10>().numbers(), q.stored::<16>().numbers())
            } else {
                let q = channels_6(&q);
                (q.stored::<10>().numbers(), q.stored::<16>().numbers())
            };
            moments_after_storage(t, e.moments, 10, &m, &ten)?;
            moments_after_storage(t, e.moments, 16, &m, &sixteen)?;
        }
    }

    /// Every pair of words means something, and its alpha nothing.
    #[test]
    fn words_of_10_bits_survive(first: u32, second: u32) {
        let packed = Packed6 { first, second };
        let q = packed.unpack();
        prop_assert_eq!(Packed6::pack(q), Packed6 {
            first: first & 0x3fff_ffff,
            second: second & 0x3fff_ffff,
        });
        prop_assert_eq!(q, q.saturated());
        prop_assert_eq!(q.r0, from_unorm::<f32, 10>((first % 1024) as f32));
        prop_assert_eq!(q.b1, from_unorm::<f32, 10>((second / (1 << 20) % 1024) as f32));
    }

    #[test]
    fn packing_is_storing_in_10_bits(x in prop::array::uniform6(-0.5..1.5_f32)) {
        let q = channels_6(&x);
        prop_assert_eq!(Packed6::pack(q).unpack(), q.stored::<10>());
        let words = [Vec3::new(q.r0, q.g0, q.b0), Vec3::new(q.r1, q.g1, q.b1)].map(pack_10);
        prop_assert_eq!(words, [Packed6::pack(q).first, Packed6::pack(q).second]);
        let stored = q.stored::<10>();
        prop_assert_eq!(unpack_10(words[1]), Vec3::new(stored.r1, stored.g1, stored.b1));
    }

    /// Two channels of 16 bits in a word: what a texture of such channels keeps.
    #[test]
    fn packing_is_storing_in_16_bits(x in -0.5..1.5_f32, y in -0.5..1.5_f32) {
        let stored = |x: f32| from_unorm::<f32, 16>(to_unorm::<f32, 16>(x));
        let word = pack_16(Vec2::new(x, y));
        prop_assert_eq!(unpack_16(word), Vec2::new(stored(x), stored(y)));
        prop_assert_eq!(pack_16(unpack_16(word)), word);
    }
}

/// A table of random channels with entries that have wrapped many times, and every kernel within it
/// from one texel to 27 x 27 at random places.
fn summed_areas<Q: Copy, F: Copy + PartialEq + std::fmt::Debug + Numbers<u32>>(
    texel: impl Fn(&mut TestRng) -> Q,
    of: impl Fn(Q, FixedPoint) -> F,
    plus: impl Fn(F, F) -> F,
    sum: impl Fn([F; 4], u32) -> F,
    mean: impl Fn([F; 4], u32, FixedPoint) -> Vec<f32>,
    numbers: impl Fn(Q) -> Vec<f32>,
    zero: F,
) {
    const WIDTH: usize = 61;
    const HEIGHT: usize = 53;
    let mut rng = TestRng::deterministic_rng(RngAlgorithm::ChaCha);
    let point = FixedPoint::for_kernel(27 * 27);
    let texels: Vec<Q> = (0..WIDTH * HEIGHT).map(|_| texel(&mut rng)).collect();
    // One more row and column, of zeros, in front.
    let mut table = [zero; (WIDTH + 1) * (HEIGHT + 1)];
    let at = |x: usize, y: usize| y * (WIDTH + 1) + x;
    for y in 1..=HEIGHT {
        let mut row = zero;
        for x in 1..=WIDTH {
            row = plus(row, of(texels[(y - 1) * WIDTH + x - 1], point));
            table[at(x, y)] = plus(table[at(x, y - 1)], row);
        }
    }
    let mut largest_error = 0.0_f64;
    for i in 0..2000 {
        let (w, h) = if i % 4 == 0 {
            (27, 27)
        } else {
            (rng.random_range(1..=27), rng.random_range(1..=27))
        };
        let (x, y) = (
            rng.random_range(0..=WIDTH - w),
            rng.random_range(0..=HEIGHT - h),
        );
        let corners = [
            table[at(x, y)],
            table[at(x + w, y)],
            table[at(x, y + h)],
            table[at(x + w, y + h)],
        ];
        let inside = || (y..y + h).flat_map(|y| (x..x + w).map(move |x| y * WIDTH + x));
        let count = (w * h) as u32;
        let channels = zero.numbers().len();
        // Without wrapping, from the texels themselves.
        let (mut exact, mut real) = (vec![0_u64; channels], vec![0.0_f64; channels]);
        for i in inside() {
            let (fixed, float) = (of(texels[i], point).numbers(), numbers(texels[i]));
            for c in 0..channels {
                exact[c] += u64::from(fixed[c]);
                real[c] += f64::from(float[c]);
            }
        }
        let sums: Vec<u64> = sum(corners, count)
            .numbers()
            .into_iter()
            .map(u64::from)
            .collect();
        assert_eq!(sums, exact);
        for (mean, real) in mean(corners, count, point).into_iter().zip(&real) {
            let error = (f64::from(mean) - real / f64::from(count)).abs();
            largest_error = largest_error.max(error);
        }
    }
    println!("largest error of a mean: 2^{}", largest_error.log2());
    // 22.5 bits after the point: a half of the last for each texel, and 2^-23 for the floats.
    assert!(largest_error < 0.5 * 2.0_f64.powf(-22.49) + 2.0_f64.powi(-23));
}

#[test]
fn kernels_up_to_27_by_27_sum_exactly_from_four_entries() {
    summed_areas(
        |rng| channels_4(&[(); 4].map(|()| rng.random::<f32>())),
        Fixed4::of,
        Fixed4::plus,
        |[before_both, before_row, before_column, last], texels| {
            Rectangle4 {
                before_both,
                before_row,
                before_column,
                last,
                texels,
            }
            .sum()
        },
        |[before_both, before_row, before_column, last], texels, point| {
            Rectangle4 {
                before_both,
                before_row,
                before_column,
                last,
                texels,
            }
            .mean(point)
            .numbers()
        },
        Numbers::numbers,
        Fixed4 {
            r: 0,
            g: 0,
            b: 0,
            a: 0,
        },
    );
    summed_areas(
        // Nearly full kernels, which come close to 2^32.
        |rng| channels_6(&[(); 6].map(|()| 1.0 - 1e-4 * rng.random::<f32>())),
        Fixed6::of,
        Fixed6::plus,
        |[before_both, before_row, before_column, last], texels| {
            Rectangle6 {
                before_both,
                before_row,
                before_column,
                last,
                texels,
            }
            .sum()
        },
        |[before_both, before_row, before_column, last], texels, point| {
            Rectangle6 {
                before_both,
                before_row,
                before_column,
                last,
                texels,
            }
            .mean(point)
            .numbers()
        },
        Numbers::numbers,
        Fixed6 {
            r0: 0,
            g0: 0,
            b0: 0,
            r1: 0,
            g1: 0,
            b1: 0,
        },
    );
}

#[test]
fn a_fixed_point_is_as_fine_as_its_kernels_allow() {
    let bits = |n: u32| f64::from(FixedPoint::for_kernel(n).one).log2();
    assert!((bits(27 * 27) - 22.5).abs() < 0.02);
    for n in [
        0,
        1,
        2,
        3,
        100,
        255,
        256,
        257,
        729,
        1023,
        65_535,
        1 << 20,
        (1 << 24) - 1,
        u32::MAX,
    ] {
        let point = FixedPoint::for_kernel(n);
        // Ones do not wrap, and no finer point has room for them.
        let full = u64::from(point.to_fixed(1.0)) * u64::from(n);
        assert!(full <= u64::from(u32::MAX), "{n}");
        assert!(
            n == 0 || point.one == 1 << 24 || full + u64::from(n) > u64::from(u32::MAX),
            "{n}"
        );
        assert_eq!(point.to_fixed(1.0), point.one, "{n}");
        assert_eq!(
            point.mean(full as u32, n),
            if n == 0 { 0.0 } else { 1.0 },
            "{n}"
        );
        assert_eq!(point.mean(0, n), 0.0);
    }
    // 2^32 / n itself would wrap for 27 x 27: it rounds up to an integer.
    assert!((2.0_f64.powi(32) / 729.0).round() * 729.0 > 2.0_f64.powi(32));
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// Whatever the bits: the nearest integer for what is in range, an end for what is not; and a
    /// mean in [0, 1].
    #[test]
    fn a_fixed_point_takes_anything(
        bits in extreme(), one: u32, sum: u32, texels: u32, x in 0.0..=1.0_f32,
    ) {
        let point = FixedPoint { one };
        let any = f32::from_bits((bits >> 32) as u32);
        let n = point.to_fixed(any);
        prop_assert!(n <= one.max(1 << 24));
        if any.is_nan() || any <= 0.0 {
            prop_assert_eq!(n, 0);
        }
        let mean = point.mean(sum, texels);
        prop_assert!((0.0..=1.0).contains(&mean));
        let point = FixedPoint { one: one % (1 << 24) + 1 };
        let scaled = f64::from(x) * f64::from(point.one);
        // Half a step, and half of another where the float product is rounded.
        let error = (f64::from(point.to_fixed(x)) - scaled).abs();
        prop_assert!(error <= 0.5 + scaled * 2.0_f64.powi(-24), "{error}");
    }
}
