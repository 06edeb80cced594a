//! What a variable is set to, as a value of its own.
//!
//! A loop may set a variable to the value that it has. SPIR-T, by which rust-gpu's linker structures control flow, may
//! then take another variable of that loop for it (`tests/upstream/rust-gpu-lost-choice`). A copy is another value to
//! it. spirv-opt removes all copies. Vectors are copied from variable to variable, by `OpCopyMemory`: it becomes a load,
//! a copy and a store.

use std::collections::{HashMap, HashSet};

use rspirv::dr::{Function, Instruction, Module, Operand};
use rspirv::spirv::{Op, Word};

use super::{id, op};

/// Copies what is stored in variables that are stored to more than once, where it is not computed there and then.
pub fn copy_assigned(module: &mut Module) {
    let plain = types_without_pointers(module);
    let pointees = pointees(module);
    let Some(header) = &mut module.header else {
        return;
    };
    for function in &mut module.functions {
        let several = stored_several_times(function, &pointees);
        let mut given: HashMap<Word, Word> = HashMap::new();
        let parameters = function.parameters.iter();
        let instructions = function.blocks.iter().flat_map(|it| &it.instructions);
        for it in parameters.chain(instructions) {
            let is_given = matches!(
                op(it),
                Op::FunctionParameter | Op::Load | Op::FunctionCall | Op::Phi
            );
            if let (true, Some(value), Some(ty)) = (is_given, it.result_id, it.result_type)
                && plain.contains(&ty)
            {
                given.insert(value, ty);
            }
        }
        for block in &mut function.blocks {
            let mut instructions = Vec::with_capacity(block.instructions.len());
            for mut it in block.instructions.drain(..) {
                if op(&it) == Op::CopyMemory
                    && it.operands.len() == 2
                    && let (Some(to), Some(from)) = (id(&it, 0), id(&it, 1))
                    && let Some(ty) = several.get(&to)
                    && plain.contains(ty)
                {
                    let (loaded, copy) = (header.bound, header.bound + 1);
                    header.bound += 2;
                    let of = |op, result, operand| {
                        let operands = vec![Operand::IdRef(operand)];
                        Instruction::new(op, Some(*ty), Some(result), operands)
                    };
                    instructions.push(of(Op::Load, loaded, from));
                    instructions.push(of(Op::CopyObject, copy, loaded));
                    let stored = vec![Operand::IdRef(to), Operand::IdRef(copy)];
                    it = Instruction::new(Op::Store, None, None, stored);
                } else if op(&it) == Op::Store
                    && id(&it, 0).is_some_and(|to| several.contains_key(&to))
                    && let Some(value) = id(&it, 1)
                    && let Some(ty) = given.get(&value)
                {
                    let copied = vec![Operand::IdRef(value)];
                    let copy =
                        Instruction::new(Op::CopyObject, Some(*ty), Some(header.bound), copied);
                    it.operands[1] = Operand::IdRef(header.bound);
                    header.bound += 1;
                    instructions.push(copy);
                }
                instructions.push(it);
            }
            block.instructions = instructions;
        }
    }
}

/// Numbers, vectors, and what is made of them. The linker follows pointers through variables, and through no copies.
fn types_without_pointers(module: &Module) -> HashSet<Word> {
    let mut plain = HashSet::new();
    for it in &module.types_global_values {
        let of =
            |count: usize| (0..count).all(|at| id(it, at).is_some_and(|ty| plain.contains(&ty)));
        let is_plain = match op(it) {
            Op::TypeBool | Op::TypeInt | Op::TypeFloat => true,
            Op::TypeVector | Op::TypeMatrix | Op::TypeArray => of(1),
            Op::TypeStruct => of(it.operands.len()),
            _ => false,
        };
        if let (true, Some(ty)) = (is_plain, it.result_id) {
            plain.insert(ty);
        }
    }
    plain
}

/// What pointers of each type point to.
fn pointees(module: &Module) -> HashMap<Word, Word> {
    let pointers = module.types_global_values.iter();
    let pointers = pointers.filter(|it| op(it) == Op::TypePointer);
    pointers
        .filter_map(|it| Some((it.result_id?, id(it, 1)?)))
        .collect()
}

/// The variables of a function that two instructions or more store to, as a whole, and the types of their values.
fn stored_several_times(
    function: &Function,
    pointees: &HashMap<Word, Word>,
) -> HashMap<Word, Word> {
    let mut stores: HashMap<Word, usize> = HashMap::new();
    for it in function.all_inst_iter() {
        let to = match op(it) {
            Op::Variable if it.operands.len() > 1 => it.result_id,
            Op::Store | Op::CopyMemory => id(it, 0),
            _ => None,
        };
        if let Some(variable) = to {
            *stores.entry(variable).or_default() += 1;
        }
    }
    let is_variable = |it: &&Instruction| op(it) == Op::Variable;
    let variables = function.all_inst_iter().filter(is_variable);
    variables
        .filter_map(|it| Some((it.result_id?, *pointees.get(&it.result_type?)?)))
        .filter(|(it, _)| stores.get(it).is_some_and(|count| *count > 1))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::store;
    use super::super::tests::of_wgsl;
    use crate::finish::{optimise, validate};
    use crate::spirv::load;

    use super::*;

    fn copies(module: &Module) -> usize {
        let all = module.functions.iter().flat_map(|it| it.all_inst_iter());
        all.filter(|it| op(it) == Op::CopyObject).count()
    }

    /// How many copies a kernel has that assigns so to its variables.
    fn copied(assignments: &str) -> usize {
        let mut module = of_wgsl(&format!(
            "@group(0) @binding(0) var<storage, read_write> x: array<u32>;
             @compute @workgroup_size(1) fn main(@builtin(global_invocation_id) id: vec3<u32>) {{
                 var a: u32; var c: u32;
                 a = x[0]; c = x[1];
                 {assignments}
                 x[0] = a; x[1] = c;
             }}"
        ));
        copy_assigned(&mut module);
        let all = copies(&module);
        let words = store(&module);
        validate(&words, "test").unwrap();
        let (words, _) = optimise(module, "test").unwrap();
        assert_eq!(
            copies(&load(&words, "test").unwrap()),
            0,
            "spirv-opt leaves none"
        );
        all
    }

    #[test]
    fn what_a_variable_is_set_to_is_copied() {
        assert_eq!(copied(""), 2, "naga initialises both, and then sets them");
        assert_eq!(copied("c = c;"), 3);
        assert_eq!(copied("a = c; c = c;"), 4);
        assert_eq!(copied("a = c + 1u;"), 2, "a sum is a value of its own");
        assert_eq!(
            copied("var once = 7u; x[2] = once;"),
            2,
            "it is set once, and to a constant"
        );
    }
}
