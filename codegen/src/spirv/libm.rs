//! Functions that rust-gpu 0.10.0 writes as others: each gets the meaning that it has in Rust.
//!
//! | in Rust | rust-gpu | here |
//! | --- | --- | --- |
//! | `libm::fmodf`: the sign of the first argument | `OpFMod`: the sign of the second | `OpFRem` |
//! | `libm::roundf`: ties away from zero | `Round`: ties as the device likes | `trunc` twice |
//! | `powi`, powers to constant whole numbers | `Pow`: nothing for bases below zero | products, or a power of the absolute value with the base's sign |
//! | `libm::cbrtf` | `Pow` by a third, likewise | a power of the absolute value with the base's sign |
//!
//! It works on the module as rust-gpu writes it: Rust's own `%` is `OpFRem` there, and
//! `round_ties_even` is `RoundEven`. So an `OpFMod` or a `Round` is always libm's.

use std::collections::{HashMap, HashSet};

use rspirv::dr::{Instruction, Module};
use rspirv::spirv::{GlslStd450Op as GLOp, Op, Word};

use super::edit::{Editor, FloatType, Sequence, called, replace_each};
use super::{id, op};

/// Powers up to this are products: no more multiplications than a device's `pow` takes.
const MOST_FACTORS: u32 = 4;

/// Gives the functions their meaning.
pub fn mend(module: &mut Module) {
    // Whole numbers that became floats, to which something is raised.
    let whole: HashMap<Word, (Word, Word)> = module
        .functions
        .iter()
        .flat_map(|function| function.all_inst_iter())
        .filter(|it| op(it) == Op::ConvertSToF)
        .filter_map(|it| Some((it.result_id?, (id(it, 0)?, it.result_type?))))
        .collect();
    // Of an absolute value a power is what it is: this ran before.
    let sizes: HashSet<Word> = module
        .functions
        .iter()
        .flat_map(|function| function.all_inst_iter())
        .filter(|it| super::edit::is_call(it, GLOp::FAbs))
        .filter_map(|it| it.result_id)
        .collect();
    let types: HashMap<Word, Word> = module
        .functions
        .iter()
        .flat_map(|function| function.all_inst_iter())
        .filter_map(|it| Some((it.result_id?, it.result_type?)))
        .collect();
    replace_each(module, |editor, instruction| {
        if op(instruction) == Op::FMod {
            let mut truncating = instruction.clone();
            truncating.class = Instruction::new(Op::FRem, None, None, Vec::new()).class;
            return Some(vec![truncating]);
        }
        let set = editor.functions_set()?;
        let result = instruction.result_id?;
        let ty = editor.float_type(instruction.result_type?)?;
        match called(instruction, set)? {
            GLOp::Round => Some(round(editor, set, ty, id(instruction, 2)?, result)),
            GLOp::Pow => {
                let (base, exponent) = (id(instruction, 2)?, id(instruction, 3)?);
                if sizes.contains(&base) {
                    return None;
                }
                if let Some(value) = editor.float_value(exponent) {
                    return constant_power(editor, set, ty, (base, exponent, value), result);
                }
                let (number, _) = *whole.get(&exponent)?;
                if let Some(value) = editor.integer_value(number) {
                    let exponent = editor.float(ty, value as f64);
                    let power = (base, exponent, value as f64);
                    return constant_power(editor, set, ty, power, result);
                }
                let number_type = *types.get(&number)?;
                let power = (base, exponent, number, number_type);
                whole_power(editor, set, ty, power, result)
            }
            _ => None,
        }
    });
}

/// `t = trunc(x); t + trunc((x - t) * 2)`: the difference is exact, and so is its double.
fn round(
    editor: &mut Editor<'_>,
    set: Word,
    ty: FloatType,
    x: Word,
    result: Word,
) -> Vec<Instruction> {
    let two = editor.float(ty, 2.0);
    let mut steps = Sequence::new(editor, set);
    let whole = steps.call(GLOp::Trunc, ty.id, &[x]);
    let rest = steps.then(Op::FSub, ty.id, &[x, whole]);
    let twice = steps.then(Op::FMul, ty.id, &[rest, two]);
    let step = steps.call(GLOp::Trunc, ty.id, &[twice]);
    steps.then(Op::FAdd, ty.id, &[whole, step]);
    steps.ending_in(result)
}

/// A power to a constant; nothing where a device's own will do.
fn constant_power(
    editor: &mut Editor<'_>,
    set: Word,
    ty: FloatType,
    (base, exponent, value): (Word, Word, f64),
    result: Word,
) -> Option<Vec<Instruction>> {
    let third = match ty.bits {
        32 => f64::from((1.0 / 3.0_f64) as f32),
        _ => 1.0 / 3.0,
    };
    if value == third {
        return Some(signed_power(
            editor,
            set,
            ty,
            (base, exponent),
            None,
            result,
        ));
    }
    if value.fract() != 0.0 || value.abs() > 1.0e9 {
        return None;
    }
    let times = value.abs() as u32;
    if times == 0 || times > MOST_FACTORS {
        let odd = times % 2 == 1;
        return Some(if odd {
            signed_power(editor, set, ty, (base, exponent), None, result)
        } else {
            let mut steps = Sequence::new(editor, set);
            let size = steps.call(GLOp::FAbs, ty.id, &[base]);
            steps.call(GLOp::Pow, ty.id, &[size, exponent]);
            steps.ending_in(result)
        });
    }
    let one = editor.float(ty, 1.0);
    let mut steps = Sequence::new(editor, set);
    let square = (times > 1).then(|| steps.then(Op::FMul, ty.id, &[base, base]));
    let product = match (times, square) {
        (2, Some(square)) => square,
        (3, Some(square)) => steps.then(Op::FMul, ty.id, &[square, base]),
        (4, Some(square)) => steps.then(Op::FMul, ty.id, &[square, square]),
        _ => base,
    };
    if value < 0.0 {
        steps.then(Op::FDiv, ty.id, &[one, product]);
    } else if times == 1 {
        steps.then(Op::CopyObject, ty.id, &[base]);
    }
    Some(steps.ending_in(result))
}

/// A power to a whole number that is not known: the sign is the base's where the number is odd.
fn whole_power(
    editor: &mut Editor<'_>,
    set: Word,
    ty: FloatType,
    (base, exponent, number, number_type): (Word, Word, Word, Word),
    result: Word,
) -> Option<Vec<Instruction>> {
    let (32, _) = editor.integer_type(number_type)? else {
        return None;
    };
    let one = editor.integer(number_type, 1);
    let bool_type = editor.bool_type();
    let mut steps = Sequence::new(editor, set);
    let lowest = steps.then(Op::BitwiseAnd, number_type, &[number, one]);
    let odd = steps.then(Op::IEqual, bool_type, &[lowest, one]);
    let before = steps.ending_in_itself();
    let after = signed_power(editor, set, ty, (base, exponent), Some(odd), result);
    Some(before.into_iter().chain(after).collect())
}

/// `pow(abs(base), exponent)`, negated where the base is below zero and `odd` holds, if given.
fn signed_power(
    editor: &mut Editor<'_>,
    set: Word,
    ty: FloatType,
    (base, exponent): (Word, Word),
    odd: Option<Word>,
    result: Word,
) -> Vec<Instruction> {
    let zero = editor.float(ty, 0.0);
    let bool_type = editor.bool_type();
    let mut steps = Sequence::new(editor, set);
    let size = steps.call(GLOp::FAbs, ty.id, &[base]);
    let power = steps.call(GLOp::Pow, ty.id, &[size, exponent]);
    let below = steps.then(Op::FOrdLessThan, bool_type, &[base, zero]);
    let turns = match odd {
        Some(odd) => steps.then(Op::LogicalAnd, bool_type, &[below, odd]),
        None => below,
    };
    let negative = steps.then(Op::FNegate, ty.id, &[power]);
    steps.then(Op::Select, ty.id, &[turns, negative, power]);
    steps.ending_in(result)
}
