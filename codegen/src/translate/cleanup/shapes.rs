//! Small shapes that nobody writes: `v[0]` for `v.x`, a `return` at the end.

use std::collections::HashMap;

use naga::{Block, Expression, Handle, Module, Statement};

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
