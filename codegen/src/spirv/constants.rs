//! Types of specialisation constants. rust-gpu has them in `u32` alone: the DSL converts the 32 bits, and here the constant
//! gets the type that they are converted to.

use std::collections::HashMap;

use hankel_dsl::native::describe::{Kernel, Role, Scalar};
use rspirv::dr::{Instruction, Module, Operand};
use rspirv::spirv::{Op, Word};

use super::edit::Editor;
use super::{global, id, literal, op, spec_constant};

/// Gives each constant its type.
pub fn retype(module: &mut Module, kernel: &Kernel) {
    for param in &kernel.params {
        if let Role::Constant { id, scalar, .. } = param.role
            && scalar != Scalar::U32
            && let Some(constant) = spec_constant(module, id)
        {
            of_type(module, constant, scalar);
        }
    }
}

fn of_type(module: &mut Module, constant: Word, scalar: Scalar) {
    let mut editor = Editor::new(module);
    let unsigned = editor.integer_type_of(32, false);
    let ty = match scalar {
        Scalar::Bool => editor.bool_type(),
        Scalar::I32 => editor.integer_type_of(32, true),
        _ => editor.float_type_of(32).id,
    };
    let (none, one) = (editor.word(0), editor.word(1));
    let Some(place) = module
        .types_global_values
        .iter()
        .position(|it| it.result_id == Some(constant) && it.result_type != Some(ty))
    else {
        return;
    };
    // Behind its type.
    let mut declared = module.types_global_values.remove(place);
    let value = literal(&declared, 0).unwrap_or_default();
    declared.result_type = Some(ty);
    if scalar == Scalar::Bool {
        let kind = if value == 0 {
            Op::SpecConstantFalse
        } else {
            Op::SpecConstantTrue
        };
        declared = Instruction::new(kind, Some(ty), Some(constant), Vec::new());
    }
    module.types_global_values.push(declared);

    let is_zero = |module: &Module, word: Option<Word>| {
        let constant = word.and_then(|word| global(module, word));
        constant.is_some_and(|it| op(it) == Op::Constant && literal(it, 0) == Some(0))
    };
    // What converts the bits is the constant itself.
    let mut converted: HashMap<Word, Word> = HashMap::new();
    for it in module.functions.iter().flat_map(|it| it.all_inst_iter()) {
        let is_conversion = if scalar == Scalar::Bool {
            let (a, b) = (id(it, 0), id(it, 1));
            op(it) == Op::INotEqual
                && (a == Some(constant) && is_zero(module, b)
                    || b == Some(constant) && is_zero(module, a))
        } else {
            op(it) == Op::Bitcast && it.result_type == Some(ty) && id(it, 0) == Some(constant)
        };
        if let Some(result) = it.result_id.filter(|_| is_conversion) {
            converted.insert(result, constant);
        }
    }
    for at in 0..module.functions.len() {
        let bits = Editor::new(module).new_id();
        let mut is_read = false;
        for block in &mut module.functions[at].blocks {
            block
                .instructions
                .retain(|it| !it.result_id.is_some_and(|id| converted.contains_key(&id)));
            for operand in block
                .instructions
                .iter_mut()
                .flat_map(|it| &mut it.operands)
            {
                let Operand::IdRef(word) = operand else {
                    continue;
                };
                if *word == constant {
                    is_read = true;
                    *word = bits;
                } else if let Some(constant) = converted.get(word) {
                    *word = *constant;
                }
            }
        }
        // Whoever reads the bits still gets them.
        if is_read && let Some(first) = module.functions[at].blocks.first_mut() {
            let (kind, operands) = match scalar {
                Scalar::Bool => (Op::Select, vec![constant, one, none]),
                _ => (Op::Bitcast, vec![constant]),
            };
            let operands = operands.into_iter().map(Operand::IdRef).collect();
            let own = Instruction::new(kind, Some(unsigned), Some(bits), operands);
            let after = first
                .instructions
                .iter()
                .position(|it| op(it) != Op::Variable)
                .unwrap_or(0);
            first.instructions.insert(after, own);
        }
    }
    module
        .debug_names
        .retain(|it| !id(it, 0).is_some_and(|id| converted.contains_key(&id)));
    module.annotations.retain(|it| {
        let target = id(it, 0);
        !target.is_some_and(|id| converted.contains_key(&id))
    });
}

#[cfg(test)]
mod tests {
    use rspirv::dr::Builder;
    use rspirv::spirv::{Decoration, FunctionControl};

    use super::*;

    /// A module whose constant is converted, and whose bits are read once more; its constant and the converted value.
    fn module(scalar: Scalar) -> (Module, Word) {
        let mut b = Builder::new();
        let word = b.type_int(32, 0);
        let constant = b.spec_constant_bit32(word, 1);
        b.decorate(constant, Decoration::SpecId, [Operand::LiteralBit32(0)]);
        let zero = b.constant_bit32(word, 0);
        let float = b.type_float(32, None);
        let truth = b.type_bool();
        let ty = b.type_function(word, []);
        b.begin_function(word, None, FunctionControl::NONE, ty)
            .unwrap();
        b.begin_block(None).unwrap();
        match scalar {
            Scalar::Bool => {
                let is = b.i_not_equal(truth, None, constant, zero).unwrap();
                b.logical_not(truth, None, is).unwrap();
            }
            _ => {
                let x = b.bitcast(float, None, constant).unwrap();
                b.f_negate(float, None, x).unwrap();
            }
        }
        let sum = b.i_add(word, None, constant, zero).unwrap();
        b.ret_value(sum).unwrap();
        b.end_function().unwrap();
        (b.module(), constant)
    }

    fn of(module: &Module, wanted: Op) -> Vec<&Instruction> {
        let all = module.all_inst_iter();
        all.filter(|it| op(it) == wanted).collect()
    }

    #[test]
    fn a_constant_has_the_type_that_it_is_converted_to() {
        let (mut module, constant) = module(Scalar::F32);
        of_type(&mut module, constant, Scalar::F32);
        let declared = of(&module, Op::SpecConstant)[0];
        let float = of(&module, Op::TypeFloat)[0].result_id;
        assert_eq!(
            (declared.result_type, literal(declared, 0)),
            (float, Some(1))
        );
        assert_eq!(id(of(&module, Op::FNegate)[0], 0), Some(constant));
        // What reads the bits still does.
        let bits = of(&module, Op::Bitcast);
        assert_eq!(bits.len(), 1);
        assert_eq!(id(of(&module, Op::IAdd)[0], 0), bits[0].result_id);
        // Once more changes nothing.
        let before = crate::spirv::store(&module);
        of_type(&mut module, constant, Scalar::F32);
        assert_eq!(before, crate::spirv::store(&module));
    }

    #[test]
    fn a_truth_value_is_none_of_bits() {
        let (mut module, constant) = module(Scalar::Bool);
        of_type(&mut module, constant, Scalar::Bool);
        assert_eq!(
            of(&module, Op::SpecConstantTrue)[0].result_id,
            Some(constant)
        );
        assert_eq!(id(of(&module, Op::LogicalNot)[0], 0), Some(constant));
        let bits = of(&module, Op::Select)[0].result_id;
        assert_eq!(id(of(&module, Op::IAdd)[0], 0), bits);
        assert!(of(&module, Op::INotEqual).is_empty());
    }
}
