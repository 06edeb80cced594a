//! What a kernel's description says of values that pass between stages, or to a target, for which rust-gpu has no
//! attribute: how they are interpolated, the second source of blending, a position that is invariant.

use hankel_dsl::native::describe::{Interpolation, Kernel, Output, Role};
use rspirv::dr::{Instruction, Module, Operand};
use rspirv::spirv::{BuiltIn, Decoration, Op, StorageClass, Word};

use super::names::{built_in, located, second_source};

/// Decorates the variables. A module may be finished twice.
pub fn apply(module: &mut Module, kernel: &Kernel) {
    interpolate(module, kernel);
    let has_second = |output: &Output| matches!(output, Output::SecondSource { .. });
    if kernel.outputs.iter().any(has_second) {
        blend_two(module);
    }
    if kernel.invariant
        && let Some(position) = built_in(module, StorageClass::Output, BuiltIn::Position as u32)
    {
        decorate(module, position, Decoration::Invariant, None);
    }
}

/// Adds a decoration that is not there yet.
fn decorate(module: &mut Module, variable: Word, decoration: Decoration, value: Option<u32>) {
    let mut operands = vec![Operand::IdRef(variable), Operand::Decoration(decoration)];
    operands.extend(value.map(Operand::LiteralBit32));
    let note = Instruction::new(Op::Decorate, None, None, operands);
    if !module.annotations.contains(&note) {
        module.annotations.push(note);
    }
}

/// rust-gpu gives the second source a location of its own, behind the target's.
fn blend_two(module: &mut Module) {
    if second_source(module).is_some() {
        return;
    }
    let class = StorageClass::Output;
    let (Some(first), Some(second)) = (located(module, class, 0), located(module, class, 1)) else {
        return;
    };
    for note in &mut module.annotations {
        let operands = note.operands.as_mut_slice();
        if let [
            Operand::IdRef(variable),
            Operand::Decoration(Decoration::Location),
            location,
        ] = operands
            && *variable == second
        {
            *location = Operand::LiteralBit32(0);
        }
    }
    decorate(module, first, Decoration::Index, Some(0));
    decorate(module, second, Decoration::Index, Some(1));
}

fn interpolate(module: &mut Module, kernel: &Kernel) {
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
            decorate(module, variable, decoration, None);
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
