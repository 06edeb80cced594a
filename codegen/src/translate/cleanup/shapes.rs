//! Small shapes that nobody writes: `v[0]` for `v.x`, a `return` at the end, an `if` that does nothing.

use std::collections::HashMap;

use naga::{Arena, Block, Expression, Handle, Module, Range, Span, Statement, UnaryOperator};

use super::walk::functions_mut;

/// Indices that are constants become members: `v.x`, not `v[0u]`.
pub fn constant_indices(module: &mut Module) {
    let constants: HashMap<Handle<naga::Constant>, u32> = module
        .constants
        .iter()
        .filter_map(|(handle, constant)| {
            Some((handle, small(&module.global_expressions[constant.init])?))
        })
        .collect();
    functions_mut(module).for_each(|function| {
        let handles: Vec<_> = function
            .expressions
            .iter()
            .map(|(handle, _)| handle)
            .collect();
        for handle in handles {
            if let Expression::Access { base, index } = function.expressions[handle] {
                let index = match &function.expressions[index] {
                    Expression::Constant(constant) => constants.get(constant).copied(),
                    other => small(other),
                };
                if let Some(index) = index {
                    function.expressions[handle] = Expression::AccessIndex { base, index };
                }
            }
        }
    });
}

fn small(expression: &Expression) -> Option<u32> {
    match *expression {
        Expression::Literal(naga::Literal::U32(value)) => Some(value),
        Expression::Literal(naga::Literal::I32(value)) => u32::try_from(value).ok(),
        _ => None,
    }
}

/// `if c {} else { … }` becomes `if !c { … }`.
pub fn turn_empty_ifs(module: &mut Module) {
    functions_mut(module).for_each(|function| {
        let mut body = std::mem::take(&mut function.body);
        turn_in(&mut body, &mut function.expressions);
        function.body = body;
    });
}

fn turn_in(block: &mut Block, expressions: &mut Arena<Expression>) {
    for (mut statement, span) in std::mem::take(block).span_into_iter() {
        match &mut statement {
            Statement::Block(inner) => turn_in(inner, expressions),
            Statement::Switch { cases, .. } => {
                for case in cases {
                    turn_in(&mut case.body, expressions);
                }
            }
            Statement::Loop {
                body, continuing, ..
            } => {
                turn_in(body, expressions);
                turn_in(continuing, expressions);
            }
            Statement::If {
                condition,
                accept,
                reject,
            } => {
                turn_in(accept, expressions);
                turn_in(reject, expressions);
                if accept.is_empty() && !reject.is_empty() {
                    std::mem::swap(accept, reject);
                    if let Expression::Unary {
                        op: UnaryOperator::LogicalNot,
                        expr,
                    } = expressions[*condition]
                    {
                        *condition = expr;
                    } else {
                        let contrary = Expression::Unary {
                            op: UnaryOperator::LogicalNot,
                            expr: *condition,
                        };
                        *condition = expressions.append(contrary, Span::UNDEFINED);
                        let emitted = Range::new_from_bounds(*condition, *condition);
                        block.push(Statement::Emit(emitted), Span::UNDEFINED);
                    }
                }
            }
            _ => {}
        }
        block.push(statement, span);
    }
}

/// Drops `return` where the function ends anyway.
pub fn drop_last_return(module: &mut Module) {
    functions_mut(module).for_each(|function| drop_return(&mut function.body));
}

pub fn drop_return(body: &mut Block) {
    if let Some(Statement::Return { value: None }) = body.last() {
        let last = body.len() - 1;
        body.cull(last..);
    }
}
