//! How values are interpolated between vertices, by the kernel's description: rust-gpu has an attribute for `Flat`
//! alone.

use hankel_dsl::native::describe::{Interpolation, Kernel, Output, Role};
use rspirv::dr::{Instruction, Module, Operand};
use rspirv::spirv::{Decoration, Op, StorageClass};

use super::names::located;

/// Decorates the variables that pass between stages.
pub fn apply(module: &mut Module, kernel: &Kernel) {
    let taken = kernel.params.iter().filter_map(|param| match param.role {
        Role::Varying {
            location,
            interpolation,
            ..
        } => Some((StorageClass::Input, location, interpolation)),
        _ => None,
    });
    let returned = kernel.outputs.iter().filter_map(|output| match output {
        Output::Varying {
            location,
            interpolation,
            ..
        } => Some((StorageClass::Output, *location, *interpolation)),
        _ => None,
    });
    for (class, location, interpolation) in taken.chain(returned) {
        let Some(variable) = located(module, class, location) else {
            continue;
        };
        for decoration in decorations(interpolation) {
            let operands = vec![Operand::IdRef(variable), Operand::Decoration(decoration)];
            let note = Instruction::new(Op::Decorate, None, None, operands);
            // A module may be finished twice.
            if !module.annotations.contains(&note) {
                module.annotations.push(note);
            }
        }
    }
}

fn decorations(interpolation: Interpolation) -> impl Iterator<Item = Decoration> {
    let all = [
        (interpolation.is_linear(), Decoration::NoPerspective),
        (interpolation.is_centroid(), Decoration::Centroid),
        (interpolation.is_per_sample(), Decoration::Sample),
    ];
    all.into_iter()
        .filter_map(|(is_said, decoration)| is_said.then_some(decoration))
}
