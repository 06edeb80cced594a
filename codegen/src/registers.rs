//! How many registers a module needs at least.

use std::collections::{HashMap, HashSet};

use rspirv::dr::{Block, Function, Instruction, Module, Operand};
use rspirv::spirv::{Op, StorageClass, Word};

use crate::spirv::{self, global, literal, op};

/// The largest number of 32-bit values that are alive at one place of a module: computed before it,
/// used behind it. Variables of a function that are left, arrays above all, count everywhere.
/// Constants do not count. A compiler for a GPU may reorder, so this is no count of its
/// registers; but it grows and shrinks with it.
pub fn most_alive(module: &Module) -> u32 {
    let types = Types::of(module);
    let most = module
        .functions
        .iter()
        .map(|function| of_function(function, &types))
        .max()
        .unwrap_or(0);
    u32::try_from(most).unwrap_or(u32::MAX)
}

fn of_function(function: &Function, types: &Types) -> u64 {
    let mut sizes: HashMap<Word, u64> = HashMap::new();
    let mut arrays: u64 = 0;
    let inner = function.blocks.iter().flat_map(|it| &it.instructions);
    for instruction in function.parameters.iter().chain(inner) {
        let (Some(id), Some(ty)) = (instruction.result_id, instruction.result_type) else {
            continue;
        };
        if op(instruction) == Op::Variable {
            arrays = arrays.saturating_add(types.variables.get(&ty).copied().unwrap_or(0));
        } else if let Some(size) = types.values.get(&ty) {
            sizes.insert(id, *size);
        }
    }
    let flow = Flow::of(function, &sizes);
    let total = |alive: &HashSet<Word>| alive.iter().map(|id| sizes[id]).sum::<u64>();
    let mut most = 0;
    for (index, block) in function.blocks.iter().enumerate() {
        let mut alive = flow.behind(index, &function.blocks);
        let mut count = total(&alive);
        most = most.max(count);
        for instruction in block.instructions.iter().rev() {
            if let Some(id) = instruction.result_id
                && let Some(size) = sizes.get(&id)
            {
                // A result that nothing uses is there for a moment, too.
                if !alive.remove(&id) {
                    most = most.max(count + size);
                } else {
                    count -= size;
                }
            }
            if op(instruction) != Op::Phi {
                for id in used(instruction) {
                    if let Some(size) = sizes.get(&id)
                        && alive.insert(id)
                    {
                        count += size;
                    }
                }
            }
            most = most.max(count);
        }
    }
    most.saturating_add(arrays)
}

/// What is alive at the begin of each block.
struct Flow {
    before: Vec<HashSet<Word>>,
    successors: Vec<Vec<usize>>,
    labels: Vec<Option<Word>>,
    sizes: HashSet<Word>,
}

impl Flow {
    fn of(function: &Function, sizes: &HashMap<Word, u64>) -> Self {
        let blocks = &function.blocks;
        let labels: Vec<Option<Word>> = blocks
            .iter()
            .map(|block| block.label.as_ref().and_then(|label| label.result_id))
            .collect();
        let index: HashMap<Word, usize> = labels
            .iter()
            .enumerate()
            .filter_map(|(i, label)| Some(((*label)?, i)))
            .collect();
        let successors = blocks
            .iter()
            .map(|block| {
                let last = block.instructions.last();
                last.map(used)
                    .unwrap_or_default()
                    .iter()
                    .filter_map(|id| index.get(id).copied())
                    .collect()
            })
            .collect();
        let mut flow = Self {
            before: vec![HashSet::new(); blocks.len()],
            successors,
            labels,
            sizes: sizes.keys().copied().collect(),
        };
        // Sets only grow, so this ends.
        let mut changed = true;
        while changed {
            changed = false;
            for index in (0..blocks.len()).rev() {
                let mut alive = flow.behind(index, blocks);
                for instruction in blocks[index].instructions.iter().rev() {
                    if let Some(id) = instruction.result_id {
                        alive.remove(&id);
                    }
                    if op(instruction) != Op::Phi {
                        alive.extend(flow.values(used(instruction)));
                    }
                }
                if alive.len() > flow.before[index].len() {
                    flow.before[index] = alive;
                    changed = true;
                }
            }
        }
        flow
    }

    fn values(&self, ids: Vec<Word>) -> impl Iterator<Item = Word> {
        ids.into_iter().filter(|id| self.sizes.contains(id))
    }

    /// What is alive behind a block: what its successors need, and what their phis take from it.
    fn behind(&self, index: usize, blocks: &[Block]) -> HashSet<Word> {
        let mut alive = HashSet::new();
        for &next in &self.successors[index] {
            alive.extend(&self.before[next]);
            let phis = blocks[next]
                .instructions
                .iter()
                .take_while(|it| matches!(op(it), Op::Phi | Op::Line | Op::NoLine));
            for phi in phis {
                for pair in used(phi).chunks_exact(2) {
                    if Some(pair[1]) == self.labels[index] {
                        alive.extend(self.values(vec![pair[0]]));
                    }
                }
            }
        }
        alive
    }
}

/// The ids that an instruction uses, its type left out.
fn used(instruction: &Instruction) -> Vec<Word> {
    instruction
        .operands
        .iter()
        .filter_map(|operand| match operand {
            Operand::IdRef(id) => Some(*id),
            _ => None,
        })
        .collect()
}

/// Sizes in 32-bit values.
#[derive(Default)]
struct Types {
    /// Of the values of each type. Pointers, images and samplers have none.
    values: HashMap<Word, u64>,
    /// Of a function's variables, by the type of the pointer to them.
    variables: HashMap<Word, u64>,
}

impl Types {
    fn of(module: &Module) -> Self {
        let mut types = Self::default();
        for ty in &module.types_global_values {
            let Some(id) = ty.result_id else {
                continue;
            };
            let part = |operand: usize| {
                spirv::id(ty, operand)
                    .and_then(|id| types.values.get(&id))
                    .copied()
                    .unwrap_or(0)
            };
            let size = match op(ty) {
                Op::TypeBool => 1,
                Op::TypeInt | Op::TypeFloat => u64::from(literal(ty, 0).unwrap_or(32).div_ceil(32)),
                Op::TypeVector | Op::TypeMatrix => {
                    part(0).saturating_mul(literal(ty, 1).unwrap_or(1).into())
                }
                Op::TypeArray => {
                    let count = spirv::id(ty, 1).and_then(|id| global(module, id));
                    part(0).saturating_mul(count.and_then(|it| literal(it, 0)).unwrap_or(1).into())
                }
                Op::TypeStruct => (0..ty.operands.len())
                    .map(part)
                    .fold(0, u64::saturating_add),
                Op::TypePointer if ty.operands.first() == Some(&FUNCTION) => {
                    let size = part(1);
                    types.variables.insert(id, size);
                    continue;
                }
                _ => continue,
            };
            // What is absurd stays so in every sum.
            types.values.insert(id, size.min(1 << 40));
        }
        types
    }
}

/// The storage class of a function's variables.
const FUNCTION: Operand = Operand::StorageClass(StorageClass::Function);
