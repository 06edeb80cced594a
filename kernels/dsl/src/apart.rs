//! Functions that are compiled once natively, and not into each of their callers.

/// A call that is a function of its own natively, where the condition holds, and part of its caller elsewhere:
/// `apart!(R, if N > 3, bound::<R, N>(m, eta))`.
///
/// Functions over a [`Real`](crate::Real) are `#[inline(always)]`: operations on lanes must be compiled for their
/// instruction set, and a shader's locals are no memory. Of long functions that costs time: what several kernels share
/// is compiled for each of them, and LLVM's time grows with the square of a function's length. A call that is apart is
/// compiled once for each type of number, with its instruction set. In a shader it stays part of the caller.
///
/// The condition is a constant. A call costs a few nanoseconds, since arguments and results are in memory: put calls
/// apart that take longer than that by far. Arguments are copied or moved.
///
/// ```
/// use hankel_dsl::{Real, apart};
/// #[inline(always)]
/// fn cube<R: Real>(x: R) -> R {
///     x * x * x
/// }
/// fn both<R: Real, const N: usize>(x: R) -> R {
///     apart!(R, if N > 3, cube(x)) + apart!(R, if N > 3, cube(-x))
/// }
/// assert_eq!(both::<f32, 4>(2.0), 0.0);
/// ```
#[macro_export]
macro_rules! apart {
    ($R:ty, if $condition:expr, $call:expr) => {{
        #[cfg(target_arch = "spirv")]
        {
            $call
        }
        #[cfg(not(target_arch = "spirv"))]
        if const { $condition } {
            <$R as $crate::Real>::apart(
                #[inline(always)]
                move || $call,
            )
        } else {
            $call
        }
    }};
}
