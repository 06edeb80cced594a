//! Structures in variables that hold references, textures or samplers: a closure that reads a buffer, in an iterator that
//! holds the closure.
//!
//! A shader has no such variables, and spirv-opt takes it for granted: it removes what is written to a variable whose
//! pointer lies in another one. So these structures are divided here, before it runs.

use std::collections::{HashMap, HashSet};

use rspirv::dr::{Function, Instruction, Module, Operand};
use rspirv::spirv::{Op, StorageClass, Word};

use super::edit::Editor;
use super::{global, id, literal, op};

/// Makes of each variable of a structure that holds a reference, a texture or a sampler one for each member. Tells whether
/// there was one. A variable that is itself kept somewhere stays whole.
pub fn divide(module: &mut Module) -> bool {
    let holders = holders(module);
    if holders.is_empty() {
        return false;
    }
    let numbers = numbers(module);
    let mut functions = std::mem::take(&mut module.functions);
    let mut editor = Editor::new(module);
    let mut is_changed = false;
    for function in &mut functions {
        let variables = divisible(function, &holders, &numbers);
        if !variables.is_empty() {
            is_changed = true;
            Division::new(&mut editor, &variables, &holders).apply(function, &numbers);
        }
    }
    module.functions = functions;
    if is_changed {
        forget(module);
    }
    is_changed
}

/// Removes names and decorations of what is not there any more.
fn forget(module: &mut Module) {
    let there: HashSet<Word> = module
        .all_inst_iter()
        .filter_map(|it| it.result_id)
        .collect();
    let is_there = |it: &Instruction| id(it, 0).is_none_or(|of| there.contains(&of));
    module.debug_names.retain(is_there);
    module.annotations.retain(is_there);
}

/// Takes members of structures that were just made: a reference, a texture or a sampler is named where it is used, and
/// nothing is made that nobody uses. Tells whether anything has changed.
pub fn fold(module: &mut Module) -> bool {
    if structures(module).is_empty() {
        return false;
    }
    let is_variable = |it: &&Instruction| op(it) == Op::Variable;
    let globals = module.types_global_values.iter().filter(is_variable);
    let globals: HashSet<Word> = globals.filter_map(|it| it.result_id).collect();
    let vectors = module.types_global_values.iter();
    let vectors: HashSet<Word> = vectors
        .filter(|it| op(it) == Op::TypeVector)
        .filter_map(|it| it.result_id)
        .collect();
    let undefined: HashSet<Word> = module
        .all_inst_iter()
        .filter(|it| op(it) == Op::Undef)
        .filter_map(|it| it.result_id)
        .collect();
    let mut is_changed = false;
    for function in &mut module.functions {
        let variables = function.all_inst_iter().filter(is_variable);
        let mut variables: HashSet<Word> = variables.filter_map(|it| it.result_id).collect();
        variables.extend(&globals);
        let mut made: HashMap<Word, Instruction> = HashMap::new();
        for it in function.all_inst_iter() {
            if let (true, Some(result)) = (is_pure(op(it)), it.result_id) {
                made.insert(result, it.clone());
            }
        }
        let mut same: HashMap<Word, Word> = HashMap::new();
        for (result, it) in &made {
            let other = match op(it) {
                Op::CompositeExtract => part(&made, &vectors, it),
                Op::Phi => only(it, &undefined).filter(|it| variables.contains(it)),
                _ => None,
            };
            same.extend(other.map(|other| (*result, other)));
        }
        is_changed |= !same.is_empty();
        rename(function, &same);
        is_changed |= sweep(function);
    }
    if is_changed {
        forget(module);
    }
    is_changed
}

/// Whether an instruction does nothing but hand on values.
fn is_pure(op: Op) -> bool {
    matches!(
        op,
        Op::CompositeConstruct
            | Op::CompositeInsert
            | Op::CompositeExtract
            | Op::CopyObject
            | Op::Phi
    )
}

/// What a `CompositeExtract` gives, if it takes a member of a structure that was made in this function.
fn part(
    made: &HashMap<Word, Instruction>,
    vectors: &HashSet<Word>,
    extract: &Instruction,
) -> Option<Word> {
    let literals = |it: &Instruction, from: usize| -> Vec<u32> {
        (from..it.operands.len())
            .map_while(|i| literal(it, i))
            .collect()
    };
    let mut whole = id(extract, 0)?;
    let mut path = literals(extract, 1);
    while !path.is_empty() {
        let it = made.get(&whole)?;
        match op(it) {
            Op::CopyObject => whole = id(it, 0)?,
            // A vector may be made of vectors.
            Op::CompositeConstruct if it.result_type.is_some_and(|ty| !vectors.contains(&ty)) => {
                whole = id(it, path.remove(0) as usize)?;
            }
            Op::CompositeExtract => {
                whole = id(it, 0)?;
                path.splice(..0, literals(it, 1));
            }
            Op::CompositeInsert => {
                let at = literals(it, 2);
                if let Some(rest) = path.strip_prefix(&at[..]) {
                    (whole, path) = (id(it, 0)?, rest.to_vec());
                } else if at.starts_with(&path) {
                    return None;
                } else {
                    whole = id(it, 1)?;
                }
            }
            _ => return None,
        }
    }
    Some(whole)
}

/// The only value that a phi can have, if it is defined.
fn only(phi: &Instruction, undefined: &HashSet<Word>) -> Option<Word> {
    let values = phi.operands.iter().step_by(2);
    let mut values = values
        .filter_map(Operand::id_ref_any)
        .filter(|it| Some(*it) != phi.result_id && !undefined.contains(it));
    let first = values.next()?;
    values.all(|it| it == first).then_some(first)
}

/// Removes what is handed on to nobody.
fn sweep(function: &mut Function) -> bool {
    let mut used: HashSet<Word> = HashSet::new();
    let mut pure: HashMap<Word, Vec<Word>> = HashMap::new();
    let mut open: Vec<Word> = Vec::new();
    for it in function.all_inst_iter() {
        let named = it.operands.iter().filter_map(Operand::id_ref_any);
        match it.result_id.filter(|_| is_pure(op(it))) {
            Some(result) => {
                pure.insert(result, named.collect());
            }
            None => open.extend(named),
        }
    }
    while let Some(name) = open.pop() {
        if used.insert(name)
            && let Some(named) = pure.get(&name)
        {
            open.extend(named);
        }
    }
    let mut is_changed = false;
    for block in &mut function.blocks {
        block.instructions.retain(|it| {
            let is_used = it.result_id.is_none_or(|it| used.contains(&it)) || !is_pure(op(it));
            is_changed |= !is_used;
            is_used
        });
    }
    is_changed
}

/// Writes for each name the one that it stands for.
fn rename(function: &mut Function, same: &HashMap<Word, Word>) {
    for it in function.all_inst_iter_mut() {
        for operand in &mut it.operands {
            while let Operand::IdRef(name) = operand
                && let Some(other) = same.get(name)
            {
                *name = *other;
            }
        }
    }
}

/// Whether a structure has a texture or a sampler in it, or what leads to one.
pub fn has_handles(module: &Module) -> bool {
    let mut handles: HashSet<Word> = HashSet::new();
    for it in &module.types_global_values {
        let mut named = it.operands.iter().filter_map(Operand::id_ref_any);
        let is_handle = match op(it) {
            Op::TypeImage | Op::TypeSampler | Op::TypeSampledImage => true,
            Op::TypePointer => named.any(|to| handles.contains(&to)),
            Op::TypeStruct if named.any(|member| handles.contains(&member)) => return true,
            _ => false,
        };
        handles.extend(it.result_id.filter(|_| is_handle));
    }
    false
}

/// Whether a function takes a structure that holds a reference, a texture or a sampler, or a reference to one.
pub fn are_passed(module: &Module) -> bool {
    let (structures, holders) = (structures(module), holders(module));
    let mut parameters = module.functions.iter().flat_map(|it| &it.parameters);
    parameters.any(|it| {
        let ty = it.result_type.unwrap_or_default();
        holders.contains_key(&ty) || structures.contains(&ty)
    })
}

/// Structures that hold a reference, a texture or a sampler.
fn structures(module: &Module) -> HashSet<Word> {
    // Types come before those that are made of them.
    let (mut unusual, mut structures) = (HashSet::new(), HashSet::new());
    for it in &module.types_global_values {
        let Some(ty) = it.result_id else {
            continue;
        };
        match op(it) {
            Op::TypePointer | Op::TypeImage | Op::TypeSampler | Op::TypeSampledImage => {
                unusual.insert(ty);
            }
            Op::TypeStruct => {
                let mut members = it.operands.iter().filter_map(Operand::id_ref_any);
                if members.any(|member| unusual.contains(&member)) {
                    unusual.insert(ty);
                    structures.insert(ty);
                }
            }
            _ => {}
        }
    }
    structures
}

/// Types of pointers to such structures in variables of functions, each with the structure and its members.
fn holders(module: &Module) -> HashMap<Word, (Word, Vec<Word>)> {
    let structures = structures(module);
    let of_function = Operand::StorageClass(StorageClass::Function);
    let pointers = module.types_global_values.iter();
    pointers
        .filter(|it| op(it) == Op::TypePointer && it.operands.first() == Some(&of_function))
        .filter_map(|it| {
            let structure = id(it, 1).filter(|to| structures.contains(to))?;
            let members = global(module, structure)?.operands.iter();
            let members = members.filter_map(Operand::id_ref_any).collect();
            Some((it.result_id?, (structure, members)))
        })
        .collect()
}

/// The values of constants of 32-bit integers.
fn numbers(module: &Module) -> HashMap<Word, u32> {
    let all = module.types_global_values.iter();
    all.filter(|it| op(it) == Op::Constant)
        .filter_map(|it| Some((it.result_id?, literal(it, 0)?)))
        .collect()
}

/// The variables of such types, with their types, that are used for nothing but their content.
fn divisible(
    function: &Function,
    holders: &HashMap<Word, (Word, Vec<Word>)>,
    numbers: &HashMap<Word, u32>,
) -> HashMap<Word, Word> {
    let mut variables: HashMap<Word, Word> = function
        .all_inst_iter()
        .filter(|it| op(it) == Op::Variable && it.operands.len() == 1)
        .filter_map(|it| Some((it.result_id?, it.result_type?)))
        .filter(|(_, ty)| holders.contains_key(ty))
        .collect();
    for it in function.all_inst_iter() {
        for (place, operand) in it.operands.iter().enumerate() {
            let Some(variable) = operand.id_ref_any() else {
                continue;
            };
            let is_content = match op(it) {
                Op::Load | Op::Store => place == 0,
                Op::AccessChain | Op::InBoundsAccessChain => {
                    place == 0 && id(it, 1).is_some_and(|index| numbers.contains_key(&index))
                }
                _ => false,
            };
            if !is_content {
                variables.remove(&variable);
            }
        }
    }
    variables
}

/// What becomes of the variables of a function.
struct Division<'e, 'm> {
    editor: &'e mut Editor<'m>,
    /// The new variables of an old one, with the types of their values.
    parts: HashMap<Word, Vec<(Word, Word)>>,
    /// Their declarations.
    declared: HashMap<Word, Vec<Instruction>>,
    /// Pointers that are a new variable now.
    same: HashMap<Word, Word>,
}

impl<'e, 'm> Division<'e, 'm> {
    fn new(
        editor: &'e mut Editor<'m>,
        variables: &HashMap<Word, Word>,
        holders: &HashMap<Word, (Word, Vec<Word>)>,
    ) -> Self {
        // In one order, whatever that of the map is.
        let mut sorted: Vec<_> = variables.iter().collect();
        sorted.sort_unstable();
        let (mut parts, mut declared) = (HashMap::new(), HashMap::new());
        for (variable, ty) in sorted {
            let (mut of_it, mut lines) = (Vec::new(), Vec::new());
            for member in holders.get(ty).map_or(&[][..], |(_, members)| members) {
                let class = StorageClass::Function;
                let pointer = editor.pointer_type(class, *member);
                let part = editor.new_id();
                let operands = vec![Operand::StorageClass(class)];
                lines.push(Instruction::new(
                    Op::Variable,
                    Some(pointer),
                    Some(part),
                    operands,
                ));
                of_it.push((part, *member));
            }
            parts.insert(*variable, of_it);
            declared.insert(*variable, lines);
        }
        Self {
            editor,
            parts,
            declared,
            same: HashMap::new(),
        }
    }

    fn apply(mut self, function: &mut Function, numbers: &HashMap<Word, u32>) {
        for block in &mut function.blocks {
            let mut made = Vec::new();
            for it in std::mem::take(&mut block.instructions) {
                match self.instead(&it, numbers) {
                    Some(new) => made.extend(new),
                    None => made.push(it),
                }
            }
            block.instructions = made;
        }
        rename(function, &self.same);
    }

    /// What takes the place of an instruction; `None`: it stays.
    fn instead(
        &mut self,
        it: &Instruction,
        numbers: &HashMap<Word, u32>,
    ) -> Option<Vec<Instruction>> {
        if op(it) == Op::Variable {
            return self.declared.remove(&it.result_id?);
        }
        let parts = self.parts.get(&id(it, 0)?)?;
        let name = |it: Word| Operand::IdRef(it);
        match op(it) {
            Op::Load => {
                let mut made = Vec::new();
                let mut values = Vec::new();
                for (part, ty) in parts {
                    let value = self.editor.new_id();
                    made.push(Instruction::new(
                        Op::Load,
                        Some(*ty),
                        Some(value),
                        vec![name(*part)],
                    ));
                    values.push(name(value));
                }
                let (ty, result) = (it.result_type, it.result_id);
                made.push(Instruction::new(Op::CompositeConstruct, ty, result, values));
                Some(made)
            }
            Op::Store => {
                let whole = id(it, 1)?;
                let mut made = Vec::new();
                for (number, (part, ty)) in (0..).zip(parts) {
                    let value = self.editor.new_id();
                    let operands = vec![name(whole), Operand::LiteralBit32(number)];
                    let extract =
                        Instruction::new(Op::CompositeExtract, Some(*ty), Some(value), operands);
                    let operands = vec![name(*part), name(value)];
                    made.push(extract);
                    made.push(Instruction::new(Op::Store, None, None, operands));
                }
                Some(made)
            }
            _ => {
                let member = *numbers.get(&id(it, 1)?)? as usize;
                let (part, _) = *parts.get(member)?;
                if it.operands.len() == 2 {
                    self.same.insert(it.result_id?, part);
                    return Some(Vec::new());
                }
                let mut chain = it.clone();
                chain.operands.splice(..2, [name(part)]);
                Some(vec![chain])
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spirv::store;
    use crate::spirv::tests::of_wgsl;

    /// A module whose function keeps a reference in a structure, as rust-gpu writes it.
    fn module() -> Module {
        let mut module = of_wgsl(
            "@group(0) @binding(0) var<storage, read_write> out: array<u32>;
             @compute @workgroup_size(1) fn main() { var n = 3u; n += 1u; out[0] = n; }",
        );
        let mut functions = std::mem::take(&mut module.functions);
        let mut editor = Editor::new(&mut module);
        let class = StorageClass::Function;
        let word = editor.word_type();
        let to_word = editor.pointer_type(class, word);
        let (zero, one) = (editor.word(0), editor.word(1));
        let structure = editor.new_id();
        let members = [to_word, word].map(Operand::IdRef).into();
        editor.declare(Instruction::new(
            Op::TypeStruct,
            None,
            Some(structure),
            members,
        ));
        let to_structure = editor.pointer_type(class, structure);
        let to_pointer = editor.pointer_type(class, to_word);
        let ids: Vec<Word> = (0..7).map(|_| editor.new_id()).collect();
        let [holder, place, number, whole, again, target, read] = ids[..] else {
            unreachable!("seven")
        };
        let name = |it: Word| Operand::IdRef(it);
        let block = &mut functions.iter_mut().last().unwrap().blocks[0];
        let at = block
            .instructions
            .iter()
            .position(|it| op(it) != Op::Variable)
            .unwrap();
        let n = block.instructions[0].result_id.unwrap();
        let add = |op_code, ty: Option<Word>, result: Option<Word>, operands: Vec<Operand>| {
            Instruction::new(op_code, ty, result, operands)
        };
        let made = [
            add(
                Op::Variable,
                Some(to_structure),
                Some(holder),
                vec![Operand::StorageClass(class)],
            ),
            add(
                Op::AccessChain,
                Some(to_pointer),
                Some(place),
                vec![name(holder), name(zero)],
            ),
            add(Op::Store, None, None, vec![name(place), name(n)]),
            add(
                Op::AccessChain,
                Some(to_word),
                Some(number),
                vec![name(holder), name(one)],
            ),
            add(Op::Store, None, None, vec![name(number), name(one)]),
            add(Op::Load, Some(structure), Some(whole), vec![name(holder)]),
            add(Op::Store, None, None, vec![name(holder), name(whole)]),
            add(
                Op::AccessChain,
                Some(to_pointer),
                Some(again),
                vec![name(holder), name(zero)],
            ),
            add(Op::Load, Some(to_word), Some(target), vec![name(again)]),
            add(Op::Load, Some(word), Some(read), vec![name(target)]),
        ];
        block.instructions.splice(at..at, made);
        module.functions = functions;
        module
    }

    #[test]
    fn a_structure_with_a_reference_is_divided() {
        let mut module = module();
        let count = |module: &Module, wanted: Op| {
            module
                .functions
                .iter()
                .flat_map(Function::all_inst_iter)
                .filter(|it| op(it) == wanted)
                .count()
        };
        let before = count(&module, Op::Variable);
        assert!(divide(&mut module));
        assert_eq!(count(&module, Op::Variable), before + 1);
        // Its members are read and written, one by one and as a whole.
        assert_eq!(count(&module, Op::CompositeConstruct), 1);
        assert_eq!(count(&module, Op::CompositeExtract), 2);
        assert!(!divide(&mut module));
        assert!(crate::spirv::load(&store(&module), "test").is_ok());
    }

    #[test]
    fn members_of_what_was_just_made_are_named() {
        let mut module = module();
        assert!(divide(&mut module) && fold(&mut module));
        let left = module.functions.iter().flat_map(Function::all_inst_iter);
        // The structure was read, and written as it was.
        assert_eq!(left.filter(|it| is_pure(op(it))).count(), 0);
        assert!(!fold(&mut module));
    }

    #[test]
    fn a_part_of_a_structure_is_found_where_it_was_put() {
        let name = |it: Word| Operand::IdRef(it);
        let number = Operand::LiteralBit32;
        let (structure, vector) = (1, 2);
        let made = |op_code, ty: Word, result: Word, operands: Vec<Operand>| {
            (
                result,
                Instruction::new(op_code, Some(ty), Some(result), operands),
            )
        };
        let made: HashMap<Word, Instruction> = [
            made(
                Op::CompositeConstruct,
                structure,
                10,
                vec![name(20), name(21)],
            ),
            made(
                Op::CompositeInsert,
                structure,
                11,
                vec![name(22), name(10), number(1)],
            ),
            made(Op::CopyObject, structure, 12, vec![name(11)]),
            made(
                Op::CompositeConstruct,
                structure,
                13,
                vec![name(12), name(23)],
            ),
            made(
                Op::CompositeInsert,
                structure,
                14,
                vec![name(24), name(13), number(0), number(1), number(2)],
            ),
            made(Op::CompositeConstruct, vector, 15, vec![name(25), name(26)]),
        ]
        .into();
        let vectors = HashSet::from([vector]);
        let part = |whole: Word, path: &[u32]| {
            let path = path.iter().map(|it| number(*it));
            let operands = std::iter::once(name(whole)).chain(path).collect();
            part(
                &made,
                &vectors,
                &Instruction::new(Op::CompositeExtract, Some(3), Some(99), operands),
            )
        };
        assert_eq!(part(10, &[1]), Some(21));
        assert_eq!((part(11, &[0]), part(11, &[1])), (Some(20), Some(22)));
        assert_eq!(part(13, &[0, 1]), Some(22));
        // What is put into a part of it changes that part alone.
        assert_eq!((part(14, &[0, 0]), part(14, &[0, 1])), (Some(20), None));
        assert_eq!(part(14, &[0, 1, 2]), Some(24));
        // A vector may be made of vectors.
        assert_eq!(part(15, &[1]), None);
    }
}
