//! One order for what a module declares, and one numbering of its ids, both by where it is used.
//!
//! rust-gpu links all entry points of a crate before it divides them, so the order of a module's types and
//! constants depends on the crate's other entry points, and what spirv-opt and naga write follows from that
//! order. After this, the same functions give the same module: a shader does not change when another one is added
//! to its crate, and one that is compiled alone is the one that is compiled among all.

use std::collections::{HashMap, HashSet};

use rspirv::binary::Assemble;
use rspirv::dr::{Function, Instruction, Module, Operand};
use rspirv::spirv::{Decoration, Op, Word};

use super::{decoration, id, op};

/// Orders types, constants, variables, functions and annotations, and numbers all ids anew.
///
/// Variables with a binding come first, by set and binding, then those with a built-in or a location; all else
/// follows as functions use it, from the entry point on; so do the variables of a function. Modules with instructions
/// for which the order has a meaning of its own, which rust-gpu does not write, stay as they are.
pub fn order(module: &mut Module) {
    let globals = &module.types_global_values;
    let has_own_order = globals.iter().any(|it| it.result_id.is_none())
        || module.annotations.iter().any(is_group)
        || module.entry_points.len() != 1;
    if has_own_order {
        return;
    }
    order_functions(module);
    for function in &mut module.functions {
        order_variables(function);
    }
    order_globals(module);
    let numbers = Numbers::of(module);
    numbers.apply(module);
    module.capabilities.sort_by_key(Assemble::assemble);
    module.capabilities.dedup();
    module.extensions.sort_by_key(Assemble::assemble);
    module.execution_modes.sort_by_key(Assemble::assemble);
    for entry in &mut module.entry_points {
        // The execution model, the function and the name stand before the variables.
        entry.operands[3..].sort_by_key(|operand| operand.id_ref_any());
    }
    let target = |it: &Instruction| (id(it, 0), it.assemble());
    module.annotations.sort_by_key(target);
    module.debug_names.sort_by_key(target);
}

fn is_group(annotation: &Instruction) -> bool {
    matches!(
        op(annotation),
        Op::DecorationGroup | Op::GroupDecorate | Op::GroupMemberDecorate
    )
}

/// The entry point first, then functions as they are called.
fn order_functions(module: &mut Module) {
    let mut rest: Vec<Option<Function>> = module.functions.drain(..).map(Some).collect();
    let place: HashMap<Word, usize> = rest
        .iter()
        .enumerate()
        .filter_map(|(i, f)| Some((f.as_ref()?.def_id()?, i)))
        .collect();
    let mut wanted: Vec<Word> = module
        .entry_points
        .iter()
        .filter_map(|it| id(it, 1))
        .collect();
    let mut next = 0;
    while let Some(function) = wanted.get(next) {
        next += 1;
        let Some(function) = place.get(function).and_then(|i| rest[*i].take()) else {
            continue;
        };
        let calls = function
            .all_inst_iter()
            .filter(|it| op(it) == Op::FunctionCall);
        wanted.extend(calls.filter_map(|it| id(it, 0)));
        module.functions.push(function);
    }
    module.functions.extend(rest.into_iter().flatten());
}

/// Variables as the function uses them: rust-gpu puts those of an inlined function where no line of the source is
/// known, so their order depends on whether lines are.
fn order_variables(function: &mut Function) {
    let mut uses: HashMap<Word, usize> = HashMap::new();
    for instruction in function.all_inst_iter() {
        for used in ids(instruction) {
            let next = uses.len();
            uses.entry(used).or_insert(next);
        }
    }
    let Some(first) = function.blocks.first_mut() else {
        return;
    };
    let places = first.instructions.iter().enumerate();
    let places: Vec<usize> = places
        .filter(|(_, it)| op(it) == Op::Variable)
        .map(|(place, _)| place)
        .collect();
    let mut variables: Vec<Instruction> = places
        .iter()
        .map(|place| first.instructions[*place].clone())
        .collect();
    let first_use = |it: &Instruction| it.result_id.and_then(|id| uses.get(&id).copied());
    variables.sort_by_key(|it| first_use(it).unwrap_or(usize::MAX));
    for (place, variable) in places.into_iter().zip(variables) {
        first.instructions[place] = variable;
    }
}

/// What is declared outside of functions, each after what it needs itself.
fn order_globals(module: &mut Module) {
    let globals = std::mem::take(&mut module.types_global_values);
    let place: HashMap<Word, usize> = globals
        .iter()
        .enumerate()
        .filter_map(|(i, it)| Some((it.result_id?, i)))
        .collect();
    let mut interface: Vec<(u8, u32, u32, Word)> = globals
        .iter()
        .filter(|it| op(it) == Op::Variable)
        .filter_map(|it| {
            let variable = it.result_id?;
            let of = |which| decoration(module, variable, which);
            let built_in = || {
                module
                    .annotations
                    .iter()
                    .find_map(|note| match note.operands.get(1..3)? {
                        [
                            Operand::Decoration(Decoration::BuiltIn),
                            Operand::BuiltIn(which),
                        ] if id(note, 0) == Some(variable) => Some(*which as u32),
                        _ => None,
                    })
            };
            if let (Some(set), Some(binding)) =
                (of(Decoration::DescriptorSet), of(Decoration::Binding))
            {
                return Some((0, set, binding, variable));
            }
            if let Some(which) = built_in() {
                return Some((1, which, 0, variable));
            }
            // Inputs and outputs each have locations of their own.
            let class = it.operands.first().map(Assemble::assemble);
            let class = class.and_then(|words| words.first().copied());
            Some((2, of(Decoration::Location)?, class.unwrap_or(0), variable))
        })
        .collect();
    interface.sort_unstable();

    let mut order = Order {
        globals: &globals,
        place: &place,
        seen: HashSet::new(),
        ordered: Vec::with_capacity(globals.len()),
    };
    for (.., variable) in interface {
        order.visit(variable);
    }
    for instruction in module.functions.iter().flat_map(Function::all_inst_iter) {
        for used in ids(instruction) {
            order.visit(used);
        }
    }
    for instruction in module.execution_modes.iter().chain(&module.entry_points) {
        for used in ids(instruction) {
            order.visit(used);
        }
    }
    // What nothing uses.
    for instruction in &globals {
        order.visit(instruction.result_id.unwrap_or(0));
    }
    let ordered = order.ordered;
    let mut globals: Vec<Option<Instruction>> = globals.into_iter().map(Some).collect();
    module.types_global_values = ordered
        .into_iter()
        .filter_map(|i| globals[i].take())
        .collect();
}

/// The ids that an instruction uses, its type first.
fn ids(instruction: &Instruction) -> impl Iterator<Item = Word> {
    let operands = instruction.operands.iter().filter_map(Operand::id_ref_any);
    instruction.result_type.into_iter().chain(operands)
}

struct Order<'a> {
    globals: &'a [Instruction],
    place: &'a HashMap<Word, usize>,
    seen: HashSet<usize>,
    ordered: Vec<usize>,
}

impl Order<'_> {
    /// Puts an instruction after all that it uses, and those after what they use, and so on.
    fn visit(&mut self, wanted: Word) {
        let Some(&first) = self.place.get(&wanted) else {
            return;
        };
        if !self.seen.insert(first) {
            return;
        }
        let used = |i: usize| ids(&self.globals[i]).collect::<Vec<_>>().into_iter();
        let mut open = vec![(first, used(first))];
        while let Some((instruction, rest)) = open.last_mut() {
            match rest.next() {
                Some(next) => {
                    if let Some(&next) = self.place.get(&next)
                        && self.seen.insert(next)
                    {
                        open.push((next, used(next)));
                    }
                }
                None => {
                    self.ordered.push(*instruction);
                    open.pop();
                }
            }
        }
    }
}

/// New ids.
struct Numbers(HashMap<Word, Word>);

impl Numbers {
    /// In the order of definitions.
    fn of(module: &Module) -> Self {
        let mut numbers = HashMap::new();
        let mut number = |id: Word| {
            let next = numbers.len() as Word + 1;
            numbers.entry(id).or_insert(next);
        };
        let defined = module
            .ext_inst_imports
            .iter()
            .chain(&module.types_global_values)
            .chain(module.functions.iter().flat_map(Function::all_inst_iter))
            .chain(&module.debug_string_source);
        for id in defined.filter_map(|it| it.result_id) {
            number(id);
        }
        // Names of what does not exist.
        for instruction in module.all_inst_iter() {
            for id in ids(instruction) {
                number(id);
            }
        }
        Self(numbers)
    }

    fn apply(&self, module: &mut Module) {
        let new = |id: Word| self.0.get(&id).copied().unwrap_or(id);
        for instruction in module.all_inst_iter_mut() {
            instruction.result_type = instruction.result_type.map(new);
            instruction.result_id = instruction.result_id.map(new);
            for operand in &mut instruction.operands {
                if let Some(id) = operand.id_ref_any_mut() {
                    *id = new(*id);
                }
            }
        }
        if let Some(header) = &mut module.header {
            header.bound = self.0.len() as Word + 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spirv::store;
    use crate::spirv::tests::of_wgsl;

    const TEXT: &str = "
        struct Row { a: vec4<f32>, b: u32 }
        @group(0) @binding(2) var<storage, read_write> out: array<Row>;
        @group(0) @binding(0) var<uniform> scale: vec4<f32>;
        @group(0) @binding(1) var<storage, read> rows: array<Row>;
        var<workgroup> shared_rows: array<f32, 64>;
        fn turned(row: Row) -> Row { return Row(row.a.wzyx * scale, row.b + 7u); }
        @compute @workgroup_size(64)
        fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) me: u32) {
            shared_rows[me] = 3.0;
            workgroupBarrier();
            var i = 0u;
            var sum = 0.0;
            loop {
                sum += shared_rows[i & 63u];
                if i >= arrayLength(&rows) { break; }
                out[i] = turned(rows[i]);
                out[i].a.x += shared_rows[63u - me] + sum;
                i += 64u + id.x;
            }
        }";

    fn module() -> Module {
        of_wgsl(TEXT)
    }

    /// The same module with other numbers, and what may be declared in any order in another one.
    fn shuffled(mut module: Module, seed: u32) -> Module {
        let factor = 2 * seed + 1;
        let new = |id: Word| (id * factor) % 1009 + 1;
        for instruction in module.all_inst_iter_mut() {
            instruction.result_type = instruction.result_type.map(new);
            instruction.result_id = instruction.result_id.map(new);
            for operand in &mut instruction.operands {
                if let Some(id) = operand.id_ref_any_mut() {
                    *id = new(*id);
                }
            }
        }
        if let Some(header) = &mut module.header {
            header.bound = 1010;
        }
        // As late as its first use allows, for every second one.
        let mut i = module.types_global_values.len();
        while i > 1 {
            i -= 1;
            let (this, next) = (
                &module.types_global_values[i - 1],
                &module.types_global_values[i],
            );
            let used = this
                .result_id
                .is_some_and(|it| ids(next).any(|id| id == it));
            if !used && (i as u32 + seed).is_multiple_of(2) {
                module.types_global_values.swap(i - 1, i);
            }
        }
        module.annotations.reverse();
        module.debug_names.reverse();
        module.capabilities.reverse();
        let functions = module.functions.len();
        module.functions.rotate_left(seed as usize % functions);
        for function in &mut module.functions {
            let block = &mut function.blocks[0].instructions;
            let variables = block.iter().take_while(|it| op(it) == Op::Variable).count();
            block[..variables].rotate_left(seed as usize % variables.max(1));
        }
        module
    }

    #[test]
    fn one_program_is_one_module() {
        let mut expected = module();
        order(&mut expected);
        let expected = store(&expected);
        for seed in 1..9 {
            let mut other = shuffled(module(), seed);
            assert_ne!(store(&other), expected);
            order(&mut other);
            assert_eq!(store(&other), expected, "seed {seed}");
        }
    }

    #[test]
    fn bindings_come_first_in_their_order() {
        let mut module = module();
        order(&mut module);
        let of = |which: Decoration| {
            let variables = module.types_global_values.iter();
            variables
                .filter_map(|it| decoration(&module, it.result_id?, which))
                .collect::<Vec<_>>()
        };
        assert_eq!(of(Decoration::Binding), [0, 1, 2]);
    }

    #[test]
    fn ordering_twice_changes_nothing() {
        let mut once = module();
        order(&mut once);
        let mut twice = once.clone();
        order(&mut twice);
        assert_eq!(store(&once), store(&twice));
    }
}
