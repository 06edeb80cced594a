//! Ways through naga's trees that every step of the clean-up takes.

use naga::{Arena, Block, Expression, Handle, LocalVariable, Module, Range, Statement, Type};

/// Visits every statement of a block, and of the blocks within it.
pub(crate) fn each_statement(block: &Block, visit: &mut impl FnMut(&Statement)) {
    for statement in block {
        each_within(statement, visit);
    }
}

/// Visits a statement, and those within it.
pub(crate) fn each_within(statement: &Statement, visit: &mut impl FnMut(&Statement)) {
    visit(statement);
    match statement {
        Statement::Block(inner) => each_statement(inner, visit),
        Statement::If { accept, reject, .. } => {
            each_statement(accept, visit);
            each_statement(reject, visit);
        }
        Statement::Switch { cases, .. } => {
            cases
                .iter()
                .for_each(|case| each_statement(&case.body, visit));
        }
        Statement::Loop {
            body, continuing, ..
        } => {
            each_statement(body, visit);
            each_statement(continuing, visit);
        }
        _ => {}
    }
}

/// Puts one type into another's place. naga has each type once, and its own `replace` panics where the module has the
/// new one already: that gets another name here.
pub fn replace_type(module: &mut Module, old: Handle<Type>, mut new: Type) {
    if module.types[old] == new {
        return;
    }
    while module.types.get(&new).is_some() {
        new.name.get_or_insert_default().push('_');
    }
    module.types.replace(old, new);
}

/// Expressions that stand for a declaration are not emitted: takes those out of the ranges that
/// were emitted when they were something else.
pub fn mend_emits(block: &mut Block, expressions: &Arena<Expression>) {
    let old = std::mem::take(block);
    for (mut statement, span) in old.span_into_iter() {
        match &mut statement {
            Statement::Emit(range) => {
                let mut run: Option<(Handle<Expression>, Handle<Expression>)> = None;
                let mut runs = Vec::new();
                for handle in range.clone() {
                    if expressions[handle].needs_pre_emit() {
                        runs.extend(run.take());
                    } else {
                        run = Some((run.map_or(handle, |(first, _)| first), handle));
                    }
                }
                runs.extend(run);
                for (first, last) in runs {
                    block.push(Statement::Emit(Range::new_from_bounds(first, last)), span);
                }
                continue;
            }
            Statement::Block(inner) => mend_emits(inner, expressions),
            Statement::If { accept, reject, .. } => {
                mend_emits(accept, expressions);
                mend_emits(reject, expressions);
            }
            Statement::Switch { cases, .. } => {
                cases
                    .iter_mut()
                    .for_each(|case| mend_emits(&mut case.body, expressions));
            }
            Statement::Loop {
                body, continuing, ..
            } => {
                mend_emits(body, expressions);
                mend_emits(continuing, expressions);
            }
            _ => {}
        }
        block.push(statement, span);
    }
}

pub fn functions(module: &Module) -> impl Iterator<Item = &naga::Function> {
    let inner = module.functions.iter().map(|(_, function)| function);
    inner.chain(module.entry_points.iter().map(|entry| &entry.function))
}

pub fn functions_mut(module: &mut Module) -> impl Iterator<Item = &mut naga::Function> {
    let inner = module.functions.iter_mut().map(|(_, function)| function);
    inner.chain(
        module
            .entry_points
            .iter_mut()
            .map(|entry| &mut entry.function),
    )
}

/// The local variable that an expression points to, if it is one as a whole.
pub fn local(
    expressions: &Arena<Expression>,
    pointer: Handle<Expression>,
) -> Option<Handle<LocalVariable>> {
    match expressions[pointer] {
        Expression::LocalVariable(local) => Some(local),
        _ => None,
    }
}

/// Every function with the types of its expressions.
pub fn with_types<'a>(
    called: &'a mut Arena<naga::Function>,
    entries: &'a mut [naga::EntryPoint],
    info: &'a naga::valid::ModuleInfo,
) -> impl Iterator<Item = (&'a naga::valid::FunctionInfo, &'a mut naga::Function)> {
    let called = called
        .iter_mut()
        .map(|(handle, function)| (&info[handle], function));
    let entries = entries
        .iter_mut()
        .enumerate()
        .map(|(index, entry)| (info.get_entry_point(index), &mut entry.function));
    called.chain(entries)
}
