//! Elementary functions, each family twice: where arithmetic is as it is written, with the same bits
//! as natively; and in every language, within the 2 ulp that reordered sums cost. Then the device's
//! own ones, and what vectors have.
//!
//! Arguments are brought into each function's domain: what is outside of it is NaN, which not every
//! language knows.

use hankel_dsl::glam::{Vec2, Vec3};
use hankel_dsl::math::{self, Elementary};
use hankel_dsl::{Element, Real, kernel, lit};

use crate::Pair;

/// A number and another one.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Arguments<R> {
    /// From -30 to 30.
    pub x: R,
    /// From -4 to 4.
    pub y: R,
}

/// Functions of angles.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Angles<R> {
    /// Sine.
    pub sin: R,
    /// Cosine.
    pub cos: R,
    /// Tangent.
    pub tan: R,
    /// Sine and cosine at once, added.
    pub both: R,
}

/// Angles of sines, cosines and tangents.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Arcs<R> {
    /// Of a sine.
    pub asin: R,
    /// Of a cosine.
    pub acos: R,
    /// Of a tangent.
    pub atan: R,
    /// Of two coordinates.
    pub atan2: R,
}

/// Powers of e and 2.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Exponentials<R> {
    /// Of e.
    pub exp: R,
    /// Of 2.
    pub exp2: R,
    /// Of e, less 1.
    pub exp_m1: R,
    /// Hyperbolic sine.
    pub sinh: R,
    /// Hyperbolic cosine.
    pub cosh: R,
    /// Hyperbolic tangent.
    pub tanh: R,
}

/// Logarithms and powers.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Powers<R> {
    /// Natural logarithm.
    pub ln: R,
    /// Logarithm to base 2.
    pub log2: R,
    /// Logarithm of 1 and a little.
    pub ln_1p: R,
    /// Cube root.
    pub cbrt: R,
    /// Power of any number above zero.
    pub pow: R,
    /// Power of a number that may be below zero.
    pub square: R,
}

/// Whole numbers, steps and mixtures.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Steps<R> {
    /// Down.
    pub floor: R,
    /// Up.
    pub ceil: R,
    /// To the nearest.
    pub round: R,
    /// Towards zero.
    pub trunc: R,
    /// What is above the whole number.
    pub fract: R,
    /// -1, 0 or 1.
    pub sign: R,
    /// 0 or 1.
    pub step: R,
    /// From 0 to 1.
    pub smoothstep: R,
    /// Between two numbers.
    pub mix: R,
    /// A product and a sum, rounded once.
    pub fma: R,
}

/// Any number of moderate size, which is not denormal.
fn moderate<R: Real>(x: R) -> R {
    let x = x.clamp(lit!(-1.0e18), lit!(1.0e18));
    R::select(x.abs().lt(lit!(1.0e-18)), lit!(1.0e-18), x)
}

fn angles_of<R: Elementary>(of: Arguments<R>) -> Angles<R> {
    let x = moderate(of.x);
    let (s, c) = math::sin_cos(moderate(of.y));
    Angles {
        sin: math::sin(x),
        cos: math::cos(x),
        tan: math::tan(x),
        both: R::select(x.lt(lit!(0.0)), s, c),
    }
}

fn arcs_of<R: Elementary>(of: Arguments<R>) -> Arcs<R> {
    let (x, y) = (moderate(of.x), moderate(of.y));
    let sine = (y * lit!(0.25)).clamp(lit!(-1.0), lit!(1.0));
    Arcs {
        asin: math::asin(sine),
        acos: math::acos(sine),
        atan: math::atan(y),
        atan2: math::atan2(y, x),
    }
}

fn exponentials_of<R: Elementary>(of: Arguments<R>) -> Exponentials<R> {
    let x = moderate(of.x).clamp(lit!(-80.0), lit!(80.0));
    let y = moderate(of.y).clamp(lit!(-80.0), lit!(80.0));
    Exponentials {
        exp: math::exp(x),
        exp2: math::exp2(x),
        exp_m1: math::exp_m1(y),
        sinh: math::sinh(y),
        cosh: math::cosh(x),
        tanh: math::tanh(y),
    }
}

fn powers_of<R: Elementary>(of: Arguments<R>) -> Powers<R> {
    let (x, y) = (moderate(of.x), moderate(of.y));
    let (size, exponent) = (x.abs(), y.clamp(lit!(-2.0), lit!(2.0)));
    Powers {
        ln: math::ln(size),
        log2: math::log2(size),
        ln_1p: math::ln_1p(y.max(lit!(-0.99))),
        cbrt: math::cbrt(x),
        pow: math::pow(size, exponent),
        square: math::pow(x, math::round(exponent)),
    }
}

macro_rules! families {
    ($($exact:ident, $free:ident: $of:ident -> $result:ident;)*) => {$(
        /// A family of functions, with the same bits everywhere.
        #[kernel(compute, threads(64), precision(f32, f64), exact)]
        pub fn $exact<R: Elementary>(#[element] of: Arguments<R>) -> $result<R> {
            $of(of)
        }

        /// The same functions in every language.
        #[kernel(
            compute,
            threads(64),
            parity(
                ulp = 2,
                absolute = 0.0,
                why = "1 ulp at most as they are written; a shader's compiler may reorder sums"
            )
        )]
        pub fn $free(#[element] of: Arguments<f32>) -> $result<f32> {
            $of(of)
        }
    )*};
}

families! {
    angles, angles_free: angles_of -> Angles;
    arcs, arcs_free: arcs_of -> Arcs;
    exponentials, exponentials_free: exponentials_of -> Exponentials;
    powers, powers_free: powers_of -> Powers;
}

/// Whole numbers, steps and mixtures.
#[kernel(compute, threads(64), precision(f32, f64), exact)]
pub fn steps<R: Elementary>(#[element] of: Arguments<R>) -> Steps<R> {
    let (x, y) = (moderate(of.x), moderate(of.y));
    // Whose product's error is no denormal number.
    let (a, b) = (x.abs().max(lit!(1.0e-6)), y.abs().max(lit!(1.0e-6)));
    // Halves too.
    let half = (x * lit!(2.0)).floor() * lit!(0.5);
    Steps {
        floor: math::floor(x),
        ceil: math::ceil(x),
        round: math::round(half),
        trunc: math::trunc(x),
        fract: math::fract(x),
        sign: math::sign(half),
        step: math::step(y, x),
        smoothstep: math::smoothstep(lit!(-4.0), lit!(4.0), x),
        mix: math::mix(x, y, lit!(0.3)),
        fma: math::fma(a, b, -(a * b)),
    }
}

/// The device's own functions, where every language promises something absolute.
#[kernel(
    compute,
    threads(64),
    parity(
        ulp = 4096,
        absolute = 5e-4,
        why = "WGSL, 15.7.4: 2^-11 for sines, 4096 ulp for arcs, and 6.8e-5"
    )
)]
pub fn native_angles(#[element] of: Arguments<f32>) -> Angles<f32> {
    use math::native;
    // Within pi.
    let x = of.x.clamp(-30.0, 30.0) * 0.1;
    let sine = of.y.clamp(-4.0, 4.0) * 0.25;
    Angles {
        sin: native::sin(x),
        cos: native::cos(x),
        tan: native::atan2(sine, x.abs() + 1.0),
        both: native::asin(sine) + native::acos(sine) + native::atan(x),
    }
}

/// The device's own exponentials and logarithms.
#[kernel(
    compute,
    threads(64),
    parity(
        ulp = 256,
        absolute = 1e-6,
        why = "WGSL, 15.7.4: 3 + 2 |x| ulp for powers, of arguments up to 30 and products up to 40; 3 ulp and 2^-21 for logarithms"
    )
)]
pub fn native_powers(#[element] of: Arguments<f32>) -> Powers<f32> {
    use math::native;
    let x = of.x.clamp(-30.0, 30.0);
    let y = of.y.clamp(-4.0, 4.0);
    let size = x.abs() + 0.01;
    Powers {
        ln: native::ln(size),
        log2: native::log2(size),
        ln_1p: native::exp(x),
        cbrt: native::exp2(x),
        pow: native::pow(size, y),
        square: native::fma(x, x, size),
    }
}

/// Two vectors.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Vectors {
    /// From -2 to 2.
    pub a: Vec3,
    /// From 0 to 1.
    pub index: f32,
    /// From -2 to 2.
    pub b: Vec3,
    /// Fills the structure up.
    pub padding: f32,
}

/// A direction that has a length.
fn direction(v: Vec3) -> Vec3 {
    let part = |x: f32| moderate(x).clamp(-100.0, 100.0);
    let v = Vec3::new(part(v.x), part(v.y), part(v.z));
    if v.length() < 0.1 { Vec3::Z } else { v }
}

/// Lengths, products, reflection and refraction.
#[kernel(compute, threads(64), exact)]
pub fn vectors(#[element] of: Vectors) -> Vectors {
    let (a, b) = (direction(of.a), direction(of.b));
    let normal = a.normalize();
    let incoming = b.normalize();
    let bent = incoming.refract(normal, 0.75);
    let flat = Vec2::new(a.x, b.y);
    Vectors {
        a: incoming.reflect(normal) + a.cross(b),
        index: a.dot(b) + a.distance(b) + flat.length(),
        b: bent + b.map(math::sin),
        padding: flat.dot(Vec2::new(1.0, 2.0)),
    }
}

/// The direction of a vector, zero where it has none, and in each component its sign and whether it is finite: functions
/// that ask for NaN and for infinities, which WGSL has no literals for.
#[kernel(
    compute,
    threads(64),
    parity(
        ulp = 4,
        absolute = 5e-7,
        non_finite,
        why = "a quotient by a root, and sums of products of numbers up to 1, which may be reordered"
    )
)]
pub fn directions(#[element] of: Vectors) -> Vectors {
    // Lengths whose squares are normal numbers, and zero.
    let part = |x: f32| if x.abs() < 1e-3 { 0.0 } else { x };
    let v = Vec3::new(part(of.a.x), part(of.a.y), part(of.a.z));
    let n = v.normalize_or_zero();
    let (tangent, bitangent) = if v.is_finite() && n != Vec3::ZERO {
        n.any_orthonormal_pair()
    } else {
        (Vec3::X, Vec3::Y)
    };
    let quotient = of.index / v.x;
    Vectors {
        a: n,
        index: tangent.dot(bitangent).abs().min(1e-3).signum() + quotient.signum(),
        b: tangent,
        padding: if quotient.is_finite() { 1.0 } else { 0.0 }
            + if f32::INFINITY > quotient { 2.0 } else { 0.0 }
            + if quotient == f32::NEG_INFINITY {
                4.0
            } else {
                0.0
            },
    }
}

/// The sum and the difference of a number and its weight's function, in one kernel with arithmetic
/// of its own.
#[kernel(
    compute,
    threads(64),
    parity(
        ulp = 4,
        absolute = 1e-6,
        why = "2 ulp of a function that is at most 1, and two sums"
    )
)]
pub fn waves(#[element] pair: Pair<f32>) -> Pair<f32> {
    let x = pair.x.clamp(-100.0, 100.0);
    let wave = math::sin(x * 0.5) * math::smoothstep(0.0, 1.0, pair.w);
    Pair {
        x: wave + math::exp(-x.abs()),
        w: wave - math::tanh(x),
    }
}
