//! The inner function goes into the entry point: inputs are its arguments, outputs its return value.

use std::collections::{HashMap, HashSet};

use naga::{
    Block, Expression, GlobalVariable, Handle, LocalVariable, Module, Span, Statement, Type,
    TypeInner,
};

use super::shapes::drop_return;
use super::walk::{each_statement, mend_emits};

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
        if let TypeInner::Vector { size, .. } = module.types[global.ty].inner
            && let Some(parts) = stores_of_parts(function, &pointers, size as usize)
        {
            components.push(function.expressions.append(
                Expression::Compose {
                    ty: global.ty,
                    components: parts,
                },
                Span::UNDEFINED,
            ));
            continue;
        }
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

/// The values of the stores to the components of one vector, if each component has one, at the function's top level, and
/// nothing reads them back; the stores are removed. A pair of numbers is stored so.
fn stores_of_parts(
    function: &mut naga::Function,
    pointers: &HashSet<Handle<Expression>>,
    size: usize,
) -> Option<Vec<Handle<Expression>>> {
    // Which component each pointer is for.
    let mut parts = HashMap::new();
    for (handle, expression) in function.expressions.iter() {
        match expression {
            Expression::AccessIndex { base, index } if pointers.contains(base) => {
                parts.insert(handle, *index as usize);
            }
            Expression::Access { base, .. } if pointers.contains(base) => return None,
            _ => {}
        }
    }
    let is_read = |expression: &Expression| match expression {
        Expression::Load { pointer } => pointers.contains(pointer) || parts.contains_key(pointer),
        _ => false,
    };
    if function.expressions.iter().any(|(_, it)| is_read(it)) {
        return None;
    }
    let mut stores = 0;
    each_statement(&function.body, &mut |statement| {
        if let Statement::Store { pointer, .. } = statement {
            stores += usize::from(pointers.contains(pointer) || parts.contains_key(pointer));
        }
    });
    let mut values = vec![None; size];
    for statement in &function.body {
        if let Statement::Store { pointer, value } = statement
            && let Some(&part) = parts.get(pointer)
        {
            *values.get_mut(part)? = Some(*value);
        }
    }
    let values: Option<Vec<_>> = values.into_iter().collect();
    let values = values.filter(|_| stores == size)?;
    let mut at = 0;
    while at < function.body.len() {
        match &function.body[at] {
            Statement::Store { pointer, .. } if parts.contains_key(pointer) => {
                function.body.cull(at..=at);
            }
            _ => at += 1,
        }
    }
    Some(values)
}

fn returns(block: &Block) -> bool {
    let mut found = false;
    each_statement(block, &mut |statement| {
        found |= matches!(statement, Statement::Return { .. })
    });
    found
}
