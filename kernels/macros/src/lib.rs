//! The macros of `hankel-dsl`; their documentation is there.
#![allow(missing_docs, reason = "documented where hankel-dsl re-exports them")]

mod apart;
mod element;
mod function;
mod general;
mod host;
mod image;
mod inputs;
mod kernel;
mod list;
mod range;
mod shader;
mod stage;
mod twin;

use proc_macro::TokenStream;
use syn::parse_macro_input;

/// Makes a function a kernel: its SPIR-V entry points, its native executor, its description.
///
/// `#[kernel(STAGE, …)]`, where the stage is `compute`, `vertex` or `fragment`. For `compute`:
///
/// | argument | meaning |
/// | --- | --- |
/// | `threads(x[, y[, z]])` | invocations of a workgroup; as many numbers as the index has dimensions |
/// | `range(…)` | how many invocations run: a number for each dimension, `range(64, 64)`; a uniform that is or has the size, `range(size)`, `range(grid.size)`; or, in one dimension, a buffer. Without it, as many as the first output has elements or texels; without outputs, as many as the first `#[element]` has |
/// | `precision(f32, f64)` | entry points of a function that is generic over one `R: Real` |
/// | `texture(FORMAT, …)` | the result is a texel; one entry point for each format |
/// | `outputs(FORMAT or buffer, …)` | what each of several results is; without it, all are elements of buffers |
/// | `forms(fragment)` | an image pass in two dimensions, all of whose results are texels, has a fragment entry point, too: `NAME_fragment`, to be drawn over all pixels of render targets, with the pixel as its index. It is one for all formats; `forms(fragment = other)` says that it is that of the function `other`, which differs in nothing else |
/// | `cooperative(name, …)` | functions marked [`#[cooperative]`](macro@cooperative) that the kernel calls |
/// | `depends(subgroup_size)` | the result depends on how many invocations a subgroup has, which differs from device to device; without it, it may not |
/// | `inputs = path::to::function` | makes inputs for parity, see below |
/// | `exact` | the result is right only if sums and products are computed as they are written: the error of a rounding, for example. Languages that cannot forbid contraction and reordering do not get the kernel; the manifest says which |
/// | `pinned` | SPIR-V asks for arithmetic as it is written, so that the bits are the same everywhere even where the result is ill-conditioned; languages that cannot ask for it get the kernel all the same |
/// | `scalar` | natively it runs without SIMD lanes, and is compiled once, not once more for each instruction set: for kernels that take long to compile and are not run on many rows |
/// | `compensated = name` | the kernel of that name has the same parameters and computes the same in about twice the digits, wherever digits are lost: `hankel eval` runs it unless `--fast` is given |
/// | `parity(ulp = N, absolute = X, why = "…")` | how far backends may differ; without it, not at all. `exact(FORMAT, …)` names formats that it does not concern; `non_finite` says that finite inputs may give infinities and NaN, which fails parity otherwise |
///
/// Each parameter says what it is bound to; bindings are numbered in order, the outputs last.
///
/// | parameter | what |
/// | --- | --- |
/// | `#[uniform] x: &T` | a uniform buffer |
/// | `#[push] x: &T` | push constants: a value of at most 128 bytes that is part of the commands; one in a kernel. A uniform buffer in languages that have none |
/// | `#[element] x: T` | the invocation's element of a read-only buffer (`Option<T>` where invocations work together: the last workgroup may have fewer) |
/// | `#[element] x: &mut T` | the same, changed in place |
/// | `#[storage] x: Buffer<'_, T>` | a read-only buffer, readable anywhere |
/// | `#[storage] x: StorageMut<'_, T>` | a buffer, readable and writable anywhere. `#[storage(unordered)]`: which element lies where depends on who comes first; parity then compares what is in it, in no order |
/// | `#[atomic] x: Atomics<'_>` | integers with atomic operations, `u32` or `Atomics<'_, i32>`; `#[atomic(unordered)]` as above |
/// | `#[texture] x: Texture2d<'_>` | also `Texture1d`, `Texture2dArray`, `Texture2dMultisampled`, `Texture3d`, `TextureCube`, `TextureCubeArray`; depths: `DepthTexture2d`, `DepthTexture2dArray`, `DepthTexture2dMultisampled`, `DepthTextureCube`, `DepthTextureCubeArray`; all but those of depths may hold integers: `Texture2d<'_, u32>`, `TextureCube<'_, i32>` |
/// | `#[texture] x: StorageTexture2d<'_, Rgba16Float>` | a texture of which any texel may be written; also `StorageTexture1d`, `StorageTexture2dArray`, `StorageTexture3d`; formats are types of `format`; a third argument says `Read` or `ReadWrite`, types of `access` |
/// | `#[sampler] x: Sampler` | a sampler; `ComparisonSampler` compares depths, `NonFilteringSampler` reads depths and integers as they are |
/// | `#[constant(id = N, default = V)] x: u32` (`i32`, `f32`, `bool`) | a specialisation constant |
/// | `#[index] x: u32` | the invocation's index: `u32`, `UVec2` or `UVec3` |
/// | `#[local_id]`, `#[group_id]`, `#[group_count]` | the invocation's place in its workgroup, its workgroup, how many workgroups the range needs: types as of the index |
/// | `#[local_index] x: u32` | the invocation's number in its workgroup |
/// | `#[subgroup_size]`, `#[subgroup_invocation_id]`, `#[subgroup_id]`, `#[subgroup_count] x: u32` | how many invocations the subgroup has, the invocation's number in it, its number in the workgroup, how many the workgroup has |
/// | `#[shared] x: Shared<'_, T, N>` | memory of the workgroup; `SharedAtomics<'_, u32, N>` (or `i32`) for atomic operations |
/// | `#[attribute] x: Vec3` | a vertex attribute |
/// | `#[varying] x: Vec3` | an interpolated value; integers and `Flat<f32>` are that of one vertex. `Linear<T>`, `Centroid<T>`, `PerSample<T>` say how |
/// | `#[vertex_index]`, `#[instance_index] x: u32` | the vertex's number, its instance's |
/// | `#[frag_coord] x: Vec3` | the centre of the fragment's pixel in the target, and its depth |
/// | `#[front_facing] x: bool` | whether the fragment's primitive faces the viewer |
/// | `#[sample_index] x: u32` | the sample that the fragment is for |
/// | `#[sample_mask] x: u32` | the samples of the pixel that the primitive covers, a bit for each |
/// | `#[primitive_index] x: u32` | the primitive's number |
///
/// A compute kernel returns what it computes, or a tuple of it; or nothing, if it writes to its
/// parameters. A vertex kernel returns the clip-space position, or a tuple of it and the varyings; a
/// fragment kernel one colour or a tuple of them, among which may be a `Depth`, a `SampleMask` and a `SecondSource`. Beside the position of a
/// vertex may be `ClipDistances`. It may
/// `discard` the fragment, take derivatives (`dpdx`), and write memory behind the last of them.
///
/// # Inputs
/// What the numbers of a parameter, or of a field of a structure, are like is said by attributes
/// beside the one above. Parity makes its inputs from them, and the command line takes defaults and
/// units from them. Names and documentation say nothing.
///
/// | attribute | meaning |
/// | --- | --- |
/// | `#[range(0.0..=1.0)]` | from one to the other. Absurd floats go beyond it, integers never do |
/// | `#[magnitude(1e-7..=1e-2)]` | of any order of magnitude between two positive numbers |
/// | `#[values(0, 1, 2)]` | one of these; of a constant, each of them is run |
/// | `#[unit_vector]` | the vector's length is 1 |
/// | `#[distinct]` | no two integers of a buffer are alike |
/// | `#[count_of(PARAM)]`, `#[index_of(PARAM)]` | the number of elements of another parameter; the number of one of its elements |
/// | `#[default(0.5)]` | a uniform's number unless somebody gives another one; 0 without it |
/// | `#[unit = "m"]` | the unit |
/// | `#[length(64)]`, `#[length(1..=64)]`, `#[length(PARAM * 3)]` | elements of a buffer or of atomic integers (256 without it): a number, any number between two, as many as another's |
/// | `#[size(64, 32)]` | texels of a texture |
/// | `#[levels(4)]` | mip levels of a texture; without it 1 |
/// | `#[layers(5)]` | layers or cubes of an array; without it 3 |
/// | `#[filter(nearest)]`, `#[mip_filter(nearest)]` | what a sampler does between texels, between levels: `nearest`, or `linear`, which is the default |
/// | `#[address(mirror_repeat)]` | what a sampler does beyond the edge: `clamp_to_edge`, `repeat`, `mirror_repeat` |
/// | `#[compare(less)]` | how a comparison sampler compares: `never`, `less`, `equal`, `less_equal` (the default), `greater`, `not_equal`, `greater_equal`, `always` |
///
/// A kernel's range that a uniform says keeps to the attributes of its numbers, too: as many invocations
/// as parity runs of every kernel, where those allow it, and sometimes the fewest.
///
/// Without any, floats lie in \[-1, 1\], texels in \[0, 1\], and integers anywhere, 0, 1, -1 and the
/// extremes among them.
///
/// What this cannot say, a function does: `inputs = path::to::function` among the arguments of
/// `#[kernel]`, a `fn(&hankel_dsl::native::inputs::Request) -> Vec<hankel_dsl::native::inputs::Given>`
/// that is compiled for the host only (behind `cfg(not(target_arch = "spirv"))`); for a kernel that
/// is generic over `R: Real`, one that is generic likewise. What it leaves out is made as above. Edge and
/// hostile inputs have its lengths, sizes and integers, with floats made as above.
#[proc_macro_attribute]
pub fn kernel(args: TokenStream, item: TokenStream) -> TokenStream {
    let item = parse_macro_input!(item as syn::ItemFn);
    kernel::Kernel::parse(args.into(), item)
        .map(|kernel| kernel.expand())
        .unwrap_or_else(|e| e.to_compile_error())
        .into()
}

/// Marks a function that waits at a `barrier`, or exchanges values in its subgroup, and is called by kernels, which name it
/// in `cooperative(…)`. One that calls others names those: `#[cooperative(other)]`. Such a function
/// is called by its name or path, not from a closure.
#[proc_macro_attribute]
pub fn cooperative(args: TokenStream, item: TokenStream) -> TokenStream {
    let args = parse_macro_input!(args as twin::Cooperative);
    let item = parse_macro_input!(item as syn::ItemFn);
    args.expand(&item)
        .unwrap_or_else(|e| e.to_compile_error())
        .into()
}

/// Lets a `repr(C)` structure be in a buffer: checks that it lies in memory as a shader sees it
/// and describes it. A structure may be generic over one number type `R`.
///
/// What its numbers are like is said by the same attributes as of a kernel's parameters, see
/// [`macro@kernel`]: `#[range(0.0..=1.0)]`, `#[default(0.5)]`, `#[unit = "m"]` and the others. (A
/// structure that also derives `Default` cannot have `#[default]`: the standard library's macro
/// wants the word for itself.)
#[proc_macro_derive(
    Element,
    attributes(
        range,
        magnitude,
        values,
        unit_vector,
        count_of,
        index_of,
        default,
        unit
    )
)]
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

/// Makes a long function one of its own natively, where the condition holds: `#[apart(R, if N > 3)]`.
///
/// Functions over a `Real` are `#[inline(always)]`: operations on lanes must be compiled for their instruction set, and a
/// shader's locals are no memory. Of long functions that costs time to compile: each kernel has its copy of what it shares
/// with others, and LLVM's time grows with the square of a function's length. What is apart is compiled once for each type
/// of number, with its instruction set. In a shader nothing changes.
///
/// The condition is a constant, and may depend on the function's parameters. A call costs time when it runs: arguments and
/// results are in memory, for each row of a group of lanes. Measure it: bounds from eight moments, in plain arithmetic and
/// 30 ns a row, took a tenth longer.
#[proc_macro_attribute]
pub fn apart(args: TokenStream, item: TokenStream) -> TokenStream {
    let args = parse_macro_input!(args as apart::Apart);
    let item = parse_macro_input!(item as syn::ItemFn);
    args.expand(&item)
        .unwrap_or_else(|e| e.to_compile_error())
        .into()
}

/// Lets a function be in a [`library!`](macro@library): a text of it, in every language, that an engine
/// includes and calls.
///
/// The function takes and gives scalars (`f32`, `u32`, `i32`, `bool`), glam's vectors, its `Mat2`, `Mat3` and `Mat4`,
/// structures of these, and `impl Fn(…) -> …` for what the engine looks up itself; where it is generic over
/// `R: Real`, the texts are of `f32`. Its body is written in a part of Rust that has a form in every
/// language; `hankel build --form functions` refuses the rest with file, line and reason:
///
/// - `let` with patterns, assignments, `if`, early `return`s, `match` on numbers, blocks, closures;
/// - arithmetic, comparisons, the methods of `Real`, conversions, bits of `u32`, the functions of `math` and `math::native`;
/// - of vectors `dot`, `length`, `distance`, `normalize`, `cross`, `lerp`, `min`, `max`, `clamp`, `abs`, `floor`,
///   `truncate`, `extend`, swizzles (`v.zyx()`); of matrices `*`, `from_cols`, `transpose`, `transform_point3`, `transform_vector3`,
///   `project_point3`, and columns by their names;
/// - structures, tuples and arrays, indexed by what is known; methods and functions of any crate whose
///   sources are at hand, which are put in place unless they have `#[function]`, too;
/// - `for` over ranges and arrays with `break` and `continue`, `while i < end { …; i += 1; }`, `unroll!`; macros of one's own.
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
