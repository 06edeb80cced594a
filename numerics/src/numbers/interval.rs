use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not};

use hankel_dsl::{Mask, Real};

use super::Wide;
use super::error_free::{PRODUCT_UNDERFLOW, product};

/// All numbers from `lower` to `upper`, both included; an infinite end has no end.
///
/// Every operation's result encloses what exact arithmetic makes of any numbers in its operands,
/// so a kernel's result encloses the kernel's exact result. The ends are the nearest `f64` outwards:
/// a result that is an `f64` stays a point. `/` by an interval around 0, and the square root of what
/// is negative throughout, give the whole line; a root is otherwise that of the part which is not
/// negative.
///
/// A comparison of intervals that overlap is [undecided](Undecided), and selecting by it gives the
/// hull of both. Intervals grow, since they do not know that two operands are the same: cut a wide
/// argument into pieces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    lower: f64,
    upper: f64,
}

/// A truth value that may be unknown: some numbers in the operands compare so, others not.
///
/// `&`, `|` and `!` are unknown where the unknown matters (Kleene). [`any`](Mask::any) asks whether
/// it may be true, [`all`](Mask::all) whether it is in every case; so code that skips what no lane
/// needs skips only what no exact result needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Undecided {
    possible: bool,
    certain: bool,
}

impl BitAnd for Undecided {
    type Output = Self;
    #[inline(always)]
    fn bitand(self, other: Self) -> Self {
        Self {
            possible: self.possible & other.possible,
            certain: self.certain & other.certain,
        }
    }
}

impl BitOr for Undecided {
    type Output = Self;
    #[inline(always)]
    fn bitor(self, other: Self) -> Self {
        Self {
            possible: self.possible | other.possible,
            certain: self.certain | other.certain,
        }
    }
}

impl Not for Undecided {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        Self {
            possible: !self.certain,
            certain: !self.possible,
        }
    }
}

impl Mask for Undecided {
    #[inline(always)]
    fn any(self) -> bool {
        self.possible
    }
    #[inline(always)]
    fn all(self) -> bool {
        self.certain
    }
}

impl Interval {
    /// The whole line.
    pub const ENTIRE: Self = Self {
        lower: f64::NEG_INFINITY,
        upper: f64::INFINITY,
    };

    /// The numbers between `a` and `b`; of a NaN, the whole line. The infinities stand for all
    /// numbers beyond the largest finite `f64`.
    #[inline(always)]
    #[must_use]
    pub fn hull(a: f64, b: f64) -> Self {
        if a.is_nan() || b.is_nan() {
            return Self::ENTIRE;
        }
        Self {
            lower: a.min(b).min(f64::MAX),
            upper: a.max(b).max(f64::MIN),
        }
    }

    /// Its lower end, or negative infinity.
    #[inline(always)]
    #[must_use]
    pub fn lower(self) -> f64 {
        self.lower
    }

    /// Its upper end, or infinity.
    #[inline(always)]
    #[must_use]
    pub fn upper(self) -> f64 {
        self.upper
    }

    /// The distance between its ends, rounded up.
    #[inline(always)]
    #[must_use]
    pub fn width(self) -> f64 {
        let (rounded, error) = self.upper.two_sum(-self.lower);
        outward(rounded, error).upper
    }

    /// Whether `x` is in it; an undefined number is in none.
    #[must_use]
    pub fn contains(self, x: Wide) -> bool {
        let above = self.lower == f64::NEG_INFINITY || Wide::from(self.lower) <= x;
        let below = self.upper == f64::INFINITY || x <= self.upper.into();
        above && below && x.is_defined()
    }

    /// The smallest interval that holds both.
    #[inline(always)]
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self {
            lower: self.lower.min(other.lower),
            upper: self.upper.max(other.upper),
        }
    }

    /// The union of an operation's results at the corners of its operands.
    #[inline(always)]
    fn of_corners(a: Self, b: Self, at: impl Fn(f64, f64) -> Self) -> Self {
        at(a.lower, b.lower)
            .union(at(a.lower, b.upper))
            .union(at(a.upper, b.lower).union(at(a.upper, b.upper)))
    }

    #[inline(always)]
    fn compare(possible: bool, certain: bool) -> Undecided {
        Undecided { possible, certain }
    }
}

/// The interval around an exact result, given the result rounded to nearest and a number with the
/// sign of what rounding took away; a NaN if that is unknown.
#[inline(always)]
fn outward(rounded: f64, error: f64) -> Interval {
    Interval {
        lower: if error >= 0.0 {
            rounded
        } else {
            rounded.next_down()
        },
        upper: if error <= 0.0 {
            rounded
        } else {
            rounded.next_up()
        },
    }
}

/// A product of ends, where 0 times infinity is 0: an infinite end is no number of the interval.
#[inline(always)]
fn product_of_ends(a: f64, b: f64) -> Interval {
    if a == 0.0 || b == 0.0 {
        return outward(0.0, 0.0);
    }
    let (rounded, error) = product(a, b);
    let is_known = rounded.abs() > PRODUCT_UNDERFLOW;
    outward(rounded, if is_known { error } else { f64::NAN })
}

/// A quotient of ends, where `b` is 0 only with the sign from which the divisor approaches it.
#[inline(always)]
fn quotient_of_ends(a: f64, b: f64) -> Interval {
    if a == 0.0 || b.is_infinite() {
        return outward(0.0, 0.0);
    }
    let rounded = a / b;
    let (p, error) = product(rounded, b);
    let rest = ((a - p) - error) * b.signum();
    let is_known = p.abs() > PRODUCT_UNDERFLOW && rounded.abs() > PRODUCT_UNDERFLOW;
    outward(rounded, if is_known { rest } else { f64::NAN })
}

impl From<f64> for Interval {
    #[inline(always)]
    fn from(x: f64) -> Self {
        Self::hull(x, x)
    }
}

impl From<f32> for Interval {
    #[inline(always)]
    fn from(x: f32) -> Self {
        f64::from(x).into()
    }
}

impl Neg for Interval {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self {
            lower: -self.upper,
            upper: -self.lower,
        }
    }
}

impl Add for Interval {
    type Output = Self;
    #[inline(never)]
    fn add(self, other: Self) -> Self {
        let (lower, lower_error) = self.lower.two_sum(other.lower);
        let (upper, upper_error) = self.upper.two_sum(other.upper);
        Self {
            lower: outward(lower, lower_error).lower,
            upper: outward(upper, upper_error).upper,
        }
    }
}

impl Mul for Interval {
    type Output = Self;
    #[inline(never)]
    fn mul(self, other: Self) -> Self {
        Self::of_corners(self, other, product_of_ends)
    }
}

impl Div for Interval {
    type Output = Self;
    #[inline(never)]
    fn div(self, other: Self) -> Self {
        let is_inside = other.lower < 0.0 && other.upper > 0.0;
        if is_inside || (other.lower == 0.0 && other.upper == 0.0) {
            return Self::ENTIRE;
        }
        // A divisor's end at 0 is approached from within.
        let other = Self {
            lower: if other.lower == 0.0 { 0.0 } else { other.lower },
            upper: if other.upper == 0.0 {
                -0.0
            } else {
                other.upper
            },
        };
        Self::of_corners(self, other, quotient_of_ends)
    }
}

remaining_operators!([] Interval);

impl Real for Interval {
    type Mask = Undecided;
    const IS_WIDE: bool = true;

    #[inline(always)]
    fn literal<const BITS: u64>() -> Self {
        f64::from_bits(BITS).into()
    }
    /// That of `f64`; use [`Unrounded`](super::Unrounded) to enclose a kernel for `f32`.
    #[inline(always)]
    fn epsilon() -> Self {
        f64::EPSILON.into()
    }
    #[inline(never)]
    fn sqrt(self) -> Self {
        if self.upper < 0.0 {
            return Self::ENTIRE;
        }
        let end = |x: f64| {
            let rounded = x.sqrt();
            let (p, error) = product(rounded, rounded);
            let is_known = x == 0.0 || x > PRODUCT_UNDERFLOW;
            outward(rounded, if is_known { (x - p) - error } else { f64::NAN })
        };
        Self {
            lower: end(self.lower.max(0.0)).lower,
            upper: end(self.upper).upper,
        }
    }
    #[inline(always)]
    fn abs(self) -> Self {
        let (a, b) = (self.lower.abs(), self.upper.abs());
        let has_zero = self.lower <= 0.0 && self.upper >= 0.0;
        Self {
            lower: if has_zero { 0.0 } else { a.min(b) },
            upper: a.max(b),
        }
    }
    #[inline(always)]
    fn floor(self) -> Self {
        Self {
            lower: self.lower.floor(),
            upper: self.upper.floor(),
        }
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self {
            lower: self.lower.min(other.lower),
            upper: self.upper.min(other.upper),
        }
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self {
            lower: self.lower.max(other.lower),
            upper: self.upper.max(other.upper),
        }
    }
    #[inline(always)]
    fn lt(self, other: Self) -> Undecided {
        Self::compare(self.lower < other.upper, self.upper < other.lower)
    }
    #[inline(always)]
    fn le(self, other: Self) -> Undecided {
        Self::compare(self.lower <= other.upper, self.upper <= other.lower)
    }
    #[inline(always)]
    fn eq(self, other: Self) -> Undecided {
        let overlap = self.lower <= other.upper && other.lower <= self.upper;
        let ends = self.lower == self.upper && other.lower == other.upper;
        Self::compare(overlap, overlap && ends)
    }
    #[inline(always)]
    fn select(mask: Undecided, a: Self, b: Self) -> Self {
        match (mask.possible, mask.certain) {
            (_, true) => a,
            (false, _) => b,
            (true, false) => a.union(b),
        }
    }
}
