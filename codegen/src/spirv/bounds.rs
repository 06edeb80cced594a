//! Comparisons that always hold. Rust tests each index into an array; of an index that is masked
//! (`t[(i & 7) as usize]`), a remainder or the upper bits of a word the test cannot fail, which spirv-opt
//! does not see. What follows a test may be left out, so that without this no barrier could come after
//! such an index ([`super::uniform`]).

use std::collections::HashMap;

use rspirv::dr::{Instruction, Module, Operand};
use rspirv::spirv::{Op, Word};

use super::edit::replace_each;
use super::{global, id, literal, op};

/// How many operations back a bound is looked for.
const DEPTH: u32 = 8;

/// Replaces `x < n` by `true` where x, of 32 bits without a sign, cannot be `n` or more. Tells whether it
/// has.
pub fn fold(module: &mut Module) -> bool {
    let values = Values::of(module);
    let mut folded = false;
    replace_each(module, |editor, instruction| {
        let (ty, result) = (instruction.result_type?, instruction.result_id?);
        let (left, right) = (id(instruction, 0)?, id(instruction, 1)?);
        let holds = match op(instruction) {
            Op::ULessThan => values.most(left, DEPTH)? < values.constant(right)?,
            Op::ULessThanEqual => values.most(left, DEPTH)? <= values.constant(right)?,
            _ => return None,
        };
        if !holds {
            return None;
        }
        folded = true;
        let operands = vec![Operand::IdRef(editor.truth(ty))];
        Some(vec![Instruction::new(
            Op::CopyObject,
            Some(ty),
            Some(result),
            operands,
        )])
    });
    folded
}

/// Numbers of 32 bits without a sign.
struct Values {
    constants: HashMap<Word, u32>,
    made: HashMap<Word, Instruction>,
}

impl Values {
    fn of(module: &Module) -> Self {
        let is_word = |it: &Instruction| {
            let ty = it.result_type.and_then(|ty| global(module, ty));
            ty.is_some_and(|ty| {
                op(ty) == Op::TypeInt && literal(ty, 0) == Some(32) && literal(ty, 1) == Some(0)
            })
        };
        let constants = module
            .types_global_values
            .iter()
            .filter(|it| op(it) == Op::Constant && is_word(it));
        let made = module
            .functions
            .iter()
            .flat_map(|function| function.all_inst_iter());
        Self {
            constants: constants
                .filter_map(|it| Some((it.result_id?, literal(it, 0)?)))
                .collect(),
            made: made
                .filter(|it| is_word(it))
                .filter_map(|it| Some((it.result_id?, it.clone())))
                .collect(),
        }
    }

    fn constant(&self, word: Word) -> Option<u32> {
        self.constants.get(&word).copied()
    }

    /// The largest value that it may have.
    fn most(&self, word: Word, depth: u32) -> Option<u32> {
        if let Some(value) = self.constant(word) {
            return Some(value);
        }
        let made = self.made.get(&word)?;
        let depth = depth.checked_sub(1)?;
        let operand = |place: usize| id(made, place);
        let most = |place: usize| self.most(operand(place)?, depth);
        match op(made) {
            Op::BitwiseAnd => most(0).into_iter().chain(most(1)).min(),
            Op::UMod => {
                let remainder = self.constant(operand(1)?)?.checked_sub(1)?;
                Some(most(0).map_or(remainder, |most| most.min(remainder)))
            }
            Op::UDiv => {
                let most = most(0).unwrap_or(u32::MAX);
                most.checked_div(self.constant(operand(1)?)?)
            }
            Op::ShiftRightLogical => {
                let most = most(0).unwrap_or(u32::MAX);
                most.checked_shr(self.constant(operand(1)?)?)
            }
            Op::IAdd => most(0)?.checked_add(most(1)?),
            Op::IMul => most(0)?.checked_mul(most(1)?),
            Op::Select => Some(most(1)?.max(most(2)?)),
            Op::CopyObject => most(0),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use rspirv::dr::Builder;
    use rspirv::spirv::FunctionControl;

    use super::*;

    /// Whether `x < limit` is known to hold for the x that `body` makes of a number.
    fn holds(limit: u32, body: impl FnOnce(&mut Builder, Word, Word) -> Word) -> bool {
        let mut b = Builder::new();
        let (word, truth) = (b.type_int(32, 0), b.type_bool());
        let ty = b.type_function(truth, [word]);
        b.begin_function(truth, None, FunctionControl::NONE, ty)
            .unwrap();
        let x = b.function_parameter(word).unwrap();
        b.begin_block(None).unwrap();
        let x = body(&mut b, word, x);
        let limit = b.constant_bit32(word, limit);
        let result = b.u_less_than(truth, None, x, limit).unwrap();
        b.ret_value(result).unwrap();
        b.end_function().unwrap();
        let mut module = b.module();
        let folded = fold(&mut module);
        let left = module.functions[0]
            .all_inst_iter()
            .any(|it| op(it) == Op::ULessThan);
        assert_ne!(folded, left);
        folded
    }

    #[test]
    fn masks_remainders_and_shifts_have_bounds() {
        let mask = |b: &mut Builder, word: Word, x: Word, mask: u32| {
            let mask = b.constant_bit32(word, mask);
            b.bitwise_and(word, None, x, mask).unwrap()
        };
        assert!(holds(8, |b, word, x| mask(b, word, x, 7)));
        assert!(!holds(7, |b, word, x| mask(b, word, x, 7)));
        assert!(!holds(8, |_, _, x| x));
        let by = |op: fn(&mut Builder, Word, Word, Word) -> Word, n: u32| {
            move |b: &mut Builder, word: Word, x: Word| {
                let n = b.constant_bit32(word, n);
                op(b, word, x, n)
            }
        };
        let remainder = |b: &mut Builder, ty, x, n| b.u_mod(ty, None, x, n).unwrap();
        assert!(holds(5, by(remainder, 5)));
        assert!(!holds(4, by(remainder, 5)));
        assert!(!holds(5, by(remainder, 0)));
        let shift = |b: &mut Builder, ty, x, n| b.shift_right_logical(ty, None, x, n).unwrap();
        assert!(holds(16, by(shift, 28)));
        assert!(!holds(16, by(shift, 27)));
        assert!(holds(16, |b, word, x| {
            let masked = mask(b, word, x, 7);
            let seven = b.constant_bit32(word, 8);
            b.i_add(word, None, masked, seven).unwrap()
        }));
        // A sum that may wrap has no bound.
        assert!(!holds(u32::MAX, |b, word, x| {
            let masked = mask(b, word, x, 7);
            let large = b.constant_bit32(word, u32::MAX);
            b.i_add(word, None, masked, large).unwrap()
        }));
    }
}
