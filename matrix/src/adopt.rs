//! SPIR-V that a foreign compiler made of generated text, made to fit where the kernel's own SPIR-V
//! fits: the entry point has the kernel's name, everything is bound by the numbers of the
//! kernel's description, and GLSL's combined samplers are a texture and a sampler again, as the
//! description has them. The code itself stays as the compiler wrote it.

use rspirv::binary::Assemble;
use rspirv::dr::{self, Builder, Instruction, Operand};
use rspirv::spirv::{Decoration, ImageFormat, Op, StorageClass, Word};

use crate::job::{Job, Role};

/// Makes `code`, compiled from the text of `job` in HLSL, fit: the compiler was told the binding of
/// every register.
///
/// # Errors
/// In words: what is not as expected.
pub fn hlsl(code: &[u8], job: &Job) -> Result<Vec<u8>, String> {
    let mut module = load(code)?;
    rename(&mut module, &job.entry_point, &job.kernel)?;
    Ok(bytes(&module))
}

/// Makes `code`, compiled by glslang's front end for HLSL, fit. That counts a byte address buffer in
/// words where HLSL counts bytes (`tests/upstream/glslang-byte-address-size`); here it is multiplied.
///
/// # Errors
/// In words: what is not as expected.
pub fn hlsl_glslang(code: &[u8], job: &Job) -> Result<Vec<u8>, String> {
    let mut module = load(code)?;
    rename(&mut module, &job.entry_point, &job.kernel)?;
    let mut b = Builder::new_from_module(module);
    let uint = b.type_int(32, 0);
    let four = b.constant_bit32(uint, 4);
    let mut next = b.id();
    let blocks = b.module_mut().functions.iter_mut();
    for block in blocks.flat_map(|f| &mut f.blocks) {
        let mut all = Vec::with_capacity(block.instructions.len() + 1);
        for mut i in block.instructions.drain(..) {
            if i.class.opcode != Op::ArrayLength {
                all.push(i);
                continue;
            }
            let bytes = Instruction::new(
                Op::IMul,
                i.result_type,
                i.result_id.replace(next),
                vec![Operand::IdRef(next), Operand::IdRef(four)],
            );
            next += 1;
            all.extend([i, bytes]);
        }
        block.instructions = all;
    }
    let mut module = b.module();
    if let Some(header) = &mut module.header {
        header.bound = next + 1;
    }
    Ok(bytes(&module))
}

/// Makes `code`, compiled from the text of `job` in GLSL, fit.
///
/// # Errors
/// In words: what is not as expected.
pub fn glsl(code: &[u8], job: &Job) -> Result<Vec<u8>, String> {
    let mut module = load(code)?;
    rename(&mut module, "main", &job.kernel)?;
    let mut b = Builder::new_from_module(module);
    for slot in &job.slots {
        if let (Some(binding), Role::Texture { .. }, Some(_)) =
            (slot.binding, &slot.role, &slot.place)
        {
            let sampler = job.slots.iter().find_map(|s| {
                let place = s.place.as_ref()?;
                place
                    .combined_with
                    .contains(&binding)
                    .then_some(s.binding)?
            });
            split(&mut b, binding, sampler)?;
        }
    }
    Ok(bytes(&b.module()))
}

fn load(code: &[u8]) -> Result<dr::Module, String> {
    dr::load_bytes(code).map_err(|e| format!("the compiler's SPIR-V cannot be read: {e}"))
}

fn bytes(module: &dr::Module) -> Vec<u8> {
    module
        .assemble()
        .into_iter()
        .flat_map(u32::to_le_bytes)
        .collect()
}

fn rename(module: &mut dr::Module, from: &str, to: &str) -> Result<(), String> {
    let name = module
        .entry_points
        .iter_mut()
        .filter_map(|e| e.operands.get_mut(2))
        .find(|o| **o == Operand::LiteralString(from.into()))
        .ok_or_else(|| format!("the compiler's SPIR-V has no entry point `{from}`"))?;
    *name = Operand::LiteralString(to.into());
    Ok(())
}

/// The instruction that defines `id` among types and globals.
fn global(module: &dr::Module, id: Word) -> Option<&Instruction> {
    module
        .types_global_values
        .iter()
        .find(|i| i.result_id == Some(id))
}

/// Takes the combined variable at `binding` apart. A texture that no sampler belongs to is only
/// loaded from, and stays alone.
fn split(b: &mut Builder, binding: u32, sampler: Option<u32>) -> Result<(), String> {
    let module = b.module_ref();
    // A compiler drops what is not used.
    let Some(variable) = bound(module, binding) else {
        return Ok(());
    };
    let pointee = |id: Word| match global(module, id)?.operands.get(1)? {
        Operand::IdRef(inner) => Some(*inner),
        _ => None,
    };
    let combined = global(module, variable)
        .and_then(|v| v.result_type)
        .and_then(pointee)
        .ok_or_else(|| format!("binding {binding} is not a variable"))?;
    let image = match global(module, combined) {
        Some(i) if i.class.opcode == Op::TypeSampledImage => match i.operands.first() {
            Some(Operand::IdRef(image)) => *image,
            _ => return Err(format!("binding {binding} has no image")),
        },
        // It is separate already.
        _ => return Ok(()),
    };
    let pointer = b.type_pointer(None, StorageClass::UniformConstant, image);
    let second = sampler.map(|number| {
        let ty = b.type_sampler();
        let pointer = b.type_pointer(None, StorageClass::UniformConstant, ty);
        let variable = b.variable(pointer, None, StorageClass::UniformConstant, None);
        b.decorate(
            variable,
            Decoration::DescriptorSet,
            [Operand::LiteralBit32(0)],
        );
        b.decorate(
            variable,
            Decoration::Binding,
            [Operand::LiteralBit32(number)],
        );
        (ty, variable)
    });
    retype(b.module_mut(), variable, pointer);

    let mut next = b.id();
    let mut fresh = || {
        next += 1;
        next - 1
    };
    // Without a sampler, what was loaded is the image, and taking the image out of it is a copy.
    let mut plain = Vec::new();
    let instruction = |op: Op, ty: Word, id: Word, operands: &[Word]| {
        let operands = operands.iter().map(|&id| Operand::IdRef(id)).collect();
        Instruction::new(op, Some(ty), Some(id), operands)
    };
    for block in b
        .module_mut()
        .functions
        .iter_mut()
        .flat_map(|f| &mut f.blocks)
    {
        let mut all = Vec::with_capacity(block.instructions.len() + 4);
        for i in block.instructions.drain(..) {
            let reads = |id: Word| i.operands.first() == Some(&Operand::IdRef(id));
            match (i.class.opcode, i.result_id) {
                (Op::Load, Some(id)) if reads(variable) => match second {
                    Some((sampler_type, sampler)) => {
                        let (texture, s) = (fresh(), fresh());
                        all.push(instruction(Op::Load, image, texture, &[variable]));
                        all.push(instruction(Op::Load, sampler_type, s, &[sampler]));
                        all.push(instruction(Op::SampledImage, combined, id, &[texture, s]));
                    }
                    None => {
                        plain.push(id);
                        all.push(instruction(Op::Load, image, id, &[variable]));
                    }
                },
                (Op::Image, Some(id)) if plain.iter().any(|&p| reads(p)) => {
                    let from = i.operands.first().and_then(Operand::id_ref_any);
                    all.push(instruction(
                        Op::CopyObject,
                        image,
                        id,
                        &[from.unwrap_or(id)],
                    ));
                }
                _ => all.push(i),
            }
        }
        block.instructions = all;
    }
    // The builder has given one number away; it counts on from the header.
    let mut module = std::mem::replace(b, Builder::new()).module();
    if let Some(header) = &mut module.header {
        header.bound = next + 1;
    }
    *b = Builder::new_from_module(module);
    Ok(())
}

/// Gives a variable another type, after the declaration of which it then stands.
fn retype(module: &mut dr::Module, variable: Word, pointer: Word) {
    let all = &mut module.types_global_values;
    if let Some(at) = all.iter().position(|i| i.result_id == Some(variable)) {
        let mut declaration = all.remove(at);
        declaration.result_type = Some(pointer);
        all.push(declaration);
    }
}

/// Whether every storage texture has the format that the description says; a shader may leave it to
/// the texture. Software drivers take the texture's format whatever the shader says, so running it
/// shows nothing.
///
/// # Errors
/// In words: the texture and its formats.
pub fn check_formats(code: &[u8], job: &Job) -> Result<(), String> {
    let module = load(code)?;
    for slot in &job.slots {
        let (Some(binding), Role::StorageTexture { format, .. }) = (slot.binding, &slot.role)
        else {
            continue;
        };
        let Some(found) = image_format(&module, binding) else {
            continue;
        };
        if found != ImageFormat::Unknown && Some(found) != vulkan_format(format) {
            return Err(format!(
                "texture `{}` is {format}, but the shader's format is {found:?}",
                slot.name
            ));
        }
    }
    Ok(())
}

/// The format of the image at a binding; none where nothing uses it.
fn image_format(module: &dr::Module, binding: u32) -> Option<ImageFormat> {
    let variable = bound(module, binding)?;
    let pointer = global(module, variable)?.result_type?;
    let Operand::IdRef(image) = *global(module, pointer)?.operands.get(1)? else {
        return None;
    };
    let image = global(module, image).filter(|i| i.class.opcode == Op::TypeImage)?;
    image.operands.iter().find_map(|o| match o {
        Operand::ImageFormat(format) => Some(*format),
        _ => None,
    })
}

/// SPIR-V's name of a format.
fn vulkan_format(name: &str) -> Option<ImageFormat> {
    Some(match name {
        "r32float" => ImageFormat::R32f,
        "rgba32float" => ImageFormat::Rgba32f,
        "rgba16float" => ImageFormat::Rgba16f,
        "rgba16unorm" => ImageFormat::Rgba16,
        "rgba8unorm" => ImageFormat::Rgba8,
        "r32uint" => ImageFormat::R32ui,
        "rgba32uint" => ImageFormat::Rgba32ui,
        "r32sint" => ImageFormat::R32i,
        "rgba32sint" => ImageFormat::Rgba32i,
        "rg32uint" => ImageFormat::Rg32ui,
        "rg32sint" => ImageFormat::Rg32i,
        "rgba16uint" => ImageFormat::Rgba16ui,
        "rgba16sint" => ImageFormat::Rgba16i,
        "rgba8uint" => ImageFormat::Rgba8ui,
        "rgba8sint" => ImageFormat::Rgba8i,
        "rg32float" => ImageFormat::Rg32f,
        "rg16float" => ImageFormat::Rg16f,
        "r16float" => ImageFormat::R16f,
        "rg16unorm" => ImageFormat::Rg16,
        "r16unorm" => ImageFormat::R16,
        "rg8unorm" => ImageFormat::Rg8,
        "r8unorm" => ImageFormat::R8,
        "rgba16snorm" => ImageFormat::Rgba16Snorm,
        "rg16snorm" => ImageFormat::Rg16Snorm,
        "r16snorm" => ImageFormat::R16Snorm,
        "rgba8snorm" => ImageFormat::Rgba8Snorm,
        "rg8snorm" => ImageFormat::Rg8Snorm,
        "r8snorm" => ImageFormat::R8Snorm,
        "rg16uint" => ImageFormat::Rg16ui,
        "r16uint" => ImageFormat::R16ui,
        "rg8uint" => ImageFormat::Rg8ui,
        "r8uint" => ImageFormat::R8ui,
        "rg16sint" => ImageFormat::Rg16i,
        "r16sint" => ImageFormat::R16i,
        "rg8sint" => ImageFormat::Rg8i,
        "r8sint" => ImageFormat::R8i,
        "rgb10a2unorm" => ImageFormat::Rgb10A2,
        "rgb10a2uint" => ImageFormat::Rgb10a2ui,
        "rg11b10ufloat" => ImageFormat::R11fG11fB10f,
        _ => return None,
    })
}

/// The variable at a binding.
fn bound(module: &dr::Module, binding: u32) -> Option<Word> {
    module
        .annotations
        .iter()
        .find_map(|i| match i.operands[..] {
            [
                Operand::IdRef(id),
                Operand::Decoration(Decoration::Binding),
                Operand::LiteralBit32(n),
            ] if n == binding => Some(id),
            _ => None,
        })
}
