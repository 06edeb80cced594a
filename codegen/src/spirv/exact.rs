//! Keeps floating-point arithmetic as it was written.
//!
//! spirv-opt rewrites `a * b + c` as `fma`, merges `(x / 2) * 3` into one operation, and turns
//! `x - x` into zero: each rounds otherwise than the source. It leaves operations alone that are
//! decorated `NoContraction`. So arithmetic is decorated while it runs, and the decoration is taken
//! away afterwards: the driver is as free as it would be with text written by hand. A kernel whose
//! result depends on it (`exact`) keeps it, on arithmetic: [`keep`].
//!
//! That also keeps it from what *is* exact. [`fold`] does it instead: arithmetic on constants
//! (correctly rounded here as on the native side) and operations that return an operand.
//!
//! Functions are not held: spirv-opt evaluates some where all arguments are constants and leaves
//! them alone elsewhere; [`fold`] evaluates those that it does not know and that round at most once. Held, they make its constant propagation abort
//! (`tests/upstream/spirv-opt-pinned-function`).

use std::collections::HashMap;

use rspirv::dr::{Instruction, Module, Operand};
use rspirv::spirv::{Decoration, GlslStd450Op as GLOp, Op, Word};

use super::edit::{called, functions_set};
use super::{id, op};

/// Arithmetic, to which alone `NoContraction` means something.
pub(super) fn arithmetic(op: Op) -> bool {
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

/// Decorates what a driver may not contract or reorder, and nothing else.
pub fn keep(module: &mut Module) {
    unpin(module);
    pin(module);
}

/// Decorates arithmetic.
pub fn pin(module: &mut Module) {
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
        .filter(|instruction| arithmetic(op(instruction)))
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

    fn negated(self) -> Self {
        match self {
            Self::Single(value) => Self::Single(-value),
            Self::Double(value) => Self::Double(-value),
        }
    }

    fn is(self, wanted: f64) -> bool {
        match self {
            Self::Single(value) => f64::from(value) == wanted,
            Self::Double(value) => value == wanted,
        }
    }

    /// A function of one argument whose result is exact or correctly rounded, on every device and natively.
    fn unary(function: GLOp, x: Self) -> Option<Self> {
        macro_rules! evaluated {
            ($x:expr) => {
                match function {
                    GLOp::FAbs => $x.abs(),
                    GLOp::Floor => $x.floor(),
                    GLOp::Ceil => $x.ceil(),
                    GLOp::Trunc => $x.trunc(),
                    GLOp::RoundEven => $x.round_ties_even(),
                    _ => return None,
                }
            };
        }
        Some(match x {
            Self::Single(x) => Self::Single(evaluated!(x)),
            Self::Double(x) => Self::Double(evaluated!(x)),
        })
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

/// Evaluates scalar arithmetic, absolute values and whole parts of constants, removes `x * 1`, `x / 1`, `x + 0`, `x - 0`, `x * 0` and
/// `--x`, and takes the sign of a negated operand into a sum, a difference or a factor that is
/// constant. Tells whether it has removed anything.
///
/// The same number for every finite x; a constant that is not finite is left for the device to
/// compute. Infinities and the sign of a zero may get lost, which Vulkan does not promise to keep
/// either.
pub fn fold(module: &mut Module) -> bool {
    let mut folder = Folder::new(module);
    for block in module.functions.iter_mut().flat_map(|f| &mut f.blocks) {
        block.instructions.retain_mut(|instruction| {
            folder.resolve_operands(instruction);
            folder.absorb_negation(instruction);
            !folder.replace(instruction)
        });
    }
    // Loops: a phi may name a result that was replaced further down.
    for instruction in module
        .functions
        .iter_mut()
        .flat_map(|function| function.all_inst_iter_mut())
    {
        folder.resolve_operands(instruction);
    }
    let gone = folder.replaced;
    let has_folded = !gone.is_empty();
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
    has_folded
}

struct Folder {
    types: HashMap<Word, Type>,
    values: HashMap<Word, Float>,
    /// (type, bits) to the constant's id.
    known: HashMap<(Word, u64), Word>,
    /// The set of GLSL's functions.
    functions: Option<Word>,
    replaced: HashMap<Word, Word>,
    /// Negated numbers, and of what.
    negated: HashMap<Word, Word>,
    made: Vec<Instruction>,
    next: Word,
}

impl Folder {
    fn new(module: &Module) -> Self {
        let mut folder = Self {
            types: HashMap::new(),
            values: HashMap::new(),
            known: HashMap::new(),
            functions: functions_set(module),
            replaced: HashMap::new(),
            negated: HashMap::new(),
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

    fn resolve_operands(&self, instruction: &mut Instruction) {
        for operand in &mut instruction.operands {
            if let Operand::IdRef(id) = operand {
                *id = self.resolve(*id);
            }
        }
    }

    /// Takes the sign of a negated operand into the operation or into its other operand.
    fn absorb_negation(&mut self, instruction: &mut Instruction) {
        let (Some(ty), Some(result)) = (instruction.result_type, instruction.result_id) else {
            return;
        };
        let (Some(a), b) = (id(instruction, 0), id(instruction, 1)) else {
            return;
        };
        let negated = |id: Option<Word>| self.negated.get(&id?).copied();
        let constant = |id: Option<Word>| self.values.get(&id?).copied();
        let (operation, left, right) = match (op(instruction), negated(Some(a)), negated(b), b) {
            (Op::FNegate, ..) => {
                self.negated.insert(result, a);
                return;
            }
            (Op::FAdd, _, Some(y), _) => (Op::FSub, a, y),
            (Op::FAdd, Some(x), _, Some(b)) => (Op::FSub, b, x),
            (Op::FSub, _, Some(y), _) => (Op::FAdd, a, y),
            (Op::FMul, Some(x), _, _) => match constant(b) {
                Some(c) => (Op::FMul, x, self.constant(ty, c.negated())),
                None => return,
            },
            (Op::FMul, _, Some(y), _) => match constant(Some(a)) {
                Some(c) => (Op::FMul, y, self.constant(ty, c.negated())),
                None => return,
            },
            _ => return,
        };
        *instruction = Instruction::new(
            operation,
            Some(ty),
            Some(result),
            vec![Operand::IdRef(left), Operand::IdRef(right)],
        );
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
            Op::FNegate => match constant(a) {
                Some(value) => value.negated(),
                None => return self.negated.get(&a?).copied(),
            },
            Op::ExtInst => {
                let function = called(instruction, self.functions?)?;
                Float::unary(function, constant(id(instruction, 2))?)?
            }
            which @ (Op::FAdd | Op::FSub | Op::FMul | Op::FDiv) => {
                match (which, constant(a), constant(b)) {
                    (_, Some(x), Some(y)) => Float::binary(which, x, y)?,
                    (Op::FMul, Some(x), _) if x.is(1.0) => return b,
                    (Op::FMul | Op::FDiv, _, Some(y)) if y.is(1.0) => return a,
                    (Op::FAdd, Some(x), _) if x.is(0.0) => return b,
                    (Op::FAdd | Op::FSub, _, Some(y)) if y.is(0.0) => return a,
                    (Op::FMul, Some(x), _) if x.is(0.0) => return a,
                    (Op::FMul, _, Some(y)) if y.is(0.0) => return b,
                    _ => return None,
                }
            }
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

#[cfg(test)]
mod tests {
    use rspirv::dr::Builder;

    use super::*;

    /// What is left of a function of x that `body` writes, operation by operation, with the
    /// constants that it uses.
    fn left(body: impl FnOnce(&mut Builder, Word, Word) -> Word) -> Vec<String> {
        let mut b = Builder::new();
        let float = b.type_float(32, None);
        let ty = b.type_function(float, [float]);
        b.begin_function(float, None, rspirv::spirv::FunctionControl::NONE, ty)
            .unwrap();
        let x = b.function_parameter(float).unwrap();
        b.begin_block(None).unwrap();
        let result = body(&mut b, float, x);
        b.ret_value(result).unwrap();
        b.end_function().unwrap();
        let mut module = b.module();
        pin(&mut module);
        let count = |module: &Module| module.functions[0].blocks[0].instructions.len();
        let before = count(&module);
        assert_eq!(fold(&mut module), count(&module) < before);
        let value = |id: Word| {
            let constant = module
                .types_global_values
                .iter()
                .find(|c| c.result_id == Some(id));
            match constant.map(|c| &c.operands[0]) {
                Some(Operand::LiteralBit32(bits)) => format!("{:?}", f32::from_bits(*bits)),
                _ if id == x => "x".into(),
                _ => "r".into(),
            }
        };
        module.functions[0].blocks[0]
            .instructions
            .iter()
            .map(|i| {
                let operands: Vec<String> = i
                    .operands
                    .iter()
                    .filter_map(Operand::id_ref_any)
                    .map(value)
                    .collect();
                format!("{:?} {}", i.class.opcode, operands.join(" "))
            })
            .collect()
    }

    fn number(b: &mut Builder, float: Word, value: f32) -> Word {
        b.constant_bit32(float, value.to_bits())
    }

    #[test]
    fn functions_of_constants_are_evaluated() {
        let found = left(|b, float, x| {
            let set = b.ext_inst_import("GLSL.std.450");
            let mut result = x;
            for (function, argument) in [
                (GLOp::FAbs, -1.5),
                (GLOp::Floor, -1.5),
                (GLOp::Ceil, 1.25),
                (GLOp::Trunc, -2.75),
                (GLOp::RoundEven, 2.5),
            ] {
                let argument = number(b, float, argument);
                let call = |b: &mut Builder, argument| {
                    let operands = [Operand::IdRef(argument)];
                    b.ext_inst(float, None, set, function as u32, operands)
                        .unwrap()
                };
                let constant = call(b, argument);
                result = b.f_mul(float, None, result, constant).unwrap();
            }
            let argument = [Operand::IdRef(result)];
            b.ext_inst(float, None, set, GLOp::FAbs as u32, argument)
                .unwrap()
        });
        assert_eq!(
            found,
            [
                "FMul x 1.5",
                "FMul r -2.0",
                "FMul r 2.0",
                "FMul r -2.0",
                "FMul r 2.0",
                "ExtInst r r",
                "ReturnValue r"
            ]
        );
    }

    #[test]
    fn a_chain_of_constants_is_one() {
        let found = left(|b, float, x| {
            let mut c = number(b, float, 1.0);
            for _ in 0..10 {
                c = b.f_add(float, None, c, c).unwrap();
            }
            b.f_mul(float, None, x, c).unwrap()
        });
        assert_eq!(found, ["FMul x 1024.0", "ReturnValue r"]);
    }

    /// `x * 0.1 * 0.7` and `x + 0.1 - 0.7` round twice.
    #[test]
    fn constants_in_a_row_stay_two() {
        let found = left(|b, float, x| {
            let (c, d) = (number(b, float, 0.1), number(b, float, 0.7));
            let y = b.f_mul(float, None, x, c).unwrap();
            let y = b.f_mul(float, None, y, d).unwrap();
            let y = b.f_add(float, None, y, c).unwrap();
            b.f_sub(float, None, y, d).unwrap()
        });
        assert_eq!(
            found,
            [
                "FMul x 0.1",
                "FMul r 0.7",
                "FAdd r 0.1",
                "FSub r 0.7",
                "ReturnValue r"
            ]
        );
    }

    #[test]
    fn neutral_operands_go() {
        for (which, value, is_left) in [
            (Op::FMul, 1.0, true),
            (Op::FMul, 1.0, false),
            (Op::FDiv, 1.0, false),
            (Op::FAdd, 0.0, true),
            (Op::FAdd, -0.0, false),
            (Op::FSub, 0.0, false),
        ] {
            let found = left(|b, float, x| {
                let c = number(b, float, value);
                let (l, r) = if is_left { (c, x) } else { (x, c) };
                match which {
                    Op::FMul => b.f_mul(float, None, l, r),
                    Op::FDiv => b.f_div(float, None, l, r),
                    Op::FAdd => b.f_add(float, None, l, r),
                    _ => b.f_sub(float, None, l, r),
                }
                .unwrap()
            });
            assert_eq!(found, ["ReturnValue x"], "{which:?} {value} {is_left}");
        }
        let zero = left(|b, float, x| {
            let c = number(b, float, 0.0);
            b.f_mul(float, None, x, c).unwrap()
        });
        assert_eq!(zero, ["ReturnValue 0.0"]);
        // 0 / x is not a number for x = 0, and 0 - x and 1 / x are operations.
        for which in [Op::FDiv, Op::FSub] {
            let found = left(|b, float, x| {
                let c = number(b, float, 0.0);
                match which {
                    Op::FDiv => b.f_div(float, None, c, x),
                    _ => b.f_sub(float, None, c, x),
                }
                .unwrap()
            });
            assert_eq!(found, [&format!("{which:?} 0.0 x"), "ReturnValue r"]);
        }
    }

    /// A result that is not finite is the device's to compute.
    #[test]
    fn overflow_stays() {
        let found = left(|b, float, _| {
            let c = number(b, float, 1e38);
            b.f_mul(float, None, c, c).unwrap()
        });
        assert_eq!(found, ["FMul 1e38 1e38", "ReturnValue r"]);
    }

    #[test]
    fn signs_are_absorbed() {
        let found = left(|b, float, x| {
            let y = b.f_mul(float, None, x, x).unwrap();
            let minus = b.f_negate(float, None, x).unwrap();
            let first = b.f_add(float, None, y, minus).unwrap();
            let second = b.f_add(float, None, minus, first).unwrap();
            let third = b.f_sub(float, None, second, minus).unwrap();
            let half = number(b, float, 0.5);
            let fourth = b.f_mul(float, None, minus, half).unwrap();
            let fifth = b.f_mul(float, None, third, fourth).unwrap();
            let plus = b.f_negate(float, None, minus).unwrap();
            b.f_mul(float, None, fifth, plus).unwrap()
        });
        assert_eq!(
            found,
            [
                "FMul x x",
                "FNegate x",
                "FSub r x",
                "FSub r x",
                "FAdd r x",
                "FMul x -0.5",
                "FMul r r",
                "FMul r x",
                "ReturnValue r"
            ]
        );
    }
}
