//! Loops. One over what is known is run here, turn by turn; one over what is not stays a loop, and the variables that are
//! assigned in it change from there on.

use std::collections::{BTreeSet, HashMap};

use proc_macro2::{Span, TokenStream, TokenTree};
use syn::spanned::Spanned;

use super::control::assigned;
use super::types::int_literal;
use super::{Done, Evaluator, Frame, Stop};
use crate::functions::fold::{literal, local};
use crate::functions::ir::{Binary, Expr, Leave, Rank, Scalar, Stmt, Type};
use crate::functions::value::Value;

/// Turns of a loop whose body is run here at most.
const MOST_TURNS: usize = 4096;

/// Turns that are written one after the other, where a loop would do.
const FEW_TURNS: i128 = 4;

/// Why a `loop` is refused, and a `while` that does not count.
pub(super) const ENDLESS: &str =
    "a loop counts, so that it ends: `for i in 0..most { …; if done { break; } }`";

/// A loop that stays one: what it counts, and over what.
struct Counting<'a> {
    /// Its counter's name.
    name: &'a str,
    from: Expr,
    end: Expr,
    body: &'a [syn::Stmt],
    span: Span,
}

impl Evaluator<'_> {
    /// `for`
    pub(super) fn counted(&mut self, frame: &mut Frame, f: &syn::ExprForLoop) -> Done<Value> {
        if let Some(label) = &f.label {
            let reason = "a label has no form here: only the innermost loop is left";
            return Err(self.refuse(frame, label.span(), reason));
        }
        let Some((from, end)) = self.range(frame, &f.expr)? else {
            let Some(all) = self.elements(frame, &f.expr)? else {
                let reason = "`for` goes over a range, or over an array";
                return Err(self.refuse(frame, f.expr.span(), reason));
            };
            return self.each(frame, f, all);
        };
        let (Some(first), Some(last)) = (from.as_int(), end.as_int()) else {
            let (from, end) = self.counters(frame, from, end, f.expr.span())?;
            return self.counting(frame, f, from, end);
        };
        if first >= last {
            return Ok(Value::Unit);
        }
        // Written out if that is short or all of it is known; and where it must be, for elements of an array.
        let is_short = last - first <= FEW_TURNS || self.assigns_what_is_known(frame, &f.body);
        let ways: &[Option<Scalar>] = if is_short {
            &[None, Some(Scalar::I32), Some(Scalar::U32)]
        } else {
            &[Some(Scalar::I32), Some(Scalar::U32), None]
        };
        let mut refused = None;
        for way in ways {
            let before = self.clone();
            let scopes = frame.scopes.len();
            let done = match *way {
                None => {
                    let turns = usize::try_from(last - first).unwrap_or(usize::MAX);
                    if turns > MOST_TURNS {
                        continue;
                    }
                    let is_typed = |v: &Value| match v {
                        Value::Scalar(e) => e.ty.scalar(),
                        _ => None,
                    };
                    let scalar = is_typed(&from).or(is_typed(&end));
                    let number = |i| match scalar.and_then(|s| int_literal(i, s)) {
                        Some(typed) => Value::Scalar(literal(typed)),
                        None => Value::Int(i),
                    };
                    self.each(frame, f, (first..last).map(number).collect())
                }
                Some(scalar) => {
                    let number = |v: &Value, i| match v {
                        Value::Scalar(e) if e.ty != Type::Scalar(scalar) => None,
                        _ => int_literal(i, scalar).map(literal),
                    };
                    match (number(&from, first), number(&end, last)) {
                        (Some(from), Some(end)) => self.counting(frame, f, from, end),
                        _ => continue,
                    }
                }
            };
            match done {
                Err(Stop::Refused(refusal)) => {
                    *self = before;
                    frame.scopes.truncate(scopes);
                    refused = Some(refusal);
                }
                done => return done,
            }
        }
        Err(refused.map_or_else(
            || self.refuse(frame, f.expr.span(), "the counter is out of range"),
            Stop::Refused,
        ))
    }

    /// The ends of `a..b` and `a..=b`, the second one excluded.
    fn range(&mut self, frame: &mut Frame, e: &syn::Expr) -> Done<Option<(Value, Value)>> {
        match e {
            syn::Expr::Paren(p) => self.range(frame, &p.expr),
            syn::Expr::Group(g) => self.range(frame, &g.expr),
            syn::Expr::Range(r) => {
                let (Some(from), Some(end)) = (&r.start, &r.end) else {
                    return Err(self.refuse(frame, r.span(), "a range here has two ends"));
                };
                let from = self.value(frame, from)?;
                let mut end = self.value(frame, end)?;
                if matches!(r.limits, syn::RangeLimits::Closed(_)) {
                    end = self.operation(frame, Binary::Add, end, Value::Int(1), r.span())?;
                }
                Ok(Some((from, end)))
            }
            _ => Ok(None),
        }
    }

    /// What an iterator that is known gives.
    fn elements(&mut self, frame: &mut Frame, e: &syn::Expr) -> Done<Option<Vec<Value>>> {
        if let Some((from, end)) = self.range(frame, e)? {
            return Ok(match (from.as_int(), end.as_int()) {
                (Some(from), Some(end)) if end - from <= MOST_TURNS as i128 => {
                    Some((from..end).map(Value::Int).collect())
                }
                _ => None,
            });
        }
        if let syn::Expr::MethodCall(m) = e {
            let argument = match (m.method.to_string().as_str(), m.args.first()) {
                ("iter" | "into_iter" | "copied" | "cloned" | "rev" | "enumerate", None) => None,
                ("step_by" | "zip", Some(argument)) => Some(argument),
                _ => return self.array(frame, e),
            };
            let Some(mut all) = self.elements(frame, &m.receiver)? else {
                return Ok(None);
            };
            if m.method == "rev" {
                all.reverse();
            } else if m.method == "enumerate" {
                let pair = |(i, v)| Value::Tuple(vec![Value::Int(i as i128), v]);
                all = all.into_iter().enumerate().map(pair).collect();
            } else if m.method == "step_by"
                && let Some(step) = argument
            {
                let step = self.value(frame, step)?.as_int();
                let Some(step) = step
                    .and_then(|s| usize::try_from(s).ok())
                    .filter(|s| *s > 0)
                else {
                    return Ok(None);
                };
                all = all.into_iter().step_by(step).collect();
            } else if let Some(other) = argument {
                let Some(others) = self.elements(frame, other)? else {
                    return Ok(None);
                };
                let pair = |(a, b)| Value::Tuple(vec![a, b]);
                all = all.into_iter().zip(others).map(pair).collect();
            }
            return Ok(Some(all));
        }
        self.array(frame, e)
    }

    fn array(&mut self, frame: &mut Frame, e: &syn::Expr) -> Done<Option<Vec<Value>>> {
        Ok(match self.value(frame, e)? {
            Value::Array(all) => Some(all),
            _ => None,
        })
    }

    /// A `for` that is run here.
    fn each(&mut self, frame: &mut Frame, f: &syn::ExprForLoop, all: Vec<Value>) -> Done<Value> {
        for value in all {
            frame.scopes.push(HashMap::new());
            let done = match self.bind(frame, &f.pat, value, Rank::Variable) {
                Ok(()) => self.block(frame, &f.body),
                Err(stop) => Err(stop),
            };
            frame.scopes.pop();
            match done {
                Err(Stop::Leave(Leave::Loop)) => break,
                Ok(_) | Err(Stop::Leave(Leave::Turn)) => {}
                Err(stop) => return Err(stop),
            }
        }
        Ok(Value::Unit)
    }

    /// A `for` that stays a loop.
    fn counting(
        &mut self,
        frame: &mut Frame,
        f: &syn::ExprForLoop,
        from: Expr,
        end: Expr,
    ) -> Done<Value> {
        let name = match f.pat.as_ref() {
            syn::Pat::Ident(i) => i.ident.to_string(),
            syn::Pat::Wild(_) => "_turn".into(),
            other => return Err(self.refuse(frame, other.span(), "a counter has a name")),
        };
        self.kept_loop(
            frame,
            &Counting {
                name: &name,
                from,
                end,
                body: &f.body.stmts,
                span: f.expr.span(),
            },
        )
    }

    /// Writes a loop.
    fn kept_loop(&mut self, frame: &mut Frame, counting: &Counting<'_>) -> Done<Value> {
        let mut names = BTreeSet::new();
        for stmt in counting.body {
            assigned(quote::quote!(#stmt), &mut names);
        }
        let ty = counting.from.ty.clone();
        let is_whole = matches!(ty, Type::Scalar(Scalar::U32 | Scalar::I32));
        if !is_whole || ty != counting.end.ty {
            return Err(self.refuse(frame, counting.span, "a counter is a `u32` or `i32`"));
        }
        let end = self.kept("end", counting.end.clone(), Rank::Part);
        let from = self.kept("start", counting.from.clone(), Rank::Part);
        self.let_change(frame, &names);
        let id = self.new_local(counting.name, ty.clone(), Rank::Variable);
        self.changing.insert(id);
        self.blocks.push(Vec::new());
        frame.scopes.push(HashMap::new());
        self.declare(frame, counting.name, Value::Scalar(local(id, ty)));
        let done = self.statements(frame, counting.body);
        frame.scopes.pop();
        let mut block = self.blocks.pop().unwrap_or_default();
        match self.no_return(frame, done, counting.span) {
            Err(Stop::Leave(what)) => block.push(Stmt::Leave(what)),
            other => {
                other?;
            }
        }
        self.emit(Stmt::For(id, from, end, block));
        Ok(Value::Unit)
    }

    /// Two ends of a range as scalars of one type.
    fn counters(&self, frame: &Frame, from: Value, end: Value, span: Span) -> Done<(Expr, Expr)> {
        Ok(match (from, end) {
            (Value::Scalar(a), Value::Scalar(b)) => (a, b),
            (Value::Scalar(a), b @ Value::Int(_)) => {
                let b = self.put_together(frame, &b, &a.ty, span)?;
                (a, b)
            }
            (a @ Value::Int(_), Value::Scalar(b)) => {
                let a = self.put_together(frame, &a, &b.ty, span)?;
                (a, b)
            }
            (Value::Int(a), Value::Int(b)) => {
                let number = |i: i128| {
                    int_literal(i, Scalar::U32)
                        .map(literal)
                        .ok_or_else(|| self.refuse(frame, span, "the counter is out of range"))
                };
                (number(a)?, number(b)?)
            }
            _ => return Err(self.refuse(frame, span, "a counter is a whole number")),
        })
    }

    /// Whether all that a body assigns is known before it.
    fn assigns_what_is_known(&self, frame: &Frame, body: &syn::Block) -> bool {
        let mut names = BTreeSet::new();
        assigned(quote::quote!(#body), &mut names);
        names
            .iter()
            .filter_map(|n| frame.find(n))
            .all(|slot| self.slots[slot].value.is_known())
    }

    /// `while`
    pub(super) fn repeated(&mut self, frame: &mut Frame, w: &syn::ExprWhile) -> Done<Value> {
        if matches!(w.cond.as_ref(), syn::Expr::Let(_)) {
            return Err(self.refuse(frame, w.cond.span(), "`while let` has no form here"));
        }
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
                    Some(true) => match self.block(frame, &w.body) {
                        Err(Stop::Leave(Leave::Loop)) => return Ok(Value::Unit),
                        Ok(_) | Err(Stop::Leave(Leave::Turn)) => {}
                        Err(stop) => return Err(stop),
                    },
                    None => break,
                }
            }
            return Err(self.refuse(frame, w.span(), "this loop does not end while it is known"));
        }
        let Some(counter) = counter else {
            return Err(self.refuse(frame, w.span(), ENDLESS));
        };
        let (_, before) = w.body.stmts.split_last().unwrap_or((&w.body.stmts[0], &[]));
        if before
            .iter()
            .any(|s| mentions(quote::quote!(#s), "continue"))
        {
            let reason = "`continue` before the count is written as `for i in start..end`";
            return Err(self.refuse(frame, w.span(), reason));
        }
        let Some(slot) = frame.find(&counter.name) else {
            return Err(self.refuse(frame, w.span(), "the counter is not found"));
        };
        let end = self.value(frame, &counter.end)?;
        let from = self.slots[slot].value.clone();
        let (from, end) = self.counters(frame, from, end, w.span())?;
        let done = self.kept_loop(
            frame,
            &Counting {
                name: &counter.name,
                from,
                end,
                body: before,
                span: w.span(),
            },
        );
        // After the loop nobody reads a counter; if somebody does, it is found out.
        self.slots[slot].value = Value::Text;
        done
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
        if name.starts_with('_') && to - from > 2 && !self.assigns_what_is_known(frame, &turns.body)
        {
            let number = |i: i128| {
                int_literal(i, Scalar::U32)
                    .map(literal)
                    .ok_or_else(|| self.refuse(frame, span, "the counter is out of range"))
            };
            let (from, end) = (number(from)?, number(to)?);
            return self.kept_loop(
                frame,
                &Counting {
                    name: "_turn",
                    from,
                    end,
                    body: &turns.body.stmts,
                    span,
                },
            );
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
