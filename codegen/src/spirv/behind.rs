//! Values that a loop computes and that are used behind it.
//!
//! naga's reader keeps such a value in a variable, and loads it for each use. A copy where the loop is left is one load.

use std::cmp::Reverse;
use std::collections::{HashMap, HashSet};

use rspirv::dr::{Function, Instruction, Module, Operand};
use rspirv::spirv::{Op, Word};

use super::branches::Graph;
use super::{id, op};

/// Copies each value that is used more than once behind the loop that computes it.
pub fn copy_behind_loops(module: &mut Module) {
    let plain: HashSet<Word> = module
        .types_global_values
        .iter()
        .filter(|it| {
            matches!(
                op(it),
                Op::TypeBool | Op::TypeInt | Op::TypeFloat | Op::TypeVector
            )
        })
        .filter_map(|it| it.result_id)
        .collect();
    let Some(header) = &mut module.header else {
        return;
    };
    for function in &mut module.functions {
        let mut made = HashMap::new();
        for (number, block) in function.blocks.iter().enumerate() {
            for it in &block.instructions {
                if let (Some(value), Some(ty)) = (it.result_id, it.result_type)
                    && plain.contains(&ty)
                {
                    made.insert(value, (number, ty));
                }
            }
        }
        for left in loops(function) {
            let copies: Vec<_> = left
                .used_behind(function, &made)
                .into_iter()
                .zip(header.bound..)
                .map(|((value, ty), copy)| Copy { value, ty, copy })
                .collect();
            header.bound += copies.len() as Word;
            made.extend(copies.iter().map(|it| (it.copy, (left.merge, it.ty))));
            left.put(function, &copies);
        }
    }
}

/// A value, its type, and what stands for it behind the loop.
struct Copy {
    value: Word,
    ty: Word,
    copy: Word,
}

/// A loop, and what comes behind it.
struct Left {
    /// The block that the loop is left to.
    merge: usize,
    /// The blocks of the loop.
    within: HashSet<usize>,
    /// The blocks that are reached by way of `merge` alone, and their labels.
    behind: Vec<usize>,
    labels: HashSet<Word>,
}

/// All loops, inner ones first: what they compute may be used behind the outer ones, too.
fn loops(function: &Function) -> Vec<Left> {
    let known = HashMap::new();
    let graph = Graph::of(function, &known);
    let mut all: Vec<_> = graph.loops().collect();
    all.sort_by_key(|(header, _)| Reverse(graph.depth(*header)));
    let blocks = 0..function.blocks.len();
    all.into_iter()
        .map(|(header, merge)| {
            let (behind, others): (Vec<_>, Vec<_>) =
                blocks.clone().partition(|it| graph.dominates(merge, *it));
            let within = others.into_iter().filter(|it| graph.dominates(header, *it));
            let label = |block: &usize| function.blocks[*block].label_id();
            Left {
                merge,
                within: within.collect(),
                labels: behind.iter().filter_map(label).collect(),
                behind,
            }
        })
        .collect()
}

impl Left {
    /// Values of the loop that are used more than once behind it, with their types.
    fn used_behind(
        &self,
        function: &Function,
        made: &HashMap<Word, (usize, Word)>,
    ) -> Vec<(Word, Word)> {
        let mut uses: Vec<(Word, Word, usize)> = Vec::new();
        let mut places = HashMap::new();
        for block in &self.behind {
            for it in &function.blocks[*block].instructions {
                for place in 0..it.operands.len() {
                    let Some(value) = id(it, place).filter(|_| self.is_used(it, place)) else {
                        continue;
                    };
                    let Some((_, ty)) = made
                        .get(&value)
                        .filter(|(block, _)| self.within.contains(block))
                    else {
                        continue;
                    };
                    let place = *places.entry(value).or_insert(uses.len());
                    if place == uses.len() {
                        uses.push((value, *ty, 0));
                    }
                    uses[place].2 += 1;
                }
            }
        }
        let several = uses.into_iter().filter(|(.., count)| *count > 1);
        several.map(|(value, ty, _)| (value, ty)).collect()
    }

    /// Whether an operand of an instruction behind the loop is used there: one of `OpPhi` is where it comes from.
    fn is_used(&self, it: &Instruction, place: usize) -> bool {
        let comes_from = || id(it, place + 1);
        op(it) != Op::Phi
            || place.is_multiple_of(2)
                && comes_from().is_some_and(|from| self.labels.contains(&from))
    }

    /// Copies values where the loop is left, and puts the copies in their places behind that.
    fn put(&self, function: &mut Function, copies: &[Copy]) {
        if copies.is_empty() {
            return;
        }
        let copy_of: HashMap<Word, Word> = copies.iter().map(|it| (it.value, it.copy)).collect();
        for block in &self.behind {
            for it in &mut function.blocks[*block].instructions {
                for place in 0..it.operands.len() {
                    if let Some(copy) = id(it, place).and_then(|value| copy_of.get(&value))
                        && self.is_used(it, place)
                    {
                        it.operands[place] = Operand::IdRef(*copy);
                    }
                }
            }
        }
        let instructions = &mut function.blocks[self.merge].instructions;
        let first = instructions
            .iter()
            .position(|it| !matches!(op(it), Op::Phi | Op::Line | Op::NoLine))
            .unwrap_or(instructions.len());
        let made = copies.iter().map(|it| {
            let value = vec![Operand::IdRef(it.value)];
            Instruction::new(Op::CopyObject, Some(it.ty), Some(it.copy), value)
        });
        instructions.splice(first..first, made);
    }
}

#[cfg(test)]
mod tests {
    use super::super::load;
    use super::super::tests::of_wgsl;
    use crate::finish::{optimise, validate};
    use crate::spirv::store;

    use super::*;

    /// How many copies a kernel has that ends so after its loop.
    fn copies(behind: &str) -> usize {
        let module = of_wgsl(&format!(
            "@group(0) @binding(0) var<storage> x: array<u32>;
             @group(0) @binding(1) var<storage, read_write> out: array<u32>;
             @compute @workgroup_size(1) fn main(@builtin(global_invocation_id) id: vec3<u32>) {{
                 var sum = 0u; var product = 1u;
                 for (var i = 0u; i < x[id.x]; i++) {{ sum += x[i]; product *= x[i]; }}
                 {behind}
             }}"
        ));
        let (words, _) = optimise(module, "test").unwrap();
        let mut module = load(&words, "test").unwrap();
        copy_behind_loops(&mut module);
        validate(&store(&module), "test").unwrap();
        let all = module.functions.iter().flat_map(|it| it.all_inst_iter());
        all.filter(|it| op(it) == Op::CopyObject).count()
    }

    #[test]
    fn what_is_used_twice_is_copied_once() {
        assert_eq!(copies("out[0] = sum;"), 0);
        assert_eq!(
            copies("out[0] = sum + 1u; out[1] = sum ^ 9u; out[2] = sum * 7u;"),
            1
        );
        assert_eq!(
            copies("out[0] = sum + 1u; out[1] = sum ^ product; out[2] = product;"),
            2
        );
        assert_eq!(
            copies("let i = id.y; out[i] = i + 1u;"),
            0,
            "nothing of the loop"
        );
    }
}
