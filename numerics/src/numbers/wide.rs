use std::cmp::Ordering;
use std::ops::{Add, Div, Mul, Neg};

use hankel_dsl::Real;
use ruint::Uint;

use super::DoubleDouble;

/// Bits of the significand.
const PRECISION: usize = 300;
/// Exponents stay within ± this, so that sums of two never overflow.
const MAX_EXPONENT: u64 = 1 << 40;

type Significand = Uint<320, 5>;
/// Holds a product of two significands; a dividend; a radicand.
type Double = Uint<640, 10>;

/// 300 bits, every operation correctly rounded (to nearest, ties to even), no overflow and no
/// underflow within 2^±2⁴⁰: what the other numbers are checked against, and slow.
///
/// A result that does not exist (a quotient by 0, the root of a negative number, what comes from an
/// infinity or a NaN) is *undefined*: it compares to nothing, and converts to a NaN.
#[derive(Clone, Copy, Debug)]
pub struct Wide(Option<Finite>);

/// `significand · 2^exponent`; the significand has all 300 bits, or is 0 and the rest too.
#[derive(Clone, Copy, Debug, Default)]
struct Finite {
    negative: bool,
    exponent: i64,
    significand: Significand,
}

impl Wide {
    /// Whether it is a number.
    #[must_use]
    pub fn is_defined(self) -> bool {
        self.0.is_some()
    }
}

/// `value` to at most `bits` bits, or one bit more if it is rounded up to a power of two; and by how
/// many places it was shifted for that.
fn shorten(value: Double, bits: usize) -> (Double, usize) {
    let shift = value.bit_len().saturating_sub(bits);
    if shift == 0 {
        return (value, 0);
    }
    let kept = value >> shift;
    let half = value.bit(shift - 1);
    let beyond = value.trailing_zeros() < shift - 1;
    let up = half && (beyond || kept.bit(0));
    (kept + Double::from(u8::from(up)), shift)
}

/// `value`, in which the last bit also stands for anything that was cut off. Rounding it to fewer
/// bits gives the same as rounding the whole, if at least two go.
fn jam(value: Double, cut_off: bool) -> Double {
    value | Double::from(u8::from(cut_off))
}

/// The integer part of the square root of a number of 639 or 640 bits: Newton's iteration, from
/// above, until it falls no further.
fn root(radicand: Double) -> Double {
    // 52 bits are right; 2 more than what rounding may have taken off.
    let leading = radicand.as_limbs()[9] as f64;
    let mut root = Double::from((leading.sqrt() * 1_048_576.0) as u64 + 2) << 268;
    loop {
        let next = (root + radicand / root) >> 1;
        if next >= root {
            return root;
        }
        root = next;
    }
}

impl Finite {
    /// Rounds `± value · 2^exponent`.
    fn round(negative: bool, exponent: i64, value: Double) -> Option<Self> {
        if value.is_zero() {
            return Some(Self::default());
        }
        let (kept, right) = shorten(value, PRECISION);
        let left = PRECISION as i64 - kept.bit_len() as i64;
        let kept = if left < 0 {
            kept >> 1
        } else {
            kept << left as usize
        };
        let exponent = exponent + right as i64 - left;
        match exponent.unsigned_abs() > MAX_EXPONENT {
            true if exponent < 0 => Some(Self::default()),
            true => None,
            false => Some(Self {
                negative,
                exponent,
                significand: Significand::from(kept),
            }),
        }
    }

    fn is_zero(self) -> bool {
        self.significand.is_zero()
    }

    fn sum(self, other: Self) -> Option<Self> {
        if self.is_zero() || other.is_zero() {
            return Some(if self.is_zero() { other } else { self });
        }
        let (a, b) = if self.exponent < other.exponent {
            (other, self)
        } else {
            (self, other)
        };
        // A bit is left free for the carry.
        const ROOM: usize = 640 - PRECISION - 2;
        let gap = usize::try_from(a.exponent - b.exponent).ok()?;
        if gap > ROOM {
            // Less than any rounding.
            return Some(a);
        }
        let large = Double::from(a.significand) << ROOM;
        let small = Double::from(b.significand) << (ROOM - gap);
        let exponent = a.exponent - ROOM as i64;
        if a.negative == b.negative {
            Self::round(a.negative, exponent, large + small)
        } else if large >= small {
            Self::round(a.negative, exponent, large - small)
        } else {
            Self::round(b.negative, exponent, small - large)
        }
    }

    fn product(self, other: Self) -> Option<Self> {
        Self::round(
            self.negative != other.negative,
            self.exponent + other.exponent,
            self.significand.widening_mul(other.significand),
        )
    }

    fn quotient(self, other: Self) -> Option<Self> {
        if other.is_zero() {
            return None;
        }
        const ROOM: usize = 640 - PRECISION;
        let dividend = Double::from(self.significand) << ROOM;
        let (quotient, rest) = dividend.div_rem(Double::from(other.significand));
        Self::round(
            self.negative != other.negative,
            self.exponent - other.exponent - ROOM as i64,
            jam(quotient, !rest.is_zero()),
        )
    }

    fn root(self) -> Option<Self> {
        if self.negative || self.is_zero() {
            return (!self.negative).then_some(self);
        }
        // The radicand's exponent must be even.
        let room = 640 - PRECISION - (self.exponent.unsigned_abs() % 2) as usize;
        let radicand = Double::from(self.significand) << room;
        let root = root(radicand);
        let exponent = (self.exponent - room as i64) / 2;
        Self::round(false, exponent, jam(root, root * root != radicand))
    }

    fn floor(self) -> Option<Self> {
        if self.exponent >= 0 {
            return Some(self);
        }
        let places = usize::try_from(-self.exponent).ok()?;
        let whole = Double::from(self.significand >> places.min(320));
        let fraction = !self.is_zero() && self.significand.trailing_zeros() < places;
        let away = Double::from(u8::from(fraction && self.negative));
        Self::round(self.negative, 0, whole + away)
    }

    fn to_f64(self) -> f64 {
        // The exponent of the leading bit says how many bits an f64 has room for.
        let leading = self.exponent + PRECISION as i64 - 1;
        let magnitude = if self.is_zero() || leading < -1075 {
            0.0
        } else if leading > 1023 {
            f64::INFINITY
        } else {
            let bits = usize::try_from((leading + 1075).min(53)).unwrap_or(0);
            let (kept, shift) = shorten(Double::from(self.significand), bits);
            let power = |e: i64| f64::from_bits(((e + 1023) as u64) << 52);
            let exponent = self.exponent + shift as i64;
            let normal = exponent.max(-1022);
            // `kept` has at most 53 bits, or is 2^53: neither product rounds.
            kept.as_limbs()[0] as f64 * power(normal) * power(exponent - normal)
        };
        if self.negative { -magnitude } else { magnitude }
    }
}

impl From<f64> for Wide {
    #[inline(never)]
    fn from(x: f64) -> Self {
        let bits = x.to_bits();
        let fraction = bits & ((1 << 52) - 1);
        let (exponent, significand) = match bits >> 52 & 0x7ff {
            0 => (-1074, fraction),
            e => (e as i64 - 1075, fraction | 1 << 52),
        };
        let rounded = Finite::round(x.is_sign_negative(), exponent, Double::from(significand));
        Self(rounded.filter(|_| x.is_finite()))
    }
}

impl From<f32> for Wide {
    fn from(x: f32) -> Self {
        f64::from(x).into()
    }
}

impl From<DoubleDouble> for Wide {
    fn from(x: DoubleDouble) -> Self {
        Self::from(x.high()) + Self::from(x.low())
    }
}

/// To nearest; beyond `f64`'s range 0 or infinite.
impl From<Wide> for f64 {
    fn from(x: Wide) -> Self {
        x.0.map_or(Self::NAN, Finite::to_f64)
    }
}

/// To nearest twice: within 2⁻¹⁰⁶ of the value.
impl From<Wide> for DoubleDouble {
    fn from(x: Wide) -> Self {
        let high = f64::from(x);
        Self::of_sum(high, (x - high.into()).into())
    }
}

impl PartialEq for Wide {
    fn eq(&self, other: &Self) -> bool {
        self.partial_cmp(other) == Some(Ordering::Equal)
    }
}

impl PartialOrd for Wide {
    #[inline(never)]
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        let difference = (*self - *other).0?;
        Some(match difference {
            d if d.is_zero() => Ordering::Equal,
            d if d.negative => Ordering::Less,
            _ => Ordering::Greater,
        })
    }
}

impl Neg for Wide {
    type Output = Self;
    #[inline(never)]
    fn neg(self) -> Self {
        Self(self.0.map(|x| Finite {
            negative: !x.negative && !x.is_zero(),
            ..x
        }))
    }
}

impl Add for Wide {
    type Output = Self;
    #[inline(never)]
    fn add(self, other: Self) -> Self {
        Self(self.0.zip(other.0).and_then(|(a, b)| a.sum(b)))
    }
}

impl Mul for Wide {
    type Output = Self;
    #[inline(never)]
    fn mul(self, other: Self) -> Self {
        Self(self.0.zip(other.0).and_then(|(a, b)| a.product(b)))
    }
}

impl Div for Wide {
    type Output = Self;
    #[inline(never)]
    fn div(self, other: Self) -> Self {
        Self(self.0.zip(other.0).and_then(|(a, b)| a.quotient(b)))
    }
}

remaining_operators!([] Wide);

impl Real for Wide {
    ordered!();

    fn literal<const BITS: u64>() -> Self {
        f64::from_bits(BITS).into()
    }
    /// 2⁻²⁹⁹
    fn epsilon() -> Self {
        Self::from(2.0_f64.powi(1 - PRECISION as i32))
    }
    #[inline(never)]
    fn sqrt(self) -> Self {
        Self(self.0.and_then(Finite::root))
    }
    fn abs(self) -> Self {
        Self(self.0.map(|x| Finite {
            negative: false,
            ..x
        }))
    }
    fn floor(self) -> Self {
        Self(self.0.and_then(Finite::floor))
    }
}
