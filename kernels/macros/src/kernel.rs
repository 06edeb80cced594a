//! What `#[kernel]` says, taken apart: [`Kernel`] is the one form that both expansions start from.

use proc_macro2::{Ident, Span, TokenStream};
use quote::{format_ident, quote};
use syn::ext::IdentExt;
use syn::parse::{Parse, ParseStream, Parser};
use syn::punctuated::Punctuated;
use syn::spanned::Spanned;
use syn::{Attribute, FnArg, GenericParam, ItemFn, LitFloat, LitInt, LitStr, Pat, Token, Type};

use crate::element::{replace, summary};

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
    /// Entry points to make.
    pub variants: Vec<Variant>,
    pub tolerance: Tolerance,
    /// Arithmetic is done as it is written.
    pub exact: bool,
    /// In SPIR-V it is.
    pub pinned: bool,
}

pub enum Stage {
    Compute(Compute),
    Vertex,
    Fragment,
}

pub struct Compute {
    pub threads: Vec<u32>,
    pub phases: Option<u32>,
    pub per_group: bool,
}

/// One entry point of the function.
pub struct Variant {
    pub entry: String,
    pub scalar: Option<Ident>,
    pub format: Option<Format>,
}

/// A texel format: its name here, in `Image!`, and as a variant of `TexelFormat`.
#[derive(Clone, Copy)]
pub struct Format {
    pub name: &'static str,
    pub variant: &'static str,
}

const FORMATS: [Format; 7] = [
    Format {
        name: "r32float",
        variant: "R32Float",
    },
    Format {
        name: "rgba32float",
        variant: "Rgba32Float",
    },
    Format {
        name: "rgba16float",
        variant: "Rgba16Float",
    },
    Format {
        name: "rgba16unorm",
        variant: "Rgba16Unorm",
    },
    Format {
        name: "rgba8unorm",
        variant: "Rgba8Unorm",
    },
    Format {
        name: "r32uint",
        variant: "R32Uint",
    },
    Format {
        name: "rgba32uint",
        variant: "Rgba32Uint",
    },
];

#[derive(Clone)]
pub struct Tolerance {
    pub ulp: u32,
    pub absolute: f64,
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
            why: "only correctly rounded operations, comparisons and selections: the same bits everywhere".into(),
            exact: Vec::new(),
        }
    }

    /// What concerns one entry point.
    pub fn of(&self, variant: &Variant) -> Self {
        match variant.format {
            Some(format) if self.exact.iter().any(|f| f == format.name) => Self::none(),
            _ => self.clone(),
        }
    }
}

pub struct Param {
    pub name: Ident,
    pub role: Role,
}

/// What a parameter is bound to; types are the values', without `&`, `Option` or `Buffer`.
pub enum Role {
    Uniform(Type),
    Element(Type),
    Storage(Type),
    Atomic,
    Texture(Texture),
    Sampler,
    Constant { id: u32, default: u32 },
    Index,
    Group { slot: Type, size: u32 },
    Phase,
    Attribute(Type),
    Varying(Type),
}

#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Texture {
    Flat,
    Multisampled,
    Volume,
}

impl Role {
    /// Whether a descriptor is bound for it.
    pub fn is_bound(&self) -> bool {
        matches!(
            self,
            Self::Uniform(_)
                | Self::Element(_)
                | Self::Storage(_)
                | Self::Atomic
                | Self::Texture(_)
                | Self::Sampler
        )
    }
}

const ROLES: &str = "uniform, element, storage, atomic, texture, sampler, constant, index, group, phase, attribute, varying";

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
        let params = item
            .sig
            .inputs
            .iter_mut()
            .map(parse_param)
            .collect::<syn::Result<Vec<_>>>()?;
        let outputs = match &item.sig.output {
            syn::ReturnType::Default => Vec::new(),
            syn::ReturnType::Type(_, ty) => match (&**ty, args.stage()?) {
                (Type::Tuple(t), Word::Vertex | Word::Fragment) => {
                    t.elems.iter().cloned().collect()
                }
                (ty, _) => vec![ty.clone()],
            },
        };
        let variants = args.variants(&name, real.as_ref())?;
        let (exact, pinned) = (args.exact, args.pinned);
        let stage = args.into_stage(&params, &outputs, &name)?;
        let tolerance = stage.1;
        let kernel = Self {
            item,
            name,
            summary,
            stage: stage.0,
            real,
            params,
            outputs,
            variants,
            tolerance,
            exact,
            pinned,
        };
        kernel.check()?;
        Ok(kernel)
    }

    /// Whether the output is a texel.
    pub fn writes_texture(&self) -> bool {
        self.variants.iter().any(|v| v.format.is_some())
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

    /// The parameter whose length is the number of invocations of a kernel without output.
    pub fn extent_param(&self) -> Option<&Param> {
        self.params
            .iter()
            .find(|p| matches!(p.role, Role::Element(_) | Role::Storage(_)))
    }

    fn check(&self) -> syn::Result<()> {
        let error = |span: Span, text: &str| Err(syn::Error::new(span, text));
        let compute = match &self.stage {
            Stage::Compute(c) => Some(c),
            _ => None,
        };
        let phases = compute.and_then(|c| c.phases);
        for p in &self.params {
            let span = p.name.span();
            match (&p.role, &self.stage) {
                (Role::Attribute(_), Stage::Vertex) | (Role::Varying(_), Stage::Fragment) => {}
                (Role::Attribute(_), _) => {
                    return error(span, "only a vertex kernel has attributes");
                }
                (Role::Varying(_), _) => return error(span, "only a fragment kernel has varyings"),
                (
                    Role::Element(_) | Role::Index | Role::Atomic,
                    Stage::Vertex | Stage::Fragment,
                ) => {
                    return error(
                        span,
                        "elements, indices and atomics belong to compute kernels",
                    );
                }
                (Role::Group { size, .. }, Stage::Compute(c)) => {
                    if c.phases.is_none() {
                        return error(span, "workgroup memory needs phases: add `phases(N)`");
                    }
                    if *size != c.threads.iter().product::<u32>() {
                        return error(
                            span,
                            "`Group` must have as many slots as the workgroup has threads",
                        );
                    }
                }
                (Role::Group { .. } | Role::Phase, Stage::Vertex | Stage::Fragment) => {
                    return error(
                        span,
                        "workgroup memory and phases belong to compute kernels",
                    );
                }
                (Role::Phase, Stage::Compute(c)) if c.phases.is_none() => {
                    return error(span, "add `phases(N)` to the kernel");
                }
                _ => {}
            }
        }
        let span = self.name.span();
        if phases.is_some() {
            if self.dimensions() != 1 {
                return error(span, "a kernel with phases has one dimension");
            }
            if self.real.is_some() {
                return error(
                    span,
                    "a kernel with phases cannot be generic over `Real`: write it for f32",
                );
            }
            if !self
                .params
                .iter()
                .any(|p| matches!(p.role, Role::Group { .. }))
            {
                return error(span, "a kernel with phases needs a `#[group]` parameter");
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
        if compute.is_some() && !self.writes_texture() && self.dimensions() != 1 {
            return error(
                span,
                "a map over 2 or 3 dimensions writes a texture: add `texture(FORMAT)`",
            );
        }
        if self.writes_texture() && self.dimensions() == 1 {
            return error(
                span,
                "a texture has 2 or 3 dimensions: write `threads(8, 8)`",
            );
        }
        if self.outputs.is_empty() {
            if !self.params.iter().any(|p| matches!(p.role, Role::Atomic)) {
                return error(span, "a kernel must return what it computes");
            }
            if self.extent_param().is_none() {
                return error(
                    span,
                    "a kernel without a result runs once for each element: give it an `#[element]`",
                );
            }
        }
        if let Some(Param { name, .. }) = self.params.iter().find(|p| p.name == "output") {
            return error(
                name.span(),
                "`output` is the result's own name: choose another",
            );
        }
        Ok(())
    }

    /// The function as it was, and beside it a module of the same name with all that is made.
    pub fn expand(&self) -> TokenStream {
        let (item, vis, name) = (&self.item, &self.item.vis, &self.name);
        let shader = self.expand_shader();
        let host = self.expand_host();
        quote! {
            #[inline(always)]
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
        "uniform" => match ty {
            Type::Reference(r) if r.mutability.is_none() => Role::Uniform((*r.elem).clone()),
            _ => return Err(syn::Error::new(ty.span(), "a uniform is `&T`")),
        },
        "element" => Role::Element(argument(ty, "Option").unwrap_or_else(|| ty.clone())),
        "storage" => Role::Storage(
            argument(ty, "Buffer")
                .ok_or_else(|| syn::Error::new(ty.span(), "a storage buffer is `Buffer<'_, T>`"))?,
        ),
        "atomic" => Role::Atomic,
        "texture" => Role::Texture(
            match last_segment(ty).map(|s| s.ident.to_string()).as_deref() {
                Some("Texture2d") => Texture::Flat,
                Some("Texture2dMultisampled") => Texture::Multisampled,
                Some("Texture3d") => Texture::Volume,
                _ => {
                    return Err(syn::Error::new(
                        ty.span(),
                        "a texture is `Texture2d<'_>`, `Texture2dMultisampled<'_>` or `Texture3d<'_>`",
                    ));
                }
            },
        ),
        "sampler" => Role::Sampler,
        "constant" => {
            let (mut id, mut default) = (None, None);
            role.parse_nested_meta(|meta| {
                let value: LitInt = meta.value()?.parse()?;
                match meta.path.get_ident() {
                    Some(i) if i == "id" => id = Some(value.base10_parse()?),
                    Some(i) if i == "default" => default = Some(value.base10_parse()?),
                    _ => return Err(meta.error("expected `id` or `default`")),
                }
                Ok(())
            })?;
            match (id, default) {
                (Some(id), Some(default)) => Role::Constant { id, default },
                _ => {
                    return Err(syn::Error::new(
                        role.span(),
                        "write #[constant(id = N, default = V)]",
                    ));
                }
            }
        }
        "index" => Role::Index,
        "group" => group(ty)?,
        "phase" => Role::Phase,
        "attribute" => Role::Attribute(ty.clone()),
        _ => Role::Varying(ty.clone()),
    };
    Ok(Param { name, role })
}

fn last_segment(ty: &Type) -> Option<&syn::PathSegment> {
    match ty {
        Type::Path(p) => p.path.segments.last(),
        _ => None,
    }
}

/// `T` of `NAME<'_, T>`.
fn argument(ty: &Type, name: &str) -> Option<Type> {
    let segment = last_segment(ty).filter(|s| s.ident == name)?;
    let syn::PathArguments::AngleBracketed(args) = &segment.arguments else {
        return None;
    };
    args.args.iter().find_map(|a| match a {
        syn::GenericArgument::Type(t) => Some(t.clone()),
        _ => None,
    })
}

fn group(ty: &Type) -> syn::Result<Role> {
    let error = || {
        syn::Error::new(
            ty.span(),
            "workgroup memory is `Group<'_, T, N>`, N a number",
        )
    };
    let slot = argument(ty, "Group").ok_or_else(error)?;
    let segment = last_segment(ty).ok_or_else(error)?;
    let syn::PathArguments::AngleBracketed(args) = &segment.arguments else {
        return Err(error());
    };
    let size = args.args.iter().find_map(|a| match a {
        syn::GenericArgument::Const(syn::Expr::Lit(l)) => match &l.lit {
            syn::Lit::Int(i) => i.base10_parse().ok(),
            _ => None,
        },
        _ => None,
    });
    Ok(Role::Group {
        slot,
        size: size.ok_or_else(error)?,
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
    phases: Option<u32>,
    per_group: bool,
    tolerance: Option<Tolerance>,
    exact: bool,
    pinned: bool,
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
                "per_group" => args.per_group = true,
                "exact" => args.exact = true,
                "pinned" => args.pinned = true,
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
                "phases" => match numbers(input)?[..] {
                    [n] if n > 0 && n <= 64 => args.phases = Some(n),
                    _ => {
                        return Err(syn::Error::new(
                            word.span(),
                            "`phases` takes a number from 1 to 64",
                        ));
                    }
                },
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
                        let format = FORMATS.into_iter().find(|known| f == known.name);
                        args.formats.push(format.ok_or_else(|| {
                            let names: Vec<_> = FORMATS.iter().map(|f| f.name).collect();
                            syn::Error::new(
                                f.span(),
                                format!("a format is one of {}", names.join(", ")),
                            )
                        })?);
                    }
                }
                "parity" => args.tolerance = Some(parity(input, word.span())?),
                _ => {
                    return Err(syn::Error::new(
                        word.span(),
                        "expected compute, vertex, fragment, threads, precision, texture, phases, per_group, exact, pinned or parity",
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
        if key == "exact" {
            tolerance.exact = idents(&content)?;
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
                    "expected ulp, absolute, why or exact",
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
                let mut entry = name.unraw().to_string();
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
            Word::Compute => Stage::Compute(Compute {
                threads: self.threads.clone().ok_or_else(|| {
                    syn::Error::new(name.span(), "say the workgroup's size: `threads(64)`")
                })?,
                phases: self.phases,
                per_group: self.per_group,
            }),
            word => {
                if self.threads.is_some()
                    || self.phases.is_some()
                    || self.per_group
                    || !self.formats.is_empty()
                {
                    return Err(syn::Error::new(
                        name.span(),
                        "threads, phases, per_group and texture belong to compute kernels",
                    ));
                }
                if outputs.is_empty() {
                    return Err(syn::Error::new(
                        name.span(),
                        "a kernel must return what it computes",
                    ));
                }
                if word == Word::Vertex {
                    Stage::Vertex
                } else {
                    Stage::Fragment
                }
            }
        };
        if self.per_group && self.phases.is_none() {
            return Err(syn::Error::new(
                name.span(),
                "`per_group` needs `phases(N)`",
            ));
        }
        let samples = params.iter().any(|p| matches!(p.role, Role::Sampler));
        let tolerance = match self.tolerance {
            Some(t) => t,
            None if samples => {
                return Err(syn::Error::new(
                    name.span(),
                    "hardware may round a sampler's weights: state `parity(ulp = …, absolute = …, why = \"…\")`",
                ));
            }
            None => Tolerance::none(),
        };
        Ok((stage, tolerance))
    }
}
