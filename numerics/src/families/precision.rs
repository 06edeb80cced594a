//! The two number formats that are measured.

use std::fmt;

use bytemuck::Pod;
use hankel_dsl::Real;
use serde::{Deserialize, Serialize};

use crate::numbers::DoubleDouble;

/// A number format.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Precision {
    /// 32 bits.
    F32,
    /// 64 bits.
    F64,
}

impl fmt::Display for Precision {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::F32 => "f32",
            Self::F64 => "f64",
        })
    }
}

/// A number format that kernels compute in.
pub trait Format:
    Real<Mask = bool> + Pod + Default + PartialEq + PartialOrd + fmt::Debug + Send + Sync
{
    /// Which.
    const PRECISION: Precision;
    /// The smallest normal number.
    const LEAST_NORMAL: f64;
    /// Rounded to the nearest.
    fn round(x: f64) -> Self;
    /// Rounded to the nearest.
    fn round_exact(x: DoubleDouble) -> Self;
    /// Exactly.
    fn widen(self) -> f64;
}

impl Format for f32 {
    const PRECISION: Precision = Precision::F32;
    const LEAST_NORMAL: f64 = f32::MIN_POSITIVE as f64;

    #[allow(clippy::cast_possible_truncation, reason = "rounding is what it does")]
    fn round(x: f64) -> Self {
        x as Self
    }

    // By way of f64: the second rounding moves a tie by 2^-53 of its size, which no measure sees.
    fn round_exact(x: DoubleDouble) -> Self {
        <Self as Format>::round(f64::from(x))
    }

    fn widen(self) -> f64 {
        f64::from(self)
    }
}

impl Format for f64 {
    const PRECISION: Precision = Precision::F64;
    const LEAST_NORMAL: f64 = f64::MIN_POSITIVE;

    fn round(x: f64) -> Self {
        x
    }

    fn round_exact(x: DoubleDouble) -> Self {
        Self::from(x)
    }

    fn widen(self) -> f64 {
        self
    }
}
