//! SPIR-V binaries: reading, writing, and the small edits that spirv-opt has no pass for.

pub(crate) mod assigned;
pub(crate) mod behind;
pub mod bounds;
pub(crate) mod branches;
pub(crate) mod canonical;
pub(crate) mod constants;
pub(crate) mod divide;
pub(crate) mod edit;
pub(crate) mod empty;
pub mod exact;
pub(crate) mod fingerprint;
pub(crate) mod halves;
pub(crate) mod holders;
pub mod interface;
pub mod libm;
pub mod names;
pub(crate) mod narrow;
pub mod offsets;
pub mod order;
pub mod parts;
pub(crate) mod references;
pub mod refused;
pub mod split;
pub(crate) mod tables;
pub mod trim;
pub(crate) mod undefined;
pub mod uniform;
pub(crate) mod unlinked;
pub mod widths;

use rspirv::binary::Assemble;
use rspirv::dr::{Instruction, Module, Operand};
use rspirv::spirv::{Decoration, Op, Word};

use crate::error::{Failure, Step, guarded};

/// First word of every SPIR-V binary.
const MAGIC: u32 = 0x0723_0203;

/// The words of a binary file, whichever its byte order.
pub fn words(bytes: &[u8], kernel: &str) -> Result<Vec<u32>, Failure> {
    let fail = |message: String| Failure {
        kernel: kernel.into(),
        step: Step::Read,
        construct: None,
        message,
        panicked: false,
    };
    if bytes.len() < 20 || !bytes.len().is_multiple_of(4) {
        return Err(fail(format!("{} bytes are no SPIR-V module", bytes.len())));
    }
    let read = |from: fn([u8; 4]) -> u32| -> Vec<u32> {
        bytes
            .chunks_exact(4)
            .map(|word| from([word[0], word[1], word[2], word[3]]))
            .collect()
    };
    for words in [read(u32::from_le_bytes), read(u32::from_be_bytes)] {
        if words[0] == MAGIC {
            return Ok(words);
        }
    }
    Err(fail("it does not begin with SPIR-V's magic number".into()))
}

/// The bytes of a binary file, little end first on every machine.
pub fn bytes(words: &[u32]) -> Vec<u8> {
    words.iter().flat_map(|word| word.to_le_bytes()).collect()
}

/// Reads a module.
pub fn load(words: &[u32], kernel: &str) -> Result<Module, Failure> {
    guarded(
        || {
            rspirv::dr::load_words(words).map_err(|error| Failure {
                kernel: kernel.into(),
                step: Step::Read,
                construct: None,
                message: error.to_string(),
                panicked: false,
            })
        },
        kernel,
        Step::Read,
    )
}

/// Writes a module.
pub fn store(module: &Module) -> Vec<u32> {
    module.assemble()
}

/// Whether an annotation gives that `SpecId`.
fn has_spec_id(note: &Instruction, spec_id: u32) -> bool {
    op(note) == Op::Decorate
        && note.operands.get(1) == Some(&Operand::Decoration(Decoration::SpecId))
        && literal(note, 2) == Some(spec_id)
}

/// The specialisation constant with that `SpecId`.
pub(crate) fn spec_constant(module: &Module, spec_id: u32) -> Option<Word> {
    let note = module
        .annotations
        .iter()
        .find(|note| has_spec_id(note, spec_id))?;
    id(note, 0)
}

/// Makes a specialisation constant a plain one, of 32 bits; a truth value is 0 or 1.
pub(crate) fn freeze_constant(module: &mut Module, spec_id: u32, value: u32) {
    let Some(target) = spec_constant(module, spec_id) else {
        return;
    };
    module
        .annotations
        .retain(|note| !has_spec_id(note, spec_id));
    for instruction in &mut module.types_global_values {
        if instruction.result_id != Some(target) {
            continue;
        }
        let (kind, operands) = match op(instruction) {
            Op::SpecConstant => (Op::Constant, vec![Operand::LiteralBit32(value)]),
            Op::SpecConstantTrue | Op::SpecConstantFalse if value != 0 => {
                (Op::ConstantTrue, Vec::new())
            }
            Op::SpecConstantTrue | Op::SpecConstantFalse => (Op::ConstantFalse, Vec::new()),
            _ => continue,
        };
        let ty = instruction.result_type;
        *instruction = Instruction::new(kind, ty, Some(target), operands);
    }
}

/// The opcode.
pub(crate) fn op(instruction: &Instruction) -> Op {
    instruction.class.opcode
}

/// The id in an operand's place.
pub(crate) fn id(instruction: &Instruction, operand: usize) -> Option<Word> {
    match instruction.operands.get(operand)? {
        Operand::IdRef(id) => Some(*id),
        _ => None,
    }
}

/// The 32-bit literal in an operand's place.
pub(crate) fn literal(instruction: &Instruction, operand: usize) -> Option<u32> {
    match instruction.operands.get(operand)? {
        Operand::LiteralBit32(value) => Some(*value),
        _ => None,
    }
}

/// The value of a decoration with one number.
pub(crate) fn decoration(module: &Module, target: Word, which: Decoration) -> Option<u32> {
    module.annotations.iter().find_map(|note| {
        (op(note) == Op::Decorate
            && id(note, 0) == Some(target)
            && note.operands.get(1) == Some(&Operand::Decoration(which)))
        .then(|| literal(note, 2))
        .flatten()
    })
}

/// The instruction outside of functions that makes an id.
pub(crate) fn global(module: &Module, wanted: Word) -> Option<&Instruction> {
    module
        .types_global_values
        .iter()
        .find(|instruction| instruction.result_id == Some(wanted))
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// What naga makes of WGSL, with names.
    pub(crate) fn of_wgsl(text: &str) -> Module {
        let parsed = naga::front::wgsl::parse_str(text).unwrap();
        let info = naga::valid::Validator::new(
            naga::valid::ValidationFlags::all(),
            naga::valid::Capabilities::all(),
        )
        .validate(&parsed)
        .unwrap();
        let options = naga::back::spv::Options {
            flags: naga::back::spv::WriterFlags::DEBUG,
            force_loop_bounding: false,
            ..Default::default()
        };
        let words = naga::back::spv::write_vec(&parsed, &info, &options, None).unwrap();
        load(&words, "test").unwrap()
    }

    #[test]
    fn both_byte_orders_are_read() {
        let little: Vec<u8> = [MAGIC, 0x0001_0500, 0, 1, 0]
            .iter()
            .flat_map(|w: &u32| w.to_le_bytes())
            .collect();
        let big: Vec<u8> = [MAGIC, 0x0001_0500, 0, 1, 0]
            .iter()
            .flat_map(|w: &u32| w.to_be_bytes())
            .collect();
        assert_eq!(words(&little, "k").unwrap(), words(&big, "k").unwrap());
        assert_eq!(bytes(&words(&big, "k").unwrap()), little);
    }

    #[test]
    fn what_is_no_spirv_is_refused() {
        assert!(words(&[], "k").is_err());
        assert!(words(&[0; 21], "k").is_err());
        assert!(words(&[0; 20], "k").unwrap_err().message.contains("magic"));
    }
}
