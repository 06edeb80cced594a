//! Depths that are read as they are. naga 30.0.1 makes a vector of each, also of four that are gathered, which its validator
//! refuses (`tests/upstream/naga-depth-gather`).

use naga::{Expression, Handle, Module, VectorSize};

use super::walk::functions_mut;

/// Takes gathered depths themselves, and a single depth where one component of its vector is all that is asked for.
pub fn restore_depths(module: &mut Module) {
    functions_mut(module).for_each(|function| {
        let expressions = &function.expressions;
        let restored: Vec<(Handle<Expression>, Expression)> = expressions
            .iter()
            .filter_map(|(handle, expression)| {
                let (splat, is_part) = match *expression {
                    // The three follow each other: nothing lies between them, not even a branch.
                    Expression::AccessIndex { base, .. } if base.index() + 1 == handle.index() => {
                        (base, true)
                    }
                    _ => (handle, false),
                };
                let Expression::Splat {
                    size: VectorSize::Quad,
                    value,
                } = expressions[splat]
                else {
                    return None;
                };
                let read = &expressions[value];
                let is_gather = matches!(
                    read,
                    Expression::ImageSample {
                        gather: Some(_),
                        ..
                    }
                );
                let is_depth = matches!(
                    read,
                    Expression::ImageSample { gather: None, .. } | Expression::ImageLoad { .. }
                );
                let is_next = value.index() + 1 == splat.index();
                let uses = expressions
                    .iter()
                    .filter(|(_, it)| matches!(it, Expression::AccessIndex { base, .. } if *base == splat))
                    .count();
                let takes = (is_gather && !is_part) || (is_depth && is_part && is_next && uses == 1);
                takes.then(|| (handle, read.clone()))
            })
            .collect();
        for (handle, read) in restored {
            function.expressions[handle] = read;
        }
    });
}
