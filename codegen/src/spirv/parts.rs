//! Structures that come from two branches. rust-gpu hands an `Option`, a tuple or an iterator on as a whole, by an
//! `OpPhi` of a structure; spirv-opt takes variables apart, but not these. Texts would have a structure
//! without a name for it, and what lives behind a barrier would be all of it.

use std::collections::{BTreeMap, HashMap, HashSet};

use rspirv::dr::{Block, Instruction, Module, Operand};
use rspirv::spirv::{Op, StorageClass, Word};

use super::edit::before_end;
use super::{global, id, literal, op};

/// Makes of each phi of a structure a phi of each number in it, and the structure of these. spirv-opt leaves the
/// structure out where only members are taken. Tells whether there was one. Structures that lie in memory have a name,
/// and stay whole.
pub fn divide(module: &mut Module) -> bool {
    let phis = divisible(module);
    if phis.is_empty() {
        return false;
    }
    let Some(bound) = module.header.as_ref().map(|header| header.bound) else {
        return false;
    };
    let mut division = Division {
        made: HashMap::new(),
        phis: HashMap::new(),
        structures: module
            .types_global_values
            .iter()
            .filter(|it| op(it) == Op::TypeStruct)
            .filter_map(|it| it.result_id)
            .collect(),
        ends: HashMap::new(),
        bound,
    };
    for it in module.all_inst_iter() {
        let is_composite = matches!(
            op(it),
            Op::CompositeConstruct
                | Op::CompositeInsert
                | Op::CompositeExtract
                | Op::ConstantComposite
                | Op::CopyObject
        );
        if let (true, Some(result)) = (is_composite, it.result_id) {
            division.made.insert(result, it.clone());
        }
    }
    for phi in &phis {
        for (path, _) in &phi.parts {
            let part = division.new_id();
            division.phis.insert((phi.result, path.clone()), part);
        }
    }
    // What takes the place of a phi: phis, and what follows the last phi of their block.
    let mut instead: HashMap<Word, [Vec<Instruction>; 2]> = HashMap::new();
    for phi in &phis {
        let mut parts = Vec::new();
        for (path, ty) in &phi.parts {
            let mut operands = Vec::new();
            for (value, from) in &phi.incoming {
                let part = division.part(*value, path.clone(), *ty, *from);
                operands.extend([Operand::IdRef(part), Operand::IdRef(*from)]);
            }
            let part = division.phis.get(&(phi.result, path.clone())).copied();
            parts.push(Instruction::new(Op::Phi, Some(*ty), part, operands));
        }
        let mut whole = Vec::new();
        division.whole(module, phi, phi.structure, &[], &mut whole);
        if let Some(last) = whole.last_mut() {
            last.result_id = Some(phi.result);
        }
        instead.insert(phi.result, [parts, whole]);
    }
    for function in &mut module.functions {
        for block in &mut function.blocks {
            replace(block, &mut instead);
            let label = block.label.as_ref().and_then(|label| label.result_id);
            let Some(ends) = label.and_then(|label| division.ends.remove(&label)) else {
                continue;
            };
            let at = before_end(block);
            block.instructions.splice(at..at, ends);
        }
    }
    if let Some(header) = &mut module.header {
        header.bound = division.bound;
    }
    true
}

/// Where in a structure something stands: a member, one of its members, and so on.
type Path = Vec<u32>;

/// A phi of a structure.
struct Phi {
    result: Word,
    structure: Word,
    /// What it is divided into, with types.
    parts: Vec<(Path, Word)>,
    /// Values, and the blocks that they come from.
    incoming: Vec<(Word, Word)>,
}

/// What becomes of phis.
struct Division {
    /// Instructions that make structures, or take them apart.
    made: HashMap<Word, Instruction>,
    /// The new phis, by the old one and the part.
    phis: HashMap<(Word, Path), Word>,
    /// Types that are structures.
    structures: HashSet<Word>,
    /// What is put at the ends of blocks.
    ends: HashMap<Word, Vec<Instruction>>,
    bound: Word,
}

impl Division {
    fn new_id(&mut self) -> Word {
        self.bound += 1;
        self.bound - 1
    }

    /// A part of a value at the end of a block: what it was made of, if that is known.
    fn part(&mut self, mut value: Word, mut path: Path, ty: Word, from: Word) -> Word {
        loop {
            if path.is_empty() {
                return value;
            }
            if let Some(part) = self.phis.get(&(value, path.clone())) {
                return *part;
            }
            let Some(it) = self.made.get(&value) else {
                break;
            };
            let literals = |from: usize| (from..it.operands.len()).map_while(|i| literal(it, i));
            let (next, left) = match op(it) {
                Op::CopyObject => (id(it, 0), path.clone()),
                Op::CompositeExtract => (id(it, 0), literals(1).chain(path.clone()).collect()),
                // Of a structure; a vector may be made of vectors.
                Op::CompositeConstruct | Op::ConstantComposite
                    if it
                        .result_type
                        .is_some_and(|ty| self.structures.contains(&ty)) =>
                {
                    (id(it, path[0] as usize), path[1..].to_vec())
                }
                Op::CompositeInsert => {
                    let place: Path = literals(2).collect();
                    match path.strip_prefix(place.as_slice()) {
                        Some(rest) => (id(it, 0), rest.to_vec()),
                        // A part of this part.
                        None if place.starts_with(&path) => break,
                        None => (id(it, 1), path.clone()),
                    }
                }
                _ => break,
            };
            let Some(next) = next else {
                break;
            };
            (value, path) = (next, left);
        }
        let part = self.new_id();
        let mut operands = vec![Operand::IdRef(value)];
        operands.extend(path.into_iter().map(Operand::LiteralBit32));
        let taken = Instruction::new(Op::CompositeExtract, Some(ty), Some(part), operands);
        self.ends.entry(from).or_default().push(taken);
        part
    }

    /// Makes the structure, or one within it, of the new phis.
    fn whole(
        &mut self,
        module: &Module,
        phi: &Phi,
        structure: Word,
        path: &[u32],
        made: &mut Vec<Instruction>,
    ) -> Word {
        if let Some(part) = self.phis.get(&(phi.result, path.to_vec())) {
            return *part;
        }
        let members: Vec<Word> = members(module, structure).unwrap_or_default();
        let mut operands = Vec::new();
        for (member, ty) in (0..).zip(members) {
            let path = [path, &[member]].concat();
            operands.push(Operand::IdRef(self.whole(module, phi, ty, &path, made)));
        }
        let result = self.new_id();
        made.push(Instruction::new(
            Op::CompositeConstruct,
            Some(structure),
            Some(result),
            operands,
        ));
        result
    }
}

/// Types of the members of a structure that does not lie in memory.
fn members(module: &Module, structure: Word) -> Option<Vec<Word>> {
    let ty = global(module, structure).filter(|ty| op(ty) == Op::TypeStruct)?;
    let members = (0..ty.operands.len()).map(|member| id(ty, member));
    (!lies_in_memory(module, structure)).then(|| members.collect())?
}

/// What a value of a type is divided into.
fn parts(module: &Module, ty: Word, path: &[u32], found: &mut Vec<(Path, Word)>) {
    match members(module, ty) {
        Some(members) => {
            for (member, ty) in (0..).zip(members) {
                parts(module, ty, &[path, &[member]].concat(), found);
            }
        }
        None => found.push((path.to_vec(), ty)),
    }
}

/// Whether a structure is what a buffer, a uniform or workgroup memory holds, or a part of it.
fn lies_in_memory(module: &Module, structure: Word) -> bool {
    module.types_global_values.iter().any(|ty| match op(ty) {
        Op::TypeArray | Op::TypeRuntimeArray => id(ty, 0) == Some(structure),
        Op::TypePointer => {
            let function = Operand::StorageClass(StorageClass::Function);
            ty.operands.first() != Some(&function) && id(ty, 1) == Some(structure)
        }
        Op::TypeStruct => {
            let holds = ty.operands.contains(&Operand::IdRef(structure));
            holds && ty.result_id.is_some_and(|ty| lies_in_memory(module, ty))
        }
        _ => false,
    })
}

/// The phis of structures that do not lie in memory.
fn divisible(module: &Module) -> Vec<Phi> {
    let mut structures: BTreeMap<Word, Option<Vec<(Path, Word)>>> = BTreeMap::new();
    let all = module.functions.iter().flat_map(|f| f.all_inst_iter());
    let phis = all.filter(|it| op(it) == Op::Phi).filter_map(|phi| {
        let structure = phi.result_type?;
        let found = structures.entry(structure).or_insert_with(|| {
            members(module, structure)?;
            let mut found = Vec::new();
            parts(module, structure, &[], &mut found);
            Some(found)
        });
        Some(Phi {
            result: phi.result_id?,
            structure,
            parts: found.clone()?,
            incoming: (0..phi.operands.len() / 2)
                .filter_map(|i| Some((id(phi, 2 * i)?, id(phi, 2 * i + 1)?)))
                .collect(),
        })
    });
    phis.collect()
}

/// Puts the new phis in place of the old ones, and the structures behind all phis.
fn replace(block: &mut Block, instead: &mut HashMap<Word, [Vec<Instruction>; 2]>) {
    let mut phis = Vec::new();
    let mut structures = Vec::new();
    let mut others = Vec::new();
    for it in std::mem::take(&mut block.instructions) {
        match it.result_id.and_then(|result| instead.remove(&result)) {
            Some([parts, whole]) => {
                phis.extend(parts);
                structures.extend(whole);
            }
            None if op(&it) == Op::Phi => phis.push(it),
            None => others.push(it),
        }
    }
    block.instructions = [phis, structures, others].concat();
}

#[cfg(test)]
mod tests {
    use rspirv::binary::Assemble;
    use rspirv::dr::Builder;
    use rspirv::spirv::{FunctionControl, SelectionControl};

    use super::*;

    /// `if c { pair(x, 1) } else { pair(0, 2) }`, and what `body` makes of it.
    fn module(body: impl FnOnce(&mut Builder, Word, Word)) -> Module {
        let mut b = Builder::new();
        let (word, truth) = (b.type_int(32, 0), b.type_bool());
        let pair = b.type_struct([word, word]);
        let ty = b.type_function(word, [truth, word]);
        let [zero, one, two] = [0, 1, 2].map(|n| b.constant_bit32(word, n));
        b.begin_function(word, None, FunctionControl::NONE, ty)
            .unwrap();
        let condition = b.function_parameter(truth).unwrap();
        let x = b.function_parameter(word).unwrap();
        b.begin_block(None).unwrap();
        let [left, right, after] = [b.id(), b.id(), b.id()];
        b.selection_merge(after, SelectionControl::NONE).unwrap();
        b.branch_conditional(condition, left, right, []).unwrap();
        b.begin_block(Some(left)).unwrap();
        let some = b.composite_construct(pair, None, [x, one]).unwrap();
        b.branch(after).unwrap();
        b.begin_block(Some(right)).unwrap();
        let none = b.composite_construct(pair, None, [zero, two]).unwrap();
        b.branch(after).unwrap();
        b.begin_block(Some(after)).unwrap();
        let both = b.phi(pair, None, [(some, left), (none, right)]).unwrap();
        body(&mut b, word, both);
        b.end_function().unwrap();
        b.module()
    }

    fn phis(module: &Module) -> Vec<&Instruction> {
        let all = module.functions[0].all_inst_iter();
        all.filter(|it| op(it) == Op::Phi).collect()
    }

    #[test]
    fn members_come_from_the_branches_by_themselves() {
        let mut divided = module(|b, word, both| {
            let second = b.composite_extract(word, None, both, [1]).unwrap();
            b.ret_value(second).unwrap();
        });
        assert!(divide(&mut divided));
        assert!(!divide(&mut divided));
        let phis = phis(&divided);
        assert_eq!(phis.len(), 2);
        for phi in phis {
            let ty = global(&divided, phi.result_type.unwrap()).unwrap();
            assert_eq!(op(ty), Op::TypeInt);
        }
        let ops = |block: &Block| block.instructions.iter().map(op).collect::<Vec<Op>>();
        let blocks = &divided.functions[0].blocks;
        // Each branch knows what it has made the structure of.
        for block in &blocks[1..3] {
            assert_eq!(ops(block), [Op::CompositeConstruct, Op::Branch]);
        }
        // What is used of it is as it was.
        assert_eq!(
            ops(&blocks[3]),
            [
                Op::Phi,
                Op::Phi,
                Op::CompositeConstruct,
                Op::CompositeExtract,
                Op::ReturnValue
            ]
        );
    }

    #[test]
    fn members_of_members_are_divided_too() {
        let mut divided = module(|b, word, both| {
            let pair = b.type_struct([word, word]);
            let outer = b.type_struct([pair, word]);
            let [after, next] = [b.id(), b.id()];
            let from = b.selected_block().unwrap();
            let from = b.module_ref().functions[0].blocks[from].label_id().unwrap();
            let zero = b.constant_bit32(word, 0);
            let whole = b.composite_construct(outer, None, [both, zero]).unwrap();
            b.branch(next).unwrap();
            b.begin_block(Some(next)).unwrap();
            let only = b.phi(outer, None, [(whole, from)]).unwrap();
            b.branch(after).unwrap();
            b.begin_block(Some(after)).unwrap();
            let second = b.composite_extract(word, None, only, [0, 1]).unwrap();
            b.ret_value(second).unwrap();
        });
        assert!(divide(&mut divided));
        // Two of the pair, and three of what holds it.
        assert_eq!(phis(&divided).len(), 5);
    }

    #[test]
    fn a_structure_that_lies_in_memory_stays() {
        let mut whole = module(|b, word, both| {
            let pair = b.type_struct([word, word]);
            b.type_runtime_array(pair);
            let second = b.composite_extract(word, None, both, [1]).unwrap();
            b.ret_value(second).unwrap();
        });
        let before = whole.clone();
        assert!(!divide(&mut whole));
        assert_eq!(whole.assemble(), before.assemble());
    }
}
