//! Layout of values in buffers, checked against the shader's rules (std430) and described.
//! `#[derive(Element)]` implements what is here for structures.

use std::boxed::Box;
use std::string::String;
use std::{format, vec};

use bytemuck::Pod;
use glam::{IVec2, IVec3, IVec4, UVec2, UVec3, UVec4, Vec2, Vec3, Vec4};

use super::describe::{Field, Layout, Precision, Scalar, Type};
use crate::Real;

/// A value that a buffer can hold: the same bytes on the host and in a shader.
#[diagnostic::on_unimplemented(
    message = "`{Self}` cannot be in a buffer",
    note = "a structure needs `#[derive(Element)]` and `#[repr(C)]`",
    note = "`bool`, `usize`, `f16` and enums have no place in a shader's memory; use `u32` or `f32`"
)]
pub trait Element: Pod + Send + Sync {
    /// Alignment in bytes that a shader wants (std430).
    const ALIGN: usize;
    /// Whether an array of it may be in a uniform buffer (its stride is a multiple of 16).
    const UNIFORM_ARRAY: bool;
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
                }],
            },
        }
    }
}

/// The Rust name of a type that is no structure.
fn name(ty: &Type) -> String {
    let scalar = |s: &Scalar| match s {
        Scalar::F32 => "f32",
        Scalar::F64 => "f64",
        Scalar::U32 => "u32",
        Scalar::I32 => "i32",
    };
    match ty {
        Type::Scalar { scalar: s } => scalar(s).into(),
        Type::Vector { scalar: s, size } => format!("{}x{size}", scalar(s)),
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
pub trait Lane: Real {
    /// What one lane holds.
    type Scalar: Real;
    /// Number of lanes.
    const LANES: usize;
    /// Lane `i` holds `f(i)`.
    fn from_fn(f: impl FnMut(usize) -> Self::Scalar) -> Self;
    /// Every lane holds `value`.
    fn splat(value: Self::Scalar) -> Self;
    /// What lane `i` < [`Lane::LANES`] holds.
    fn get(&self, i: usize) -> Self::Scalar;
}

/// A value over scalars of type `S` that has a counterpart over lanes of `S`.
#[diagnostic::on_unimplemented(
    message = "`{Self}` cannot be spread over SIMD lanes",
    note = "every field of an element or an output of a kernel that is generic over `Real` must be the generic type, or a structure of it"
)]
pub trait Lanewise<S: Real>: Copy {
    /// The counterpart.
    type Over<L: Real>;
    /// Lane `i` is `at(i)`.
    fn gather<L: Lane<Scalar = S>>(at: impl Fn(usize) -> Self + Copy) -> Self::Over<L>;
    /// The value in lane `i`.
    fn extract<L: Lane<Scalar = S>>(over: &Self::Over<L>, i: usize) -> Self;
}

/// A value that is the same for all lanes.
pub trait Splat<S: Real>: Copy {
    /// The counterpart of [`Lanewise::Over`].
    type Over<L: Real>;
    /// The value in every lane.
    fn splat<L: Lane<Scalar = S>>(self) -> Self::Over<L>;
}

macro_rules! scalar {
    ($($float:ty),*) => {$(
        impl Lanewise<$float> for $float {
            type Over<L: Real> = L;
            #[inline(always)]
            fn gather<L: Lane<Scalar = $float>>(at: impl Fn(usize) -> Self + Copy) -> L {
                L::from_fn(at)
            }
            #[inline(always)]
            fn extract<L: Lane<Scalar = $float>>(over: &L, i: usize) -> Self {
                over.get(i)
            }
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
    )*};
}

scalar!(f32, f64);
