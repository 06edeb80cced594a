//! Comparisons that hold for NaN. In SPIR-V there are two of each kind, and only SPIR-V has both:
//! naga 30.0.1 reads `OpFUnordLessThan` as `<`, which is false for NaN
//! (`tests/upstream/naga-unordered`). `NaN as u32` is 0 in Rust by way of one of them. Each becomes
//! "not the contrary", which every reader understands.
//!
//! `x != x` asks for NaN itself. Compilers that may take it that there is none answer no; so the
//! bits are asked.

use rspirv::dr::{Instruction, Module};
use rspirv::spirv::{Op, Word};

use super::edit::{Editor, Sequence, replace_each};
use super::{id, op};

/// Bits of a 32-bit float without its sign.
const MAGNITUDE: u32 = 0x7fff_ffff;
/// Bits of infinity: NaN lies above.
const INFINITY: u32 = 0x7f80_0000;

/// The comparison that holds where the other does not, and not for NaN.
fn contrary(op: Op) -> Option<Op> {
    Some(match op {
        Op::FUnordNotEqual => Op::FOrdEqual,
        Op::FUnordLessThan => Op::FOrdGreaterThanEqual,
        Op::FUnordLessThanEqual => Op::FOrdGreaterThan,
        Op::FUnordGreaterThan => Op::FOrdLessThanEqual,
        Op::FUnordGreaterThanEqual => Op::FOrdLessThan,
        _ => return None,
    })
}

/// Replaces comparisons that hold for NaN.
pub fn mend(module: &mut Module) {
    let floats: std::collections::HashMap<Word, Word> = module
        .all_inst_iter()
        .filter_map(|it| Some((it.result_id?, it.result_type?)))
        .collect();
    replace_each(module, |editor, instruction| {
        let contrary = contrary(op(instruction))?;
        let (ty, result) = (instruction.result_type?, instruction.result_id?);
        let (left, right) = (id(instruction, 0)?, id(instruction, 1)?);
        let single = floats
            .get(&left)
            .and_then(|ty| editor.float_type(*ty))
            .is_some_and(|ty| ty.bits == 32);
        if op(instruction) == Op::FUnordNotEqual && left == right && single {
            return Some(is_nan(editor, ty, left, result));
        }
        let mut steps = Sequence::new(editor, 0);
        let ordered = steps.then(contrary, ty, &[left, right]);
        steps.then(Op::LogicalNot, ty, &[ordered]);
        Some(steps.ending_in(result))
    });
}

fn is_nan(editor: &mut Editor<'_>, bool_type: Word, x: Word, result: Word) -> Vec<Instruction> {
    let word = editor.word_type();
    let (magnitude, infinity) = (editor.word(MAGNITUDE), editor.word(INFINITY));
    let mut steps = Sequence::new(editor, 0);
    let bits = steps.then(Op::Bitcast, word, &[x]);
    let size = steps.then(Op::BitwiseAnd, word, &[bits, magnitude]);
    steps.then(Op::UGreaterThan, bool_type, &[size, infinity]);
    steps.ending_in(result)
}
