//! Subgroups: invocations of a workgroup that run together and exchange values without memory.
//! Other names: waves (HLSL), SIMD-groups (MSL), warps (CUDA). (SPIR-V, `OpGroupNonUniform…`; WGSL,
//! "Subgroup built-in functions"; names are WGSL's.)
//!
//! How many invocations a subgroup has is the device's choice: 4 to 128. Each operation belongs into
//! control flow that is the same for all invocations of the subgroup; the native device reports other
//! uses. No operation orders memory.

use glam::{IVec2, IVec3, IVec4, UVec2, UVec3, UVec4, Vec2, Vec3, Vec4};

/// What passes between the invocations of a subgroup: `f32`, `u32`, `i32` and vectors of them.
#[cfg(target_arch = "spirv")]
pub trait SubgroupValue: spirv_std::ScalarOrVector {}

/// What passes between the invocations of a subgroup: `f32`, `u32`, `i32` and vectors of them.
#[cfg(not(target_arch = "spirv"))]
pub trait SubgroupValue: bytemuck::Pod {}

macro_rules! numbers {
    ($(($name:ident, $inclusive:ident, $exclusive:ident)),*; $($extreme:ident),*) => {
        /// Numbers that a subgroup adds, multiplies and compares; vectors component by component.
        #[cfg(target_arch = "spirv")]
        pub trait SubgroupNumber: SubgroupValue {
            $(
                #[doc(hidden)]
                fn $name(self) -> Self;
                #[doc(hidden)]
                fn $inclusive(self) -> Self;
                #[doc(hidden)]
                fn $exclusive(self) -> Self;
            )*
            $(
                #[doc(hidden)]
                fn $extreme(self) -> Self;
            )*
        }
    };
}

numbers!(
    (all_sum, inclusive_sum, exclusive_sum),
    (all_product, inclusive_product, exclusive_product);
    all_least, all_greatest
);

/// Numbers that a subgroup adds, multiplies and compares; vectors component by component.
#[cfg(not(target_arch = "spirv"))]
pub trait SubgroupNumber: SubgroupValue {
    #[doc(hidden)]
    const NOTHING: Self;
    #[doc(hidden)]
    const ONE: Self;
    #[doc(hidden)]
    fn sum(self, other: Self) -> Self;
    #[doc(hidden)]
    fn product(self, other: Self) -> Self;
    #[doc(hidden)]
    fn least(self, other: Self) -> Self;
    #[doc(hidden)]
    fn greatest(self, other: Self) -> Self;
}

/// Integers whose bits a subgroup combines; vectors component by component.
#[cfg(target_arch = "spirv")]
pub trait SubgroupInteger: SubgroupNumber {
    #[doc(hidden)]
    fn all_and(self) -> Self;
    #[doc(hidden)]
    fn all_or(self) -> Self;
    #[doc(hidden)]
    fn all_xor(self) -> Self;
}

/// Integers whose bits a subgroup combines; vectors component by component.
#[cfg(not(target_arch = "spirv"))]
pub trait SubgroupInteger:
    SubgroupNumber
    + core::ops::BitAnd<Output = Self>
    + core::ops::BitOr<Output = Self>
    + core::ops::BitXor<Output = Self>
{
}

#[cfg(target_arch = "spirv")]
macro_rules! number {
    ($ty:ty: $add:ident $inclusive_add:ident $exclusive_add:ident
        $mul:ident $inclusive_mul:ident $exclusive_mul:ident $min:ident $max:ident) => {
        impl SubgroupValue for $ty {}
        impl SubgroupNumber for $ty {
            number!(
                all_sum $add, inclusive_sum $inclusive_add, exclusive_sum $exclusive_add,
                all_product $mul, inclusive_product $inclusive_mul,
                exclusive_product $exclusive_mul, all_least $min, all_greatest $max
            );
        }
    };
    ($($name:ident $function:ident),*) => { $(
        #[inline(always)]
        fn $name(self) -> Self {
            spirv_std::arch::$function(self)
        }
    )* };
}

#[cfg(target_arch = "spirv")]
macro_rules! floats {
    ($($ty:ty, $zero:expr, $one:expr;)*) => { $(
        number!($ty: subgroup_f_add subgroup_inclusive_f_add subgroup_exclusive_f_add
            subgroup_f_mul subgroup_inclusive_f_mul subgroup_exclusive_f_mul
            subgroup_f_min subgroup_f_max);
    )* };
}

#[cfg(target_arch = "spirv")]
macro_rules! integers {
    ($min:ident $max:ident: $($ty:ty, $zero:expr, $one:expr;)*) => { $(
        number!($ty: subgroup_i_add subgroup_inclusive_i_add subgroup_exclusive_i_add
            subgroup_i_mul subgroup_inclusive_i_mul subgroup_exclusive_i_mul $min $max);
        impl SubgroupInteger for $ty {
            number!(all_and subgroup_and, all_or subgroup_or, all_xor subgroup_xor);
        }
    )* };
}

#[cfg(not(target_arch = "spirv"))]
macro_rules! number {
    ($ty:ty, $zero:expr, $one:expr, |$a:ident, $b:ident| $sum:expr, $product:expr) => {
        impl SubgroupValue for $ty {}
        impl SubgroupNumber for $ty {
            const NOTHING: Self = $zero;
            const ONE: Self = $one;
            #[inline]
            fn sum(self, other: Self) -> Self {
                let ($a, $b) = (self, other);
                $sum
            }
            #[inline]
            fn product(self, other: Self) -> Self {
                let ($a, $b) = (self, other);
                $product
            }
            #[inline]
            fn least(self, other: Self) -> Self {
                self.min(other)
            }
            #[inline]
            fn greatest(self, other: Self) -> Self {
                self.max(other)
            }
        }
    };
}

#[cfg(not(target_arch = "spirv"))]
macro_rules! floats {
    ($($ty:ty, $zero:expr, $one:expr;)*) => { $(
        number!($ty, $zero, $one, |a, b| a + b, a * b);
    )* };
}

#[cfg(not(target_arch = "spirv"))]
macro_rules! integers {
    ($min:ident $max:ident: $($ty:ty, $zero:expr, $one:expr;)*) => { $(
        number!($ty, $zero, $one, |a, b| a.wrapping_add(b), a.wrapping_mul(b));
        impl SubgroupInteger for $ty {}
    )* };
}

floats! {
    f32, 0.0, 1.0;
    Vec2, Vec2::ZERO, Vec2::ONE;
    Vec3, Vec3::ZERO, Vec3::ONE;
    Vec4, Vec4::ZERO, Vec4::ONE;
}

integers! {
    subgroup_u_min subgroup_u_max:
    u32, 0, 1;
    UVec2, UVec2::ZERO, UVec2::ONE;
    UVec3, UVec3::ZERO, UVec3::ONE;
    UVec4, UVec4::ZERO, UVec4::ONE;
}

integers! {
    subgroup_s_min subgroup_s_max:
    i32, 0, 1;
    IVec2, IVec2::ZERO, IVec2::ONE;
    IVec3, IVec3::ZERO, IVec3::ONE;
    IVec4, IVec4::ZERO, IVec4::ONE;
}

/// Each function: a shader's instruction, and on the host what ends a call that is not the twin's.
macro_rules! functions {
    ($($(#[doc = $doc:literal])* $name:ident
        $(<$t:ident: $bound:ident $(, $number:ident)?>)?
        ($($arg:ident: $ty:ty),*) -> $out:ty = $shader:expr;)*) => { $(
        $(#[doc = $doc])*
        ///
        /// # Panics
        /// Natively it works only in a kernel, and in what a kernel names in `cooperative(…)`.
        #[cfg_attr(target_arch = "spirv", inline(always))]
        #[must_use]
        pub fn $name$(<$t: $bound $(, const $number: u32)?>)?($($arg: $ty),*) -> $out {
            #[cfg(target_arch = "spirv")]
            {
                $shader
            }
            #[cfg(not(target_arch = "spirv"))]
            {
                let _ = ($($arg,)*);
                crate::workgroup::alone(stringify!($name))
            }
        }
    )* };
}

#[cfg(target_arch = "spirv")]
use spirv_std::arch;

functions! {
    /// Whether `predicate` holds in any invocation of the subgroup.
    subgroup_any(predicate: bool) -> bool = arch::subgroup_any(predicate);
    /// Whether `predicate` holds in every invocation of the subgroup.
    subgroup_all(predicate: bool) -> bool = arch::subgroup_all(predicate);
    /// In which invocations of the subgroup `predicate` holds: bit `i % 32` of component `i / 32` is
    /// that of invocation `i`.
    subgroup_ballot(predicate: bool) -> UVec4 = arch::subgroup_ballot(predicate);
    /// The value of invocation `INVOCATION` of the subgroup, which must be less than 4 to be there on
    /// every device.
    subgroup_broadcast<T: SubgroupValue, INVOCATION>(value: T) -> T =
        // SAFETY: the native device reports an invocation that is not there.
        unsafe { arch::subgroup_broadcast_const::<T, INVOCATION>(value) };
    /// The value of the first invocation of the subgroup.
    subgroup_broadcast_first<T: SubgroupValue>(value: T) -> T =
        arch::subgroup_broadcast_first(value);
    /// The value of invocation `invocation` of the subgroup; any value if there is none.
    subgroup_shuffle<T: SubgroupValue>(value: T, invocation: u32) -> T =
        arch::subgroup_shuffle(value, invocation);
    /// The value of the invocation whose number is this one's, exclusive or `mask`; any value if there
    /// is none. `mask` is the same for the subgroup.
    subgroup_shuffle_xor<T: SubgroupValue>(value: T, mask: u32) -> T =
        arch::subgroup_shuffle_xor(value, mask);
    /// The value of the invocation whose number is less by `delta`; any value if there is none. `delta`
    /// is the same for the subgroup, and less than its size.
    subgroup_shuffle_up<T: SubgroupValue>(value: T, delta: u32) -> T =
        arch::subgroup_shuffle_up(value, delta);
    /// The value of the invocation whose number is greater by `delta`; any value if there is none.
    /// `delta` is the same for the subgroup, and less than its size.
    subgroup_shuffle_down<T: SubgroupValue>(value: T, delta: u32) -> T =
        arch::subgroup_shuffle_down(value, delta);
    /// The sum over the subgroup; of integers modulo 2^32. In which order floats are added is the
    /// device's choice.
    subgroup_add<T: SubgroupNumber>(value: T) -> T = value.all_sum();
    /// The product over the subgroup; of integers modulo 2^32. In which order floats are multiplied is
    /// the device's choice.
    subgroup_mul<T: SubgroupNumber>(value: T) -> T = value.all_product();
    /// The smallest value in the subgroup; any if one is NaN.
    subgroup_min<T: SubgroupNumber>(value: T) -> T = value.all_least();
    /// The greatest value in the subgroup; any if one is NaN.
    subgroup_max<T: SubgroupNumber>(value: T) -> T = value.all_greatest();
    /// The bits that are set in every invocation of the subgroup.
    subgroup_and<T: SubgroupInteger>(value: T) -> T = value.all_and();
    /// The bits that are set in any invocation of the subgroup.
    subgroup_or<T: SubgroupInteger>(value: T) -> T = value.all_or();
    /// The bits that are set in an odd number of invocations of the subgroup.
    subgroup_xor<T: SubgroupInteger>(value: T) -> T = value.all_xor();
    /// The sum over the invocations up to this one, itself among them.
    subgroup_inclusive_add<T: SubgroupNumber>(value: T) -> T = value.inclusive_sum();
    /// The sum over the invocations before this one; 0 in the first.
    subgroup_exclusive_add<T: SubgroupNumber>(value: T) -> T = value.exclusive_sum();
    /// The product over the invocations up to this one, itself among them.
    subgroup_inclusive_mul<T: SubgroupNumber>(value: T) -> T = value.inclusive_product();
    /// The product over the invocations before this one; 1 in the first.
    subgroup_exclusive_mul<T: SubgroupNumber>(value: T) -> T = value.exclusive_product();
    /// The value of invocation `INDEX`, 0 to 3, of the quad: of the four invocations of the subgroup
    /// whose numbers differ in the last two bits only.
    quad_broadcast<T: SubgroupValue, INDEX>(value: T) -> T = {
        const { assert!(INDEX < 4, "a quad has the invocations 0, 1, 2 and 3") };
        arch::subgroup_quad_broadcast(value, INDEX)
    };
    /// The value of the other invocation in the quad's row: of 1 in 0, of 3 in 2, and back.
    quad_swap_x<T: SubgroupValue>(value: T) -> T = arch::subgroup_quad_swap::<0, T>(value);
    /// The value of the other invocation in the quad's column: of 2 in 0, of 3 in 1, and back.
    quad_swap_y<T: SubgroupValue>(value: T) -> T = arch::subgroup_quad_swap::<1, T>(value);
    /// The value of the invocation across the quad: of 3 in 0, of 2 in 1, and back.
    quad_swap_diagonal<T: SubgroupValue>(value: T) -> T = arch::subgroup_quad_swap::<2, T>(value);
}
