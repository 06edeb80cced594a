//! The `async` twin of a function with barriers, made from the same body: each `barrier()`, each
//! operation of the subgroup and each call of a function that is named as cooperative is awaited. The
//! host runs it; the body itself stays as it is for the shader.

use proc_macro2::{Delimiter, Group, Ident, Spacing, TokenStream, TokenTree};
use quote::{ToTokens, format_ident, quote, quote_spanned};
use syn::ItemFn;
use syn::parse::{Parse, ParseStream};
use syn::punctuated::Punctuated;
use syn::spanned::Spanned;

/// Functions at which invocations wait.
const BARRIERS: [&str; 2] = ["barrier", "storage_barrier"];

/// Operations of the subgroup, at which its invocations wait for one another.
const OF_SUBGROUP: [&str; 24] = [
    "subgroup_any",
    "subgroup_all",
    "subgroup_ballot",
    "subgroup_broadcast",
    "subgroup_broadcast_first",
    "subgroup_shuffle",
    "subgroup_shuffle_xor",
    "subgroup_shuffle_up",
    "subgroup_shuffle_down",
    "subgroup_add",
    "subgroup_mul",
    "subgroup_min",
    "subgroup_max",
    "subgroup_and",
    "subgroup_or",
    "subgroup_xor",
    "subgroup_inclusive_add",
    "subgroup_exclusive_add",
    "subgroup_inclusive_mul",
    "subgroup_exclusive_mul",
    "quad_broadcast",
    "quad_swap_x",
    "quad_swap_y",
    "quad_swap_diagonal",
];

/// `#[cooperative]`: names of the cooperative functions that this one calls.
#[derive(Default)]
pub struct Cooperative(Vec<Ident>);

impl Parse for Cooperative {
    fn parse(input: ParseStream<'_>) -> syn::Result<Self> {
        let names = Punctuated::<Ident, syn::Token![,]>::parse_terminated(input)?;
        Ok(Self(names.into_iter().collect()))
    }
}

impl Cooperative {
    /// The function, and beside it a module of the same name with its twin.
    pub fn expand(&self, item: &ItemFn) -> syn::Result<TokenStream> {
        if let Some(token) = &item.sig.asyncness {
            return Err(syn::Error::new(
                token.span(),
                "a cooperative function is not async: write it as a plain one",
            ));
        }
        if !has_barrier(item, &self.0) {
            return Err(syn::Error::new(
                item.sig.ident.span(),
                "it waits at no barrier and for no subgroup: leave `#[cooperative]` out, or name the cooperative functions that it calls, `#[cooperative(other)]`",
            ));
        }
        let (vis, name) = (&item.vis, &item.sig.ident);
        let twin = twin(item, &format_ident!("twin"), &self.0);
        let subgroups = uses_subgroups(item, &self.0);
        // The host runs the twin in its place.
        Ok(quote! {
            #[inline(always)]
            #[allow(dead_code)]
            #item

            #[doc(hidden)]
            #[allow(unused_imports, missing_docs, reason = "generated")]
            #vis mod #name {
                use super::*;

                ::hankel_dsl::on_host! {
                    #twin
                    pub const SUBGROUPS: bool = #subgroups;
                }
            }
        })
    }
}

/// Whether the function itself waits at a barrier, or for its subgroup.
pub fn has_barrier(item: &ItemFn, helpers: &[Ident]) -> bool {
    let waits = |name: &str| {
        helpers.iter().any(|n| n == name) || BARRIERS.contains(&name) || OF_SUBGROUP.contains(&name)
    };
    mentions(item.block.to_token_stream(), &waits)
}

/// Whether the function, or one of the helpers that it calls, has operations of the subgroup: an
/// expression, since a helper's own macro knows.
pub fn uses_subgroups(item: &ItemFn, helpers: &[Ident]) -> TokenStream {
    let own = mentions(item.block.to_token_stream(), &|name: &str| {
        OF_SUBGROUP.contains(&name)
    });
    if own || helpers.is_empty() {
        quote!(#own)
    } else {
        quote!(#(#helpers::SUBGROUPS)||*)
    }
}

fn mentions(tokens: TokenStream, waits: &impl Fn(&str) -> bool) -> bool {
    tokens.into_iter().any(|token| match token {
        TokenTree::Ident(ident) => waits(&ident.to_string()),
        TokenTree::Group(group) => mentions(group.stream(), waits),
        _ => false,
    })
}

/// The twin, called `name`.
pub fn twin(item: &ItemFn, name: &Ident, helpers: &[Ident]) -> TokenStream {
    let mut sig = item.sig.clone();
    sig.asyncness = Some(syn::Token![async](sig.fn_token.span));
    sig.ident = name.clone();
    let body = awaited(item.block.to_token_stream(), helpers);
    quote! {
        #[doc(hidden)]
        #[allow(warnings, clippy::all, reason = "the function itself is checked")]
        pub #sig #body
    }
}

/// `tokens` with every wait awaited.
fn awaited(tokens: TokenStream, helpers: &[Ident]) -> TokenStream {
    let tokens: Vec<TokenTree> = tokens.into_iter().collect();
    let mut out: Vec<TokenTree> = Vec::with_capacity(tokens.len());
    let mut i = 0;
    while i < tokens.len() {
        match &tokens[i] {
            TokenTree::Group(group) => {
                let mut inner = Group::new(group.delimiter(), awaited(group.stream(), helpers));
                inner.set_span(group.span());
                out.push(inner.into());
            }
            TokenTree::Ident(name) if !is_declared_or_method(&out) => {
                let is_barrier = BARRIERS.iter().any(|b| name == b);
                let is_of_subgroup = OF_SUBGROUP.iter().any(|b| name == b);
                let is_helper = helpers.contains(name);
                // A call of a generic function has its types between.
                let types = if is_helper || is_of_subgroup {
                    turbofish(&tokens[i + 1..])
                } else {
                    0
                };
                let args = match tokens.get(i + 1 + types) {
                    Some(TokenTree::Group(g)) if g.delimiter() == Delimiter::Parenthesis => g,
                    _ => {
                        out.push(tokens[i].clone());
                        i += 1;
                        continue;
                    }
                };
                if is_barrier && args.stream().is_empty() {
                    drop_path(&mut out);
                    let span = name.span();
                    out.extend(quote_spanned!(span=>
                        ::hankel_dsl::native::workgroup::#name().await
                    ));
                    i += 2;
                    continue;
                }
                if is_of_subgroup {
                    drop_path(&mut out);
                    out.extend(quote_spanned!(name.span()=>
                        ::hankel_dsl::native::subgroup::#name
                    ));
                } else {
                    out.push(tokens[i].clone());
                }
                if is_helper {
                    out.extend(quote_spanned!(name.span()=> ::twin));
                }
                if is_helper || is_of_subgroup {
                    out.extend_from_slice(&tokens[i + 1..i + 1 + types]);
                    let mut inner = Group::new(args.delimiter(), awaited(args.stream(), helpers));
                    inner.set_span(args.span());
                    out.push(inner.into());
                    out.extend(quote_spanned!(name.span()=> .await));
                    i += 1 + types;
                }
            }
            other => out.push(other.clone()),
        }
        i += 1;
    }
    out.into_iter().collect()
}

/// Whether what comes next is the name of a method or of a new function.
fn is_declared_or_method(before: &[TokenTree]) -> bool {
    match before.last() {
        Some(TokenTree::Punct(p)) => p.as_char() == '.',
        Some(TokenTree::Ident(i)) => i == "fn",
        _ => false,
    }
}

/// How many tokens `::<…>` takes, if that is what they begin with.
fn turbofish(tokens: &[TokenTree]) -> usize {
    let is =
        |i: usize, c: char| matches!(&tokens.get(i), Some(TokenTree::Punct(p)) if p.as_char() == c);
    if !(is(0, ':') && is(1, ':') && is(2, '<')) {
        return 0;
    }
    let mut depth = 0;
    for i in 2..tokens.len() {
        if is(i, '<') {
            depth += 1;
        } else if is(i, '>') && !is(i - 1, '-') {
            depth -= 1;
            if depth == 0 {
                return i + 1;
            }
        }
    }
    0
}

/// Takes `a::b::` off the end.
fn drop_path(out: &mut Vec<TokenTree>) {
    let is_colon = |t: Option<&TokenTree>, joint: bool| {
        matches!(t, Some(TokenTree::Punct(p)) if p.as_char() == ':'
            && (!joint || p.spacing() == Spacing::Joint))
    };
    while out.len() >= 2 && is_colon(out.last(), false) && is_colon(out.get(out.len() - 2), true) {
        out.truncate(out.len() - 2);
        if matches!(out.last(), Some(TokenTree::Ident(_))) {
            out.pop();
        }
    }
}
