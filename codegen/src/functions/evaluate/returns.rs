//! Early `return`s. Texts have one end: `if c { return a; } rest` is `if c { a } else { rest }`. Where several sides of a
//! branch go on, each has the rest.

use std::borrow::Cow;
use std::collections::BTreeSet;

use proc_macro2::{TokenStream, TokenTree};
use quote::ToTokens;

/// A body of which no branch returns, if that can be had: what follows a branch that may return is within
/// the branches that do not. A `return` in a loop stays.
pub(super) fn with_one_end(body: &syn::Block) -> Cow<'_, syn::Block> {
    if !returns(body) {
        return Cow::Borrowed(body);
    }
    let mut copied = 0;
    Cow::Owned(syn::Block {
        brace_token: body.brace_token,
        stmts: ended(body.stmts.clone(), &mut copied),
    })
}

/// Statements that are written once more, at most: each branch with two sides that go on doubles what follows.
const MOST_COPIED: usize = 1000;

/// Whether there is a `return`.
fn returns(tokens: &impl ToTokens) -> bool {
    fn within(tokens: TokenStream) -> bool {
        tokens.into_iter().any(|t| match t {
            TokenTree::Ident(i) => i == "return",
            TokenTree::Group(g) => within(g.stream()),
            _ => false,
        })
    }
    within(tokens.to_token_stream())
}

/// The statements of a body, without early ends.
fn ended(stmts: Vec<syn::Stmt>, copied: &mut usize) -> Vec<syn::Stmt> {
    let mut out = Vec::with_capacity(stmts.len());
    let mut all = stmts.into_iter();
    while let Some(stmt) = all.next() {
        let stmt = match stmt {
            syn::Stmt::Expr(syn::Expr::Return(r), _) => {
                out.extend(r.expr.map(|e| syn::Stmt::Expr(*e, None)));
                return out;
            }
            other => other,
        };
        let branch = match &stmt {
            syn::Stmt::Expr(e, _) => Some((e, None)),
            syn::Stmt::Local(l) => l.init.as_ref().map(|init| (init.expr.as_ref(), Some(l))),
            _ => None,
        };
        if let Some((e, local)) = branch
            && returns(e)
            && let Some(e) = absorbed(e, local, all.as_slice(), copied)
        {
            out.push(syn::Stmt::Expr(e, None));
            return out;
        }
        out.push(stmt);
    }
    out
}

/// A branch that may return with what follows it within its sides: `let` of its value, and the rest. None where that
/// cannot be.
fn absorbed(
    e: &syn::Expr,
    local: Option<&syn::Local>,
    rest: &[syn::Stmt],
    copied: &mut usize,
) -> Option<syn::Expr> {
    let follows = Follows { local, rest };
    let mut side = |e: &syn::Expr| follows.side(statements(e), BTreeSet::new(), copied);
    Some(match e {
        syn::Expr::If(i) => {
            let mut i = i.clone();
            let then = side(&block(
                i.then_branch.stmts.clone(),
                i.then_branch.brace_token,
            ))?;
            let (token, other) = match i.else_branch.take() {
                Some((token, other)) => (token, side(&other)?),
                None => {
                    let nothing = block(Vec::new(), i.then_branch.brace_token);
                    (syn::token::Else(i.if_token.span), side(&nothing)?)
                }
            };
            i.else_branch = Some((token, Box::new(block(other, i.then_branch.brace_token))));
            i.then_branch.stmts = then;
            syn::Expr::If(i)
        }
        syn::Expr::Match(m) => {
            let mut m = m.clone();
            for arm in &mut m.arms {
                let bound = names_of(&arm.pat);
                let side = follows.side(statements(&arm.body), bound, copied)?;
                *arm.body = block(side, m.brace_token);
            }
            syn::Expr::Match(m)
        }
        syn::Expr::Block(b) if b.label.is_none() => {
            let mut b = b.clone();
            b.block.stmts = side(e)?;
            syn::Expr::Block(b)
        }
        _ => return None,
    })
}

fn block(stmts: Vec<syn::Stmt>, brace_token: syn::token::Brace) -> syn::Expr {
    syn::Expr::Block(syn::ExprBlock {
        attrs: Vec::new(),
        label: None,
        block: syn::Block { brace_token, stmts },
    })
}

fn statements(e: &syn::Expr) -> Vec<syn::Stmt> {
    match e {
        syn::Expr::Block(b) if b.label.is_none() => b.block.stmts.clone(),
        other => vec![syn::Stmt::Expr(other.clone(), None)],
    }
}

/// What follows a branch.
struct Follows<'a> {
    /// The `let` that takes the branch's value.
    local: Option<&'a syn::Local>,
    rest: &'a [syn::Stmt],
}

impl Follows<'_> {
    /// One side of the branch with what follows, unless the side ends itself. `hidden` are names that its pattern binds.
    fn side(
        &self,
        mut stmts: Vec<syn::Stmt>,
        mut hidden: BTreeSet<String>,
        copied: &mut usize,
    ) -> Option<Vec<syn::Stmt>> {
        if ends(&stmts) {
            return Some(ended(stmts, copied));
        }
        *copied += self.rest.len();
        if *copied > MOST_COPIED {
            return None;
        }
        for stmt in &stmts {
            match stmt {
                syn::Stmt::Local(l) => hidden.extend(names_of(&l.pat)),
                syn::Stmt::Item(syn::Item::Const(c)) => {
                    hidden.insert(c.ident.to_string());
                }
                _ => {}
            }
        }
        let bound = self.local.map(|l| names_of(&l.pat)).unwrap_or_default();
        let read: BTreeSet<String> = self.rest.iter().flat_map(names_of).collect();
        if hidden
            .iter()
            .any(|name| read.contains(name) && !bound.contains(name))
        {
            return None;
        }
        if let Some(local) = self.local {
            let Some(syn::Stmt::Expr(value, None)) = stmts.pop() else {
                return None;
            };
            let mut local = local.clone();
            if let Some(init) = &mut local.init {
                *init.expr = value;
            }
            stmts.push(syn::Stmt::Local(local));
        } else if !self.rest.is_empty()
            && let Some(syn::Stmt::Expr(_, semicolon @ None)) = stmts.last_mut()
        {
            // The branch's value was `()`: it is a statement now.
            *semicolon = Some(syn::token::Semi::default());
        }
        stmts.extend_from_slice(self.rest);
        Some(ended(stmts, copied))
    }
}

/// Whether the last statement returns on every way.
fn ends(stmts: &[syn::Stmt]) -> bool {
    let Some(syn::Stmt::Expr(last, _)) = stmts.last() else {
        return false;
    };
    match last {
        syn::Expr::Return(_) => true,
        syn::Expr::If(i) => {
            ends(&i.then_branch.stmts)
                && i.else_branch
                    .as_ref()
                    .is_some_and(|(_, other)| match other.as_ref() {
                        syn::Expr::Block(b) => ends(&b.block.stmts),
                        other => ends(&[syn::Stmt::Expr(other.clone(), None)]),
                    })
        }
        syn::Expr::Match(m) => m.arms.iter().all(|arm| match arm.body.as_ref() {
            syn::Expr::Block(b) => ends(&b.block.stmts),
            other => matches!(other, syn::Expr::Return(_)),
        }),
        syn::Expr::Block(b) => ends(&b.block.stmts),
        _ => false,
    }
}

/// The identifiers in something.
fn names_of(tokens: &impl ToTokens) -> BTreeSet<String> {
    fn within(tokens: TokenStream, all: &mut BTreeSet<String>) {
        for token in tokens {
            match token {
                TokenTree::Ident(i) => {
                    all.insert(i.to_string());
                }
                TokenTree::Group(g) => within(g.stream(), all),
                _ => {}
            }
        }
    }
    let mut all = BTreeSet::new();
    within(tokens.to_token_stream(), &mut all);
    all
}
