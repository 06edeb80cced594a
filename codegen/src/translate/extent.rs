//! How long and how deeply nested a text will be, before it is written.
//!
//! naga's writers spell out constants of arrays and structures number by number at every use, and
//! initial zeros of variables too. HLSL has a member for every four bytes that a structure leaves
//! unused. So a module of a few kilobytes can ask for gigabytes of text. The writers also call
//! themselves for every level of an expression or a block, and a deep one would take their stack.
//! All of that is refused here, with what is to blame.

use naga::valid::{FunctionInfo, ModuleInfo};
use naga::{
    AddressSpace, Arena, ArraySize, Block, Expression, Function, Handle, Module, Statement, Type,
    TypeInner,
};

use super::cleanup::with_types;

/// Most numbers in the constants of a text: tens of megabytes of it.
pub(crate) const MOST_NUMBERS: u64 = 4_000_000;

/// Most bytes that a structure may leave unused: as many as Direct3D's largest constant buffer has.
/// HLSL has a member for every four of them.
const MOST_PADDING: u32 = 64 << 10;

/// Most levels of an expression within an expression or a block within a block: the writers' stack
/// ([`crate::error::STACK`]) has 32 KiB for each.
pub(crate) const MOST_LEVELS: u32 = 2000;

/// An expression of more levels gets variables for its parts ([`split_expressions`]).
const READABLE_LEVELS: u32 = 100;

/// Refuses what would be too long or too deep.
pub(super) fn check(module: &Module, info: &ModuleInfo) -> Result<(), String> {
    padding(module)?;
    let types = type_sizes(module);
    let size = |ty: Handle<Type>| types[ty.index()];
    let constants = constant_sizes(module, &types);
    let mut numbers = Numbers { total: 0 };
    for (_, variable) in module.global_variables.iter() {
        let name = variable.name.as_deref().unwrap_or("a variable");
        match (variable.init, variable.space) {
            (Some(init), _) => numbers.add(constants[init.index()], name)?,
            (None, AddressSpace::Private) => numbers.add(size(variable.ty), name)?,
            _ => {}
        }
    }
    let functions = module
        .functions
        .iter()
        .map(|(handle, function)| (function, &info[handle]));
    let entry_points = module
        .entry_points
        .iter()
        .enumerate()
        .map(|(i, entry)| (&entry.function, info.get_entry_point(i)));
    for (function, info) in functions.chain(entry_points) {
        for (_, variable) in function.local_variables.iter() {
            if variable.init.is_none() {
                let name = variable.name.as_deref().unwrap_or("a variable");
                numbers.add(size(variable.ty), name)?;
            }
        }
        for (handle, expression) in function.expressions.iter() {
            let uses = info[handle].ref_count as u64;
            let each = match *expression {
                Expression::Constant(constant) => {
                    constants[module.constants[constant].init.index()]
                }
                Expression::ZeroValue(ty) => size(ty),
                _ => continue,
            };
            // A name, or a single number, is what every expression has.
            if each > 1 {
                numbers.add(each.saturating_mul(uses), "a constant")?;
            }
        }
        depth(function, info)?;
    }
    Ok(())
}

struct Numbers {
    total: u64,
}

impl Numbers {
    fn add(&mut self, count: u64, what: &str) -> Result<(), String> {
        self.total = self.total.saturating_add(count);
        if self.total <= MOST_NUMBERS {
            return Ok(());
        }
        Err(format!(
            "its text would have more than {MOST_NUMBERS} numbers: {what} has {count} in all its \
             uses, and every language spells them out; make the array smaller, or read it from a \
             buffer"
        ))
    }
}

/// Refuses structures that are mostly gaps.
fn padding(module: &Module) -> Result<(), String> {
    for (_, ty) in module.types.iter() {
        let TypeInner::Struct { members, span } = &ty.inner else {
            continue;
        };
        let mut end = 0;
        let mut unused: u32 = 0;
        for member in members {
            unused = unused.saturating_add(member.offset.saturating_sub(end));
            let size = module.types[member.ty].inner.size(module.to_ctx());
            end = member.offset.saturating_add(size);
        }
        unused = unused.saturating_add(span.saturating_sub(end));
        if unused > MOST_PADDING {
            return Err(format!(
                "its structure {} leaves {unused} bytes unused between its members and behind \
                 them, more than {MOST_PADDING}: HLSL needs a member for every four of them",
                ty.name.as_deref().unwrap_or("without a name"),
            ));
        }
    }
    Ok(())
}

/// Numbers in a value of each type, saturating.
fn type_sizes(module: &Module) -> Vec<u64> {
    let mut sizes: Vec<u64> = Vec::with_capacity(module.types.len());
    for (_, ty) in module.types.iter() {
        let size = match &ty.inner {
            TypeInner::Vector { size, .. } => *size as u64,
            TypeInner::Matrix { columns, rows, .. } => *columns as u64 * *rows as u64,
            TypeInner::Array {
                base,
                size: ArraySize::Constant(count),
                ..
            } => sizes[base.index()].saturating_mul(u64::from(count.get())),
            TypeInner::Struct { members, .. } => members.iter().fold(0, |sum: u64, member| {
                sum.saturating_add(sizes[member.ty.index()])
            }),
            _ => 1,
        };
        sizes.push(size);
    }
    sizes
}

/// Numbers in each of the module's constant expressions, saturating: they refer to earlier ones.
fn constant_sizes(module: &Module, types: &[u64]) -> Vec<u64> {
    let arena: &Arena<Expression> = &module.global_expressions;
    let mut sizes: Vec<u64> = Vec::with_capacity(arena.len());
    for (_, expression) in arena.iter() {
        let size = match expression {
            Expression::Compose { components, .. } => components
                .iter()
                .fold(0, |sum: u64, part| sum.saturating_add(sizes[part.index()])),
            Expression::ZeroValue(ty) => types[ty.index()],
            Expression::Constant(constant) => {
                let init = module.constants[*constant].init.index();
                sizes.get(init).copied().unwrap_or(1)
            }
            _ => 1,
        };
        sizes.push(size);
    }
    sizes
}

/// How many levels each expression has in the text. What the writers give a variable starts anew: what is
/// used often or has a name.
fn levels(function: &Function, info: &FunctionInfo) -> Vec<u32> {
    let mut levels: Vec<u32> = Vec::with_capacity(function.expressions.len());
    for (_, expression) in function.expressions.iter() {
        let mut deepest = 0;
        for operand in operands(expression) {
            let variable = function.named_expressions.contains_key(&operand)
                || info[operand].ref_count >= function.expressions[operand].bake_ref_count();
            // Expressions refer to earlier ones.
            let level = levels.get(operand.index()).copied().unwrap_or(0);
            deepest = deepest.max(if variable { 1 } else { level });
        }
        levels.push(deepest + 1);
    }
    levels
}

/// Names parts of expressions that are nested deeply: the writers give them variables.
pub(super) fn split_expressions(module: &mut Module, info: &ModuleInfo) {
    for (info, function) in with_types(&mut module.functions, &mut module.entry_points, info) {
        let levels = levels(function, info);
        for (handle, expression) in function.expressions.iter() {
            let computes = matches!(
                expression,
                Expression::Binary { .. }
                    | Expression::Unary { .. }
                    | Expression::Math { .. }
                    | Expression::Select { .. }
                    | Expression::As { .. }
            );
            if computes && levels[handle.index()].is_multiple_of(READABLE_LEVELS) {
                let name = function.named_expressions.entry(handle);
                name.or_insert_with(|| "part".to_owned());
            }
        }
    }
}

/// Refuses expressions and blocks that are nested too deeply.
fn depth(function: &Function, info: &FunctionInfo) -> Result<(), String> {
    let mut open: Vec<(&Block, u32)> = vec![(&function.body, 1)];
    let mut levels = levels(function, info).into_iter().max().unwrap_or(0);
    while let Some((block, level)) = open.pop() {
        levels = levels.max(level);
        for statement in block {
            match statement {
                Statement::Block(inner) => open.push((inner, level + 1)),
                Statement::If { accept, reject, .. } => {
                    open.extend([(accept, level + 1), (reject, level + 1)]);
                }
                Statement::Switch { cases, .. } => {
                    open.extend(cases.iter().map(|case| (&case.body, level + 1)));
                }
                Statement::Loop {
                    body, continuing, ..
                } => open.extend([(body, level + 1), (continuing, level + 1)]),
                _ => {}
            }
        }
    }
    if levels > MOST_LEVELS {
        return Err(format!(
            "it is nested {levels} levels deep, more than the {MOST_LEVELS} that can be written: \
             nest fewer conditions and loops"
        ));
    }
    Ok(())
}

/// What an expression is written around.
fn operands(expression: &Expression) -> Vec<Handle<Expression>> {
    use Expression as E;
    match expression {
        E::Access { base, index } => vec![*base, *index],
        E::AccessIndex { base, .. } => vec![*base],
        E::Splat { value, .. } => vec![*value],
        E::Swizzle { vector, .. } => vec![*vector],
        E::Compose { components, .. } => components.clone(),
        E::Unary { expr, .. } | E::As { expr, .. } | E::Derivative { expr, .. } => vec![*expr],
        E::Binary { left, right, .. } => vec![*left, *right],
        E::Select {
            condition,
            accept,
            reject,
        } => vec![*condition, *accept, *reject],
        E::Relational { argument, .. } => vec![*argument],
        E::Math {
            arg,
            arg1,
            arg2,
            arg3,
            ..
        } => [Some(*arg), *arg1, *arg2, *arg3]
            .into_iter()
            .flatten()
            .collect(),
        E::ArrayLength(array) => vec![*array],
        _ => Vec::new(),
    }
}
