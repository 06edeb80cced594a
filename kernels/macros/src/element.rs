//! `#[derive(Element)]`.

use proc_macro2::{Group, Ident, TokenStream, TokenTree};
use quote::{format_ident, quote, quote_spanned};
use syn::spanned::Spanned;
use syn::{Data, DeriveInput, Fields, GenericParam};

use crate::inputs::{Holder, Inputs};
use crate::kernel::text_of;

pub fn derive(item: &DeriveInput) -> syn::Result<TokenStream> {
    let name = &item.ident;
    let Data::Struct(data) = &item.data else {
        return Err(syn::Error::new(
            item.span(),
            "only a structure can be in a buffer",
        ));
    };
    let Fields::Named(fields) = &data.fields else {
        return Err(syn::Error::new(
            item.span(),
            "a structure in a buffer needs named fields: their names appear in every language",
        ));
    };
    if !is_repr_c(item) {
        return Err(syn::Error::new(
            name.span(),
            format!("`{name}` needs #[repr(C)]: Rust may reorder its fields otherwise"),
        ));
    }
    if fields.named.is_empty() {
        return Err(syn::Error::new(
            name.span(),
            "a structure in a buffer needs a field",
        ));
    }
    let parameter = parameter(item)?;
    let fields: Vec<Field<'_>> = fields
        .named
        .iter()
        .map(|f| {
            let inputs = Inputs::parse(&f.attrs)?;
            inputs.check(Holder::Field, &[])?;
            Ok(Field {
                name: f.ident.as_ref().expect("named"),
                ty: &f.ty,
                summary: summary(&f.attrs),
                inputs,
            })
        })
        .collect::<syn::Result<_>>()?;
    let impls = match parameter {
        None => one(name, &quote!(#name), &fields, None),
        Some(p) => ["f32", "f64"]
            .into_iter()
            .map(|scalar| {
                let scalar = format_ident!("{scalar}");
                one(name, &quote!(#name<#scalar>), &fields, Some((p, &scalar)))
            })
            .collect(),
    };
    Ok(quote! {
        ::hankel_dsl::on_host! {
            #[allow(
                clippy::all,
                unused_parens,
                reason = "generated, with expressions as the attributes have them"
            )]
            const _: () = {
                use ::hankel_dsl::native::{describe, layout};
                #impls
            };
        }
    })
}

struct Field<'a> {
    name: &'a Ident,
    ty: &'a syn::Type,
    summary: String,
    inputs: Inputs,
}

/// The implementations for one concrete type.
fn one(
    name: &Ident,
    this: &TokenStream,
    fields: &[Field<'_>],
    generic: Option<(&Ident, &Ident)>,
) -> TokenStream {
    let types: Vec<TokenStream> = fields
        .iter()
        .map(|f| {
            let ty = f.ty;
            match generic {
                Some((p, scalar)) => replace(quote!(#ty), p, scalar),
                None => quote!(#ty),
            }
        })
        .collect();
    let names: Vec<&Ident> = fields.iter().map(|f| f.name).collect();
    let text = text_of(name);
    let checks = fields.iter().zip(&types).map(|(f, ty)| {
        let message = format!(
            "field `{}` of `{name}` does not start where a shader expects it: its alignment (4 for a number, 8 for f64 and 2-vectors, 16 for 3- and 4-vectors) does not divide the bytes before it; move larger fields to the front or put padding fields before it",
            f.name
        );
        quote_spanned! {f.ty.span()=>
            assert!(at.is_multiple_of(<#ty as layout::Element>::ALIGN), #message);
            at += size_of::<#ty>();
        }
    });
    let end = format!(
        "`{name}` ends off its own alignment: add padding fields at the end, so that its size is a multiple of its largest field's alignment"
    );
    let descriptions = fields.iter().zip(&types).map(|(f, ty)| {
        let (field, summary) = (f.name, &f.summary);
        let field_text = text_of(field);
        let inputs = f.inputs.describe();
        quote! {
            describe::Field {
                name: describe::text(#field_text),
                summary: describe::text(#summary),
                ty: <#ty as layout::Element>::ty(),
                offset: core::mem::offset_of!(#this, #field) as u32,
                size: size_of::<#ty>() as u32,
                inputs: #inputs,
            }
        }
    });
    let lanes = generic.map_or_else(
        || {
            quote! {
                impl layout::Splat<f32> for #this {
                    type Over<L: ::hankel_dsl::Real> = Self;
                    #[inline(always)]
                    fn splat<L: layout::Lane<Scalar = f32>>(self) -> Self { self }
                }
                impl layout::Splat<f64> for #this {
                    type Over<L: ::hankel_dsl::Real> = Self;
                    #[inline(always)]
                    fn splat<L: layout::Lane<Scalar = f64>>(self) -> Self { self }
                }
            }
        },
        |(p, scalar)| {
            // Fields that mention the parameter have lanes; a structure with others is the same
            // for all lanes at most.
            let all_lanes = fields.iter().all(|f| {
                let ty = f.ty;
                mentions(quote!(#ty), p)
            });
            let lanewise = all_lanes.then(|| {
                quote! {
                    // SAFETY: `repr(C)`, and every field is so laid out.
                    unsafe impl layout::Lanewise<#scalar> for #this {
                        type Over<L: ::hankel_dsl::Real> = #name<L>;
                    }
                    const _: () = {
                        const fn lanewise<T: layout::Lanewise<#scalar>>() {}
                        #(lanewise::<#types>();)*
                    };
                }
            });
            quote! {
                impl layout::Splat<#scalar> for #this {
                    type Over<L: ::hankel_dsl::Real> = #name<L>;
                    #[inline(always)]
                    fn splat<L: layout::Lane<Scalar = #scalar>>(self) -> #name<L> {
                        #name {
                            #(#names: <#types as layout::Splat<#scalar>>::splat::<L>(self.#names),)*
                        }
                    }
                }
                #lanewise
            }
        },
    );
    quote! {
        const _: () = {
            let mut at = 0_usize;
            #(#checks)*
            assert!(at.is_multiple_of(<#this as layout::Element>::ALIGN), #end);
        };

        // SAFETY: `repr(C)`, every field is `Pod`, and the assertions above leave no padding.
        unsafe impl ::hankel_dsl::bytemuck::Zeroable for #this {}
        // SAFETY: see above.
        unsafe impl ::hankel_dsl::bytemuck::Pod for #this {}

        impl layout::Element for #this {
            const ALIGN: usize = {
                let mut align = 4;
                #(if <#types as layout::Element>::ALIGN > align {
                    align = <#types as layout::Element>::ALIGN;
                })*
                align
            };
            const UNIFORM_ARRAY: bool = size_of::<#this>().is_multiple_of(16);
            const IS_STRUCTURE: bool = true;
            const UNIFORM: bool = true #(&& <#types as layout::Element>::UNIFORM && (
                !<#types as layout::Element>::IS_STRUCTURE
                    || ::core::mem::offset_of!(#this, #names).is_multiple_of(16)
                        && (size_of::<#types>().is_multiple_of(16)
                            || ::core::mem::offset_of!(#this, #names) + size_of::<#types>()
                                == size_of::<#this>())
            ))*;
            fn ty() -> describe::Type {
                describe::Type::Struct {
                    layout: describe::Layout {
                        name: describe::text(#text),
                        size: size_of::<#this>() as u32,
                        align: <#this as layout::Element>::ALIGN as u32,
                        fields: [#(#descriptions),*].into(),
                    },
                }
            }
        }

        #lanes
    }
}

fn is_repr_c(item: &DeriveInput) -> bool {
    item.attrs.iter().any(|a| {
        let mut found = false;
        if a.path().is_ident("repr") {
            // Other representations are not this macro's to judge.
            let _ = a.parse_nested_meta(|meta| {
                found |= meta.path.is_ident("C");
                Ok(())
            });
        }
        found
    })
}

/// The one type parameter that a structure may have.
fn parameter(item: &DeriveInput) -> syn::Result<Option<&Ident>> {
    let mut params = item.generics.params.iter();
    match (params.next(), params.next()) {
        (None, _) => Ok(None),
        (Some(GenericParam::Type(t)), None) => Ok(Some(&t.ident)),
        _ => Err(syn::Error::new(
            item.generics.span(),
            "a structure in a buffer may be generic over one number type at most",
        )),
    }
}

/// The first paragraph of a documentation comment, on one line.
pub fn summary(attrs: &[syn::Attribute]) -> String {
    let lines = attrs.iter().filter_map(|a| match &a.meta {
        syn::Meta::NameValue(nv) if nv.path.is_ident("doc") => match &nv.value {
            syn::Expr::Lit(syn::ExprLit {
                lit: syn::Lit::Str(s),
                ..
            }) => Some(s.value().trim().to_string()),
            _ => None,
        },
        _ => None,
    });
    lines
        .take_while(|l| !l.is_empty())
        .collect::<Vec<_>>()
        .join(" ")
}

/// `tokens` with every identifier `from` replaced by `to`.
pub fn replace(tokens: TokenStream, from: &Ident, to: &Ident) -> TokenStream {
    tokens
        .into_iter()
        .map(|t| match t {
            TokenTree::Ident(i) if i == *from => {
                let mut to = to.clone();
                to.set_span(i.span());
                TokenTree::Ident(to)
            }
            TokenTree::Group(g) => {
                let mut inner = Group::new(g.delimiter(), replace(g.stream(), from, to));
                inner.set_span(g.span());
                TokenTree::Group(inner)
            }
            other => other,
        })
        .collect()
}

/// Whether `name` occurs in `tokens`.
fn mentions(tokens: TokenStream, name: &Ident) -> bool {
    tokens.into_iter().any(|t| match t {
        TokenTree::Ident(i) => i == *name,
        TokenTree::Group(g) => mentions(g.stream(), name),
        _ => false,
    })
}
