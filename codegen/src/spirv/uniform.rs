//! Whether every invocation of a workgroup reaches every barrier, and every one of a subgroup every operation of
//! the subgroup.
//!
//! A barrier that some invocations do not reach hangs a device or does nothing; an operation of a subgroup is one
//! of those that reach it. That happens where it stands in a branch, and also where an invocation has left before:
//! rust-gpu makes of a panic (of a division, an index, an `unwrap`) that the invocation does nothing more, so that
//! all that follows is in a branch.
//!
//! What is the same for a whole group is told from where it comes: constants, uniforms, the group's own number, and
//! what is computed from these where all invocations are together.

use std::collections::{HashMap, HashSet};

use rspirv::dr::{Function, Instruction, Module, Operand};
use rspirv::spirv::{BuiltIn, Decoration, GroupOperation, Op, StorageClass, Word};

use super::{id, op, refused};

/// What memory that others write counts as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Memory {
    /// The same for all where the place is: an author knows what a barrier before it has settled.
    Trusted,
    /// As WGSL has it: different, unless nobody can write it.
    Doubted,
}

/// The invocations that are to be together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Group {
    /// All of a workgroup.
    Workgroup,
    /// All of a subgroup.
    Subgroup,
}

/// Whether there is a barrier that only some invocations of a workgroup may reach.
#[must_use]
pub fn divides_at_barrier(module: &Module, memory: Memory) -> bool {
    divides(module, memory, Group::Workgroup, |op| {
        op == Op::ControlBarrier
    })
}

/// Whether there is an operation of a subgroup that only some invocations of the group may reach.
#[must_use]
pub fn divides_at_subgroup(module: &Module, memory: Memory, group: Group) -> bool {
    divides(module, memory, group, is_of_subgroup)
}

/// Whether there is a difference between neighbouring fragments, as a texture takes one that is sampled at the level of
/// the fragment, that only some fragments may reach.
#[must_use]
pub fn divides_at_neighbours(module: &Module, memory: Memory) -> bool {
    divides(module, memory, Group::Workgroup, |op| {
        refused::of_neighbours(op).is_some()
    })
}

fn divides(module: &Module, memory: Memory, group: Group, together: fn(Op) -> bool) -> bool {
    let concerned = |function: &&Function| function.all_inst_iter().any(|it| together(op(it)));
    let mut functions = module.functions.iter().filter(concerned);
    functions.any(|function| Analysis::of(module, function, memory, group).has_in_branch(together))
}

struct Analysis<'a> {
    function: &'a Function,
    memory: Memory,
    group: Group,
    variables: HashMap<Word, StorageClass>,
    /// Inputs that are the same for the group.
    shared_inputs: HashSet<Word>,
    /// Buffers and textures that nobody writes.
    read_only: HashSet<Word>,
    /// Pointers to the variable that they lead into.
    roots: HashMap<Word, Word>,
    successors: Vec<Vec<usize>>,
    /// Of each block, the next one that every way from it leads through.
    joins: Vec<Option<usize>>,
    different: HashSet<Word>,
    divided: HashSet<usize>,
}

impl<'a> Analysis<'a> {
    fn of(module: &Module, function: &'a Function, memory: Memory, group: Group) -> Self {
        let variables: HashMap<Word, StorageClass> = module
            .types_global_values
            .iter()
            .chain(function.all_inst_iter())
            .filter(|it| op(it) == Op::Variable)
            .filter_map(|it| match it.operands.first()? {
                Operand::StorageClass(class) => Some((it.result_id?, *class)),
                _ => None,
            })
            .collect();
        let shared_inputs = module
            .annotations
            .iter()
            .filter(|note| {
                matches!(note.operands.get(2), Some(Operand::BuiltIn(it)) if is_shared(*it, group))
            })
            .filter_map(|note| id(note, 0))
            .collect();
        let blocks = &function.blocks;
        let numbers: HashMap<Word, usize> = blocks
            .iter()
            .enumerate()
            .filter_map(|(number, block)| Some((block.label_id()?, number)))
            .collect();
        let successors: Vec<Vec<usize>> = blocks
            .iter()
            .map(|block| {
                let last = block.instructions.last();
                let targets = last.into_iter().flat_map(|it| match op(it) {
                    Op::Branch => it.operands.clone(),
                    Op::BranchConditional | Op::Switch => it.operands[1..].to_vec(),
                    _ => Vec::new(),
                });
                targets
                    .filter_map(|it| numbers.get(&it.id_ref_any()?).copied())
                    .collect()
            })
            .collect();
        let joins = joins(&successors);
        let mut analysis = Self {
            function,
            memory,
            group,
            variables,
            shared_inputs,
            read_only: read_only(module),
            roots: HashMap::new(),
            successors,
            joins,
            different: HashSet::new(),
            divided: HashSet::new(),
        };
        for it in function.all_inst_iter() {
            if matches!(
                op(it),
                Op::AccessChain | Op::InBoundsAccessChain | Op::CopyObject
            ) && let (Some(result), Some(base)) = (it.result_id, id(it, 0))
            {
                let root = analysis.root(base);
                analysis.roots.insert(result, root);
            }
        }
        analysis.settle();
        analysis
    }

    fn root(&self, pointer: Word) -> Word {
        self.roots.get(&pointer).copied().unwrap_or(pointer)
    }

    fn settle(&mut self) {
        loop {
            let before = (self.different.len(), self.divided.len());
            for (number, block) in self.function.blocks.iter().enumerate() {
                for it in &block.instructions {
                    if op(it) == Op::Store {
                        self.store(it, number);
                    } else if let Some(result) = it.result_id
                        && self.is_different(it, number)
                    {
                        self.different.insert(result);
                    }
                }
                let branches = block.instructions.last().is_some_and(|it| {
                    matches!(op(it), Op::BranchConditional | Op::Switch)
                        && id(it, 0).is_some_and(|it| self.different.contains(&it))
                });
                if branches {
                    self.divide(number);
                }
            }
            if (self.different.len(), self.divided.len()) == before {
                return;
            }
        }
    }

    /// What is stored in a function's own variable makes that different.
    fn store(&mut self, it: &Instruction, block: usize) {
        let (Some(pointer), Some(value)) = (id(it, 0), id(it, 1)) else {
            return;
        };
        let differs = self.divided.contains(&block)
            || self.different.contains(&value)
            || self.different.contains(&pointer);
        if differs {
            let root = self.root(pointer);
            self.different.insert(root);
        }
    }

    fn is_different(&self, it: &Instruction, block: usize) -> bool {
        let any = it
            .operands
            .iter()
            .filter_map(Operand::id_ref_any)
            .any(|word| self.different.contains(&word));
        match op(it) {
            Op::Label | Op::Variable | Op::ArrayLength => false,
            // The variable itself may hold what differs; where it lies is the same for all.
            Op::AccessChain | Op::InBoundsAccessChain => it.operands[1..]
                .iter()
                .filter_map(Operand::id_ref_any)
                .any(|word| self.different.contains(&word)),
            Op::Load => id(it, 0).is_none_or(|pointer| self.loads_different(pointer)),
            Op::Phi => {
                any || self.divided.contains(&block)
                    || it.operands.chunks_exact(2).any(|way| {
                        way[1]
                            .id_ref_any()
                            .is_some_and(|from| self.comes_divided(from))
                    })
            }
            Op::FunctionParameter | Op::FunctionCall => true,
            // What an atomic returns depends on whose turn it is.
            Op::AtomicLoad
            | Op::AtomicExchange
            | Op::AtomicCompareExchange
            | Op::AtomicIIncrement
            | Op::AtomicIDecrement
            | Op::AtomicIAdd
            | Op::AtomicISub
            | Op::AtomicSMin
            | Op::AtomicUMin
            | Op::AtomicSMax
            | Op::AtomicUMax
            | Op::AtomicAnd
            | Op::AtomicOr
            | Op::AtomicXor
            | Op::AtomicFAddEXT => true,
            // A subgroup is not the workgroup.
            other if is_of_subgroup(other) => {
                self.group == Group::Workgroup || !is_same_for_subgroup(it)
            }
            Op::ImageRead => any || self.memory == Memory::Doubted,
            _ => any,
        }
    }

    fn loads_different(&self, pointer: Word) -> bool {
        let root = self.root(pointer);
        let place = self.different.contains(&pointer);
        match self.variables.get(&root) {
            Some(StorageClass::Input) => !self.shared_inputs.contains(&root),
            Some(StorageClass::Function | StorageClass::Private) => {
                place || self.different.contains(&root)
            }
            Some(StorageClass::StorageBuffer | StorageClass::Workgroup) => {
                let trusted = self.memory == Memory::Trusted || self.read_only.contains(&root);
                place || !trusted
            }
            Some(_) => place,
            None => true,
        }
    }

    /// Whether a block is left by invocations that did not all come there.
    fn comes_divided(&self, label: Word) -> bool {
        let blocks = &self.function.blocks;
        let Some(number) = blocks.iter().position(|it| it.label_id() == Some(label)) else {
            return true;
        };
        let branches = blocks[number].instructions.last().is_some_and(|it| {
            matches!(op(it), Op::BranchConditional | Op::Switch)
                && id(it, 0).is_some_and(|it| self.different.contains(&it))
        });
        branches || self.divided.contains(&number)
    }

    /// Marks what lies between a branch and where its ways meet again.
    fn divide(&mut self, branch: usize) {
        let mut open = self.successors[branch].clone();
        while let Some(next) = open.pop() {
            if Some(next) != self.joins[branch] && self.divided.insert(next) {
                open.extend(&self.successors[next]);
            }
        }
    }

    fn has_in_branch(&self, together: fn(Op) -> bool) -> bool {
        self.divided.iter().any(|block| {
            let mut all = self.function.blocks[*block].instructions.iter();
            all.any(|it| together(op(it)))
        })
    }
}

/// Whether an input is the same for all of a group.
fn is_shared(input: BuiltIn, group: Group) -> bool {
    let of_workgroup = matches!(
        input,
        BuiltIn::WorkgroupId | BuiltIn::NumWorkgroups | BuiltIn::WorkgroupSize
    );
    let of_subgroup = matches!(
        input,
        BuiltIn::SubgroupId | BuiltIn::NumSubgroups | BuiltIn::SubgroupSize
    );
    of_workgroup || of_subgroup && group == Group::Subgroup
}

/// Whether all invocations of a subgroup get the same of one of its operations.
fn is_same_for_subgroup(it: &Instruction) -> bool {
    let reduces = Operand::GroupOperation(GroupOperation::Reduce);
    it.operands.contains(&reduces)
        || matches!(
            op(it),
            Op::GroupNonUniformAll
                | Op::GroupNonUniformAny
                | Op::GroupNonUniformAllEqual
                | Op::GroupNonUniformBallot
                | Op::GroupNonUniformBroadcast
                | Op::GroupNonUniformBroadcastFirst
        )
}

/// SPIR-V numbers them in a row.
fn is_of_subgroup(op: Op) -> bool {
    let row = Op::GroupNonUniformElect as u32..=Op::GroupNonUniformQuadSwap as u32;
    row.contains(&(op as u32))
}

/// Storage that is decorated so that it cannot be written.
fn read_only(module: &Module) -> HashSet<Word> {
    let is_note = |note: &&Instruction| {
        let mark = Operand::Decoration(Decoration::NonWritable);
        note.operands.contains(&mark)
    };
    let marked: HashSet<Word> = module
        .annotations
        .iter()
        .filter(is_note)
        .filter_map(|note| id(note, 0))
        .collect();
    let of_type = |it: &Instruction| {
        let pointer = super::global(module, it.result_type?)?;
        id(pointer, 1)
    };
    module
        .types_global_values
        .iter()
        .filter(|it| op(it) == Op::Variable)
        .filter(|it| {
            it.result_id.is_some_and(|it| marked.contains(&it))
                || of_type(it).is_some_and(|it| marked.contains(&it))
        })
        .filter_map(|it| it.result_id)
        .collect()
}

/// Of each block, the nearest other one that all ways from it to the function's end lead through.
fn joins(successors: &[Vec<usize>]) -> Vec<Option<usize>> {
    let count = successors.len();
    // Blocks that every way from a block leads through, itself among them.
    let mut through: Vec<Vec<bool>> = successors
        .iter()
        .enumerate()
        .map(|(number, next)| {
            let end = next.is_empty();
            (0..count).map(|other| !end || other == number).collect()
        })
        .collect();
    loop {
        let mut changed = false;
        for number in (0..count).rev() {
            let next = &successors[number];
            let of_all = |other: usize| next.iter().all(|next| through[*next][other]);
            let now: Vec<bool> = (0..count)
                .map(|other| other == number || !next.is_empty() && of_all(other))
                .collect();
            if through[number] != now {
                through[number] = now;
                changed = true;
            }
        }
        if !changed {
            break;
        }
    }
    let size = |block: usize| through[block].iter().filter(|it| **it).count();
    (0..count)
        .map(|number| {
            (0..count)
                .filter(|other| *other != number && through[number][*other])
                .max_by_key(|other| size(*other))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn operations_of_subgroups_differ_within_a_workgroup() {
        for op in [
            Op::GroupNonUniformElect,
            Op::GroupNonUniformBallot,
            Op::GroupNonUniformBroadcastFirst,
            Op::GroupNonUniformFAdd,
        ] {
            assert!(is_of_subgroup(op), "{op:?}");
        }
        assert!(!is_of_subgroup(Op::IAdd) && !is_of_subgroup(Op::ControlBarrier));
    }

    #[test]
    fn ways_meet_where_all_lead_through() {
        // 0 -> 1 | 2 -> 3 -> 4 | 5, both ends.
        let successors = [vec![1, 2], vec![3], vec![3], vec![4, 5], vec![], vec![]];
        assert_eq!(
            joins(&successors),
            [Some(3), Some(3), Some(3), None, None, None]
        );
        // A loop: 0 -> 1 -> 2 -> 1, 1 -> 3.
        let turns = [vec![1], vec![2, 3], vec![1], vec![]];
        assert_eq!(joins(&turns), [Some(1), Some(3), Some(1), None]);
    }
}
