//! What a number is extended by when it gets more bits. Rust extends it by the sign of the type that it had: `-1_i32 as u64`
//! is 2^64 - 1, and `0xff_u8 as i32` is 255. rust-gpu 0.10.0 takes the sign of the type that it gets, and so `as` between
//! a signed and an unsigned type of other widths gives another number.

use std::collections::HashMap;

use rspirv::dr::Module;
use rspirv::spirv::{Op, Word};

use super::edit::{Sequence, replace_each};
use super::{id, op};

/// Extends each number by the sign of its own type.
pub fn mend(module: &mut Module) {
    let types: HashMap<Word, Word> = module
        .all_inst_iter()
        .filter_map(|it| Some((it.result_id?, it.result_type?)))
        .collect();
    replace_each(module, |editor, it| {
        let (result, ty) = (it.result_id?, it.result_type?);
        let by_sign = match op(it) {
            Op::SConvert => true,
            Op::UConvert => false,
            _ => return None,
        };
        let value = id(it, 0)?;
        let (from_bits, from_sign) = editor.integer_type(*types.get(&value)?)?;
        let (bits, sign) = editor.integer_type(ty)?;
        if bits <= from_bits || by_sign == from_sign {
            return None;
        }
        let extend = if from_sign {
            Op::SConvert
        } else {
            Op::UConvert
        };
        // Of the same sign first: an unsigned extension has an unsigned result, and not every reader takes a signed one
        // with an unsigned result.
        let between = editor.integer_type_of(bits, from_sign);
        let mut steps = Sequence::new(editor, 0);
        let extended = steps.then(extend, between, &[value]);
        if sign != from_sign {
            steps.then(Op::Bitcast, ty, &[extended]);
        }
        Some(steps.ending_in(result))
    });
}

#[cfg(test)]
mod tests {
    use rspirv::dr::Builder;
    use rspirv::spirv::FunctionControl;

    use super::*;

    /// What becomes of a conversion as rust-gpu writes it, from and to integers of so many bits and a sign.
    fn mended(from: (u32, u32), to: (u32, u32)) -> Vec<Op> {
        let mut b = Builder::new();
        let (from, to_type) = (b.type_int(from.0, from.1), b.type_int(to.0, to.1));
        let void = b.type_void();
        let ty = b.type_function(void, [from]);
        b.begin_function(void, None, FunctionControl::NONE, ty)
            .unwrap();
        let x = b.function_parameter(from).unwrap();
        b.begin_block(None).unwrap();
        if to.1 == 1 {
            b.s_convert(to_type, None, x).unwrap();
        } else {
            b.u_convert(to_type, None, x).unwrap();
        }
        b.ret().unwrap();
        b.end_function().unwrap();
        let mut module = b.module();
        mend(&mut module);
        let block = &module.functions[0].blocks[0];
        let made = block.instructions.iter().map(op);
        made.filter(|it| *it != Op::Return).collect()
    }

    #[test]
    fn numbers_are_extended_by_their_own_sign() {
        const SIGNED: u32 = 1;
        const UNSIGNED: u32 = 0;
        let extended = |from, to| mended((32, from), (64, to));
        assert_eq!(extended(SIGNED, UNSIGNED), [Op::SConvert, Op::Bitcast]);
        assert_eq!(extended(UNSIGNED, SIGNED), [Op::UConvert, Op::Bitcast]);
        assert_eq!(extended(SIGNED, SIGNED), [Op::SConvert]);
        assert_eq!(extended(UNSIGNED, UNSIGNED), [Op::UConvert]);
        // What is cut has no sign.
        assert_eq!(mended((64, SIGNED), (16, UNSIGNED)), [Op::UConvert]);
        assert_eq!(
            mended((8, UNSIGNED), (16, SIGNED)),
            [Op::UConvert, Op::Bitcast]
        );
    }
}
