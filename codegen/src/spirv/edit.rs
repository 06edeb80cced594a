//! What several edits need: new ids, and types and constants that are there once.

use std::collections::{HashMap, HashSet};

use rspirv::dr::{Block, Instruction, Module, Operand};
use rspirv::spirv::{GlslStd450Op as GLOp, Op, StorageClass, Word};

use super::{id, literal, op};

/// Makes instructions for a module whose functions were taken out of it.
pub struct Editor<'a> {
    module: &'a mut Module,
}

/// A scalar type of floating-point numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FloatType {
    pub id: Word,
    pub bits: u32,
}

impl<'a> Editor<'a> {
    pub fn new(module: &'a mut Module) -> Self {
        Self { module }
    }

    /// An id that nothing has.
    pub fn new_id(&mut self) -> Word {
        match &mut self.module.header {
            Some(header) => {
                header.bound += 1;
                header.bound - 1
            }
            None => 0,
        }
    }

    fn once(&mut self, op_code: Op, ty: Option<Word>, operands: Vec<Operand>) -> Word {
        let there = self
            .module
            .types_global_values
            .iter()
            .find(|it| op(it) == op_code && it.result_type == ty && it.operands == operands);
        if let Some(found) = there.and_then(|it| it.result_id) {
            return found;
        }
        let new = self.new_id();
        self.module
            .types_global_values
            .push(Instruction::new(op_code, ty, Some(new), operands));
        new
    }

    /// Floating-point numbers of so many bits.
    pub fn float_type_of(&mut self, bits: u32) -> FloatType {
        let operands = vec![Operand::LiteralBit32(bits)];
        let id = self.once(Op::TypeFloat, None, operands);
        FloatType { id, bits }
    }

    /// Vectors of `count` values of type `part`.
    pub fn vector_type_of(&mut self, part: Word, count: u32) -> Word {
        let operands = vec![Operand::IdRef(part), Operand::LiteralBit32(count)];
        self.once(Op::TypeVector, None, operands)
    }

    pub fn bool_type(&mut self) -> Word {
        self.once(Op::TypeBool, None, Vec::new())
    }

    /// Integers of so many bits, with or without a sign.
    pub fn integer_type_of(&mut self, bits: u32, signed: bool) -> Word {
        let operands = vec![
            Operand::LiteralBit32(bits),
            Operand::LiteralBit32(signed.into()),
        ];
        self.once(Op::TypeInt, None, operands)
    }

    /// Pointers to values of type `to`.
    pub fn pointer_type(&mut self, class: StorageClass, to: Word) -> Word {
        let operands = vec![Operand::StorageClass(class), Operand::IdRef(to)];
        self.once(Op::TypePointer, None, operands)
    }

    /// Adds a type or a constant.
    #[cfg(test)]
    pub fn declare(&mut self, it: Instruction) {
        self.module.types_global_values.push(it);
    }

    /// 32 bits without a sign.
    pub fn word_type(&mut self) -> Word {
        self.integer_type_of(32, false)
    }

    /// `ty`, if it is a scalar of floats of 32 or 64 bits.
    pub fn float_type(&self, ty: Word) -> Option<FloatType> {
        let found = super::global(self.module, ty).filter(|it| op(it) == Op::TypeFloat)?;
        let bits = literal(found, 0).filter(|bits| matches!(bits, 32 | 64))?;
        Some(FloatType { id: ty, bits })
    }

    /// Bits and sign of an integer scalar type.
    pub fn integer_type(&self, ty: Word) -> Option<(u32, bool)> {
        let found = super::global(self.module, ty).filter(|it| op(it) == Op::TypeInt)?;
        Some((literal(found, 0)?, literal(found, 1)? == 1))
    }

    pub fn word(&mut self, value: u32) -> Word {
        let ty = self.word_type();
        self.once(Op::Constant, Some(ty), vec![Operand::LiteralBit32(value)])
    }

    /// The constant `true` of type `ty`.
    pub fn truth(&mut self, ty: Word) -> Word {
        self.once(Op::ConstantTrue, Some(ty), Vec::new())
    }

    /// The constant `false` of type `ty`.
    pub fn falsehood(&mut self, ty: Word) -> Word {
        self.once(Op::ConstantFalse, Some(ty), Vec::new())
    }

    /// A 32-bit integer of type `ty`.
    pub fn integer(&mut self, ty: Word, value: u32) -> Word {
        self.once(Op::Constant, Some(ty), vec![Operand::LiteralBit32(value)])
    }

    /// The constant of type `ty` that is made of others.
    pub fn composite(&mut self, ty: Word, parts: Vec<Operand>) -> Word {
        self.once(Op::ConstantComposite, Some(ty), parts)
    }

    pub fn float(&mut self, ty: FloatType, value: f64) -> Word {
        let operand = match ty.bits {
            32 => Operand::LiteralBit32((value as f32).to_bits()),
            _ => Operand::LiteralBit64(value.to_bits()),
        };
        self.once(Op::Constant, Some(ty.id), vec![operand])
    }

    /// A constant of 16 bits, of type `ty`.
    pub fn half(&mut self, ty: Word, bits: u16) -> Word {
        let bits = Operand::LiteralBit32(bits.into());
        self.once(Op::Constant, Some(ty), vec![bits])
    }

    /// What a constant vector is made of.
    pub fn parts_of(&self, constant: Word) -> Option<Vec<Word>> {
        let found = super::global(self.module, constant);
        let found = found.filter(|it| op(it) == Op::ConstantComposite)?;
        found.operands.iter().map(Operand::id_ref_any).collect()
    }

    /// The value of a constant of floats, not of a specialisation constant.
    pub fn float_value(&self, constant: Word) -> Option<f64> {
        let found = super::global(self.module, constant).filter(|it| op(it) == Op::Constant)?;
        let ty = self.float_type(found.result_type?)?;
        match (ty.bits, found.operands.first()?) {
            (32, Operand::LiteralBit32(bits)) => Some(f32::from_bits(*bits).into()),
            (64, Operand::LiteralBit64(bits)) => Some(f64::from_bits(*bits)),
            _ => None,
        }
    }

    /// The value of a constant of integers, with its sign.
    pub fn integer_value(&self, constant: Word) -> Option<i64> {
        let found = super::global(self.module, constant).filter(|it| op(it) == Op::Constant)?;
        let (_, signed) = self.integer_type(found.result_type?)?;
        Some(match *found.operands.first()? {
            Operand::LiteralBit32(bits) if signed => (bits as i32).into(),
            Operand::LiteralBit32(bits) => bits.into(),
            Operand::LiteralBit64(bits) => bits as i64,
            _ => return None,
        })
    }

    /// The set of GLSL's functions, if the module has it.
    pub fn functions_set(&self) -> Option<Word> {
        functions_set(self.module)
    }
}

/// The import of GLSL's functions, if the module has it.
pub fn functions_set(module: &Module) -> Option<Word> {
    module
        .ext_inst_imports
        .iter()
        .find(|it| it.operands.first() == Some(&Operand::LiteralString("GLSL.std.450".into())))
        .and_then(|it| it.result_id)
}

/// The import of GLSL's functions, which the module has afterwards.
pub fn import_functions(module: &mut Module) -> Word {
    if let Some(there) = functions_set(module) {
        return there;
    }
    let new = Editor::new(module).new_id();
    let name = Operand::LiteralString("GLSL.std.450".into());
    let import = Instruction::new(Op::ExtInstImport, None, Some(new), vec![name]);
    module.ext_inst_imports.push(import);
    new
}

/// Instructions that take the place of one; the last of them has its id.
pub struct Sequence<'e, 'm> {
    editor: &'e mut Editor<'m>,
    set: Word,
    made: Vec<Instruction>,
}

impl<'e, 'm> Sequence<'e, 'm> {
    /// `set` is that of GLSL's functions.
    pub fn new(editor: &'e mut Editor<'m>, set: Word) -> Self {
        Self {
            editor,
            set,
            made: Vec::new(),
        }
    }

    pub fn then(&mut self, op_code: Op, ty: Word, operands: &[Word]) -> Word {
        let new = self.editor.new_id();
        let operands = operands.iter().map(|it| Operand::IdRef(*it)).collect();
        self.made
            .push(Instruction::new(op_code, Some(ty), Some(new), operands));
        new
    }

    /// An instruction that ends in numbers: the places of parts.
    pub fn part(&mut self, op_code: Op, ty: Word, operands: &[Word], places: &[u32]) -> Word {
        let new = self.then(op_code, ty, operands);
        if let Some(made) = self.made.last_mut() {
            let places = places.iter().copied().map(Operand::LiteralBit32);
            made.operands.extend(places);
        }
        new
    }

    /// One of GLSL's functions.
    pub fn call(&mut self, function: GLOp, ty: Word, arguments: &[Word]) -> Word {
        let new = self.editor.new_id();
        let mut operands = vec![
            Operand::IdRef(self.set),
            Operand::LiteralExtInstInteger(function as u32),
        ];
        operands.extend(arguments.iter().map(|it| Operand::IdRef(*it)));
        self.made
            .push(Instruction::new(Op::ExtInst, Some(ty), Some(new), operands));
        new
    }

    /// The instructions as they are.
    pub fn ending_in_itself(self) -> Vec<Instruction> {
        self.made
    }

    /// The instructions, of which the last makes `result`.
    pub fn ending_in(mut self, result: Word) -> Vec<Instruction> {
        if let Some(last) = self.made.last_mut() {
            last.result_id = Some(result);
        }
        self.made
    }
}

/// The function, if the instruction calls one of GLSL's; its arguments begin at the third operand.
pub fn called(instruction: &Instruction, set: Word) -> Option<GLOp> {
    if op(instruction) != Op::ExtInst || id(instruction, 0) != Some(set) {
        return None;
    }
    match instruction.operands.get(1) {
        Some(Operand::LiteralExtInstInteger(number)) => GLOp::from_u32(*number),
        _ => None,
    }
}

/// Whether an instruction calls `function`, of whichever set: a module has no other.
pub fn is_call(instruction: &Instruction, function: GLOp) -> bool {
    op(instruction) == Op::ExtInst
        && instruction.operands.get(1) == Some(&Operand::LiteralExtInstInteger(function as u32))
}

/// Where instructions may be put at a block's end: before what ends it, and the merge before that.
pub fn before_end(block: &Block) -> usize {
    let last = block.instructions.len().saturating_sub(1);
    let merges = last.checked_sub(1).is_some_and(|at| {
        matches!(
            op(&block.instructions[at]),
            Op::SelectionMerge | Op::LoopMerge
        )
    });
    if merges { last - 1 } else { last }
}

/// Replaces instructions of functions by others: `by` gives those, or nothing.
pub fn replace_each(
    module: &mut Module,
    mut by: impl FnMut(&mut Editor<'_>, &Instruction) -> Option<Vec<Instruction>>,
) {
    let mut functions = std::mem::take(&mut module.functions);
    let mut editor = Editor::new(module);
    for block in functions.iter_mut().flat_map(|it| &mut it.blocks) {
        let old = std::mem::take(&mut block.instructions);
        for instruction in old {
            match by(&mut editor, &instruction) {
                Some(new) => block.instructions.extend(new),
                None => block.instructions.push(instruction),
            }
        }
    }
    module.functions = functions;
}

/// Puts other types in the place of some, and makes one of those that are the same then. What takes a place must be declared
/// before all that holds what it takes the place of.
pub fn exchange_types(module: &mut Module, mut same: HashMap<Word, Word>) {
    let gone: HashSet<Word> = same.keys().copied().collect();
    module
        .types_global_values
        .retain(|it| it.result_id.is_none_or(|id| !gone.contains(&id)));
    let mut seen: HashMap<(Op, Vec<Operand>), Word> = HashMap::new();
    let mut kept = Vec::new();
    for mut it in std::mem::take(&mut module.types_global_values) {
        rename(&mut it, &same);
        if let (Op::TypePointer | Op::TypeFunction | Op::TypeVector, Some(made)) =
            (op(&it), it.result_id)
        {
            let key = (op(&it), it.operands.clone());
            if let Some(first) = seen.get(&key) {
                same.insert(made, *first);
                continue;
            }
            seen.insert(key, made);
        }
        kept.push(it);
    }
    module.types_global_values = kept;
    let is_gone = |it: &Instruction| id(it, 0).is_some_and(|id| same.contains_key(&id));
    module.debug_names.retain(|it| !is_gone(it));
    module.annotations.retain(|it| !is_gone(it));
    for function in &mut module.functions {
        for it in function.all_inst_iter_mut() {
            rename(it, &same);
        }
    }
}

fn rename(it: &mut Instruction, same: &HashMap<Word, Word>) {
    if let Some(ty) = it.result_type.as_mut()
        && let Some(other) = same.get(ty)
    {
        *ty = *other;
    }
    for operand in &mut it.operands {
        if let Operand::IdRef(id) = operand
            && let Some(other) = same.get(id)
        {
            *id = *other;
        }
    }
}
