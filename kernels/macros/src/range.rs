//! `range(…)`: how many invocations run.

use proc_macro2::{Ident, TokenStream};
use quote::{format_ident, quote, quote_spanned};
use syn::punctuated::Punctuated;
use syn::spanned::Spanned;
use syn::{Expr, Lit, Token};

use crate::kernel::{Kernel, Param, Role, Stage, text_of};

/// How many invocations of a compute kernel run.
pub enum Range {
    /// As many as the first output has elements; without outputs, the first element buffer.
    Outputs,
    /// As many as this buffer has elements.
    Elements(Ident),
    /// So many along each axis.
    Fixed(Vec<u32>),
    /// What a uniform says: the parameter, and the path to the value from it on.
    Uniform { param: Ident, value: Expr },
}

const EXPECTED: &str = "`range` takes a number for each dimension, a uniform that is or has the size (`range(size)`, `range(grid.size)`), or a buffer parameter";

impl Range {
    /// Takes the argument apart, for a kernel of so many dimensions.
    pub fn parse(
        args: &Punctuated<Expr, Token![,]>,
        params: &[Param],
        dimensions: usize,
    ) -> syn::Result<Self> {
        let error = |span, text: &str| Err(syn::Error::new(span, text));
        let numbers: Vec<Option<u32>> = args.iter().map(number).collect();
        if !numbers.is_empty() && numbers.iter().all(Option::is_some) {
            let numbers: Vec<u32> = numbers.into_iter().flatten().collect();
            if numbers.len() != dimensions || numbers.contains(&0) {
                return error(
                    args.span(),
                    "`range` has as many numbers as `threads`, each at least 1",
                );
            }
            return Ok(Self::Fixed(numbers));
        }
        let Some(value) = args.first().filter(|_| args.len() == 1) else {
            return error(args.span(), EXPECTED);
        };
        let Some(base) = base(value) else {
            return error(value.span(), EXPECTED);
        };
        let Some(param) = params.iter().find(|p| p.name == base) else {
            return error(base.span(), "there is no parameter of this name");
        };
        match (&param.role, value) {
            (Role::Uniform(_), _) => Ok(Self::Uniform {
                param: base,
                value: value.clone(),
            }),
            (
                Role::Element(_)
                | Role::ElementMut(_)
                | Role::Storage(_)
                | Role::StorageMut { .. }
                | Role::Atomic { .. },
                Expr::Path(_),
            ) if dimensions == 1 => Ok(Self::Elements(base)),
            _ if dimensions > 1 => error(
                value.span(),
                "a buffer has one length: say the size of 2 or 3 dimensions with numbers or with a uniform",
            ),
            _ => error(value.span(), EXPECTED),
        }
    }
}

fn number(expr: &Expr) -> Option<u32> {
    match expr {
        Expr::Lit(l) => match &l.lit {
            Lit::Int(i) => i.base10_parse().ok(),
            _ => None,
        },
        _ => None,
    }
}

/// `a` of `a.b.c`.
fn base(expr: &Expr) -> Option<Ident> {
    match expr {
        Expr::Path(p) => p.path.get_ident().cloned(),
        Expr::Field(f) => base(&f.base),
        _ => None,
    }
}

/// `b.c` of `a.b.c`.
fn fields(expr: &Expr) -> TokenStream {
    match expr {
        Expr::Field(f) => {
            let (before, member) = (fields(&f.base), &f.member);
            if before.is_empty() {
                quote!(#member)
            } else {
                quote!(#before.#member)
            }
        }
        _ => TokenStream::new(),
    }
}

impl Kernel {
    fn range(&self) -> &Range {
        match &self.stage {
            Stage::Compute(c) => &c.range,
            _ => &Range::Outputs,
        }
    }

    /// The parameter whose length is the number of invocations, where a buffer says it.
    pub fn counted(&self) -> Option<&Param> {
        match self.range() {
            Range::Elements(name) => self.params.iter().find(|p| p.name == *name),
            Range::Outputs if self.outputs.is_empty() => self.params.iter().find(|p| {
                matches!(
                    p.role,
                    Role::Element(_) | Role::ElementMut(_) | Role::Storage(_)
                )
            }),
            _ => None,
        }
    }

    /// `describe::Range`.
    pub fn describe_range(&self) -> TokenStream {
        match self.range() {
            Range::Outputs => quote!(describe::Range::Outputs),
            Range::Elements(name) => {
                let name = text_of(name);
                quote!(describe::Range::Elements { param: describe::text(#name) })
            }
            Range::Fixed(numbers) => {
                let mut size = numbers.clone();
                size.resize(3, 1);
                quote!(describe::Range::Fixed { size: [#(#size),*] })
            }
            Range::Uniform { param, value } => {
                let (name, fields) = (text_of(param), fields(value));
                let offset = match (fields.is_empty(), self.uniform_type(param)) {
                    (false, Some(ty)) => quote!(core::mem::offset_of!(#ty, #fields) as u32),
                    _ => quote!(0),
                };
                quote!(describe::Range::Uniform { param: describe::text(#name), offset: #offset })
            }
        }
    }

    fn uniform_type(&self, name: &Ident) -> Option<&syn::Type> {
        self.params.iter().find_map(|p| match &p.role {
            Role::Uniform(ty) if p.name == *name => Some(ty),
            _ => None,
        })
    }

    /// `let __extent: INDEX = …;`, where a number or a uniform says it.
    pub fn said_extent(&self) -> Option<TokenStream> {
        let ty = self.index_type();
        match self.range() {
            Range::Fixed(numbers) => Some(match numbers.len() {
                1 => quote!(let __extent: #ty = #(#numbers)*;),
                _ => quote!(let __extent: #ty = <#ty>::new(#(#numbers),*);),
            }),
            Range::Uniform { value, .. } => {
                // What is wrong with the value is shown at it; the name is found by what else is made here, also where a
                // macro has written the value.
                let extent = format_ident!("__extent");
                let span = value.span();
                Some(match value {
                    Expr::Path(_) => quote_spanned!(span=> let #extent: #ty = *#value;),
                    _ => quote_spanned!(span=> let #extent: #ty = #value;),
                })
            }
            Range::Outputs | Range::Elements(_) => None,
        }
    }

    /// Host: `let __extent: [u32; 3] = …;`.
    pub fn host_extent(&self, first_output_is_texture: bool) -> TokenStream {
        if let Some(said) = self.said_extent() {
            let whole = match self.dimensions() {
                1 => quote!([__extent, 1, 1]),
                2 => quote!([__extent.x, __extent.y, 1]),
                _ => quote!(__extent.to_array()),
            };
            return quote!(#said let __extent: [u32; 3] = #whole;);
        }
        if let Some(param) = self.counted() {
            let name = &param.name;
            return quote!(let __extent: [u32; 3] = [#name.len() as u32, 1, 1];);
        }
        let output = self.output_ident(0);
        if first_output_is_texture {
            quote!(let __extent: [u32; 3] = #output.size();)
        } else {
            quote!(let __extent: [u32; 3] = [#output.len(), 1, 1];)
        }
    }

    /// The variable that stands for an output.
    pub fn output_ident(&self, i: usize) -> Ident {
        if self.outputs.len() == 1 {
            format_ident!("output")
        } else {
            format_ident!("output{i}")
        }
    }
}
