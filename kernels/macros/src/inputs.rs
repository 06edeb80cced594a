//! What the numbers of a parameter or a field are like: attributes of their own, from which parity
//! makes inputs and the command line takes defaults and units.
//!
//! Nothing else says it: neither a name nor a documentation comment.

use proc_macro2::{Ident, Span, TokenStream};
use quote::quote;
use syn::punctuated::Punctuated;
use syn::spanned::Spanned;
use syn::{Attribute, BinOp, Expr, ExprLit, Lit, LitInt, LitStr, Meta, RangeLimits, Token};

use crate::kernel::{SamplerKind, text_of};

/// The attributes' names.
const WORDS: [&str; 17] = [
    "range",
    "magnitude",
    "values",
    "unit_vector",
    "distinct",
    "count_of",
    "index_of",
    "default",
    "unit",
    "length",
    "size",
    "levels",
    "layers",
    "filter",
    "mip_filter",
    "address",
    "compare",
];

const FILTERS: [(&str, &str); 2] = [("nearest", "Nearest"), ("linear", "Linear")];

const ADDRESSES: [(&str, &str); 3] = [
    ("clamp_to_edge", "ClampToEdge"),
    ("repeat", "Repeat"),
    ("mirror_repeat", "MirrorRepeat"),
];

const COMPARISONS: [(&str, &str); 8] = [
    ("never", "Never"),
    ("less", "Less"),
    ("equal", "Equal"),
    ("less_equal", "LessEqual"),
    ("greater", "Greater"),
    ("not_equal", "NotEqual"),
    ("greater_equal", "GreaterEqual"),
    ("always", "Always"),
];

/// What attributes say of a parameter or a field.
#[derive(Default)]
pub struct Inputs {
    /// Where its numbers lie, and the attribute that says so.
    domain: Option<(Domain, Span)>,
    default: Option<Expr>,
    unit: Option<LitStr>,
    /// Elements of a buffer.
    length: Option<(Length, Span)>,
    /// Texels of a texture.
    size: Option<(Vec<u32>, Span)>,
    /// Mip levels of a texture.
    levels: Option<(u32, Span)>,
    /// Layers or cubes of an array.
    layers: Option<(u32, Span)>,
    /// Variants of `native::Filter`, `native::Address` and `native::Compare`.
    filter: Option<(Ident, Span)>,
    mip_filter: Option<(Ident, Span)>,
    address: Option<(Ident, Span)>,
    compare: Option<(Ident, Span)>,
}

enum Domain {
    Range(Expr, Expr),
    Magnitude(Expr, Expr),
    Values(Vec<Expr>),
    UnitVector,
    Distinct,
    CountOf(Ident),
    IndexOf(Ident),
}

enum Length {
    Between(u32, u32),
    Of { param: Ident, times: u32, plus: i32 },
}

/// What numbers are asked of, for the checks.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Holder {
    /// A field of a structure.
    Field,
    /// A parameter that is a buffer of elements.
    Buffer,
    /// Integers for atomic operations: they begin as zeros.
    Counters,
    /// A parameter that is a texture.
    Texture {
        /// Dimensions of a layer.
        dimensions: usize,
        /// It can have several mip levels.
        levels: bool,
        /// It has any number of layers.
        array: bool,
        /// Its layers are squares.
        cube: bool,
    },
    /// A storage texture: nothing is said of its texels.
    Texels {
        /// It has any number of layers.
        array: bool,
    },
    /// A sampler.
    Sampler(SamplerKind),
    /// Any other parameter with numbers.
    Value,
    /// A specialisation constant.
    Constant,
    /// A parameter without numbers of the caller's: an index, counters, shared memory.
    Nothing,
}

fn is_ours(attribute: &Attribute) -> bool {
    attribute
        .path()
        .get_ident()
        .is_some_and(|i| WORDS.iter().any(|w| i == w))
}

impl Inputs {
    /// Takes the attributes that are this module's out of `attributes`.
    pub fn take(attributes: &mut Vec<Attribute>) -> syn::Result<Self> {
        let inputs = Self::parse(attributes)?;
        attributes.retain(|a| !is_ours(a));
        Ok(inputs)
    }

    /// Reads the attributes that are this module's.
    pub fn parse(attributes: &[Attribute]) -> syn::Result<Self> {
        let mut inputs = Self::default();
        for attribute in attributes.iter().filter(|a| is_ours(a)) {
            inputs.add(attribute)?;
        }
        Ok(inputs)
    }

    fn add(&mut self, attribute: &Attribute) -> syn::Result<()> {
        let word = attribute.path().require_ident()?.to_string();
        let span = attribute.span();
        let twice = || {
            Err(syn::Error::new(
                span,
                format!("`{word}` is said twice: keep one of them"),
            ))
        };
        let domain = match word.as_str() {
            "range" => {
                let (least, most) = range(attribute)?;
                Domain::Range(least, most)
            }
            "magnitude" => {
                let (least, most) = range(attribute)?;
                Domain::Magnitude(least, most)
            }
            "values" => {
                let parse = Punctuated::<Expr, Token![,]>::parse_terminated;
                let values: Vec<Expr> = attribute.parse_args_with(parse)?.into_iter().collect();
                if values.is_empty() {
                    return Err(syn::Error::new(
                        span,
                        "write the values: #[values(0, 1, 2)]",
                    ));
                }
                Domain::Values(values)
            }
            "unit_vector" => {
                attribute.meta.require_path_only()?;
                Domain::UnitVector
            }
            "distinct" => {
                attribute.meta.require_path_only()?;
                Domain::Distinct
            }
            "count_of" => Domain::CountOf(attribute.parse_args()?),
            "index_of" => Domain::IndexOf(attribute.parse_args()?),
            "default" => {
                let value = attribute.parse_args()?;
                return match self.default.replace(value) {
                    None => Ok(()),
                    Some(_) => twice(),
                };
            }
            "unit" => {
                let text = match &attribute.meta {
                    Meta::NameValue(it) => match &it.value {
                        Expr::Lit(ExprLit {
                            lit: Lit::Str(text),
                            ..
                        }) => Some(text.clone()),
                        _ => None,
                    },
                    _ => None,
                };
                let text = text
                    .filter(|t| !t.value().trim().is_empty())
                    .ok_or_else(|| syn::Error::new(span, "write the unit as #[unit = \"m\"]"))?;
                return match self.unit.replace(text) {
                    None => Ok(()),
                    Some(_) => twice(),
                };
            }
            "length" => {
                let length = length(&attribute.parse_args()?)?;
                return match self.length.replace((length, span)) {
                    None => Ok(()),
                    Some(_) => twice(),
                };
            }
            "levels" | "layers" => {
                let number = attribute.parse_args::<LitInt>()?.base10_parse()?;
                let (slot, most) = if word == "levels" {
                    (&mut self.levels, 13)
                } else {
                    (&mut self.layers, 256)
                };
                if !(1..=most).contains(&number) {
                    return Err(syn::Error::new(
                        span,
                        format!("`{word}` is a number from 1 to {most}"),
                    ));
                }
                return match slot.replace((number, span)) {
                    None => Ok(()),
                    Some(_) => twice(),
                };
            }
            "filter" | "mip_filter" | "address" | "compare" => {
                let (slot, known): (_, &[(&str, &str)]) = match word.as_str() {
                    "filter" => (&mut self.filter, &FILTERS),
                    "mip_filter" => (&mut self.mip_filter, &FILTERS),
                    "address" => (&mut self.address, &ADDRESSES),
                    _ => (&mut self.compare, &COMPARISONS),
                };
                let said: Ident = attribute.parse_args()?;
                let Some((_, variant)) = known.iter().find(|(name, _)| said == name) else {
                    let names: Vec<_> = known.iter().map(|(name, _)| *name).collect();
                    return Err(syn::Error::new(
                        said.span(),
                        format!("`{word}` is one of {}", names.join(", ")),
                    ));
                };
                return match slot.replace((Ident::new(variant, said.span()), span)) {
                    None => Ok(()),
                    Some(_) => twice(),
                };
            }
            _ => {
                let parse = Punctuated::<LitInt, Token![,]>::parse_terminated;
                let size = attribute
                    .parse_args_with(parse)?
                    .iter()
                    .map(LitInt::base10_parse)
                    .collect::<syn::Result<Vec<u32>>>()?;
                if !(1..=3).contains(&size.len()) || size.iter().any(|n| !(1..=4096).contains(n)) {
                    return Err(syn::Error::new(
                        span,
                        "a texture's size is 1 to 3 numbers of texels, 1 to 4096 each: #[size(64, 32)]",
                    ));
                }
                return match self.size.replace((size, span)) {
                    None => Ok(()),
                    Some(_) => twice(),
                };
            }
        };
        match self.domain.replace((domain, span)) {
            None => Ok(()),
            Some(_) => Err(syn::Error::new(
                span,
                "range, magnitude, values, unit_vector, distinct, count_of and index_of exclude each other: keep one of them",
            )),
        }
    }

    /// Refuses what would mean nothing where it stands. `params` are the names that lengths may
    /// refer to: of the kernel's buffers and textures.
    pub fn check(&self, holder: Holder, params: &[&Ident]) -> syn::Result<()> {
        let error = |span: Span, text: &str| Err(syn::Error::new(span, text));
        let named = |param: &Ident| {
            if holder == Holder::Field || params.contains(&param) {
                return Ok(());
            }
            let known: Vec<String> = params.iter().map(|p| format!("`{p}`")).collect();
            Err(syn::Error::new(
                param.span(),
                format!(
                    "the kernel has no buffer or texture `{param}`; it has {}",
                    if known.is_empty() {
                        "none".into()
                    } else {
                        known.join(", ")
                    }
                ),
            ))
        };
        if let Some((domain, span)) = &self.domain {
            match domain {
                _ if matches!(
                    holder,
                    Holder::Nothing | Holder::Counters | Holder::Texels { .. } | Holder::Sampler(_)
                ) =>
                {
                    return error(
                        *span,
                        "this parameter has no numbers that inputs are made for",
                    );
                }
                Domain::UnitVector
                    if matches!(holder, Holder::Texture { .. } | Holder::Constant) =>
                {
                    return error(*span, "only vectors have a length");
                }
                Domain::Distinct if holder != Holder::Buffer => {
                    return error(*span, "only the elements of a buffer can be told apart");
                }
                Domain::CountOf(_) | Domain::IndexOf(_)
                    if matches!(holder, Holder::Texture { .. }) =>
                {
                    return error(*span, "a texture's channels are no counts");
                }
                Domain::CountOf(param) | Domain::IndexOf(param) => named(param)?,
                _ => {}
            }
        }
        if let (
            Some(default),
            Holder::Buffer
            | Holder::Counters
            | Holder::Texture { .. }
            | Holder::Texels { .. }
            | Holder::Sampler(_)
            | Holder::Nothing,
        ) = (&self.default, holder)
        {
            return error(default.span(), "only a uniform's numbers have a default");
        }
        if let Some((length, span)) = &self.length {
            if !matches!(holder, Holder::Buffer | Holder::Counters) {
                return error(*span, "only a buffer has a length");
            }
            if let Length::Of { param, .. } = length {
                named(param)?;
            }
        }
        for (said, wanted) in [(&self.levels, "levels"), (&self.layers, "layers")] {
            let has = matches!(
                (holder, wanted),
                (Holder::Texture { levels: true, .. }, "levels")
                    | (Holder::Texture { array: true, .. }, "layers")
                    | (Holder::Texels { array: true }, "layers")
            );
            if let (Some((_, span)), false) = (said, has) {
                return error(*span, &format!("this has no {wanted} to choose"));
            }
        }
        let filters = [&self.filter, &self.mip_filter]
            .into_iter()
            .flatten()
            .next();
        if let (Holder::Sampler(SamplerKind::NonFiltering), Some((_, span))) = (holder, filters) {
            return error(*span, "a `NonFilteringSampler` takes the nearest texel");
        }
        for (said, compares) in [
            (&self.filter, false),
            (&self.mip_filter, false),
            (&self.address, false),
            (&self.compare, true),
        ] {
            let has = match holder {
                Holder::Sampler(kind) => kind == SamplerKind::Comparison || !compares,
                _ => false,
            };
            if let (Some((_, span)), false) = (said, has) {
                let text = if compares {
                    "only a `ComparisonSampler` compares"
                } else {
                    "only a sampler has filters and address modes"
                };
                return error(*span, text);
            }
        }
        let Some((size, span)) = &self.size else {
            return Ok(());
        };
        let Holder::Texture {
            dimensions, cube, ..
        } = holder
        else {
            return error(
                *span,
                "only a texture that is read has a size in texels by itself: what is written has the size of the range",
            );
        };
        if size.len() != dimensions {
            return error(
                *span,
                &format!(
                    "its size has as many numbers as it has dimensions, {dimensions}; layers have an attribute of their own"
                ),
            );
        }
        if cube && size[0] != size[1] {
            return error(*span, "the faces of a cube are squares");
        }
        let Some((levels, span)) = &self.levels else {
            return Ok(());
        };
        let largest = size.iter().max().copied().unwrap_or(1);
        if largest >> (levels - 1) == 0 {
            return error(
                *span,
                &format!(
                    "{largest} texels have {} levels at most",
                    largest.ilog2() + 1
                ),
            );
        }
        Ok(())
    }

    /// The record of it, a `describe::Inputs`.
    pub fn describe(&self) -> TokenStream {
        let domain = match &self.domain {
            None => quote!(None),
            Some((domain, span)) => {
                let made = match domain {
                    Domain::Range(least, most) => {
                        let (a, b) = (number(least), number(most));
                        let ends = ordered(*span, &a, &b, "range", &quote!(true));
                        quote!(Range { least: #ends[0], most: #ends[1] })
                    }
                    Domain::Magnitude(least, most) => {
                        let (a, b) = (number(least), number(most));
                        let ends = ordered(*span, &a, &b, "magnitude", &quote!(ENDS[0] > 0.0));
                        quote!(Magnitude { least: #ends[0], most: #ends[1] })
                    }
                    Domain::Values(values) => {
                        let values = values.iter().map(number);
                        quote!(Values { values: [#(#values),*].into() })
                    }
                    Domain::UnitVector => quote!(UnitVector),
                    Domain::Distinct => quote!(Distinct),
                    Domain::CountOf(param) => {
                        let param = text_of(param);
                        quote!(CountOf { param: describe::text(#param) })
                    }
                    Domain::IndexOf(param) => {
                        let param = text_of(param);
                        quote!(IndexOf { param: describe::text(#param) })
                    }
                };
                quote!(Some(describe::Domain::#made))
            }
        };
        let default = match &self.default {
            None => quote!(None),
            Some(value) => {
                let value = number(value);
                quote!(Some(#value))
            }
        };
        let unit = match &self.unit {
            None => quote!(None),
            Some(unit) => quote!(Some(describe::text(#unit))),
        };
        let length = match &self.length {
            None => quote!(None),
            Some((Length::Between(least, most), _)) => {
                quote!(Some(describe::Length::Between { least: #least, most: #most }))
            }
            Some((Length::Of { param, times, plus }, _)) => {
                let param = text_of(param);
                quote!(Some(describe::Length::Of { param: describe::text(#param), times: #times, plus: #plus }))
            }
        };
        let size = match &self.size {
            None => quote!(None),
            Some((size, _)) => {
                let mut size = size.clone();
                size.resize(3, 1);
                quote!(Some([#(#size),*]))
            }
        };
        let number_of = |said: &Option<(u32, Span)>| match said {
            None => quote!(None),
            Some((number, _)) => quote!(Some(#number)),
        };
        let (levels, layers) = (number_of(&self.levels), number_of(&self.layers));
        let variant = |of: &str, said: &Option<(Ident, Span)>| match said {
            None => quote!(None),
            Some((variant, _)) => {
                let of = Ident::new(of, Span::call_site());
                quote!(Some(::hankel_dsl::native::#of::#variant))
            }
        };
        let filter = variant("Filter", &self.filter);
        let mip_filter = variant("Filter", &self.mip_filter);
        let address = variant("Address", &self.address);
        let compare = variant("Compare", &self.compare);
        quote! {
            describe::Inputs {
                domain: #domain,
                default: #default,
                unit: #unit,
                length: #length,
                size: #size,
                levels: #levels,
                layers: #layers,
                filter: #filter,
                mip_filter: #mip_filter,
                address: #address,
                compare: #compare,
            }
        }
    }
}

/// An expression as `f64`. A literal without a type would become an `i32` first, which may be too
/// small for it.
fn number(expression: &Expr) -> TokenStream {
    match expression {
        Expr::Lit(ExprLit {
            lit: Lit::Int(n), ..
        }) if n.suffix().is_empty() => {
            let n = syn::LitFloat::new(&format!("{}.0", n.base10_digits()), n.span());
            quote!(#n)
        }
        Expr::Unary(unary) if matches!(unary.op, syn::UnOp::Neg(_)) => {
            let inner = number(&unary.expr);
            quote!(-#inner)
        }
        other => quote!((#other) as f64),
    }
}

/// Two ends that are checked at compile time.
fn ordered(
    span: Span,
    least: &TokenStream,
    most: &TokenStream,
    word: &str,
    also: &TokenStream,
) -> TokenStream {
    let message = if word == "range" {
        "a range's first number is not above its second, and both are finite"
    } else {
        "a magnitude lies between two finite positive numbers, the smaller one first"
    };
    quote::quote_spanned! {span=>
        {
            const ENDS: [f64; 2] = [#least, #most];
            const _: () = assert!(
                ENDS[0] <= ENDS[1] && ENDS[0].is_finite() && ENDS[1].is_finite() && #also,
                #message
            );
            ENDS
        }
    }
}

/// `A..=B`.
fn range(attribute: &Attribute) -> syn::Result<(Expr, Expr)> {
    let expected = "write both ends and what lies between: `0.0..=1.0`";
    match attribute.parse_args::<Expr>()? {
        Expr::Range(range) => match (range.start, range.limits, range.end) {
            (Some(least), RangeLimits::Closed(_), Some(most)) => Ok((*least, *most)),
            _ => Err(syn::Error::new(attribute.span(), expected)),
        },
        other => Err(syn::Error::new(other.span(), expected)),
    }
}

/// `7`, `1..=64`, `other`, `other * 3`, `other + 1`, `other - 1`.
fn length(expression: &Expr) -> syn::Result<Length> {
    let number = |e: &Expr| match e {
        Expr::Lit(ExprLit {
            lit: Lit::Int(n), ..
        }) => n.base10_parse::<u32>().ok().filter(|n| *n <= 1 << 20),
        _ => None,
    };
    let name = |e: &Expr| match e {
        Expr::Path(path) => path.path.get_ident().cloned(),
        _ => None,
    };
    let made = match expression {
        Expr::Lit(_) => number(expression).map(|n| Length::Between(n, n)),
        Expr::Path(_) => name(expression).map(|param| Length::Of {
            param,
            times: 1,
            plus: 0,
        }),
        Expr::Range(range) => match (&range.start, range.limits, &range.end) {
            (Some(a), RangeLimits::Closed(_), Some(b)) => match (number(a), number(b)) {
                (Some(a), Some(b)) if a <= b => Some(Length::Between(a, b)),
                _ => None,
            },
            _ => None,
        },
        Expr::Binary(binary) => match (name(&binary.left), number(&binary.right), binary.op) {
            (Some(param), Some(times), BinOp::Mul(_)) => Some(Length::Of {
                param,
                times,
                plus: 0,
            }),
            (Some(param), Some(n), BinOp::Add(_)) => Some(Length::Of {
                param,
                times: 1,
                plus: n as i32,
            }),
            (Some(param), Some(n), BinOp::Sub(_)) => Some(Length::Of {
                param,
                times: 1,
                plus: -(n as i32),
            }),
            _ => None,
        },
        _ => None,
    };
    made.ok_or_else(|| {
        syn::Error::new(
            expression.span(),
            "a length is a number up to 1048576, a range `1..=64`, or another buffer's: `other`, `other * 3`, `other + 1`",
        )
    })
}
