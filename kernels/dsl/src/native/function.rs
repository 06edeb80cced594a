//! The functions of a library, callable without their types: what tests compare the texts with.

use std::vec::Vec;

use glam::{IVec2, IVec3, IVec4, Mat2, Mat3, Mat4, UVec2, UVec3, UVec4, Vec2, Vec3, Vec4};

use super::describe::{Scalar, Type};
use super::layout;

/// A function of a library.
#[derive(Clone, Debug)]
pub struct Function {
    /// Its name.
    pub name: &'static str,
    /// Its parameters' names and types.
    pub params: Vec<(&'static str, Type)>,
    /// What it gives.
    pub result: Type,
    /// Takes the arguments' words, one after the other, and appends the result's. Truth values are 0
    /// and 1.
    pub run: fn(&[u32], &mut Vec<u32>),
}

/// A value as 32-bit words.
pub trait Words: Sized {
    /// How many.
    const COUNT: usize;

    /// The type's description.
    fn describe() -> Type;

    /// From its words, of which there are enough.
    fn read(words: &[u32]) -> Self;

    /// Appends its words.
    fn write(self, words: &mut Vec<u32>);
}

macro_rules! scalars {
    ($($ty:ident $scalar:ident $from:expr, $to:expr;)*) => {$(
        impl Words for $ty {
            const COUNT: usize = 1;
            fn describe() -> Type {
                Type::Scalar { scalar: Scalar::$scalar }
            }
            fn read(words: &[u32]) -> Self {
                $from(words[0])
            }
            fn write(self, words: &mut Vec<u32>) {
                words.push($to(self));
            }
        }
    )*};
}

scalars! {
    f32 F32 f32::from_bits, f32::to_bits;
    u32 U32 core::convert::identity, core::convert::identity;
    i32 I32 u32::cast_signed, i32::cast_unsigned;
    bool U32 (|word| word != 0), u32::from;
}

macro_rules! vectors {
    ($($ty:ident $scalar:ident $size:literal $component:ident;)*) => {$(
        impl Words for $ty {
            const COUNT: usize = $size;
            fn describe() -> Type {
                Type::Vector { scalar: Scalar::$scalar, size: $size }
            }
            fn read(words: &[u32]) -> Self {
                Self::from_array(core::array::from_fn(|i| $component::read(&words[i..])))
            }
            fn write(self, words: &mut Vec<u32>) {
                for component in self.to_array() {
                    component.write(words);
                }
            }
        }
    )*};
}

vectors! {
    Vec2 F32 2 f32; Vec3 F32 3 f32; Vec4 F32 4 f32;
    UVec2 U32 2 u32; UVec3 U32 3 u32; UVec4 U32 4 u32;
    IVec2 I32 2 i32; IVec3 I32 3 i32; IVec4 I32 4 i32;
}

macro_rules! matrices {
    ($($ty:ident $size:literal $column:ty;)*) => {$(
        /// Columns, one after the other.
        impl Words for $ty {
            const COUNT: usize = $size * $size;
            fn describe() -> Type {
                layout::matrix(stringify!($ty), $size, <$column>::describe())
            }
            fn read(words: &[u32]) -> Self {
                Self::from_cols_array(&core::array::from_fn(|i| f32::read(&words[i..])))
            }
            fn write(self, words: &mut Vec<u32>) {
                for number in self.to_cols_array() {
                    number.write(words);
                }
            }
        }
    )*};
}

matrices! {
    Mat2 2 Vec2; Mat3 3 Vec3; Mat4 4 Vec4;
}
