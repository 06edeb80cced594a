//! Bounds for two, four, six, eight, ten and twelve power moments and a free total, and their derivatives,
//! as maps over rows of moments: `moment_bound_n2` is for N = 2, moments `m0` to `m4`.
//!
//! Compensated ones are in error by about what rounding the numbers of a row once does, for the kinds of rows that
//! `hankel stress` draws.

use hankel_dsl::{Element, Real, kernel};
use hankel_moments::{
    Gradient, MAX_MOMENTS, bias_target, bound, bound_adjoint, bound_adjoint_compensated,
    bound_compensated, mix_bias, mix_bias_adjoint,
};

/// How bounds are taken.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct BoundSettings<R> {
    /// Where between the lower bound, 0, and the upper bound, 1.
    #[range(0.0..=1.0)]
    #[default(0)]
    pub overestimation: R,
    /// Share of the moments, from 0 to 1, that is replaced by a fixed distribution's on [-1, 1].
    #[magnitude(1e-7..=1e-2)]
    #[default(0)]
    pub bias: R,
}

/// A bound.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Bound<R> {
    /// How much of the total `m0` lies below the query point, from 0 to `m0`.
    pub bound: R,
}

#[inline(always)]
fn biased<R: Real, const N: usize>(
    m: [R; MAX_MOMENTS],
    settings: &BoundSettings<R>,
) -> [R; MAX_MOMENTS] {
    mix_bias::<R, N>(m, bias_target::<R, N>(), settings.bias)
}

/// The structures and entry points for one N.
macro_rules! order {
    (
        $n:literal; $($m:ident $d_m:ident $k:literal),*;
        $Row:ident, $AdjointRow:ident, $Derivative:ident; $rows:ident, $adjoint_rows:ident;
        $(#[$bound_doc:meta])* $bound:ident,
        $(#[$adjoint_doc:meta])* $adjoint:ident,
        $(#[$compensated_doc:meta])* $compensated:ident,
        $(#[$both_doc:meta])* $both:ident
    ) => {
        /// Moments and a query point.
        #[derive(Clone, Copy, Debug, PartialEq, Element)]
        #[repr(C)]
        pub struct $Row<R> {
            $(
                /// The moment of that order: weights times powers of depths, summed.
                pub $m: R,
            )*
            /// The query point.
            pub eta: R,
        }

        impl<R: Real> $Row<R> {
            #[inline(always)]
            fn moments(&self) -> [R; MAX_MOMENTS] {
                let mut m = [R::literal::<0>(); MAX_MOMENTS];
                $(m[$k] = self.$m;)*
                m
            }
        }

        /// Moments, a query point, and the upstream gradient.
        #[derive(Clone, Copy, Debug, PartialEq, Element)]
        #[repr(C)]
        pub struct $AdjointRow<R> {
            $(
                /// The moment of that order: weights times powers of depths, summed.
                pub $m: R,
            )*
            /// The query point.
            pub eta: R,
            /// The upstream gradient: the derivative of a result by the bound.
            pub d_bound: R,
        }

        impl<R: Real> $AdjointRow<R> {
            #[inline(always)]
            fn moments(&self) -> [R; MAX_MOMENTS] {
                let mut m = [R::literal::<0>(); MAX_MOMENTS];
                $(m[$k] = self.$m;)*
                m
            }
        }

        /// The gradient of a result.
        #[derive(Clone, Copy, Debug, PartialEq, Element)]
        #[repr(C)]
        pub struct $Derivative<R> {
            $(
                /// To the moment of that order.
                pub $d_m: R,
            )*
            /// To the query point.
            pub d_eta: R,
        }

        impl<R: Real> $Derivative<R> {
            /// From the gradient to biased moments.
            #[inline(always)]
            fn new(d: Gradient<R>, settings: &BoundSettings<R>) -> Self {
                let target = bias_target::<R, $n>();
                let d_m = mix_bias_adjoint::<R, $n>(d.m, target, settings.bias);
                Self {
                    $($d_m: d_m[$k],)*
                    d_eta: d.eta,
                }
            }
        }

        $(#[$bound_doc])*
        #[kernel(
            compute,
            threads(64),
            precision(f32, f64),
            pinned,
            compensated = $compensated,
            inputs = crate::inputs::$rows
        )]
        pub fn $bound<R: Real>(
            #[uniform] settings: &BoundSettings<R>,
            #[element] row: $Row<R>,
        ) -> Bound<R> {
            let m = biased::<R, $n>(row.moments(), settings);
            Bound {
                bound: bound::<R, $n>(m, row.eta).blend(settings.overestimation),
            }
        }

        $(#[$compensated_doc])*
        #[kernel(
            compute,
            threads(64),
            precision(f32, f64),
            pinned,
            inputs = crate::inputs::$rows,
            parity(
                absolute = 2e-45,
                why = "shaders take a product's error from partial products, which may overflow or underflow beyond the range that the bounds are stated for: one subnormal step"
            )
        )]
        pub fn $compensated<R: Real>(
            #[uniform] settings: &BoundSettings<R>,
            #[element] row: $Row<R>,
        ) -> Bound<R> {
            let m = biased::<R, $n>(row.moments(), settings);
            Bound {
                bound: bound_compensated::<R, $n>(m, row.eta).blend(settings.overestimation),
            }
        }

        $(#[$adjoint_doc])*
        #[kernel(
            compute,
            threads(64),
            precision(f32, f64),
            pinned,
            compensated = $both,
            inputs = crate::inputs::$adjoint_rows,
            parity(
                absolute = 1e-12,
                why = "factors of derivatives close to 0 may underflow"
            )
        )]
        pub fn $adjoint<R: Real>(
            #[uniform] settings: &BoundSettings<R>,
            #[element] row: $AdjointRow<R>,
        ) -> $Derivative<R> {
            let m = biased::<R, $n>(row.moments(), settings);
            let d = bound_adjoint::<R, $n>(
                m,
                row.eta,
                settings.overestimation,
                row.d_bound,
            );
            $Derivative::new(d, settings)
        }

        $(#[$both_doc])*
        #[kernel(
            compute,
            threads(64),
            precision(f32, f64),
            pinned,
            inputs = crate::inputs::$adjoint_rows,
            parity(
                absolute = 1e-12,
                why = "factors of derivatives close to 0 may underflow"
            )
        )]
        pub fn $both<R: Real>(
            #[uniform] settings: &BoundSettings<R>,
            #[element] row: $AdjointRow<R>,
        ) -> $Derivative<R> {
            let m = biased::<R, $n>(row.moments(), settings);
            let d = bound_adjoint_compensated::<R, $n>(
                m,
                row.eta,
                settings.overestimation,
                row.d_bound,
            );
            $Derivative::new(d, settings)
        }
    };
}

order! {
    1; m0 d_m0 0, m1 d_m1 1, m2 d_m2 2;
    Row1, AdjointRow1, Derivative1; rows_1, adjoint_rows_1;
    /// Bound on the amount below a query point, from two power moments and their total.
    moment_bound_n1,
    /// Derivatives of the bound from two power moments and their total, times `d_bound`.
    moment_bound_adjoint_n1,
    /// Bound on the amount below a query point, from two power moments and their total, with what
    /// is ill-conditioned in about twice the digits.
    moment_bound_compensated_n1,
    /// Derivatives of the bound from two power moments and their total, times `d_bound`, with what is
    /// ill-conditioned in about twice the digits.
    moment_bound_adjoint_compensated_n1
}

order! {
    2; m0 d_m0 0, m1 d_m1 1, m2 d_m2 2, m3 d_m3 3, m4 d_m4 4;
    Row2, AdjointRow2, Derivative2; rows_2, adjoint_rows_2;
    /// Bound on the amount below a query point, from four power moments and their total.
    moment_bound_n2,
    /// Derivatives of the bound from four power moments and their total, times `d_bound`.
    moment_bound_adjoint_n2,
    /// Bound on the amount below a query point, from four power moments and their total, with what
    /// is ill-conditioned in about twice the digits.
    moment_bound_compensated_n2,
    /// Derivatives of the bound from four power moments and their total, times `d_bound`, with what is
    /// ill-conditioned in about twice the digits.
    moment_bound_adjoint_compensated_n2
}

order! {
    3; m0 d_m0 0, m1 d_m1 1, m2 d_m2 2, m3 d_m3 3, m4 d_m4 4, m5 d_m5 5, m6 d_m6 6;
    Row3, AdjointRow3, Derivative3; rows_3, adjoint_rows_3;
    /// Bound on the amount below a query point, from six power moments and their total.
    moment_bound_n3,
    /// Derivatives of the bound from six power moments and their total, times `d_bound`.
    moment_bound_adjoint_n3,
    /// Bound on the amount below a query point, from six power moments and their total, with what
    /// is ill-conditioned in about twice the digits.
    moment_bound_compensated_n3,
    /// Derivatives of the bound from six power moments and their total, times `d_bound`, with what is
    /// ill-conditioned in about twice the digits.
    moment_bound_adjoint_compensated_n3
}

order! {
    4; m0 d_m0 0, m1 d_m1 1, m2 d_m2 2, m3 d_m3 3, m4 d_m4 4, m5 d_m5 5, m6 d_m6 6, m7 d_m7 7, m8 d_m8 8;
    Row4, AdjointRow4, Derivative4; rows_4, adjoint_rows_4;
    /// Bound on the amount below a query point, from eight power moments and their total.
    moment_bound_n4,
    /// Derivatives of the bound from eight power moments and their total, times `d_bound`.
    moment_bound_adjoint_n4,
    /// Bound on the amount below a query point, from eight power moments and their total, with what
    /// is ill-conditioned in about twice the digits.
    moment_bound_compensated_n4,
    /// Derivatives of the bound from eight power moments and their total, times `d_bound`, with what is
    /// ill-conditioned in about twice the digits.
    moment_bound_adjoint_compensated_n4
}

order! {
    5; m0 d_m0 0, m1 d_m1 1, m2 d_m2 2, m3 d_m3 3, m4 d_m4 4, m5 d_m5 5, m6 d_m6 6, m7 d_m7 7, m8 d_m8 8, m9 d_m9 9, m10 d_m10 10;
    Row5, AdjointRow5, Derivative5; rows_5, adjoint_rows_5;
    /// Bound on the amount below a query point, from ten power moments and their total.
    moment_bound_n5,
    /// Derivatives of the bound from ten power moments and their total, times `d_bound`.
    moment_bound_adjoint_n5,
    /// Bound on the amount below a query point, from ten power moments and their total, with what
    /// is ill-conditioned in about twice the digits.
    moment_bound_compensated_n5,
    /// Derivatives of the bound from ten power moments and their total, times `d_bound`, with what is
    /// ill-conditioned in about twice the digits.
    moment_bound_adjoint_compensated_n5
}

order! {
    6; m0 d_m0 0, m1 d_m1 1, m2 d_m2 2, m3 d_m3 3, m4 d_m4 4, m5 d_m5 5, m6 d_m6 6, m7 d_m7 7, m8 d_m8 8, m9 d_m9 9, m10 d_m10 10, m11 d_m11 11, m12 d_m12 12;
    Row6, AdjointRow6, Derivative6; rows_6, adjoint_rows_6;
    /// Bound on the amount below a query point, from twelve power moments and their total.
    moment_bound_n6,
    /// Derivatives of the bound from twelve power moments and their total, times `d_bound`.
    moment_bound_adjoint_n6,
    /// Bound on the amount below a query point, from twelve power moments and their total, with what
    /// is ill-conditioned in about twice the digits.
    moment_bound_compensated_n6,
    /// Derivatives of the bound from twelve power moments and their total, times `d_bound`, with what is
    /// ill-conditioned in about twice the digits.
    moment_bound_adjoint_compensated_n6
}
