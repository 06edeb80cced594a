//! Offsets of samples in texels, which must be constants: the DSL makes each of two numbers in the function that samples.

use std::collections::HashMap;

use rspirv::dr::{Instruction, Module, Operand};
use rspirv::spirv::{ImageOperands, Op, Word};

use super::edit::replace_each;
use super::{global, id, op};

/// Makes constants of them.
pub fn make_constant(module: &mut Module) {
    let has_offset = |it: &Instruction| place_of_offset(it).is_some();
    let mut functions = module.functions.iter();
    if !functions.any(|function| function.all_inst_iter().any(has_offset)) {
        return;
    }
    let is_constant = |word: Word| global(module, word).is_some_and(|it| op(it) == Op::Constant);
    let made: HashMap<Word, Instruction> = module
        .functions
        .iter()
        .flat_map(|function| function.all_inst_iter())
        .filter(|it| op(it) == Op::CompositeConstruct)
        .filter(|it| {
            it.operands
                .iter()
                .all(|part| matches!(part, Operand::IdRef(word) if is_constant(*word)))
        })
        .filter_map(|it| Some((it.result_id?, it.clone())))
        .collect();
    replace_each(module, |editor, it| {
        let place = place_of_offset(it)?;
        let parts = made.get(&id(it, place)?)?;
        let constant = editor.composite(parts.result_type?, parts.operands.clone());
        let mut new = it.clone();
        new.operands[place] = Operand::IdRef(constant);
        Some(vec![new])
    });
}

/// Which operand of a sampling instruction is its constant offset.
fn place_of_offset(it: &Instruction) -> Option<usize> {
    let (at, operands) =
        it.operands
            .iter()
            .enumerate()
            .find_map(|(at, operand)| match operand {
                Operand::ImageOperands(operands) => Some((at, *operands)),
                _ => None,
            })?;
    // Behind a bias or a level, or two gradients.
    let before = ImageOperands::BIAS | ImageOperands::LOD;
    let gradients = 2 * u32::from(operands.contains(ImageOperands::GRAD));
    let place = at + 1 + ((operands & before).bits().count_ones() + gradients) as usize;
    operands
        .contains(ImageOperands::CONST_OFFSET)
        .then_some(place)
}
