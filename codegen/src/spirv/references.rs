//! References that are chosen while a kernel runs: `a.iter().find(…)`, `Some(&a[i])` that is taken apart again.
//!
//! rust-gpu leaves them as pointers in structures, and as pointers from one of several blocks (`OpPhi`). A shader has
//! neither. Where all of them lead into one variable, the indices are chosen instead, and the pointer is made of them
//! where it is used.

use std::collections::{HashMap, HashSet};

use rspirv::dr::{Function, Instruction, Module, Operand};
use rspirv::spirv::{Op, StorageClass, Word};

use super::edit::Editor;
use super::{id, literal, op};
use crate::error::{Failure, Step};

/// Textures and samplers, which spirv-opt resolves.
const HANDLE: Operand = Operand::StorageClass(StorageClass::UniformConstant);

/// Makes pointers such as a shader may have. Tells whether there were any, and which is the first that could not be made
/// one: a reference is chosen among several variables, or kept in memory, which spirv-opt may still resolve.
pub fn resolve(module: &mut Module, kernel: &str) -> (bool, Option<Failure>) {
    let pointers: HashSet<Word> = module
        .types_global_values
        .iter()
        .filter(|it| op(it) == Op::TypePointer && it.operands.first() != Some(&HANDLE))
        .filter_map(|it| it.result_id)
        .collect();
    let (mut changed, mut left) = (false, None);
    for number in 0..module.functions.len() {
        let (edits, is_resolved) = Resolver::new(module, number, &pointers).edits();
        if !is_resolved {
            left = Some(Failure {
                kernel: kernel.into(),
                step: Step::Meaning,
                construct: None,
                message: "a reference to one of several arrays or variables is chosen while the kernel runs: \
                          choose a value (`*a` or `a[i]`), or an index into one array"
                    .into(),
                panicked: false,
            });
        }
        changed |= !edits.made.is_empty();
        apply(module, number, edits);
    }
    (changed, left)
}

/// Forwards stores to loads, of variables that hold a pointer and are written once: rust-gpu keeps them
/// where one closure holds another one that holds a reference. A shader's variables hold no pointers. Tells whether there
/// was one.
pub fn forward_stores(module: &mut Module) -> bool {
    let mut holders: HashSet<Word> = HashSet::new();
    for it in module
        .types_global_values
        .iter()
        .filter(|it| op(it) == Op::TypePointer)
    {
        let pointee = id(it, 1).and_then(|ty| super::global(module, ty));
        let is_pointer = pointee.is_some_and(|it| op(it) == Op::TypePointer);
        if let (true, Some(ty)) = (is_pointer, it.result_id) {
            holders.insert(ty);
        }
    }
    let mut removed: HashSet<Word> = HashSet::new();
    for function in &mut module.functions {
        // The variable that each name stands for, and what is written to it.
        let mut variables: HashMap<Word, Word> = HashMap::new();
        let mut written: HashMap<Word, Vec<Word>> = HashMap::new();
        for it in function.all_inst_iter() {
            let (Some(result), Some(ty)) = (it.result_id, it.result_type) else {
                continue;
            };
            match op(it) {
                Op::Variable if holders.contains(&ty) && it.operands.len() == 1 => {
                    variables.insert(result, result);
                    written.insert(result, Vec::new());
                }
                Op::CopyObject => {
                    let variable = id(it, 0).and_then(|of| variables.get(&of).copied());
                    variables.extend(variable.map(|variable| (result, variable)));
                }
                _ => {}
            }
        }
        for it in function.all_inst_iter() {
            for (place, operand) in it.operands.iter().enumerate() {
                let Some(variable) = operand.id_ref_any().and_then(|it| variables.get(&it)) else {
                    continue;
                };
                match (op(it), place) {
                    (Op::Load | Op::CopyObject, 0) => {}
                    (Op::Store, 0) => {
                        let all = written.get_mut(variable).into_iter();
                        all.for_each(|all| all.extend(id(it, 1)));
                    }
                    _ => {
                        written.remove(variable);
                    }
                }
            }
        }
        written.retain(|_, values| values.len() == 1);
        if written.is_empty() {
            continue;
        }
        let held = |it: &Instruction| {
            let variable = variables.get(&id(it, 0)?)?;
            written.get(variable)?.first().copied()
        };
        for block in &mut function.blocks {
            block.instructions.retain_mut(|it| {
                let is_gone = match op(it) {
                    Op::Variable | Op::CopyObject => it
                        .result_id
                        .and_then(|name| variables.get(&name))
                        .is_some_and(|variable| written.contains_key(variable)),
                    Op::Store => held(it).is_some(),
                    Op::Load => {
                        if let Some(value) = held(it) {
                            let (ty, result) = (it.result_type, it.result_id);
                            let value = vec![Operand::IdRef(value)];
                            *it = Instruction::new(Op::CopyObject, ty, result, value);
                        }
                        false
                    }
                    _ => false,
                };
                removed.extend(it.result_id.filter(|_| is_gone));
                !is_gone
            });
        }
    }
    let is_there = |it: &Instruction| id(it, 0).is_none_or(|of| !removed.contains(&of));
    module.debug_names.retain(is_there);
    module.annotations.retain(is_there);
    !removed.is_empty()
}

/// Makes each pointer into a variable of the function in the block where it is used: one of several blocks would be a
/// variable of its own to naga, which cannot hold a pointer.
pub fn near(module: &mut Module) {
    let Some(mut bound) = module.header.as_ref().map(|header| header.bound) else {
        return;
    };
    for function in &mut module.functions {
        let is_chain =
            |it: &Instruction| matches!(op(it), Op::AccessChain | Op::InBoundsAccessChain);
        let local: HashSet<Word> = function
            .all_inst_iter()
            .filter(|it| op(it) == Op::Variable)
            .filter_map(|it| it.result_id)
            .collect();
        let chains: HashMap<Word, Instruction> = function
            .all_inst_iter()
            .filter(|it| is_chain(it) && id(it, 0).is_some_and(|base| local.contains(&base)))
            .filter_map(|it| Some((it.result_id?, it.clone())))
            .collect();
        for block in &mut function.blocks {
            // The names that pointers have here.
            let mut here: HashMap<Word, Word> = HashMap::new();
            let mut instructions = Vec::new();
            for mut it in std::mem::take(&mut block.instructions) {
                for operand in &mut it.operands {
                    let Operand::IdRef(value) = operand else {
                        continue;
                    };
                    let Some(chain) = chains.get(value) else {
                        continue;
                    };
                    let name = *here.entry(*value).or_insert_with(|| {
                        bound += 1;
                        let mut copy = chain.clone();
                        copy.result_id = Some(bound - 1);
                        instructions.push(copy);
                        bound - 1
                    });
                    *value = name;
                }
                if let Some(result) = it.result_id.filter(|it| chains.contains_key(it)) {
                    here.insert(result, result);
                }
                instructions.push(it);
            }
            block.instructions = instructions;
        }
    }
    if let Some(header) = &mut module.header {
        header.bound = bound;
    }
}

/// Removes structures of pointers that nobody uses, which spirv-opt leaves: naga knows no such type. Whether there was
/// one.
pub fn sweep(module: &mut Module) -> bool {
    let is_pointer = |ty: &Word| {
        let found = super::global(module, *ty);
        found.is_some_and(|it| op(it) == Op::TypePointer)
    };
    let mut holders: HashSet<Word> = HashSet::new();
    for it in &module.types_global_values {
        let members: Vec<Word> = it.operands.iter().filter_map(Operand::id_ref_any).collect();
        let holds = members
            .iter()
            .any(|ty| is_pointer(ty) || holders.contains(ty));
        if let (Op::TypeStruct, Some(ty), true) = (op(it), it.result_id, holds) {
            holders.insert(ty);
        }
    }
    if holders.is_empty() {
        return false;
    }
    let nothing: HashSet<Word> = module
        .types_global_values
        .iter()
        .filter(|it| matches!(op(it), Op::Undef | Op::ConstantNull))
        .filter(|it| it.result_type.is_some_and(|ty| holders.contains(&ty)))
        .filter_map(|it| it.result_id)
        .collect();
    let mut changed = false;
    for function in &mut module.functions {
        // A part of nothing is nothing.
        for it in function.all_inst_iter_mut() {
            let of_nothing = id(it, 0).is_some_and(|it| nothing.contains(&it));
            if op(it) == Op::CompositeExtract && of_nothing {
                *it = Instruction::new(Op::Undef, it.result_type, it.result_id, Vec::new());
                changed = true;
            }
        }
        loop {
            let used: HashSet<Word> = function
                .all_inst_iter()
                .flat_map(|it| it.operands.iter().filter_map(Operand::id_ref_any))
                .collect();
            let held: HashSet<Word> = function
                .all_inst_iter()
                .filter(|it| it.result_type.is_some_and(|ty| holders.contains(&ty)))
                .filter_map(|it| it.result_id)
                .collect();
            let before: usize = function.blocks.iter().map(|it| it.instructions.len()).sum();
            for block in &mut function.blocks {
                block.instructions.retain(|it| {
                    let is_made = matches!(
                        op(it),
                        Op::CompositeConstruct
                            | Op::CompositeInsert
                            | Op::Undef
                            | Op::Phi
                            | Op::Select
                    );
                    let is_unused = it.result_id.is_some_and(|it| !used.contains(&it));
                    let is_held = it.result_id.is_some_and(|it| held.contains(&it));
                    let is_taken = op(it) == Op::CompositeExtract;
                    !(is_unused && (is_made && is_held || is_taken))
                });
            }
            let after: usize = function.blocks.iter().map(|it| it.instructions.len()).sum();
            if after == before {
                break;
            }
            changed = true;
        }
    }
    changed
}

/// Whether an instruction gives a pointer that a shader may not have.
fn is_chosen(pointers: &HashSet<Word>, it: &Instruction) -> bool {
    let chosen = matches!(
        op(it),
        Op::CompositeExtract | Op::Phi | Op::Select | Op::Load
    );
    chosen && it.result_type.is_some_and(|ty| pointers.contains(&ty))
}

/// Where a pointer comes from.
#[derive(Clone, Debug)]
enum Source {
    /// A variable, and indices into it.
    Place { base: Word, indices: Vec<Word> },
    /// Another one from each block that comes before this one.
    Phi {
        block: usize,
        from: Vec<(usize, Word)>,
    },
    /// One of two.
    Select {
        block: usize,
        place: usize,
        condition: Word,
        of: [usize; 2],
    },
    /// That of another value.
    Same(usize),
    /// Nothing that is used.
    Undefined,
    /// What cannot be followed.
    Unknown,
}

/// What is done to a function.
#[derive(Default)]
struct Edits {
    /// Instructions that choose indices: for a block, at its start.
    phis: Vec<(usize, Instruction)>,
    /// The same, before the instruction in a place of a block.
    selects: Vec<((usize, usize), Instruction)>,
    /// Pointers made of indices, for the instructions in these places.
    made: HashMap<(usize, usize), Instruction>,
    /// How many ids are new.
    bound: Word,
    /// Constants that stand for an index that nobody uses, by their type.
    zeros: HashMap<Word, Word>,
}

/// What makes an id, and in the function its block and its place there.
type Made<'a> = (&'a Instruction, Option<(usize, usize)>);

struct Resolver<'a> {
    function: &'a Function,
    pointers: &'a HashSet<Word>,
    made: HashMap<Word, Made<'a>>,
    sources: Vec<Source>,
    known: HashMap<(Word, Vec<u32>), usize>,
    edits: Edits,
    /// The ids that choose an index of a source.
    indices: HashMap<(usize, usize), Word>,
}

impl<'a> Resolver<'a> {
    fn new(module: &'a Module, number: usize, pointers: &'a HashSet<Word>) -> Self {
        let function = &module.functions[number];
        let globals = module.types_global_values.iter();
        let outside = globals.chain(&function.parameters);
        let outside = outside.filter_map(|it| Some((it.result_id?, (it, None))));
        let inside = each(function).filter_map(|(at, it)| Some((it.result_id?, (it, Some(at)))));
        Self {
            function,
            pointers,
            made: outside.chain(inside).collect(),
            sources: Vec::new(),
            known: HashMap::new(),
            edits: Edits {
                bound: module.header.as_ref().map_or(0, |header| header.bound),
                ..Edits::default()
            },
            indices: HashMap::new(),
        }
    }

    /// What to do, and whether that is enough for every pointer that is chosen.
    fn edits(mut self) -> (Edits, bool) {
        let mut is_resolved = true;
        for (at, it) in each(self.function) {
            let (true, Some(result)) = (is_chosen(self.pointers, it), it.result_id) else {
                continue;
            };
            let source = self.source(result, Vec::new());
            match self.pointer(source, it) {
                Some(made) => {
                    self.edits.made.insert(at, made);
                }
                None => is_resolved = false,
            }
        }
        (self.edits, is_resolved)
    }

    /// The source of the part `path` of a value.
    fn source(&mut self, value: Word, path: Vec<u32>) -> usize {
        let key = (value, path);
        if let Some(found) = self.known.get(&key) {
            return *found;
        }
        let number = self.sources.len();
        self.sources.push(Source::Unknown);
        self.known.insert(key.clone(), number);
        let source = self.follow(key.0, key.1);
        self.sources[number] = source;
        number
    }

    fn follow(&mut self, value: Word, path: Vec<u32>) -> Source {
        let Some(&(it, at)) = self.made.get(&value) else {
            return Source::Unknown;
        };
        // What another value has in place of this one.
        let same = |this: &mut Self, value: Option<Word>, path: Vec<u32>| match value {
            Some(value) => Source::Same(this.source(value, path)),
            None => Source::Unknown,
        };
        let literals = |from: usize| (from..it.operands.len()).map_while(|i| literal(it, i));
        match (op(it), at) {
            (Op::Undef | Op::ConstantNull, _) => Source::Undefined,
            (Op::CopyObject, _) => same(self, id(it, 0), path),
            (Op::CompositeExtract, _) => {
                let path = literals(1).chain(path).collect();
                same(self, id(it, 0), path)
            }
            (Op::CompositeConstruct | Op::ConstantComposite, _) if !path.is_empty() => {
                same(self, id(it, path[0] as usize), path[1..].to_vec())
            }
            (Op::CompositeInsert, _) if !path.is_empty() => {
                let place: Vec<u32> = literals(2).collect();
                match path.strip_prefix(place.as_slice()) {
                    Some(rest) => same(self, id(it, 0), rest.to_vec()),
                    None => same(self, id(it, 1), path),
                }
            }
            (Op::Phi, Some((block, _))) => {
                let from = it
                    .operands
                    .as_chunks()
                    .0
                    .iter()
                    .filter_map(|[value, parent]| {
                        let value = self.source(value.id_ref_any()?, path.clone());
                        Some((value, parent.id_ref_any()?))
                    });
                Source::Phi {
                    block,
                    from: from.collect(),
                }
            }
            (Op::Select, Some((block, place))) => match (id(it, 0), id(it, 1), id(it, 2)) {
                (Some(condition), Some(yes), Some(no)) => Source::Select {
                    block,
                    place,
                    condition,
                    of: [self.source(yes, path.clone()), self.source(no, path)],
                },
                _ => Source::Unknown,
            },
            (Op::AccessChain | Op::InBoundsAccessChain, _) if path.is_empty() => {
                let Some(base) = id(it, 0) else {
                    return Source::Unknown;
                };
                let base = self.source(base, Vec::new());
                match self.sources[self.behind(base)].clone() {
                    Source::Place { base, mut indices } => {
                        indices.extend(it.operands.iter().skip(1).filter_map(Operand::id_ref_any));
                        Source::Place { base, indices }
                    }
                    _ => Source::Unknown,
                }
            }
            (Op::Variable | Op::FunctionParameter, _) if path.is_empty() => Source::Place {
                base: value,
                indices: Vec::new(),
            },
            _ => Source::Unknown,
        }
    }

    /// The source that others are the same as.
    fn behind(&self, mut source: usize) -> usize {
        // Values that are each other, which there are in loops that nothing enters, end somewhere.
        for _ in 0..self.sources.len() {
            match self.sources[source] {
                Source::Same(other) => source = other,
                _ => break,
            }
        }
        source
    }

    /// The pointer of a source, for the instruction `instead` of which it stands; none if there is none.
    fn pointer(&mut self, source: usize, instead: &Instruction) -> Option<Instruction> {
        let places = self.places(source)?;
        let (base, first) = places.first()?.clone();
        let alike =
            |(other, indices): &(Word, Vec<Word>)| *other == base && indices.len() == first.len();
        if !places.iter().all(alike) {
            return None;
        }
        let mut operands = vec![Operand::IdRef(base)];
        for place in 0..first.len() {
            let ty = self.index_type(first[place])?;
            for (_, indices) in &places {
                if self.index_type(indices[place])? != ty {
                    return None;
                }
            }
            // A constant is the same everywhere; what is computed for one block need not be there in this one.
            let constant = self.made.get(&first[place])?.1.is_none();
            let same = places.iter().all(|(_, it)| it[place] == first[place]);
            let is_place = matches!(self.sources[self.behind(source)], Source::Place { .. });
            let index = if same && (constant || is_place) {
                first[place]
            } else {
                self.index(source, place, ty)
            };
            operands.push(Operand::IdRef(index));
        }
        let made = match operands.len() {
            1 => Op::CopyObject,
            _ => Op::InBoundsAccessChain,
        };
        let (ty, result) = (instead.result_type, instead.result_id);
        Some(Instruction::new(made, ty, result, operands))
    }

    /// All places that a source may be; none if one is unknown.
    fn places(&self, source: usize) -> Option<Vec<(Word, Vec<Word>)>> {
        let mut places = Vec::new();
        let (mut seen, mut left) = (HashSet::new(), vec![source]);
        while let Some(next) = left.pop() {
            if !seen.insert(next) {
                continue;
            }
            match &self.sources[next] {
                Source::Place { base, indices } => places.push((*base, indices.clone())),
                Source::Phi { from, .. } => left.extend(from.iter().map(|(it, _)| *it)),
                Source::Select { of, .. } => left.extend(of),
                Source::Same(other) => left.push(*other),
                Source::Undefined => {}
                Source::Unknown => return None,
            }
        }
        Some(places)
    }

    fn index_type(&self, index: Word) -> Option<Word> {
        self.made.get(&index)?.0.result_type
    }

    /// The id of an index of a source, which is chosen as the source is.
    fn index(&mut self, source: usize, place: usize, ty: Word) -> Word {
        let source = self.behind(source);
        if let Some(found) = self.indices.get(&(source, place)) {
            return *found;
        }
        match self.sources[source].clone() {
            Source::Place { indices, .. } => indices[place],
            Source::Same(_) | Source::Undefined | Source::Unknown => {
                match self.edits.zeros.get(&ty) {
                    Some(zero) => *zero,
                    None => {
                        let zero = self.new_id();
                        self.edits.zeros.insert(ty, zero);
                        zero
                    }
                }
            }
            Source::Phi { block, from } => {
                let result = self.new_id();
                self.indices.insert((source, place), result);
                let operands = from.iter().flat_map(|(it, parent)| {
                    let value = self.index(*it, place, ty);
                    [Operand::IdRef(value), Operand::IdRef(*parent)]
                });
                let operands = operands.collect();
                let phi = Instruction::new(Op::Phi, Some(ty), Some(result), operands);
                self.edits.phis.push((block, phi));
                result
            }
            Source::Select {
                block,
                place: at,
                condition,
                of,
            } => {
                let result = self.new_id();
                self.indices.insert((source, place), result);
                let [yes, no] = of.map(|it| self.index(it, place, ty));
                let operands = [condition, yes, no].map(Operand::IdRef).to_vec();
                let select = Instruction::new(Op::Select, Some(ty), Some(result), operands);
                self.edits.selects.push(((block, at), select));
                result
            }
        }
    }

    fn new_id(&mut self) -> Word {
        self.edits.bound += 1;
        self.edits.bound - 1
    }
}

/// The instructions of a function with the numbers of their blocks and their places there.
fn each(function: &Function) -> impl Iterator<Item = ((usize, usize), &Instruction)> {
    let blocks = function.blocks.iter().enumerate();
    blocks.flat_map(|(number, block)| {
        let instructions = block.instructions.iter().enumerate();
        instructions.map(move |(place, it)| ((number, place), it))
    })
}

fn apply(module: &mut Module, number: usize, mut edits: Edits) {
    if let Some(header) = &mut module.header {
        header.bound = edits.bound;
    }
    let mut names: HashMap<Word, Word> = HashMap::new();
    for (ty, zero) in &edits.zeros {
        names.insert(*zero, Editor::new(module).integer(*ty, 0));
    }
    for (number, block) in module.functions[number].blocks.iter_mut().enumerate() {
        let mut phis = Vec::new();
        let mut rest = Vec::new();
        for (place, it) in std::mem::take(&mut block.instructions)
            .into_iter()
            .enumerate()
        {
            let at = (number, place);
            let selects = edits.selects.iter().filter(|(before, _)| *before == at);
            rest.extend(selects.map(|(_, select)| select.clone()));
            match edits.made.remove(&at) {
                Some(made) => rest.push(made),
                None if op(&it) == Op::Phi => phis.push(it),
                None => rest.push(it),
            }
        }
        let own = edits.phis.iter().filter(|(block, _)| *block == number);
        phis.extend(own.map(|(_, phi)| phi.clone()));
        phis.extend(rest);
        for operand in phis.iter_mut().flat_map(|it| &mut it.operands) {
            if let Operand::IdRef(value) = operand {
                *value = *names.get(value).unwrap_or(value);
            }
        }
        block.instructions = phis;
    }
}

#[cfg(test)]
mod tests {
    use rspirv::dr::Builder;
    use rspirv::spirv::{FunctionControl, SelectionControl};

    use super::*;
    use crate::finish::validate;
    use crate::spirv::store;

    /// Types and values of a test.
    struct Given {
        word: Word,
        pointer: Word,
        /// A structure of a word and a pointer.
        maybe: Word,
        one: Word,
        /// Variables: two arrays of four words.
        arrays: [Word; 2],
        /// An index.
        index: Word,
    }

    /// What a branch chooses.
    type Arm = dyn Fn(&mut Builder, &Given) -> Word;

    /// `if c { left } else { right }`, and what `after` makes of both.
    fn module(
        arms: [&Arm; 2],
        of: impl Fn(&Given) -> Word,
        after: impl FnOnce(&mut Builder, &Given, Word) -> Word,
    ) -> Module {
        use rspirv::spirv::{AddressingModel, Capability, ExecutionModel, MemoryModel};
        let mut b = Builder::new();
        b.set_version(1, 5);
        b.capability(Capability::Shader);
        b.memory_model(AddressingModel::Logical, MemoryModel::GLSL450);
        let (void, word, truth) = (b.type_void(), b.type_int(32, 0), b.type_bool());
        let [zero, one, four] = [0, 1, 4].map(|n| b.constant_bit32(word, n));
        let array = b.type_array(word, four);
        let pointer = b.type_pointer(None, StorageClass::Function, word);
        let to_array = b.type_pointer(None, StorageClass::Function, array);
        let maybe = b.type_struct([word, pointer]);
        let ty = b.type_function(void, []);
        let main = b
            .begin_function(void, None, FunctionControl::NONE, ty)
            .unwrap();
        b.begin_block(None).unwrap();
        let arrays = [(); 2].map(|()| b.variable(to_array, None, StorageClass::Function, None));
        let element = b
            .in_bounds_access_chain(pointer, None, arrays[0], [zero])
            .unwrap();
        let index = b.load(word, None, element, None, []).unwrap();
        let condition = b.u_less_than(truth, None, index, one).unwrap();
        let given = Given {
            word,
            pointer,
            maybe,
            one,
            arrays,
            index,
        };
        let [left, right, merge] = [b.id(), b.id(), b.id()];
        b.selection_merge(merge, SelectionControl::NONE).unwrap();
        b.branch_conditional(condition, left, right, []).unwrap();
        let mut values = Vec::new();
        for (block, arm) in [left, right].into_iter().zip(arms) {
            b.begin_block(Some(block)).unwrap();
            values.push((arm(&mut b, &given), block));
            b.branch(merge).unwrap();
        }
        b.begin_block(Some(merge)).unwrap();
        let both = b.phi(of(&given), None, values).unwrap();
        let chosen = after(&mut b, &given, both);
        let read = b.load(given.word, None, chosen, None, []).unwrap();
        b.store(element, read, None, []).unwrap();
        b.ret().unwrap();
        b.end_function().unwrap();
        b.entry_point(ExecutionModel::GLCompute, main, "main", []);
        b.execution_mode(main, rspirv::spirv::ExecutionMode::LocalSize, [1, 1, 1]);
        b.module()
    }

    fn element(b: &mut Builder, given: &Given, array: usize, index: Word) -> Word {
        let array = given.arrays[array];
        b.in_bounds_access_chain(given.pointer, None, array, [index])
            .unwrap()
    }

    fn count(module: &Module, wanted: Op) -> usize {
        let all = module.functions[0].all_inst_iter();
        all.filter(|it| op(it) == wanted).count()
    }

    #[test]
    fn of_two_elements_the_index_is_chosen() {
        let mut chosen = module(
            [&|b, it| element(b, it, 0, it.one), &|b, it| {
                element(b, it, 0, it.index)
            }],
            |it| it.pointer,
            |_, _, both| both,
        );
        assert!(validate(&store(&chosen), "k").is_err());
        assert_eq!(resolve(&mut chosen, "k"), (true, None));
        validate(&store(&chosen), "k").unwrap();
        assert_eq!(count(&chosen, Op::Phi), 1);
    }

    #[test]
    fn a_pointer_is_taken_out_of_a_structure_and_where_there_is_none_any_index_will_do() {
        let mut taken = module(
            [
                &|b, it| {
                    let pointer = element(b, it, 0, it.index);
                    b.composite_construct(it.maybe, None, [it.one, pointer])
                        .unwrap()
                },
                &|b, it| {
                    let nothing = b.undef(it.maybe, None);
                    b.composite_insert(it.maybe, None, it.index, nothing, [0])
                        .unwrap()
                },
            ],
            |it| it.maybe,
            |b, it, both| b.composite_extract(it.pointer, None, both, [1]).unwrap(),
        );
        assert_eq!(resolve(&mut taken, "k"), (true, None));
        validate(&store(&taken), "k").unwrap();
        // That of the structures is left to spirv-opt.
        assert_eq!(count(&taken, Op::Phi), 2);
    }

    #[test]
    fn a_variable_that_holds_a_pointer_is_what_was_written_to_it() {
        let mut held = module(
            [&|b, it| element(b, it, 0, it.one), &|b, it| {
                element(b, it, 0, it.index)
            }],
            |it| it.pointer,
            |b, it, both| {
                let ty = b.type_pointer(None, StorageClass::Function, it.pointer);
                let holder = b.variable(ty, None, StorageClass::Function, None);
                b.name(holder, "closure");
                b.store(holder, both, None, []).unwrap();
                let same = b.copy_object(ty, None, holder).unwrap();
                b.load(it.pointer, None, same, None, []).unwrap()
            },
        );
        // A variable has to be in the first block.
        let blocks = &mut held.functions[0].blocks;
        let all = &mut blocks[3].instructions;
        let place = all.iter().position(|it| op(it) == Op::Variable).unwrap();
        let holder = all.remove(place);
        blocks[0].instructions.insert(0, holder);
        resolve(&mut held, "k");
        assert!(forward_stores(&mut held));
        assert!(!forward_stores(&mut held));
        resolve(&mut held, "k");
        validate(&store(&held), "k").unwrap();
        assert_eq!(count(&held, Op::Variable), 2);
        assert_eq!(count(&held, Op::Store), 1);
    }

    #[test]
    fn of_two_arrays_none_can_be_chosen() {
        let mut chosen = module(
            [&|b, it| element(b, it, 0, it.one), &|b, it| {
                element(b, it, 1, it.one)
            }],
            |it| it.pointer,
            |_, _, both| both,
        );
        let failure = resolve(&mut chosen, "k").1.unwrap();
        assert!(
            failure.message.contains("an index into one array"),
            "{failure:?}"
        );
    }
}
