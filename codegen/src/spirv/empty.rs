//! Structures without members: rust-gpu has them for closures and types of no size, and naga refuses them.

use std::collections::HashSet;

use rspirv::dr::{Module, Operand};
use rspirv::spirv::{Op, Word};

use super::edit::Editor;
use super::op;

/// Gives structures without members one that nobody reads.
pub fn fill(module: &mut Module) {
    let is_empty = |module: &Module| -> HashSet<Word> {
        let all = module.types_global_values.iter();
        all.filter(|it| op(it) == Op::TypeStruct && it.operands.is_empty())
            .filter_map(|it| it.result_id)
            .collect()
    };
    let empty = is_empty(module);
    if empty.is_empty() {
        return;
    }
    let mut editor = Editor::new(module);
    let (number, zero) = (editor.integer_type_of(32, false), editor.word(0));
    // Before the structures.
    let is_first = |id: Option<Word>| id == Some(number) || id == Some(zero);
    module
        .types_global_values
        .sort_by_key(|it| match it.result_id {
            id if is_first(id) && op(it) == Op::TypeInt => 0,
            id if is_first(id) => 1,
            _ => 2,
        });
    let of_empty = |ty: Option<Word>| ty.is_some_and(|ty| empty.contains(&ty));
    for it in &mut module.types_global_values {
        if it.result_id.is_some_and(|id| empty.contains(&id)) {
            it.operands.push(Operand::IdRef(number));
        } else if op(it) == Op::ConstantComposite && of_empty(it.result_type) {
            it.operands.push(Operand::IdRef(zero));
        }
    }
    let blocks = module.functions.iter_mut().flat_map(|it| &mut it.blocks);
    for it in blocks.flat_map(|it| &mut it.instructions) {
        if op(it) == Op::CompositeConstruct && of_empty(it.result_type) {
            it.operands.push(Operand::IdRef(zero));
        }
    }
}

#[cfg(test)]
mod tests {
    use rspirv::dr::Builder;
    use rspirv::spirv::FunctionControl;

    use super::*;

    #[test]
    fn a_structure_without_members_gets_one() {
        let mut b = Builder::new();
        let void = b.type_void();
        let empty = b.type_struct([]);
        let pair = b.type_struct([empty, empty]);
        let none = b.constant_composite(empty, []);
        let ty = b.type_function(void, []);
        b.begin_function(void, None, FunctionControl::NONE, ty)
            .unwrap();
        b.begin_block(None).unwrap();
        let made = b.composite_construct(empty, None, []).unwrap();
        b.composite_construct(pair, None, [made, none]).unwrap();
        b.ret().unwrap();
        b.end_function().unwrap();
        let mut module = b.module();
        fill(&mut module);
        let of = |id| {
            let mut all = module.all_inst_iter();
            all.find(|it| it.result_id == Some(id))
                .map(|it| it.operands.len())
        };
        assert_eq!(
            [empty, none, made, pair].map(of),
            [Some(1), Some(1), Some(1), Some(2)]
        );
        let first = &module.types_global_values[..2];
        assert_eq!([op(&first[0]), op(&first[1])], [Op::TypeInt, Op::Constant]);
    }
}
