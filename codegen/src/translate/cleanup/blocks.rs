//! Buffers lose the structure around their contents: `input[i]`, not `input.elements[i]`.

use naga::{AddressSpace, Expression, GlobalVariable, Handle, Module, Statement, Type, TypeInner};

use super::walk::{each_statement, functions, functions_mut, mend_emits, replace_type};

/// Buffers whose type is a structure with one member become that member.
pub fn unwrap_blocks(module: &mut Module) {
    let blocks: Vec<(Handle<GlobalVariable>, Handle<Type>, Option<String>)> = module
        .global_variables
        .iter()
        .filter(|(_, global)| {
            matches!(
                global.space,
                AddressSpace::Uniform | AddressSpace::Immediate | AddressSpace::Storage { .. }
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
            replace_type(module, content, named);
        }
    }
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
