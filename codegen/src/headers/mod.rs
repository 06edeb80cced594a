//! What a host includes to run kernels, in the folder `include`: structures of buffers that check
//! their own offsets at compile time, and for each kernel its texts, entry points, workgroup size and
//! bindings. In C and C++, Rust (and for users of wgpu and bytemuck), JavaScript with types.

mod c;
mod javascript;
mod rust;
mod wgpu;

use std::collections::BTreeMap;

use hankel_dsl::native::describe::{Field, Kernel, Layout, Output, Role, Scalar, Type};

use crate::manifest::{Binding, BindingKind, KernelEntry};
use crate::spirv::names::camel_case;

/// The structures that kernels use, each under a name of its own.
///
/// Structures that are generic over the precision have one name in Rust and two layouts: the one
/// with 64-bit floats gets `F64` appended. Structures of different modules that happen to share a
/// name get the kernel's function put before it.
#[derive(Clone, Debug, Default)]
pub struct Layouts {
    /// By name; the kernels' own order is in `order`.
    by_name: BTreeMap<String, Layout>,
    /// Names, each after those that it contains.
    order: Vec<String>,
}

impl Layouts {
    /// Collects the structures of the kernels' buffers.
    pub fn of(kernels: &[Kernel]) -> Self {
        let mut layouts = Self::default();
        for kernel in kernels {
            for layout in buffers(kernel) {
                layouts.add(layout, &kernel.function);
            }
        }
        layouts
    }

    /// The structures in an order in which each comes after those that it contains.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &Layout)> {
        self.order
            .iter()
            .map(|name| (name.as_str(), &self.by_name[name]))
    }

    /// The name of a structure; for a buffer of plain numbers the number's.
    pub fn name(&self, layout: &Layout) -> String {
        let known = self.by_name.iter().find(|(_, other)| *other == layout);
        known.map_or_else(|| layout.name.clone(), |(name, _)| name.clone())
    }

    /// The spelling of a type in the manifest: `f32`, `vec4<f32>`, `array<f32, 4>`, or the name of
    /// a structure.
    pub fn spell(&self, ty: &Type) -> String {
        match ty.in_shader() {
            Type::Scalar { scalar } => scalar.name().into(),
            Type::Vector { scalar, size } => format!("vec{size}<{}>", scalar.name()),
            Type::Array {
                element, length, ..
            } => format!("array<{}, {length}>", self.spell(element)),
            Type::Struct { layout } => self.name(layout),
        }
    }

    fn add(&mut self, layout: &Layout, function: &str) {
        if is_plain(layout) || self.by_name.values().any(|other| other == layout) {
            return;
        }
        for field in &layout.fields {
            let mut ty = &field.ty;
            while let Type::Array { element, .. } = ty {
                ty = element;
            }
            if let Type::Struct { layout } = ty {
                self.add(layout, function);
            }
        }
        let mut name = layout.name.clone();
        if has_double(layout) {
            name.push_str("F64");
        }
        if self.by_name.contains_key(&name) {
            name = format!("{}{name}", camel_case(function));
        }
        let mut number = 2;
        let stem = name.clone();
        while self.by_name.contains_key(&name) {
            name = format!("{stem}{number}");
            number += 1;
        }
        self.by_name.insert(name.clone(), layout.clone());
        self.order.push(name);
    }
}

/// Group and binding in WGSL of each binding, by kernel and number in SPIR-V; also of those that the
/// kernel's code does not use.
pub type InWgsl = BTreeMap<String, BTreeMap<u32, (u32, u32)>>;

/// The places in WGSL of a kernel's bindings.
struct Groups<'a> {
    in_wgsl: Option<&'a BTreeMap<u32, (u32, u32)>>,
}

impl<'a> Groups<'a> {
    fn of(in_wgsl: &'a InWgsl, kernel: &str) -> Self {
        Self {
            in_wgsl: in_wgsl.get(kernel),
        }
    }

    /// Group and binding.
    fn place(&self, binding: &Binding) -> (u32, u32) {
        let own = (binding.set, binding.binding);
        let place = self.in_wgsl.and_then(|it| it.get(&binding.binding));
        place.copied().unwrap_or(own)
    }

    /// The groups, each with its bindings and their numbers in it, in order. Without bindings there
    /// is one group that is empty.
    fn all<'b>(&self, bindings: &'b [Binding]) -> BTreeMap<u32, Vec<(u32, &'b Binding)>> {
        let mut groups: BTreeMap<u32, Vec<(u32, &Binding)>> = BTreeMap::new();
        let bound = bindings
            .iter()
            .filter(|it| it.kind != BindingKind::PushConstants);
        for binding in bound {
            let (group, number) = self.place(binding);
            groups.entry(group).or_default().push((number, binding));
        }
        for members in groups.values_mut() {
            members.sort_by_key(|(number, _)| *number);
        }
        if groups.is_empty() {
            groups.insert(0, Vec::new());
        }
        groups
    }

    /// Whether all bindings are where SPIR-V has them.
    fn are_as_in_spirv(&self) -> bool {
        let mut places = self.in_wgsl.into_iter().flatten();
        places.all(|(binding, place)| *place == (0, *binding))
    }
}

/// Every file of the folder `include`, by its path.
pub fn files(
    layouts: &Layouts,
    kernels: &BTreeMap<String, KernelEntry>,
    in_wgsl: &InWgsl,
) -> [(&'static str, String); 6] {
    [
        ("include/hankel.h", c::header(layouts, kernels)),
        ("include/hankel.rs", rust::module(layouts, kernels, in_wgsl)),
        ("include/hankel_bytemuck.rs", rust::bytemuck(layouts)),
        ("include/hankel_wgpu.rs", wgpu::module(kernels, in_wgsl)),
        (
            "include/hankel.js",
            javascript::module(layouts, kernels, in_wgsl),
        ),
        (
            "include/hankel.d.ts",
            javascript::types(layouts, kernels, in_wgsl),
        ),
    ]
}

fn buffers(kernel: &Kernel) -> impl Iterator<Item = &Layout> {
    let params = kernel.params.iter().filter_map(|param| match &param.role {
        Role::Uniform { layout, .. }
        | Role::Element { layout, .. }
        | Role::ElementMut { layout, .. }
        | Role::Storage { layout, .. }
        | Role::StorageMut { layout, .. } => Some(layout),
        _ => None,
    });
    let outputs = kernel.outputs.iter().filter_map(|output| match output {
        Output::Buffer { layout, .. } => Some(layout),
        _ => None,
    });
    params.chain(outputs)
}

/// A buffer of plain numbers.
fn is_plain(layout: &Layout) -> bool {
    layout.fields.iter().all(|field| field.name.is_empty())
}

fn has_double(layout: &Layout) -> bool {
    fn double(ty: &Type) -> bool {
        match ty {
            Type::Scalar { scalar } | Type::Vector { scalar, .. } => *scalar == Scalar::F64,
            Type::Array { element, .. } => double(element),
            Type::Struct { layout } => has_double(layout),
        }
    }
    layout.fields.iter().any(|field| double(&field.ty))
}

/// The Rust type of a scalar in memory.
fn scalar_name(scalar: Scalar) -> &'static str {
    match scalar {
        Scalar::Bool => "u32",
        other => other.name(),
    }
}

fn scalar_size(scalar: Scalar) -> u32 {
    scalar.bytes() as u32
}

/// Bytes that a type's values take, without padding after them.
fn size(ty: &Type) -> u32 {
    match ty {
        Type::Scalar { scalar } => scalar_size(*scalar),
        Type::Vector { scalar, size } => scalar_size(*scalar) * size,
        Type::Array { length, stride, .. } => length * stride,
        Type::Struct { layout } => layout.size,
    }
}

/// What stands between the fields: `Some` bytes of padding, or a field.
enum Part<'a> {
    Padding { bytes: u32, number: usize },
    Field(&'a Field),
}

fn parts(layout: &Layout) -> Vec<Part<'_>> {
    let mut parts = Vec::new();
    let mut at = 0;
    let mut number = 0;
    let mut pad = |parts: &mut Vec<Part<'_>>, bytes: u32| {
        if bytes > 0 {
            parts.push(Part::Padding { bytes, number });
            number += 1;
        }
    };
    for field in &layout.fields {
        pad(&mut parts, field.offset.saturating_sub(at));
        at = field.offset + size(&field.ty);
        parts.push(Part::Field(field));
    }
    pad(&mut parts, layout.size.saturating_sub(at));
    parts
}

/// What a field means: its documentation, and that a number of 32 bits is two halves, which its type does not say.
pub(crate) fn meaning(field: &Field) -> String {
    let halves = match &field.ty {
        Type::Array { element, .. } if element.in_shader() != &**element => {
            "Each number is two halves, the first one in its lower 16 bits."
        }
        ty if ty.in_shader() != ty => "Two halves, the first one in the lower 16 bits.",
        _ => return field.summary.clone(),
    };
    format!("{} {halves}", field.summary).trim_start().into()
}

fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Elements whose stride is larger than they are (`vec3`): as an array of their scalars, the last
/// ones being padding.
fn padded(element: &Type, stride: u32) -> Option<(Scalar, u32)> {
    match element {
        Type::Scalar { scalar } | Type::Vector { scalar, .. } if size(element) < stride => {
            Some((*scalar, stride / scalar_size(*scalar)))
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use std::process::{Command, Output};

    use hankel_dsl::native::describe::Inputs;

    use super::*;

    /// A structure with what is hard: a vector without its fourth number, arrays of numbers and of
    /// such vectors, a structure in it.
    fn light() -> Layout {
        let field = |name: &str, ty: Type, offset: u32| Field {
            name: name.into(),
            summary: "What a test needs.".into(),
            size: size(&ty),
            ty,
            offset,
            inputs: Inputs::default(),
        };
        let number = |scalar| Type::Scalar { scalar };
        let vec3 = Type::Vector {
            scalar: Scalar::F32,
            size: 3,
        };
        let array = |element: Type, length, stride| Type::Array {
            element: Box::new(element),
            length,
            stride,
        };
        let inner = Layout {
            name: "Range".into(),
            size: 8,
            align: 4,
            fields: vec![
                field("first", number(Scalar::U32), 0),
                field("step", number(Scalar::I32), 4),
            ],
        };
        Layout {
            name: "Light".into(),
            size: 80,
            align: 16,
            fields: vec![
                field("direction", vec3.clone(), 0),
                field("power", number(Scalar::F32), 12),
                field("weights", array(number(Scalar::F32), 3, 4), 16),
                field("points", array(vec3, 2, 16), 32),
                field("range", Type::Struct { layout: inner }, 64),
                field("precise", number(Scalar::F64), 72),
            ],
        }
    }

    #[test]
    fn halves_are_told_where_the_type_does_not() {
        let mut field = light().fields.remove(1);
        assert_eq!(meaning(&field), "What a test needs.");
        field.ty = Type::Vector {
            scalar: Scalar::F16,
            size: 2,
        };
        let halves = "Two halves, the first one in the lower 16 bits.";
        assert_eq!(meaning(&field), format!("What a test needs. {halves}"));
        field.summary.clear();
        assert_eq!(meaning(&field), halves);
    }

    fn layouts() -> Layouts {
        let mut layouts = Layouts::default();
        layouts.add(&light(), "light");
        layouts
    }

    /// What a shader reads: the words in order, the gaps 0.
    fn expected() -> Vec<u8> {
        let floats =
            |numbers: &[f32]| -> Vec<u8> { numbers.iter().flat_map(|x| x.to_le_bytes()).collect() };
        let mut bytes = floats(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 0.0]);
        bytes.extend(floats(&[8.0, 9.0, 10.0, 0.0, 11.0, 12.0, 13.0, 0.0]));
        bytes.extend(14_u32.to_le_bytes());
        bytes.extend((-15_i32).to_le_bytes());
        bytes.extend(16.5_f64.to_le_bytes());
        bytes
    }

    fn ran(mut command: Command) -> Output {
        let output = command
            .output()
            .unwrap_or_else(|e| panic!("{command:?}: {e}"));
        assert!(
            output.status.success(),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
        output
    }

    #[test]
    fn rust_gives_the_bytes_that_shaders_read() {
        let folder = tempfile::tempdir().unwrap();
        let text = rust::module(&layouts(), &BTreeMap::new(), &InWgsl::new());
        assert!(!text.contains("feature"), "{text}");
        let main = "
            fn main() {
                let range = Range { first: 14, step: -15 };
                let light = LightF64 {
                    direction: [1.0, 2.0, 3.0],
                    power: 4.0,
                    weights: [5.0, 6.0, 7.0],
                    hankel_pad0: [0; 4],
                    points: [[8.0, 9.0, 10.0, 0.0], [11.0, 12.0, 13.0, 0.0]],
                    range,
                    precise: 16.5,
                };
                print!(\"{:?}\", light.to_bytes().to_vec());
            }";
        std::fs::write(folder.path().join("main.rs"), text + main).unwrap();
        let mut rustc = Command::new("rustc");
        rustc
            .current_dir(folder.path())
            .args(["--edition=2021", "-Dwarnings", "main.rs"]);
        ran(rustc);
        let output = ran(Command::new(folder.path().join("main")));
        assert_eq!(
            String::from_utf8_lossy(&output.stdout),
            format!("{:?}", expected())
        );
    }

    #[test]
    fn javascript_writes_the_bytes_that_shaders_read() {
        let folder = tempfile::tempdir().unwrap();
        let text = javascript::module(&layouts(), &BTreeMap::new(), &InWgsl::new());
        std::fs::write(folder.path().join("hankel.mjs"), text).unwrap();
        let main = "
            import { LightF64 } from './hankel.mjs';
            const bytes = new Uint8Array(LightF64.size);
            LightF64.write(new DataView(bytes.buffer), 0, {
                direction: [1, 2, 3], power: 4, weights: [5, 6, 7],
                points: [[8, 9, 10], [11, 12, 13]],
                range: { first: 14, step: -15 }, precise: 16.5,
            });
            process.stdout.write(`[${[...bytes].join(', ')}]`);";
        std::fs::write(folder.path().join("main.mjs"), main).unwrap();
        let mut node = Command::new("node");
        node.current_dir(folder.path()).arg("main.mjs");
        let output = ran(node);
        assert_eq!(
            String::from_utf8_lossy(&output.stdout),
            format!("{:?}", expected())
        );
    }
}
