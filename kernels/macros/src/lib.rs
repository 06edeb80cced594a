//! The macros of `hankel-dsl`; their documentation is there.
#![allow(missing_docs, reason = "documented where hankel-dsl re-exports them")]

mod element;
mod function;
mod host;
mod kernel;
mod list;
mod shader;

use proc_macro::TokenStream;
use syn::parse_macro_input;

/// Makes a function a kernel: its SPIR-V entry points, its native executor, its description.
///
/// `#[kernel(STAGE, …)]`, where the stage is `compute`, `vertex` or `fragment`. For `compute`:
///
/// | argument | meaning |
/// | --- | --- |
/// | `threads(x[, y[, z]])` | invocations of a workgroup; as many numbers as the index has dimensions |
/// | `precision(f32, f64)` | entry points of a function that is generic over one `R: Real` |
/// | `texture(FORMAT, …)` | the result is a texel; one entry point for each format |
/// | `phases(N)` | workgroup memory: the function runs for phase 0 to N with barriers between |
/// | `per_group` | the first invocation's result is the workgroup's output |
/// | `exact` | the result is right only if sums and products are computed as they are written: the error of a rounding, for example. Languages that cannot forbid contraction and reordering do not get the kernel; the manifest says which |
/// | `pinned` | SPIR-V asks for arithmetic as it is written, so that the bits are the same everywhere even where the result is ill-conditioned; languages that cannot ask for it get the kernel all the same |
/// | `parity(ulp = N, absolute = X, why = "…")` | how far backends may differ; without it, not at all. `exact(FORMAT, …)` names formats that it does not concern |
///
/// Each parameter says what it is bound to; bindings are numbered in order, the output last.
///
/// | parameter | what |
/// | --- | --- |
/// | `#[uniform] x: &T` | a uniform buffer |
/// | `#[element] x: T` | the invocation's element of a read-only buffer (`Option<T>` in a kernel with phases) |
/// | `#[storage] x: Buffer<'_, T>` | a read-only buffer, readable anywhere |
/// | `#[atomic] x: Atomics<'_>` | counters |
/// | `#[texture] x: Texture2d<'_>` | also `Texture2dMultisampled`, `Texture3d` |
/// | `#[sampler] x: Sampler` | a sampler |
/// | `#[constant(id = N, default = V)] x: u32` | a specialisation constant |
/// | `#[index] x: u32` | the invocation's index: `u32`, `UVec2` or `UVec3` |
/// | `#[group] x: Group<'_, T, N>` | the workgroup's memory |
/// | `#[phase] x: u32` | the phase |
/// | `#[attribute] x: Vec3` | a vertex attribute |
/// | `#[varying] x: Vec3` | an interpolated value |
///
/// A vertex kernel returns the clip-space position, or a tuple of it and the varyings; a fragment
/// kernel one colour or a tuple of them.
#[proc_macro_attribute]
pub fn kernel(args: TokenStream, item: TokenStream) -> TokenStream {
    let item = parse_macro_input!(item as syn::ItemFn);
    kernel::Kernel::parse(args.into(), item)
        .map(|kernel| kernel.expand())
        .unwrap_or_else(|e| e.to_compile_error())
        .into()
}

/// Lets a `repr(C)` structure be in a buffer: checks that it lies in memory as a shader sees it
/// and describes it. A structure may be generic over one number type `R`.
#[proc_macro_derive(Element)]
pub fn derive_element(item: TokenStream) -> TokenStream {
    let item = parse_macro_input!(item as syn::DeriveInput);
    element::derive(&item)
        .unwrap_or_else(|e| e.to_compile_error())
        .into()
}

/// Lists a crate's kernels, once, at its root: `kernels![one, module::other];`. Makes
/// `pub fn entries()`, and what `hankel` needs to run the crate natively.
#[proc_macro]
pub fn kernels(input: TokenStream) -> TokenStream {
    let list = parse_macro_input!(input as list::List);
    list.expand().into()
}

/// Lets a function be in a [`library!`](macro@library): a text of it, in every language, that an engine
/// includes and calls.
///
/// The function takes and gives scalars (`f32`, `u32`, `i32`, `bool`), glam's vectors, structures of
/// these, and `impl Fn(…) -> …` for what the engine looks up itself; where it is generic over
/// `R: Real`, the texts are of `f32`. Its body is written in a part of Rust that has a form in every
/// language; `hankel build --form functions` refuses the rest with file, line and reason:
///
/// - `let` with patterns, assignments, `if`, `match` on what is known, blocks, closures;
/// - arithmetic, comparisons, the methods of `Real`, conversions that lose nothing, bits of `u32`;
/// - structures, tuples and arrays, indexed by what is known; methods and functions of any crate whose
///   sources are at hand, which are put in place unless they have `#[function]`, too;
/// - `unroll!` and `while i < end { …; i += 1; }`; macros of one's own.
#[proc_macro_attribute]
pub fn function(args: TokenStream, item: TokenStream) -> TokenStream {
    let item = parse_macro_input!(item as syn::ItemFn);
    function::function(&args.into(), &item)
        .unwrap_or_else(|e| e.to_compile_error())
        .into()
}

/// Names the functions and constants of a library of functions:
/// `library!(shadows { api: 1, functions: [bounds::hamburger_bound], constants: [LEAST] });`. `api`
/// rises when a signature changes, and `hankel check` fails if it does not.
#[proc_macro]
pub fn library(input: TokenStream) -> TokenStream {
    let library = parse_macro_input!(input as function::Library);
    library.expand().into()
}
