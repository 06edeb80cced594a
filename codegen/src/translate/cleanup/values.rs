//! Names for variables and values that have none in SPIR-V: after what they are, not after a number.
//! naga numbers those of one name in their order, so that a statement more changes the names of its
//! kind that follow, and no others.
//!
//! rust-gpu 0.10.0 does not pass on the names of the author's variables: it keeps memory out of
//! functions, and names memory alone.

use std::collections::{HashMap, HashSet};

use naga::valid::ModuleInfo;
use naga::{
    BinaryOperator, Expression, Function, Handle, LocalVariable, MathFunction, Module, ScalarKind,
    Statement, Type, TypeInner, UnaryOperator,
};

use super::walk::{each_statement, local, with_types};

/// Names the variables that naga makes of SPIR-V's phis.
pub fn name_phis(module: &mut Module) {
    let types = &module.types;
    let functions = module.functions.iter_mut().map(|(_, function)| function);
    let entries = module
        .entry_points
        .iter_mut()
        .map(|entry| &mut entry.function);
    for function in functions.chain(entries) {
        let counters = counters(function);
        let mut next_counter = COUNTERS.iter().cycle();
        for (handle, variable) in function.local_variables.iter_mut() {
            let is_phi = variable.name.as_ref().is_none_or(|name| {
                name.strip_prefix("phi_")
                    .is_some_and(|number| number.bytes().all(|it| it.is_ascii_digit()))
            });
            if is_phi {
                let name = match counters.contains(&handle) {
                    true => next_counter.next().copied().unwrap_or("i"),
                    false => after_type(&types[variable.ty]),
                };
                variable.name = Some(name.into());
            }
        }
    }
}

const COUNTERS: [&str; 3] = ["i", "j", "k"];

/// What a variable of a type is called.
fn after_type(ty: &Type) -> &'static str {
    match ty.inner {
        TypeInner::Scalar(scalar) => match scalar.kind {
            ScalarKind::Bool => "holds",
            ScalarKind::Float | ScalarKind::AbstractFloat => "value",
            _ => "number",
        },
        TypeInner::Vector { .. } => "components",
        TypeInner::Matrix { .. } => "columns",
        TypeInner::Array { .. } => "elements",
        TypeInner::Struct { .. } => "parts",
        _ => "it",
    }
}

/// Variables to which a constant is added, and nothing else done but to set them before.
fn counters(function: &Function) -> HashSet<Handle<LocalVariable>> {
    let expressions = &function.expressions;
    let is_step = |value: Handle<Expression>, variable: Handle<LocalVariable>| {
        let Expression::Binary {
            op: BinaryOperator::Add,
            left,
            right,
        } = expressions[value]
        else {
            return false;
        };
        let loads = |it: Handle<Expression>| match expressions[it] {
            Expression::Load { pointer } => local(expressions, pointer) == Some(variable),
            _ => false,
        };
        let constant = |it: Handle<Expression>| {
            matches!(
                expressions[it],
                Expression::Constant(_) | Expression::Literal(_)
            )
        };
        loads(left) && constant(right) || loads(right) && constant(left)
    };
    let mut steps: HashMap<Handle<LocalVariable>, bool> = HashMap::new();
    each_statement(&function.body, &mut |statement| {
        if let Statement::Store { pointer, value } = statement
            && let Some(variable) = local(expressions, *pointer)
        {
            let constant = matches!(
                expressions[*value],
                Expression::Constant(_) | Expression::Literal(_)
            );
            let step = is_step(*value, variable);
            match (step, constant) {
                (true, _) => {
                    steps.entry(variable).or_insert(true);
                }
                (false, true) => {}
                (false, false) => {
                    steps.insert(variable, false);
                }
            }
        }
    });
    steps
        .into_iter()
        .filter_map(|(variable, counts)| counts.then_some(variable))
        .collect()
}

/// Names the values that the writers give a variable of their own.
pub fn name_values(module: &mut Module, info: &ModuleInfo) {
    for (info, function) in with_types(&mut module.functions, &mut module.entry_points, info) {
        let mut found = Vec::new();
        each_statement(&function.body, &mut |statement| {
            let Statement::Emit(range) = statement else {
                return;
            };
            found.extend(range.clone().filter(|handle| {
                let often = function.expressions[*handle].bake_ref_count();
                info[*handle].ref_count >= often
            }));
        });
        for handle in found {
            if function.named_expressions.contains_key(&handle) {
                continue;
            }
            if let Some(name) = name_of(function, handle) {
                function.named_expressions.insert(handle, name);
            }
        }
    }
}

fn name_of(function: &Function, handle: Handle<Expression>) -> Option<String> {
    use BinaryOperator as B;
    use MathFunction as M;
    let name = match &function.expressions[handle] {
        Expression::Load { pointer } => {
            let variable = local(&function.expressions, *pointer)?;
            return function.local_variables[variable].name.clone();
        }
        Expression::Binary { op, .. } => match op {
            B::Add => "sum",
            B::Subtract => "difference",
            B::Multiply => "product",
            B::Divide => "quotient",
            B::Modulo => "remainder",
            B::Equal | B::NotEqual => "is_equal",
            B::Less | B::LessEqual => "is_less",
            B::Greater | B::GreaterEqual => "is_greater",
            B::And | B::ExclusiveOr | B::InclusiveOr => "bits",
            B::LogicalAnd => "both",
            B::LogicalOr => "either",
            B::ShiftLeft | B::ShiftRight => "shifted",
        },
        Expression::Unary { op, .. } => match op {
            UnaryOperator::Negate => "negative",
            UnaryOperator::LogicalNot => "contrary",
            UnaryOperator::BitwiseNot => "bits",
        },
        Expression::Math { fun, .. } => match fun {
            M::Abs => "magnitude",
            M::Sqrt => "root",
            M::Min => "least",
            M::Max => "most",
            M::Clamp | M::Saturate => "clamped",
            M::Floor | M::Ceil | M::Round | M::Trunc => "whole",
            M::Dot => "dot_product",
            M::Cross => "cross_product",
            M::Length | M::Distance => "extent",
            M::Normalize => "direction",
            M::Pow | M::Exp | M::Exp2 => "power",
            M::Log | M::Log2 => "logarithm",
            M::Sin => "sine",
            M::Cos => "cosine",
            M::Fma => "sum",
            M::Mix => "mixed",
            M::Sign => "sign_of",
            _ => return None,
        },
        Expression::Select { .. } => "chosen",
        Expression::As { .. } => "converted",
        Expression::Compose { .. } | Expression::Splat { .. } | Expression::Swizzle { .. } => {
            "components"
        }
        Expression::ArrayLength(_) => "count",
        _ => return None,
    };
    Some(name.into())
}
