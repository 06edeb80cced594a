//! Tables of constants: `TABLE[i]`.
//!
//! rust-gpu has a variable for each place that reads a table, and fills it there, each time, in a loop in each turn. Here
//! there is one variable for each table, which has the constants from the start: compilers of drivers make constant
//! memory of it.

use std::collections::{HashMap, HashSet};

use rspirv::dr::{Function, Instruction, Module, Operand};
use rspirv::spirv::{Op, StorageClass, Word};

use super::{id, op};

/// Gives variables that hold the same constants throughout these from the start. Whether there were any.
pub fn keep(module: &mut Module) -> bool {
    let constants: HashSet<Word> = module
        .types_global_values
        .iter()
        .filter(|it| op(it) == Op::ConstantComposite)
        .filter_map(|it| it.result_id)
        .collect();
    let mut changed = false;
    for function in &mut module.functions {
        let tables = tables(function, &constants);
        if !tables.is_empty() {
            changed = true;
            fill(function, &tables);
        }
    }
    changed
}

/// Lets spirv-opt see through structures of constants that are compared by reference, as in `(x, y) != (0, 0)`: it moves a
/// private variable into the function that uses it, but only if no chain into it is said to be in bounds. Variables
/// that are indexed by what is not known stay tables.
pub fn reach_constants(module: &mut Module) {
    let is_private = |it: &&Instruction| {
        op(it) == Op::Variable
            && it.operands.first() == Some(&Operand::StorageClass(StorageClass::Private))
    };
    let globals = || module.types_global_values.iter();
    let mut private: HashSet<Word> = globals()
        .filter(is_private)
        .filter_map(|it| it.result_id)
        .collect();
    let constants: HashSet<Word> = globals()
        .filter(|it| op(it) == Op::Constant)
        .filter_map(|it| it.result_id)
        .collect();
    let chains = || module.functions.iter().flat_map(Function::all_inst_iter);
    for it in chains().filter(|it| op(it) == Op::InBoundsAccessChain) {
        let indices = it.operands.iter().skip(1).filter_map(Operand::id_ref_any);
        if !indices.into_iter().all(|index| constants.contains(&index)) {
            private.remove(&id(it, 0).unwrap_or_default());
        }
    }
    for it in module.all_inst_iter_mut() {
        if op(it) == Op::InBoundsAccessChain && id(it, 0).is_some_and(|it| private.contains(&it)) {
            let operands = std::mem::take(&mut it.operands);
            *it = Instruction::new(Op::AccessChain, it.result_type, it.result_id, operands);
        }
    }
}

/// Variables without an initial value that are filled with one constant only, and that is all that is ever written.
fn tables(function: &Function, constants: &HashSet<Word>) -> HashMap<Word, Word> {
    // What leads into which variable.
    let mut into: HashMap<Word, Word> = HashMap::new();
    let mut filled: HashMap<Word, Word> = HashMap::new();
    let mut others: HashSet<Word> = HashSet::new();
    // A pointer is made before it is used, in blocks that come before.
    for it in function.all_inst_iter() {
        let pointed = |place: usize| into.get(&id(it, place)?).copied();
        match (op(it), it.result_id) {
            (Op::Variable, Some(variable)) if it.operands.len() == 1 => {
                into.insert(variable, variable);
            }
            (Op::AccessChain | Op::InBoundsAccessChain, Some(part)) => {
                if let Some(variable) = pointed(0) {
                    into.insert(part, variable);
                }
            }
            (Op::Load, _) => {}
            (Op::Store, _) => {
                let whole = pointed(0).filter(|variable| id(it, 0) == Some(*variable));
                match (whole, id(it, 1)) {
                    (Some(variable), Some(value)) if constants.contains(&value) => {
                        if *filled.entry(variable).or_insert(value) != value {
                            others.insert(variable);
                        }
                    }
                    _ => others.extend(pointed(0)),
                }
                others.extend(pointed(1));
            }
            _ => {
                let used = (0..it.operands.len()).filter_map(pointed);
                others.extend(used.collect::<Vec<_>>());
            }
        }
    }
    filled.retain(|variable, _| !others.contains(variable));
    filled
}

/// Makes the constants initial values; one variable remains of those that hold the same.
fn fill(function: &mut Function, tables: &HashMap<Word, Word>) {
    let mut kept: HashMap<(Option<Word>, Word), Word> = HashMap::new();
    let mut names: HashMap<Word, Word> = HashMap::new();
    for block in &mut function.blocks {
        block.instructions.retain_mut(|it| {
            let table = match op(it) {
                Op::Variable => it.result_id,
                Op::Store => id(it, 0),
                _ => None,
            };
            let Some((variable, value)) = table.and_then(|it| tables.get_key_value(&it)) else {
                return true;
            };
            if op(it) == Op::Store {
                return false;
            }
            let first = *kept.entry((it.result_type, *value)).or_insert(*variable);
            names.insert(*variable, first);
            it.operands.push(Operand::IdRef(*value));
            first == *variable
        });
    }
    for it in function.all_inst_iter_mut() {
        for operand in &mut it.operands {
            if let Operand::IdRef(value) = operand {
                *value = *names.get(value).unwrap_or(value);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use rspirv::dr::Builder;
    use rspirv::spirv::{FunctionControl, StorageClass};

    use super::*;

    /// Two variables that are filled with a table and read, one of them written to if `written`.
    fn module(written: bool) -> Module {
        let mut b = Builder::new();
        let word = b.type_int(32, 0);
        let [zero, one, two] = [0, 1, 2].map(|n| b.constant_bit32(word, n));
        let array = b.type_array(word, two);
        let (to_array, to_word) = (
            b.type_pointer(None, StorageClass::Function, array),
            b.type_pointer(None, StorageClass::Function, word),
        );
        let table = b.constant_composite(array, [zero, one]);
        let ty = b.type_function(word, [word]);
        b.begin_function(word, None, FunctionControl::NONE, ty)
            .unwrap();
        let index = b.function_parameter(word).unwrap();
        b.begin_block(None).unwrap();
        let variables = [(); 2].map(|()| b.variable(to_array, None, StorageClass::Function, None));
        let mut value = index;
        for variable in variables {
            b.store(variable, table, None, []).unwrap();
            let element = b.access_chain(to_word, None, variable, [value]).unwrap();
            value = b.load(word, None, element, None, []).unwrap();
            if written && variable == variables[1] {
                b.store(element, one, None, []).unwrap();
            }
        }
        b.ret_value(value).unwrap();
        b.end_function().unwrap();
        b.module()
    }

    fn count(module: &Module, wanted: Op) -> usize {
        let all = module.functions[0].all_inst_iter();
        all.filter(|it| op(it) == wanted).count()
    }

    #[test]
    fn one_variable_holds_a_table_from_the_start() {
        let mut both = module(false);
        assert!(keep(&mut both));
        assert_eq!(
            (count(&both, Op::Variable), count(&both, Op::Store)),
            (1, 0)
        );
        assert!(!keep(&mut both));
    }

    #[test]
    fn what_is_written_to_is_no_table() {
        let mut one = module(true);
        assert!(keep(&mut one));
        assert_eq!((count(&one, Op::Variable), count(&one, Op::Store)), (2, 2));
    }
}
