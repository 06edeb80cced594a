//! What a module costs, counted in its instructions.
//!
//! The figures are those of the SPIR-V as it is handed to a driver, so they compare kernels and
//! listings with each other, not with a processor's cycles:
//!
//! - *arithmetic*: instructions that compute a value: float and integer arithmetic, bit
//!   operations, conversions, comparisons, logic, `select`, and extended instructions. What only
//!   moves values (composites, shuffles, loads, phis, bit casts, constants) is not counted.
//! - *operations*: the same for each component of the result, and two for a fused
//!   multiply-add: what a scalar machine would do.
//! - *branches*: conditional branches and switches. A map kernel's guard is one branch and one
//!   comparison for each dimension.
//! - *registers*: the most 32-bit values that are alive at one place.

use rspirv::dr::{Instruction, Module};
use rspirv::spirv::{Op, Word};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::Failure;
use crate::registers;
use crate::spirv::{self, global, literal, op};

/// Counts of a module's instructions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Cost {
    /// Instructions that compute.
    pub arithmetic: u32,
    /// Scalar operations that they do.
    pub operations: u32,
    /// Conditional branches and switches.
    pub branches: u32,
    /// Loops.
    pub loops: u32,
    /// Loads, stores and atomics on memory outside of the function.
    pub memory: u32,
    /// Texture reads, samples, writes and queries.
    pub texture: u32,
    /// Barriers.
    pub barriers: u32,
    /// All instructions within functions, labels not counted.
    pub total: u32,
    /// The largest number of 32-bit values that are alive at one place; local arrays count
    /// everywhere. Grows and shrinks with the registers that a GPU needs.
    #[serde(default)]
    pub registers: u32,
}

/// Counts the instructions of a SPIR-V binary, anybody's.
///
/// # Errors
///
/// The binary is no SPIR-V; `name` is what the error calls it.
pub fn of_spirv(bytes: &[u8], name: &str) -> Result<Cost, Failure> {
    let words = spirv::words(bytes, name)?;
    Ok(of_module(&spirv::load(&words, name)?))
}

/// Counts a module's instructions.
pub fn of_module(module: &Module) -> Cost {
    let mut cost = Cost {
        registers: registers::most_alive(module),
        ..Cost::default()
    };
    let body = module
        .functions
        .iter()
        .flat_map(|function| &function.blocks);
    for instruction in body.flat_map(|block| &block.instructions) {
        let which = op(instruction);
        match which {
            Op::Line | Op::NoLine | Op::Variable => continue,
            Op::BranchConditional | Op::Switch => cost.branches += 1,
            Op::LoopMerge => cost.loops += 1,
            Op::ControlBarrier | Op::MemoryBarrier => cost.barriers += 1,
            Op::Load | Op::Store | Op::ArrayLength => cost.memory += 1,
            _ if name(which).starts_with("Atomic") => cost.memory += 1,
            _ if name(which).starts_with("Image") && which != Op::ImageTexelPointer => {
                cost.texture += 1;
            }
            _ if computes(which) => {
                cost.arithmetic += 1;
                cost.operations += components(module, instruction) * weight(instruction);
            }
            _ => {}
        }
        cost.total += 1;
    }
    cost
}

fn name(which: Op) -> String {
    format!("{which:?}")
}

fn computes(which: Op) -> bool {
    use Op::*;
    matches!(
        which,
        ExtInst
            | FAdd
            | FSub
            | FMul
            | FDiv
            | FRem
            | FMod
            | FNegate
            | IAdd
            | ISub
            | IMul
            | SDiv
            | UDiv
            | SRem
            | SMod
            | UMod
            | SNegate
            | IAddCarry
            | ISubBorrow
            | UMulExtended
            | SMulExtended
            | VectorTimesScalar
            | MatrixTimesScalar
            | VectorTimesMatrix
            | MatrixTimesVector
            | MatrixTimesMatrix
            | OuterProduct
            | Dot
            | Transpose
            | ShiftLeftLogical
            | ShiftRightLogical
            | ShiftRightArithmetic
            | BitwiseAnd
            | BitwiseOr
            | BitwiseXor
            | Not
            | BitFieldInsert
            | BitFieldSExtract
            | BitFieldUExtract
            | BitReverse
            | BitCount
            | ConvertFToU
            | ConvertFToS
            | ConvertSToF
            | ConvertUToF
            | UConvert
            | SConvert
            | FConvert
            | Any
            | All
            | IsNan
            | IsInf
            | LogicalEqual
            | LogicalNotEqual
            | LogicalOr
            | LogicalAnd
            | LogicalNot
            | Select
            | IEqual
            | INotEqual
            | UGreaterThan
            | SGreaterThan
            | UGreaterThanEqual
            | SGreaterThanEqual
            | ULessThan
            | SLessThan
            | ULessThanEqual
            | SLessThanEqual
            | FOrdEqual
            | FUnordEqual
            | FOrdNotEqual
            | FUnordNotEqual
            | FOrdLessThan
            | FUnordLessThan
            | FOrdGreaterThan
            | FUnordGreaterThan
            | FOrdLessThanEqual
            | FUnordLessThanEqual
            | FOrdGreaterThanEqual
            | FUnordGreaterThanEqual
            | DPdx
            | DPdy
            | Fwidth
            | DPdxFine
            | DPdyFine
            | FwidthFine
            | DPdxCoarse
            | DPdyCoarse
            | FwidthCoarse
    )
}

/// Number of the fused multiply-add in GLSL's extended instructions.
const FMA: u32 = 50;

fn weight(instruction: &Instruction) -> u32 {
    let fused = op(instruction) == Op::ExtInst
        && instruction.operands.get(1) == Some(&rspirv::dr::Operand::LiteralExtInstInteger(FMA));
    if fused { 2 } else { 1 }
}

fn components(module: &Module, instruction: &Instruction) -> u32 {
    let vector = |ty: Word| global(module, ty).filter(|ty| op(ty) == Op::TypeVector);
    // A dot product has a scalar result, but works on vectors.
    let ty = match op(instruction) {
        Op::Dot => spirv::id(instruction, 0).and_then(|operand| {
            module
                .all_inst_iter()
                .find(|it| it.result_id == Some(operand))?
                .result_type
        }),
        _ => instruction.result_type,
    };
    ty.and_then(vector)
        .and_then(|ty| literal(ty, 1))
        .unwrap_or(1)
}
