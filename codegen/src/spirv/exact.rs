//! Keeps floating-point arithmetic as it was written.
//!
//! spirv-opt rewrites `a * b + c` as `fma`, merges `(x / 2) * 3` into one operation, and turns
//! `x - x` into zero: each rounds otherwise than the source. It leaves operations alone that are
//! decorated `NoContraction`. So all are decorated while it runs, and the decoration is taken
//! away afterwards: the driver is as free as it would be with text written by hand. A kernel whose
//! result depends on it (`exact`) keeps it, on arithmetic: [`keep`].
//!
//! That also keeps it from what *is* exact. [`fold`] does it instead: arithmetic on constants
//! (correctly rounded here as on the native side) and operations that return their operand.

use std::collections::HashMap;

use rspirv::dr::{Instruction, Module, Operand};
use rspirv::spirv::{Decoration, Op, Word};

use super::{id, op};

/// Operations that spirv-opt must leave alone.
fn contracts(op: Op) -> bool {
    arithmetic(op) || op == Op::ExtInst
}

/// Arithmetic, to which alone `NoContraction` means something.
fn arithmetic(op: Op) -> bool {
    matches!(
        op,
        Op::FAdd
            | Op::FSub
            | Op::FMul
            | Op::FDiv
            | Op::FRem
            | Op::FMod
            | Op::FNegate
            | Op::VectorTimesScalar
            | Op::MatrixTimesScalar
            | Op::VectorTimesMatrix
            | Op::MatrixTimesVector
            | Op::MatrixTimesMatrix
            | Op::OuterProduct
            | Op::Dot
    )
}

/// Decorates every floating-point operation.
pub fn pin(module: &mut Module) {
    decorate(module, contracts);
}

/// Decorates what a driver may not contract or reorder, and nothing else.
pub fn keep(module: &mut Module) {
    unpin(module);
    decorate(module, arithmetic);
}

fn decorate(module: &mut Module, which: fn(Op) -> bool) {
    let decorated: std::collections::HashSet<Word> = module
        .annotations
        .iter()
        .filter(|note| is_pin(note))
        .filter_map(|note| id(note, 0))
        .collect();
    let results: Vec<Word> = module
        .functions
        .iter()
        .flat_map(|function| function.all_inst_iter())
        .filter(|instruction| which(op(instruction)))
        .filter_map(|instruction| instruction.result_id)
        .filter(|result| !decorated.contains(result))
        .collect();
    module.annotations.extend(results.into_iter().map(|result| {
        let operands = vec![
            Operand::IdRef(result),
            Operand::Decoration(Decoration::NoContraction),
        ];
        Instruction::new(Op::Decorate, None, None, operands)
    }));
}

/// Takes the decorations away again.
pub fn unpin(module: &mut Module) {
    module.annotations.retain(|note| !is_pin(note));
}

fn is_pin(note: &Instruction) -> bool {
    op(note) == Op::Decorate
        && note.operands.get(1) == Some(&Operand::Decoration(Decoration::NoContraction))
}

/// A floating-point constant, in the precision that it has.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Float {
    Single(f32),
    Double(f64),
}

impl Float {
    fn of(ty: &Type, bits: u64) -> Option<Self> {
        match ty {
            Type::Single => Some(Self::Single(f32::from_bits(bits as u32))),
            Type::Double => Some(Self::Double(f64::from_bits(bits))),
            Type::Other => None,
        }
    }

    fn operand(self) -> Operand {
        match self {
            Self::Single(value) => Operand::LiteralBit32(value.to_bits()),
            Self::Double(value) => Operand::LiteralBit64(value.to_bits()),
        }
    }

    fn bits(self) -> u64 {
        match self {
            Self::Single(value) => value.to_bits().into(),
            Self::Double(value) => value.to_bits(),
        }
    }

    fn finite(self) -> bool {
        match self {
            Self::Single(value) => value.is_finite(),
            Self::Double(value) => value.is_finite(),
        }
    }

    fn is(self, wanted: f64) -> bool {
        let value = match self {
            Self::Single(value) => f64::from(value),
            Self::Double(value) => value,
        };
        // Not `==`: minus zero is not zero here.
        value.to_bits() == wanted.to_bits()
    }

    fn binary(op: Op, a: Self, b: Self) -> Option<Self> {
        match (a, b) {
            (Self::Single(a), Self::Single(b)) => computed(op, a, b).map(Self::Single),
            (Self::Double(a), Self::Double(b)) => computed(op, a, b).map(Self::Double),
            _ => None,
        }
    }
}

fn computed<T>(op: Op, a: T, b: T) -> Option<T>
where
    T: std::ops::Add<Output = T>
        + std::ops::Sub<Output = T>
        + std::ops::Mul<Output = T>
        + std::ops::Div<Output = T>,
{
    Some(match op {
        Op::FAdd => a + b,
        Op::FSub => a - b,
        Op::FMul => a * b,
        Op::FDiv => a / b,
        _ => return None,
    })
}

enum Type {
    Single,
    Double,
    Other,
}

/// Evaluates scalar arithmetic on constants, and removes `x * 1`, `x / 1`, `x - 0`.
///
/// Exact: a result that is not finite is left for the device to compute.
pub fn fold(module: &mut Module) {
    let mut folder = Folder::new(module);
    for f in 0..module.functions.len() {
        for b in 0..module.functions[f].blocks.len() {
            let block = &mut module.functions[f].blocks[b];
            for instruction in &mut block.instructions {
                for operand in &mut instruction.operands {
                    if let Operand::IdRef(id) = operand {
                        *id = folder.resolve(*id);
                    }
                }
            }
            block
                .instructions
                .retain(|instruction| !folder.replace(instruction));
        }
    }
    // Loops: a phi may name a result that was replaced further down.
    for instruction in module
        .functions
        .iter_mut()
        .flat_map(|function| function.all_inst_iter_mut())
    {
        for operand in &mut instruction.operands {
            if let Operand::IdRef(id) = operand {
                *id = folder.resolve(*id);
            }
        }
    }
    let gone = folder.replaced;
    module
        .annotations
        .retain(|note| id(note, 0).is_none_or(|target| !gone.contains_key(&target)));
    module
        .debug_names
        .retain(|name| id(name, 0).is_none_or(|target| !gone.contains_key(&target)));
    module.types_global_values.extend(folder.made);
    if let Some(header) = &mut module.header {
        header.bound = folder.next;
    }
}

struct Folder {
    types: HashMap<Word, Type>,
    values: HashMap<Word, Float>,
    /// (type, bits) to the constant's id.
    known: HashMap<(Word, u64), Word>,
    replaced: HashMap<Word, Word>,
    made: Vec<Instruction>,
    next: Word,
}

impl Folder {
    fn new(module: &Module) -> Self {
        let mut folder = Self {
            types: HashMap::new(),
            values: HashMap::new(),
            known: HashMap::new(),
            replaced: HashMap::new(),
            made: Vec::new(),
            next: module.header.as_ref().map_or(0, |header| header.bound),
        };
        for instruction in &module.types_global_values {
            let Some(result) = instruction.result_id else {
                continue;
            };
            match (op(instruction), instruction.operands.first()) {
                (Op::TypeFloat, Some(Operand::LiteralBit32(width))) => {
                    let ty = match width {
                        32 => Type::Single,
                        64 => Type::Double,
                        _ => Type::Other,
                    };
                    folder.types.insert(result, ty);
                }
                (Op::Constant, Some(operand)) => {
                    let Some(ty) = instruction.result_type else {
                        continue;
                    };
                    let bits = match operand {
                        Operand::LiteralBit32(bits) => u64::from(*bits),
                        Operand::LiteralBit64(bits) => *bits,
                        _ => continue,
                    };
                    folder.known.insert((ty, bits), result);
                    let value = folder.types.get(&ty).and_then(|ty| Float::of(ty, bits));
                    folder.values.extend(value.map(|value| (result, value)));
                }
                _ => {}
            }
        }
        folder
    }

    fn resolve(&self, mut id: Word) -> Word {
        while let Some(&other) = self.replaced.get(&id) {
            id = other;
        }
        id
    }

    /// Replaces the instruction's result, if it can be; it is then not needed.
    fn replace(&mut self, instruction: &Instruction) -> bool {
        let (Some(ty), Some(result)) = (instruction.result_type, instruction.result_id) else {
            return false;
        };
        let Some(by) = self.value(instruction, ty) else {
            return false;
        };
        self.replaced.insert(result, by);
        true
    }

    fn value(&mut self, instruction: &Instruction, ty: Word) -> Option<Word> {
        let a = id(instruction, 0);
        let b = id(instruction, 1);
        let constant = |id: Option<Word>| self.values.get(&id?).copied();
        let value = match op(instruction) {
            Op::FConvert => match (self.types.get(&ty)?, constant(a)?) {
                (Type::Single, Float::Double(value)) => Float::Single(value as f32),
                (Type::Double, Float::Single(value)) => Float::Double(value.into()),
                _ => return None,
            },
            Op::FNegate => match constant(a)? {
                Float::Single(value) => Float::Single(-value),
                Float::Double(value) => Float::Double(-value),
            },
            which @ (Op::FAdd | Op::FSub | Op::FMul | Op::FDiv) => match (constant(a), constant(b))
            {
                (Some(a), Some(b)) => Float::binary(which, a, b)?,
                (Some(one), None) if which == Op::FMul && one.is(1.0) => return b,
                (None, Some(one)) if matches!(which, Op::FMul | Op::FDiv) && one.is(1.0) => {
                    return a;
                }
                (None, Some(zero)) if which == Op::FSub && zero.is(0.0) => return a,
                _ => return None,
            },
            _ => return None,
        };
        value.finite().then(|| self.constant(ty, value))
    }

    fn constant(&mut self, ty: Word, value: Float) -> Word {
        *self.known.entry((ty, value.bits())).or_insert_with(|| {
            let id = self.next;
            self.next += 1;
            self.values.insert(id, value);
            self.made.push(Instruction::new(
                Op::Constant,
                Some(ty),
                Some(id),
                vec![value.operand()],
            ));
            id
        })
    }
}
