//! Comparisons that hold for NaN. In SPIR-V there are two of each kind, and only SPIR-V has both:
//! naga 30.0.1 reads `OpFUnordLessThan` as `<`, which is false for NaN
//! (`tests/upstream/naga-unordered`). `NaN as u32` is 0 in Rust by way of one of them. Each becomes
//! "not the contrary", which every reader understands.
//!
//! `x != x` asks for NaN itself. Compilers that may take it that there is none answer no; so the
//! bits are asked.
//!
//! Comparisons with infinity (`is_finite`, and glam's `normalize_or_zero` by it) ask for the bits or compare with the
//! largest number: WGSL has no literal for an infinity. Of `signum`, which gives NaN for NaN, the constant becomes the
//! argument. What needs an infinity or NaN as a number keeps it, and WGSL does not get the kernel.

use std::collections::{HashMap, HashSet};

use rspirv::dr::{Instruction, Module, Operand};
use rspirv::spirv::{GlslStd450Op as GLOp, Op, Word};

use super::edit::{Editor, Sequence, is_call, replace_each};
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

/// The comparison with its operands exchanged.
fn exchanged(op: Op) -> Op {
    match op {
        Op::FOrdLessThan => Op::FOrdGreaterThan,
        Op::FOrdLessThanEqual => Op::FOrdGreaterThanEqual,
        Op::FOrdGreaterThan => Op::FOrdLessThan,
        Op::FOrdGreaterThanEqual => Op::FOrdLessThanEqual,
        same => same,
    }
}

/// What functions have, by result.
#[derive(Default)]
struct Values {
    types: HashMap<Word, Word>,
    /// Of magnitudes: of what.
    magnitudes: HashMap<Word, Word>,
    /// What is compared with itself, and whether the comparison holds for NaN.
    is_nan: HashMap<Word, (Word, bool)>,
    /// Blocks that are only reached where a number is NaN, and the number.
    where_nan: HashMap<Word, Word>,
}

impl Values {
    fn of(module: &Module) -> Self {
        let mut values = Self::default();
        for it in module.all_inst_iter() {
            let (Some(result), Some(ty)) = (it.result_id, it.result_type) else {
                continue;
            };
            values.types.insert(result, ty);
            match op(it) {
                Op::FUnordNotEqual | Op::FOrdEqual if id(it, 0) == id(it, 1) => {
                    let holds = op(it) == Op::FUnordNotEqual;
                    values
                        .is_nan
                        .extend(id(it, 0).map(|of| (result, (of, holds))));
                }
                _ if is_call(it, GLOp::FAbs) => {
                    values.magnitudes.extend(id(it, 2).map(|of| (result, of)));
                }
                _ => {}
            }
        }
        for function in &module.functions {
            let mut reached: HashMap<Word, u32> = HashMap::new();
            let ends = function
                .blocks
                .iter()
                .filter_map(|it| it.instructions.last());
            for it in ends.clone() {
                for target in it.operands.iter().filter_map(Operand::id_ref_any) {
                    *reached.entry(target).or_default() += 1;
                }
            }
            for it in ends.filter(|it| op(it) == Op::BranchConditional) {
                let (Some(condition), Some(yes), Some(no)) = (id(it, 0), id(it, 1), id(it, 2))
                else {
                    continue;
                };
                if let Some((of, holds_for_nan)) = values.is_nan.get(&condition) {
                    let block = if *holds_for_nan { yes } else { no };
                    if reached.get(&block) == Some(&1) {
                        values.where_nan.insert(block, *of);
                    }
                }
            }
        }
        values
    }

    fn is_single(&self, editor: &Editor<'_>, value: Word) -> bool {
        let ty = self.types.get(&value).and_then(|ty| editor.float_type(*ty));
        ty.is_some_and(|ty| ty.bits == 32)
    }
}

/// Replaces comparisons that hold for NaN, or that are with infinity.
pub fn mend(module: &mut Module) {
    let values = Values::of(module);
    replace_each(module, |editor, instruction| {
        let (ty, result) = (instruction.result_type?, instruction.result_id?);
        if op(instruction) == Op::Select {
            return chosen(editor, &values, instruction).map(|it| [it].into());
        }
        if op(instruction) == Op::Phi {
            return joined(editor, &values, instruction).map(|it| [it].into());
        }
        let (left, right) = (id(instruction, 0)?, id(instruction, 1)?);
        let (ordered, holds_for_nan) = match op(instruction) {
            op if contrary(op).is_some() => (contrary(op)?, true),
            op @ (Op::FOrdEqual
            | Op::FOrdLessThan
            | Op::FOrdLessThanEqual
            | Op::FOrdGreaterThan
            | Op::FOrdGreaterThanEqual) => (op, false),
            _ => return None,
        };
        if holds_for_nan
            && ordered == Op::FOrdEqual
            && left == right
            && values.is_single(editor, left)
        {
            return Some(is_nan(editor, ty, left, result));
        }
        let with_infinity = with_infinity(editor, &values, ty, (ordered, left, right));
        if with_infinity.is_none() && !holds_for_nan {
            return None;
        }
        let mut made = with_infinity.unwrap_or_else(|| {
            let mut steps = Sequence::new(editor, 0);
            steps.then(ordered, ty, &[left, right]);
            steps.ending_in_itself()
        });
        if holds_for_nan {
            let of = made.last()?.result_id?;
            let mut steps = Sequence::new(editor, 0);
            steps.then(Op::LogicalNot, ty, &[of]);
            made.extend(steps.ending_in_itself());
        }
        made.last_mut()?.result_id = Some(result);
        Some(made)
    });
    drop_unused_constants(module);
}

/// An ordered comparison with an infinite constant, in finite numbers.
fn with_infinity(
    editor: &mut Editor<'_>,
    values: &Values,
    bool_type: Word,
    (comparison, left, right): (Op, Word, Word),
) -> Option<Vec<Instruction>> {
    let infinite = |editor: &Editor<'_>, value: Word| {
        let value = editor.float_value(value)?;
        value.is_infinite().then_some(value > 0.0)
    };
    let (comparison, x, constant, positive) = match infinite(editor, right) {
        Some(positive) => (comparison, left, right, positive),
        None => (exchanged(comparison), right, left, infinite(editor, left)?),
    };
    let of = values.magnitudes.get(&x).filter(|_| positive);
    if let Some(of) = of.filter(|of| values.is_single(editor, **of)) {
        let by_bits = match comparison {
            Op::FOrdLessThan => Op::ULessThan,
            Op::FOrdEqual | Op::FOrdGreaterThanEqual => Op::IEqual,
            _ => return None,
        };
        return Some(magnitude(editor, bool_type, *of, by_bits));
    }
    let finite = match (comparison, positive) {
        (Op::FOrdLessThan, true) => Op::FOrdLessThanEqual,
        (Op::FOrdEqual | Op::FOrdGreaterThanEqual, true) => Op::FOrdGreaterThan,
        (Op::FOrdGreaterThan, false) => Op::FOrdGreaterThanEqual,
        (Op::FOrdEqual | Op::FOrdLessThanEqual, false) => Op::FOrdLessThan,
        // Never, or for all but NaN: nobody writes it.
        _ => return None,
    };
    let ty = editor.float_type(*values.types.get(&constant)?)?;
    let largest = if ty.bits == 32 {
        f32::MAX.into()
    } else {
        f64::MAX
    };
    let largest = editor.float(ty, if positive { largest } else { -largest });
    let mut steps = Sequence::new(editor, 0);
    steps.then(finite, bool_type, &[x, largest]);
    Some(steps.ending_in_itself())
}

/// A constant NaN that is chosen where `x` is NaN becomes `x`.
fn chosen(editor: &Editor<'_>, values: &Values, select: &Instruction) -> Option<Instruction> {
    let (of, holds_for_nan) = *values.is_nan.get(&id(select, 0)?)?;
    let place = if holds_for_nan { 1 } else { 2 };
    let is_nan = editor.float_value(id(select, place)?)?.is_nan();
    let same_type = values.types.get(&of) == select.result_type.as_ref();
    (is_nan && same_type).then(|| {
        let mut select = select.clone();
        select.operands[place] = Operand::IdRef(of);
        select
    })
}

/// As [`chosen`], where a branch chooses.
fn joined(editor: &Editor<'_>, values: &Values, phi: &Instruction) -> Option<Instruction> {
    let mut joined = phi.clone();
    for place in (0..phi.operands.len()).step_by(2) {
        let (value, block) = (id(phi, place)?, id(phi, place + 1)?);
        if let Some(of) = values.where_nan.get(&block)
            && editor.float_value(value).is_some_and(f64::is_nan)
            && values.types.get(of) == phi.result_type.as_ref()
        {
            joined.operands[place] = Operand::IdRef(*of);
        }
    }
    (joined.operands != phi.operands).then_some(joined)
}

/// Constants without a literal in WGSL must not stay where nothing needs them.
fn drop_unused_constants(module: &mut Module) {
    let used: HashSet<Word> = module
        .all_inst_iter()
        .flat_map(|it| it.operands.iter().filter_map(Operand::id_ref_any))
        .collect();
    let constants: Vec<Word> = module
        .types_global_values
        .iter()
        .filter(|it| op(it) == Op::Constant)
        .filter_map(|it| it.result_id.filter(|constant| !used.contains(constant)))
        .collect();
    let editor = Editor::new(module);
    let unused: HashSet<Word> = constants
        .into_iter()
        .filter(|it| editor.float_value(*it).is_some_and(|it| !it.is_finite()))
        .collect();
    module
        .types_global_values
        .retain(|it| it.result_id.is_none_or(|it| !unused.contains(&it)));
}

fn is_nan(editor: &mut Editor<'_>, bool_type: Word, x: Word, result: Word) -> Vec<Instruction> {
    let mut made = magnitude(editor, bool_type, x, Op::UGreaterThan);
    if let Some(last) = made.last_mut() {
        last.result_id = Some(result);
    }
    made
}

/// Bits of a float without its sign, compared with those of infinity.
fn magnitude(
    editor: &mut Editor<'_>,
    bool_type: Word,
    x: Word,
    comparison: Op,
) -> Vec<Instruction> {
    let word = editor.word_type();
    let (magnitude, infinity) = (editor.word(MAGNITUDE), editor.word(INFINITY));
    let mut steps = Sequence::new(editor, 0);
    let bits = steps.then(Op::Bitcast, word, &[x]);
    let size = steps.then(Op::BitwiseAnd, word, &[bits, magnitude]);
    steps.then(comparison, bool_type, &[size, infinity]);
    steps.ending_in_itself()
}

#[cfg(test)]
mod tests {
    use rspirv::dr::Builder;
    use rspirv::spirv::FunctionControl;

    use super::*;

    /// The instructions that `body` becomes, which is given the module, the types of truth values and floats, and a number.
    fn mended(body: impl Fn(&mut Builder, Word, Word, Word)) -> (Vec<Op>, Vec<f32>) {
        let mut b = Builder::new();
        let (truth, float) = (b.type_bool(), b.type_float(32, None));
        let void = b.type_void();
        let ty = b.type_function(void, [float]);
        b.begin_function(void, None, FunctionControl::NONE, ty)
            .unwrap();
        let x = b.function_parameter(float).unwrap();
        b.begin_block(None).unwrap();
        body(&mut b, truth, float, x);
        b.ret().unwrap();
        b.end_function().unwrap();
        let mut module = b.module();
        mend(&mut module);
        let block = &module.functions[0].blocks[0];
        let made = block.instructions.iter().map(op).collect();
        let constants = module.types_global_values.iter();
        let floats = constants.filter(|it| op(it) == Op::Constant && it.result_type == Some(float));
        let values = floats.map(|it| match it.operands[0] {
            Operand::LiteralBit32(bits) => f32::from_bits(bits),
            _ => panic!("no float"),
        });
        (made, values.collect())
    }

    fn infinity(b: &mut Builder, float: Word, sign: f32) -> Word {
        b.constant_bit32(float, (f32::INFINITY * sign).to_bits())
    }

    #[test]
    fn comparisons_with_infinity_are_with_the_largest_number() {
        let (made, constants) = mended(|b, truth, float, x| {
            let limit = infinity(b, float, 1.0);
            b.f_ord_less_than(truth, None, x, limit).unwrap();
        });
        assert_eq!(made, [Op::FOrdLessThanEqual, Op::Return]);
        assert_eq!(constants, [f32::MAX]);
        let (made, constants) = mended(|b, truth, float, x| {
            let limit = infinity(b, float, -1.0);
            b.f_ord_less_than(truth, None, limit, x).unwrap();
            b.f_unord_not_equal(truth, None, x, limit).unwrap();
        });
        let not_equal = [Op::FOrdLessThan, Op::LogicalNot];
        assert_eq!(made[0], Op::FOrdGreaterThanEqual);
        assert_eq!(made[1..3], not_equal);
        assert_eq!(constants, [f32::MIN]);
    }

    #[test]
    fn magnitudes_are_compared_by_their_bits() {
        let (made, constants) = mended(|b, truth, float, x| {
            let limit = infinity(b, float, 1.0);
            let set = b.ext_inst_import("GLSL.std.450");
            let size = b
                .ext_inst(float, None, set, GLOp::FAbs as u32, [Operand::IdRef(x)])
                .unwrap();
            b.f_ord_less_than(truth, None, size, limit).unwrap();
        });
        let by_bits = [Op::Bitcast, Op::BitwiseAnd, Op::ULessThan];
        assert_eq!(made[1..4], by_bits);
        assert!(constants.is_empty(), "{constants:?}");
    }

    #[test]
    fn nan_that_is_chosen_for_nan_is_the_number_itself() {
        let (made, constants) = mended(|b, truth, float, x| {
            let nan = b.constant_bit32(float, f32::NAN.to_bits());
            let one = b.constant_bit32(float, 1.0_f32.to_bits());
            let is_nan = b.f_unord_not_equal(truth, None, x, x).unwrap();
            b.select(float, None, is_nan, nan, one).unwrap();
        });
        let select = [Op::UGreaterThan, Op::Select, Op::Return];
        assert_eq!(made[made.len() - 3..], select);
        assert_eq!(constants, [1.0]);
    }

    #[test]
    fn nan_that_a_branch_gives_for_nan_is_the_number_itself() {
        let (made, constants) = mended(|b, truth, float, x| {
            let nan = b.constant_bit32(float, f32::NAN.to_bits());
            let one = b.constant_bit32(float, 1.0_f32.to_bits());
            let is_nan = b.f_unord_not_equal(truth, None, x, x).unwrap();
            let (yes, no, end) = (b.id(), b.id(), b.id());
            b.selection_merge(end, rspirv::spirv::SelectionControl::NONE)
                .unwrap();
            b.branch_conditional(is_nan, yes, no, []).unwrap();
            b.begin_block(Some(yes)).unwrap();
            b.branch(end).unwrap();
            b.begin_block(Some(no)).unwrap();
            b.branch(end).unwrap();
            b.begin_block(Some(end)).unwrap();
            b.phi(float, None, [(nan, yes), (one, no)]).unwrap();
        });
        assert!(made.contains(&Op::UGreaterThan), "{made:?}");
        assert_eq!(constants, [1.0]);
    }

    #[test]
    fn an_infinity_that_is_a_number_stays() {
        let (made, constants) = mended(|b, truth, float, x| {
            let limit = infinity(b, float, 1.0);
            let nearest = b.f_add(float, None, x, limit).unwrap();
            b.f_ord_less_than(truth, None, x, nearest).unwrap();
        });
        assert_eq!(made, [Op::FAdd, Op::FOrdLessThan, Op::Return]);
        assert_eq!(constants, [f32::INFINITY]);
    }
}
