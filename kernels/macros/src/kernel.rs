//! What `#[kernel]` says, taken apart: [`Kernel`] is the one form that both expansions start from.

use proc_macro2::{Ident, Span, TokenStream};
use quote::{format_ident, quote};
use syn::ext::IdentExt;
use syn::parse::{Parse, ParseStream, Parser};
use syn::punctuated::Punctuated;
use syn::spanned::Spanned;
use syn::{
    Attribute, Expr, FnArg, GenericParam, ItemFn, LitFloat, LitInt, LitStr, Pat, Token, Type,
};

use crate::element::{replace, summary};
use crate::general::Form;
use crate::inputs::{Holder, Inputs};
use crate::range::Range;
use crate::stage::Passed;
use crate::twin;

/// A kernel function.
pub struct Kernel {
    pub item: ItemFn,
    pub name: Ident,
    pub summary: String,
    pub stage: Stage,
    /// The type parameter, if the function is generic.
    pub real: Option<Ident>,
    pub params: Vec<Param>,
    /// Types of the outputs, in order.
    pub outputs: Vec<Type>,
    /// Formats of the outputs that are texels, where each has its own: `outputs(…)`.
    pub output_formats: Vec<Option<Format>>,
    /// Entry points to make; the fragment form of an image pass is beside them.
    pub variants: Vec<Variant>,
    /// The fragment form of an image pass.
    pub fragment_form: Option<FragmentForm>,
    pub tolerance: Tolerance,
    pub rounding: Rounding,
    /// The function that makes inputs, as it is named from inside the kernel's module.
    pub inputs: Option<TokenStream>,
    /// The kernel that computes the same in about twice the digits.
    pub compensated: Option<Ident>,
    /// Natively it runs without SIMD lanes.
    pub scalar: bool,
    /// Cooperative functions that it calls.
    pub helpers: Vec<Ident>,
    /// Its result depends on the size of subgroups.
    pub sized_by_subgroups: bool,
    /// Its position is invariant.
    pub invariant: bool,
}

/// A variant of `describe::Rounding`.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Rounding {
    Free,
    Pinned,
    Exact,
}

impl Rounding {
    /// The variant's name.
    pub fn variant(self) -> &'static str {
        match self {
            Self::Free => "Free",
            Self::Pinned => "Pinned",
            Self::Exact => "Exact",
        }
    }
}

pub enum Stage {
    Compute(Box<Compute>),
    Vertex,
    Fragment,
}

pub struct Compute {
    pub threads: Vec<u32>,
    /// Its invocations share memory or wait for one another.
    pub cooperative: bool,
    pub range: Range,
}

impl Compute {
    /// Invocations of a workgroup along x, y, z.
    pub fn all_threads(&self) -> Vec<u32> {
        let mut threads = self.threads.clone();
        threads.resize(3, 1);
        threads
    }
}

/// One entry point of the function.
pub struct Variant {
    pub entry: String,
    pub scalar: Option<Ident>,
    pub format: Option<Format>,
    /// The fragment form of an image pass.
    pub fragment: bool,
}

/// Where the fragment form of an image pass comes from.
#[derive(Clone)]
pub enum FragmentForm {
    /// The function itself.
    Own,
    /// That of another function, which differs in its formats only.
    Of(Ident),
}

/// A texel format by its name, which is that in WebGPU.
#[derive(Clone, Copy)]
pub struct Format {
    pub name: &'static str,
}

impl Format {
    /// The variant of `TexelFormat`: `Rgba16Unorm` for `rgba16unorm`.
    pub fn variant(self) -> Ident {
        let mut after_digit = true;
        let letter = |letter: char| {
            let starts = after_digit && letter.is_ascii_lowercase();
            after_digit = letter.is_ascii_digit();
            if starts {
                letter.to_ascii_uppercase()
            } else {
                letter
            }
        };
        let variant: String = self.name.chars().map(letter).collect();
        Ident::new(&variant, Span::call_site())
    }
}

/// All of them: the table is `texel_formats` of hankel-dsl, which has a test of this.
#[rustfmt::skip]
const FORMATS: [&str; 39] = [
    "r32float", "r32uint", "r32sint",
    "rg32uint", "rg32sint", "rg32float",
    "rgba32float", "rgba32uint", "rgba32sint",
    "r16float", "r16unorm", "r16snorm", "r16uint", "r16sint",
    "rg16float", "rg16unorm", "rg16snorm", "rg16uint", "rg16sint",
    "rgba16float", "rgba16unorm", "rgba16uint", "rgba16sint", "rgba16snorm",
    "r8unorm", "r8snorm", "r8uint", "r8sint",
    "rg8unorm", "rg8snorm", "rg8uint", "rg8sint",
    "rgba8unorm", "rgba8uint", "rgba8sint", "rgba8snorm",
    "rgb10a2unorm", "rgb10a2uint", "rg11b10ufloat",
];

#[derive(Clone)]
pub struct Tolerance {
    pub ulp: u32,
    pub absolute: f64,
    /// Finite inputs may give results that are not finite.
    pub non_finite: bool,
    pub why: String,
    /// Texel formats that it does not concern: they hold what was computed.
    pub exact: Vec<Ident>,
}

impl Tolerance {
    /// None: the same bits everywhere.
    fn none() -> Self {
        Self {
            ulp: 0,
            absolute: 0.0,
            non_finite: false,
            why: "only correctly rounded operations, comparisons and selections: the same bits everywhere".into(),
            exact: Vec::new(),
        }
    }

    /// What concerns one entry point.
    pub fn of(&self, variant: &Variant) -> Self {
        match variant.format {
            Some(format) if self.exact.iter().any(|f| f == format.name) => Self {
                non_finite: self.non_finite,
                ..Self::none()
            },
            _ => self.clone(),
        }
    }
}

pub struct Param {
    pub name: Ident,
    pub role: Role,
    pub inputs: Inputs,
    /// A uniform that is push constants.
    pub push: bool,
}

/// What a parameter is bound to; types are the values', without `&`, `Option` or `Buffer`.
pub enum Role {
    Uniform(Type),
    Element(Type),
    ElementMut(Type),
    Storage(Type),
    StorageMut {
        ty: Type,
        unordered: bool,
    },
    Atomic {
        scalar: Type,
        unordered: bool,
    },
    /// The name of its kind and of its image.
    Texture(Ident),
    StorageTexture {
        kind: StorageKind,
        format: Type,
        /// None if it says nothing.
        access: Option<Type>,
    },
    Sampler(SamplerKind),
    /// The default is its 32 bits.
    Constant {
        id: u32,
        default: u32,
        ty: Ident,
    },
    Index,
    BuiltIn(BuiltIn),
    Shared {
        ty: Type,
        length: TokenStream,
        atomic: bool,
    },
    Attribute(Type),
    Varying(Passed),
}

/// What a sampler does. The names are those of `describe::SamplerKind`.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum SamplerKind {
    Filtering,
    NonFiltering,
    Comparison,
}

impl SamplerKind {
    /// The DSL's type, in full.
    pub fn ty(self) -> TokenStream {
        match self {
            Self::Filtering => quote!(::hankel_dsl::Sampler),
            Self::NonFiltering => quote!(::hankel_dsl::NonFilteringSampler),
            Self::Comparison => quote!(::hankel_dsl::ComparisonSampler),
        }
    }

    /// `describe::SamplerKind`.
    pub fn variant(self) -> TokenStream {
        let name = format_ident!("{self:?}");
        quote!(describe::SamplerKind::#name)
    }
}

/// How the texels of a storage texture lie. The names are those of a format's images in the DSL.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum StorageKind {
    Line,
    Flat,
    Layers,
    Volume,
}

impl StorageKind {
    /// The DSL's type.
    pub fn name(self) -> &'static str {
        match self {
            Self::Line => "StorageTexture1d",
            Self::Flat => "StorageTexture2d",
            Self::Layers => "StorageTexture2dArray",
            Self::Volume => "StorageTexture3d",
        }
    }

    /// The DSL's type, in full.
    pub fn ty(self) -> TokenStream {
        let name = format_ident!("{}", self.name());
        quote!(::hankel_dsl::#name)
    }

    /// The format's type of its image in SPIR-V.
    pub fn image(self) -> Ident {
        format_ident!("{self:?}")
    }

    pub fn dimensions(self) -> u32 {
        match self {
            Self::Line => 1,
            Self::Flat | Self::Layers => 2,
            Self::Volume => 3,
        }
    }
}

/// What the device knows of an invocation.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum BuiltIn {
    LocalId,
    LocalIndex,
    GroupId,
    GroupCount,
    SubgroupSize,
    SubgroupInvocationId,
    SubgroupId,
    SubgroupCount,
    VertexIndex,
    InstanceIndex,
    FragCoord,
    FrontFacing,
    SampleIndex,
    SampleMask,
    PrimitiveIndex,
}

/// Each by the word of its attribute.
const BUILT_INS: [(&str, BuiltIn); 15] = [
    ("local_id", BuiltIn::LocalId),
    ("local_index", BuiltIn::LocalIndex),
    ("group_id", BuiltIn::GroupId),
    ("group_count", BuiltIn::GroupCount),
    ("subgroup_size", BuiltIn::SubgroupSize),
    ("subgroup_invocation_id", BuiltIn::SubgroupInvocationId),
    ("subgroup_id", BuiltIn::SubgroupId),
    ("subgroup_count", BuiltIn::SubgroupCount),
    ("vertex_index", BuiltIn::VertexIndex),
    ("instance_index", BuiltIn::InstanceIndex),
    ("frag_coord", BuiltIn::FragCoord),
    ("front_facing", BuiltIn::FrontFacing),
    ("sample_index", BuiltIn::SampleIndex),
    ("sample_mask", BuiltIn::SampleMask),
    ("primitive_index", BuiltIn::PrimitiveIndex),
];

impl BuiltIn {
    /// Whether only an invocation in a subgroup has it.
    pub const fn is_of_subgroup(self) -> bool {
        matches!(
            self,
            Self::SubgroupSize
                | Self::SubgroupInvocationId
                | Self::SubgroupId
                | Self::SubgroupCount
        )
    }

    /// The variant of `describe::BuiltIn`.
    pub fn variant(self) -> Ident {
        format_ident!(
            "{}",
            match self {
                Self::LocalId => "LocalId",
                Self::LocalIndex => "LocalIndex",
                Self::GroupId => "GroupId",
                Self::GroupCount => "GroupCount",
                Self::SubgroupSize => "SubgroupSize",
                Self::SubgroupInvocationId => "SubgroupInvocationId",
                Self::SubgroupId => "SubgroupId",
                Self::SubgroupCount => "SubgroupCount",
                Self::VertexIndex => "VertexIndex",
                Self::InstanceIndex => "InstanceIndex",
                Self::FragCoord => "FragCoord",
                Self::FrontFacing => "FrontFacing",
                Self::SampleIndex => "SampleIndex",
                Self::SampleMask => "SampleMask",
                Self::PrimitiveIndex => "PrimitiveIndex",
            }
        )
    }
}

/// Types of textures that are read: of depths.
const TEXTURES_OF_DEPTHS: [&str; 5] = [
    "DepthTexture2d",
    "DepthTexture2dArray",
    "DepthTexture2dMultisampled",
    "DepthTextureCube",
    "DepthTextureCubeArray",
];

/// Those that may hold floats or integers, `Texture2d<'_, u32>`.
const TEXTURES_OF: [&str; 7] = [
    "Texture1d",
    "Texture2d",
    "Texture2dArray",
    "Texture2dMultisampled",
    "Texture3d",
    "TextureCube",
    "TextureCubeArray",
];

/// The kind of a texture: its type's name, which begins with what its integers are.
fn texture_kind(ty: &Type) -> Option<Ident> {
    let name = &last_segment(ty)?.ident;
    let of_integers = TEXTURES_OF.iter().any(|it| name == it);
    let number = argument(ty, &name.to_string());
    let number = number
        .as_ref()
        .map(last_segment)
        .map(|it| it.map(|it| it.ident.to_string()));
    let before = match number {
        None => "",
        Some(Some(number)) if of_integers => match number.as_str() {
            "f32" => "",
            "u32" => "Uint",
            "i32" => "Sint",
            _ => return None,
        },
        _ => return None,
    };
    let known = of_integers || TEXTURES_OF_DEPTHS.iter().any(|it| name == it);
    known.then(|| format_ident!("{before}{name}"))
}

/// The DSL's type of a texture of a kind.
pub fn texture_type(kind: &Ident) -> TokenStream {
    let name = kind.to_string();
    for (before, number) in [("Uint", "u32"), ("Sint", "i32")] {
        if let Some(name) = name.strip_prefix(before) {
            let (name, number) = (format_ident!("{name}"), format_ident!("{number}"));
            return quote!(::hankel_dsl::#name::<#number>);
        }
    }
    if TEXTURES_OF.contains(&name.as_str()) {
        return quote!(::hankel_dsl::#kind::<f32>);
    }
    quote!(::hankel_dsl::#kind)
}

impl Role {
    /// Whether the kernel writes it: not a storage texture that says `Read`.
    pub fn is_written(&self) -> bool {
        match self {
            Self::Atomic { .. } | Self::ElementMut(_) | Self::StorageMut { .. } => true,
            Self::StorageTexture { access, .. } => {
                let access = access.as_ref().and_then(last_segment);
                access.is_none_or(|it| it.ident != "Read")
            }
            _ => false,
        }
    }

    /// What its numbers are, for attributes about them.
    fn holder(&self) -> Holder {
        match self {
            Self::Uniform(_) | Self::Attribute(_) | Self::Varying(_) => Holder::Value,
            Self::Element(_) | Self::ElementMut(_) | Self::Storage(_) | Self::StorageMut { .. } => {
                Holder::Buffer
            }
            Self::Texture(kind) => {
                let kind = kind.to_string();
                let dimensions = if kind.ends_with("1d") {
                    1
                } else if kind.ends_with("3d") {
                    3
                } else {
                    2
                };
                Holder::Texture {
                    dimensions,
                    levels: dimensions != 1 && !kind.ends_with("Multisampled"),
                    array: kind.ends_with("Array"),
                    cube: kind.contains("Cube"),
                }
            }
            Self::Sampler(kind) => Holder::Sampler(*kind),
            Self::Constant { .. } => Holder::Constant,
            Self::Atomic { .. } => Holder::Counters,
            Self::StorageTexture { kind, .. } => Holder::Texels {
                array: *kind == StorageKind::Layers,
            },
            Self::Index | Self::BuiltIn(_) | Self::Shared { .. } => Holder::Nothing,
        }
    }

    /// Whether a descriptor is bound for it.
    pub fn is_bound(&self) -> bool {
        matches!(
            self,
            Self::Uniform(_)
                | Self::Element(_)
                | Self::ElementMut(_)
                | Self::Storage(_)
                | Self::StorageMut { .. }
                | Self::Atomic { .. }
                | Self::Texture(_)
                | Self::StorageTexture { .. }
                | Self::Sampler(_)
        )
    }
}

/// Variables of the generated code.
const RESERVED: [&str; 3] = ["invocation", "args", "call"];

const ROLES: &str = "uniform, push, element, storage, atomic, texture, sampler, constant, index, local_id, local_index, group_id, group_count, subgroup_size, subgroup_invocation_id, subgroup_id, subgroup_count, shared, attribute, varying, vertex_index, instance_index, frag_coord, front_facing, sample_index, sample_mask, primitive_index";

impl Kernel {
    pub fn parse(args: TokenStream, mut item: ItemFn) -> syn::Result<Self> {
        let args = Args::parse.parse2(args)?;
        let name = item.sig.ident.clone();
        let summary = summary(&item.attrs);
        if summary.is_empty() {
            return Err(syn::Error::new(
                name.span(),
                "a kernel needs a documentation comment: its first paragraph goes into the manifest",
            ));
        }
        reject(&item)?;
        let real = real(&item)?;
        let elements = element_types(&item);
        let params = item
            .sig
            .inputs
            .iter_mut()
            .map(parse_param)
            .collect::<syn::Result<Vec<_>>>()?;
        let outputs = match &item.sig.output {
            syn::ReturnType::Default => Vec::new(),
            syn::ReturnType::Type(_, ty) => match &**ty {
                Type::Tuple(t) => t.elems.iter().cloned().collect(),
                ty => vec![ty.clone()],
            },
        };
        let variants = args.variants(&name, real.as_ref())?;
        let (forms, fragment_form) = args.forms.clone().unzip();
        let output_formats = args.output_formats(&outputs)?;
        let compensated = args.compensated.clone();
        let scalar = args.scalar;
        let invariant = args.invariant.clone();
        let rounding = args.rounding.unwrap_or(Rounding::Free);
        let inputs = args.inputs.as_ref().map(from_inside);
        let helpers = args.cooperative.clone();
        let depends = args.depends.clone();
        let mut stage = args.into_stage(&params, &outputs, &name)?;
        if let Stage::Compute(c) = &mut stage.0 {
            c.cooperative = twin::has_barrier(&item, &helpers)
                || params.iter().any(|p| match p.role {
                    Role::Shared { .. } => true,
                    Role::BuiltIn(built_in) => built_in.is_of_subgroup(),
                    _ => false,
                });
            options(&elements, c.cooperative)?;
        }
        let tolerance = stage.1;
        let kernel = Self {
            item,
            name,
            summary,
            stage: stage.0,
            real,
            params,
            outputs,
            output_formats,
            variants,
            fragment_form,
            tolerance,
            rounding,
            inputs,
            compensated,
            scalar,
            helpers,
            sized_by_subgroups: depends.is_some(),
            invariant: invariant.is_some(),
        };
        if let Some(word) = invariant.filter(|_| !matches!(kernel.stage, Stage::Vertex)) {
            return Err(syn::Error::new(
                word.span(),
                "only the position of a vertex kernel is invariant",
            ));
        }
        if let Some(word) = depends.filter(|_| kernel.form() != Form::Cooperative) {
            return Err(syn::Error::new(
                word.span(),
                "the kernel has no operation of subgroups and does not ask for their size: leave `depends` out",
            ));
        }
        kernel.check()?;
        if let Some(span) = forms {
            kernel.check_forms(span)?;
        }
        Ok(kernel)
    }

    /// Whether an output is a texel.
    pub fn writes_texture(&self) -> bool {
        self.variants
            .iter()
            .map(|v| v.format)
            .chain(self.output_formats.iter().copied())
            .any(|f| f.is_some())
    }

    /// The format of an output that is a texel.
    pub fn output_format(&self, i: usize, variant: &Variant) -> Option<Format> {
        match self.output_formats.get(i) {
            Some(format) => *format,
            None => variant.format,
        }
    }

    /// An output's name in messages and as an argument.
    pub fn output_text(&self, i: usize) -> String {
        if self.outputs.len() == 1 {
            "output".into()
        } else {
            format!("output[{i}]")
        }
    }

    /// Dimensions of the index.
    pub fn dimensions(&self) -> usize {
        match &self.stage {
            Stage::Compute(c) => c.threads.len(),
            _ => 1,
        }
    }

    /// The type of the index.
    pub fn index_type(&self) -> TokenStream {
        match self.dimensions() {
            1 => quote!(u32),
            2 => quote!(::hankel_dsl::glam::UVec2),
            _ => quote!(::hankel_dsl::glam::UVec3),
        }
    }

    /// `tokens` with the type parameter replaced by the variant's scalar.
    pub fn concrete(&self, tokens: impl quote::ToTokens, variant: &Variant) -> TokenStream {
        let tokens = quote!(#tokens);
        match (&self.real, &variant.scalar) {
            (Some(real), Some(scalar)) => replace(tokens, real, scalar),
            _ => tokens,
        }
    }

    fn check(&self) -> syn::Result<()> {
        let sized: Vec<&Ident> = self
            .params
            .iter()
            .filter(|p| {
                matches!(
                    p.role.holder(),
                    Holder::Buffer | Holder::Counters | Holder::Texture { .. }
                )
            })
            .map(|p| &p.name)
            .collect();
        for p in &self.params {
            p.inputs.check(p.role.holder(), &sized)?;
        }
        let error = |span: Span, text: &str| Err(syn::Error::new(span, text));
        let compute = match &self.stage {
            Stage::Compute(c) => Some(c),
            _ => None,
        };
        for p in &self.params {
            let span = p.name.span();
            match (&p.role, &self.stage) {
                (Role::Attribute(_), Stage::Vertex) => {}
                (Role::Varying(passed), Stage::Fragment) => {
                    if let Some(problem) = passed.problem() {
                        return error(span, problem);
                    }
                }
                (Role::Attribute(_), _) => {
                    return error(span, "only a vertex kernel has attributes");
                }
                (Role::Varying(_), _) => return error(span, "only a fragment kernel has varyings"),
                (
                    Role::Element(_) | Role::ElementMut(_) | Role::Index,
                    Stage::Vertex | Stage::Fragment,
                ) => {
                    return error(
                        span,
                        "elements and indices belong to compute kernels: a vertex kernel has attributes and a #[vertex_index], a fragment kernel varyings and a #[frag_coord]",
                    );
                }
                (
                    Role::StorageMut { .. } | Role::StorageTexture { .. } | Role::Atomic { .. },
                    Stage::Vertex,
                ) => {
                    return error(
                        span,
                        "a vertex kernel writes nothing but what it returns: atomics, buffers and textures that are written belong to compute and fragment kernels",
                    );
                }
                (Role::Shared { .. }, Stage::Vertex | Stage::Fragment) => {
                    return error(
                        span,
                        "workgroups and their memory belong to compute kernels",
                    );
                }
                (Role::BuiltIn(built_in), stage) => {
                    if let Some(problem) = built_in.foreign_to(stage) {
                        return error(span, problem);
                    }
                }
                _ => {}
            }
        }
        if compute.is_none() {
            self.check_returned()?;
        }
        if let Some(second) = self.params.iter().filter(|p| p.push).nth(1) {
            return error(
                second.name.span(),
                "a kernel has one block of push constants: put all of them into one structure",
            );
        }
        let span = self.name.span();
        if compute.is_some_and(|c| c.cooperative) {
            if self.real.is_some() {
                return error(
                    span,
                    "a kernel whose invocations work together cannot be generic over `Real`: write it for f32",
                );
            }
            if let Some(p) = self.changed().next() {
                return error(
                    p.name.span(),
                    "the last workgroup may have fewer elements than invocations: take a `StorageMut` and write where there is one",
                );
            }
        }
        if self.real.is_some()
            && (self.dimensions() != 1 || self.writes_texture() || compute.is_none())
        {
            return error(
                span,
                "only a compute map over buffers can be generic over `Real`: write this one for f32",
            );
        }
        let by_outputs = compute.is_some_and(|c| matches!(c.range, Range::Outputs));
        let first_is_texture = self
            .variants
            .first()
            .is_some_and(|v| self.output_format(0, v).is_some());
        if by_outputs && !first_is_texture && self.dimensions() != 1 {
            return error(
                span,
                "nothing says how far it goes in 2 or 3 dimensions: write a texture, `texture(FORMAT)`, or add `range(…)` with a number for each dimension or a uniform",
            );
        }
        if self.writes_texture() && self.dimensions() == 1 {
            return error(
                span,
                "a texture has 2 or 3 dimensions: write `threads(8, 8)`",
            );
        }
        if compute.is_some() && self.outputs.is_empty() {
            let writes = self.params.iter().any(|p| p.role.is_written());
            if !writes {
                return error(
                    span,
                    "a kernel returns what it computes, or writes it: to an `#[element] x: &mut T`, a `#[storage] x: StorageMut<'_, T>`, or `#[atomic]` integers",
                );
            }
            if by_outputs && self.counted().is_none() {
                return error(
                    span,
                    "nothing says how many invocations run: give it an `#[element]`, or add `range(…)` with a number, a uniform or a buffer",
                );
            }
        }
        if self.real.is_some() && self.form() == Form::General {
            return error(
                span,
                "only a map from elements to one output can be generic over `Real`: write this one for f32",
            );
        }
        for p in &self.params {
            if p.name == "output" {
                return error(
                    p.name.span(),
                    "`output` is the result's own name: choose another",
                );
            }
            if RESERVED.iter().any(|r| p.name == r) {
                return error(
                    p.name.span(),
                    "the generated code has a variable of this name: choose another",
                );
            }
        }
        Ok(())
    }

    /// The function as it was, and beside it a module of the same name with all that is made.
    pub fn expand(&self) -> TokenStream {
        let (mut item, vis, name) = (self.item.clone(), &self.item.vis, &self.name);
        // What says the range is used, also where the body does not name it.
        if let Stage::Compute(compute) = &self.stage
            && let Range::Uniform { param, .. } | Range::Elements(param) = &compute.range
        {
            let uses = syn::parse_quote!(let _ = &#param;);
            item.block.stmts.insert(0, uses);
        }
        let shader = self.expand_shader();
        let host = self.expand_host();
        // The host runs the twin in its place.
        let unused = (self.form() == Form::Cooperative).then(|| quote!(#[allow(dead_code)]));
        quote! {
            #[inline(always)]
            #[allow(
                clippy::too_many_arguments, clippy::type_complexity,
                reason = "the parameters of a kernel are what is bound to it, and it returns all that it makes"
            )]
            #unused
            #item

            #[doc(hidden)]
            #vis mod #name {
                #[allow(unused_imports, reason = "what the signature names")]
                use super::*;

                #shader
                #host
            }
        }
    }
}

/// The types of the elements, as they are written.
fn element_types(item: &ItemFn) -> Vec<Type> {
    let elements = item.sig.inputs.iter().filter_map(|arg| match arg {
        FnArg::Typed(arg) if arg.attrs.iter().any(|a| a.path().is_ident("element")) => {
            Some((*arg.ty).clone())
        }
        _ => None,
    });
    elements.collect()
}

/// Whether elements are `Option<T>` in a cooperative kernel, and only there.
fn options(elements: &[Type], cooperative: bool) -> syn::Result<()> {
    for ty in elements {
        let optional = argument(ty, "Option").is_some();
        if cooperative && !optional && !matches!(ty, Type::Reference(_)) {
            return Err(syn::Error::new(
                ty.span(),
                "where invocations work together the last workgroup may have fewer elements than invocations: take an `Option<T>`",
            ));
        }
        if !cooperative && optional {
            return Err(syn::Error::new(
                ty.span(),
                "each invocation has an element: take `T`, without `Option`",
            ));
        }
    }
    Ok(())
}

/// What the generated code could not keep its promises about.
fn reject(item: &ItemFn) -> syn::Result<()> {
    let sig = &item.sig;
    for (token, what) in [
        (sig.asyncness.map(|t| t.span()), "async"),
        (sig.unsafety.map(|t| t.span()), "unsafe"),
        (sig.abi.as_ref().map(Spanned::span), "extern"),
    ] {
        if let Some(span) = token {
            return Err(syn::Error::new(span, format!("a kernel cannot be {what}")));
        }
    }
    if let Some(r) = &sig.receiver() {
        return Err(syn::Error::new(r.span(), "a kernel is a free function"));
    }
    Ok(())
}

/// The one type parameter that a kernel may have.
fn real(item: &ItemFn) -> syn::Result<Option<Ident>> {
    let mut params = item.sig.generics.params.iter();
    match (params.next(), params.next()) {
        (None, _) => Ok(None),
        (Some(GenericParam::Type(t)), None) => Ok(Some(t.ident.clone())),
        _ => Err(syn::Error::new(
            item.sig.generics.span(),
            "a kernel may be generic over one `R: Real`, and nothing else",
        )),
    }
}

fn parse_param(arg: &mut FnArg) -> syn::Result<Param> {
    let FnArg::Typed(arg) = arg else {
        return Err(syn::Error::new(arg.span(), "a kernel is a free function"));
    };
    let Pat::Ident(pat) = &*arg.pat else {
        return Err(syn::Error::new(
            arg.pat.span(),
            "a kernel's parameter is a plain name",
        ));
    };
    let name = pat.ident.clone();
    let inputs = Inputs::take(&mut arg.attrs)?;
    let is_role = |a: &Attribute| {
        a.path()
            .get_ident()
            .is_some_and(|i| ROLES.split(", ").any(|r| i == r))
    };
    let mut roles: Vec<Attribute> = arg.attrs.iter().filter(|a| is_role(a)).cloned().collect();
    arg.attrs.retain(|a| !is_role(a));
    let (Some(role), true) = (roles.pop(), roles.is_empty()) else {
        return Err(syn::Error::new(
            name.span(),
            format!("say what `{name}` is bound to, with one of #[…]: {ROLES}"),
        ));
    };
    let word = role.path().require_ident()?.to_string();
    let ty = &*arg.ty;
    let role = match word.as_str() {
        "uniform" | "push" => match ty {
            Type::Reference(r) if r.mutability.is_none() => Role::Uniform((*r.elem).clone()),
            _ if word == "push" => {
                return Err(syn::Error::new(ty.span(), "push constants are `&T`"));
            }
            _ => return Err(syn::Error::new(ty.span(), "a uniform is `&T`")),
        },
        "element" => match ty {
            Type::Reference(r) if r.mutability.is_some() => Role::ElementMut((*r.elem).clone()),
            Type::Reference(_) => {
                return Err(syn::Error::new(
                    ty.span(),
                    "an element is `T`, or `&mut T` to change it in place",
                ));
            }
            _ => Role::Element(argument(ty, "Option").unwrap_or_else(|| ty.clone())),
        },
        "storage" => {
            let unordered = unordered(&role)?;
            match (argument(ty, "Buffer"), argument(ty, "StorageMut")) {
                (Some(_), _) if unordered => {
                    return Err(syn::Error::new(
                        role.span(),
                        "a buffer that is only read has no order to lose: leave `unordered` out",
                    ));
                }
                (Some(ty), _) => Role::Storage(ty),
                (None, Some(ty)) => Role::StorageMut { ty, unordered },
                (None, None) => {
                    return Err(syn::Error::new(
                        ty.span(),
                        "a storage buffer is `Buffer<'_, T>` to be read, `StorageMut<'_, T>` to be read and written anywhere",
                    ));
                }
            }
        }
        "atomic" => {
            if last_segment(ty).is_none_or(|s| s.ident != "Atomics") {
                return Err(syn::Error::new(
                    ty.span(),
                    "integers for atomic operations are `Atomics<'_>` (u32) or `Atomics<'_, i32>`",
                ));
            }
            let scalar = argument(ty, "Atomics").unwrap_or_else(|| syn::parse_quote!(u32));
            let known = matches!(&scalar, Type::Path(p) if p.path.is_ident("u32") || p.path.is_ident("i32"));
            if !known {
                return Err(syn::Error::new(
                    scalar.span(),
                    "every shader language has atomic operations for u32 and i32, and for nothing else",
                ));
            }
            Role::Atomic {
                scalar,
                unordered: unordered(&role)?,
            }
        }
        "texture" if storage_texture(ty).is_some() => storage_texture(ty).unwrap_or(Role::Index),
        "texture" => match last_segment(ty) {
            Some(_) if texture_kind(ty).is_some() => {
                Role::Texture(texture_kind(ty).unwrap_or_else(|| name.clone()))
            }
            _ => {
                let names: Vec<_> = TEXTURES_OF
                    .iter()
                    .chain(&TEXTURES_OF_DEPTHS)
                    .map(|name| format!("`{name}<'_>`"))
                    .collect();
                return Err(syn::Error::new(
                    ty.span(),
                    format!(
                        "a texture is one of {}; one that is written is `StorageTexture1d<'_, FORMAT>`, `StorageTexture2d<'_, FORMAT>`, `StorageTexture2dArray<'_, FORMAT>` or `StorageTexture3d<'_, FORMAT>`",
                        names.join(", ")
                    ),
                ));
            }
        },
        "sampler" => match last_segment(ty).map(|s| s.ident.to_string()).as_deref() {
            Some("Sampler") => Role::Sampler(SamplerKind::Filtering),
            Some("NonFilteringSampler") => Role::Sampler(SamplerKind::NonFiltering),
            Some("ComparisonSampler") => Role::Sampler(SamplerKind::Comparison),
            _ => {
                return Err(syn::Error::new(
                    ty.span(),
                    "a sampler is `Sampler`, `NonFilteringSampler`, or `ComparisonSampler` for depths",
                ));
            }
        },
        "constant" => {
            let (mut id, mut default) = (None, None);
            let scalar = last_segment(ty).map(|s| s.ident.clone()).filter(|name| {
                ["u32", "i32", "f32", "bool"]
                    .iter()
                    .any(|scalar| name == scalar)
            });
            let Some(scalar) = scalar else {
                return Err(syn::Error::new(
                    ty.span(),
                    "a specialisation constant is a `u32`, `i32`, `f32` or `bool`",
                ));
            };
            role.parse_nested_meta(|meta| {
                let value = meta.value()?;
                match meta.path.get_ident() {
                    Some(i) if i == "id" => id = Some(value.parse::<LitInt>()?.base10_parse()?),
                    Some(i) if i == "default" => {
                        default = Some(word_of(&value.parse()?, &scalar)?);
                    }
                    _ => return Err(meta.error("expected `id` or `default`")),
                }
                Ok(())
            })?;
            match (id, default) {
                (Some(id), Some(default)) => Role::Constant {
                    id,
                    default,
                    ty: scalar,
                },
                _ => {
                    return Err(syn::Error::new(
                        role.span(),
                        "write #[constant(id = N, default = V)]",
                    ));
                }
            }
        }
        "index" => Role::Index,
        "shared" => shared(ty)?,
        "attribute" => Role::Attribute(ty.clone()),
        "varying" => Role::Varying(Passed::of(ty)),
        word => match BUILT_INS.iter().find(|(name, _)| *name == word) {
            Some((_, built_in)) => Role::BuiltIn(*built_in),
            None => return Err(syn::Error::new(role.span(), "this role is not known")),
        },
    };
    let push = word == "push";
    Ok(Param {
        name,
        role,
        inputs,
        push,
    })
}

/// The 32 bits of a specialisation constant's default.
fn word_of(value: &Expr, ty: &Ident) -> syn::Result<u32> {
    let (negative, literal) = match value {
        Expr::Unary(syn::ExprUnary {
            op: syn::UnOp::Neg(_),
            expr,
            ..
        }) => (true, expr.as_ref()),
        other => (false, other),
    };
    let Expr::Lit(syn::ExprLit { lit, .. }) = literal else {
        return Err(syn::Error::new(value.span(), "the default is a literal"));
    };
    let wrong = || syn::Error::new(value.span(), format!("this is no `{ty}`"));
    let word = match (ty.to_string().as_str(), lit) {
        ("bool", syn::Lit::Bool(b)) if !negative => Some(u32::from(b.value)),
        ("u32", syn::Lit::Int(i)) if !negative => i.base10_parse().ok(),
        ("i32", syn::Lit::Int(i)) => {
            let size: i64 = i.base10_parse()?;
            let number = i32::try_from(if negative { -size } else { size });
            number.ok().map(i32::cast_unsigned)
        }
        ("f32", syn::Lit::Float(_) | syn::Lit::Int(_)) => {
            let digits = match lit {
                syn::Lit::Float(f) => f.base10_digits().to_owned(),
                syn::Lit::Int(i) => i.base10_digits().to_owned(),
                _ => return Err(wrong()),
            };
            let size: f32 = digits.parse().map_err(|_| wrong())?;
            size.is_finite()
                .then(|| (if negative { -size } else { size }).to_bits())
        }
        _ => None,
    };
    word.ok_or_else(wrong)
}

/// Whether a role's attribute says `unordered`.
fn unordered(role: &Attribute) -> syn::Result<bool> {
    if matches!(role.meta, syn::Meta::Path(_)) {
        return Ok(false);
    }
    let word: Ident = role.parse_args()?;
    if word == "unordered" {
        Ok(true)
    } else {
        Err(syn::Error::new(word.span(), "expected `unordered`"))
    }
}

/// A name without `r#`, which only Rust needs.
pub fn text_of(name: &Ident) -> String {
    name.unraw().to_string()
}

pub fn last_segment(ty: &Type) -> Option<&syn::PathSegment> {
    match ty {
        Type::Path(p) => p.path.segments.last(),
        _ => None,
    }
}

/// `T` of `NAME<'_, T>`.
pub fn argument(ty: &Type, name: &str) -> Option<Type> {
    arguments(ty, name).into_iter().next()
}

/// `A`, `B` of `NAME<'_, A, B>`.
fn arguments(ty: &Type, name: &str) -> Vec<Type> {
    let segment = last_segment(ty).filter(|s| s.ident == name);
    let Some(syn::PathArguments::AngleBracketed(args)) = segment.map(|it| &it.arguments) else {
        return Vec::new();
    };
    let types = args.args.iter().filter_map(|a| match a {
        syn::GenericArgument::Type(t) => Some(t.clone()),
        _ => None,
    });
    types.collect()
}

/// The role of `NAME<'_, FORMAT, ACCESS>`, if it is a storage texture.
fn storage_texture(ty: &Type) -> Option<Role> {
    let kinds = [
        StorageKind::Line,
        StorageKind::Flat,
        StorageKind::Layers,
        StorageKind::Volume,
    ];
    kinds.into_iter().find_map(|kind| {
        let mut arguments = arguments(ty, kind.name()).into_iter();
        Some(Role::StorageTexture {
            kind,
            format: arguments.next()?,
            access: arguments.next(),
        })
    })
}

fn shared(ty: &Type) -> syn::Result<Role> {
    let error = || {
        syn::Error::new(
            ty.span(),
            "workgroup memory is `Shared<'_, T, N>`, or `SharedAtomics<'_, u32, N>` (or i32) for atomic operations; N is how many",
        )
    };
    let segment = last_segment(ty).ok_or_else(error)?;
    let atomic = match segment.ident.to_string().as_str() {
        "Shared" => false,
        "SharedAtomics" => true,
        _ => return Err(error()),
    };
    let syn::PathArguments::AngleBracketed(args) = &segment.arguments else {
        return Err(error());
    };
    let mut args = args
        .args
        .iter()
        .filter(|a| !matches!(a, syn::GenericArgument::Lifetime(_)));
    let (Some(syn::GenericArgument::Type(ty)), Some(length), None) =
        (args.next(), args.next(), args.next())
    else {
        return Err(error());
    };
    Ok(Role::Shared {
        ty: ty.clone(),
        length: quote!(#length),
        atomic,
    })
}

/// The stage's word.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Word {
    Compute,
    Vertex,
    Fragment,
}

/// The attribute's arguments.
#[derive(Default)]
struct Args {
    stage: Option<Word>,
    threads: Option<Vec<u32>>,
    precision: Vec<Ident>,
    formats: Vec<Format>,
    cooperative: Vec<Ident>,
    /// What the result depends on: the size of subgroups.
    depends: Option<Ident>,
    range: Option<(Span, Punctuated<Expr, Token![,]>)>,
    outputs: Option<(Span, Vec<Option<Format>>)>,
    tolerance: Option<Tolerance>,
    rounding: Option<Rounding>,
    inputs: Option<syn::Path>,
    compensated: Option<Ident>,
    scalar: bool,
    invariant: Option<Ident>,
    forms: Option<(Span, FragmentForm)>,
}

impl Parse for Args {
    fn parse(input: ParseStream<'_>) -> syn::Result<Self> {
        let mut args = Self::default();
        while !input.is_empty() {
            let word = input.call(Ident::parse_any)?;
            match word.to_string().as_str() {
                "compute" => args.stage = Some(Word::Compute),
                "vertex" => args.stage = Some(Word::Vertex),
                "fragment" => args.stage = Some(Word::Fragment),
                "exact" | "pinned" => {
                    let asked = if word == "exact" {
                        Rounding::Exact
                    } else {
                        Rounding::Pinned
                    };
                    if args.rounding.replace(asked).is_some() {
                        return Err(syn::Error::new(
                            word.span(),
                            "`exact` says more than `pinned`: write one of them, once",
                        ));
                    }
                }
                "invariant" => args.invariant = Some(word),
                "threads" => {
                    let threads = numbers(input)?;
                    let product: u64 = threads.iter().map(|t| u64::from(*t)).product();
                    if threads.is_empty() || threads.len() > 3 || product == 0 || product > 1024 {
                        return Err(syn::Error::new(
                            word.span(),
                            "a workgroup has 1 to 3 dimensions and 1 to 1024 threads; 256 run everywhere",
                        ));
                    }
                    args.threads = Some(threads);
                }
                "cooperative" => args.cooperative = idents(input)?,
                "depends" => {
                    let on = idents(input)?;
                    match &on[..] {
                        [size] if size == "subgroup_size" => args.depends = Some(size.clone()),
                        _ => {
                            return Err(syn::Error::new(
                                word.span(),
                                "a result may depend on one thing that differs from device to device: write `depends(subgroup_size)`",
                            ));
                        }
                    }
                }
                "precision" => {
                    args.precision = idents(input)?;
                    for p in &args.precision {
                        if p != "f32" && p != "f64" {
                            return Err(syn::Error::new(p.span(), "a precision is f32 or f64"));
                        }
                    }
                }
                "texture" => {
                    for f in idents(input)? {
                        args.formats.push(format(&f)?);
                    }
                }
                "outputs" => {
                    let kinds = idents(input)?
                        .iter()
                        .map(|f| {
                            if f == "buffer" {
                                Ok(None)
                            } else {
                                format(f).map(Some)
                            }
                        })
                        .collect::<syn::Result<_>>()?;
                    args.outputs = Some((word.span(), kinds));
                }
                "range" => {
                    let content;
                    syn::parenthesized!(content in input);
                    args.range = Some((word.span(), Punctuated::parse_terminated(&content)?));
                }
                "inputs" => {
                    input.parse::<Token![=]>()?;
                    args.inputs = Some(input.parse()?);
                }
                "scalar" => args.scalar = true,
                "forms" => args.forms = Some((word.span(), fragment_form(input)?)),
                "compensated" => {
                    input.parse::<Token![=]>()?;
                    args.compensated = Some(input.parse()?);
                }
                "parity" => args.tolerance = Some(parity(input, word.span())?),
                _ => {
                    return Err(syn::Error::new(
                        word.span(),
                        "expected compute, vertex, fragment, threads, precision, texture, outputs, forms, range, cooperative, depends, exact, pinned, scalar, compensated, inputs or parity",
                    ));
                }
            }
            if input.is_empty() {
                break;
            }
            input.parse::<Token![,]>()?;
        }
        Ok(args)
    }
}

/// `(fragment)`, or `(fragment = NAME)`.
fn fragment_form(input: ParseStream<'_>) -> syn::Result<FragmentForm> {
    let content;
    syn::parenthesized!(content in input);
    let word: Ident = content.parse()?;
    if word != "fragment" {
        return Err(syn::Error::new(
            word.span(),
            "an image pass is a compute kernel, which may have one more form: write `forms(fragment)`",
        ));
    }
    if content.is_empty() {
        return Ok(FragmentForm::Own);
    }
    content.parse::<Token![=]>()?;
    Ok(FragmentForm::Of(content.parse()?))
}

fn format(name: &Ident) -> syn::Result<Format> {
    let known = FORMATS.into_iter().find(|known| name == known);
    known.map(|name| Format { name }).ok_or_else(|| {
        syn::Error::new(
            name.span(),
            format!("a format is one of {}", FORMATS.join(", ")),
        )
    })
}

/// A path as the kernel's own module, one below, sees it.
fn from_inside(path: &syn::Path) -> TokenStream {
    match path.segments.first() {
        Some(first) if path.leading_colon.is_none() && first.ident == "self" => {
            let rest = path.segments.iter().skip(1);
            quote!(super #(:: #rest)*)
        }
        Some(first) if path.leading_colon.is_none() && first.ident == "super" => {
            quote!(super::#path)
        }
        _ => quote!(#path),
    }
}

fn numbers(input: ParseStream<'_>) -> syn::Result<Vec<u32>> {
    let content;
    syn::parenthesized!(content in input);
    Punctuated::<LitInt, Token![,]>::parse_terminated(&content)?
        .iter()
        .map(LitInt::base10_parse)
        .collect()
}

fn idents(input: ParseStream<'_>) -> syn::Result<Vec<Ident>> {
    let content;
    syn::parenthesized!(content in input);
    Ok(Punctuated::<Ident, Token![,]>::parse_terminated(&content)?
        .into_iter()
        .collect())
}

fn parity(input: ParseStream<'_>, span: Span) -> syn::Result<Tolerance> {
    let content;
    syn::parenthesized!(content in input);
    let mut tolerance = Tolerance {
        why: String::new(),
        ..Tolerance::none()
    };
    while !content.is_empty() {
        let key: Ident = content.parse()?;
        if key == "exact" || key == "non_finite" {
            if key == "exact" {
                tolerance.exact = idents(&content)?;
            } else {
                tolerance.non_finite = true;
            }
            if content.is_empty() {
                break;
            }
            content.parse::<Token![,]>()?;
            continue;
        }
        content.parse::<Token![=]>()?;
        match key.to_string().as_str() {
            "ulp" => tolerance.ulp = content.parse::<LitInt>()?.base10_parse()?,
            "absolute" => tolerance.absolute = content.parse::<LitFloat>()?.base10_parse()?,
            "why" => tolerance.why = content.parse::<LitStr>()?.value(),
            _ => {
                return Err(syn::Error::new(
                    key.span(),
                    "expected ulp, absolute, non_finite, why or exact",
                ));
            }
        }
        if content.is_empty() {
            break;
        }
        content.parse::<Token![,]>()?;
    }
    if tolerance.why.is_empty() {
        return Err(syn::Error::new(
            span,
            "say why backends may differ: `why = \"…\"`",
        ));
    }
    Ok(tolerance)
}

impl Args {
    fn stage(&self) -> syn::Result<Word> {
        self.stage.ok_or_else(|| {
            syn::Error::new(
                Span::call_site(),
                "say the stage: compute, vertex or fragment",
            )
        })
    }

    /// Formats of several outputs; none where all are buffers, or one format is for the only one.
    fn output_formats(&self, outputs: &[Type]) -> syn::Result<Vec<Option<Format>>> {
        let Some((span, kinds)) = &self.outputs else {
            if outputs.len() > 1 && !self.formats.is_empty() {
                return Err(syn::Error::new(
                    Span::call_site(),
                    "`texture` is for one output: say what each of several is, `outputs(rgba16float, buffer)`",
                ));
            }
            return Ok(if outputs.len() > 1 {
                vec![None; outputs.len()]
            } else {
                Vec::new()
            });
        };
        if !self.formats.is_empty() {
            return Err(syn::Error::new(
                *span,
                "`outputs` says it all: leave `texture` out",
            ));
        }
        if let ([Some(format)], 1) = (kinds.as_slice(), outputs.len()) {
            return Err(syn::Error::new(
                *span,
                format!(
                    "`outputs` is for several results: write `texture({})` for one",
                    format.name
                ),
            ));
        }
        if kinds.len() != outputs.len() {
            return Err(syn::Error::new(
                *span,
                format!(
                    "{} outputs are listed, the function returns {}: list a format or `buffer` for each",
                    kinds.len(),
                    outputs.len()
                ),
            ));
        }
        Ok(kinds.clone())
    }

    fn variants(&self, name: &Ident, real: Option<&Ident>) -> syn::Result<Vec<Variant>> {
        let scalars: Vec<Option<Ident>> = match (real, &self.precision[..]) {
            (None, []) => vec![None],
            (None, [p, ..]) => {
                return Err(syn::Error::new(
                    p.span(),
                    "the function is not generic: it has one precision",
                ));
            }
            (Some(_), []) => vec![Some(format_ident!("f32"))],
            (Some(_), all) => all.iter().cloned().map(Some).collect(),
        };
        let formats: Vec<Option<Format>> = if self.formats.is_empty() {
            vec![None]
        } else {
            self.formats.iter().copied().map(Some).collect()
        };
        let several = formats.len() > 1;
        let mut variants = Vec::new();
        for scalar in &scalars {
            for format in &formats {
                let mut entry = text_of(name);
                if scalar.as_ref().is_some_and(|s| s == "f64") {
                    entry.push_str("_f64");
                }
                if let (Some(f), true) = (format, several) {
                    entry.push('_');
                    entry.push_str(f.name);
                }
                variants.push(Variant {
                    entry,
                    scalar: scalar.clone(),
                    format: *format,
                    fragment: false,
                });
            }
        }
        Ok(variants)
    }

    fn into_stage(
        self,
        params: &[Param],
        outputs: &[Type],
        name: &Ident,
    ) -> syn::Result<(Stage, Tolerance)> {
        let stage = match self.stage()? {
            Word::Compute => {
                let threads = self.threads.clone().ok_or_else(|| {
                    syn::Error::new(name.span(), "say the workgroup's size: `threads(64)`")
                })?;
                let range = match &self.range {
                    Some((span, args)) if args.is_empty() => {
                        return Err(syn::Error::new(
                            *span,
                            "say how far: `range(64)`, `range(size)` with a uniform, or a buffer",
                        ));
                    }
                    Some((_, args)) => Range::parse(args, params, threads.len())?,
                    None => Range::Outputs,
                };
                Stage::Compute(Box::new(Compute {
                    threads,
                    // To be found in the body.
                    cooperative: false,
                    range,
                }))
            }
            word => {
                if self.threads.is_some()
                    || !self.cooperative.is_empty()
                    || self.depends.is_some()
                    || self.range.is_some()
                    || self.outputs.is_some()
                    || self.forms.is_some()
                    || !self.formats.is_empty()
                {
                    return Err(syn::Error::new(
                        name.span(),
                        "threads, range, outputs, forms, cooperative, depends and texture belong to compute kernels",
                    ));
                }
                if outputs.is_empty() {
                    return Err(syn::Error::new(
                        name.span(),
                        if word == Word::Vertex {
                            "a vertex kernel returns the clip-space position, a Vec4, or a tuple of it and the varyings"
                        } else {
                            "a fragment kernel returns a colour or a Depth: WebGPU draws into one target at least. One that only writes memory returns a colour for a target that nobody reads"
                        },
                    ));
                }
                if word == Word::Vertex {
                    Stage::Vertex
                } else {
                    Stage::Fragment
                }
            }
        };
        let tolerance = self.tolerance.unwrap_or_else(Tolerance::none);
        Ok((stage, tolerance))
    }
}
