//! Gives the module the names of the kernel's source, and compares the two on the way: an entry
//! point, binding or offset that differs from the description is an error.

use std::collections::HashMap;

use hankel_dsl::native::describe::{Kernel, Layout, Output, Role, Stage, Type};
use rspirv::dr::{Instruction, Module, Operand};
use rspirv::spirv::{Decoration, ExecutionModel, Op, StorageClass, Word};

use super::{decoration, global, id, literal, op};
use crate::error::{Failure, Step};

/// Names variables, structures, members and constants as `kernel` does.
///
/// # Errors
///
/// The module is not the one that the description describes.
pub fn apply(module: &mut Module, kernel: &Kernel) -> Result<(), Failure> {
    entry_point(module, kernel)?;
    let mut names = Names {
        kernel: &kernel.name,
        names: Vec::new(),
        taken: HashMap::new(),
    };
    for param in &kernel.params {
        match &param.role {
            Role::Uniform {
                binding,
                layout,
                push,
            } => {
                let variable = if *push {
                    in_class(module, StorageClass::PushConstant).next()
                } else {
                    bound(module, *binding)
                };
                names.block(module, variable, &param.name, layout, "Uniform", "value")?;
            }
            Role::Element { binding, layout }
            | Role::ElementMut { binding, layout }
            | Role::Storage { binding, layout }
            | Role::StorageMut {
                binding, layout, ..
            } => {
                names.buffer(module, *binding, &param.name, layout, "Buffer", "elements")?;
            }
            Role::Atomic { binding, .. } => {
                let plain = Layout {
                    name: "Counter".into(),
                    size: 4,
                    align: 4,
                    fields: Vec::new(),
                };
                names.buffer(module, *binding, &param.name, &plain, "Buffer", "elements")?;
            }
            Role::Texture { binding, .. }
            | Role::StorageTexture { binding, .. }
            | Role::Sampler { binding, .. } => {
                if let Some(variable) = bound(module, *binding) {
                    names.set(variable, &param.name);
                }
            }
            Role::Constant { id, .. } => {
                if let Some(constant) = super::spec_constant(module, *id) {
                    names.set(constant, &param.name);
                }
            }
            Role::Attribute { location, .. } | Role::Varying { location, .. } => {
                if let Some(variable) = located(module, StorageClass::Input, *location) {
                    names.set(variable, &param.name);
                }
            }
            Role::Index | Role::BuiltIn { .. } | Role::Shared { .. } => {}
        }
    }
    for (index, output) in kernel.outputs.iter().enumerate() {
        let name = output_name(kernel, index);
        match output {
            Output::Buffer {
                binding, layout, ..
            } => {
                names.buffer(module, *binding, &name, layout, "Buffer", "elements")?;
            }
            Output::Texture { binding, .. } => {
                if let Some(variable) = bound(module, *binding) {
                    names.set(variable, &name);
                }
            }
            Output::Varying { location, .. } | Output::Target { location, .. } => {
                if let Some(variable) = located(module, StorageClass::Output, *location) {
                    names.set(variable, &name);
                }
            }
            Output::SecondSource { .. } => {
                if let Some(variable) = second_source(module) {
                    names.set(variable, &name);
                }
            }
            Output::Position
            | Output::Depth
            | Output::SampleMask
            | Output::ClipDistances { .. } => {
                let number = match output {
                    Output::Depth => 22,
                    Output::SampleMask => 20,
                    Output::ClipDistances { .. } => 3,
                    _ => 0,
                };
                if let Some(variable) = built_in(module, StorageClass::Output, number) {
                    names.set(variable, &name);
                }
            }
        }
    }
    // In the order of the parameters; what the kernel does not use is gone.
    let mut shared = kernel.params.iter().filter_map(|param| match &param.role {
        Role::Shared { length, .. } => Some((&param.name, *length)),
        _ => None,
    });
    for variable in in_class(module, StorageClass::Workgroup) {
        let length = array_length(module, variable);
        if let Some((name, _)) = shared.find(|(_, n)| Some(*n) == length) {
            names.set(variable, name);
        }
    }
    for (built_in_number, name) in INPUTS {
        if let Some(variable) = built_in(module, StorageClass::Input, built_in_number) {
            names.set(variable, name);
        }
    }
    module.debug_names.extend(names.names);
    Ok(())
}

/// Input variables that every stage names alike: SPIR-V's number, name.
const INPUTS: [(u32, &str); 15] = [
    (28, "id"),
    (27, "local_id"),
    (26, "group_id"),
    (29, "local_index"),
    (36, "subgroup_size"),
    (38, "subgroup_count"),
    (40, "subgroup_id"),
    (41, "subgroup_invocation_id"),
    (42, "vertex_index"),
    (43, "instance_index"),
    (15, "frag_coord"),
    (17, "front_facing"),
    (18, "sample_index"),
    (20, "covered_samples"),
    (7, "primitive_index"),
];

/// What an output is called where it needs a name: `out` if it is the only one of its kind,
/// otherwise its number after it; `position`, `depth`, `color`.
pub fn output_name(kernel: &Kernel, index: usize) -> String {
    let stem = |output: &Output| match output {
        Output::Buffer { .. } | Output::Texture { .. } => "out",
        Output::Position => "position",
        Output::Depth => "depth",
        Output::SampleMask => "sample_mask",
        Output::ClipDistances { .. } => "clip_distances",
        Output::SecondSource { .. } => "second_color",
        Output::Varying { .. } => "varying",
        Output::Target { .. } => "color",
    };
    let name = stem(&kernel.outputs[index]);
    let alike = kernel
        .outputs
        .iter()
        .filter(|other| stem(other) == name)
        .count();
    let number = kernel.outputs[..index]
        .iter()
        .filter(|other| stem(other) == name)
        .count();
    if alike == 1 {
        name.into()
    } else {
        format!("{name}{number}")
    }
}

fn failure(kernel: &str, construct: String, message: String) -> Failure {
    Failure {
        kernel: kernel.into(),
        step: Step::Describe,
        construct: Some(construct),
        message,
        panicked: false,
    }
}

/// Gives the entry point called `from` another name.
pub(crate) fn rename_entry_point(module: &mut Module, from: &str, to: &str) {
    let from = Operand::LiteralString(from.into());
    for entry in &mut module.entry_points {
        if entry.operands.get(2) != Some(&from) {
            continue;
        }
        entry.operands[2] = Operand::LiteralString(to.into());
        let function = entry.operands[1].clone();
        for note in &mut module.debug_names {
            if op(note) == Op::Name && note.operands.first() == Some(&function) {
                note.operands[1] = Operand::LiteralString(to.into());
            }
        }
    }
}

fn entry_point(module: &Module, kernel: &Kernel) -> Result<(), Failure> {
    let [entry] = module.entry_points.as_slice() else {
        let count = module.entry_points.len();
        let message = format!("one entry point is expected, the module has {count}");
        return Err(failure(&kernel.name, "OpEntryPoint".into(), message));
    };
    let named = match entry.operands.get(2) {
        Some(Operand::LiteralString(name)) => name.as_str(),
        _ => "",
    };
    if named != kernel.name {
        let message = format!("the module's entry point is `{named}`");
        return Err(failure(&kernel.name, "OpEntryPoint".into(), message));
    }
    let model = match &kernel.stage {
        Stage::Compute { .. } => ExecutionModel::GLCompute,
        Stage::Vertex => ExecutionModel::Vertex,
        Stage::Fragment => ExecutionModel::Fragment,
    };
    if entry.operands.first() != Some(&Operand::ExecutionModel(model)) {
        let message = format!("its stage is not {model:?}");
        return Err(failure(&kernel.name, "OpEntryPoint".into(), message));
    }
    if let Stage::Compute { threads, .. } = &kernel.stage {
        let mode = Operand::ExecutionMode(rspirv::spirv::ExecutionMode::LocalSize);
        let size = module
            .execution_modes
            .iter()
            .find(|it| it.operands.get(1) == Some(&mode));
        let size = size.map(|it| [2, 3, 4].map(|place| literal(it, place).unwrap_or_default()));
        if size != Some(*threads) {
            let message = format!("the workgroup is {size:?}, not {threads:?}");
            return Err(failure(&kernel.name, "LocalSize".into(), message));
        }
    }
    Ok(())
}

/// The variable at a binding of set 0; unused ones are gone.
pub(super) fn bound(module: &Module, binding: u32) -> Option<Word> {
    variables(module).find(|variable| {
        decoration(module, *variable, Decoration::Binding) == Some(binding)
            && decoration(module, *variable, Decoration::DescriptorSet) == Some(0)
    })
}

pub(super) fn located(module: &Module, class: StorageClass, location: u32) -> Option<Word> {
    in_class(module, class).find(|variable| {
        decoration(module, *variable, Decoration::Location) == Some(location)
            && decoration(module, *variable, Decoration::Index) != Some(1)
    })
}

/// The output that is the second source of blending.
pub(super) fn second_source(module: &Module) -> Option<Word> {
    in_class(module, StorageClass::Output)
        .find(|variable| decoration(module, *variable, Decoration::Index) == Some(1))
}

fn in_class(module: &Module, class: StorageClass) -> impl Iterator<Item = Word> + '_ {
    variables(module).filter(move |variable| {
        global(module, *variable).and_then(|it| it.operands.first())
            == Some(&Operand::StorageClass(class))
    })
}

/// Elements of a variable that is an array.
fn array_length(module: &Module, variable: Word) -> Option<u32> {
    let pointer = global(module, global(module, variable)?.result_type?)?;
    let array = global(module, id(pointer, 1)?)?;
    literal(global(module, id(array, 1)?)?, 0)
}

pub(super) fn built_in(module: &Module, class: StorageClass, number: u32) -> Option<Word> {
    in_class(module, class).find(|variable| {
        module.annotations.iter().any(|note| {
            matches!(
                note.operands.as_slice(),
                [
                    Operand::IdRef(target),
                    Operand::Decoration(Decoration::BuiltIn),
                    Operand::BuiltIn(which),
                ] if target == variable && *which as u32 == number
            )
        })
    })
}

fn variables(module: &Module) -> impl Iterator<Item = Word> + '_ {
    module
        .types_global_values
        .iter()
        .filter(|instruction| op(instruction) == Op::Variable)
        .filter_map(|instruction| instruction.result_id)
}

struct Names<'a> {
    kernel: &'a str,
    names: Vec<Instruction>,
    /// Types that have a name.
    taken: HashMap<Word, String>,
}

impl Names<'_> {
    fn set(&mut self, target: Word, name: &str) {
        let operands = vec![Operand::IdRef(target), Operand::LiteralString(name.into())];
        self.names
            .push(Instruction::new(Op::Name, None, None, operands));
    }

    fn set_member(&mut self, target: Word, member: u32, name: &str) {
        let operands = vec![
            Operand::IdRef(target),
            Operand::LiteralBit32(member),
            Operand::LiteralString(name.into()),
        ];
        self.names
            .push(Instruction::new(Op::MemberName, None, None, operands));
    }

    /// A buffer: the variable, the block around its value or elements, and their structure.
    fn buffer(
        &mut self,
        module: &Module,
        binding: u32,
        name: &str,
        layout: &Layout,
        suffix: &str,
        member: &str,
    ) -> Result<(), Failure> {
        let variable = bound(module, binding);
        self.block(module, variable, name, layout, suffix, member)
    }

    /// The same of a variable; none if the kernel does not use it.
    fn block(
        &mut self,
        module: &Module,
        variable: Option<Word>,
        name: &str,
        layout: &Layout,
        suffix: &str,
        member: &str,
    ) -> Result<(), Failure> {
        let Some(variable) = variable else {
            return Ok(());
        };
        self.set(variable, name);
        let pointee = |pointer: Word| global(module, pointer).and_then(|it| id(it, 1));
        let Some(block) = global(module, variable)
            .and_then(|it| it.result_type)
            .and_then(pointee)
        else {
            return Ok(());
        };
        let Some(block_type) = global(module, block).filter(|it| op(it) == Op::TypeStruct) else {
            return Err(failure(
                self.kernel,
                format!("`{name}`"),
                "it is not a buffer".into(),
            ));
        };
        if self.taken.insert(block, layout.name.clone()).is_none() {
            self.set(block, &format!("{}{suffix}", camel_case(&layout.name)));
            self.set_member(block, 0, member);
        }
        let Some(mut element) = id(block_type, 0) else {
            return Ok(());
        };
        if let Some(array) = global(module, element).filter(|it| op(it) == Op::TypeRuntimeArray) {
            let stride = decoration(module, element, Decoration::ArrayStride);
            if stride != Some(layout.size) {
                let message = format!(
                    "an element takes {stride:?} bytes in SPIR-V, {} in Rust",
                    layout.size
                );
                return Err(failure(self.kernel, format!("`{name}`"), message));
            }
            element = id(array, 0).unwrap_or(element);
        }
        self.structure(module, element, layout)
    }

    fn structure(&mut self, module: &Module, ty: Word, layout: &Layout) -> Result<(), Failure> {
        let Some(structure) = global(module, ty).filter(|it| op(it) == Op::TypeStruct) else {
            return Ok(());
        };
        if layout.fields.iter().any(|field| field.name.is_empty()) {
            return Ok(());
        }
        if structure.operands.len() != layout.fields.len() {
            let message = format!(
                "it has {} members in SPIR-V, {} in Rust",
                structure.operands.len(),
                layout.fields.len()
            );
            return Err(failure(self.kernel, format!("`{}`", layout.name), message));
        }
        let first = self.taken.insert(ty, layout.name.clone()).is_none();
        if first {
            self.set(ty, &layout.name);
        }
        for (member, field) in (0..).zip(&layout.fields) {
            let offset = member_offset(module, ty, member);
            if offset != Some(field.offset) {
                let message = format!(
                    "it lies at byte {} in SPIR-V, {} in Rust",
                    offset.map_or("?".into(), |offset| offset.to_string()),
                    field.offset
                );
                let construct = format!("`{}::{}`", layout.name, field.name);
                return Err(failure(self.kernel, construct, message));
            }
            if first {
                self.set_member(ty, member, &field.name);
            }
            let mut inner = &field.ty;
            let mut inner_type = id(structure, member as usize);
            while let Type::Array { element, .. } = inner {
                inner = element;
                inner_type = inner_type.and_then(|array| id(global(module, array)?, 0));
            }
            if let (Type::Struct { layout }, Some(inner_type)) = (inner, inner_type) {
                self.structure(module, inner_type, layout)?;
            }
        }
        Ok(())
    }
}

fn member_offset(module: &Module, ty: Word, member: u32) -> Option<u32> {
    module.annotations.iter().find_map(|note| {
        (op(note) == Op::MemberDecorate
            && id(note, 0) == Some(ty)
            && literal(note, 1) == Some(member)
            && note.operands.get(2) == Some(&Operand::Decoration(Decoration::Offset)))
        .then(|| literal(note, 3))
        .flatten()
    })
}

/// `f32` to `F32`, `depth_pair` to `DepthPair`.
pub(crate) fn camel_case(name: &str) -> String {
    name.split('_')
        .flat_map(|part| {
            let mut letters = part.chars();
            letters
                .next()
                .map(char::to_uppercase)
                .into_iter()
                .flatten()
                .chain(letters)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    #[test]
    fn camel_case_joins_the_parts() {
        assert_eq!(super::camel_case("depth_pair"), "DepthPair");
        assert_eq!(super::camel_case("f32"), "F32");
        assert_eq!(super::camel_case("Moments"), "Moments");
    }
}
