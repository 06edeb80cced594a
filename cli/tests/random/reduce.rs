//! Smaller programs: every way to make one simpler by one step. A step keeps the program typed, with an
//! end, and every variable declared before it is used.

use super::program::{Expr, Program, Stmt, blocks_mut, expressions_mut};

/// All programs that are one step simpler, the largest steps first.
pub fn steps(program: &Program) -> Vec<Program> {
    let mut all = Vec::new();
    let mut with = |change: &dyn Fn(&mut Program) -> bool| {
        let mut simpler = program.clone();
        if change(&mut simpler) && simpler != *program {
            all.push(simpler);
        }
    };
    for n in 0..program.functions.len() {
        // Whoever calls it gets a constant; its number stays taken.
        with(&|it| {
            each_expression(it, &mut |e| {
                if matches!(e, Expr::Call(_, f, _) if *f as usize == n) {
                    *e = Expr::Literal(e.ty(), 2);
                }
            });
            it.functions[n].body.clear();
            it.functions[n].result = Expr::Literal(it.functions[n].result.ty(), 2);
            true
        });
    }
    let statements = count_statements(program);
    // A run of statements, then fewer.
    let mut run = statements / 2;
    while run > 0 {
        for first in (0..statements).step_by(run) {
            with(&|it| {
                let mut number = 0;
                each_block(it, &mut |block| {
                    drop_run(block, &mut number, first, first + run)
                });
                drop_undeclared(it);
                true
            });
        }
        run /= 2;
    }
    for n in 0..statements {
        with(&|it| {
            let mut number = 0;
            let mut unwrapped = false;
            each_block(it, &mut |block| {
                unwrap(block, &mut number, n, &mut unwrapped)
            });
            drop_undeclared(it);
            unwrapped
        });
    }
    let mut expressions = 0;
    each_expression(&mut program.clone(), &mut |_| expressions += 1);
    for n in 0..expressions {
        let ways = 1 + 4;
        for way in 0..ways {
            with(&|it| {
                let mut number = 0;
                let mut changed = false;
                each_expression(it, &mut |e| {
                    if number == n {
                        changed = simplify(e, way);
                    }
                    number += 1;
                });
                changed
            });
        }
    }
    all.retain(|it| it.size() < program.size());
    all.sort_by_key(Program::size);
    all.dedup();
    all
}

/// A constant in place of an expression, or a part of it that has its type.
fn simplify(e: &mut Expr, way: usize) -> bool {
    let simpler = match way {
        0 if matches!(e, Expr::Literal(..)) => None,
        0 => Some(Expr::Literal(e.ty(), 2)),
        n => e
            .parts()
            .get(n - 1)
            .filter(|part| part.ty() == e.ty())
            .cloned(),
    };
    let found = simpler.is_some();
    if let Some(simpler) = simpler {
        *e = simpler;
    }
    found
}

/// The outermost blocks.
fn each_block(program: &mut Program, f: &mut dyn FnMut(&mut Vec<Stmt>)) {
    for function in &mut program.functions {
        f(&mut function.body);
    }
    f(&mut program.body);
}

fn count_statements(program: &Program) -> usize {
    fn count(block: &mut Vec<Stmt>, n: &mut usize) {
        for statement in block {
            *n += 1;
            for inner in blocks_mut(statement) {
                count(inner, n);
            }
        }
    }
    let mut n = 0;
    each_block(&mut program.clone(), &mut |block| count(block, &mut n));
    n
}

/// Drops the statements with numbers from `first` to `end`.
fn drop_run(block: &mut Vec<Stmt>, number: &mut usize, first: usize, end: usize) {
    let mut kept = Vec::new();
    for mut statement in block.drain(..) {
        let own = *number;
        *number += 1;
        for inner in blocks_mut(&mut statement) {
            drop_run(inner, number, first, end);
        }
        if !(first..end).contains(&own) {
            kept.push(statement);
        }
    }
    *block = kept;
}

/// Puts the first block of a statement in its place.
fn unwrap(block: &mut Vec<Stmt>, number: &mut usize, wanted: usize, unwrapped: &mut bool) {
    let mut kept = Vec::new();
    for mut statement in block.drain(..) {
        let own = *number;
        *number += 1;
        for inner in blocks_mut(&mut statement) {
            unwrap(inner, number, wanted, unwrapped);
        }
        match statement {
            // What ends a round stays in its loop.
            Stmt::If(_, inner, _) if own == wanted => {
                *unwrapped = true;
                kept.extend(inner);
            }
            Stmt::Match(_, _, arms) if own == wanted => {
                *unwrapped = true;
                kept.extend(arms.into_iter().flatten());
            }
            Stmt::Loop(.., inner) if own == wanted => {
                *unwrapped = true;
                kept.extend(inner.into_iter().filter(|it| {
                    !matches!(it, Stmt::BreakIf(_) | Stmt::ContinueIf(_)) && !leaves(it)
                }));
            }
            other => kept.push(other),
        }
    }
    *block = kept;
}

/// Whether a statement ends a round of a loop around it.
fn leaves(statement: &Stmt) -> bool {
    let within = |block: &Vec<Stmt>| {
        block
            .iter()
            .any(|it| matches!(it, Stmt::BreakIf(_) | Stmt::ContinueIf(_)) || leaves(it))
    };
    match statement {
        Stmt::If(_, a, b) => within(a) || within(b),
        Stmt::Match(_, _, arms) => arms.iter().any(within),
        _ => false,
    }
}

/// Constants for variables that nobody declares any more, and no statement about them.
fn drop_undeclared(program: &mut Program) {
    for function in &mut program.functions {
        let mut known: Vec<u32> = function.parameters.iter().map(|p| p.1).collect();
        settle(&mut function.body, &mut known);
        settle_expression(&mut function.result, &known);
    }
    let mut known = Vec::new();
    settle(&mut program.body, &mut known);
    for result in &mut program.result {
        settle_expression(result, &known);
    }
}

fn settle_expression(e: &mut Expr, known: &[u32]) {
    for part in e.parts_mut() {
        settle_expression(part, known);
    }
    if let Expr::Variable(ty, id) | Expr::Element(ty, id, _) = e
        && !known.contains(id)
    {
        *e = Expr::Literal(*ty, 2);
    }
}

fn settle(block: &mut Vec<Stmt>, known: &mut Vec<u32>) {
    block.retain_mut(|statement| {
        for e in expressions_mut(statement) {
            settle_expression(e, known);
        }
        match statement {
            Stmt::Assign(id, _) | Stmt::SetElement(id, ..) if !known.contains(id) => return false,
            Stmt::AssignBoth(both, _) if both.iter().any(|id| !known.contains(id)) => return false,
            _ => {}
        }
        let before = known.len();
        if let Stmt::Loop(_, id, ..) = statement {
            known.push(*id);
        }
        for inner in blocks_mut(statement) {
            let outside = known.len();
            settle(inner, known);
            known.truncate(outside);
        }
        known.truncate(before);
        if let Stmt::Let(id, _)
        | Stmt::Array(id, _)
        | Stmt::Match(id, ..)
        | Stmt::Store(id, _)
        | Stmt::Exchange(id, ..) = statement
        {
            known.push(*id);
        }
        true
    });
}

/// Every expression and every part of one.
fn each_expression(program: &mut Program, f: &mut dyn FnMut(&mut Expr)) {
    fn down(e: &mut Expr, f: &mut dyn FnMut(&mut Expr)) {
        f(e);
        for part in e.parts_mut() {
            down(part, f);
        }
    }
    fn block(all: &mut Vec<Stmt>, f: &mut dyn FnMut(&mut Expr)) {
        for statement in all {
            for e in expressions_mut(statement) {
                down(e, f);
            }
            for inner in blocks_mut(statement) {
                block(inner, f);
            }
        }
    }
    each_block(program, &mut |it| block(it, f));
    for function in &mut program.functions {
        down(&mut function.result, f);
    }
    for result in &mut program.result {
        down(result, f);
    }
}

/// Whether each variable is declared before it is used, in whatever block.
pub fn is_closed(program: &Program) -> bool {
    let mut settled = program.clone();
    drop_undeclared(&mut settled);
    settled == *program
}
