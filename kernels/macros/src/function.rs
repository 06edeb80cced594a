//! `#[function]` and `library!`.

use proc_macro2::{Ident, TokenStream};
use quote::{format_ident, quote};
use syn::parse::{Parse, ParseStream};
use syn::punctuated::Punctuated;
use syn::spanned::Spanned;
use syn::{FnArg, ItemFn, Pat, Path, ReturnType, Token, Type, braced, bracketed};

use crate::kernel::text_of;

/// `#[function]` on a function: the function, and on the host what calls it without its types.
pub fn function(args: &TokenStream, item: &ItemFn) -> syn::Result<TokenStream> {
    if !args.is_empty() {
        return Err(syn::Error::new(
            args.span(),
            "`#[function]` takes no arguments",
        ));
    }
    let sig = &item.sig;
    let refused = [
        (
            sig.unsafety.map(|t| t.span()),
            "a function of a library is not `unsafe`",
        ),
        (
            sig.asyncness.map(|t| t.span()),
            "a function of a library is not `async`",
        ),
        (
            sig.variadic.as_ref().map(Spanned::span),
            "a function of a library takes so many arguments",
        ),
    ];
    for (span, reason) in refused {
        if let Some(span) = span {
            return Err(syn::Error::new(span, reason));
        }
    }
    if !item.attrs.iter().any(|a| a.path().is_ident("doc")) {
        let reason = "a function of a library has documentation: it is all that its users read";
        return Err(syn::Error::new(sig.ident.span(), reason));
    }
    let ReturnType::Type(_, result) = &sig.output else {
        return Err(syn::Error::new(
            sig.ident.span(),
            "a function of a library gives something",
        ));
    };
    if let Some(bad) = sig.generics.lifetimes().next() {
        return Err(syn::Error::new(
            bad.span(),
            "a function of a library takes values, no references",
        ));
    }
    let mut params: Vec<(Ident, &Type)> = Vec::new();
    for input in &sig.inputs {
        let FnArg::Typed(typed) = input else {
            return Err(syn::Error::new(
                input.span(),
                "a function of a library has no `self`",
            ));
        };
        let Pat::Ident(name) = typed.pat.as_ref() else {
            return Err(syn::Error::new(
                typed.pat.span(),
                "a parameter of a library's function has a name",
            ));
        };
        params.push((name.ident.clone(), typed.ty.as_ref()));
    }
    let looks_up = params
        .iter()
        .any(|(_, ty)| matches!(ty, Type::ImplTrait(_)));
    let host = if looks_up {
        // What is looked up has no words: tests call such a function themselves.
        module(item, &quote!(None))
    } else {
        native(item, &params, result)
    };
    let inline = if item.attrs.iter().any(|a| a.path().is_ident("inline")) {
        TokenStream::new()
    } else {
        quote!(#[inline])
    };
    Ok(quote! {
        #inline
        #item
        #host
    })
}

/// The module beside a function.
fn module(item: &ItemFn, native: &TokenStream) -> TokenStream {
    let (vis, name) = (&item.vis, &item.sig.ident);
    // Within the module, a number type is `f32`.
    let reals = item.sig.generics.type_params().map(|p| &p.ident);
    quote! {
        ::hankel_dsl::on_host! {
            #[doc(hidden)]
            #[allow(clippy::all, dead_code, unused_imports, unused_variables, unused_assignments, unused_mut, reason = "generated")]
            #vis mod #name {
                use super::*;
                use ::hankel_dsl::native::function::{Function, Words};
                #(type #reals = f32;)*

                pub fn native() -> Option<Function> {
                    #native
                }
            }
        }
    }
}

fn native(item: &ItemFn, params: &[(Ident, &Type)], result: &Type) -> TokenStream {
    let name = &item.sig.ident;
    let text = text_of(name);
    let names = params.iter().map(|(n, _)| text_of(n));
    let types = params.iter().map(|(_, ty)| ty);
    let arguments = params.iter().map(|(n, ty)| {
        quote! {
            let #n = <#ty as Words>::read(&words[at..]);
            at += <#ty as Words>::COUNT;
        }
    });
    let values = params.iter().map(|(n, _)| n);
    let native = quote! {
        Some(Function {
            name: #text,
            params: ::hankel_dsl::native::Vec::from([#((#names, <#types as Words>::describe())),*]),
            result: <#result as Words>::describe(),
            run: |words, out| {
                let mut at = 0;
                #(#arguments)*
                Words::write(super::#name(#(#values),*), out);
            },
        })
    };
    module(item, &native)
}

/// `name { api: 1, functions: […], constants: […] }`
pub struct Library {
    name: Ident,
    functions: Vec<Path>,
    constants: Vec<Path>,
}

impl Parse for Library {
    fn parse(input: ParseStream<'_>) -> syn::Result<Self> {
        input.call(syn::Attribute::parse_outer)?;
        let mut library = Self {
            name: input.parse()?,
            functions: Vec::new(),
            constants: Vec::new(),
        };
        let body;
        braced!(body in input);
        let mut has_api = false;
        while !body.is_empty() {
            let key: Ident = body.parse()?;
            body.parse::<Token![:]>()?;
            if key == "api" {
                let number: u32 = body.parse::<syn::LitInt>()?.base10_parse()?;
                has_api = number > 0;
            } else {
                let inner;
                bracketed!(inner in body);
                let paths = Punctuated::<Path, Token![,]>::parse_terminated(&inner)?;
                match key.to_string().as_str() {
                    "functions" => library.functions.extend(paths),
                    "constants" => library.constants.extend(paths),
                    _ => {
                        let expected = "there are `api`, `functions` and `constants`";
                        return Err(syn::Error::new(key.span(), expected));
                    }
                }
            }
            if !body.is_empty() {
                body.parse::<Token![,]>()?;
            }
        }
        if !has_api {
            let reason = "say `api: 1`, or more: it rises when a signature changes";
            return Err(syn::Error::new(library.name.span(), reason));
        }
        Ok(library)
    }
}

impl Library {
    pub fn expand(&self) -> TokenStream {
        let module = format_ident!("{}_library", self.name);
        let doc = format!("The library `{}`.", self.name);
        let functions = &self.functions;
        // Those that look something up have no untyped form; all must exist.
        let constants = self.constants.iter();
        let uses = self
            .functions
            .iter()
            .enumerate()
            .map(|(i, path)| (format_ident!("function_{i}"), path));
        let uses = uses.map(|(name, path)| quote!(#[doc(hidden)] pub use super::#path as #name;));
        let natives = (0..functions.len()).map(|i| format_ident!("function_{i}"));
        quote! {
            ::hankel_dsl::on_host! {
                #[doc = #doc]
                #[allow(unused_imports, reason = "some are named only to see that they exist")]
                pub mod #module {
                    #(#uses)*
                    const _: () = { #(let _ = super::#constants;)* };

                    /// Its functions, but those that look something up, callable without their types.
                    #[must_use]
                    pub fn functions() -> ::hankel_dsl::native::Vec<::hankel_dsl::native::function::Function> {
                        [#(#natives::native()),*].into_iter().flatten().collect()
                    }
                }
            }
        }
    }
}
