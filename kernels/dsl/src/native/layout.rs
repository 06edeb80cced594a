//! Layout of values in buffers, checked against the shader's rules (std430) and described.
//! `#[derive(Element)]` implements what is here for structures.

use core::mem::MaybeUninit;
use core::slice;
use std::boxed::Box;
use std::string::String;
use std::{format, vec};

use bytemuck::Pod;
use glam::{IVec2, IVec3, IVec4, Mat4, UVec2, UVec3, UVec4, Vec2, Vec3, Vec4};

use super::describe::{Field, Inputs, Layout, Precision, Scalar, Type};
use super::lanes;
use crate::{Bool, F16x2, Real};

/// A value that a buffer can hold: the same bytes on the host and in a shader.
#[diagnostic::on_unimplemented(
    message = "`{Self}` cannot be in a buffer",
    note = "a structure needs `#[derive(Element)]` and `#[repr(C)]`",
    note = "`usize` and enums have no place in a shader's memory: use `u32` or `f32`; for `bool`, use `Bool`; for halves, `F16x2`; for matrices, `Mat4`"
)]
pub trait Element: Pod + Send + Sync {
    /// Alignment in bytes that a shader wants (std430).
    const ALIGN: usize;
    /// Whether an array of it may be in a uniform buffer (its stride is a multiple of 16).
    const UNIFORM_ARRAY: bool;
    /// Whether it is a structure, which begins and ends at a multiple of 16 bytes within another one in a uniform buffer.
    const IS_STRUCTURE: bool = false;
    /// Whether it may be in a uniform buffer.
    const UNIFORM: bool;
    /// Its type.
    fn ty() -> Type;
    /// Its layout as the element of a buffer.
    fn layout() -> Layout {
        match Self::ty() {
            Type::Struct { layout } => layout,
            ty => Layout {
                name: name(&ty),
                size: size_of::<Self>() as u32,
                align: Self::ALIGN as u32,
                fields: vec![Field {
                    name: String::new(),
                    summary: String::new(),
                    offset: 0,
                    size: size_of::<Self>() as u32,
                    ty,
                    inputs: Inputs::default(),
                }],
            },
        }
    }
}

/// The Rust name of a type that is no structure.
fn name(ty: &Type) -> String {
    match ty {
        Type::Scalar { scalar } => scalar.name().into(),
        Type::Vector { scalar, size } => format!("{}x{size}", scalar.name()),
        Type::Array {
            element, length, ..
        } => format!("{}[{length}]", name(element)),
        Type::Struct { layout } => layout.name.clone(),
    }
}

macro_rules! leaf {
    ($($ty:ty, $align:literal, $value:expr;)*) => {$(
        impl Element for $ty {
            const ALIGN: usize = $align;
            const UNIFORM_ARRAY: bool = size_of::<$ty>().is_multiple_of(16);
            const UNIFORM: bool = true;
            fn ty() -> Type {
                $value
            }
        }
    )*};
}

leaf! {
    f32, 4, Type::Scalar { scalar: Scalar::F32 };
    f64, 8, Type::Scalar { scalar: Scalar::F64 };
    u32, 4, Type::Scalar { scalar: Scalar::U32 };
    i32, 4, Type::Scalar { scalar: Scalar::I32 };
    u64, 8, Type::Scalar { scalar: Scalar::U64 };
    i64, 8, Type::Scalar { scalar: Scalar::I64 };
    Bool, 4, Type::Scalar { scalar: Scalar::Bool };
    F16x2, 4, Type::Vector { scalar: Scalar::F16, size: 2 };
    Vec2, 8, Type::Vector { scalar: Scalar::F32, size: 2 };
    Vec3, 16, Type::Vector { scalar: Scalar::F32, size: 3 };
    Vec4, 16, Type::Vector { scalar: Scalar::F32, size: 4 };
    UVec2, 8, Type::Vector { scalar: Scalar::U32, size: 2 };
    UVec3, 16, Type::Vector { scalar: Scalar::U32, size: 3 };
    UVec4, 16, Type::Vector { scalar: Scalar::U32, size: 4 };
    IVec2, 8, Type::Vector { scalar: Scalar::I32, size: 2 };
    IVec3, 16, Type::Vector { scalar: Scalar::I32, size: 3 };
    IVec4, 16, Type::Vector { scalar: Scalar::I32, size: 4 };
}

/// glam's names of a matrix's columns.
pub const COLUMNS: [&str; 4] = ["x_axis", "y_axis", "z_axis", "w_axis"];

/// Its columns: in memory the same as a matrix of every language, which the texts have in its place.
impl Element for Mat4 {
    const ALIGN: usize = 16;
    const UNIFORM_ARRAY: bool = true;
    const UNIFORM: bool = true;
    fn ty() -> Type {
        matrix("Mat4", 4, Vec4::ty())
    }
}

/// A matrix of so many columns of as many `f32`, by glam's name: a structure of its columns, without padding.
pub(super) fn matrix(name: &str, size: usize, column: Type) -> Type {
    let bytes = (size * size_of::<f32>()) as u32;
    let columns = COLUMNS[..size].iter().zip(0..).map(|(name, i)| Field {
        name: (*name).into(),
        summary: String::new(),
        ty: column.clone(),
        offset: i * bytes,
        size: bytes,
        inputs: Inputs::default(),
    });
    Type::Struct {
        layout: Layout {
            name: name.into(),
            size: bytes * size as u32,
            align: if size == 4 { 16 } else { 4 },
            fields: columns.collect(),
        },
    }
}

// SAFETY: a transparent `u32`, of which every bit pattern is a value.
unsafe impl bytemuck::Zeroable for Bool {}
// SAFETY: see above.
unsafe impl Pod for Bool {}

// SAFETY: a transparent `u32`, of which every bit pattern is a value.
unsafe impl bytemuck::Zeroable for F16x2 {}
// SAFETY: see above.
unsafe impl Pod for F16x2 {}

impl<T: Element, const N: usize> Element for [T; N]
where
    Self: Pod,
{
    const ALIGN: usize = T::ALIGN;
    const UNIFORM_ARRAY: bool = T::UNIFORM_ARRAY;
    const UNIFORM: bool = T::UNIFORM && T::UNIFORM_ARRAY;
    fn ty() -> Type {
        Type::Array {
            element: Box::new(T::ty()),
            length: N as u32,
            stride: size_of::<T>() as u32,
        }
    }
}

/// `value` rounded up to a multiple of `align`.
#[doc(hidden)]
#[must_use]
pub const fn round_up(value: usize, align: usize) -> usize {
    value.div_ceil(align) * align
}

/// The scalar of an integer with atomic operations.
#[doc(hidden)]
pub trait AtomicScalar: crate::AtomicInteger {
    /// Which.
    const SCALAR: Scalar;
}

impl AtomicScalar for u32 {
    const SCALAR: Scalar = Scalar::U32;
}

impl AtomicScalar for i32 {
    const SCALAR: Scalar = Scalar::I32;
}

/// The precision of a scalar type.
#[doc(hidden)]
pub trait HasPrecision {
    /// Which.
    const PRECISION: Precision;
}

impl HasPrecision for f32 {
    const PRECISION: Precision = Precision::F32;
}

impl HasPrecision for f64 {
    const PRECISION: Precision = Precision::F64;
}

/// Several values of a scalar type at once; see [`super::lanes`].
///
/// # Safety
///
/// [`Lane::columns`] fills all columns.
pub unsafe trait Lane: Real {
    /// What one lane holds.
    type Scalar: Real + Pod;
    /// Number of lanes.
    const LANES: usize;
    /// Every lane holds `value`.
    fn splat(value: Self::Scalar) -> Self;
    /// The columns of `rows`, one row for each lane, whose columns are its scalars. Which lane has which row is the same
    /// for all tables. `columns` has as many as a row has scalars.
    fn columns<T: Pod>(rows: &[T], columns: &mut [MaybeUninit<Self>]);
    /// And back.
    fn put_columns<T: Pod>(columns: &[Self], rows: &mut [T]);
}

/// A value over scalars of type `S` that has a counterpart over lanes of `S`.
///
/// # Safety
///
/// The value is laid out as an array of `S`, and the counterpart as an array of lanes with as many elements.
#[diagnostic::on_unimplemented(
    message = "`{Self}` cannot be spread over SIMD lanes",
    note = "every field of an element or an output of a kernel that is generic over `Real` must be the generic type, an array of it, or a structure of it"
)]
pub unsafe trait Lanewise<S: Real + Pod>: Pod {
    /// The counterpart.
    type Over<L: Real>;

    /// Each lane holds one of `rows`, as many as there are lanes. Which one, is up to `L`.
    #[inline(always)]
    fn load<L: Lane<Scalar = S>>(rows: &[Self]) -> Self::Over<L> {
        let mut over = MaybeUninit::<Self::Over<L>>::uninit();
        let count = const { scalars::<Self, L, Self::Over<L>>() };
        // SAFETY: the counterpart is an array of so many lanes.
        let columns = unsafe { slice::from_raw_parts_mut(over.as_mut_ptr().cast(), count) };
        let rows = &rows[..L::LANES];
        lanes::fetch_next(rows);
        L::columns(rows, columns);
        // SAFETY: `Lane::columns` filled all of them.
        unsafe { over.assume_init() }
    }
    /// Each of `rows` becomes what its lane holds: the one of that row in [`Lanewise::load`].
    #[inline(always)]
    fn store<L: Lane<Scalar = S>>(over: &Self::Over<L>, rows: &mut [Self]) {
        let count = const { scalars::<Self, L, Self::Over<L>>() };
        // SAFETY: the counterpart is an array of so many lanes.
        let columns = unsafe { slice::from_raw_parts(core::ptr::from_ref(over).cast(), count) };
        L::put_columns(columns, &mut rows[..L::LANES]);
    }
}

/// How many scalars a value of `T` has, and so how many lanes `Over`, its counterpart.
const fn scalars<T, L: Lane, Over>() -> usize {
    let count = size_of::<T>() / size_of::<L::Scalar>();
    assert!(size_of::<Over>() == count * size_of::<L>());
    count
}

/// A value that is the same for all lanes.
pub trait Splat<S: Real>: Copy {
    /// The counterpart of [`Lanewise::Over`].
    type Over<L: Real>;
    /// The value in every lane.
    fn splat<L: Lane<Scalar = S>>(self) -> Self::Over<L>;
}

// SAFETY: an array of such values is laid out as theirs, one after another.
unsafe impl<S: Real + Pod, T: Lanewise<S>, const N: usize> Lanewise<S> for [T; N]
where
    Self: Pod,
{
    type Over<L: Real> = [T::Over<L>; N];
}

macro_rules! scalar {
    ($($float:ty),*) => {$(
        // SAFETY: one scalar, one lane.
        unsafe impl Lanewise<$float> for $float {
            type Over<L: Real> = L;
        }
        impl Splat<$float> for $float {
            type Over<L: Real> = L;
            #[inline(always)]
            fn splat<L: Lane<Scalar = $float>>(self) -> L {
                L::splat(self)
            }
        }
        impl Splat<$float> for u32 {
            type Over<L: Real> = u32;
            #[inline(always)]
            fn splat<L: Lane<Scalar = $float>>(self) -> u32 {
                self
            }
        }
        impl Splat<$float> for i32 {
            type Over<L: Real> = i32;
            #[inline(always)]
            fn splat<L: Lane<Scalar = $float>>(self) -> i32 {
                self
            }
        }
        impl Splat<$float> for F16x2 {
            type Over<L: Real> = F16x2;
            #[inline(always)]
            fn splat<L: Lane<Scalar = $float>>(self) -> F16x2 {
                self
            }
        }
        impl Splat<$float> for Bool {
            type Over<L: Real> = Bool;
            #[inline(always)]
            fn splat<L: Lane<Scalar = $float>>(self) -> Bool {
                self
            }
        }
    )*};
}

scalar!(f32, f64);
