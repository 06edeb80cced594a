//! How many operations a kernel does: its own source, run with numbers that count.

use std::cell::Cell;
use std::hint::black_box;
use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

use hankel_dsl::Real;
use hankel_dsl::native::layout::{Lane, Lanewise, Splat};
use hankel_shadows::moment_bounds as kernels;
use serde::{Deserialize, Serialize};

use crate::families::{Format, Row};

/// Operations on numbers. Of what only moves them, nothing is counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Operations {
    /// Sums and differences.
    pub sums: f64,
    /// Products.
    pub products: f64,
    /// Products whose rounding error is taken by one fused operation, where there is one.
    pub fused: f64,
    /// Quotients.
    pub quotients: f64,
    /// Square roots.
    pub roots: f64,
    /// Comparisons, minima and maxima.
    pub comparisons: f64,
    /// Selections.
    pub selections: f64,
    /// Changes of sign, magnitudes, roundings to whole numbers.
    pub others: f64,
}

impl Operations {
    /// All that are not quotients or roots: an instruction each, as fast as a sum.
    #[must_use]
    pub fn simple(&self) -> f64 {
        self.sums + self.products + self.fused + self.comparisons + self.selections + self.others
    }

    /// Floating-point operations as they are usually counted: sums, products, quotients and roots,
    /// and two for a fused one.
    #[must_use]
    pub fn flops(&self) -> f64 {
        self.sums + self.products + 2.0 * self.fused + self.quotients + self.roots
    }

    fn map2(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        Self {
            sums: f(self.sums, other.sums),
            products: f(self.products, other.products),
            fused: f(self.fused, other.fused),
            quotients: f(self.quotients, other.quotients),
            roots: f(self.roots, other.roots),
            comparisons: f(self.comparisons, other.comparisons),
            selections: f(self.selections, other.selections),
            others: f(self.others, other.others),
        }
    }
}

thread_local! {
    static COUNT: Cell<Operations> = const { Cell::new(Operations {
        sums: 0.0, products: 0.0, fused: 0.0, quotients: 0.0,
        roots: 0.0, comparisons: 0.0, selections: 0.0, others: 0.0,
    }) };
}

fn count(f: impl FnOnce(&mut Operations)) {
    COUNT.with(|cell| {
        let mut operations = cell.get();
        f(&mut operations);
        cell.set(operations);
    });
}

/// What `f` does with [`Counted`] numbers, on this thread.
pub fn operations_of<T>(f: impl FnOnce() -> T) -> Operations {
    let before = COUNT.with(Cell::get);
    black_box(f());
    COUNT.with(Cell::get).map2(before, |after, before| after - before)
}

/// A number that counts what is done to it, on the thread where it is done.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub struct Counted<R>(
    /// The value.
    pub R,
);

macro_rules! operators {
    ($($operator:ident $function:ident $field:ident),*) => {$(
        impl<R: Real> $operator for Counted<R> {
            type Output = Self;
            fn $function(self, other: Self) -> Self {
                count(|o| o.$field += 1.0);
                Self(self.0.$function(other.0))
            }
        }
    )*};
    ($($operator:ident $function:ident by $with:ident),*) => {$(
        impl<R: Real> $operator for Counted<R> {
            fn $function(&mut self, other: Self) {
                *self = self.$with(other);
            }
        }
    )*};
}

operators!(Add add sums, Sub sub sums, Mul mul products, Div div quotients);
operators!(AddAssign add_assign by add, SubAssign sub_assign by sub, MulAssign mul_assign by mul);

impl<R: Real> Neg for Counted<R> {
    type Output = Self;
    fn neg(self) -> Self {
        count(|o| o.others += 1.0);
        Self(-self.0)
    }
}

impl<R: Real> Real for Counted<R> {
    type Mask = R::Mask;

    fn literal<const BITS: u64>() -> Self {
        Self(R::literal::<BITS>())
    }
    fn epsilon() -> Self {
        Self(R::epsilon())
    }
    fn sqrt(self) -> Self {
        count(|o| o.roots += 1.0);
        Self(self.0.sqrt())
    }
    fn abs(self) -> Self {
        count(|o| o.others += 1.0);
        Self(self.0.abs())
    }
    fn floor(self) -> Self {
        count(|o| o.others += 1.0);
        Self(self.0.floor())
    }
    fn min(self, other: Self) -> Self {
        count(|o| o.comparisons += 1.0);
        Self(self.0.min(other.0))
    }
    fn max(self, other: Self) -> Self {
        count(|o| o.comparisons += 1.0);
        Self(self.0.max(other.0))
    }
    fn lt(self, other: Self) -> R::Mask {
        count(|o| o.comparisons += 1.0);
        self.0.lt(other.0)
    }
    fn le(self, other: Self) -> R::Mask {
        count(|o| o.comparisons += 1.0);
        self.0.le(other.0)
    }
    fn eq(self, other: Self) -> R::Mask {
        count(|o| o.comparisons += 1.0);
        self.0.eq(other.0)
    }
    fn select(mask: R::Mask, a: Self, b: Self) -> Self {
        count(|o| o.selections += 1.0);
        Self(R::select(mask, a.0, b.0))
    }
    fn two_sum(self, other: Self) -> (Self, Self) {
        count(|o| o.sums += 6.0);
        let (sum, error) = self.0.two_sum(other.0);
        (Self(sum), Self(error))
    }
    fn two_product(self, other: Self) -> (Self, Self) {
        count(|o| {
            o.products += 1.0;
            o.fused += 1.0;
        });
        let (product, error) = self.0.two_product(other.0);
        (Self(product), Self(error))
    }
}

/// One lane: what makes a row of plain numbers into one of counting numbers.
impl<P: Format> Lane for Counted<P> {
    type Scalar = P;
    const LANES: usize = 1;
    fn splat(value: P) -> Self {
        Self(value)
    }
    fn column(table: &[P], _: usize, at: usize) -> Self {
        Self(table[at])
    }
    fn put_column(table: &mut [P], _: usize, at: usize, last: &[Self; 4]) {
        table[at] = last[3].0;
    }
}

/// Mean operations for a row in `f32`; `None` for a function that is no kernel for bounds. Every
/// precision does the same.
#[must_use]
pub fn per_row(function: &str, n: usize, rows: &[Row<f32>]) -> Option<Operations> {
    let settings = Splat::<f32>::splat::<Counted<f32>>(kernels::BoundSettings {
        overestimation: 0.0_f32,
        bias: 0.0,
    });
    macro_rules! kernel {
        ($($kernel:ident $order:literal $Row:ident { $($m:ident $k:literal),* } $($d_bound:ident)?;)*) => {
            match function {
                $(stringify!($kernel) if n == $order => rows
                    .iter()
                    .map(|row| {
                        let plain = kernels::$Row {
                            $($m: row.m[$k],)*
                            eta: row.eta,
                            $($d_bound: 1.0_f32,)?
                        };
                        let counted = Lanewise::<f32>::load::<Counted<f32>>(&[plain]);
                        operations_of(|| kernels::$kernel(&settings, counted))
                    })
                    .fold(Operations::default(), |sum, one| sum.map2(one, |a, b| a + b)),)*
                _ => return None,
            }
        };
    }
    let sum = kernel! {
        moment_bound_n1 1 Row1 { m0 0, m1 1, m2 2 };
        moment_bound_n2 2 Row2 { m0 0, m1 1, m2 2, m3 3, m4 4 };
        moment_bound_n3 3 Row3 { m0 0, m1 1, m2 2, m3 3, m4 4, m5 5, m6 6 };
        moment_bound_n4 4 Row4 { m0 0, m1 1, m2 2, m3 3, m4 4, m5 5, m6 6, m7 7, m8 8 };
        moment_bound_n5 5 Row5 { m0 0, m1 1, m2 2, m3 3, m4 4, m5 5, m6 6, m7 7, m8 8, m9 9, m10 10 };
        moment_bound_compensated_n2 2 Row2 { m0 0, m1 1, m2 2, m3 3, m4 4 };
        moment_bound_compensated_n3 3 Row3 { m0 0, m1 1, m2 2, m3 3, m4 4, m5 5, m6 6 };
        moment_bound_adjoint_n1 1 AdjointRow1 { m0 0, m1 1, m2 2 } d_bound;
        moment_bound_adjoint_n2 2 AdjointRow2 { m0 0, m1 1, m2 2, m3 3, m4 4 } d_bound;
        moment_bound_adjoint_n3 3 AdjointRow3 { m0 0, m1 1, m2 2, m3 3, m4 4, m5 5, m6 6 } d_bound;
        moment_bound_adjoint_n4 4 AdjointRow4 { m0 0, m1 1, m2 2, m3 3, m4 4, m5 5, m6 6, m7 7, m8 8 } d_bound;
        moment_bound_adjoint_n5 5 AdjointRow5 { m0 0, m1 1, m2 2, m3 3, m4 4, m5 5, m6 6, m7 7, m8 8, m9 9, m10 10 } d_bound;
    };
    let count = rows.len().max(1) as f64;
    Some(sum.map2(sum, |a, _| a / count))
}

#[cfg(test)]
mod tests {
    use hankel_dsl::{Real, lit};

    use super::{Counted, Operations, operations_of};

    fn horner<R: Real>(x: R) -> R {
        let root = (x * x + lit!(1.0)).sqrt();
        R::select(x.lt(root), -x, x.max(root) / root)
    }

    #[test]
    fn every_operation_is_counted_once() {
        let counted = operations_of(|| assert_eq!(horner(Counted(2.0_f64)).0, -2.0));
        let expected = Operations {
            sums: 1.0,
            products: 1.0,
            quotients: 1.0,
            roots: 1.0,
            comparisons: 2.0,
            selections: 1.0,
            others: 1.0,
            fused: 0.0,
        };
        assert_eq!(counted, expected);
        assert_eq!(counted.simple(), 6.0);
        assert_eq!(counted.flops(), 4.0);
    }

    #[test]
    fn error_terms_count_as_what_they_take() {
        let counted = operations_of(|| {
            let (a, b) = (Counted(1.0_f32), Counted(1e-9_f32));
            assert_eq!(a.two_sum(b).1.0, 1e-9);
            a.two_product(b)
        });
        assert_eq!(counted.sums, 6.0);
        assert_eq!((counted.products, counted.fused), (1.0, 1.0));
        assert_eq!(counted.flops(), 9.0);
    }
}
