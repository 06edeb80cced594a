//! Local variables that are only written go, and stores take the value that was stored before.

use std::collections::{HashMap, HashSet};

use naga::{Arena, Block, Expression, Handle, LocalVariable, Module, Span, Statement};

use super::walk::{each_statement, functions_mut, local};

/// Stores what was stored to another variable before, not what is loaded from that.
pub fn forward_stores(block: &mut Block, expressions: &Arena<Expression>) {
    let mut stored: HashMap<Handle<LocalVariable>, Handle<Expression>> = HashMap::new();
    let mut loaded: HashMap<Handle<Expression>, Handle<Expression>> = HashMap::new();
    for statement in block.iter_mut() {
        match statement {
            Statement::Emit(range) => {
                for handle in range.clone() {
                    if let Expression::Load { pointer } = expressions[handle] {
                        let value =
                            local(expressions, pointer).and_then(|local| stored.get(&local));
                        loaded.extend(value.map(|value| (handle, *value)));
                    }
                }
            }
            Statement::Store { pointer, value } => {
                if let Some(original) = loaded.get(value) {
                    *value = *original;
                }
                match local(expressions, *pointer) {
                    Some(local) => {
                        stored.insert(local, *value);
                    }
                    None => stored.clear(),
                }
            }
            other => {
                // It may store.
                stored.clear();
                match other {
                    Statement::Block(inner) => forward_stores(inner, expressions),
                    Statement::If { accept, reject, .. } => {
                        forward_stores(accept, expressions);
                        forward_stores(reject, expressions);
                    }
                    Statement::Switch { cases, .. } => {
                        cases
                            .iter_mut()
                            .for_each(|case| forward_stores(&mut case.body, expressions));
                    }
                    Statement::Loop {
                        body, continuing, ..
                    } => {
                        forward_stores(body, expressions);
                        forward_stores(continuing, expressions);
                    }
                    _ => {}
                }
            }
        }
    }
}

/// Drops stores to local variables that nothing reads. The module must be compact: the variables
/// themselves go with [`drop_unused_locals`] after it is compacted again.
pub fn drop_dead_locals(module: &mut Module) {
    functions_mut(module).for_each(|function| {
        let expressions = &function.expressions;
        let mut read = HashSet::new();
        for (_, expression) in expressions.iter() {
            match *expression {
                Expression::Load { pointer: base }
                | Expression::Access { base, .. }
                | Expression::AccessIndex { base, .. } => read.extend(local(expressions, base)),
                _ => {}
            }
        }
        each_statement(&function.body, &mut |statement| match statement {
            Statement::Call { arguments, .. } => {
                read.extend(
                    arguments
                        .iter()
                        .filter_map(|argument| local(expressions, *argument)),
                );
            }
            Statement::Emit(_) | Statement::Store { .. } => {}
            Statement::Atomic { pointer, .. } | Statement::WorkGroupUniformLoad { pointer, .. } => {
                read.extend(local(expressions, *pointer));
            }
            _ => {}
        });
        let mut body = std::mem::take(&mut function.body);
        drop_stores(&mut body, &|pointer| {
            local(expressions, pointer).is_some_and(|local| !read.contains(&local))
        });
        function.body = body;
    });
}

/// Drops stores of which that holds.
pub fn drop_stores(block: &mut Block, is_dead: &impl Fn(Handle<Expression>) -> bool) {
    let old = std::mem::take(block);
    for (mut statement, span) in old.span_into_iter() {
        match &mut statement {
            Statement::Store { pointer, .. } if is_dead(*pointer) => continue,
            Statement::Block(inner) => drop_stores(inner, is_dead),
            Statement::If { accept, reject, .. } => {
                drop_stores(accept, is_dead);
                drop_stores(reject, is_dead);
            }
            Statement::Switch { cases, .. } => {
                cases
                    .iter_mut()
                    .for_each(|case| drop_stores(&mut case.body, is_dead));
            }
            Statement::Loop {
                body, continuing, ..
            } => {
                drop_stores(body, is_dead);
                drop_stores(continuing, is_dead);
            }
            _ => {}
        }
        block.push(statement, span);
    }
}

/// Drops local variables that no expression names. The module must be compact.
pub fn drop_unused_locals(module: &mut Module) {
    functions_mut(module).for_each(|function| {
        let used: HashSet<_> = function
            .expressions
            .iter()
            .filter_map(|(handle, _)| local(&function.expressions, handle))
            .collect();
        let mut kept = Arena::new();
        let mut moved = HashMap::new();
        for (handle, variable) in function.local_variables.iter() {
            if used.contains(&handle) {
                moved.insert(handle, kept.append(variable.clone(), Span::UNDEFINED));
            }
        }
        for (_, expression) in function.expressions.iter_mut() {
            if let Expression::LocalVariable(local) = expression {
                *local = moved[local];
            }
        }
        function.local_variables = kept;
    });
}
