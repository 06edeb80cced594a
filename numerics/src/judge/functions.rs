use std::f64::consts::TAU;
use std::fmt;
use std::str::FromStr;

use super::JudgeError;

/// A scalar function of depth whose mean a shadow map may hold.
///
/// [`ALL`](Self::ALL) are the 37 candidates of the automated search for shadow map data (\[MSM\],
/// supplement, section 6, where they are listed by kind; the text that is in circulation lost the
/// minus sign of asin(2z - 1), without which the function would not be defined on [0, 1], and the
/// count of 37 confirms that nothing else is missing). Beyond them every power may be asked for,
/// since bounds exist for more moments than the search could afford.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum DepthFunction {
    /// `z^k`; candidates for k = 1 to 8, permitted up to [`MAX_POWER`](Self::MAX_POWER).
    Power(u8),
    /// `z^(1/k)`, k = 2 to 4; for z >= 0.
    Root(u8),
    /// `1/(z+1)^k`, k = 1 to 4; for z > -1.
    Reciprocal(u8),
    /// `exp(k z)`, k = 1 to 4.
    Exponential(u8),
    /// `log(z+k)`, k = 1 to 4; for z > -k.
    Logarithm(u8),
    /// `sin(2 pi k z)`, k = 1 to 4.
    Sine(u8),
    /// `cos(2 pi k z)`, k = 1 to 4.
    Cosine(u8),
    /// `cosh(z)`.
    HyperbolicCosine,
    /// `sinh(z)`.
    HyperbolicSine,
    /// `asin(z)`; for z in [-1, 1].
    Arcsine,
    /// `asin(2z-1)`; for z in [0, 1].
    ArcsineOfUnit,
    /// `atan(z)`.
    Arctangent,
    /// `exp(-z^2)`.
    Gaussian,
}

use DepthFunction as F;

impl DepthFunction {
    /// The greatest power.
    pub const MAX_POWER: u8 = 16;

    /// The 37 candidates, in the order of the paper's list.
    #[rustfmt::skip]
    pub const ALL: [Self; 37] = [
        F::Power(1), F::Power(2), F::Power(3), F::Power(4),
        F::Power(5), F::Power(6), F::Power(7), F::Power(8),
        F::Root(2), F::Root(3), F::Root(4),
        F::Reciprocal(1), F::Reciprocal(2), F::Reciprocal(3), F::Reciprocal(4),
        F::Exponential(1), F::Exponential(2), F::Exponential(3), F::Exponential(4),
        F::Logarithm(1), F::Logarithm(2), F::Logarithm(3), F::Logarithm(4),
        F::Sine(1), F::Sine(2), F::Sine(3), F::Sine(4),
        F::Cosine(1), F::Cosine(2), F::Cosine(3), F::Cosine(4),
        F::HyperbolicCosine, F::HyperbolicSine,
        F::Arcsine, F::ArcsineOfUnit, F::Arctangent,
        F::Gaussian,
    ];

    /// The powers `z` to `z^count`.
    ///
    /// # Errors
    /// [`JudgeError::FunctionCount`] for none or more than [`MAX_POWER`](Self::MAX_POWER).
    pub fn powers(count: usize) -> Result<Vec<Self>, JudgeError> {
        match u8::try_from(count) {
            Ok(count @ 1..=Self::MAX_POWER) => Ok((1..=count).map(F::Power).collect()),
            _ => Err(JudgeError::FunctionCount { count }),
        }
    }

    /// The functions of trigonometric moment shadow mapping: cosine and sine of the first `count`
    /// multiples of `2 pi z`, in the order of the supplement's section 7.4.
    ///
    /// # Errors
    /// [`JudgeError::FunctionCount`] for none or more than 4.
    pub fn trigonometric(count: usize) -> Result<Vec<Self>, JudgeError> {
        match u8::try_from(count) {
            Ok(count @ 1..=4) => Ok((1..=count)
                .flat_map(|k| [F::Cosine(k), F::Sine(k)])
                .collect()),
            _ => Err(JudgeError::FunctionCount { count: 2 * count }),
        }
    }

    /// The function's value; finite where [`is_defined`](Self::is_defined) says so, while it does
    /// not overflow.
    #[must_use]
    pub fn eval(self, z: f64) -> f64 {
        match self {
            F::Power(k) => z.powi(k.into()),
            F::Root(2) => z.sqrt(),
            F::Root(3) => z.cbrt(),
            F::Root(k) => z.powf(1.0 / f64::from(k)),
            F::Reciprocal(k) => (z + 1.0).powi(-i32::from(k)),
            F::Exponential(k) => (f64::from(k) * z).exp(),
            F::Logarithm(1) => z.ln_1p(),
            F::Logarithm(k) => (z + f64::from(k)).ln(),
            F::Sine(k) => (f64::from(k) * TAU * z).sin(),
            F::Cosine(k) => (f64::from(k) * TAU * z).cos(),
            F::HyperbolicCosine => z.cosh(),
            F::HyperbolicSine => z.sinh(),
            F::Arcsine => z.asin(),
            F::ArcsineOfUnit => 2.0_f64.mul_add(z, -1.0).asin(),
            F::Arctangent => z.atan(),
            F::Gaussian => (-z * z).exp(),
        }
    }

    /// Whether the function is real and finite at `z`, but for overflow.
    #[must_use]
    pub fn is_defined(self, z: f64) -> bool {
        match self {
            F::Root(_) => z >= 0.0,
            F::Reciprocal(_) => z > -1.0,
            F::Logarithm(k) => z > -f64::from(k),
            F::Arcsine => (-1.0..=1.0).contains(&z),
            F::ArcsineOfUnit => (0.0..=1.0).contains(&z),
            _ => z.is_finite(),
        }
    }
}

impl fmt::Display for DepthFunction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let times = |k: u8| {
            if k == 1 { String::new() } else { k.to_string() }
        };
        let power = |k: u8| {
            if k == 1 {
                String::new()
            } else {
                format!("^{k}")
            }
        };
        match *self {
            F::Power(k) => write!(f, "z{}", power(k)),
            F::Root(k) => write!(f, "z^(1/{k})"),
            F::Reciprocal(k) => write!(f, "1/(z+1){}", power(k)),
            F::Exponential(k) => write!(f, "exp({}z)", times(k)),
            F::Logarithm(k) => write!(f, "log(z+{k})"),
            F::Sine(k) => write!(f, "sin({}pi*z)", 2 * k),
            F::Cosine(k) => write!(f, "cos({}pi*z)", 2 * k),
            F::HyperbolicCosine => f.write_str("cosh(z)"),
            F::HyperbolicSine => f.write_str("sinh(z)"),
            F::Arcsine => f.write_str("asin(z)"),
            F::ArcsineOfUnit => f.write_str("asin(2z-1)"),
            F::Arctangent => f.write_str("atan(z)"),
            F::Gaussian => f.write_str("exp(-z^2)"),
        }
    }
}

impl FromStr for DepthFunction {
    type Err = JudgeError;

    /// Reads a function as it is displayed; spaces do not matter.
    fn from_str(text: &str) -> Result<Self, JudgeError> {
        let text: String = text.chars().filter(|c| !c.is_whitespace()).collect();
        let further = (9..=Self::MAX_POWER).map(F::Power);
        Self::ALL
            .into_iter()
            .chain(further)
            .find(|function| function.to_string() == text)
            .ok_or(JudgeError::UnknownFunction { text })
    }
}
