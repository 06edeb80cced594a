//! Branches and `match`. What is known is run here; what is not stays a branch, and the variables that are assigned in
//! it change from there on.

use std::collections::{BTreeSet, HashMap};

use proc_macro2::{Span, TokenStream, TokenTree};
use syn::spanned::Spanned;

use super::{Done, Evaluator, Frame, Stop};
use crate::functions::fold::{builtin, float, literal, local, unary};
use crate::functions::ir::{Builtin, Kind, Leave, Literal, Rank, Scalar, Stmt, Type, Unary};
use crate::functions::source::{Item, segments};
use crate::functions::value::Value;

impl Evaluator<'_> {
    pub(super) fn branch(&mut self, frame: &mut Frame, i: &syn::ExprIf) -> Done<Value> {
        if matches!(i.cond.as_ref(), syn::Expr::Let(_)) {
            return Err(self.refuse(frame, i.cond.span(), "`if let` has no form here"));
        }
        let condition = self.value(frame, &i.cond)?;
        if let Some(holds) = condition.as_bool() {
            return if holds {
                self.block(frame, &i.then_branch)
            } else if let Some((_, other)) = &i.else_branch {
                self.expr(frame, other)
            } else {
                Ok(Value::Unit)
            };
        }
        let Value::Scalar(condition) = condition else {
            return Err(self.refuse(frame, i.cond.span(), "this is not a condition"));
        };
        let mut names = BTreeSet::new();
        assigned(quote::quote!(#i), &mut names);
        let condition = self.kept("condition", condition, Rank::Part);
        self.let_change(frame, &names);

        let (then_block, then) = self.side(frame, i.span(), |own, frame| {
            own.block(frame, &i.then_branch)
        })?;
        let (other_block, other) =
            self.side(frame, i.span(), |own, frame| match &i.else_branch {
                Some((_, e)) => own.expr(frame, e),
                None => Ok(Value::Unit),
            })?;
        // What comes after a side that leaves the loop belongs to the other side.
        let (then, other) = match (then, other) {
            (Ok(then), Ok(other)) => (then, other),
            (Err(_), other) => {
                self.emit(Stmt::If(condition, then_block, Vec::new()));
                other_block.into_iter().for_each(|s| self.emit(s));
                return other.map_err(Stop::Leave);
            }
            (Ok(then), Err(_)) => {
                let fails = unary(Unary::Not, &condition);
                self.emit(Stmt::If(fails, other_block, Vec::new()));
                then_block.into_iter().for_each(|s| self.emit(s));
                return Ok(then);
            }
        };

        let (mut then, other) = self.alike(frame, then, other, i.span())?;
        let mut a = Vec::new();
        then.each_scalar("chosen", &mut |name, e| {
            a.push((name.to_owned(), e.clone()))
        });
        let mut b = Vec::new();
        other
            .clone()
            .each_scalar("chosen", &mut |_, e| b.push(e.clone()));
        if a.len() != b.len() {
            return Err(self.refuse(
                frame,
                i.span(),
                "both sides of a branch give values of one shape",
            ));
        }
        let mut chosen = Vec::new();
        if then_block.is_empty() && other_block.is_empty() {
            for ((_, x), y) in a.iter().zip(&b) {
                let args = vec![condition.clone(), x.clone(), y.clone()];
                chosen.push(builtin(Builtin::Select, args));
            }
        } else {
            let mut then_block = then_block;
            let mut other_block = other_block;
            for ((name, x), y) in a.iter().zip(&b) {
                if x == y && matches!(x.kind, Kind::Literal(_)) {
                    chosen.push(x.clone());
                    continue;
                }
                let id = self.new_local(name, x.ty.clone(), Rank::Part);
                self.changing.insert(id);
                then_block.push(Stmt::Assign(id, x.clone()));
                // A literal is the initial value, and the other side has nothing to assign.
                let first = if matches!(y.kind, Kind::Literal(_)) {
                    y.clone()
                } else {
                    other_block.push(Stmt::Assign(id, y.clone()));
                    match x.ty {
                        Type::Scalar(Scalar::F32) => float(0.0),
                        Type::Scalar(Scalar::U32) => literal(Literal::U32(0)),
                        Type::Scalar(Scalar::I32) => literal(Literal::I32(0)),
                        _ => literal(Literal::Bool(false)),
                    }
                };
                self.emit(Stmt::Var(id, first));
                chosen.push(local(id, x.ty.clone()));
            }
            self.emit(Stmt::If(condition, then_block, other_block));
        }
        let mut chosen = chosen.into_iter();
        then.each_scalar("chosen", &mut |_, e| {
            if let Some(other) = chosen.next() {
                *e = other;
            }
        });
        Ok(then)
    }

    /// Both sides of a branch, with literals typed as the other side has them.
    fn alike(&self, frame: &Frame, a: Value, b: Value, span: Span) -> Done<(Value, Value)> {
        let single = |v: Value| match v {
            Value::Fraction(_, s) => Value::Scalar(float(s)),
            other => other,
        };
        Ok(match (single(a), single(b)) {
            (Value::Int(x), Value::Int(y)) if x == y => (Value::Int(x), Value::Int(y)),
            (Value::Int(x), Value::Scalar(e)) => {
                let x = self.put_together(frame, &Value::Int(x), &e.ty, span)?;
                (Value::Scalar(x), Value::Scalar(e))
            }
            (Value::Scalar(e), Value::Int(y)) => {
                let y = self.put_together(frame, &Value::Int(y), &e.ty, span)?;
                (Value::Scalar(e), Value::Scalar(y))
            }
            (Value::Int(_), Value::Int(_)) => {
                let reason = "say the type of one of these numbers: `0_u32`, `0_i32`";
                return Err(self.refuse(frame, span, reason));
            }
            other => other,
        })
    }

    /// What one side of a branch does and gives, or how it leaves the loop around.
    fn side(
        &mut self,
        frame: &mut Frame,
        span: Span,
        run: impl FnOnce(&mut Self, &mut Frame) -> Done<Value>,
    ) -> Done<(Vec<Stmt>, Result<Value, Leave>)> {
        self.blocks.push(Vec::new());
        let done = run(self, frame);
        let mut block = self.blocks.pop().unwrap_or_default();
        match self.no_return(frame, done, span) {
            Ok(value) => Ok((block, Ok(value))),
            Err(Stop::Leave(what)) => {
                block.push(Stmt::Leave(what));
                Ok((block, Err(what)))
            }
            Err(stop) => Err(stop),
        }
    }

    pub(super) fn no_return(&self, frame: &Frame, done: Done<Value>, span: Span) -> Done<Value> {
        match done {
            Err(Stop::Return(_)) => {
                let reason = "this `return` has no form here: it is in a loop, within too many branches, or beside a \
                              variable with the name of one that is read later. Keep the value in a variable, and \
                              give it at the end";
                Err(self.refuse(frame, span, reason))
            }
            other => other,
        }
    }

    pub(super) fn matched(&mut self, frame: &mut Frame, m: &syn::ExprMatch) -> Done<Value> {
        let value = self.value(frame, &m.expr)?;
        let known = match &value {
            Value::Variant(name) => Err(name.clone()),
            other => match other.as_int() {
                Some(i) => Ok(i),
                None => return self.chosen_arm(frame, m, value),
            },
        };
        for arm in &m.arms {
            if arm.guard.is_some() {
                return Err(self.refuse(frame, arm.span(), "a guard has no form here"));
            }
            let fits = match (&arm.pat, &known) {
                (syn::Pat::Wild(_), _) => true,
                (syn::Pat::Lit(l), Ok(i)) => {
                    let v = self.literal(frame, &l.lit)?;
                    v.as_int() == Some(*i)
                }
                (syn::Pat::Path(p), Err(name)) => {
                    let own = segments(&p.path).join("::");
                    own == *name || own.rsplit("::").next() == name.rsplit("::").next()
                }
                (syn::Pat::Path(p), Ok(i)) => self.path(frame, p)?.as_int() == Some(*i),
                _ => {
                    return Err(self.refuse(
                        frame,
                        arm.pat.span(),
                        "this pattern has no form here",
                    ));
                }
            };
            if fits {
                return self.expr(frame, &arm.body);
            }
        }
        Err(self.refuse(frame, m.span(), "no arm fits"))
    }

    /// A `match` on a number that is not known, as a chain of branches.
    fn chosen_arm(&mut self, frame: &mut Frame, m: &syn::ExprMatch, value: Value) -> Done<Value> {
        let Value::Scalar(e) = value else {
            let reason = "`match` is for numbers, and for what is known when the text is written";
            return Err(self.refuse(frame, m.expr.span(), reason));
        };
        let kept = self.kept("matched", e, Rank::Part);
        // No variable of a source is called so.
        let name = syn::Ident::new("__matched", m.expr.span());
        let mut chain: Option<syn::Expr> = None;
        for arm in m.arms.iter().rev() {
            let body = &arm.body;
            let (mut condition, binding) = match self.fits(frame, &arm.pat, &name) {
                Some(fits) => fits,
                None => {
                    let reason =
                        "this pattern has no form here: take numbers, `|`, ranges, a name or `_`";
                    return Err(self.refuse(frame, arm.pat.span(), reason));
                }
            };
            let body: syn::Expr = syn::parse_quote_spanned!(arm.pat.span()=> { #binding #body });
            if let Some((_, guard)) = &arm.guard {
                let guarded: syn::Expr =
                    syn::parse_quote_spanned!(guard.span()=> ({ #binding #guard }));
                condition = Some(match condition {
                    Some(fits) => syn::parse_quote_spanned!(guard.span()=> (#fits) && #guarded),
                    None => guarded,
                });
            }
            // Rust has seen that some arm fits, so that the last one needs no condition.
            chain = Some(match (chain, condition) {
                (None, _) | (_, None) => body,
                (Some(rest), Some(fits)) => {
                    syn::parse_quote_spanned!(arm.pat.span()=> if #fits #body else { #rest })
                }
            });
        }
        let Some(chain) = chain else {
            return Err(self.refuse(frame, m.span(), "no arm fits"));
        };
        frame.scopes.push(HashMap::new());
        self.declare(frame, "__matched", Value::Scalar(kept));
        let done = self.expr(frame, &chain);
        frame.scopes.pop();
        done
    }

    /// When a pattern fits the number of that name, if it may not, and what it binds.
    fn fits(
        &self,
        frame: &Frame,
        pat: &syn::Pat,
        name: &syn::Ident,
    ) -> Option<(Option<syn::Expr>, TokenStream)> {
        let span = pat.span();
        let nothing = TokenStream::new();
        Some(match pat {
            syn::Pat::Wild(_) => (None, nothing),
            syn::Pat::Paren(p) => self.fits(frame, &p.pat, name)?,
            syn::Pat::Lit(lit) => match &lit.lit {
                syn::Lit::Bool(b) if b.value => (Some(syn::parse_quote!(#name)), nothing),
                syn::Lit::Bool(_) => (Some(syn::parse_quote!(!#name)), nothing),
                _ => (
                    Some(syn::parse_quote_spanned!(span=> #name == #lit)),
                    nothing,
                ),
            },
            syn::Pat::Path(p) => (Some(syn::parse_quote_spanned!(span=> #name == #p)), nothing),
            syn::Pat::Range(r) => {
                let from = r.start.as_ref().map(|from| quote::quote!(#name >= #from));
                let to = r.end.as_ref().map(|to| match r.limits {
                    syn::RangeLimits::HalfOpen(_) => quote::quote!(#name < #to),
                    syn::RangeLimits::Closed(_) => quote::quote!(#name <= #to),
                });
                let both = match (from, to) {
                    (Some(from), Some(to)) => quote::quote!(#from && #to),
                    (from, to) => from.or(to)?,
                };
                (Some(syn::parse_quote_spanned!(span=> #both)), nothing)
            }
            syn::Pat::Or(or) => {
                let mut all: Option<syn::Expr> = None;
                for case in &or.cases {
                    let (Some(fits), _) = self.fits(frame, case, name)? else {
                        return Some((None, nothing));
                    };
                    all = Some(match all {
                        Some(before) => syn::parse_quote_spanned!(span=> #before || #fits),
                        None => fits,
                    });
                }
                (Some(all?), nothing)
            }
            syn::Pat::Ident(i) if i.subpat.is_none() => {
                let ident = &i.ident;
                let names = [ident.to_string()];
                if matches!(
                    self.tree.resolve(frame.module, &names),
                    Some((_, Item::Const(_)))
                ) {
                    (
                        Some(syn::parse_quote_spanned!(span=> #name == #ident)),
                        nothing,
                    )
                } else {
                    (None, quote::quote!(let #ident = #name;))
                }
            }
            _ => return None,
        })
    }
}

/// The names that are assigned somewhere in the tokens, or lent out to be changed.
pub(super) fn assigned(tokens: TokenStream, names: &mut BTreeSet<String>) {
    let all: Vec<TokenTree> = tokens.into_iter().collect();
    let punct = |i: usize| match all.get(i) {
        Some(TokenTree::Punct(p)) => Some(p.as_char()),
        _ => None,
    };
    for (i, token) in all.iter().enumerate() {
        match token {
            TokenTree::Group(g) => assigned(g.stream(), names),
            TokenTree::Ident(ident) if *ident == "mut" && i > 0 && punct(i - 1) == Some('&') => {
                if let Some(TokenTree::Ident(name)) = all.get(i + 1) {
                    names.insert(name.to_string());
                }
            }
            TokenTree::Punct(p) if p.as_char() == '=' => {
                let next = punct(i + 1);
                let before = if i > 0 { punct(i - 1) } else { None };
                let joined =
                    p.spacing() == proc_macro2::Spacing::Joint && matches!(next, Some('=' | '>'));
                let compares = matches!(before, Some('=' | '!' | '<' | '>'))
                    && matches!(&all[i - 1], TokenTree::Punct(q) if q.spacing() == proc_macro2::Spacing::Joint)
                    // `<<=` and `>>=` assign.
                    && !(i > 1 && matches!(before, Some('<' | '>')) && punct(i - 2) == before);
                if joined || compares {
                    continue;
                }
                let mut start = i;
                while start > 0 && punct(start - 1) != Some(';') {
                    if matches!(&all[start - 1], TokenTree::Group(g) if g.delimiter() == proc_macro2::Delimiter::Brace)
                    {
                        break;
                    }
                    start -= 1;
                }
                let run = &all[start..i];
                if matches!(run.first(), Some(TokenTree::Ident(first)) if *first == "let" || *first == "const")
                {
                    continue;
                }
                match run.iter().find(|t| !matches!(t, TokenTree::Punct(_))) {
                    Some(TokenTree::Ident(name)) => {
                        names.insert(name.to_string());
                    }
                    Some(TokenTree::Group(g)) => {
                        for t in g.stream() {
                            if let TokenTree::Ident(name) = t {
                                names.insert(name.to_string());
                            }
                        }
                    }
                    _ => {}
                }
            }
            _ => {}
        }
    }
}
