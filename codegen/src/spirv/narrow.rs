//! Integers of 8 and 16 bits, which few devices compute with, as integers of 32 bits.
//!
//! `core` has them where an author sees none: the tag of an enum, what `<` of tuples returns, `Option<bool>`. A number
//! of 8 or 16 bits is a number of 32 bits with the same value here: extended by its sign if its type has one, else by
//! zeros. A mask, or two shifts, follow each operation whose result may have more bits. In memory that the host sees
//! there is no such number.

use std::collections::{HashMap, HashSet};

use rspirv::dr::{Instruction, Module, Operand};
use rspirv::spirv::{GlslStd450Op as GLOp, Op, StorageClass, Word};

use super::edit::{Editor, Sequence, exchange_types, replace_each};
use super::{id, literal, op};
use crate::error::{Failure, Step};

/// A type of 8 or 16 bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Narrow {
    id: Word,
    bits: u32,
    signed: bool,
}

/// What the module's integers are.
struct Known {
    narrow: HashMap<Word, Narrow>,
    /// Bits and sign of all types of integers.
    integers: HashMap<Word, (u32, bool)>,
    /// Types of booleans.
    booleans: HashSet<Word>,
    /// Types of values.
    types: HashMap<Word, Word>,
}

/// Gives all integers 32 bits or 64.
///
/// # Errors
///
/// One of 8 or 16 bits is in a buffer or a uniform, or in an operation that is not known.
pub fn widen(module: &mut Module, kernel: &str) -> Result<(), Failure> {
    let known = Known::of(module);
    if known.narrow.is_empty() {
        return Ok(());
    }
    known.refuse(module, kernel)?;
    replace_each(module, |editor, it| known.replaced(editor, it));
    exchange(module, &known);
    Ok(())
}

impl Known {
    fn of(module: &Module) -> Self {
        let integers: HashMap<Word, (u32, bool)> = module
            .types_global_values
            .iter()
            .filter(|it| op(it) == Op::TypeInt)
            .filter_map(|it| Some((it.result_id?, (literal(it, 0)?, literal(it, 1)? == 1))))
            .collect();
        let booleans = module.types_global_values.iter();
        let booleans = booleans.filter(|it| op(it) == Op::TypeBool);
        let narrow = integers
            .iter()
            .filter(|(_, (bits, _))| matches!(bits, 8 | 16));
        let narrow = narrow.map(|(&id, &(bits, signed))| (id, Narrow { id, bits, signed }));
        Self {
            narrow: narrow.collect(),
            booleans: booleans.filter_map(|it| it.result_id).collect(),
            types: module
                .all_inst_iter()
                .filter_map(|it| Some((it.result_id?, it.result_type?)))
                .collect(),
            integers,
        }
    }

    /// The type of a value, if it is a narrow one.
    fn of_value(&self, value: Word) -> Option<Narrow> {
        self.narrow.get(self.types.get(&value)?).copied()
    }

    fn of_result(&self, it: &Instruction) -> Option<Narrow> {
        self.narrow.get(&it.result_type?).copied()
    }

    /// Whether an instruction makes or takes narrow numbers.
    fn is_met(&self, it: &Instruction) -> bool {
        self.of_result(it).is_some()
            || it.operands.iter().any(
                |operand| matches!(operand, Operand::IdRef(id) if self.of_value(*id).is_some()),
            )
    }

    fn refuse(&self, module: &Module, kernel: &str) -> Result<(), Failure> {
        let fail = |message: &str| Failure {
            kernel: kernel.into(),
            step: Step::Meaning,
            construct: None,
            message: format!("{message}: write `u32`, and `& 0xff` where the width matters"),
            panicked: false,
        };
        // Types with narrow numbers in them.
        let mut holding: HashSet<Word> = self.narrow.keys().copied().collect();
        for it in &module.types_global_values {
            let Some(made) = it.result_id.filter(|_| it.result_type.is_none()) else {
                continue;
            };
            let holds = it
                .operands
                .iter()
                .any(|operand| matches!(operand, Operand::IdRef(id) if holding.contains(id)));
            match op(it) {
                _ if !holds => {}
                Op::TypeVector => {
                    return Err(fail("a shader has no vectors of 8 or 16 bits"));
                }
                Op::TypePointer => {
                    let class = it.operands.first();
                    let own = [
                        StorageClass::Function,
                        StorageClass::Private,
                        StorageClass::Workgroup,
                    ];
                    if !own
                        .iter()
                        .any(|own| class == Some(&Operand::StorageClass(*own)))
                    {
                        return Err(fail(
                            "memory that the host sees has no numbers of 8 or 16 bits",
                        ));
                    }
                }
                _ => {
                    holding.insert(made);
                }
            }
        }
        let is_cast_whole = |it: &Instruction| {
            let from = id(it, 0).and_then(|from| self.types.get(&from));
            let types = [from, it.result_type.as_ref()].into_iter().flatten();
            let mut held = types.filter(|ty| holding.contains(ty));
            op(it) == Op::Bitcast && held.any(|ty| !self.narrow.contains_key(ty))
        };
        for function in &module.functions {
            for block in &function.blocks {
                for it in &block.instructions {
                    if is_cast_whole(it) {
                        return Err(Failure {
                            message: "a shader cannot cast a number to an array of bytes, or back, as `to_le_bytes` \
                                      does: write shifts and masks, `(x >> 8) as u8`"
                                .into(),
                            ..fail("")
                        });
                    }
                    if self.is_met(it) && !self.is_known(it) {
                        return Err(fail(&format!("{:?} of a number of 8 or 16 bits", op(it))));
                    }
                }
            }
        }
        Ok(())
    }

    fn is_known(&self, it: &Instruction) -> bool {
        match op(it) {
            // rust-gpu makes a byte of a boolean like this. Of a vector or an array, the bits would be others.
            Op::Bitcast => {
                let from = id(it, 0).and_then(|from| self.types.get(&from).copied());
                [from, it.result_type].iter().all(|ty| {
                    ty.is_some_and(|ty| {
                        self.narrow.contains_key(&ty) || self.booleans.contains(&ty)
                    })
                })
            }
            Op::ExtInst => function(it).is_some(),
            op => stays(op) || reading(op).is_some() || makes(op),
        }
    }

    fn replaced(&self, editor: &mut Editor<'_>, it: &Instruction) -> Option<Vec<Instruction>> {
        if !self.is_met(it) || stays(op(it)) {
            return None;
        }
        let result = it.result_id?;
        let result_type = it.result_type?;
        let made = self.of_result(it);
        let word = editor.word_type();
        // What cuts a number, by its type and a sign: a mask, or the amount of two shifts.
        let met = it.operands.iter().filter_map(|operand| match operand {
            Operand::IdRef(id) => self.of_value(*id),
            _ => None,
        });
        let cuts: HashMap<(Word, bool), Word> = met
            .chain(made)
            .flat_map(|ty| [(ty, false), (ty, true)])
            .map(|(ty, signed)| {
                let number = if signed {
                    32 - ty.bits
                } else {
                    u32::MAX >> (32 - ty.bits)
                };
                ((ty.id, signed), editor.integer(ty.id, number))
            })
            .collect();
        // What a boolean is as a number.
        let byte = made.or_else(|| self.of_value(id(it, 0)?));
        let of_boolean = byte
            .filter(|_| op(it) == Op::Bitcast)
            .map(|ty| [0, 1].map(|number| editor.integer(ty.id, number)));
        let set = editor.functions_set().unwrap_or_default();
        let mut steps = Sequence::new(editor, set);
        // The value of a number with this sign, whichever its type has.
        let cut = |steps: &mut Sequence<'_, '_>, ty: Narrow, value: Word, signed: bool| {
            let by = cuts[&(ty.id, signed)];
            if signed {
                let high = steps.then(Op::ShiftLeftLogical, ty.id, &[value, by]);
                steps.then(Op::ShiftRightArithmetic, ty.id, &[high, by])
            } else {
                steps.then(Op::BitwiseAnd, ty.id, &[value, by])
            }
        };
        let first = usize::from(op(it) == Op::ExtInst) * 2;
        let signs = match op(it) {
            Op::ExtInst => function(it).map(|(_, sign)| [sign; 2]),
            op => reading(op),
        };
        let mut operands = Vec::new();
        for (place, operand) in it.operands.iter().enumerate().skip(first) {
            let Operand::IdRef(value) = *operand else {
                return None;
            };
            let sign = signs.and_then(|signs| signs[place.min(1)]);
            operands.push(match (self.of_value(value), sign) {
                (Some(ty), Some(signed)) if ty.signed != signed => {
                    cut(&mut steps, ty, value, signed)
                }
                _ => value,
            });
        }
        // Bits and sign of what is converted: it has them still where it was cut.
        let given = id(it, 0).and_then(|given| self.types.get(&given));
        let given = given.and_then(|ty| self.integers.get(ty).copied());
        let value = *operands.first()?;
        let is_boolean = |value: Word| {
            self.types
                .get(&value)
                .is_some_and(|ty| self.booleans.contains(ty))
        };
        match (op(it), made) {
            (Op::Bitcast, Some(ty)) if is_boolean(value) => {
                let [no, yes] = of_boolean?;
                steps.then(Op::Select, ty.id, &[value, yes, no]);
            }
            (Op::Bitcast, None) => {
                let [no, _] = of_boolean?;
                steps.then(Op::INotEqual, result_type, &[value, no]);
            }
            (Op::UConvert | Op::SConvert | Op::Bitcast, Some(ty)) => {
                let (value, signed) = match given {
                    Some((64, _)) => (steps.then(Op::UConvert, word, &[value]), false),
                    other => (value, other.is_some_and(|(_, signed)| signed)),
                };
                // naga takes the type of a shift from its operand.
                let value = match signed == ty.signed {
                    true => value,
                    false => steps.then(Op::Bitcast, ty.id, &[value]),
                };
                cut(&mut steps, ty, value, ty.signed);
            }
            (Op::UConvert | Op::SConvert, None) => {
                let to = self.integers.get(&result_type)?;
                let from = id(it, 0).and_then(|from| self.of_value(from))?;
                let how = match to.0 {
                    64 => op(it),
                    _ if to.1 == from.signed => Op::CopyObject,
                    _ => Op::Bitcast,
                };
                steps.then(how, result_type, &[value]);
            }
            (Op::BitReverse, Some(ty)) => {
                let all = steps.then(Op::BitReverse, ty.id, &[value]);
                let low = steps.then(Op::ShiftRightLogical, ty.id, &[all, cuts[&(ty.id, true)]]);
                cut(&mut steps, ty, low, ty.signed);
            }
            (Op::ExtInst, _) => {
                let (function, _) = function(it)?;
                let value = steps.call(function, result_type, &operands);
                if let Some(ty) = made {
                    cut(&mut steps, ty, value, ty.signed);
                }
            }
            (op, _) => {
                let value = steps.then(op, result_type, &operands);
                if let Some(ty) = made {
                    cut(&mut steps, ty, value, ty.signed);
                }
            }
        }
        Some(steps.ending_in(result))
    }
}

/// What only moves numbers.
fn stays(op: Op) -> bool {
    matches!(
        op,
        Op::Load
            | Op::Store
            | Op::Select
            | Op::Phi
            | Op::CompositeExtract
            | Op::CompositeConstruct
            | Op::CompositeInsert
            | Op::CopyObject
            | Op::FunctionCall
            | Op::ReturnValue
            | Op::Undef
            | Op::Variable
            | Op::Switch
    )
}

/// With which sign an operation reads its first operand and the others: `None`, only the low bits count.
fn reading(op: Op) -> Option<[Option<bool>; 2]> {
    const LOW: Option<bool> = None;
    const UNSIGNED: Option<bool> = Some(false);
    const SIGNED: Option<bool> = Some(true);
    Some(match op {
        Op::IAdd
        | Op::ISub
        | Op::IMul
        | Op::SNegate
        | Op::Not
        | Op::BitwiseAnd
        | Op::BitwiseOr
        | Op::BitwiseXor => [LOW; 2],
        Op::ShiftLeftLogical => [LOW, UNSIGNED],
        Op::ShiftRightLogical
        | Op::UDiv
        | Op::UMod
        | Op::UConvert
        | Op::ConvertUToF
        | Op::BitCount
        | Op::IEqual
        | Op::INotEqual
        | Op::ULessThan
        | Op::ULessThanEqual
        | Op::UGreaterThan
        | Op::UGreaterThanEqual => [UNSIGNED; 2],
        Op::ShiftRightArithmetic => [SIGNED, UNSIGNED],
        Op::SDiv
        | Op::SRem
        | Op::SMod
        | Op::SConvert
        | Op::ConvertSToF
        | Op::SLessThan
        | Op::SLessThanEqual
        | Op::SGreaterThan
        | Op::SGreaterThanEqual => [SIGNED; 2],
        _ => return None,
    })
}

/// What makes numbers of something else, or of their low bits.
fn makes(op: Op) -> bool {
    matches!(op, Op::ConvertFToU | Op::ConvertFToS | Op::BitReverse)
}

/// One of GLSL's functions, and the sign that it reads numbers with.
fn function(it: &Instruction) -> Option<(GLOp, Option<bool>)> {
    let Some(Operand::LiteralExtInstInteger(number)) = it.operands.get(1) else {
        return None;
    };
    let function = GLOp::from_u32(*number)?;
    let signed = match function {
        GLOp::UMin | GLOp::UMax | GLOp::UClamp => false,
        GLOp::SMin | GLOp::SMax | GLOp::SClamp | GLOp::SAbs | GLOp::SSign => true,
        _ => return None,
    };
    Some((function, Some(signed)))
}

/// Puts types of 32 bits in the place of narrow ones, and one type in the place of several that are then the same.
fn exchange(module: &mut Module, known: &Known) {
    let mut same: HashMap<Word, Word> = HashMap::new();
    for signed in [false, true] {
        let ids: Vec<Word> = known
            .narrow
            .values()
            .filter(|it| it.signed == signed)
            .map(|it| it.id)
            .collect();
        if ids.is_empty() {
            continue;
        }
        let operands = vec![
            Operand::LiteralBit32(32),
            Operand::LiteralBit32(signed.into()),
        ];
        // It may stand after types that hold the narrow one.
        let there = module
            .types_global_values
            .iter()
            .position(|it| op(it) == Op::TypeInt && it.operands == operands);
        let wide = match there {
            Some(place) => module.types_global_values.remove(place),
            None => {
                let new = Editor::new(module).new_id();
                Instruction::new(Op::TypeInt, None, Some(new), operands)
            }
        };
        same.extend(ids.iter().filter_map(|id| Some((*id, wide.result_id?))));
        module.types_global_values.insert(0, wide);
    }
    exchange_types(module, same);
}

#[cfg(test)]
mod tests {
    use rspirv::dr::Builder;
    use rspirv::spirv::FunctionControl;

    use super::*;

    /// A byte that is read from memory of a class and added to itself.
    fn module(class: StorageClass) -> Module {
        let mut b = Builder::new();
        let byte = b.type_int(8, 0);
        let pointer = b.type_pointer(None, class, byte);
        let ty = b.type_function(byte, [pointer]);
        b.begin_function(byte, None, FunctionControl::NONE, ty)
            .unwrap();
        let place = b.function_parameter(pointer).unwrap();
        b.begin_block(None).unwrap();
        let value = b.load(byte, None, place, None, []).unwrap();
        let sum = b.i_add(byte, None, value, value).unwrap();
        b.ret_value(sum).unwrap();
        b.end_function().unwrap();
        b.module()
    }

    #[test]
    fn a_sum_is_cut_to_its_bits() {
        let mut module = module(StorageClass::Function);
        widen(&mut module, "k").unwrap();
        let ops: Vec<Op> = module.functions[0].blocks[0]
            .instructions
            .iter()
            .map(op)
            .collect();
        assert_eq!(ops, [Op::Load, Op::IAdd, Op::BitwiseAnd, Op::ReturnValue]);
        let widths = module
            .types_global_values
            .iter()
            .filter(|it| op(it) == Op::TypeInt);
        let widths: Vec<_> = widths.map(|it| literal(it, 0)).collect();
        assert_eq!(widths, [Some(32)]);
    }

    #[test]
    fn a_number_is_not_cast_to_an_array_of_bytes() {
        let mut b = Builder::new();
        let [byte, word] = [8, 32].map(|bits| b.type_int(bits, 0));
        let four = b.constant_bit32(word, 4);
        let bytes = b.type_array(byte, four);
        let ty = b.type_function(bytes, [word]);
        b.begin_function(bytes, None, FunctionControl::NONE, ty)
            .unwrap();
        let number = b.function_parameter(word).unwrap();
        b.begin_block(None).unwrap();
        let cast = b.bitcast(bytes, None, number).unwrap();
        b.ret_value(cast).unwrap();
        b.end_function().unwrap();
        let failure = widen(&mut b.module(), "k").unwrap_err();
        assert!(failure.message.contains("`to_le_bytes`"), "{failure}");
    }

    #[test]
    fn the_hosts_memory_keeps_its_width() {
        let failure = widen(&mut module(StorageClass::StorageBuffer), "k").unwrap_err();
        assert!(
            failure.message.contains("memory that the host sees"),
            "{failure}"
        );
    }
}
