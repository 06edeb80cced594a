//! Variables: the slots that the source's names stand for, the locals that hold their scalars in the text,
//! and places, which are assigned to.

use std::collections::BTreeSet;

use proc_macro2::Span;
use syn::spanned::Spanned;

use super::types::int_literal;
use super::{Done, Evaluator, Frame, Slot};
use crate::functions::fold::{float, literal, local};
use crate::functions::ir::{Expr, Id, Kind, Local, Rank, Scalar, Stmt, Type};
use crate::functions::source::segments;
use crate::functions::value::{Place, Step, Value};

impl Evaluator<'_> {
    pub(super) fn new_local(&mut self, name: &str, ty: Type, rank: Rank) -> Id {
        let name = name.trim_start_matches("r#").trim_start_matches('_');
        let name = if name.is_empty() { "value" } else { name };
        self.locals.push(Local {
            name: name.into(),
            ty,
            rank,
        });
        self.locals.len() - 1
    }

    pub(super) fn emit(&mut self, stmt: Stmt) {
        if let Some(block) = self.blocks.last_mut() {
            block.push(stmt);
        }
    }

    pub(super) fn declare(&mut self, frame: &mut Frame, name: &str, value: Value) {
        self.slots.push(Slot {
            name: name.into(),
            value,
            depth: self.blocks.len(),
        });
        if let Some(scope) = frame.scopes.last_mut() {
            scope.insert(name.into(), self.slots.len() - 1);
        }
    }

    /// A value whose parts have no variable of their own in the source, each computed once.
    pub(in crate::functions) fn part(&mut self, value: Value, name: &str) -> Value {
        self.settled(value, name, Rank::Part)
    }

    /// The value with each scalar that is an operation, or that may change, kept in a local.
    pub(super) fn settled(&mut self, mut value: Value, name: &str, rank: Rank) -> Value {
        let own = match &value {
            Value::Scalar(_) => rank,
            _ => rank.min(Rank::Part),
        };
        let mut all = Vec::new();
        value.each_scalar(name, &mut |part, e| all.push((part.to_owned(), e.clone())));
        let mut kept = Vec::with_capacity(all.len());
        for (part, e) in all {
            kept.push(self.kept(&part, e, own));
        }
        let mut kept = kept.into_iter();
        value.each_scalar(name, &mut |_, e| {
            if let Some(other) = kept.next() {
                *e = other;
            }
        });
        value
    }

    /// Whether it is a local that does not change, or a member of one.
    fn stays(&self, e: &Expr) -> bool {
        match &e.kind {
            Kind::Local(id) => !self.changing.contains(id),
            Kind::Member(of, _) => self.stays(of),
            _ => false,
        }
    }

    pub(super) fn kept(&mut self, name: &str, e: Expr, rank: Rank) -> Expr {
        match &e.kind {
            Kind::Literal(_) => e,
            Kind::Local(id) if !self.changing.contains(id) => {
                let id = *id;
                // A variable's own name says more than the place that its value came from.
                if self.locals[id].rank < rank {
                    self.locals[id].rank = rank;
                    self.locals[id].name = name.trim_start_matches('_').to_owned();
                }
                e
            }
            Kind::Member(of, _) if self.stays(of) => e,
            _ => {
                let ty = e.ty.clone();
                let id = self.new_local(name, ty.clone(), rank);
                self.emit(Stmt::Let(id, e));
                local(id, ty)
            }
        }
    }

    /// Gives a place another value.
    pub(super) fn assign(
        &mut self,
        frame: &Frame,
        place: &Place,
        value: Value,
        span: Span,
    ) -> Done<()> {
        let name = self.slots[place.slot].name.clone();
        let name = match place.path.last() {
            Some(Step::Field(f)) if !f.starts_with(|c: char| c.is_ascii_digit()) => f.clone(),
            Some(Step::Index(i)) => format!("{name}{i}"),
            _ => name,
        };
        let depth = self.slots[place.slot].depth;
        let inner = self.blocks.len() > depth;
        let mut olds = Vec::new();
        match self.slots[place.slot].value.part(&place.path) {
            Some(old) => old.each_scalar(&name, &mut |_, e| olds.push(e.clone())),
            None => return Err(self.refuse(frame, span, "this cannot be assigned to")),
        }
        let changing = |e: &Expr| match e.kind {
            Kind::Local(id) if self.changing.contains(&id) => Some(id),
            _ => None,
        };
        let targets: Vec<Option<Id>> = olds.iter().map(changing).collect();
        if targets.iter().any(Option::is_some) {
            let mut news = Vec::new();
            let mut value = value;
            value.each_scalar(&name, &mut |_, e| news.push(e.clone()));
            if news.len() != targets.len() || targets.iter().any(Option::is_none) {
                let reason = "what is assigned in a loop or branch must be numbers before it, too: \
                              give it a value that is not a mere literal's type";
                return Err(self.refuse(frame, span, reason));
            }
            // Several numbers change at once: what reads one of them is computed before.
            if news.len() > 1 {
                for new in &mut news {
                    let e = new.clone();
                    *new = if matches!(e.kind, Kind::Literal(_)) {
                        e
                    } else {
                        let ty = e.ty.clone();
                        let id = self.new_local(&name, ty.clone(), Rank::Part);
                        self.emit(Stmt::Let(id, e));
                        local(id, ty)
                    };
                }
            }
            for (target, new) in targets.into_iter().zip(news) {
                if let Some(id) = target
                    && !matches!(new.kind, Kind::Local(other) if other == id)
                {
                    self.emit(Stmt::Assign(id, new));
                }
            }
            return Ok(());
        }
        if inner {
            let reason = format!(
                "`{name}` is changed inside of a loop or branch in a way that is not seen before it"
            );
            return Err(self.refuse(frame, span, reason));
        }
        let rank = if matches!(value, Value::Scalar(_)) {
            Rank::Variable
        } else {
            Rank::Part
        };
        let value = self.settled(value, &name, rank);
        if let Some(old) = self.slots[place.slot].value.part(&place.path) {
            *old = value;
        }
        Ok(())
    }

    /// Lets the variables that `names` are change from here on: they are assigned in a loop or branch.
    pub(super) fn let_change(&mut self, frame: &Frame, names: &BTreeSet<String>) {
        let mut slots: Vec<usize> = names.iter().filter_map(|n| frame.find(n)).collect();
        // A variable may be a reference to another one.
        for i in 0..slots.len() {
            if let Value::Ref(place) = &self.slots[slots[i]].value {
                slots.push(place.slot);
            }
        }
        slots.sort_unstable();
        slots.dedup();
        for slot in slots {
            let name = self.slots[slot].name.clone();
            let mut value = self.slots[slot].value.clone();
            // A number whose type is not said has Rust's own.
            match value {
                Value::Fraction(_, single) => value = Value::Scalar(float(single)),
                Value::Int(i) => {
                    if let Some(number) = int_literal(i, Scalar::I32) {
                        value = Value::Scalar(literal(number));
                    }
                }
                _ => {}
            }
            let mut all = Vec::new();
            value.each_scalar(&name, &mut |part, e| all.push((part.to_owned(), e.clone())));
            let mut fresh = Vec::new();
            for (part, e) in all {
                if matches!(e.kind, Kind::Local(id) if self.changing.contains(&id)) {
                    fresh.push(e);
                    continue;
                }
                let ty = e.ty.clone();
                let id = self.new_local(&part, ty.clone(), Rank::Variable);
                self.emit(Stmt::Var(id, e));
                self.changing.insert(id);
                fresh.push(local(id, ty));
            }
            let mut fresh = fresh.into_iter();
            value.each_scalar(&name, &mut |_, e| {
                if let Some(other) = fresh.next() {
                    *e = other;
                }
            });
            self.slots[slot].value = value;
        }
    }

    /// What a reference refers to; anything else as it is.
    pub(in crate::functions) fn read(&mut self, value: Value) -> Value {
        match value {
            Value::Ref(place) => {
                let found = self.slots[place.slot].value.part(&place.path).cloned();
                match found {
                    Some(inner) => self.read(inner),
                    None => Value::Unit,
                }
            }
            other => other,
        }
    }

    pub(super) fn place(&mut self, frame: &mut Frame, e: &syn::Expr) -> Done<Place> {
        match e {
            syn::Expr::Paren(p) => self.place(frame, &p.expr),
            syn::Expr::Group(g) => self.place(frame, &g.expr),
            syn::Expr::Unary(u) if matches!(u.op, syn::UnOp::Deref(_)) => {
                self.place(frame, &u.expr)
            }
            syn::Expr::Path(p) => {
                let names = segments(&p.path);
                let slot = match names.as_slice() {
                    [name] => frame.find(name),
                    _ => None,
                };
                let Some(slot) = slot else {
                    return Err(self.refuse(frame, p.span(), "only a variable can be changed"));
                };
                match &self.slots[slot].value {
                    Value::Ref(place) => Ok(place.clone()),
                    _ => Ok(Place {
                        slot,
                        path: Vec::new(),
                    }),
                }
            }
            syn::Expr::Field(f) => {
                let mut place = self.place(frame, &f.base)?;
                place.path.push(Step::Field(match &f.member {
                    syn::Member::Named(n) => n.to_string(),
                    syn::Member::Unnamed(i) => i.index.to_string(),
                }));
                Ok(place)
            }
            syn::Expr::Index(i) => {
                let mut place = self.place(frame, &i.expr)?;
                let index = self.value(frame, &i.index)?;
                let Some(at) = index.as_int().and_then(|at| usize::try_from(at).ok()) else {
                    let reason = "an array is indexed by what is known when the text is written";
                    return Err(self.refuse(frame, i.span(), reason));
                };
                place.path.push(Step::Index(at));
                Ok(place)
            }
            syn::Expr::Call(c) => match element(c) {
                Some((element, true)) => self.place(frame, &element),
                _ => Err(self.refuse(frame, c.span(), "this cannot be changed")),
            },
            other => Err(self.refuse(frame, other.span(), "this cannot be changed")),
        }
    }

    pub(super) fn assignment(&mut self, frame: &mut Frame, a: &syn::ExprAssign) -> Done<Value> {
        let value = self.value(frame, &a.right)?;
        if let syn::Expr::Tuple(t) = a.left.as_ref() {
            let Value::Tuple(all) = value else {
                return Err(self.refuse(frame, a.span(), "a tuple is assigned to a tuple"));
            };
            let mut news = Vec::new();
            for v in all {
                news.push(self.part(v, "next"));
            }
            for (e, v) in t.elems.iter().zip(news) {
                let place = self.place(frame, e)?;
                self.assign(frame, &place, v, a.span())?;
            }
            return Ok(Value::Unit);
        }
        let place = self.place(frame, &a.left)?;
        let value = self.like(&place, value);
        self.assign(frame, &place, value, a.span())?;
        Ok(Value::Unit)
    }

    /// A literal without type gets that of what it replaces.
    fn like(&mut self, place: &Place, value: Value) -> Value {
        let old = self.slots[place.slot].value.part(&place.path).cloned();
        match (old, &value) {
            (Some(Value::Scalar(e)), Value::Fraction(_, single)) if e.ty == Type::F32 => {
                Value::Scalar(float(*single))
            }
            (Some(Value::Double(_)), Value::Fraction(double, _)) => Value::Double(*double),
            (Some(Value::Scalar(e)), Value::Int(i)) => {
                e.ty.scalar()
                    .and_then(|s| int_literal(*i, s))
                    .map_or(value, |l| Value::Scalar(literal(l)))
            }
            _ => value,
        }
    }
}

/// Of `array_element(&array, i)` and `array_element_mut(&mut array, i)`, `array[i]`, and whether it may be changed.
pub(super) fn element(call: &syn::ExprCall) -> Option<(syn::Expr, bool)> {
    let syn::Expr::Path(p) = call.func.as_ref() else {
        return None;
    };
    let is_changed = match p.path.segments.last()?.ident.to_string().as_str() {
        "array_element" => false,
        "array_element_mut" => true,
        _ => return None,
    };
    let mut args = call.args.iter();
    let (array, index) = (args.next()?, args.next()?);
    let array = match array {
        syn::Expr::Reference(r) => r.expr.as_ref(),
        other => other,
    };
    let indexed = syn::ExprIndex {
        attrs: Vec::new(),
        expr: Box::new(array.clone()),
        bracket_token: syn::token::Bracket(call.span()),
        index: Box::new(index.clone()),
    };
    Some((indexed.into(), is_changed))
}
