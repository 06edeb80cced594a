//! Structures that come from two branches. rust-gpu hands an `Option` or a tuple on as a whole, by an
//! `OpPhi` of a structure; spirv-opt takes variables apart, but not these. Texts would have a structure
//! without a name for it, and what lives behind a barrier would be all of it.

use std::collections::{HashMap, HashSet};

use rspirv::dr::{Block, Instruction, Module, Operand};
use rspirv::spirv::{Op, StorageClass, Word};

use super::{global, id, literal, op};

/// Members that are taken, each by its number, with the new phi's id and type.
type Members = Vec<(u32, Word, Word)>;

/// Makes phis of the members of each phi of a structure of which only members are taken. Tells whether
/// there was one. Structures that lie in memory have a name, and stay whole.
pub fn divide(module: &mut Module) -> bool {
    let phis = divisible(module);
    if phis.is_empty() {
        return false;
    }
    let Some(mut bound) = module.header.as_ref().map(|header| header.bound) else {
        return false;
    };
    let mut next = || {
        bound += 1;
        bound - 1
    };
    let mut ends: HashMap<Word, Vec<Instruction>> = HashMap::new();
    let mut made: HashMap<Word, Vec<Instruction>> = HashMap::new();
    let mut numbers: Vec<Word> = phis.keys().copied().collect();
    numbers.sort_unstable();
    let mut parts: HashMap<Word, Members> = HashMap::new();
    for phi in &numbers {
        let members = phis[phi].members.iter();
        let members = members.map(|(member, ty)| (*member, next(), *ty));
        parts.insert(*phi, members.collect());
    }
    for phi in &numbers {
        for (member, new, ty) in &parts[phi] {
            let mut operands = Vec::new();
            for (value, from) in &phis[phi].incoming {
                let other = parts.get(value).and_then(|all| {
                    let same = all.iter().find(|it| it.0 == *member);
                    same.map(|it| it.1)
                });
                let value = other.unwrap_or_else(|| {
                    let part = next();
                    ends.entry(*from).or_default().push(Instruction::new(
                        Op::CompositeExtract,
                        Some(*ty),
                        Some(part),
                        vec![Operand::IdRef(*value), Operand::LiteralBit32(*member)],
                    ));
                    part
                });
                operands.extend([Operand::IdRef(value), Operand::IdRef(*from)]);
            }
            made.entry(*phi).or_default().push(Instruction::new(
                Op::Phi,
                Some(*ty),
                Some(*new),
                operands,
            ));
        }
    }
    for function in &mut module.functions {
        for block in &mut function.blocks {
            replace(block, &parts, &made);
            let label = block.label.as_ref().and_then(|label| label.result_id);
            let Some(ends) = label.and_then(|label| ends.remove(&label)) else {
                continue;
            };
            let at = before_end(block);
            block.instructions.splice(at..at, ends);
        }
    }
    if let Some(header) = &mut module.header {
        header.bound = bound;
    }
    true
}

/// A phi of a structure.
struct Phi {
    /// Values, and the blocks that they come from.
    incoming: Vec<(Word, Word)>,
    /// Members that are taken, and their types.
    members: Vec<(u32, Word)>,
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

/// Phis of structures of which nothing but members is used.
fn divisible(module: &Module) -> HashMap<Word, Phi> {
    let mut phis: HashMap<Word, Phi> = HashMap::new();
    let all = || module.functions.iter().flat_map(|f| f.all_inst_iter());
    for phi in all().filter(|it| op(it) == Op::Phi) {
        let structure = phi
            .result_type
            .and_then(|ty| global(module, ty))
            .filter(|ty| op(ty) == Op::TypeStruct)
            .and_then(|ty| ty.result_id)
            .filter(|ty| !lies_in_memory(module, *ty));
        if let (Some(result), Some(_)) = (phi.result_id, structure) {
            let incoming = (0..phi.operands.len() / 2)
                .filter_map(|i| Some((id(phi, 2 * i)?, id(phi, 2 * i + 1)?)));
            let found = Phi {
                incoming: incoming.collect(),
                members: Vec::new(),
            };
            phis.insert(result, found);
        }
    }
    let mut types: HashMap<Word, Word> = HashMap::new();
    for phi in all().filter(|it| op(it) == Op::Phi) {
        if let (Some(result), Some(ty)) = (phi.result_id, phi.result_type) {
            types.insert(result, ty);
        }
    }
    // Another phi may take it as a whole, if that is divided, too.
    let mut whole: HashSet<Word> = HashSet::new();
    for it in all() {
        for (place, operand) in it.operands.iter().enumerate() {
            let Operand::IdRef(used) = operand else {
                continue;
            };
            if !phis.contains_key(used) {
                continue;
            }
            let by_phi = op(it) == Op::Phi && it.result_id.is_some_and(|id| phis.contains_key(&id));
            let member = literal(it, 1).filter(|_| op(it) == Op::CompositeExtract && place == 0);
            match member {
                None if by_phi => {}
                None => {
                    whole.insert(*used);
                }
                Some(member) => {
                    let ty = types
                        .get(used)
                        .and_then(|ty| id(global(module, *ty)?, member as usize));
                    let known = phis.get_mut(used).zip(ty);
                    if let Some((phi, ty)) = known
                        && !phi.members.iter().any(|it| it.0 == member)
                    {
                        phi.members.push((member, ty));
                    }
                }
            }
        }
    }
    // What goes into a phi that stays is used as a whole, and so on.
    loop {
        let more: Vec<Word> = phis
            .iter()
            .filter(|(phi, _)| whole.contains(*phi))
            .flat_map(|(_, phi)| phi.incoming.iter().map(|it| it.0))
            .filter(|value| phis.contains_key(value) && !whole.contains(value))
            .collect();
        if more.is_empty() {
            break;
        }
        whole.extend(more);
    }
    phis.retain(|phi, _| !whole.contains(phi));
    // A member that is taken of one is taken of those that go into it.
    loop {
        let mut changed = false;
        let wanted: Vec<(Word, (u32, Word))> = phis
            .values()
            .flat_map(|phi| {
                let values = phi.incoming.iter().map(|it| it.0);
                values.flat_map(|value| phi.members.iter().map(move |member| (value, *member)))
            })
            .collect();
        for (value, member) in wanted {
            if let Some(phi) = phis.get_mut(&value)
                && !phi.members.iter().any(|it| it.0 == member.0)
            {
                phi.members.push(member);
                changed = true;
            }
        }
        if !changed {
            break;
        }
    }
    for phi in phis.values_mut() {
        phi.members.sort_unstable();
    }
    phis
}

/// Puts the new phis in place of the old ones, and takes members from them.
fn replace(
    block: &mut Block,
    parts: &HashMap<Word, Members>,
    made: &HashMap<Word, Vec<Instruction>>,
) {
    let old = std::mem::take(&mut block.instructions);
    for mut it in old {
        if let Some(result) = it.result_id
            && parts.contains_key(&result)
        {
            block
                .instructions
                .extend(made.get(&result).into_iter().flatten().cloned());
            continue;
        }
        let taken = match op(&it) {
            Op::CompositeExtract => id(&it, 0).and_then(|of| {
                let member = literal(&it, 1)?;
                let members = parts.get(&of)?;
                members.iter().find(|it| it.0 == member).map(|it| it.1)
            }),
            _ => None,
        };
        if let Some(part) = taken {
            if it.operands.len() == 2 {
                it.class = Instruction::new(Op::CopyObject, None, None, Vec::new()).class;
                it.operands = vec![Operand::IdRef(part)];
            } else {
                it.operands.remove(1);
                it.operands[0] = Operand::IdRef(part);
            }
        }
        block.instructions.push(it);
    }
}

/// Where instructions may be put at a block's end: before what ends it, and the merge before that.
fn before_end(block: &Block) -> usize {
    let last = block.instructions.len().saturating_sub(1);
    let merges = last.checked_sub(1).is_some_and(|at| {
        matches!(
            op(&block.instructions[at]),
            Op::SelectionMerge | Op::LoopMerge
        )
    });
    if merges { last - 1 } else { last }
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
        assert_eq!(phis.len(), 1);
        let word = phis[0].result_type.unwrap();
        assert_eq!(op(global(&divided, word).unwrap()), Op::TypeInt);
        // Each branch takes the member just before it ends.
        for block in &divided.functions[0].blocks[1..3] {
            let ops: Vec<Op> = block.instructions.iter().map(op).collect();
            assert_eq!(
                ops,
                [Op::CompositeConstruct, Op::CompositeExtract, Op::Branch]
            );
        }
    }

    #[test]
    fn a_structure_that_is_used_as_a_whole_stays() {
        let mut whole = module(|b, word, both| {
            let pair = b.type_struct([word, word]);
            let copy = b.copy_object(pair, None, both).unwrap();
            let second = b.composite_extract(word, None, copy, [1]).unwrap();
            b.ret_value(second).unwrap();
        });
        let before = whole.clone();
        assert!(!divide(&mut whole));
        assert_eq!(whole.assemble(), before.assemble());
    }
}
