//! Counts of bits get variables of their own in GLSL ES, where `bitCount`, `findMSB` and `findLSB`
//! are `lowp` (GLSL ES 3.10, section 8.8): computed with further, they overflow after 8 bits on
//! devices that take the word at its value. A variable is `highp`, as the text says at its top.

use naga::{Expression, Handle, MathFunction, Module, Statement};

use super::walk::{each_statement, functions, functions_mut};

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
