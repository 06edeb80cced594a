//! `kernels![…]`.

use proc_macro2::TokenStream;
use quote::quote;
use syn::parse::{Parse, ParseStream};
use syn::punctuated::Punctuated;
use syn::{Path, Token};

/// Paths of kernel functions.
pub struct List(Punctuated<Path, Token![,]>);

impl Parse for List {
    fn parse(input: ParseStream<'_>) -> syn::Result<Self> {
        Ok(Self(Punctuated::parse_terminated(input)?))
    }
}

impl List {
    pub fn expand(&self) -> TokenStream {
        let paths = self.0.iter();
        quote! {
            ::hankel_dsl::on_host! {
                /// Every entry point of this crate: what it is, and its native code.
                #[must_use]
                pub fn entries() -> ::hankel_dsl::native::Entries {
                    let mut all = ::hankel_dsl::native::Entries::new();
                    #(all.extend(#paths::entries());)*
                    all
                }

                #[doc(hidden)]
                #[allow(unexpected_cfgs, reason = "hankel sets it to build a plug-in")]
                pub mod hankel_plugin {
                    #[cfg(hankel_plugin)]
                    ::hankel_dsl::plugin_exports!(super::entries);
                }
            }
        }
    }
}
