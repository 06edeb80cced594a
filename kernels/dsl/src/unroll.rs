//! Loops without a loop.

/// Repeats a block for each index of a range that is known when the kernel is compiled, up to 0..16.
/// Inside, the index is a constant. There is no `break` and no `continue`.
///
/// The compiler reads the block once for every index that there might be. Where such blocks stand
/// within each other, say how far the range can go, 7 or 13: `unroll!(i in 0..N, max 7, { … })`.
/// Three of them within each other, or two around a long block, belong into functions with a const
/// parameter for the outer index: an incremental build's time grows with the square of a function's copies.
///
/// A long block may be too much for a shader compiler, and for a GPU's instruction cache, when it is repeated dozens of
/// times. With a condition, `unroll!(i in 0..N, max 7, loop if N > 3, { … })`, it is a loop in a shader where that holds,
/// and natively as without. The block must then be right for an index that is no constant: `if` in place of `if const`,
/// and [`array_element`](crate::array_element) and [`array_element_mut`](crate::array_element_mut) for arrays.
///
/// A shader that indexes a local array dynamically spills it to memory, and rust-gpu's loops are
/// ones that shader compilers rarely unroll. With this, arrays of a few numbers become plain
/// variables.
///
/// ```
/// use hankel_dsl::{Real, unroll};
/// fn sum<R: Real, const N: usize>(x: [R; N]) -> R {
///     let mut total = x[0];
///     unroll!(i in 1..N, {
///         total += x[i];
///     });
///     total
/// }
/// assert_eq!(sum([1.0_f32, 2.0, 3.0]), 6.0);
/// ```
#[macro_export]
macro_rules! unroll {
    ($i:ident in $from:tt .. $to:expr, max $max:tt, loop if $condition:expr, $body:block) => {
        if const { cfg!(target_arch = "spirv") && $condition } {
            let mut $i: usize = $from;
            while $i < $to {
                $body
                $i += 1;
            }
        } else {
            $crate::unroll!($i in $from .. $to, max $max, $body);
        }
    };
    ($i:ident in $from:tt .. $to:expr, max 7, $body:block) => {
        $crate::unroll!(@each $i, $from, $to, $body, 7, 0 1 2 3 4 5 6)
    };
    ($i:ident in $from:tt .. $to:expr, max 13, $body:block) => {
        $crate::unroll!(@each $i, $from, $to, $body, 13, 0 1 2 3 4 5 6 7 8 9 10 11 12)
    };
    ($i:ident in $from:tt .. $to:expr, $body:block) => {
        $crate::unroll!(@each $i, $from, $to, $body, 16, 0 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15)
    };
    (@each $i:ident, $from:expr, $to:expr, $body:block, $max:literal, $($index:tt)*) => {{
        const { assert!($to <= $max, "unroll! goes up to 16, or to what max says") };
        $(
            #[allow(
                unused_comparisons,
                unconditional_panic,
                arithmetic_overflow,
                unused_assignments,
                clippy::out_of_bounds_indexing,
                clippy::absurd_extreme_comparisons,
                reason = "what is beyond the range is never reached, and after the last index \
                          nothing is read"
            )]
            if const { $index >= $from && $index < $to } {
                #[allow(non_upper_case_globals, reason = "it stands for a variable")]
                const $i: usize = $index;
                $body
            }
        )*
    }};
}
