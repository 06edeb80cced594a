//! Takes away what a module declares and does not use, so that it asks as little as possible of
//! the device that runs it.

use std::collections::HashSet;

use rspirv::dr::{Instruction, Module, Operand};
use rspirv::spirv::{
    AddressingModel, BuiltIn, Capability, Decoration, Dim, ImageFormat, MemoryAccess, MemoryModel,
    MemorySemantics, Op, Scope, StorageClass, Word,
};

use super::{global, id, literal, op};

/// Removes capabilities that nothing in the module needs.
///
/// Knows those that Hankel enables for a whole crate; others stay. spirv-val, which runs
/// afterwards, would tell of one too few.
pub fn capabilities(module: &mut Module) {
    let used: HashSet<Capability> = module
        .all_inst_iter()
        .flat_map(|it| [needs(it), format_needs(it)])
        .flatten()
        .collect();
    module
        .capabilities
        .retain(|instruction| match instruction.operands.first() {
            Some(Operand::Capability(capability)) if ENABLED.contains(capability) => {
                used.contains(capability)
            }
            _ => true,
        });
}

/// Capabilities that are enabled for every kernel crate, used or not.
pub const ENABLED: [Capability; 21] = [
    // Of the number of a primitive.
    Capability::Geometry,
    // `narrow` leaves no such number.
    Capability::Int8,
    Capability::Int16,
    Capability::Float16,
    Capability::Float64,
    Capability::Int64,
    Capability::ImageQuery,
    Capability::StorageImageExtendedFormats,
    Capability::DerivativeControl,
    Capability::SampleRateShading,
    Capability::Sampled1D,
    Capability::Image1D,
    Capability::SampledCubeArray,
    Capability::ClipDistance,
    Capability::GroupNonUniform,
    Capability::GroupNonUniformVote,
    Capability::GroupNonUniformArithmetic,
    Capability::GroupNonUniformBallot,
    Capability::GroupNonUniformShuffle,
    Capability::GroupNonUniformShuffleRelative,
    Capability::GroupNonUniformQuad,
];

fn needs(instruction: &Instruction) -> Option<Capability> {
    match op(instruction) {
        Op::TypeFloat if literal(instruction, 0) == Some(16) => Some(Capability::Float16),
        Op::TypeFloat if literal(instruction, 0) == Some(64) => Some(Capability::Float64),
        Op::TypeInt if literal(instruction, 0) == Some(64) => Some(Capability::Int64),
        Op::ImageQuerySize
        | Op::ImageQuerySizeLod
        | Op::ImageQueryLod
        | Op::ImageQueryLevels
        | Op::ImageQuerySamples => Some(Capability::ImageQuery),
        Op::TypeImage => {
            let arrayed = literal(instruction, 3) == Some(1);
            let stored = literal(instruction, 5) == Some(2);
            match instruction.operands.get(1) {
                Some(Operand::Dim(Dim::Dim1D)) if stored => Some(Capability::Image1D),
                Some(Operand::Dim(Dim::Dim1D)) => Some(Capability::Sampled1D),
                Some(Operand::Dim(Dim::DimCube)) if arrayed => Some(Capability::SampledCubeArray),
                _ => None,
            }
        }
        Op::DPdxFine
        | Op::DPdyFine
        | Op::FwidthFine
        | Op::DPdxCoarse
        | Op::DPdyCoarse
        | Op::FwidthCoarse => Some(Capability::DerivativeControl),
        Op::Decorate
            if instruction.operands.get(1) == Some(&Operand::Decoration(Decoration::Sample)) =>
        {
            Some(Capability::SampleRateShading)
        }
        Op::Decorate => match instruction.operands.get(2) {
            Some(Operand::BuiltIn(BuiltIn::PrimitiveId)) => Some(Capability::Geometry),
            Some(Operand::BuiltIn(BuiltIn::ClipDistance)) => Some(Capability::ClipDistance),
            Some(Operand::BuiltIn(BuiltIn::SampleId)) => Some(Capability::SampleRateShading),
            Some(Operand::BuiltIn(
                BuiltIn::SubgroupSize
                | BuiltIn::SubgroupLocalInvocationId
                | BuiltIn::SubgroupId
                | BuiltIn::NumSubgroups,
            )) => Some(Capability::GroupNonUniform),
            _ => None,
        },
        // Each of these brings `GroupNonUniform` with it.
        Op::GroupNonUniformAll | Op::GroupNonUniformAny => Some(Capability::GroupNonUniformVote),
        Op::GroupNonUniformBallot
        | Op::GroupNonUniformBroadcast
        | Op::GroupNonUniformBroadcastFirst => Some(Capability::GroupNonUniformBallot),
        Op::GroupNonUniformShuffle | Op::GroupNonUniformShuffleXor => {
            Some(Capability::GroupNonUniformShuffle)
        }
        Op::GroupNonUniformShuffleUp | Op::GroupNonUniformShuffleDown => {
            Some(Capability::GroupNonUniformShuffleRelative)
        }
        Op::GroupNonUniformQuadBroadcast | Op::GroupNonUniformQuadSwap => {
            Some(Capability::GroupNonUniformQuad)
        }
        other if is_arithmetic(other) => Some(Capability::GroupNonUniformArithmetic),
        _ => None,
    }
}

/// What the format of a storage image needs.
fn format_needs(instruction: &Instruction) -> Option<Capability> {
    let has_format = op(instruction) == Op::TypeImage;
    match instruction.operands.get(6) {
        Some(Operand::ImageFormat(format)) if has_format && !is_core(*format) => {
            Some(Capability::StorageImageExtendedFormats)
        }
        _ => None,
    }
}

/// Whether it is a reduction or a scan of a subgroup, which SPIR-V numbers in a row.
fn is_arithmetic(op: Op) -> bool {
    (Op::GroupNonUniformIAdd as u32..=Op::GroupNonUniformLogicalXor as u32).contains(&(op as u32))
}

/// Formats that every device with storage images has.
fn is_core(format: ImageFormat) -> bool {
    matches!(
        format,
        ImageFormat::Unknown
            | ImageFormat::Rgba32f
            | ImageFormat::Rgba16f
            | ImageFormat::R32f
            | ImageFormat::Rgba8
            | ImageFormat::Rgba8Snorm
            | ImageFormat::Rgba32i
            | ImageFormat::Rgba16i
            | ImageFormat::Rgba8i
            | ImageFormat::R32i
            | ImageFormat::Rgba32ui
            | ImageFormat::Rgba16ui
            | ImageFormat::Rgba8ui
            | ImageFormat::R32ui
    )
}

/// Replaces the Vulkan memory model by GLSL's, where no access says more than GLSL's can.
///
/// rust-gpu declares Vulkan's for every module, but marks no access as shared with other
/// invocations. Under Vulkan's model an unmarked access is private: what one invocation puts into
/// workgroup memory need not reach another, barrier or not. Under GLSL's every access is shared,
/// which is what the kernels mean; and devices need not know the newer model.
pub fn memory_model(module: &mut Module) {
    let vulkan = Operand::MemoryModel(MemoryModel::Vulkan);
    if module
        .memory_model
        .as_ref()
        .and_then(|model| model.operands.get(1))
        != Some(&vulkan)
    {
        return;
    }
    let plain = MemoryAccess::VOLATILE | MemoryAccess::ALIGNED | MemoryAccess::NONTEMPORAL;
    let semantics: HashSet<Word> = module
        .functions
        .iter()
        .flat_map(|function| function.all_inst_iter())
        .flat_map(|instruction| &instruction.operands)
        .filter_map(|operand| match operand {
            Operand::IdMemorySemantics(id) => Some(*id),
            _ => None,
        })
        .collect();
    let beyond = MemorySemantics::OUTPUT_MEMORY
        | MemorySemantics::MAKE_AVAILABLE
        | MemorySemantics::MAKE_VISIBLE
        | MemorySemantics::VOLATILE;
    let says_more = module.all_inst_iter().any(|instruction| {
        let constant = op(instruction) == Op::Constant
            && instruction
                .result_id
                .is_some_and(|id| semantics.contains(&id))
            && literal(instruction, 0)
                .is_none_or(|bits| MemorySemantics::from_bits_truncate(bits).intersects(beyond));
        constant
            || instruction.operands.iter().any(|operand| match operand {
                Operand::MemoryAccess(access) => !plain.contains(*access),
                Operand::ImageOperands(operands) => operands.bits() & !0xff != 0,
                _ => false,
            })
    });
    if says_more {
        return;
    }
    device_scope(module);
    module.memory_model = Some(Instruction::new(
        Op::MemoryModel,
        None,
        None,
        vec![
            Operand::AddressingModel(AddressingModel::Logical),
            Operand::MemoryModel(MemoryModel::GLSL450),
        ],
    ));
    let needed = Operand::Capability(Capability::VulkanMemoryModel);
    module
        .capabilities
        .retain(|instruction| instruction.operands.first() != Some(&needed));
    module.extensions.retain(|instruction| {
        instruction.operands.first()
            != Some(&Operand::LiteralString(
                "SPV_KHR_vulkan_memory_model".into(),
            ))
    });
}

/// Widens the scope `QueueFamily`, which only Vulkan's memory model has and which rust-gpu's
/// atomics use, to `Device`.
fn device_scope(module: &mut Module) {
    let scope = |module: &Module, wanted: Scope| {
        module.types_global_values.iter().find_map(|constant| {
            let is_wanted =
                op(constant) == Op::Constant && literal(constant, 0) == Some(wanted as u32);
            let ty = global(module, constant.result_type?)?;
            (is_wanted && op(ty) == Op::TypeInt).then_some(constant.result_id?)
        })
    };
    let queue_family: HashSet<Word> = module
        .types_global_values
        .iter()
        .filter(|it| op(it) == Op::Constant && literal(it, 0) == Some(Scope::QueueFamily as u32))
        .filter_map(|it| it.result_id)
        .collect();
    let is_queue_family =
        |operand: &Operand| matches!(operand, Operand::IdScope(id) if queue_family.contains(id));
    let Some(&ty) = module
        .all_inst_iter()
        .find_map(|instruction| instruction.operands.iter().find(|it| is_queue_family(it)))
        .and_then(|operand| match operand {
            Operand::IdScope(id) => global(module, *id)?.result_type.as_ref(),
            _ => None,
        })
    else {
        return;
    };
    let device = match (scope(module, Scope::Device), &mut module.header) {
        (Some(device), _) => device,
        (None, Some(header)) => {
            let id = header.bound;
            header.bound += 1;
            let value = vec![Operand::LiteralBit32(Scope::Device as u32)];
            let made = Instruction::new(Op::Constant, Some(ty), Some(id), value);
            module.types_global_values.push(made);
            id
        }
        (None, None) => return,
    };
    for instruction in module.all_inst_iter_mut() {
        for operand in &mut instruction.operands {
            if is_queue_family(operand) {
                *operand = Operand::IdScope(device);
            }
        }
    }
}

/// Says of storage textures that are never read, or never written, that they are not: WGSL, GLSL ES
/// and Metal ask for less then.
pub fn accesses_of_textures(module: &mut Module) {
    let textures: Vec<Word> = module
        .types_global_values
        .iter()
        .filter(|variable| {
            op(variable) == Op::Variable
                && variable.operands.first()
                    == Some(&Operand::StorageClass(StorageClass::UniformConstant))
                && is_storage_image(module, variable).unwrap_or(false)
        })
        .filter_map(|variable| variable.result_id)
        .collect();
    for texture in textures {
        for (decoration, by) in [
            (Decoration::NonReadable, Op::ImageWrite),
            (Decoration::NonWritable, Op::ImageRead),
        ] {
            if uses_otherwise(module, texture, by) {
                continue;
            }
            let decoration = Operand::Decoration(decoration);
            let there = module.annotations.iter().any(|note| {
                op(note) == Op::Decorate
                    && id(note, 0) == Some(texture)
                    && note.operands.get(1) == Some(&decoration)
            });
            if !there {
                let operands = vec![Operand::IdRef(texture), decoration];
                let note = Instruction::new(Op::Decorate, None, None, operands);
                module.annotations.push(note);
            }
        }
    }
}

fn is_storage_image(module: &Module, variable: &Instruction) -> Option<bool> {
    let pointer = global(module, variable.result_type?)?;
    let image = global(module, id(pointer, 1)?)?;
    Some(op(image) == Op::TypeImage && literal(image, 5) == Some(2))
}

/// Whether anything but `access` and queries of the size uses the variable. If nothing else does, nor
/// does `access`, it is written: it has one of the two decorations, not both.
fn uses_otherwise(module: &Module, variable: Word, access: Op) -> bool {
    let body = || {
        module
            .functions
            .iter()
            .flat_map(|function| function.all_inst_iter())
    };
    let mut loaded = HashSet::new();
    for instruction in body() {
        let mentions = instruction.operands.contains(&Operand::IdRef(variable));
        if mentions && op(instruction) == Op::Load {
            loaded.extend(instruction.result_id);
        } else if mentions {
            return true;
        }
    }
    let mut accesses = access == Op::ImageWrite;
    let otherwise = body().any(|instruction| {
        let harmless = op(instruction) == access || op(instruction) == Op::ImageQuerySize;
        accesses |= op(instruction) == access
            && id(instruction, 0).is_some_and(|image| loaded.contains(&image));
        instruction
            .operands
            .iter()
            .enumerate()
            .any(|(place, operand)| {
                matches!(operand, Operand::IdRef(id) if loaded.contains(id))
                    && !(harmless && place == 0)
            })
    });
    otherwise || !accesses
}

/// Drops source lines and names; the names are written anew from the kernel's description.
pub fn debug(module: &mut Module) {
    module.debug_names.clear();
    lines(module);
}

/// Drops source lines.
pub fn lines(module: &mut Module) {
    module.debug_string_source.clear();
    module.debug_module_processed.clear();
    for function in &mut module.functions {
        for block in &mut function.blocks {
            block
                .instructions
                .retain(|instruction| !matches!(op(instruction), Op::Line | Op::NoLine));
        }
    }
    module
        .types_global_values
        .retain(|instruction| !matches!(op(instruction), Op::Line | Op::NoLine));
}
