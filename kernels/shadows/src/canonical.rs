//! The points and weights of the distribution that attains the bounds, and derivatives of what depends on them, as
//! maps over rows of moments: `canonical_n2` is for N = 2, moments `m0` to `m4`.

use hankel_dsl::{Element, Real, kernel};
use hankel_moments::{
    Canonical, MAX_MOMENTS, bias_target, canonical, canonical_adjoint, mix_bias, mix_bias_adjoint,
};

use crate::moment_bounds::{
    Derivative1, Derivative2, Derivative3, Derivative4, Derivative5, Derivative6, Row1, Row2, Row3,
    Row4, Row5, Row6,
};

/// Which moments are meant.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct CanonicalSettings<R> {
    /// Share of the moments, from 0 to 1, that is replaced by a fixed distribution's on [-1, 1].
    #[magnitude(1e-7..=1e-2)]
    #[default(0)]
    pub bias: R,
}

/// The structure and entry points for one N.
macro_rules! order {
    (
        $n:literal; $($m:ident $d_m:ident $k:literal),*; $($reciprocal:ident $weight:ident $i:literal),*;
        $Row:ident, $Derivative:ident, $Canonical:ident; $rows:ident, $adjoint_rows:ident;
        $(#[$doc:meta])* $canonical:ident,
        $(#[$adjoint_doc:meta])* $adjoint:ident
    ) => {
        /// Points and weights, the query point among them, or the upstream gradient to each of these numbers.
        #[derive(Clone, Copy, Debug, PartialEq, Element)]
        #[repr(C)]
        pub struct $Canonical<R> {
            $(
                /// The reciprocal of that point's distance from the query point, in ascending order: the point is
                /// at `eta + 1 / reciprocal`, at infinity for 0.
                pub $reciprocal: R,
            )*
            $(
                /// That point's weight, from 0 to `m0`.
                pub $weight: R,
            )*
            /// The query point's weight.
            pub own: R,
        }

        $(#[$doc])*
        #[kernel(
            compute,
            threads(64),
            precision(f32, f64),
            pinned,
            scalar,
            inputs = crate::inputs::canonical::$rows
        )]
        pub fn $canonical<R: Real>(
            #[uniform] settings: &CanonicalSettings<R>,
            #[element] row: $Row<R>,
        ) -> $Canonical<R> {
            let mut m = [R::literal::<0>(); MAX_MOMENTS];
            $(m[$k] = row.$m;)*
            let m = mix_bias::<R, $n>(m, bias_target::<R, $n>(), settings.bias);
            let found = canonical::<R, $n>(m, row.eta);
            $Canonical {
                $($reciprocal: found.reciprocals[$i],)*
                $($weight: found.weights[$i],)*
                own: found.own,
            }
        }

        $(#[$adjoint_doc])*
        #[kernel(
            compute,
            threads(64),
            precision(f32, f64),
            pinned,
            scalar,
            inputs = crate::inputs::canonical::$adjoint_rows
        )]
        pub fn $adjoint<R: Real>(
            #[uniform] settings: &CanonicalSettings<R>,
            #[element] row: $Row<R>,
            #[element] upstream: $Canonical<R>,
        ) -> $Derivative<R> {
            let target = bias_target::<R, $n>();
            let mut m = [R::literal::<0>(); MAX_MOMENTS];
            $(m[$k] = row.$m;)*
            let m = mix_bias::<R, $n>(m, target, settings.bias);
            let mut d = Canonical::none();
            $(
                d.reciprocals[$i] = upstream.$reciprocal;
                d.weights[$i] = upstream.$weight;
            )*
            d.own = upstream.own;
            let d = canonical_adjoint::<R, $n>(m, row.eta, d);
            let d_m = mix_bias_adjoint::<R, $n>(d.m, target, settings.bias);
            $Derivative {
                $($d_m: d_m[$k],)*
                d_eta: d.eta,
            }
        }
    };
}

order! {
    1; m0 d_m0 0, m1 d_m1 1, m2 d_m2 2;
    reciprocal_0 weight_0 0;
    Row1, Derivative1, Canonical1; rows_1, adjoint_rows_1;
    /// The distribution with two power moments and their total that contains the query point: one other point.
    canonical_n1,
    /// Derivatives of what depends on points and weights of `canonical_n1`, from those to each of them.
    canonical_adjoint_n1
}

order! {
    2; m0 d_m0 0, m1 d_m1 1, m2 d_m2 2, m3 d_m3 3, m4 d_m4 4;
    reciprocal_0 weight_0 0, reciprocal_1 weight_1 1;
    Row2, Derivative2, Canonical2; rows_2, adjoint_rows_2;
    /// The distribution with four power moments and their total that contains the query point: two other points.
    canonical_n2,
    /// Derivatives of what depends on points and weights of `canonical_n2`, from those to each of them.
    canonical_adjoint_n2
}

order! {
    3; m0 d_m0 0, m1 d_m1 1, m2 d_m2 2, m3 d_m3 3, m4 d_m4 4, m5 d_m5 5, m6 d_m6 6;
    reciprocal_0 weight_0 0, reciprocal_1 weight_1 1, reciprocal_2 weight_2 2;
    Row3, Derivative3, Canonical3; rows_3, adjoint_rows_3;
    /// The distribution with six power moments and their total that contains the query point: three other points.
    canonical_n3,
    /// Derivatives of what depends on points and weights of `canonical_n3`, from those to each of them.
    canonical_adjoint_n3
}

order! {
    4; m0 d_m0 0, m1 d_m1 1, m2 d_m2 2, m3 d_m3 3, m4 d_m4 4, m5 d_m5 5, m6 d_m6 6, m7 d_m7 7, m8 d_m8 8;
    reciprocal_0 weight_0 0, reciprocal_1 weight_1 1, reciprocal_2 weight_2 2, reciprocal_3 weight_3 3;
    Row4, Derivative4, Canonical4; rows_4, adjoint_rows_4;
    /// The distribution with eight power moments and their total that contains the query point: four other points.
    canonical_n4,
    /// Derivatives of what depends on points and weights of `canonical_n4`, from those to each of them.
    canonical_adjoint_n4
}

order! {
    5; m0 d_m0 0, m1 d_m1 1, m2 d_m2 2, m3 d_m3 3, m4 d_m4 4, m5 d_m5 5, m6 d_m6 6, m7 d_m7 7, m8 d_m8 8, m9 d_m9 9, m10 d_m10 10;
    reciprocal_0 weight_0 0, reciprocal_1 weight_1 1, reciprocal_2 weight_2 2, reciprocal_3 weight_3 3, reciprocal_4 weight_4 4;
    Row5, Derivative5, Canonical5; rows_5, adjoint_rows_5;
    /// The distribution with ten power moments and their total that contains the query point: five other points.
    canonical_n5,
    /// Derivatives of what depends on points and weights of `canonical_n5`, from those to each of them.
    canonical_adjoint_n5
}

order! {
    6; m0 d_m0 0, m1 d_m1 1, m2 d_m2 2, m3 d_m3 3, m4 d_m4 4, m5 d_m5 5, m6 d_m6 6, m7 d_m7 7, m8 d_m8 8, m9 d_m9 9, m10 d_m10 10, m11 d_m11 11, m12 d_m12 12;
    reciprocal_0 weight_0 0, reciprocal_1 weight_1 1, reciprocal_2 weight_2 2, reciprocal_3 weight_3 3, reciprocal_4 weight_4 4, reciprocal_5 weight_5 5;
    Row6, Derivative6, Canonical6; rows_6, adjoint_rows_6;
    /// The distribution with twelve power moments and their total that contains the query point: six other points.
    canonical_n6,
    /// Derivatives of what depends on points and weights of `canonical_n6`, from those to each of them.
    canonical_adjoint_n6
}
