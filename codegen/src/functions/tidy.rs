//! Makes of translated statements what a person would write: parts that are used once stand where
//! they are used, what is not used is gone, and every name is unique and free in every language.

use std::collections::{HashMap, HashSet};

use super::fold;
use super::ir::{Expr, Function, Id, Kind, Local, Rank, Stmt, Type, expressions, replace, walk};
use super::names;

/// Operations in one expression at most, when a part is put into it.
const LONGEST: usize = 14;

/// Tidies a function.
pub fn tidy(function: &mut Function) {
    let mut body = std::mem::take(&mut function.body);
    let params: HashSet<Id> = function.params.iter().map(|p| p.id).collect();
    loop {
        let before = body.clone();
        drop_unused(&mut body);
        once(&mut body, &function.locals);
        start_with(&mut body, &mut function.locals);
        put_in_place(&mut body, &function.locals);
        if body == before {
            break;
        }
    }
    drop_comments(&mut body);
    structures_alone(&mut body, &mut function.locals);
    function.body = body;
    compact(function, &params);
    names::make_unique(function);
}

fn uses(body: &[Stmt]) -> HashMap<Id, usize> {
    let mut counts = HashMap::new();
    expressions(body, &mut |e| {
        walk(e, &mut |x| match x.kind {
            Kind::Local(id) | Kind::Lookup(id, _) => *counts.entry(id).or_insert(0) += 1,
            _ => {}
        });
    });
    counts
}

/// Removes locals that nobody reads, and empty branches and loops.
fn drop_unused(body: &mut Vec<Stmt>) {
    loop {
        // What is only read to compute its own next value counts as not read.
        let counts = read_by_others(body);
        if !drop_within(body, &counts) {
            return;
        }
    }
}

fn read_by_others(body: &[Stmt]) -> HashMap<Id, usize> {
    fn count(body: &[Stmt], counts: &mut HashMap<Id, usize>) {
        for stmt in body {
            let own = match stmt {
                Stmt::Assign(id, _) => Some(*id),
                _ => None,
            };
            let mut with = |e: &Expr| {
                walk(e, &mut |x| match x.kind {
                    Kind::Local(id) | Kind::Lookup(id, _) if Some(id) != own => {
                        *counts.entry(id).or_insert(0) += 1;
                    }
                    _ => {}
                });
            };
            match stmt {
                Stmt::Comment(_) | Stmt::Leave(_) => {}
                Stmt::Let(_, e) | Stmt::Var(_, e) | Stmt::Assign(_, e) | Stmt::Return(e) => with(e),
                Stmt::If(c, a, b) => {
                    with(c);
                    count(a, counts);
                    count(b, counts);
                }
                Stmt::For(_, from, to, inner) => {
                    with(from);
                    with(to);
                    count(inner, counts);
                }
            }
        }
    }
    let mut counts = HashMap::new();
    count(body, &mut counts);
    counts
}

fn drop_within(body: &mut Vec<Stmt>, counts: &HashMap<Id, usize>) -> bool {
    let unread = |id: &Id| !counts.contains_key(id);
    let mut changed = false;
    let mut kept: Vec<Stmt> = Vec::with_capacity(body.len());
    let mut all = std::mem::take(body).into_iter().peekable();
    while let Some(mut stmt) = all.next() {
        let gone = match &mut stmt {
            Stmt::Let(id, _) | Stmt::Var(id, _) | Stmt::Assign(id, _) => unread(id),
            Stmt::If(_, a, b) => {
                changed |= drop_within(a, counts);
                changed |= drop_within(b, counts);
                is_empty(a) && is_empty(b)
            }
            Stmt::For(_, _, _, inner) => {
                changed |= drop_within(inner, counts);
                is_empty(inner)
            }
            Stmt::Comment(_) | Stmt::Leave(_) | Stmt::Return(_) => false,
        };
        if gone {
            changed = true;
            // Its comment goes with it, unless that is about what follows, too.
            if matches!(all.peek(), None | Some(Stmt::Comment(_))) {
                while matches!(kept.last(), Some(Stmt::Comment(_))) {
                    kept.pop();
                }
            }
        } else {
            kept.push(stmt);
        }
    }
    *body = kept;
    changed
}

fn is_empty(body: &[Stmt]) -> bool {
    body.iter().all(|s| matches!(s, Stmt::Comment(_)))
}

fn size(e: &Expr) -> usize {
    let mut n = 0;
    walk(e, &mut |x| {
        if !matches!(x.kind, Kind::Literal(_) | Kind::Local(_) | Kind::Member(..)) {
            n += 1;
        }
    });
    n
}

/// The locals that a statement and what is in it assign.
fn assigns(stmt: &Stmt, ids: &mut HashSet<Id>) {
    match stmt {
        Stmt::Assign(id, _) | Stmt::Var(id, _) => {
            ids.insert(*id);
        }
        Stmt::If(_, a, b) => a.iter().chain(b).for_each(|s| assigns(s, ids)),
        Stmt::For(id, _, _, inner) => {
            ids.insert(*id);
            inner.iter().for_each(|s| assigns(s, ids));
        }
        Stmt::Comment(_) | Stmt::Let(..) | Stmt::Leave(_) | Stmt::Return(_) => {}
    }
}

/// Puts parts and arguments that are used once where they are used.
fn put_in_place(body: &mut Vec<Stmt>, locals: &[Local]) {
    for stmt in body.iter_mut() {
        match stmt {
            Stmt::If(_, a, b) => {
                put_in_place(a, locals);
                put_in_place(b, locals);
            }
            Stmt::For(_, _, _, inner) => put_in_place(inner, locals),
            _ => {}
        }
    }
    let counts = uses(body);
    // From the end, so that what is put somewhere may be put further with it.
    let mut i = body.len();
    while i > 0 {
        i -= 1;
        let Stmt::Let(id, e) = &body[i] else {
            continue;
        };
        let (id, e) = (*id, e.clone());
        let copies = matches!(e.kind, Kind::Local(_) | Kind::Literal(_));
        let times = counts.get(&id).copied().unwrap_or(0);
        if (locals[id].rank >= Rank::Variable && !copies) || times == 0 || (times > 1 && !copies) {
            continue;
        }
        let mut mentioned = HashSet::new();
        walk(&e, &mut |x| {
            if let Kind::Local(id) = x.kind {
                mentioned.insert(id);
            }
        });
        // The statements that use it, while nothing that it is made of changes.
        let mut found = 0;
        let mut at = Vec::new();
        for (j, later) in body.iter().enumerate().skip(i + 1) {
            let direct = direct_uses(later, id);
            let inside = times_within(later, id) - direct;
            let mut changed = HashSet::new();
            assigns(later, &mut changed);
            let safe = changed.is_disjoint(&mentioned);
            // Into a loop or branch only what is a mere copy.
            if inside > 0 && !(copies && safe) {
                break;
            }
            if direct > 0 || inside > 0 {
                found += direct + inside;
                at.push(j);
            }
            if found == times || !safe {
                break;
            }
        }
        if found != times {
            continue;
        }
        if !copies && at.iter().any(|&j| total(&body[j]) + size(&e) > LONGEST) {
            continue;
        }
        // Members of vectors, matrices and structures are read by name.
        if matches!(e.ty, Type::Vector(..) | Type::Matrix(_) | Type::Struct(_)) && !copies {
            let mut by_member = false;
            for &j in &at {
                let mut with = |x: &Expr| {
                    walk(x, &mut |y| {
                        if let Kind::Member(of, _) = &y.kind {
                            by_member |= matches!(of.kind, Kind::Local(l) if l == id);
                        }
                    });
                };
                expressions(std::slice::from_ref(&body[j]), &mut with);
            }
            if by_member && !matches!(e.kind, Kind::Member(..)) {
                continue;
            }
        }
        for j in at {
            substitute(&mut body[j], id, &e);
        }
        body.remove(i);
        // Its comment is about what follows now, or about nothing.
        if i > 0
            && matches!(body.get(i - 1), Some(Stmt::Comment(_)))
            && matches!(body.get(i), None | Some(Stmt::Comment(_)))
        {
            while i > 0 && matches!(body.get(i - 1), Some(Stmt::Comment(_))) {
                body.remove(i - 1);
                i -= 1;
            }
        }
    }
}

/// What is computed twice under one name is computed once.
fn once(body: &mut Vec<Stmt>, locals: &[Local]) {
    let mut changing = HashSet::new();
    body.iter().for_each(|s| assigns(s, &mut changing));
    let mut i = 0;
    while i < body.len() {
        if let Stmt::Let(id, e) = &body[i] {
            let (id, e) = (*id, e.clone());
            let mut fixed = true;
            walk(&e, &mut |x| {
                fixed &= !matches!(x.kind, Kind::Lookup(..))
                    && !matches!(x.kind, Kind::Local(l) if changing.contains(&l));
            });
            let before = body[..i].iter().find_map(|s| match s {
                Stmt::Let(other, same) if *same == e && locals[*other].name == locals[id].name => {
                    Some(*other)
                }
                _ => None,
            });
            if let (true, Some(other)) = (fixed, before) {
                let copy = fold::local(other, e.ty.clone());
                body[i + 1..]
                    .iter_mut()
                    .for_each(|s| substitute(s, id, &copy));
                body.remove(i);
                continue;
            }
        }
        i += 1;
    }
}

/// A local that changes starts with the value itself, not with a local that is only for that.
fn start_with(body: &mut Vec<Stmt>, locals: &mut [Local]) {
    let counts = uses(body);
    let mut i = 0;
    while i < body.len() {
        if let Stmt::Var(id, e) = &body[i]
            && let Kind::Local(first) = e.kind
            && counts.get(&first) == Some(&1)
            && let Some(at) = body[..i]
                .iter()
                .position(|s| matches!(s, Stmt::Let(l, _) if *l == first))
            && let Stmt::Let(_, value) = &body[at]
        {
            let mut mentioned = HashSet::new();
            walk(value, &mut |x| {
                if let Kind::Local(l) = x.kind {
                    mentioned.insert(l);
                }
            });
            let mut changed = HashSet::new();
            body[at..i].iter().for_each(|s| assigns(s, &mut changed));
            if changed.is_disjoint(&mentioned) {
                let (id, value) = (*id, value.clone());
                locals[id].name = locals[first].name.clone();
                // It stands where the value stood, with its comment.
                body[at] = Stmt::Var(id, value);
                body.remove(i);
                continue;
            }
        }
        i += 1;
    }
}

fn count_in(e: &Expr, id: Id) -> usize {
    let mut n = 0;
    walk(e, &mut |x| {
        if matches!(x.kind, Kind::Local(l) | Kind::Lookup(l, _) if l == id) {
            n += 1;
        }
    });
    n
}

fn direct_uses(stmt: &Stmt, id: Id) -> usize {
    match stmt {
        Stmt::Comment(_) | Stmt::Leave(_) => 0,
        Stmt::Let(_, e) | Stmt::Var(_, e) | Stmt::Assign(_, e) | Stmt::Return(e) => count_in(e, id),
        Stmt::If(c, ..) => count_in(c, id),
        Stmt::For(_, from, to, _) => count_in(from, id) + count_in(to, id),
    }
}

fn times_within(stmt: &Stmt, id: Id) -> usize {
    let mut n = 0;
    expressions(std::slice::from_ref(stmt), &mut |e| n += count_in(e, id));
    n
}

fn total(stmt: &Stmt) -> usize {
    match stmt {
        Stmt::Let(_, e) | Stmt::Var(_, e) | Stmt::Assign(_, e) | Stmt::If(e, ..) => size(e),
        Stmt::Return(e) => match &e.kind {
            // Each component has a line's length for itself.
            Kind::Construct(all) => all.iter().map(size).max().unwrap_or(0),
            _ => size(e),
        },
        Stmt::For(_, from, to, _) => size(from) + size(to),
        Stmt::Comment(_) | Stmt::Leave(_) => 0,
    }
}

fn substitute(stmt: &mut Stmt, id: Id, by: &Expr) {
    let with = |e: &Expr| match e.kind {
        Kind::Local(l) if l == id => Some(by.clone()),
        _ => None,
    };
    match stmt {
        Stmt::Comment(_) | Stmt::Leave(_) => {}
        Stmt::Let(_, e) | Stmt::Var(_, e) | Stmt::Assign(_, e) | Stmt::Return(e) => {
            *e = replace(e, &with);
        }
        Stmt::If(c, a, b) => {
            *c = replace(c, &with);
            a.iter_mut().chain(b).for_each(|s| substitute(s, id, by));
        }
        Stmt::For(_, from, to, inner) => {
            *from = replace(from, &with);
            *to = replace(to, &with);
            inner.iter_mut().for_each(|s| substitute(s, id, by));
        }
    }
}

/// Comments at the end of a block say nothing.
fn drop_comments(body: &mut Vec<Stmt>) {
    while matches!(body.last(), Some(Stmt::Comment(_))) {
        body.pop();
    }
    for stmt in body {
        match stmt {
            Stmt::If(_, a, b) => {
                drop_comments(a);
                drop_comments(b);
            }
            Stmt::For(_, _, _, inner) => drop_comments(inner),
            _ => {}
        }
    }
}

/// A structure is made in a statement of its own: not every language has an expression for it.
fn structures_alone(body: &mut Vec<Stmt>, locals: &mut Vec<Local>) {
    let mut out = Vec::with_capacity(body.len());
    for mut stmt in std::mem::take(body) {
        let mut before = Vec::new();
        match &mut stmt {
            Stmt::Let(_, e) | Stmt::Return(e) => {
                let parts = match &e.kind {
                    Kind::Construct(parts) if matches!(e.ty, Type::Struct(_)) => Some(parts),
                    _ => None,
                };
                *e = match parts {
                    Some(parts) => {
                        let parts = parts
                            .iter()
                            .map(|p| alone(p, &mut before, locals))
                            .collect();
                        fold::node(e.ty.clone(), Kind::Construct(parts))
                    }
                    None => alone(e, &mut before, locals),
                };
            }
            Stmt::Var(_, e) | Stmt::Assign(_, e) => *e = alone(e, &mut before, locals),
            Stmt::If(_, a, b) => {
                structures_alone(a, locals);
                structures_alone(b, locals);
            }
            Stmt::For(_, _, _, inner) => structures_alone(inner, locals),
            Stmt::Comment(_) | Stmt::Leave(_) => {}
        }
        out.extend(before);
        out.push(stmt);
    }
    *body = out;
}

fn alone(e: &Expr, before: &mut Vec<Stmt>, locals: &mut Vec<Local>) -> Expr {
    let mut all =
        |v: &[Expr]| -> Vec<Expr> { v.iter().map(|x| alone(x, before, locals)).collect() };
    let kind = match &e.kind {
        Kind::Literal(_) | Kind::Local(_) => return e.clone(),
        Kind::Member(x, name) => Kind::Member(alone(x, before, locals), name.clone()),
        Kind::Unary(op, x) => Kind::Unary(*op, alone(x, before, locals)),
        Kind::Binary(op, a, b) => {
            Kind::Binary(*op, alone(a, before, locals), alone(b, before, locals))
        }
        Kind::Builtin(b, v) => Kind::Builtin(*b, all(v)),
        Kind::Call(name, v) => Kind::Call(name.clone(), all(v)),
        Kind::Lookup(id, v) => Kind::Lookup(*id, all(v)),
        Kind::Construct(v) => Kind::Construct(all(v)),
    };
    let e = fold::node(e.ty.clone(), kind);
    if let (Kind::Construct(_), Type::Struct(name)) = (&e.kind, &e.ty) {
        locals.push(Local {
            name: name.to_lowercase(),
            ty: e.ty.clone(),
            rank: Rank::Part,
        });
        let id = locals.len() - 1;
        before.push(Stmt::Let(id, e.clone()));
        return fold::local(id, e.ty.clone());
    }
    e
}

/// Forgets locals that no statement mentions.
fn compact(function: &mut Function, params: &HashSet<Id>) {
    fn declared(body: &[Stmt], ids: &mut HashSet<Id>) {
        for stmt in body {
            match stmt {
                Stmt::Let(id, _) | Stmt::Var(id, _) => {
                    ids.insert(*id);
                }
                Stmt::If(_, a, b) => {
                    declared(a, ids);
                    declared(b, ids);
                }
                Stmt::For(id, _, _, inner) => {
                    ids.insert(*id);
                    declared(inner, ids);
                }
                _ => {}
            }
        }
    }
    let mut ids = params.clone();
    declared(&function.body, &mut ids);
    for (id, local) in function.locals.iter_mut().enumerate() {
        if !ids.contains(&id) {
            local.name.clear();
        }
    }
}
