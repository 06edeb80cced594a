//! Structures that the description tells apart and SPIR-V does not: rust-gpu makes one type of all
//! structures with the same members, so that an output would wear its input's names. Each buffer
//! gets a structure of its own name, where the module's uses of it allow that.

use std::collections::HashMap;

use hankel_dsl::native::describe::{Kernel, Layout, Output, Role};
use rspirv::dr::{Instruction, Module, Operand};
use rspirv::spirv::{Op, Word};

use super::names::bound;
use super::{global, id, op};

/// Gives buffers whose elements share a type under different names types of their own.
pub fn apply(module: &mut Module, kernel: &Kernel) {
    let params = kernel.params.iter().filter_map(|param| match &param.role {
        Role::Element { binding, layout } | Role::Storage { binding, layout } => {
            Some((*binding, layout))
        }
        _ => None,
    });
    let outputs = kernel.outputs.iter().filter_map(|output| match output {
        Output::Buffer {
            binding, layout, ..
        } => Some((*binding, layout)),
        _ => None,
    });
    let mut taken: HashMap<Word, &Layout> = HashMap::new();
    for (binding, layout) in params.chain(outputs) {
        let Some(buffer) = Buffer::of(module, binding) else {
            continue;
        };
        if *taken.entry(buffer.element).or_insert(layout) == layout {
            continue;
        }
        let mut changed = module.clone();
        if buffer.split(&mut changed).is_some() {
            *module = changed;
        }
    }
}

/// A storage buffer of structures: its variable, and the types from the outermost in.
struct Buffer {
    variable: Word,
    pointer: Word,
    block: Word,
    array: Word,
    element: Word,
}

impl Buffer {
    fn of(module: &Module, binding: u32) -> Option<Self> {
        let variable = bound(module, binding)?;
        let pointer = global(module, variable)?.result_type?;
        let block = id(global(module, pointer)?, 1)?;
        let array = id(global(module, block)?, 0)?;
        let array_type = global(module, array).filter(|it| op(it) == Op::TypeRuntimeArray)?;
        let element = id(array_type, 0)?;
        global(module, element).filter(|it| op(it) == Op::TypeStruct)?;
        Some(Self {
            variable,
            pointer,
            block,
            array,
            element,
        })
    }

    /// Copies the types for this buffer alone. `None`: a use does not allow it, and the module is
    /// left half-done.
    fn split(&self, module: &mut Module) -> Option<()> {
        let element = copy(module, self.element, None)?;
        let array = copy(module, self.array, Some((0, element)))?;
        let block = copy(module, self.block, Some((0, array)))?;
        let pointer = copy(module, self.pointer, Some((1, block)))?;
        let variable = module
            .types_global_values
            .iter_mut()
            .find(|it| it.result_id == Some(self.variable))?;
        variable.result_type = Some(pointer);
        self.retype_uses(module, element)
    }

    /// Follows the pointers to whole elements, and the elements themselves.
    fn retype_uses(&self, module: &mut Module, element: Word) -> Option<()> {
        let old_pointer = module
            .types_global_values
            .iter()
            .find(|it| {
                op(it) == Op::TypePointer
                    && id(it, 1) == Some(self.element)
                    && it.operands.first()
                        == Some(&Operand::StorageClass(
                            rspirv::spirv::StorageClass::StorageBuffer,
                        ))
            })
            .and_then(|it| it.result_id);
        let new_pointer = match old_pointer {
            Some(old) => Some(copy(module, old, Some((1, element)))?),
            None => None,
        };
        let (mut pointers, mut values) = (Vec::new(), Vec::new());
        for instruction in module.all_inst_iter_mut() {
            match op(instruction) {
                Op::AccessChain | Op::InBoundsAccessChain
                    if id(instruction, 0) == Some(self.variable)
                        && instruction.result_type == old_pointer =>
                {
                    instruction.result_type = new_pointer;
                    pointers.extend(instruction.result_id);
                }
                Op::Load if id(instruction, 0).is_some_and(|from| pointers.contains(&from)) => {
                    instruction.result_type = Some(element);
                    values.extend(instruction.result_id);
                }
                Op::Store if id(instruction, 0).is_some_and(|to| pointers.contains(&to)) => {
                    values.extend(id(instruction, 1));
                }
                _ => {}
            }
        }
        // What is stored must be made for it alone, and what is loaded only be taken apart.
        for instruction in module.all_inst_iter_mut() {
            let makes = instruction.result_id.is_some_and(|it| values.contains(&it));
            if makes && instruction.result_type != Some(element) {
                if op(instruction) != Op::CompositeConstruct {
                    return None;
                }
                instruction.result_type = Some(element);
            }
            let uses = instruction
                .operands
                .iter()
                .any(|it| matches!(it, Operand::IdRef(word) if values.contains(word)));
            if uses && !matches!(op(instruction), Op::CompositeExtract | Op::Store) {
                return None;
            }
            let is_elsewhere = op(instruction) == Op::Store
                && id(instruction, 1).is_some_and(|it| values.contains(&it))
                && !id(instruction, 0).is_some_and(|to| pointers.contains(&to));
            if is_elsewhere {
                return None;
            }
        }
        Some(())
    }
}

/// Copies a type with its decorations, with one operand replaced; gives the copy.
fn copy(module: &mut Module, ty: Word, replace: Option<(usize, Word)>) -> Option<Word> {
    let place = module
        .types_global_values
        .iter()
        .position(|it| it.result_id == Some(ty))?;
    let header = module.header.as_mut()?;
    let new = header.bound;
    header.bound += 1;
    let mut instruction: Instruction = module.types_global_values[place].clone();
    instruction.result_id = Some(new);
    if let Some((operand, with)) = replace {
        *instruction.operands.get_mut(operand)? = Operand::IdRef(with);
    }
    // Behind what it refers to: its own original, and the copy that replaces an operand.
    let after = replace
        .and_then(|(_, with)| {
            let types = &module.types_global_values;
            types.iter().position(|it| it.result_id == Some(with))
        })
        .map_or(place, |other| other.max(place));
    module.types_global_values.insert(after + 1, instruction);
    let decorations: Vec<Instruction> = module
        .annotations
        .iter()
        .filter(|note| id(note, 0) == Some(ty))
        .cloned()
        .collect();
    for mut note in decorations {
        *note.operands.first_mut()? = Operand::IdRef(new);
        module.annotations.push(note);
    }
    Some(new)
}
