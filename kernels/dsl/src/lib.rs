//! The vocabulary a kernel is written in.
//!
//! A kernel is a plain function with [`#[kernel]`](macro@kernel) on it. From it come the SPIR-V
//! entry point, the native executor and the [description](native::describe) that everything else
//! goes by. The body is the same code on every backend.
//!
//! ```
//! use hankel_dsl::{Element, Real, kernel, lit};
//!
//! /// A point of the curve.
//! #[derive(Clone, Copy, Element)]
//! #[repr(C)]
//! pub struct Point<R> {
//!     /// Abscissa.
//!     pub x: R,
//! }
//!
//! /// The parabola's ordinate.
//! #[derive(Clone, Copy, Element)]
//! #[repr(C)]
//! pub struct Height<R> {
//!     /// Ordinate.
//!     pub y: R,
//! }
//!
//! /// Half the square of the abscissa.
//! #[kernel(compute, threads(64), precision(f32, f64))]
//! pub fn parabola<R: Real>(#[element] point: Point<R>) -> Height<R> {
//!     Height { y: point.x * point.x * lit!(0.5) }
//! }
//!
//! hankel_dsl::kernels![parabola];
//! # fn main() {
//! assert_eq!(parabola(Point { x: 2.0_f32 }).y, 2.0);
//! assert_eq!(entries().len(), 2);
//! # }
//! ```
//!
//! # Kinds of compute kernels
//! A map reads what it likes and returns its own element: it cannot race.
//! ```
//! use hankel_dsl::kernel;
//!
//! /// Squares.
//! #[kernel(compute, threads(64))]
//! fn square(#[element] x: f32) -> f32 {
//!     x * x
//! }
//! # fn main() {}
//! ```
//! A kernel with a `StorageMut` or `Atomics` writes where it
//! likes; its invocations must not race, which `hankel sanitize` checks.
//! ```
//! use hankel_dsl::{Atomics, StorageMut, kernel};
//!
//! /// Keeps the numbers that are not zero; the counter says how many.
//! #[kernel(compute, threads(64))]
//! fn compact(
//!     #[element] x: u32,
//!     #[atomic] count: Atomics<'_>,
//!     #[storage(unordered)] kept: StorageMut<'_, u32>,
//! ) {
//!     if x != 0 {
//!         kept.set(count.add(0, 1), x);
//!     }
//! }
//! # fn main() {}
//! ```
//! A kernel with `Shared` memory or a `barrier` runs workgroup by
//! workgroup, those invocations too that are beyond the range, so that all of them come to every
//! barrier. Natively each invocation is resumable, and barriers in control flow that is not uniform
//! are reported.
//! ```
//! use hankel_dsl::{Shared, StorageMut, barrier, kernel};
//!
//! /// The sum of each 64 numbers.
//! #[kernel(compute, threads(64), range(x))]
//! fn sums(
//!     #[local_index] me: u32,
//!     #[group_id] group: u32,
//!     #[shared] part: Shared<'_, u32, 64>,
//!     #[element] x: Option<u32>,
//!     #[storage] out: StorageMut<'_, u32>,
//! ) {
//!     part.set(me, x.unwrap_or(0));
//!     let mut half = 32;
//!     while half > 0 {
//!         barrier();
//!         if me < half {
//!             part.set(me, part.get(me) + part.get(me + half));
//!         }
//!         half /= 2;
//!     }
//!     if me == 0 {
//!         out.set(group, part.get(0));
//!     }
//! }
//! # fn main() {}
//! ```
//!
//! # What is refused
//! - `unsafe`, `cfg(target_arch)` and a second version for the processor: the DSL owns them.
//! - In a map, writing anywhere but to one's own element: it *returns* what it computes. Who
//!   writes elsewhere takes a [`StorageMut`] or [`Atomics`] and says so by it.
//! - `core`'s `min`, `max`, `clamp` and slice indexing in kernels: they compile, but carry NaN and
//!   bounds tests into the shader; [`Real`] and [`Buffer`] do not.
//!
//! # Layout of buffers
//! `#[derive(Element)]` checks at compile time that a `repr(C)` structure lies in memory as a
//! shader (std430) sees it, names the field that does not, and describes it for the host.
#![no_std]
#![cfg_attr(target_arch = "spirv", feature(asm_experimental_arch, f16))]

#[cfg(not(target_arch = "spirv"))]
extern crate std;

// So that the macros' `::hankel_dsl` paths also work in this crate's own tests.
extern crate self as hankel_dsl;

#[macro_use]
mod formats;

mod atomics;
mod data;
mod half;
pub mod math;
mod memory;
#[cfg(not(target_arch = "spirv"))]
pub mod native;
mod real;
mod specialised;
mod stage;
mod storage;
mod storage_texture;
mod subgroup;
mod texture;
mod unroll;
mod workgroup;

pub use atomics::{AtomicInteger, Atomics};
pub use data::{Bool, PackedVec3};
pub use glam;
pub use half::{F16, F16x2, F16x4, Half, Half2, Half3, Half4};
/// ```
/// use hankel_dsl::{Real, apart};
/// #[apart(R, if N > 3)]
/// #[inline(always)]
/// fn power<R: Real, const N: usize>(x: R) -> R {
///     let mut all = x;
///     for _ in 1..N {
///         all *= x;
///     }
///     all
/// }
/// assert_eq!(power::<f32, 4>(2.0) + power::<f32, 2>(3.0), 25.0);
/// ```
pub use hankel_macros::apart;
pub use hankel_macros::{Element, cooperative, function, kernel, kernels, library};
pub use memory::{Buffer, array_element, array_element_mut};
pub use real::{Mask, Real, to_i32};
#[doc(hidden)]
pub use specialised::Specialised;
#[cfg(target_arch = "spirv")]
#[doc(hidden)]
pub use spirv_std;
pub use stage::{
    Centroid, ClipDistances, Depth, Derivative, Flat, Linear, PerSample, SampleMask, SecondSource,
    discard, dpdx, dpdx_coarse, dpdx_fine, dpdy, dpdy_coarse, dpdy_fine, fwidth, fwidth_coarse,
    fwidth_fine,
};
pub use storage::{StorageMut, Stored};
pub use storage_texture::{
    Access, Format, Readable, StorageTexture1d, StorageTexture2d, StorageTexture2dArray,
    StorageTexture3d, Writable, access, format,
};
pub use subgroup::{
    SubgroupInteger, SubgroupNumber, SubgroupValue, quad_broadcast, quad_swap_diagonal,
    quad_swap_x, quad_swap_y, subgroup_add, subgroup_all, subgroup_and, subgroup_any,
    subgroup_ballot, subgroup_broadcast, subgroup_broadcast_first, subgroup_exclusive_add,
    subgroup_exclusive_mul, subgroup_inclusive_add, subgroup_inclusive_mul, subgroup_max,
    subgroup_min, subgroup_mul, subgroup_or, subgroup_shuffle, subgroup_shuffle_down,
    subgroup_shuffle_up, subgroup_shuffle_xor, subgroup_xor,
};
pub use texture::{
    Channel, ComparisonSampler, DepthTexture2d, DepthTexture2dArray, DepthTexture2dMultisampled,
    DepthTextureCube, DepthTextureCubeArray, NonFilteringSampler, Sampler, Shifted, Texel,
    Texture1d, Texture2d, Texture2dArray, Texture2dMultisampled, Texture3d, TextureCube,
    TextureCubeArray,
};
pub use workgroup::{Shared, SharedAtomics, barrier, storage_barrier};

#[cfg(target_arch = "spirv")]
#[doc(hidden)]
pub use texture::image;

#[cfg(not(target_arch = "spirv"))]
#[doc(hidden)]
pub use bytemuck;

/// Keeps its tokens where they are compiled for the host only. The macros emit this instead of a
/// `cfg`, which would have to be declared in every kernel crate.
#[cfg(not(target_arch = "spirv"))]
#[doc(hidden)]
#[macro_export]
macro_rules! on_host {
    ($($tokens:tt)*) => { $($tokens)* };
}

/// See the other one.
#[cfg(target_arch = "spirv")]
#[doc(hidden)]
#[macro_export]
macro_rules! on_host {
    ($($tokens:tt)*) => {};
}

/// Keeps its tokens where they are compiled for SPIR-V only.
#[cfg(not(target_arch = "spirv"))]
#[doc(hidden)]
#[macro_export]
macro_rules! on_spirv {
    ($($tokens:tt)*) => {};
}

/// See the other one.
#[cfg(target_arch = "spirv")]
#[doc(hidden)]
#[macro_export]
macro_rules! on_spirv {
    ($($tokens:tt)*) => { $($tokens)* };
}

/// What `kernels!` exports from a plug-in.
#[cfg(not(target_arch = "spirv"))]
#[doc(hidden)]
#[macro_export]
macro_rules! plugin_exports {
    ($entries:path) => {
        use $crate::native::plugin;

        static ENTRIES: plugin::OnceLock<$crate::native::Entries> = plugin::OnceLock::new();

        unsafe extern "C" fn describe(sink: plugin::Sink, context: *mut plugin::c_void) {
            // SAFETY: the loader's promise is passed on.
            unsafe { plugin::describe(ENTRIES.get_or_init($entries), sink, context) }
        }

        unsafe extern "C" fn run(
            call: *const plugin::RawCall,
            sink: plugin::Sink,
            context: *mut plugin::c_void,
        ) -> u32 {
            // SAFETY: the loader's promise is passed on.
            unsafe { plugin::run(ENTRIES.get_or_init($entries), call, sink, context) }
        }

        unsafe extern "C" fn inputs(
            kernel: u32,
            request: *const u8,
            len: usize,
            sink: plugin::Sink,
            context: *mut plugin::c_void,
        ) -> u32 {
            // SAFETY: the loader's promise is passed on.
            unsafe {
                plugin::inputs(
                    ENTRIES.get_or_init($entries),
                    kernel,
                    request,
                    len,
                    sink,
                    context,
                )
            }
        }

        #[unsafe(no_mangle)]
        extern "C" fn hankel_plugin() -> plugin::Exports {
            plugin::Exports {
                abi: plugin::ABI,
                describe,
                run,
                inputs,
            }
        }
    };
}
