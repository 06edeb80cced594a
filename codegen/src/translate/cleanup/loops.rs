//! Loops end with a `break` in their body instead of a condition at their end.

use std::collections::HashSet;

use naga::{Arena, Block, Expression, Handle, LocalVariable, Module, Span, Statement};

use super::locals::forward_stores;
use super::walk::{each_statement, functions, functions_mut, local};

/// Loops without a `continuing` block or condition at the end.
///
/// This is not for looks alone: naga's HLSL, MSL and GLSL writers put that block before the body
/// and write its condition out again there, from variables that have the next turn's values by
/// then. What remains of such loops, [`has_late_loops`] tells.
pub fn plain_loops(module: &mut Module) {
    functions_mut(module).for_each(|function| {
        let mut body = std::mem::take(&mut function.body);
        plain_loops_in(&mut body, &function.expressions);
        forward_stores(&mut body, &function.expressions);
        function.body = body;
    });
}

/// Whether a loop has a `continuing` block or a condition at its end.
pub fn has_late_loops(module: &Module) -> bool {
    let mut late = false;
    functions(module).for_each(|function| {
        each_statement(&function.body, &mut |statement| {
            if let Statement::Loop {
                continuing,
                break_if,
                ..
            } = statement
            {
                late |= !continuing.is_empty() || break_if.is_some();
            }
        });
    });
    late
}

fn plain_loops_in(block: &mut Block, expressions: &Arena<Expression>) {
    for statement in block.iter_mut() {
        match statement {
            Statement::Block(inner) => plain_loops_in(inner, expressions),
            Statement::If { accept, reject, .. } => {
                plain_loops_in(accept, expressions);
                plain_loops_in(reject, expressions);
            }
            Statement::Switch { cases, .. } => {
                cases
                    .iter_mut()
                    .for_each(|case| plain_loops_in(&mut case.body, expressions));
            }
            Statement::Loop {
                body,
                continuing,
                break_if,
            } => {
                plain_loops_in(body, expressions);
                plain_loops_in(continuing, expressions);
                if let Some(Statement::Continue) = body.last() {
                    let last = body.len() - 1;
                    body.cull(last..);
                }
                let ways = continues(body);
                if ways == Ways::FromSwitch && break_if.is_some() {
                    // A `break` there would leave the `switch` alone.
                    continue;
                }
                let end = std::mem::take(continuing);
                match (break_if.take(), ways) {
                    (None, Ways::None) => append(body, end),
                    (Some(condition), Ways::None) => end_loop(body, end, condition, expressions),
                    (condition, _) => end_each_way(body, end, condition),
                }
            }
            _ => {}
        }
    }
}

/// How a block goes on to the next turn of the loop around it before its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Ways {
    /// It does not.
    None,
    /// From outside of any `switch`.
    Plain,
    /// Also from within a `switch`.
    FromSwitch,
}

fn continues(block: &Block) -> Ways {
    let ways = block.iter().map(|statement| match statement {
        Statement::Continue => Ways::Plain,
        Statement::Block(inner) => continues(inner),
        Statement::If { accept, reject, .. } => continues(accept).max(continues(reject)),
        Statement::Switch { cases, .. } => {
            let within = cases.iter().map(|case| continues(&case.body)).max();
            match within {
                None | Some(Ways::None) => Ways::None,
                Some(_) => Ways::FromSwitch,
            }
        }
        _ => Ways::None,
    });
    ways.max().unwrap_or(Ways::None)
}

/// Puts what happens at a loop's end before each `continue` and at the end of the body.
fn end_each_way(body: &mut Block, mut end: Block, condition: Option<Handle<Expression>>) {
    if let Some(condition) = condition {
        leave_if(&mut end, condition);
    }
    before_each_continue(body, &end);
    append(body, end);
}

fn before_each_continue(block: &mut Block, end: &Block) {
    let old = std::mem::take(block);
    for (mut statement, span) in old.span_into_iter() {
        match &mut statement {
            Statement::Continue => append(block, end.clone()),
            Statement::Block(inner) => before_each_continue(inner, end),
            Statement::If { accept, reject, .. } => {
                before_each_continue(accept, end);
                before_each_continue(reject, end);
            }
            Statement::Switch { cases, .. } => {
                for case in cases {
                    before_each_continue(&mut case.body, end);
                }
            }
            _ => {}
        }
        block.push(statement, span);
    }
}

/// `if condition { break }`.
fn leave_if(block: &mut Block, condition: Handle<Expression>) {
    let mut leave = Block::new();
    leave.push(Statement::Break, Span::UNDEFINED);
    let statement = Statement::If {
        condition,
        accept: leave,
        reject: Block::new(),
    };
    block.push(statement, Span::UNDEFINED);
}

fn append(block: &mut Block, more: Block) {
    for (statement, span) in more.span_into_iter() {
        block.push(statement, span);
    }
}

/// Puts what happens at a loop's end into its body: `if condition { break }`.
///
/// rust-gpu's loops test the same condition twice: once around what they do, once at their end.
/// Where nothing that happens in between can be seen after the loop, once is enough.
fn end_loop(
    body: &mut Block,
    end: Block,
    condition: Handle<Expression>,
    expressions: &Arena<Expression>,
) {
    let negated = match expressions[condition] {
        Expression::Unary {
            op: naga::UnaryOperator::LogicalNot,
            expr,
        } => Some(expr),
        _ => None,
    };
    let place = body
        .iter()
        .rposition(|statement| matches!(statement, Statement::If { .. }));
    if let Some(place) = place {
        let Statement::If {
            condition: tested,
            accept,
            reject,
        } = &body[place]
        else {
            return;
        };
        let stays = if negated == Some(*tested) {
            Some((true, reject))
        } else if condition == *tested {
            Some((false, accept))
        } else {
            None
        };
        if let Some((stays_if, leaving)) = stays {
            let after = Block::from_vec(body[place + 1..].to_vec());
            let mut stored = HashSet::new();
            let simple = [leaving, &after, &end]
                .iter()
                .all(|part| only_stores(part, expressions, &mut stored));
            if simple && !loaded_outside(&stored, body, &end, expressions) {
                let tested = *tested;
                let mut staying = if stays_if {
                    accept.clone()
                } else {
                    reject.clone()
                };
                append(&mut staying, after);
                append(&mut staying, end);
                let mut leave = Block::new();
                leave.push(Statement::Break, Span::UNDEFINED);
                let (accept, reject) = if stays_if {
                    (staying, leave)
                } else {
                    (leave, staying)
                };
                body.cull(place..);
                body.push(
                    Statement::If {
                        condition: tested,
                        accept,
                        reject,
                    },
                    Span::UNDEFINED,
                );
                return;
            }
        }
    }
    append(body, end);
    leave_if(body, condition);
}

/// Whether a block does nothing but compute and store to local variables, which are collected.
fn only_stores(
    block: &Block,
    expressions: &Arena<Expression>,
    stored: &mut HashSet<Handle<LocalVariable>>,
) -> bool {
    block.iter().all(|statement| match statement {
        Statement::Emit(_) => true,
        Statement::Store { pointer, .. } => match local(expressions, *pointer) {
            Some(local) => {
                stored.insert(local);
                true
            }
            None => false,
        },
        _ => false,
    })
}

/// Whether any of the variables is used by an expression that a loop does not itself emit.
fn loaded_outside(
    variables: &HashSet<Handle<LocalVariable>>,
    body: &Block,
    end: &Block,
    expressions: &Arena<Expression>,
) -> bool {
    let mut inside = HashSet::new();
    for block in [body, end] {
        each_statement(block, &mut |statement| {
            if let Statement::Emit(range) = statement {
                inside.extend(range.clone());
            }
        });
    }
    expressions.iter().any(|(handle, expression)| {
        let pointer = match *expression {
            Expression::Load { pointer } => pointer,
            Expression::Access { base, .. } | Expression::AccessIndex { base, .. } => base,
            _ => return false,
        };
        local(expressions, pointer).is_some_and(|local| variables.contains(&local))
            && !inside.contains(&handle)
    })
}
