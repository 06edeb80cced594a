//! What naga's SPIR-V reader and its writers need of a module, done to a copy of it before it is
//! read: edits are easier and safer there than in naga's trees, where every expression must follow
//! what it uses.
//!
//! | what | without it | case in `tests/upstream` |
//! | --- | --- | --- |
//! | a type of two whole numbers for coordinates into arrays of textures | naga 30.0.1 panics | `naga-arrayed-fetch` |
//! | a copy of what an operation of a subgroup takes from another block | naga 30.0.1 panics | `naga-subgroup-operand` |
//! | a copy of what an atomic operation takes from another block | naga 30.0.1 makes an invalid module | `naga-atomic-operand` |
//! | a mask of samples as a number, which is an array in SPIR-V | naga 30.0.1 refuses it | `naga-sample-mask` |
//! | depths that are never compared as floats in GLSL | a sampler that compares, which cannot read them | |
//! | the remainder of signed numbers in GLSL | `%`, which GLSL leaves undefined below zero | `naga-glsl-remainder` |
//! | exchanged bytes in HLSL | DXC 1.7 makes an intrinsic of them that Direct3D does not have | `dxc-byte-swap` |
//!
//! And what the reader drops without a word is looked for: [`Dropped`].

use std::collections::{BTreeMap, HashMap, HashSet};

use naga::Sampling;
use rspirv::dr::{Instruction, Module, Operand};
use rspirv::spirv::{BuiltIn, Decoration, ImageOperands, Op, StorageClass, Word};

use crate::Language;
use crate::spirv::edit::{Sequence, replace_each};
use crate::spirv::halves;
use crate::spirv::{decoration, global, id, literal, op};

/// What naga's reader does not take over.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Dropped {
    /// What no text can say, since naga does not have it.
    pub reason: Option<String>,
    /// Where varyings are evaluated, by whether they are inputs, and location.
    pub sampling: BTreeMap<(bool, u32), Sampling>,
}

impl Dropped {
    /// Looks through a module.
    pub fn of(module: &Module) -> Self {
        let reason = module
            .functions
            .iter()
            .flat_map(|function| function.all_inst_iter())
            .find_map(|it| dropped(module, it));
        Self {
            reason,
            sampling: samplings(module),
        }
    }
}

/// Why a sampling instruction means less in naga's representation.
fn dropped(module: &Module, instruction: &Instruction) -> Option<String> {
    let (compares, place) = match op(instruction) {
        Op::ImageSampleDrefImplicitLod
        | Op::ImageSampleDrefExplicitLod
        | Op::ImageSampleProjDrefImplicitLod
        | Op::ImageSampleProjDrefExplicitLod
        | Op::ImageDrefGather => (true, 3),
        Op::ImageSampleImplicitLod
        | Op::ImageSampleExplicitLod
        | Op::ImageSampleProjImplicitLod
        | Op::ImageSampleProjExplicitLod => (false, 2),
        Op::ImageGather => (false, 3),
        _ => return None,
    };
    let Some(Operand::ImageOperands(operands)) = instruction.operands.get(place) else {
        return None;
    };
    let known = ImageOperands::BIAS
        | ImageOperands::LOD
        | ImageOperands::GRAD
        | ImageOperands::CONST_OFFSET;
    if !known.contains(*operands) {
        return Some(format!(
            "naga drops what a texture is sampled with: {:?}",
            *operands - known
        ));
    }
    if compares && operands.contains(ImageOperands::GRAD) {
        return Some("naga compares at level 0 where gradients are given".into());
    }
    // Bias comes before the level.
    let level = place + 1 + usize::from(operands.contains(ImageOperands::BIAS));
    let at_zero = || {
        let constant = global(module, id(instruction, level)?)?;
        Some(op(constant) == Op::Constant && literal(constant, 0) == Some(0))
    };
    (compares && operands.contains(ImageOperands::LOD) && at_zero() != Some(true)).then(|| {
        "naga compares at level 0 whichever level is given, and so would every text; WGSL and \
         GLSL ES have no comparison at a level"
            .into()
    })
}

/// The types of results.
fn types_of<'a>(all: impl Iterator<Item = &'a Instruction>) -> HashMap<Word, Word> {
    all.filter_map(|it| Some((it.result_id?, it.result_type?)))
        .collect()
}

/// What naga's reader refuses of a final module, which its writers are given otherwise: for those who read SPIR-V with
/// naga, as wgpu does.
pub fn refused(module: &Module) -> Option<&'static str> {
    let types = types_of(module.all_inst_iter());
    let ty = |value: Word| global(module, *types.get(&value)?);
    // `tests/upstream/naga-layers`.
    let sizes: HashMap<Word, u32> = module
        .functions
        .iter()
        .flat_map(|it| it.all_inst_iter())
        .filter(|it| matches!(op(it), Op::ImageQuerySizeLod | Op::ImageQuerySize))
        .filter(|it| {
            let image = id(it, 0).and_then(ty);
            image.and_then(|image| literal(image, 3)) == Some(1)
        })
        .filter_map(|it| Some((it.result_id?, literal(global(module, it.result_type?)?, 1)?)))
        .collect();
    let reads_layers = |it: &Instruction| {
        let of = |place| id(it, place).and_then(|size| sizes.get(&size)).copied();
        match op(it) {
            Op::CompositeExtract => of(0).is_some_and(|n| literal(it, 1) == Some(n - 1)),
            Op::VectorShuffle => of(0).is_some_and(|n| {
                (2..it.operands.len()).any(|place| literal(it, place) == Some(n - 1))
            }),
            _ => false,
        }
    };
    // `tests/upstream/naga-depth-gather`.
    let gathers_depths = |it: &Instruction| {
        let sampled = id(it, 0).and_then(ty).and_then(|sampled| id(sampled, 0));
        op(it) == Op::ImageGather
            && sampled
                .and_then(|image| global(module, image))
                .and_then(|image| literal(image, 2))
                == Some(1)
    };
    let mut all = module.functions.iter().flat_map(|it| it.all_inst_iter());
    let of_instruction = all.find_map(|it| {
        if reads_layers(it) {
            Some("the number of a texture's layers")
        } else if gathers_depths(it) {
            Some("gathered depths")
        } else {
            None
        }
    });
    of_instruction.or_else(|| {
        module.annotations.iter().find_map(|note| {
            let decoration = note.operands.get(1)?;
            if *decoration == Operand::Decoration(Decoration::BuiltIn) {
                // `tests/upstream/naga-sample-mask`.
                let is_mask = note.operands.get(2) == Some(&Operand::BuiltIn(BuiltIn::SampleMask));
                return is_mask.then_some("masks of samples");
            }
            // `tests/upstream/naga-centroid`.
            let evaluated = [Decoration::Centroid, Decoration::Sample].map(Operand::Decoration);
            evaluated
                .contains(decoration)
                .then_some("varyings at centroids and samples")
        })
    })
}

fn samplings(module: &Module) -> BTreeMap<(bool, u32), Sampling> {
    module
        .annotations
        .iter()
        .filter(|note| op(note) == Op::Decorate)
        .filter_map(|note| {
            let sampling = match note.operands.get(1)? {
                Operand::Decoration(Decoration::Centroid) => Sampling::Centroid,
                Operand::Decoration(Decoration::Sample) => Sampling::Sample,
                _ => return None,
            };
            let variable = id(note, 0)?;
            let location = decoration(module, variable, Decoration::Location)?;
            let class = global(module, variable)?.operands.first()?;
            let input = *class == Operand::StorageClass(StorageClass::Input);
            Some(((input, location), sampling))
        })
        .collect()
}

/// Edits that a language needs. Says whether there were any.
pub fn for_language(module: &mut Module, language: Language) -> bool {
    match language {
        Language::Glsl | Language::Essl310 | Language::Essl300 => {
            plain_depths(module) | remainders(module) | halves::widen(module)
        }
        Language::Hlsl => swapped_bytes(module),
        Language::Spirv | Language::Wgsl | Language::Msl => false,
    }
}

/// Depths that nothing compares become floats: a sampler of GLSL compares always, or never.
fn plain_depths(module: &mut Module) -> bool {
    let compares = |it: &Instruction| {
        matches!(
            op(it),
            Op::ImageSampleDrefImplicitLod | Op::ImageSampleDrefExplicitLod | Op::ImageDrefGather
        )
    };
    let functions = || module.functions.iter().flat_map(|it| it.all_inst_iter());
    if functions().any(compares) {
        return false;
    }
    let mut any = false;
    for it in &mut module.types_global_values {
        let depth = Operand::LiteralBit32(1);
        if op(it) == Op::TypeImage && it.operands.get(2) == Some(&depth) {
            it.operands[2] = Operand::LiteralBit32(0);
            any = true;
        }
    }
    any
}

/// naga looks for the type of a coordinate without the layer, which nobody may have used. It is part
/// of the final SPIR-V, which others read with naga, too.
pub fn coordinate_types(module: &mut Module) {
    let types = types_of(module.all_inst_iter());
    let mut wanted = Vec::new();
    for it in module.functions.iter().flat_map(|it| it.all_inst_iter()) {
        let (image, coordinate) = match op(it) {
            Op::ImageFetch | Op::ImageRead | Op::ImageWrite => (id(it, 0), id(it, 1)),
            _ => continue,
        };
        let vector = || {
            let image = global(module, *types.get(&image?)?)?;
            let arrayed = literal(image, 3) == Some(1);
            let vector = global(module, *types.get(&coordinate?)?)?;
            let size = literal(vector, 1)?;
            let is_vector = op(vector) == Op::TypeVector && arrayed && size > 2;
            is_vector.then(|| Some((id(vector, 0)?, size - 1)))?
        };
        wanted.extend(vector());
    }
    for (scalar, size) in wanted {
        let operands = vec![Operand::IdRef(scalar), Operand::LiteralBit32(size)];
        let there = module
            .types_global_values
            .iter()
            .any(|it| op(it) == Op::TypeVector && it.operands == operands);
        let Some(header) = module.header.as_mut().filter(|_| !there) else {
            continue;
        };
        let new = Instruction::new(Op::TypeVector, None, Some(header.bound), operands);
        header.bound += 1;
        module.types_global_values.push(new);
    }
}

/// naga reads what an operation of a subgroup, or an atomic one, takes after it has ended the list of expressions that it
/// would add a load to: of a value from another block it needs one. A copy in the same block is such a load. It is part of
/// the final SPIR-V, as above.
pub fn late_operands(module: &mut Module) {
    let Some(header) = &mut module.header else {
        return;
    };
    for function in &mut module.functions {
        let types = types_of(function.all_inst_iter());
        for block in &mut function.blocks {
            let own: HashSet<Word> = block
                .instructions
                .iter()
                .filter_map(|it| it.result_id)
                .collect();
            let mut instructions = Vec::with_capacity(block.instructions.len());
            for mut it in block.instructions.drain(..) {
                if let Some(first) = first_late_operand(op(&it)) {
                    for operand in it.operands.iter_mut().skip(first) {
                        let Operand::IdRef(value) = operand else {
                            continue;
                        };
                        if let Some(ty) = types.get(value).filter(|_| !own.contains(value)) {
                            let copied = vec![Operand::IdRef(*value)];
                            let copy = Instruction::new(
                                Op::CopyObject,
                                Some(*ty),
                                Some(header.bound),
                                copied,
                            );
                            *value = header.bound;
                            header.bound += 1;
                            instructions.push(copy);
                        }
                    }
                }
                instructions.push(it);
            }
            block.instructions = instructions;
        }
    }
}

/// Of an operation of a subgroup the scope is first, of an atomic one the pointer, the scope and the semantics.
fn first_late_operand(op: Op) -> Option<usize> {
    let number = op as u32;
    if (Op::GroupNonUniformElect as u32..=Op::GroupNonUniformQuadSwap as u32).contains(&number) {
        Some(1)
    } else if (Op::AtomicExchange as u32..=Op::AtomicXor as u32).contains(&number)
        || op == Op::AtomicFAddEXT
    {
        Some(3)
    } else {
        None
    }
}

/// The module with masks of samples as numbers, of which naga knows no arrays; none if it has no mask.
pub fn with_number_masks(module: &Module) -> Option<Module> {
    let masks: Vec<Word> = module
        .annotations
        .iter()
        .filter(|note| note.operands.get(2) == Some(&Operand::BuiltIn(BuiltIn::SampleMask)))
        .filter_map(|note| id(note, 0))
        .collect();
    if masks.is_empty() {
        return None;
    }
    let mut module = module.clone();
    let mut numbers = HashMap::new();
    for mask in masks {
        numbers.insert(mask, number_in_place_of_array(&mut module, mask)?);
    }
    // What refers to the element of an array refers to the number.
    let elements: HashMap<Word, Word> = module
        .functions
        .iter()
        .flat_map(|function| function.all_inst_iter())
        .filter(|it| matches!(op(it), Op::AccessChain | Op::InBoundsAccessChain))
        .filter_map(|it| {
            Some((
                it.result_id?,
                id(it, 0).filter(|of| numbers.contains_key(of))?,
            ))
        })
        .collect();
    replace_each(&mut module, |editor, it| {
        if it
            .result_id
            .is_some_and(|made| elements.contains_key(&made))
        {
            return Some(Vec::new());
        }
        match op(it) {
            Op::Load => {
                let (mask, ty) = (id(it, 0)?, it.result_type?);
                let number = *numbers.get(&mask)?;
                let mut steps = Sequence::new(editor, 0);
                let loaded = steps.then(Op::Load, number, &[mask]);
                steps.then(Op::CompositeConstruct, ty, &[loaded]);
                Some(steps.ending_in(it.result_id?))
            }
            Op::Store => {
                let (mask, array) = (id(it, 0)?, id(it, 1)?);
                let number = *numbers.get(&mask)?;
                let stored = editor.new_id();
                let operands = vec![Operand::IdRef(array), Operand::LiteralBit32(0)];
                let part =
                    Instruction::new(Op::CompositeExtract, Some(number), Some(stored), operands);
                let mut store = it.clone();
                store.operands[1] = Operand::IdRef(stored);
                Some(vec![part, store])
            }
            _ => None,
        }
    });
    let functions = module.functions.iter_mut();
    for it in functions.flat_map(|function| function.all_inst_iter_mut()) {
        for operand in &mut it.operands {
            if let Operand::IdRef(used) = operand
                && let Some(mask) = elements.get(used)
            {
                *used = *mask;
            }
        }
    }
    Some(module)
}

/// Makes a variable that is an array of one number that number, and gives the number's type.
fn number_in_place_of_array(module: &mut Module, variable: Word) -> Option<Word> {
    let pointer = global(module, global(module, variable)?.result_type?)?;
    let class = pointer.operands.first()?.clone();
    let number = id(global(module, id(pointer, 1)?)?, 0)?;
    let globals = &mut module.types_global_values;
    let at = globals
        .iter()
        .position(|it| it.result_id == Some(variable))?;
    let operands = vec![class, Operand::IdRef(number)];
    let there = globals[..at]
        .iter()
        .find(|it| op(it) == Op::TypePointer && it.operands == operands)
        .and_then(|it| it.result_id);
    let to_number = match there {
        Some(found) => found,
        None => {
            let header = module.header.as_mut()?;
            let new = header.bound;
            header.bound += 1;
            let globals = &mut module.types_global_values;
            globals.insert(
                at,
                Instruction::new(Op::TypePointer, None, Some(new), operands),
            );
            new
        }
    };
    let globals = module.types_global_values.iter_mut();
    for it in globals.filter(|it| it.result_id == Some(variable)) {
        it.result_type = Some(to_number);
    }
    Some(number)
}

/// `x % y` of signed numbers is `x - x / y * y`: quotients are truncated everywhere.
fn remainders(module: &mut Module) -> bool {
    let mut changed = false;
    replace_each(module, |editor, it| {
        if op(it) != Op::SRem {
            return None;
        }
        let (ty, result) = (it.result_type?, it.result_id?);
        let (left, right) = (id(it, 0)?, id(it, 1)?);
        let mut steps = Sequence::new(editor, 0);
        let quotient = steps.then(Op::SDiv, ty, &[left, right]);
        let product = steps.then(Op::IMul, ty, &[quotient, right]);
        steps.then(Op::ISub, ty, &[left, product]);
        changed = true;
        Some(steps.ending_in(result))
    });
    changed
}

/// Where each byte of a number of 32 or 64 bits comes from: a number and a byte of it, lowest first. Bytes that are 0, or
/// beyond the number, come from none.
type Bytes = [Option<(Word, usize)>; 8];

struct Numbers {
    /// What makes each number of the functions.
    made: HashMap<Word, Instruction>,
    constants: HashMap<Word, u64>,
}

impl Numbers {
    fn bytes(&self, number: Word, size: usize, depth: u32) -> Option<Bytes> {
        let leaf = std::array::from_fn(|byte| (byte < size).then_some((number, byte)));
        let Some(it) = self.made.get(&number).filter(|_| depth > 0) else {
            return Some(leaf);
        };
        let (left, right) = (id(it, 0), id(it, 1));
        let constant = |word: Option<Word>| self.constants.get(&word?).copied();
        let of = |word: Option<Word>| self.bytes(word?, size, depth - 1);
        match op(it) {
            Op::ShiftLeftLogical | Op::ShiftRightLogical => {
                let is_whole = |by: &u64| by.is_multiple_of(8) && *by < 8 * size as u64;
                let Some(shift) = constant(right).filter(is_whole) else {
                    return Some(leaf);
                };
                let from = of(left)?;
                let by = shift as usize / 8;
                Some(std::array::from_fn(|byte| match op(it) {
                    Op::ShiftLeftLogical if byte < size => {
                        byte.checked_sub(by).and_then(|byte| from[byte])
                    }
                    Op::ShiftLeftLogical => None,
                    _ => from.get(byte + by).copied().flatten(),
                }))
            }
            Op::BitwiseAnd => {
                let (mask, masked) = match (constant(left), constant(right)) {
                    (_, Some(mask)) => (mask, left),
                    (Some(mask), _) => (mask, right),
                    _ => return Some(leaf),
                };
                let mask = mask.to_le_bytes();
                if mask.iter().any(|byte| !matches!(byte, 0 | 0xff)) {
                    return Some(leaf);
                }
                let from = of(masked)?;
                Some(std::array::from_fn(|byte| {
                    from[byte].filter(|_| mask[byte] != 0)
                }))
            }
            Op::BitwiseOr => {
                let (a, b) = (of(left)?, of(right)?);
                let apart = a.iter().zip(&b).all(|(a, b)| a.is_none() || b.is_none());
                if !apart {
                    return Some(leaf);
                }
                Some(std::array::from_fn(|byte| a[byte].or(b[byte])))
            }
            _ => Some(leaf),
        }
    }

    /// The number of `size` bytes whose bytes, in the other order, `number` is made of.
    fn swapped(&self, number: Word, size: usize) -> Option<Word> {
        let bytes = self.bytes(number, size, 12)?;
        let (source, _) = bytes[0]?;
        let all = (0..size).all(|byte| bytes[byte] == Some((source, size - 1 - byte)));
        (all && source != number).then_some(source)
    }
}

/// The bytes of a number of 32 bits in the other order, `constants` being those of [`SWAPS`].
fn swap(
    steps: &mut Sequence<'_, '_>,
    ty: Word,
    number: Word,
    constants: [(Word, Word); 3],
) -> Word {
    let mut bits = steps.then(Op::BitReverse, ty, &[number]);
    for (by, mask) in constants {
        let low = steps.then(Op::BitwiseAnd, ty, &[bits, mask]);
        let up = steps.then(Op::ShiftLeftLogical, ty, &[low, by]);
        let high = steps.then(Op::ShiftRightLogical, ty, &[bits, by]);
        let down = steps.then(Op::BitwiseAnd, ty, &[high, mask]);
        bits = steps.then(Op::BitwiseOr, ty, &[up, down]);
    }
    bits
}

/// How far bits are moved to be in the other order within each byte, and which of them.
const SWAPS: [(u32, u32); 3] = [(1, 0x5555_5555), (2, 0x3333_3333), (4, 0x0f0f_0f0f)];

/// Exchanged bytes by way of exchanged bits, of which DXC makes nothing else.
fn swapped_bytes(module: &mut Module) -> bool {
    let made = module
        .functions
        .iter()
        .flat_map(|function| function.all_inst_iter())
        .filter_map(|it| Some((it.result_id?, it.clone())))
        .collect();
    let value = |it: &Instruction| match it.operands.first() {
        Some(Operand::LiteralBit32(bits)) => Some(u64::from(*bits)),
        Some(Operand::LiteralBit64(bits)) => Some(*bits),
        _ => None,
    };
    let constants = module
        .types_global_values
        .iter()
        .filter(|it| op(it) == Op::Constant)
        .filter_map(|it| Some((it.result_id?, value(it)?)))
        .collect();
    let numbers = Numbers { made, constants };
    let mut changed = false;
    replace_each(module, |editor, it| {
        if op(it) != Op::BitwiseOr {
            return None;
        }
        let (ty, result) = (it.result_type?, it.result_id?);
        let size = match editor.integer_type(ty) {
            Some((32, false)) => 4,
            Some((64, false)) => 8,
            _ => return None,
        };
        let source = numbers.swapped(result, size)?;
        let constants = SWAPS.map(|(by, mask)| (editor.word(by), editor.word(mask)));
        changed = true;
        if size == 4 {
            let mut steps = Sequence::new(editor, 0);
            swap(&mut steps, ty, source, constants);
            return Some(steps.ending_in(result));
        }
        let (word, half) = (editor.word_type(), editor.word(32));
        let mut steps = Sequence::new(editor, 0);
        let low = steps.then(Op::UConvert, word, &[source]);
        let high = steps.then(Op::ShiftRightLogical, ty, &[source, half]);
        let high = steps.then(Op::UConvert, word, &[high]);
        let [low, high] = [low, high].map(|number| {
            let swapped = swap(&mut steps, word, number, constants);
            steps.then(Op::UConvert, ty, &[swapped])
        });
        let low = steps.then(Op::ShiftLeftLogical, ty, &[low, half]);
        steps.then(Op::BitwiseOr, ty, &[low, high]);
        Some(steps.ending_in(result))
    });
    changed
}
