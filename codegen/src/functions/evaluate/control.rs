//! Control flow: branches, `match`, loops and `unroll!`. What is known is run here; what is not stays a branch or a
//! loop, and the variables that are assigned in it change from there on.

use std::collections::{BTreeSet, HashMap};

use proc_macro2::{Span, TokenStream, TokenTree};
use syn::spanned::Spanned;

use super::types::int_literal;
use super::{Done, Evaluator, Frame, Stop};
use crate::functions::fold::{builtin, float, literal, local};
use crate::functions::ir::{Builtin, Kind, Literal, Rank, Scalar, Stmt, Type};
use crate::functions::source::segments;
use crate::functions::value::Value;

/// Turns of a loop whose body is run here at most.
const MOST_TURNS: usize = 4096;

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

        self.blocks.push(Vec::new());
        let then = self.block(frame, &i.then_branch);
        let then_block = self.blocks.pop().unwrap_or_default();
        let then = self.no_return(frame, then, i.span())?;
        self.blocks.push(Vec::new());
        let other = match &i.else_branch {
            Some((_, e)) => self.expr(frame, e),
            None => Ok(Value::Unit),
        };
        let other_block = self.blocks.pop().unwrap_or_default();
        let other = self.no_return(frame, other, i.span())?;

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

    fn no_return(&self, frame: &Frame, done: Done<Value>, span: Span) -> Done<Value> {
        match done {
            Err(Stop::Return(_)) => {
                let reason = "a `return` that only happens sometimes has no form here: give a value \
                              from both branches";
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
                None => {
                    let reason = "`match` is for what is known when the text is written";
                    return Err(self.refuse(frame, m.expr.span(), reason));
                }
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

    pub(super) fn repeated(&mut self, frame: &mut Frame, w: &syn::ExprWhile) -> Done<Value> {
        let mut names = BTreeSet::new();
        let body = &w.body;
        assigned(quote::quote!(#body), &mut names);
        let condition = self.value(frame, &w.cond)?;
        let counter = counter(w);
        // A loop over what is known is run here; one over what is not stays a loop.
        let others_known = names
            .iter()
            .filter(|n| Some(n.as_str()) != counter.as_ref().map(|c| c.name.as_str()))
            .filter_map(|n| frame.find(n))
            .all(|slot| self.slots[slot].value.is_known());
        let is_known = condition.as_bool().is_some();
        let used = counter.as_ref().is_some_and(|c| c.used);
        if is_known && (others_known || used || counter.is_none()) {
            for _ in 0..MOST_TURNS {
                let condition = self.value(frame, &w.cond)?;
                match condition.as_bool() {
                    Some(false) => return Ok(Value::Unit),
                    Some(true) => {
                        self.block(frame, &w.body)?;
                    }
                    None => break,
                }
            }
            return Err(self.refuse(frame, w.span(), "this loop does not end while it is known"));
        }
        let Some(counter) = counter else {
            let reason = "a loop counts: `let mut i = 0; while i < end { …; i += 1; }`";
            return Err(self.refuse(frame, w.span(), reason));
        };
        names.remove(&counter.name);
        let Some(slot) = frame.find(&counter.name) else {
            return Err(self.refuse(frame, w.span(), "the counter is not found"));
        };
        let end = self.value(frame, &counter.end)?;
        let from = self.slots[slot].value.clone();
        let (from, end) = match (from, end) {
            (Value::Scalar(a), Value::Scalar(b)) => (a, b),
            (Value::Scalar(a), b @ Value::Int(_)) => {
                let b = self.put_together(frame, &b, &a.ty, w.span())?;
                (a, b)
            }
            (a @ Value::Int(_), Value::Scalar(b)) => {
                let a = self.put_together(frame, &a, &b.ty, w.span())?;
                (a, b)
            }
            (Value::Int(a), Value::Int(b)) => {
                let number = |i: i128| {
                    int_literal(i, Scalar::U32)
                        .map(literal)
                        .ok_or_else(|| self.refuse(frame, w.span(), "the counter is out of range"))
                };
                (number(a)?, number(b)?)
            }
            _ => return Err(self.refuse(frame, w.span(), "a counter is a whole number")),
        };
        if !matches!(from.ty, Type::Scalar(Scalar::U32 | Scalar::I32)) || from.ty != end.ty {
            return Err(self.refuse(frame, w.span(), "a counter is a `u32` or `i32`"));
        }
        let end = self.kept("end", end, Rank::Part);
        let from = self.kept("start", from, Rank::Part);
        self.let_change(frame, &names);
        let id = self.new_local(&counter.name, from.ty.clone(), Rank::Variable);
        self.changing.insert(id);
        self.slots[slot].value = Value::Scalar(local(id, from.ty.clone()));
        self.blocks.push(Vec::new());
        frame.scopes.push(HashMap::new());
        let stmts = &w.body.stmts[..w.body.stmts.len() - 1];
        let done = self.statements(frame, stmts);
        frame.scopes.pop();
        let block = self.blocks.pop().unwrap_or_default();
        self.no_return(frame, done, w.span())?;
        // After the loop nobody reads a counter; if somebody does, it is found out.
        self.slots[slot].value = Value::Text;
        self.emit(Stmt::For(id, from, end, block));
        Ok(Value::Unit)
    }

    pub(super) fn unroll(&mut self, frame: &mut Frame, mac: &syn::Macro) -> Done<Value> {
        let span = mac.path.span();
        let turns: Turns = self.parsed(frame, mac.tokens.clone(), span)?;
        let from = self.value(frame, &turns.from)?.as_int();
        let to = self.value(frame, &turns.to)?.as_int();
        let (Some(from), Some(to)) = (from, to) else {
            return Err(self.refuse(frame, span, "the range of `unroll!` is not known"));
        };
        let name = turns.index.to_string();
        // Without an index nothing tells one turn from another: it stays a loop.
        if name.starts_with('_') && to - from > 2 {
            let mut names = BTreeSet::new();
            let block = &turns.body;
            assigned(quote::quote!(#block), &mut names);
            let known = names
                .iter()
                .filter_map(|n| frame.find(n))
                .all(|slot| self.slots[slot].value.is_known());
            if !known {
                self.let_change(frame, &names);
                let id = self.new_local("turn", Type::U32, Rank::Variable);
                self.changing.insert(id);
                self.blocks.push(Vec::new());
                let done = self.block(frame, &turns.body);
                let block = self.blocks.pop().unwrap_or_default();
                self.no_return(frame, done, span)?;
                let number = |i: i128| literal(Literal::U32(i as u32));
                self.emit(Stmt::For(id, number(from), number(to), block));
                return Ok(Value::Unit);
            }
        }
        for i in from..to {
            frame.scopes.push(HashMap::new());
            self.declare(frame, &name, Value::Int(i));
            let done = self.block(frame, &turns.body);
            frame.scopes.pop();
            done?;
        }
        Ok(Value::Unit)
    }
}

/// The range and body of an `unroll!`.
struct Turns {
    index: proc_macro2::Ident,
    from: syn::Expr,
    to: syn::Expr,
    body: syn::Block,
}

impl syn::parse::Parse for Turns {
    fn parse(input: syn::parse::ParseStream<'_>) -> syn::Result<Self> {
        let index = input.parse()?;
        input.parse::<syn::Token![in]>()?;
        let range: syn::Expr = input.call(syn::Expr::parse_without_eager_brace)?;
        let syn::Expr::Range(syn::ExprRange {
            start: Some(from),
            end: Some(to),
            ..
        }) = range
        else {
            return Err(syn::Error::new(range.span(), "`unroll!` takes a range"));
        };
        input.parse::<syn::Token![,]>()?;
        if input.peek(syn::Ident) {
            input.parse::<syn::Ident>()?;
            input.parse::<syn::LitInt>()?;
            input.parse::<syn::Token![,]>()?;
        }
        // A loop in a shader: functions have no arrays, so that here it is none.
        if input.peek(syn::Token![loop]) {
            input.parse::<syn::Token![loop]>()?;
            input.parse::<syn::Token![if]>()?;
            input.parse::<syn::Expr>()?;
            input.parse::<syn::Token![,]>()?;
        }
        Ok(Self {
            index,
            from: *from,
            to: *to,
            body: input.parse()?,
        })
    }
}

/// What counts in a loop.
struct Counter {
    name: String,
    end: syn::Expr,
    /// The body reads it, but for counting.
    used: bool,
}

/// `while i < end { …; i += 1; }`
fn counter(w: &syn::ExprWhile) -> Option<Counter> {
    let syn::Expr::Binary(condition) = w.cond.as_ref() else {
        return None;
    };
    let (syn::BinOp::Lt(_), syn::Expr::Path(p)) = (condition.op, condition.left.as_ref()) else {
        return None;
    };
    let name = p.path.get_ident()?.to_string();
    let (last, before) = w.body.stmts.split_last()?;
    let syn::Stmt::Expr(syn::Expr::Binary(step), _) = last else {
        return None;
    };
    let (syn::BinOp::AddAssign(_), syn::Expr::Path(q), syn::Expr::Lit(one)) =
        (step.op, step.left.as_ref(), step.right.as_ref())
    else {
        return None;
    };
    if q.path.get_ident()? != &name || quote::quote!(#one).to_string() != "1" {
        return None;
    }
    let used = before.iter().any(|s| mentions(quote::quote!(#s), &name));
    Some(Counter {
        name,
        end: (*condition.right).clone(),
        used,
    })
}

fn mentions(tokens: TokenStream, name: &str) -> bool {
    tokens.into_iter().any(|t| match t {
        TokenTree::Ident(i) => i == name,
        TokenTree::Group(g) => mentions(g.stream(), name),
        _ => false,
    })
}

/// The names that are assigned somewhere in the tokens, or lent out to be changed.
fn assigned(tokens: TokenStream, names: &mut BTreeSet<String>) {
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
