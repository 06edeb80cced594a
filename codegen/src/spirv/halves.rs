//! Numbers of 16 bits: their constants, and what languages do that have none.
//!
//! Such a language gets numbers of 32 bits, of which each result is rounded to 16. Rounding is by GLSL's `packHalf2x16` and `unpackHalf2x16`. A sum, a product or a quotient of 32 bits that is rounded
//! is the one of 16 bits: `kernels/dsl/src/half`.

use std::cell::RefCell;
use std::collections::{HashMap, HashSet};

use half::f16;
use rspirv::dr::{Instruction, Module, Operand};
use rspirv::spirv::{GlslStd450Op as GLOp, Op, Word};

use super::edit::{
    Editor, FloatType, Sequence, called, exchange_types, import_functions, is_call, replace_each,
};
use super::{exact, id, literal, op};

/// The numbers of 16 bits of a module.
struct Halves {
    /// Their type.
    half: Word,
    /// How many of them a vector holds, by its type.
    vectors: HashMap<Word, u32>,
    /// Types of values.
    types: HashMap<Word, Word>,
    /// Pairs of 32 bits that are made of two halves.
    unpacked: HashSet<Word>,
    /// Constants, and what was made of them alone.
    constants: RefCell<HashSet<Word>>,
}

/// Makes constants of 16 bits of those of 32 that are converted. Says whether there were any.
pub fn fold(module: &mut Module) -> bool {
    let Some(halves) = Halves::of(module) else {
        return false;
    };
    let mut any = false;
    replace_each(module, |editor, it| {
        let (result, ty) = (it.result_id?, it.result_type?);
        if op(it) != Op::FConvert || halves.count(ty).is_none() {
            return None;
        }
        let constant = halves.constant(editor, id(it, 0)?, ty)?;
        any = true;
        let mut copy = Sequence::new(editor, 0);
        copy.then(Op::CopyObject, ty, &[constant]);
        Some(copy.ending_in(result))
    });
    any
}

/// Gives all floating-point numbers at least 32 bits. Says whether some had 16.
pub fn widen(module: &mut Module) -> bool {
    let Some(halves) = Halves::of(module) else {
        return false;
    };
    let set = import_functions(module);
    for it in &mut module.types_global_values {
        if let (Some(ty), [Operand::LiteralBit32(bits)]) = (it.result_type, &mut it.operands[..])
            && ty == halves.half
        {
            *bits = f16::from_bits(*bits as u16).to_f32().to_bits();
        }
    }
    replace_each(module, |editor, it| halves.replaced(editor, set, it));
    let float = Editor::new(module).float_type_of(32);
    // It has to stand before what holds a half.
    let globals = &mut module.types_global_values;
    if let Some(place) = globals.iter().position(|it| it.result_id == Some(float.id)) {
        let declared = globals.remove(place);
        globals.insert(0, declared);
    }
    exchange_types(module, HashMap::from([(halves.half, float.id)]));
    true
}

impl Halves {
    fn of(module: &Module) -> Option<Self> {
        let globals = &module.types_global_values;
        let is_half = |it: &&Instruction| op(it) == Op::TypeFloat && literal(it, 0) == Some(16);
        let half = globals.iter().find(is_half)?.result_id?;
        let vectors = globals.iter().filter(|it| op(it) == Op::TypeVector);
        Some(Self {
            half,
            vectors: vectors
                .filter(|it| id(it, 0) == Some(half))
                .filter_map(|it| Some((it.result_id?, literal(it, 1)?)))
                .collect(),
            types: module
                .all_inst_iter()
                .filter_map(|it| Some((it.result_id?, it.result_type?)))
                .collect(),
            unpacked: module
                .all_inst_iter()
                .filter(|it| is_call(it, GLOp::UnpackHalf2x16))
                .filter_map(|it| it.result_id)
                .collect(),
            constants: RefCell::new(
                globals
                    .iter()
                    .filter(|it| matches!(op(it), Op::Constant | Op::ConstantComposite))
                    .filter_map(|it| it.result_id)
                    .collect(),
            ),
        })
    }

    /// How many halves a value of this type is; `None` where it is something else.
    fn count(&self, ty: Word) -> Option<u32> {
        match ty == self.half {
            true => Some(1),
            false => self.vectors.get(&ty).copied(),
        }
    }

    /// A constant, or several in a vector, as one of halves.
    fn constant(&self, editor: &mut Editor<'_>, of: Word, ty: Word) -> Option<Word> {
        if ty == self.half {
            let value = f16::from_f64(editor.float_value(of)?);
            return Some(editor.half(ty, value.to_bits()));
        }
        let parts = editor.parts_of(of)?;
        let parts: Option<Vec<_>> = parts
            .into_iter()
            .map(|part| self.constant(editor, part, self.half))
            .collect();
        let parts = parts?.into_iter().map(Operand::IdRef).collect();
        Some(editor.composite(ty, parts))
    }

    /// What takes the place of an instruction of which a result of 32 bits is no half.
    fn replaced(
        &self,
        editor: &mut Editor<'_>,
        set: Word,
        it: &Instruction,
    ) -> Option<Vec<Instruction>> {
        let (result, ty) = (it.result_id?, it.result_type?);
        let from_half = || self.count(*self.types.get(&id(it, 0)?)?);
        let is_half = || id(it, 0).is_some_and(|it| self.unpacked.contains(&it));
        if op(it) == Op::FConvert && (from_half().is_some() || is_half()) {
            let mut copy = Sequence::new(editor, set);
            copy.then(Op::CopyObject, ty, &[id(it, 0)?]);
            return Some(copy.ending_in(result));
        }
        let count = self.count(ty)?;
        if !is_rounded(it, set) {
            return None;
        }
        let float = editor.float_type_of(32);
        // From 32 bits nothing is left to do but to round.
        let (wide, mut made) = match op(it) {
            Op::FConvert => (id(it, 0)?, Vec::new()),
            _ => {
                let wide = editor.new_id();
                let mut wider = it.clone();
                wider.result_id = Some(wide);
                (wide, vec![wider])
            }
        };
        if count > 1 && self.is_constant(it) {
            self.constants.borrow_mut().insert(result);
            made.extend(rounded_one_by_one(editor, set, (wide, count), (ty, result)));
        } else {
            made.extend(rounded(editor, set, float, (wide, count), (ty, result)));
        }
        Some(made)
    }

    /// Whether an instruction's operands are constants alone.
    fn is_constant(&self, it: &Instruction) -> bool {
        let constants = self.constants.borrow();
        let mut values = it.operands.iter().filter_map(|operand| match operand {
            Operand::IdRef(value) if self.types.contains_key(value) => Some(value),
            _ => None,
        });
        values.all(|value| constants.contains(value))
    }
}

/// Whether the result may have more than 16 bits where its operands are halves.
fn is_rounded(it: &Instruction, set: Word) -> bool {
    match op(it) {
        Op::FConvert | Op::ConvertSToF | Op::ConvertUToF => true,
        Op::ExtInst => !matches!(
            called(it, set),
            Some(
                GLOp::FAbs
                    | GLOp::FSign
                    | GLOp::FMin
                    | GLOp::FMax
                    | GLOp::FClamp
                    | GLOp::NMin
                    | GLOp::NMax
                    | GLOp::NClamp
                    | GLOp::Floor
                    | GLOp::Ceil
                    | GLOp::Trunc
                    | GLOp::Round
                    | GLOp::RoundEven
                    | GLOp::Step
            )
        ),
        other => exact::arithmetic(other) && other != Op::FNegate,
    }
}

/// `count` numbers of 32 bits, rounded: a value of a type, with an id.
fn rounded(
    editor: &mut Editor<'_>,
    set: Word,
    float: FloatType,
    (wide, count): (Word, u32),
    (ty, result): (Word, Word),
) -> Vec<Instruction> {
    let pair = editor.vector_type_of(float.id, 2);
    let word = editor.word_type();
    let zero = editor.float(float, 0.0);
    let mut steps = Sequence::new(editor, set);
    let round = |steps: &mut Sequence<'_, '_>, two: Word| {
        let bits = steps.call(GLOp::PackHalf2x16, word, &[two]);
        steps.call(GLOp::UnpackHalf2x16, pair, &[bits])
    };
    match count {
        1 => {
            let two = steps.then(Op::CompositeConstruct, pair, &[wide, zero]);
            let two = round(&mut steps, two);
            steps.part(Op::CompositeExtract, ty, &[two], &[0]);
        }
        2 => {
            round(&mut steps, wide);
        }
        _ => {
            let first = steps.part(Op::VectorShuffle, pair, &[wide, wide], &[0, 1]);
            let second = steps.part(Op::VectorShuffle, pair, &[wide, wide], &[2, count - 1]);
            let (first, second) = (round(&mut steps, first), round(&mut steps, second));
            let parts: Vec<u32> = (0..count).collect();
            steps.part(Op::VectorShuffle, ty, &[first, second], &parts);
        }
    }
    steps.ending_in(result)
}

/// The same one by one. Of a pair of constants, Mesa 22.3.6 loses the second number where glslang has written the GLSL.
fn rounded_one_by_one(
    editor: &mut Editor<'_>,
    set: Word,
    (wide, count): (Word, u32),
    (ty, result): (Word, Word),
) -> Vec<Instruction> {
    let float = editor.float_type_of(32);
    let pair = editor.vector_type_of(float.id, 2);
    let (word, zero) = (editor.word_type(), editor.float(float, 0.0));
    let mut steps = Sequence::new(editor, set);
    let parts: Vec<Word> = (0..count)
        .map(|place| {
            let one = steps.part(Op::CompositeExtract, float.id, &[wide], &[place]);
            let two = steps.then(Op::CompositeConstruct, pair, &[one, zero]);
            let bits = steps.call(GLOp::PackHalf2x16, word, &[two]);
            let two = steps.call(GLOp::UnpackHalf2x16, pair, &[bits]);
            steps.part(Op::CompositeExtract, float.id, &[two], &[0])
        })
        .collect();
    steps.then(Op::CompositeConstruct, ty, &parts);
    steps.ending_in(result)
}

#[cfg(test)]
mod tests {
    use rspirv::spirv::Capability;

    use super::*;
    use crate::finish::validate;
    use crate::spirv::store;
    use crate::spirv::tests::of_wgsl;

    const TEXT: &str = "
        enable f16;
        @group(0) @binding(0) var<storage, read_write> numbers: array<vec4<f32>>;
        @compute @workgroup_size(64)
        fn scale(@builtin(global_invocation_id) id: vec3<u32>) {
            let all = vec4<f16>(numbers[id.x]);
            let three = all.xyz * 1.5h + all.yzw;
            let two = max(three.xy, all.zw) / all.xy;
            var sum = sqrt(dot(two, all.xy)) - 0.25h;
            if sum > 1.0h { sum = -sum; }
            numbers[id.x] = vec4<f32>(vec3<f32>(three), f32(sum));
        }";

    /// Instructions like one.
    fn count(module: &Module, like: impl Fn(&Instruction) -> bool) -> usize {
        module.all_inst_iter().filter(|it| like(it)).count()
    }

    #[test]
    fn no_half_is_left_and_the_module_is_valid() {
        let mut module = of_wgsl(TEXT);
        assert!(widen(&mut module));
        let halves = |it: &Instruction| op(it) == Op::TypeFloat && literal(it, 0) == Some(16);
        assert_eq!(count(&module, halves), 0);
        let capability = Operand::Capability(Capability::Float16);
        module
            .capabilities
            .retain(|it| it.operands[0] != capability);
        validate(&store(&module), "scale").unwrap();
        assert!(!widen(&mut module), "nothing is left to do");
    }

    #[test]
    fn results_are_rounded_and_what_is_exact_is_not() {
        let mut module = of_wgsl(TEXT);
        widen(&mut module);
        let packs = count(&module, |it| {
            op(it) == Op::ExtInst
                && it.operands[1] == Operand::LiteralExtInstInteger(GLOp::PackHalf2x16 as u32)
        });
        // Of four: the conversion. Of three: the product and the sum. Of two: the quotient. Of one: the dot product, the
        // root and the difference. Nothing of the maximum, the negation and the conversions to `f32`.
        assert_eq!(packs, 2 + 2 * 2 + 1 + 3);
    }

    #[test]
    fn constants_are_halves_at_once() {
        let mut module = of_wgsl(
            "enable f16;
            @group(0) @binding(0) var<storage, read_write> numbers: array<vec2<f32>>;
            @compute @workgroup_size(64)
            fn scale(@builtin(global_invocation_id) id: vec3<u32>) {
                var tenth = 0.1f;
                var both = vec2<f32>(1.5, -2.0);
                numbers[id.x] = vec2<f32>(vec2<f16>(both) * f16(tenth));
            }",
        );
        // As rust-gpu leaves it: what is converted is the constant itself.
        let first = |loaded: Word, module: &Module| {
            let made = |wanted: Word| {
                let mut all = module.all_inst_iter();
                all.find(|it| it.result_id == Some(wanted)).cloned()
            };
            let load = made(loaded).filter(|it| op(it) == Op::Load)?;
            made(id(&load, 0)?).and_then(|variable| id(&variable, 1))
        };
        let before = module.clone();
        for it in module
            .all_inst_iter_mut()
            .filter(|it| op(it) == Op::FConvert)
        {
            if let Some(stored) = id(it, 0).and_then(|of| first(of, &before)) {
                it.operands[0] = Operand::IdRef(stored);
            }
        }
        assert!(fold(&mut module));
        // naga's writer asks for halves in memory, too.
        let needed = [Capability::Shader, Capability::Float16].map(Operand::Capability);
        module
            .capabilities
            .retain(|it| needed.contains(&it.operands[0]));
        validate(&store(&module), "scale").unwrap();
        let converted = count(&module, |it| op(it) == Op::FConvert);
        assert_eq!(converted, 1, "the product alone");
        let tenth = Operand::LiteralBit32(0x2e66);
        assert_eq!(count(&module, |it| it.operands.first() == Some(&tenth)), 1);
    }

    #[test]
    fn other_modules_stay() {
        let text = "@compute @workgroup_size(1) fn main() {}";
        let mut module = of_wgsl(text);
        let before = store(&module);
        assert!(!widen(&mut module));
        assert_eq!(store(&module), before);
    }
}
