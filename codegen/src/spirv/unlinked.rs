//! The SPIR-V that rustc leaves for rust-gpu's linker, without what no shader shows: the lines of the source, and blocks
//! that nothing reaches.
//!
//! Most instructions of such a module are of these kinds. rustc makes a block of each branch that a constant rules out:
//! `unroll!` has many. The linker copies all of them for each call that it inlines, and goes through the decorations
//! with lines then. Without them it takes half of the time and half of the memory.

use std::collections::HashSet;

use rspirv::spirv::{Op, Word};

/// rust-gpu's own instructions, which its linker removes, as rust-gpu 0.10 has them: other versions may number them
/// otherwise, and keep all that they have.
const CUSTOM: &str = "Rust.rustc_codegen_spirv.0_10_0.";
/// Those of them that say which line comes next, or that none is known.
const LINES: [u32; 2] = [0, 1];
/// How the decoration begins that says on which line something is declared. Others say what is no SPIR-V.
const DECLARED_ON_LINE: u8 = b'L';

/// The words of a module without lines, and without blocks that nothing reaches. What is no whole module is left as it is:
/// whoever reads it says what is wrong.
pub fn lean(words: &[Word]) -> Vec<Word> {
    let instructions: Option<Vec<_>> = Instructions::of(words).collect();
    let Some(instructions) = instructions else {
        return words.to_vec();
    };
    let custom = instructions.iter().find(|it| it.is_import_of(CUSTOM));
    let Some(custom) = custom.and_then(|it| it.words.get(1).copied()) else {
        return words.to_vec();
    };
    let mut reached: HashSet<Word> = HashSet::new();
    for it in &instructions {
        reached.extend(it.blocks());
    }
    let mut kept = words[..HEADER].to_vec();
    let mut before = Op::Nop;
    let mut rest = instructions.iter().peekable();
    while let Some(it) = rest.next() {
        let is_dead = it.is(Op::Label)
            // A function's first block has no branch to it.
            && !matches!(before, Op::Function | Op::FunctionParameter)
            && !it.words.get(1).is_some_and(|id| reached.contains(id))
            && rest.peek().is_some_and(|next| next.is(Op::Unreachable));
        if is_dead {
            rest.next();
            continue;
        }
        if !it.is_line(custom) {
            kept.extend_from_slice(it.words);
            before = it.op().unwrap_or(Op::Nop);
        }
    }
    kept
}

/// Words before the first instruction.
const HEADER: usize = 5;

/// One after the other; `None` where one is cut.
struct Instructions<'a> {
    rest: &'a [Word],
}

impl<'a> Instructions<'a> {
    fn of(words: &'a [Word]) -> Self {
        let rest = words.get(HEADER..).unwrap_or_default();
        Self { rest }
    }
}

impl<'a> Iterator for Instructions<'a> {
    type Item = Option<Instruction<'a>>;

    fn next(&mut self) -> Option<Self::Item> {
        let length = (*self.rest.first()? >> 16) as usize;
        let Some((words, rest)) = self.rest.split_at_checked(length.max(1)) else {
            self.rest = &[];
            return Some(None);
        };
        self.rest = rest;
        Some((length > 0).then_some(Instruction { words }))
    }
}

struct Instruction<'a> {
    words: &'a [Word],
}

impl Instruction<'_> {
    fn op(&self) -> Option<Op> {
        Op::from_u32(self.words[0] & 0xffff)
    }

    fn is(&self, op: Op) -> bool {
        self.op() == Some(op)
    }

    /// Whether it imports a set of instructions whose name begins so.
    fn is_import_of(&self, name: &str) -> bool {
        self.is(Op::ExtInstImport) && self.words.get(2..).is_some_and(|it| begins_with(it, name))
    }

    /// Whether it only says which line of the source something comes from.
    fn is_line(&self, custom: Word) -> bool {
        match (self.op(), self.words) {
            (Some(Op::Line | Op::NoLine), _) => true,
            (Some(Op::ExtInst), [_, _, _, set, which, ..]) => {
                *set == custom && LINES.contains(which)
            }
            (Some(Op::DecorateString), [_, _, _, text, ..]) => {
                text.to_le_bytes()[0] == DECLARED_ON_LINE
            }
            _ => false,
        }
    }

    /// The blocks that it names, and perhaps more: numbers in it are taken for blocks, too.
    fn blocks(&self) -> &[Word] {
        match self.op() {
            Some(
                Op::Phi
                | Op::LoopMerge
                | Op::SelectionMerge
                | Op::Branch
                | Op::BranchConditional
                | Op::Switch,
            ) => &self.words[1..],
            _ => &[],
        }
    }
}

/// Whether a literal string, four letters to a word, begins so.
fn begins_with(words: &[Word], text: &str) -> bool {
    let letters = words.iter().flat_map(|word| word.to_le_bytes());
    letters.take(text.len()).eq(text.bytes())
}

#[cfg(test)]
mod tests {
    use super::*;
    use rspirv::dr::{Instruction, Operand};

    use crate::spirv::tests::of_wgsl;
    use crate::spirv::{load, store};

    const TEXT: &str = "
        @group(0) @binding(0) var<storage, read_write> numbers: array<f32>;
        fn scaled(x: f32) -> f32 { if x > 1.0 { return x; } return x * 3.0; }
        @compute @workgroup_size(64)
        fn scale(@builtin(global_invocation_id) id: vec3<u32>) { numbers[id.x] = scaled(numbers[id.x]); }";

    /// Makes new ids.
    fn next(module: &mut rspirv::dr::Module) -> Word {
        let header = module.header.as_mut().unwrap();
        header.bound += 1;
        header.bound - 1
    }

    /// The module with rust-gpu's set of instructions, and with what `change` adds; its id is `change`'s second argument.
    fn with(change: impl FnOnce(&mut rspirv::dr::Module, Word)) -> Vec<Word> {
        let mut module = of_wgsl(TEXT);
        let custom = next(&mut module);
        let name = Operand::LiteralString(format!("{CUSTOM}0123"));
        let import = Instruction::new(Op::ExtInstImport, None, Some(custom), vec![name]);
        module.ext_inst_imports.push(import);
        change(&mut module, custom);
        store(&module)
    }

    fn void(module: &rspirv::dr::Module) -> Option<Word> {
        let all = &module.types_global_values;
        all.iter()
            .find(|it| it.class.opcode == Op::TypeVoid)?
            .result_id
    }

    /// Adds an instruction of rust-gpu's own to each function.
    fn add_custom(module: &mut rspirv::dr::Module, custom: Word, which: u32) {
        let (void, own) = (void(module), next(module));
        let operands = vec![
            Operand::IdRef(custom),
            Operand::LiteralExtInstInteger(which),
        ];
        let it = Instruction::new(Op::ExtInst, void, Some(own), operands);
        let block = &mut module.functions[0].blocks[0].instructions;
        block.insert(block.len() - 1, it);
    }

    fn add_decoration(module: &mut rspirv::dr::Module, text: &str) {
        let target = module.functions[0].def_id().unwrap();
        let operands = vec![
            Operand::IdRef(target),
            Operand::Decoration(rspirv::spirv::Decoration::UserTypeGOOGLE),
            Operand::LiteralString(text.into()),
        ];
        let it = Instruction::new(Op::DecorateString, None, None, operands);
        module.annotations.push(it);
    }

    fn count(words: &[Word], op: Op) -> usize {
        let all = load(words, "").unwrap();
        all.all_inst_iter()
            .filter(|it| it.class.opcode == op)
            .count()
    }

    #[test]
    fn lines_go_and_all_else_stays() {
        let plain = with(|_, _| {});
        let without = lean(&plain);
        assert_eq!(without, plain);
        for which in LINES {
            let words = with(|module, custom| add_custom(module, custom, which));
            assert_eq!(count(&lean(&words), Op::ExtInst), 0, "{which}");
        }
        for which in [2, 3, 4] {
            let words = with(|module, custom| add_custom(module, custom, which));
            assert_eq!(lean(&words), words, "{which}");
        }
        let words = with(|module, _| add_decoration(module, "L/a.rs"));
        assert_eq!(count(&lean(&words), Op::DecorateString), 0);
        let words = with(|module, _| add_decoration(module, "Zu128"));
        assert_eq!(lean(&words), words, "rust-gpu says by it what is no SPIR-V");
    }

    #[test]
    fn blocks_that_nothing_reaches_go() {
        let add = |module: &mut rspirv::dr::Module, is_reached: bool| {
            let label = next(module);
            let function = module
                .functions
                .iter_mut()
                .find(|it| it.blocks.len() > 1)
                .unwrap();
            let block = rspirv::dr::Block {
                label: Some(Instruction::new(Op::Label, None, Some(label), vec![])),
                instructions: vec![Instruction::new(Op::Unreachable, None, None, vec![])],
            };
            function.blocks.push(block);
            if is_reached {
                let all = function
                    .blocks
                    .iter_mut()
                    .flat_map(|it| &mut it.instructions);
                let mut branches = all.filter(|it| it.class.opcode == Op::BranchConditional);
                branches.next().unwrap().operands[1] = Operand::IdRef(label);
            }
        };
        let words = with(|module, _| add(module, false));
        let labels = count(&words, Op::Label);
        assert_eq!(count(&lean(&words), Op::Label), labels - 1);
        let words = with(|module, _| add(module, true));
        assert_eq!(count(&lean(&words), Op::Label), labels);
    }

    #[test]
    fn a_function_of_one_block_keeps_it() {
        let words = with(|module, _| {
            for function in &mut module.functions {
                function.blocks.truncate(1);
                let unreachable = Instruction::new(Op::Unreachable, None, None, vec![]);
                function.blocks[0].instructions = vec![unreachable];
            }
        });
        assert_eq!(lean(&words), words);
    }

    #[test]
    fn modules_of_other_compilers_and_damaged_ones_stay() {
        let other = store(&of_wgsl(TEXT));
        assert_eq!(lean(&other), other);
        let mut words = with(|module, custom| add_custom(module, custom, 0));
        words.push(3 << 16 | Op::Line as u32);
        assert_eq!(lean(&words), words, "an instruction that is cut");
        words.pop();
        words.push(0);
        assert_eq!(lean(&words), words, "an instruction without a length");
        assert_eq!(lean(&[1, 2]), [1, 2]);
        assert!(lean(&[]).is_empty());
    }
}
