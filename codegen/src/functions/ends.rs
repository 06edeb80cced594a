//! Ends of functions, for languages in which a branch can return: what both sides of a last branch would give to a
//! variable, they return.

use std::collections::HashMap;

use super::ir::{Expr, Id, Kind, Stmt, expressions, replace, walk};

/// Operations at most of a result that is written on both sides of a branch.
const LONGEST: usize = 3;

/// `var y = 0; if c { …; y = a; } else { …; y = b; } return y;` as `if c { …; return a; } …; return b;`
pub fn early(body: &[Stmt]) -> Vec<Stmt> {
    let mut body = body.to_vec();
    while let Some(next) = divided(&body) {
        body = next;
    }
    for stmt in &mut body {
        if let Stmt::If(_, then, _) = stmt
            && matches!(then.last(), Some(Stmt::Return(_)))
        {
            *then = early(then);
        }
    }
    body
}

/// The block with its last branch's sides returning, if that can be.
fn divided(body: &[Stmt]) -> Option<Vec<Stmt>> {
    let [
        before @ ..,
        Stmt::If(condition, then, other),
        Stmt::Return(result),
    ] = body
    else {
        return None;
    };
    let mut operations = 0;
    walk(result, &mut |e| {
        operations += usize::from(matches!(e.kind, Kind::Binary(..) | Kind::Builtin(..)));
    });
    // What the branch is for: variables that start before it, and that the result is made of.
    let starts: HashMap<Id, Expr> = before
        .iter()
        .filter_map(|s| match s {
            Stmt::Var(id, first) if mentions(result, *id) => Some((*id, first.clone())),
            _ => None,
        })
        .collect();
    let is_literal = |e: &Expr| matches!(e.kind, Kind::Literal(_));
    if operations > LONGEST || starts.is_empty() || !starts.values().all(is_literal) {
        return None;
    }
    let rest: Vec<Stmt> = before
        .iter()
        .filter(|s| !matches!(s, Stmt::Var(id, _) if starts.contains_key(id)))
        .cloned()
        .collect();
    if starts
        .keys()
        .any(|id| is_mentioned(&rest, *id) || mentions(condition, *id))
    {
        return None;
    }
    let then = returned(then, result, &starts)?;
    let other = returned(other, result, &starts)?;
    let mut out = rest;
    out.push(Stmt::If(condition.clone(), then, Vec::new()));
    out.extend(other);
    Some(out)
}

/// A side of a branch that returns the result, of which it assigns the parts last.
fn returned(side: &[Stmt], result: &Expr, starts: &HashMap<Id, Expr>) -> Option<Vec<Stmt>> {
    let mut values = starts.clone();
    let mut end = side.len();
    while let Some(Stmt::Assign(id, value)) = side[..end].last()
        && starts.contains_key(id)
    {
        if starts.keys().any(|id| mentions(value, *id)) {
            return None;
        }
        values.insert(*id, value.clone());
        end -= 1;
    }
    if starts.keys().any(|id| is_mentioned(&side[..end], *id)) {
        return None;
    }
    let result = replace(result, &|e| match e.kind {
        Kind::Local(id) => values.get(&id).cloned(),
        _ => None,
    });
    let mut out = side[..end].to_vec();
    out.push(Stmt::Return(result));
    Some(out)
}

fn mentions(e: &Expr, id: Id) -> bool {
    let mut found = false;
    walk(e, &mut |x| {
        found |= matches!(x.kind, Kind::Local(l) if l == id)
    });
    found
}

/// Whether a local is read or assigned.
fn is_mentioned(body: &[Stmt], id: Id) -> bool {
    fn assigned(body: &[Stmt], id: Id) -> bool {
        body.iter().any(|s| match s {
            Stmt::Assign(l, _) => *l == id,
            Stmt::If(_, a, b) => assigned(a, id) || assigned(b, id),
            Stmt::For(_, _, _, inner) => assigned(inner, id),
            _ => false,
        })
    }
    let mut found = assigned(body, id);
    expressions(body, &mut |e| found |= mentions(e, id));
    found
}
