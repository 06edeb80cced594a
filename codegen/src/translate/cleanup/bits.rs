//! Counts of bits get variables of their own in GLSL ES, where `bitCount`, `findMSB` and `findLSB`
//! are `lowp` (GLSL ES 3.10, section 8.8): computed with further, they overflow after 8 bits on
//! devices that take the word at its value. A variable is `highp`, as the text says at its top.

//!
//! And 64-bit integers that are read with or without a sign are converted in HLSL: naga writes nothing there
//! (`tests/upstream/naga-hlsl-wide-sign`), so that shifts and comparisons were those of the other sign.

use naga::valid::ModuleInfo;
use naga::{Expression, Handle, MathFunction, Module, ScalarKind, Statement};

use super::walk::{each_statement, functions, functions_mut, with_types};

fn counts(expression: &Expression) -> bool {
    matches!(
        expression,
        Expression::Math {
            fun: MathFunction::CountOneBits
                | MathFunction::CountLeadingZeros
                | MathFunction::CountTrailingZeros
                | MathFunction::FirstLeadingBit
                | MathFunction::FirstTrailingBit,
            ..
        }
    )
}

/// Whether any are there.
pub fn has_bit_counts(module: &Module) -> bool {
    functions(module).any(|function| function.expressions.iter().any(|(_, it)| counts(it)))
}

/// Whether there are any, or other functions of bits that GLSL ES 3.00 does not have.
pub fn has_functions_of_bits(module: &Module) -> bool {
    let others = |expression: &Expression| {
        matches!(
            expression,
            Expression::Math {
                fun: MathFunction::ReverseBits
                    | MathFunction::ExtractBits
                    | MathFunction::InsertBits
                    | MathFunction::Pack4x8snorm
                    | MathFunction::Pack4x8unorm
                    | MathFunction::Unpack4x8snorm
                    | MathFunction::Unpack4x8unorm,
                ..
            }
        )
    };
    functions(module).any(|function| {
        let mut all = function.expressions.iter();
        all.any(|(_, it)| counts(it) || others(it))
    })
}

/// Names them.
pub fn name_bit_counts(module: &mut Module) {
    for function in functions_mut(module) {
        let mut found: Vec<Handle<Expression>> = Vec::new();
        each_statement(&function.body, &mut |statement| {
            if let Statement::Emit(range) = statement {
                let all = range.clone();
                found.extend(all.filter(|handle| counts(&function.expressions[*handle])));
            }
        });
        for handle in found {
            let name = function.named_expressions.entry(handle);
            name.or_insert_with(|| "bits".into());
        }
    }
}

/// Whether a type is one of 64-bit integers.
fn is_wide_integer(inner: &naga::TypeInner) -> bool {
    inner
        .scalar()
        .is_some_and(|it| it.width == 8 && matches!(it.kind, ScalarKind::Sint | ScalarKind::Uint))
}

/// Makes conversions of 64-bit integers that are read with or without a sign. Says whether there were any.
pub fn convert_wide_signs(module: &mut Module, info: &ModuleInfo) -> bool {
    let types = &module.types;
    let mut changed = false;
    for (info, function) in with_types(&mut module.functions, &mut module.entry_points, info) {
        for (_, expression) in function.expressions.iter_mut() {
            if let Expression::As {
                expr,
                kind: ScalarKind::Sint | ScalarKind::Uint,
                convert: convert @ None,
            } = expression
                && is_wide_integer(info[*expr].ty.inner_with(types))
            {
                *convert = Some(8);
                changed = true;
            }
        }
    }
    changed
}
