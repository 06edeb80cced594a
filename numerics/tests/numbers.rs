//! The numbers against each other, against the processor and against a library of big numbers.

use dashu_float::round::mode::HalfEven;
use dashu_float::{Context, FBig};
use hankel_dsl::{Mask, Real, lit};
use hankel_moments::{Moments4, hamburger_4, hausdorff_4};
use hankel_numerics::numbers::{DoubleDouble, Dual, Interval, Unrounded, Wide};
use proptest::prelude::*;

type Big = FBig<HalfEven, 2>;

fn settings() -> ProptestConfig {
    ProptestConfig::with_cases(2000)
}

fn power(exponent: i32) -> f64 {
    f64::from_bits(((exponent + 1023) as u64) << 52)
}

/// Any bits at all: denormals, infinities and NaNs too.
fn any_f64() -> impl Strategy<Value = f64> {
    prop_oneof![
        4 => any::<u64>().prop_map(f64::from_bits),
        1 => prop_oneof![Just(0.0), Just(1.0), Just(-1.0), Just(-0.0), Just(f64::MAX)],
        1 => (-8..8).prop_map(f64::from),
    ]
}

/// Full significands of either sign, with magnitudes around 2^±`exponents`.
fn moderate(exponents: i32) -> impl Strategy<Value = f64> {
    (1.0..2.0_f64, any::<bool>(), -exponents..=exponents).prop_map(|(x, negative, e)| {
        if negative {
            -x * power(e)
        } else {
            x * power(e)
        }
    })
}

fn double_double() -> impl Strategy<Value = DoubleDouble> {
    (moderate(60), -1.0..1.0_f64)
        .prop_map(|(x, rest)| DoubleDouble::of_sum(x, x * rest * power(-53)))
}

/// All 300 bits, sometimes with long runs of zeros.
fn wide() -> impl Strategy<Value = Wide> {
    (
        moderate(60),
        prop::collection::vec((moderate(20), any::<bool>()), 6),
    )
        .prop_map(|(x, pieces)| {
            let mut sum = Wide::from(x);
            for (i, (piece, present)) in pieces.into_iter().enumerate() {
                if present {
                    sum += Wide::from(x * piece * power(-52 * (i as i32 + 1)));
                }
            }
            sum
        })
}

/// Exactly, as a big number: what a `Wide` of moderate size is a sum of.
fn big(mut x: Wide) -> Big {
    let mut sum = Big::ZERO;
    while x != Wide::from(0.0) {
        let piece = f64::from(x);
        sum += Big::try_from(piece).unwrap().with_precision(0).value();
        x -= Wide::from(piece);
    }
    sum
}

/// `x` rounded to what a `Wide` holds.
fn rounded(x: Big) -> Big {
    x.with_precision(300).value()
}

/// `|a - b|` as a share of `|b|`.
fn relative_error(a: impl Into<Wide>, b: Wide) -> f64 {
    let error = a.into() - b;
    if error == Wide::from(0.0) {
        0.0
    } else {
        f64::from((error / b).abs())
    }
}

fn same(a: f64, b: f64) -> bool {
    a == b || (a.is_nan() && b.is_nan())
}

proptest! {
    #![proptest_config(settings())]

    /// Rounded once more, to `f64`, 300 bits give what the processor gives: a quotient or a root of
    /// 53 bits is never so near to a tie.
    #[test]
    fn wide_agrees_with_the_processor(a in any_f64(), b in any_f64()) {
        let (x, y) = (Wide::from(a), Wide::from(b));
        let finite = if a.is_finite() { a } else { f64::NAN };
        prop_assert!(same(x.into(), finite));
        if a.is_finite() && b.is_finite() {
            prop_assert!(same((x + y).into(), a + b), "{a:e} + {b:e}");
            prop_assert!(same((x - y).into(), a - b), "{a:e} - {b:e}");
            prop_assert!(same((x * y).into(), a * b), "{a:e} * {b:e}");
            prop_assert!(same((x / y).into(), if b == 0.0 { f64::NAN } else { a / b }), "{a:e} / {b:e}");
            prop_assert!(same(Real::sqrt(x).into(), a.sqrt()), "sqrt {a:e}");
            prop_assert!(same(Real::floor(x).into(), a.floor()), "floor {a:e}");
            prop_assert!(same(Real::abs(x).into(), a.abs()));
            prop_assert_eq!(x.partial_cmp(&y), a.partial_cmp(&b));
        } else {
            prop_assert!(!(x + y).is_defined() && x.partial_cmp(&y).is_none());
        }
    }

    /// To the last bit.
    #[test]
    fn wide_rounds_correctly(a in wide(), b in wide()) {
        let (x, y) = (big(a), big(b));
        prop_assert_eq!(big(a + b), rounded(&x + &y));
        prop_assert_eq!(big(a - b), rounded(&x - &y));
        prop_assert_eq!(big(a * b), rounded(&x * &y));
        let context = Context::<HalfEven>::new(300);
        prop_assert_eq!(big(a / b), context.div(x.repr(), y.repr()).unwrap().value());
        let root = big(Real::sqrt(Real::abs(a)));
        let magnitude = big(Real::abs(a));
        prop_assert_eq!(root, context.sqrt(magnitude.repr()).unwrap().value());
    }

    #[test]
    fn double_double_is_within_its_bounds(a in double_double(), b in double_double()) {
        let (x, y) = (Wide::from(a), Wide::from(b));
        let unit = power(-106);
        prop_assert!(relative_error(a + b, x + y) <= 3.01 * unit);
        prop_assert!(relative_error(a - b, x - y) <= 3.01 * unit);
        prop_assert!(relative_error(a * b, x * y) <= 7.01 * unit);
        prop_assert!(relative_error(a / b, x / y) <= 16.01 * unit);
        let root = Real::sqrt(Real::abs(x));
        prop_assert!(relative_error(Real::sqrt(Real::abs(a)), root) <= 4.01 * unit);
        prop_assert_eq!(Wide::from(Real::floor(a)), Real::floor(x));
        prop_assert_eq!(Wide::from(Real::abs(a)), Real::abs(x));
        prop_assert_eq!(a.partial_cmp(&b), x.partial_cmp(&y));
        // There and back.
        prop_assert_eq!(DoubleDouble::from(x), a);
        prop_assert_eq!(f64::from(a), f64::from(x));
    }

    /// Sums that nearly cancel are as good: their error is relative to the result.
    #[test]
    fn double_double_survives_cancellation(a in double_double(), share in -1.0..1.0, e in -106..0) {
        let near = DoubleDouble::of_sum(-a.high(), a.high() * share * power(e));
        let exact = Wide::from(a) + Wide::from(near);
        prop_assert!(relative_error(a + near, exact) <= 3.01 * power(-106));
    }

    /// Any ends, any numbers between them.
    #[test]
    fn intervals_enclose(
        ends in prop::array::uniform4(any_f64()),
        shares in prop::array::uniform2(0.0..=1.0),
        points in prop::array::uniform2(any::<bool>()),
    ) {
        prop_assume!(ends.iter().all(|x| x.is_finite()));
        let pick = |a: f64, b: f64, share: f64, is_point: bool| {
            let b = if is_point { a } else { b };
            let inside = Wide::from(a) + (Wide::from(b) - Wide::from(a)) * Wide::from(share);
            (Interval::hull(a, b), inside)
        };
        let (a, x) = pick(ends[0], ends[1], shares[0], points[0]);
        let (b, y) = pick(ends[2], ends[3], shares[1], points[1]);
        let check = |what: &str, interval: Interval, exact: Wide| {
            // What has no value, as a quotient by 0, need not be enclosed.
            let is_sound = !exact.is_defined() || interval.contains(exact);
            prop_assert!(is_sound, "{what} of {a:?}, {b:?}: {interval:?} without {}", f64::from(exact));
            Ok(())
        };
        check("+", a + b, x + y)?;
        check("-", a - b, x - y)?;
        check("*", a * b, x * y)?;
        check("/", a / b, x / y)?;
        check("sqrt", Real::sqrt(a), Real::sqrt(x))?;
        check("abs", Real::abs(a), Real::abs(x))?;
        check("floor", Real::floor(a), Real::floor(x))?;
        check("min", a.min(b), x.min(y))?;
        check("max", a.max(b), x.max(y))?;
        let comparisons = [
            (a.lt(b), x < y),
            (a.le(b), x <= y),
            (Real::eq(a, b), x == y),
            (!a.lt(b) & a.le(b), x == y),
            (a.lt(b) | b.lt(a), x != y),
        ];
        for (unknown, known) in comparisons {
            let is_sound = if known { unknown.any() } else { !unknown.all() };
            prop_assert!(is_sound);
            check("select", Interval::select(unknown, a, b), Wide::select(known, x, y))?;
        }
    }

    /// Of points: the two neighbours of the exact result, or the result.
    #[test]
    fn intervals_are_tight(a in moderate(100), b in moderate(100)) {
        let (x, y) = (Interval::from(a), Interval::from(b));
        let sound = [
            (x + y, a + b, Wide::from(a) + b.into()),
            (x * y, a * b, Wide::from(a) * b.into()),
            (x / y, a / b, Wide::from(a) / b.into()),
            (Real::sqrt(Real::abs(x)), a.abs().sqrt(), Real::sqrt(Wide::from(a.abs()))),
        ];
        for (interval, nearest, exact) in sound {
            prop_assert!(interval.lower() == nearest || interval.upper() == nearest);
            let expected = match exact.partial_cmp(&nearest.into()) {
                Some(std::cmp::Ordering::Equal) => nearest,
                Some(std::cmp::Ordering::Less) => nearest.next_down(),
                _ => nearest.next_up(),
            };
            prop_assert!(interval == Interval::hull(nearest, expected));
        }
    }
}

/// A quotient, a root, kinks and a step: derivatives of all the operations.
fn formula<R: Real>(x: R, y: R) -> R {
    let root = (x * x + lit!(0.5)).sqrt();
    let bent = (x - y).abs().min(x * lit!(2.0) + lit!(1.0)).max(-y);
    let stepped = (y * lit!(8.0)).floor() * x;
    R::select(x.lt(y), root / (y * y + lit!(1.0)), bent - stepped) + x * y - root
}

/// The derivative of `f` at `x`, where it is smooth within 2⁻⁷⁰.
fn difference(f: impl Fn(Wide) -> Wide, x: Wide) -> Wide {
    let h = Wide::from(power(-70));
    (f(x + h) - f(x - h)) / (h + h)
}

fn difference_in<P: Real + Into<f64>>(
    f: impl Fn(Unrounded<P, Wide>) -> Unrounded<P, Wide>,
    x: f64,
) -> Wide {
    difference(|x| f(Unrounded::new(x)).value, x.into())
}

/// Moments of up to four depths in [0, 1], each depth with its weight.
fn distribution() -> impl Strategy<Value = [f64; 4]> {
    prop::collection::vec((0.0..=1.0, 0.01..1.0), 1..=4).prop_map(|points| {
        let total: f64 = points.iter().map(|p: &(f64, f64)| p.1).sum();
        [1, 2, 3, 4].map(|j| points.iter().map(|(z, w)| w / total * z.powi(j)).sum())
    })
}

fn moments<R: From<f64>>(m: [f64; 4]) -> Moments4<R> {
    let [b1, b2, b3, b4] = m.map(R::from);
    Moments4 { b1, b2, b3, b4 }
}

/// Three depths far apart and then some, at which nothing is near to a kink or a pole.
fn benign() -> impl Strategy<Value = [f64; 4]> {
    (0.05..0.2, 0.4..0.6, 0.8..0.95, distribution()).prop_map(
        |(a, b, c, rest): (f64, f64, f64, _)| {
            [1, 2, 3, 4].map(|j| (a.powi(j) + b.powi(j) + c.powi(j) + rest[j as usize - 1]) / 4.0)
        },
    )
}

proptest! {
    #![proptest_config(settings())]

    #[test]
    fn duals_differentiate(x in moderate(2), y in moderate(2)) {
        // The formula's kinks; between them it is smooth.
        prop_assume!((x - y).abs() > 1e-9 && (y * 8.0).fract().abs() > 1e-9);
        let along = |x: Dual<Wide>, y: Dual<Wide>| formula(x, y).derivative;
        let (u, v) = (Wide::from(x), Wide::from(y));
        let dx = along(Dual::variable(u), Dual::constant(v));
        let dy = along(Dual::constant(u), Dual::variable(v));
        let near = |a: Wide, b: Wide| f64::from(a - b).abs() < power(-120);
        prop_assert!(near(dx, difference(|x| formula(x, v), u)));
        prop_assert!(near(dy, difference(|y| formula(u, y), v)));
        prop_assert!(formula(Dual::variable(u), Dual::constant(v)).value == formula(u, v));
        // Half the precision, and enclosed.
        let rough = formula(Dual::variable(DoubleDouble::from(x)), y.into()).derivative;
        prop_assert!(f64::from(Wide::from(rough) - dx).abs() < power(-90));
        prop_assert!(formula(Dual::variable(Interval::from(x)), y.into()).derivative.contains(dx));
    }

    /// The bounds' gradients, against differences.
    #[test]
    fn duals_differentiate_bounds(m in benign(), z in 0.02..0.98, index in 0_usize..5) {
        fn gradient<R: Real + From<f64>>(
            f: impl Fn(Moments4<Dual<R>>, Dual<R>) -> Dual<R>,
            m: [f64; 4],
            z: f64,
            index: usize,
        ) -> R {
            let mut arguments = [m[0], m[1], m[2], m[3], z].map(Dual::from);
            arguments[index] = Dual::variable(arguments[index].value);
            let [b1, b2, b3, b4, z] = arguments;
            f(Moments4 { b1, b2, b3, b4 }, z).derivative
        }
        type Exact = Unrounded<f32, Wide>;
        let at = |f: &dyn Fn(Moments4<Exact>, Exact) -> Exact| {
            difference_in(
                |x| {
                    let mut arguments = [m[0], m[1], m[2], m[3], z].map(Exact::from);
                    arguments[index] = x;
                    let [b1, b2, b3, b4, z] = arguments;
                    f(Moments4 { b1, b2, b3, b4 }, z)
                },
                [m[0], m[1], m[2], m[3], z][index],
            )
        };
        let expected = [at(&hamburger_4), at(&hausdorff_4)];
        let wide = [
            gradient::<Exact>(hamburger_4, m, z, index).value,
            gradient::<Exact>(hausdorff_4, m, z, index).value,
        ];
        let rough = [
            gradient::<Unrounded<f32, DoubleDouble>>(hamburger_4, m, z, index).value,
            gradient::<Unrounded<f32, DoubleDouble>>(hausdorff_4, m, z, index).value,
        ];
        for i in 0..2 {
            let size = f64::from(wide[i]).abs() + 1.0;
            prop_assert!(f64::from(wide[i] - expected[i]).abs() < size * power(-80), "{i}");
            prop_assert!(f64::from(Wide::from(rough[i]) - wide[i]).abs() < size * power(-70), "{i}");
        }
    }

    /// Of the kernels, with the constants of `f32`: any moments, valid or not.
    #[test]
    fn intervals_enclose_bounds(
        valid in distribution(),
        invalid in prop::array::uniform4(-1.5..1.5),
        is_valid in any::<bool>(),
        z in -0.5..1.5,
        radius in prop_oneof![Just(0.0), 1e-12..1e-3],
        shares in prop::array::uniform5(-1.0..=1.0),
    ) {
        type Exact = Unrounded<f32, Wide>;
        type Enclosed = Unrounded<f32, Interval>;
        let m = if is_valid { valid } else { invalid };
        let around = |x: f64| Enclosed::new(Interval::hull(x - radius, x + radius));
        // A number of the box: `radius` off at most, within rounding, so moved in a little.
        let inside = |x: f64, share: f64| {
            Exact::new(Wide::from(x) + Wide::from(radius * share * 0.999))
        };
        let boxed = Moments4 {
            b1: around(m[0]),
            b2: around(m[1]),
            b3: around(m[2]),
            b4: around(m[3]),
        };
        let exact = Moments4 {
            b1: inside(m[0], shares[0]),
            b2: inside(m[1], shares[1]),
            b3: inside(m[2], shares[2]),
            b4: inside(m[3], shares[3]),
        };
        let (z_box, z) = (around(z), inside(z, shares[4]));
        let (interval, bound) = (hamburger_4(boxed, z_box), hamburger_4(exact, z));
        prop_assert!(interval.value.contains(bound.value), "{interval:?} without {bound:?}");
        let (interval, bound) = (hausdorff_4(boxed, z_box), hausdorff_4(exact, z));
        prop_assert!(interval.value.contains(bound.value), "{interval:?} without {bound:?}");
    }

    /// Between easy depths the enclosures are narrow, and 106 bits agree with 300 to 80.
    #[test]
    fn bounds_of_easy_moments_are_known_well(m in benign(), z in 0.02..0.98_f64) {
        let exact = [
            hamburger_4::<Unrounded<f32, Wide>>(moments(m), z.into()).value,
            hausdorff_4::<Unrounded<f32, Wide>>(moments(m), z.into()).value,
        ];
        let double = [
            hamburger_4::<Unrounded<f32, DoubleDouble>>(moments(m), z.into()).value,
            hausdorff_4::<Unrounded<f32, DoubleDouble>>(moments(m), z.into()).value,
        ];
        let enclosed = [
            hamburger_4::<Unrounded<f32, Interval>>(moments(m), z.into()).value,
            hausdorff_4::<Unrounded<f32, Interval>>(moments(m), z.into()).value,
        ];
        for i in 0..2 {
            prop_assert!(f64::from(Wide::from(double[i]) - exact[i]).abs() < power(-80), "{i}");
            prop_assert!(enclosed[i].width() < 1e-6, "{i}: {:?}", enclosed[i]);
        }
    }
}

#[test]
fn literals_are_the_f64_and_epsilons_the_type_s_own() {
    fn tenth<R: Real>() -> R {
        lit!(0.1)
    }
    assert_eq!(tenth::<Wide>(), Wide::from(0.1));
    assert_eq!(tenth::<DoubleDouble>(), DoubleDouble::from(0.1));
    assert_eq!(tenth::<Interval>(), Interval::hull(0.1, 0.1));
    assert_eq!(tenth::<Dual<f64>>(), Dual::constant(0.1));
    assert_eq!(
        tenth::<Unrounded<f32, Wide>>().value,
        Wide::from(f64::from(0.1_f32))
    );
    assert_eq!(f64::from(DoubleDouble::epsilon()), power(-104));
    assert_eq!(f64::from(Wide::epsilon()), power(-299));
    assert_eq!(
        Unrounded::<f32, DoubleDouble>::epsilon().value,
        f32::EPSILON.into()
    );
    let one = Wide::from(1.0);
    let after = one + Wide::epsilon();
    assert!(after > one && (one + Wide::epsilon() * Wide::from(0.5)) == one);
    // The tie after an odd number goes up.
    assert_eq!(
        after + Wide::epsilon() * Wide::from(0.5),
        after + Wide::epsilon()
    );
    // 1 / (1 - x) = 1 + x + x² + x³ + …: x² would be a tie to even, but for what follows it.
    let x = Wide::from(power(-150));
    assert_eq!(one / (one - x), one + x + Wide::epsilon());
}

#[test]
fn roots_at_zero_have_a_derivative() {
    let root = Dual::variable(0.0_f64).sqrt();
    assert_eq!((root.value, root.derivative), (0.0, 0.0));
    let root = Dual::variable(4.0_f64).sqrt();
    assert_eq!((root.value, root.derivative), (2.0, 0.25));
    // Second derivatives: of x³ at 2.
    let x = Dual {
        value: Dual::variable(2.0_f64),
        derivative: Dual::constant(1.0),
    };
    assert_eq!((x * x * x).derivative.derivative, 12.0);
}

#[test]
fn what_does_not_exist_stays_so() {
    let zero = Wide::from(0.0);
    let minus = Wide::from(-1.0);
    for undefined in [
        zero / zero,
        Real::sqrt(minus),
        f64::NAN.into(),
        f64::INFINITY.into(),
    ] {
        assert!(!undefined.is_defined() && !(undefined + minus).is_defined());
        assert!(f64::from(undefined).is_nan() && undefined != undefined);
        assert!(!Interval::ENTIRE.contains(undefined));
    }
    // Kernels replace what is not a number by comparing it.
    let sanitised = |x: Wide| Wide::select(Real::abs(x).le(lit!(1e30)), x, zero);
    assert_eq!(sanitised(f64::NAN.into()), zero);
    let x = DoubleDouble::from(f64::INFINITY);
    assert!(!Real::abs(x).le(lit!(1e30)));
    assert!(!Real::abs(DoubleDouble::from(f64::NAN)).le(lit!(1e30)));
}

#[test]
fn intervals_know_their_limits() {
    let interval = Interval::hull;
    let infinity = f64::INFINITY;
    // Division by what ends at 0 has one end; by what is around 0, none.
    let quotient = interval(1.0, 2.0) / interval(0.0, 4.0);
    assert_eq!((quotient.lower(), quotient.upper()), (0.25, infinity));
    let quotient = interval(1.0, 2.0) / interval(-4.0, -0.0);
    assert_eq!((quotient.lower(), quotient.upper()), (-infinity, -0.25));
    assert_eq!(interval(1.0, 2.0) / interval(-1.0, 1.0), Interval::ENTIRE);
    assert_eq!(interval(0.0, 0.0) / interval(0.0, 0.0), Interval::ENTIRE);
    // 0 times anything is 0, however large.
    assert_eq!(interval(0.0, 0.0) * Interval::ENTIRE, interval(0.0, 0.0));
    // Beyond the largest number.
    let huge = interval(f64::MAX, f64::MAX) * interval(2.0, 2.0);
    assert_eq!((huge.lower(), huge.upper()), (f64::MAX, infinity));
    let huge = interval(f64::MAX, f64::MAX) + interval(f64::MAX, f64::MAX);
    assert_eq!((huge.lower(), huge.upper()), (f64::MAX, infinity));
    let denormal = interval(f64::MIN_POSITIVE, f64::MIN_POSITIVE);
    assert!((denormal * denormal).upper() > 0.0);
    assert_eq!(Interval::from(f64::NAN), Interval::ENTIRE);
    assert_eq!(Interval::from(infinity).lower(), f64::MAX);
    assert_eq!(Real::sqrt(interval(-1.0, 4.0)), interval(0.0, 2.0));
    assert_eq!(Real::sqrt(interval(-2.0, -1.0)), Interval::ENTIRE);
    assert_eq!(Real::abs(interval(-3.0, 2.0)), interval(0.0, 3.0));
    // Undecided: both branches.
    let x = interval(-1.0, 2.0);
    let mask = x.lt(interval(0.0, 0.0));
    assert!(mask.any() && !mask.all() && (!mask).any() && !(!mask).all());
    assert_eq!(Interval::select(mask, -x, x), interval(-2.0, 2.0));
    assert!((mask | !mask).any() && !(mask | !mask).all());
}
