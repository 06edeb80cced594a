//! What is refused at the author's line, where nothing after rust-gpu can put it right.
//!
//! Differences between neighbours, in a stage that has none: derivatives, and textures that are
//! sampled at the level that follows from them.

use std::collections::HashSet;

use rspirv::dr::{Function, Instruction, Module, Operand};
use rspirv::spirv::{ExecutionModel, Op, Word};

use super::{global, op};
use crate::error::{Failure, Step};

const FRAGMENT: ExecutionModel = ExecutionModel::Fragment;

/// Looks through a module as rust-gpu writes it.
///
/// # Errors
///
/// The first thing that is wrong.
pub fn check(module: &Module, kernel: &str) -> Result<(), Failure> {
    let fragment = module
        .entry_points
        .iter()
        .all(|entry| entry.operands.first() == Some(&Operand::ExecutionModel(FRAGMENT)));
    for function in &module.functions {
        for block in &function.blocks {
            for it in &block.instructions {
                if let (Some(instead), false) = (of_neighbours(op(it)), fragment) {
                    return Err(Failure {
                        kernel: kernel.into(),
                        step: Step::Meaning,
                        construct: None,
                        message: format!("only a fragment has neighbours: {instead}"),
                        panicked: false,
                    });
                }
            }
        }
    }
    Ok(())
}

/// Looks for references of which nothing tells any more where they lead, in an optimised module.
///
/// # Errors
///
/// There is one, and it is used.
pub fn check_references(module: &Module, kernel: &str) -> Result<(), Failure> {
    let is_handle = |ty: Word| {
        let found = global(module, ty).map(op);
        matches!(
            found,
            Some(Op::TypePointer | Op::TypeImage | Op::TypeSampler | Op::TypeSampledImage)
        )
    };
    let lost: HashSet<Word> = module
        .all_inst_iter()
        .filter(|it| op(it) == Op::Undef && it.result_type.is_some_and(is_handle))
        .filter_map(|it| it.result_id)
        .collect();
    let uses = |it: &Instruction| {
        let mut used = it.operands.iter().filter_map(Operand::id_ref_any);
        used.any(|name| lost.contains(&name))
    };
    let mut code = module.functions.iter().flat_map(Function::all_inst_iter);
    if !code.any(uses) {
        return Ok(());
    }
    Err(Failure {
        kernel: kernel.into(),
        step: Step::Meaning,
        construct: None,
        message: "a buffer, a texture or a reference is kept in a structure, by a closure in an iterator for example, \
                  and what it leads to is lost there: name it where it is used, in a `for` loop"
            .into(),
        panicked: false,
    })
}

/// What to write instead of what takes differences between neighbours.
pub(super) fn of_neighbours(op: Op) -> Option<&'static str> {
    match op {
        Op::ImageSampleImplicitLod => Some("write `sample_level` for `sample` and `sample_bias`"),
        Op::ImageSampleDrefImplicitLod => Some("write `compare_level_zero` for `compare`"),
        Op::DPdx
        | Op::DPdy
        | Op::Fwidth
        | Op::DPdxFine
        | Op::DPdyFine
        | Op::FwidthFine
        | Op::DPdxCoarse
        | Op::DPdyCoarse
        | Op::FwidthCoarse => Some("no derivative is taken elsewhere"),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use rspirv::dr::Block;

    use super::*;

    #[test]
    fn only_fragments_have_neighbours() {
        let check = |model: ExecutionModel, op: Op| {
            let mut module = Module::new();
            let operands = vec![Operand::ExecutionModel(model)];
            module
                .entry_points
                .push(Instruction::new(Op::EntryPoint, None, None, operands));
            let (mut function, mut block) = (Function::new(), Block::new());
            let sample = Instruction::new(op, Some(1), Some(2), vec![Operand::IdRef(3)]);
            block.instructions.push(sample);
            function.blocks.push(block);
            module.functions.push(function);
            check(&module, "k")
        };
        for op in [Op::ImageSampleImplicitLod, Op::DPdx] {
            assert!(check(ExecutionModel::Fragment, op).is_ok());
            for model in [ExecutionModel::GLCompute, ExecutionModel::Vertex] {
                let message = check(model, op).unwrap_err().message;
                assert!(
                    message.contains("only a fragment has neighbours"),
                    "{message}"
                );
            }
        }
        assert!(check(ExecutionModel::GLCompute, Op::ImageSampleExplicitLod).is_ok());
    }
}
