//! What every comparison of backends is made of: running a case on a device, whatever its stage, and
//! telling how far the numbers are from those of the native scalar run, one invocation after the
//! other, without SIMD lanes. `hankel_matrix` runs the kernels and reports.
//!
//! A kernel without tolerance gives the same bits for all inputs. A tolerance is for inputs as in
//! use; absurd ones, for which no condition is bounded, are then compared in that what is finite
//! in the reference is finite. What the rounding of a sampler's weights does is no part of a tolerance: it
//! is found for each number ([`intervals`]).
//!
//! NaN equals NaN, and zeros are equal whatever their signs. Vertex and fragment stages get no
//! subnormal numbers, and theirs count as zero ([`crate::inputs::flushes`]).

pub mod capture;
pub mod compare;
pub mod execute;
pub mod intervals;
pub mod numbers;
pub mod panics;
pub mod sanitize;
pub mod translate;
