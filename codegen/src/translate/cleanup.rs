//! Makes naga's module read as a person would have written it.
//!
//! naga's SPIR-V reader keeps SPIR-V's shape: inputs are copied to private globals, an inner
//! function computes on those, and its outputs are copied back; every buffer is a structure around
//! its contents. Here
//!
//! - [`fold_entry_point`] puts the inner function into the entry point: inputs are its arguments,
//!   outputs its return value;
//! - [`unwrap_blocks`] takes the structure off buffers: `input[i]`, not `input.elements[i]`;
//! - [`plain_loops`] ends loops with `break` in their body instead of a condition at their end;
//! - [`constant_indices`] makes `v[0]` with a constant index `v.x`;
//! - [`drop_dead_locals`] drops variables that are only written;
//! - [`drop_last_return`] drops the `return` at the end;
//! - [`name_loads`] names what is loaded after the member or structure that it comes from;
//! - [`name_roundings`] names every result of arithmetic, where that must be computed as written.
//!
//! Each declines where it does not apply, and the validator has the last word: it runs after them,
//! and where it rejects the result, the module stays as naga read it.

use std::collections::{HashMap, HashSet};

use naga::{
    AddressSpace, Arena, Block, Expression, FunctionResult, GlobalVariable, Handle, ImageQuery,
    LocalVariable, MathFunction, Module, Range, Span, Statement, Type, TypeInner,
};

/// Puts the inner function of the only entry point into it. Says whether it did.
pub fn fold_entry_point(module: &mut Module) -> bool {
    fold(module).is_some()
}

/// What naga's wrapper around a function does.
struct Wrapper {
    inner: Handle<naga::Function>,
    /// Private global to argument.
    inputs: HashMap<Handle<GlobalVariable>, u32>,
    /// Private globals that are returned, in order.
    outputs: Vec<Handle<GlobalVariable>>,
    /// Type of the structure that they are put into, if there are several.
    composed: Option<Handle<Type>>,
}

fn read_wrapper(module: &Module) -> Option<Wrapper> {
    let [entry] = module.entry_points.as_slice() else {
        return None;
    };
    let function = &entry.function;
    let global = |handle: Handle<Expression>| match function.expressions[handle] {
        Expression::GlobalVariable(global) => Some(global),
        _ => None,
    };
    let mut inner = None;
    let mut inputs = HashMap::new();
    let mut outputs = Vec::new();
    let mut composed = None;
    for statement in &function.body {
        match *statement {
            Statement::Emit(_) => {}
            Statement::Store { pointer, value } if inner.is_none() => {
                let Expression::FunctionArgument(argument) = function.expressions[value] else {
                    return None;
                };
                inputs.insert(global(pointer)?, argument);
            }
            Statement::Call {
                function,
                ref arguments,
                result: None,
            } if inner.is_none() && arguments.is_empty() => {
                inner = Some(function);
            }
            Statement::Return { value: Some(value) } if inner.is_some() => {
                let parts = match &function.expressions[value] {
                    Expression::Compose { ty, components } => {
                        composed = Some(*ty);
                        components.clone()
                    }
                    _ => vec![value],
                };
                for part in parts {
                    let Expression::Load { pointer } = function.expressions[part] else {
                        return None;
                    };
                    outputs.push(global(pointer)?);
                }
            }
            _ => return None,
        }
    }
    Some(Wrapper {
        inner: inner?,
        inputs,
        outputs,
        composed,
    })
}

fn fold(module: &mut Module) -> Option<()> {
    // With other functions about, somebody else might use the globals.
    if module.functions.len() != 1 {
        return None;
    }
    let wrapper = read_wrapper(module)?;
    let mut function = module.functions[wrapper.inner].clone();
    if !function.arguments.is_empty() || function.result.is_some() {
        return None;
    }
    inputs_to_arguments(&mut function, &wrapper.inputs)?;
    drop_return(&mut function.body);
    if !wrapper.outputs.is_empty() {
        outputs_to_result(module, &mut function, &wrapper)?;
    }
    mend_emits(&mut function.body, &function.expressions);
    let entry = &mut module.entry_points[0].function;
    entry.local_variables = function.local_variables;
    entry.expressions = function.expressions;
    entry.named_expressions = function.named_expressions;
    entry.body = function.body;
    Some(())
}

/// Loads of input globals become the arguments themselves.
fn inputs_to_arguments(
    function: &mut naga::Function,
    inputs: &HashMap<Handle<GlobalVariable>, u32>,
) -> Option<()> {
    // Pointers into inputs: the variable and constant members of it.
    let mut rooted: HashSet<Handle<Expression>> = HashSet::new();
    let handles: Vec<_> = function
        .expressions
        .iter()
        .map(|(handle, _)| handle)
        .collect();
    for handle in handles {
        match function.expressions[handle] {
            Expression::GlobalVariable(global) => {
                if let Some(&argument) = inputs.get(&global) {
                    rooted.insert(handle);
                    function.expressions[handle] = Expression::FunctionArgument(argument);
                }
            }
            Expression::AccessIndex { base, .. } if rooted.contains(&base) => {
                rooted.insert(handle);
            }
            // A value cannot be indexed by a variable in every language.
            Expression::Access { base, .. } if rooted.contains(&base) => return None,
            // The pointer has become the value.
            Expression::Load { pointer } if rooted.contains(&pointer) => {
                function.expressions[handle] = function.expressions[pointer].clone();
            }
            _ => {}
        }
    }
    Some(())
}

/// Output globals become the return value, by way of a local variable where they are stored in
/// several places.
fn outputs_to_result(
    module: &Module,
    function: &mut naga::Function,
    wrapper: &Wrapper,
) -> Option<()> {
    if returns(&function.body) {
        return None;
    }
    let mut components = Vec::new();
    let first_new = function.expressions.len();
    for &output in &wrapper.outputs {
        let pointers: HashSet<Handle<Expression>> = function
            .expressions
            .iter()
            .filter(|(_, expression)| {
                matches!(expression, Expression::GlobalVariable(global) if *global == output)
            })
            .map(|(handle, _)| handle)
            .collect();
        if let Some(value) = single_store(function, &pointers) {
            components.push(value);
            continue;
        }
        let global = &module.global_variables[output];
        if global.init.is_some() {
            return None;
        }
        let local = function.local_variables.append(
            LocalVariable {
                name: global.name.clone(),
                ty: global.ty,
                init: None,
            },
            Span::UNDEFINED,
        );
        for &pointer in &pointers {
            function.expressions[pointer] = Expression::LocalVariable(local);
        }
        let pointer = function
            .expressions
            .append(Expression::LocalVariable(local), Span::UNDEFINED);
        components.push(
            function
                .expressions
                .append(Expression::Load { pointer }, Span::UNDEFINED),
        );
    }
    let value = match wrapper.composed {
        Some(ty) => function
            .expressions
            .append(Expression::Compose { ty, components }, Span::UNDEFINED),
        None => *components.first()?,
    };
    if function.expressions.len() > first_new {
        let range = function.expressions.range_from(first_new);
        function.body.push(Statement::Emit(range), Span::UNDEFINED);
    }
    function
        .body
        .push(Statement::Return { value: Some(value) }, Span::UNDEFINED);
    Some(())
}

/// The value of the only store to one of `pointers`, if that stands at the function's top level
/// and nothing reads it back; the store is removed.
fn single_store(
    function: &mut naga::Function,
    pointers: &HashSet<Handle<Expression>>,
) -> Option<Handle<Expression>> {
    let used_otherwise = function
        .expressions
        .iter()
        .any(|(_, expression)| match expression {
            Expression::Load { pointer } => pointers.contains(pointer),
            Expression::AccessIndex { base, .. } | Expression::Access { base, .. } => {
                pointers.contains(base)
            }
            _ => false,
        });
    let mut stores = 0;
    each_statement(&function.body, &mut |statement| {
        if let Statement::Store { pointer, .. } = statement {
            stores += u32::from(pointers.contains(pointer));
        }
    });
    if used_otherwise || stores != 1 {
        return None;
    }
    let place = function.body.iter().position(
        |statement| matches!(statement, Statement::Store { pointer, .. } if pointers.contains(pointer)),
    )?;
    let Statement::Store { value, .. } = function.body[place] else {
        return None;
    };
    function.body.cull(place..=place);
    Some(value)
}

fn returns(block: &Block) -> bool {
    let mut found = false;
    each_statement(block, &mut |statement| {
        found |= matches!(statement, Statement::Return { .. })
    });
    found
}

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

/// Expressions that stand for a declaration are not emitted: takes those out of the ranges that
/// were emitted when they were something else.
fn mend_emits(block: &mut Block, expressions: &Arena<Expression>) {
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

/// Buffers whose type is a structure with one member become that member.
pub fn unwrap_blocks(module: &mut Module) {
    let blocks: Vec<(Handle<GlobalVariable>, Handle<Type>, Option<String>)> = module
        .global_variables
        .iter()
        .filter(|(_, global)| {
            matches!(
                global.space,
                AddressSpace::Uniform | AddressSpace::Storage { .. }
            )
        })
        .filter_map(|(handle, global)| match &module.types[global.ty] {
            Type {
                name,
                inner: TypeInner::Struct { members, .. },
            } => match members.as_slice() {
                [only] if only.offset == 0 => Some((handle, only.ty, name.clone())),
                _ => None,
            },
            _ => None,
        })
        .collect();
    for (global, content, name) in blocks {
        if !functions(module).all(|function| only_member_used(function, global)) {
            continue;
        }
        functions_mut(module).for_each(|function| skip_member(function, global));
        module.global_variables.get_mut(global).ty = content;
        // MSL and GLSL declare the array's type: by the block's name.
        if let (
            Type {
                name: None,
                inner: TypeInner::Array { .. },
            },
            Some(name),
        ) = (&module.types[content], name)
        {
            let named = Type {
                name: Some(name),
                ..module.types[content].clone()
            };
            module.types.replace(content, named);
        }
    }
}

fn functions(module: &Module) -> impl Iterator<Item = &naga::Function> {
    let inner = module.functions.iter().map(|(_, function)| function);
    inner.chain(module.entry_points.iter().map(|entry| &entry.function))
}

fn functions_mut(module: &mut Module) -> impl Iterator<Item = &mut naga::Function> {
    let inner = module.functions.iter_mut().map(|(_, function)| function);
    inner.chain(
        module
            .entry_points
            .iter_mut()
            .map(|entry| &mut entry.function),
    )
}

/// A load or store of the whole block would change its meaning.
fn only_member_used(function: &naga::Function, global: GlobalHandle) -> bool {
    let is_block = |handle: &Handle<Expression>| matches!(function.expressions[*handle], Expression::GlobalVariable(other) if other == global);
    let loaded = function.expressions.iter().any(
        |(_, expression)| matches!(expression, Expression::Load { pointer } if is_block(pointer)),
    );
    let mut passed = false;
    each_statement(&function.body, &mut |statement| {
        passed |= match statement {
            Statement::Store { pointer, .. } => is_block(pointer),
            Statement::Call { arguments, .. } => arguments.iter().any(is_block),
            _ => false,
        };
    });
    !loaded && !passed
}

type GlobalHandle = Handle<GlobalVariable>;

fn skip_member(function: &mut naga::Function, global: GlobalHandle) {
    let handles: Vec<_> = function
        .expressions
        .iter()
        .map(|(handle, _)| handle)
        .collect();
    // Decided before the first edit: an edited access looks like the block itself.
    let accesses: Vec<_> = handles
        .into_iter()
        .filter(|handle| match function.expressions[*handle] {
            Expression::AccessIndex { base, index: 0 } => {
                matches!(function.expressions[base], Expression::GlobalVariable(other) if other == global)
            }
            _ => false,
        })
        .collect();
    for access in accesses {
        function.expressions[access] = Expression::GlobalVariable(global);
    }
    let mut body = std::mem::take(&mut function.body);
    mend_emits(&mut body, &function.expressions);
    function.body = body;
}

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
                if continues(body) {
                    continue;
                }
                let end = std::mem::take(continuing);
                match break_if.take() {
                    None => append(body, end),
                    Some(condition) => end_loop(body, end, condition, expressions),
                }
            }
            _ => {}
        }
    }
}

/// Whether a block goes on to the next turn of the loop around it before its end.
fn continues(block: &Block) -> bool {
    block.iter().any(|statement| match statement {
        Statement::Continue => true,
        Statement::Block(inner) => continues(inner),
        Statement::If { accept, reject, .. } => continues(accept) || continues(reject),
        Statement::Switch { cases, .. } => cases.iter().any(|case| continues(&case.body)),
        _ => false,
    })
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
    let mut leave = Block::new();
    leave.push(Statement::Break, Span::UNDEFINED);
    body.push(
        Statement::If {
            condition,
            accept: leave,
            reject: Block::new(),
        },
        Span::UNDEFINED,
    );
}

/// The local variable that an expression points to, if it is one as a whole.
fn local(
    expressions: &Arena<Expression>,
    pointer: Handle<Expression>,
) -> Option<Handle<LocalVariable>> {
    match expressions[pointer] {
        Expression::LocalVariable(local) => Some(local),
        _ => None,
    }
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

/// Stores what was stored to another variable before, not what is loaded from that.
fn forward_stores(block: &mut Block, expressions: &Arena<Expression>) {
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

fn drop_stores(block: &mut Block, is_dead: &impl Fn(Handle<Expression>) -> bool) {
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

fn drop_return(body: &mut Block) {
    if let Some(Statement::Return { value: None }) = body.last() {
        let last = body.len() - 1;
        body.cull(last..);
    }
}

/// Names the structure that a vertex or fragment stage with several outputs returns.
pub fn name_result(module: &mut Module, name: &str, members: &[String]) {
    let Some(FunctionResult { ty, .. }) = module
        .entry_points
        .first()
        .and_then(|entry| entry.function.result.clone())
    else {
        return;
    };
    let mut named = module.types[ty].clone();
    let TypeInner::Struct {
        members: fields, ..
    } = &mut named.inner
    else {
        return;
    };
    if named.name.is_some() || fields.len() != members.len() {
        return;
    }
    for (field, member) in fields.iter_mut().zip(members) {
        field.name = Some(member.clone());
    }
    named.name = Some(name.into());
    module.types.replace(ty, named);
}

/// Names loaded values after the member, structure or texture that they come from.
pub fn name_loads(module: &mut Module, info: &naga::valid::ModuleInfo) {
    if module.entry_points.len() != 1 {
        return;
    }
    let function = &module.entry_points[0].function;
    let types = info.get_entry_point(0);
    let pointee = |pointer: Handle<Expression>| match *types[pointer].ty.inner_with(&module.types) {
        TypeInner::Pointer { base, .. } => Some(&module.types[base]),
        _ => None,
    };
    let mut names = Vec::new();
    for (handle, expression) in function.expressions.iter() {
        let name = match *expression {
            Expression::Load { pointer } => match function.expressions[pointer] {
                Expression::AccessIndex { base, index } => match pointee(base) {
                    Some(Type {
                        inner: TypeInner::Struct { members, .. },
                        ..
                    }) => members[index as usize].name.clone(),
                    _ => None,
                },
                Expression::Access { .. } => match pointee(pointer) {
                    Some(Type {
                        name: Some(name),
                        inner: TypeInner::Struct { .. },
                    }) => Some(snake_case(name)),
                    _ => None,
                },
                _ => None,
            },
            Expression::ImageLoad { image, .. } | Expression::ImageSample { image, .. } => {
                texture_name(module, function, image).map(|name| format!("{name}_texel"))
            }
            Expression::ImageQuery {
                image,
                query: ImageQuery::Size { .. },
            } => texture_name(module, function, image).map(|name| format!("{name}_size")),
            _ => None,
        };
        names.extend(name.map(|name| (handle, name)));
    }
    module.entry_points[0]
        .function
        .named_expressions
        .extend(names);
}

/// Every function with the types of its expressions.
fn with_types<'a>(
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

/// Names every floating-point result that is rounded: the writers then give it a variable of its
/// own, which a language can say things about. Other functions than the entry point too.
pub fn name_roundings(module: &mut Module, info: &naga::valid::ModuleInfo) {
    let types = &module.types;
    for (info, function) in with_types(&mut module.functions, &mut module.entry_points, info) {
        let mut rounded = Vec::new();
        each_statement(&function.body, &mut |statement| {
            let Statement::Emit(range) = statement else {
                return;
            };
            rounded.extend(range.clone().filter(|handle| {
                let rounds = matches!(
                    function.expressions[*handle],
                    Expression::Binary { .. } | Expression::Math { .. }
                );
                let scalar = info[*handle].ty.inner_with(types).scalar();
                rounds && scalar.is_some_and(|scalar| scalar.kind == naga::ScalarKind::Float)
            }));
        });
        for handle in rounded {
            let name = function.named_expressions.entry(handle);
            name.or_insert_with(|| ROUNDED.into());
        }
    }
}

/// Names every floating-point value that leaves arithmetic: is stored, compared, put into a vector
/// or a structure. In GLSL and HLSL a `precise` variable makes all precise that its value is computed
/// from; so these, and the variables that the writers make anyway, are enough.
pub fn name_results(module: &mut Module, info: &naga::valid::ModuleInfo) {
    let types = &module.types;
    for (info, function) in with_types(&mut module.functions, &mut module.entry_points, info) {
        let is_arithmetic = |handle: Handle<Expression>| {
            let computes = matches!(
                function.expressions[handle],
                Expression::Binary { .. }
                    | Expression::Unary { .. }
                    | Expression::Math { .. }
                    | Expression::Select { .. }
            );
            let scalar = info[handle].ty.inner_with(types).scalar();
            computes && scalar.is_some_and(|scalar| scalar.kind == naga::ScalarKind::Float)
        };
        // How often each is used by arithmetic; every other use is one that it leaves by.
        let mut within = vec![0; function.expressions.len()];
        for (handle, expression) in function.expressions.iter() {
            if is_arithmetic(handle) {
                let mut count = |used: Handle<Expression>| within[used.index()] += 1;
                match *expression {
                    Expression::Binary { left, right, .. } => {
                        count(left);
                        count(right);
                    }
                    Expression::Unary { expr, .. } => count(expr),
                    // A call of our own in HLSL, into which `precise` does not reach.
                    Expression::Math {
                        fun: MathFunction::Sqrt | MathFunction::Floor,
                        arg,
                        ..
                    } if info[arg].ty.inner_with(types).scalar() == Some(naga::Scalar::F64) => {}
                    Expression::Math {
                        arg,
                        arg1,
                        arg2,
                        arg3,
                        ..
                    } => [Some(arg), arg1, arg2, arg3]
                        .into_iter()
                        .flatten()
                        .for_each(count),
                    Expression::Select { accept, reject, .. } => {
                        count(accept);
                        count(reject);
                    }
                    _ => {}
                }
            }
        }
        let leaving: Vec<_> = function
            .expressions
            .iter()
            .map(|(handle, _)| handle)
            .filter(|&handle| {
                is_arithmetic(handle) && info[handle].ref_count > within[handle.index()]
            })
            .collect();
        for handle in leaving {
            let name = function.named_expressions.entry(handle);
            name.or_insert_with(|| ROUNDED.into());
        }
    }
}

/// What [`name_roundings`] and [`name_results`] call them; the writers number them.
pub const ROUNDED: &str = "rounded";

fn texture_name(
    module: &Module,
    function: &naga::Function,
    image: Handle<Expression>,
) -> Option<String> {
    match function.expressions[image] {
        Expression::GlobalVariable(global) => module.global_variables[global].name.clone(),
        _ => None,
    }
}

/// `DepthPair` to `depth_pair`.
fn snake_case(name: &str) -> String {
    let mut snake = String::new();
    let mut after_small = false;
    for letter in name.chars() {
        if letter.is_uppercase() && after_small {
            snake.push('_');
        }
        after_small = !letter.is_uppercase() && letter != '_';
        snake.extend(letter.to_lowercase());
    }
    snake
}

#[cfg(test)]
mod tests {
    #[test]
    fn snake_case_parts_words() {
        assert_eq!(super::snake_case("DepthPair"), "depth_pair");
        assert_eq!(super::snake_case("Moments4"), "moments4");
        assert_eq!(super::snake_case("VSM"), "vsm");
    }
}
