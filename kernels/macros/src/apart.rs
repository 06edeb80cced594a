//! `#[apart]`

use proc_macro2::{Ident, TokenStream};
use quote::quote;
use syn::parse::{Parse, ParseStream};
use syn::spanned::Spanned;
use syn::{Expr, FnArg, GenericParam, ItemFn, Pat, Token, Type};

/// The number type, and when: `R, if N > 3`.
pub struct Apart {
    number: Type,
    condition: Expr,
}

impl Parse for Apart {
    fn parse(input: ParseStream<'_>) -> syn::Result<Self> {
        let number = input.parse()?;
        input.parse::<Token![,]>()?;
        input.parse::<Token![if]>()?;
        Ok(Self {
            number,
            condition: input.parse()?,
        })
    }
}

impl Apart {
    /// The function as it is for shaders, and natively one that calls it apart.
    pub fn expand(&self, item: &ItemFn) -> syn::Result<TokenStream> {
        let Self { number, condition } = self;
        let ItemFn {
            attrs,
            vis,
            sig,
            block,
        } = item;
        let name = &sig.ident;
        let parameters = sig.inputs.iter().map(parameter);
        let parameters = parameters.collect::<syn::Result<Vec<&Ident>>>()?;
        let generics = sig.generics.params.iter().filter_map(|it| match it {
            GenericParam::Type(it) => Some(&it.ident),
            GenericParam::Const(it) => Some(&it.ident),
            GenericParam::Lifetime(_) => None,
        });
        let call = quote!(#name::<#(#generics),*>(#(#parameters),*));
        Ok(quote! {
            #[cfg(target_arch = "spirv")]
            #(#attrs)*
            #vis #sig #block

            #[cfg(not(target_arch = "spirv"))]
            #(#attrs)*
            #vis #sig {
                #[inline(always)]
                #sig #block

                if const { #condition } {
                    <#number as ::hankel_dsl::Real>::apart(
                        #[inline(always)]
                        move || #call,
                    )
                } else {
                    #call
                }
            }
        })
    }
}

fn parameter(input: &FnArg) -> syn::Result<&Ident> {
    let FnArg::Typed(typed) = input else {
        let reason = "`#[apart]` stands on a function, not on a method: call one from it";
        return Err(syn::Error::new(input.span(), reason));
    };
    match typed.pat.as_ref() {
        Pat::Ident(it) if it.subpat.is_none() && it.by_ref.is_none() && it.mutability.is_none() => {
            Ok(&it.ident)
        }
        other => {
            let reason = "a parameter of a function with `#[apart]` is a name, without `mut`";
            Err(syn::Error::new(other.span(), reason))
        }
    }
}
