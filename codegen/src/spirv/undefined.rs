//! Values that are not defined become zero, as naga writes them.
//!
//! No result follows from one. But where an arm of a phi is not defined, Mesa 22.3's lavapipe gets values wrong that
//! leave a loop, for invocations that leave it at another turn than their neighbours (kernel `ranked` of
//! `tests/iteration`).

use std::collections::HashSet;

use rspirv::dr::{Instruction, Module};
use rspirv::spirv::{Op, Word};

use super::op;

/// Gives undefined numbers, booleans and what is made of them the value zero.
pub fn fill(module: &mut Module) {
    let types: HashSet<Word> = module
        .types_global_values
        .iter()
        .filter(|it| has_zero(op(it)))
        .filter_map(|it| it.result_id)
        .collect();
    let is_filled = |it: &Instruction| {
        op(it) == Op::Undef && it.result_type.is_some_and(|ty| types.contains(&ty))
    };
    let zero = |it: &Instruction| {
        Instruction::new(Op::ConstantNull, it.result_type, it.result_id, Vec::new())
    };
    for it in &mut module.types_global_values {
        if is_filled(it) {
            *it = zero(it);
        }
    }
    let mut constants = Vec::new();
    for block in module.functions.iter_mut().flat_map(|it| &mut it.blocks) {
        block.instructions.retain(|it| {
            if is_filled(it) {
                constants.push(zero(it));
            }
            !is_filled(it)
        });
    }
    module.types_global_values.extend(constants);
}

/// Whether a type's values may be zero: pointers and textures are not.
fn has_zero(ty: Op) -> bool {
    matches!(
        ty,
        Op::TypeBool
            | Op::TypeInt
            | Op::TypeFloat
            | Op::TypeVector
            | Op::TypeMatrix
            | Op::TypeArray
            | Op::TypeStruct
    )
}

#[cfg(test)]
mod tests {
    use rspirv::dr::Builder;
    use rspirv::spirv::FunctionControl;

    use super::*;

    #[test]
    fn numbers_become_zero_wherever_they_stand() {
        let mut b = Builder::new();
        let word = b.type_int(32, 0);
        let ty = b.type_function(word, []);
        let outside = b.undef(word, None);
        b.begin_function(word, None, FunctionControl::NONE, ty)
            .unwrap();
        b.begin_block(None).unwrap();
        let inside = b.undef(word, None);
        let sum = b.i_add(word, None, outside, inside).unwrap();
        b.ret_value(sum).unwrap();
        b.end_function().unwrap();
        let mut module = b.module();
        fill(&mut module);
        assert!(module.all_inst_iter().all(|it| op(it) != Op::Undef));
        let zeros = module.types_global_values.iter();
        let zeros = zeros.filter(|it| op(it) == Op::ConstantNull);
        let zeros: Vec<_> = zeros.filter_map(|it| it.result_id).collect();
        assert_eq!(zeros, [outside, inside]);
    }
}
