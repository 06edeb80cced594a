//! `kernels![…]`.

use proc_macro2::TokenStream;
use quote::{format_ident, quote};
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
        // rustc compiles what can be reached from outside of the crate: a kernel in a private module
        // cannot, unless it is named here.
        let reachable = self.0.iter().enumerate().map(|(i, path)| {
            let name = format_ident!("kernel{i}");
            let path = from_inside(path, 2);
            quote!(pub mod #name { pub use #path::shader::*; })
        });
        quote! {
            ::hankel_dsl::on_spirv! {
                #[doc(hidden)]
                #[allow(missing_docs, unused_imports, reason = "generated")]
                pub mod hankel_kernels {
                    #(#reachable)*
                }
            }

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

/// A path as a module `depth` below sees it.
fn from_inside(path: &Path, depth: usize) -> TokenStream {
    let up = (0..depth).map(|_| quote!(super::));
    match path.segments.first() {
        Some(first) if path.leading_colon.is_none() && first.ident == "self" => {
            let rest = path.segments.iter().skip(1);
            quote!(#(#up)* #(#rest)::*)
        }
        Some(first) if path.leading_colon.is_some() || first.ident == "crate" => quote!(#path),
        _ => quote!(#(#up)* #path),
    }
}
