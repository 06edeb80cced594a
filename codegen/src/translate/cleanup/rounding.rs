//! Variables for results of arithmetic, where a language must be told to compute them as written.

use naga::{Expression, Handle, MathFunction, Module, Statement};

use super::walk::{each_statement, with_types};

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
