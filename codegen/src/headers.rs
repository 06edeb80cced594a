//! The structures of the kernels' buffers for the host: a C header and a Rust module. Both check
//! their own offsets at compile time.

use std::collections::BTreeMap;
use std::fmt::Write;

use hankel_dsl::native::describe::{Kernel, Layout, Output, Role, Scalar, Type};

use crate::VERSION;
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
        match ty {
            Type::Scalar { scalar } => scalar_name(*scalar).into(),
            Type::Vector { scalar, size } => format!("vec{size}<{}>", scalar_name(*scalar)),
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

fn scalar_name(scalar: Scalar) -> &'static str {
    match scalar {
        Scalar::F32 => "f32",
        Scalar::F64 => "f64",
        Scalar::U32 => "u32",
        Scalar::I32 => "i32",
    }
}

fn scalar_size(scalar: Scalar) -> u32 {
    if scalar == Scalar::F64 { 8 } else { 4 }
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
    Field(&'a hankel_dsl::native::describe::Field),
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

/// The C header, for C11 and C++11. Structures have the prefix `Hankel`.
pub fn c_header(layouts: &Layouts) -> String {
    let mut text = format!(
        "/* Generated by hankel {VERSION}. Do not edit.\n   The structures of the kernels' buffers, laid out as the shaders read them (std430). */\n\
         #ifndef HANKEL_H\n#define HANKEL_H\n\n#include <stddef.h>\n#include <stdint.h>\n\n\
         #ifdef __cplusplus\n#define HANKEL_ASSERT(condition, message) static_assert(condition, message)\n\
         #else\n#define HANKEL_ASSERT(condition, message) _Static_assert(condition, message)\n#endif\n"
    );
    for (name, layout) in layouts.iter() {
        let _ = write!(text, "\ntypedef struct Hankel{name} {{\n");
        for part in parts(layout) {
            match part {
                Part::Padding { bytes, number } => {
                    let _ = writeln!(text, "    uint8_t hankel_pad{number}[{bytes}];");
                }
                Part::Field(field) => {
                    let summary = one_line(&field.summary).replace("*/", "* /");
                    if !summary.is_empty() {
                        let _ = writeln!(text, "    /* {summary} */");
                    }
                    let (ty, dimensions) = c_type(layouts, &field.ty);
                    let _ = writeln!(text, "    {ty} {}{dimensions};", c_name(&field.name));
                }
            }
        }
        let _ = writeln!(text, "}} Hankel{name};");
        let _ = writeln!(
            text,
            "HANKEL_ASSERT(sizeof(Hankel{name}) == {}, \"size of Hankel{name}\");",
            layout.size
        );
        for field in &layout.fields {
            let member = c_name(&field.name);
            let _ = writeln!(
                text,
                "HANKEL_ASSERT(offsetof(Hankel{name}, {member}) == {}, \"offset of Hankel{name}::{member}\");",
                field.offset
            );
        }
    }
    text.push_str("\n#endif\n");
    text
}

/// A type before the name and its dimensions after it.
fn c_type(layouts: &Layouts, ty: &Type) -> (String, String) {
    let scalar = |scalar: &Scalar| {
        match scalar {
            Scalar::F32 => "float",
            Scalar::F64 => "double",
            Scalar::U32 => "uint32_t",
            Scalar::I32 => "int32_t",
        }
        .to_owned()
    };
    match ty {
        Type::Scalar { scalar: it } => (scalar(it), String::new()),
        Type::Vector { scalar: it, size } => (scalar(it), format!("[{size}]")),
        Type::Array {
            element,
            length,
            stride,
        } => {
            let (ty, dimensions) = match padded(element, *stride) {
                Some((scalar_of, count)) => (scalar(&scalar_of), format!("[{count}]")),
                None => c_type(layouts, element),
            };
            (ty, format!("[{length}]{dimensions}"))
        }
        Type::Struct { layout } => (format!("Hankel{}", layouts.name(layout)), String::new()),
    }
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

fn c_name(name: &str) -> String {
    const WORDS: [&str; 44] = [
        "alignas",
        "alignof",
        "and",
        "asm",
        "auto",
        "bool",
        "case",
        "catch",
        "char",
        "class",
        "default",
        "delete",
        "do",
        "double",
        "explicit",
        "export",
        "float",
        "friend",
        "goto",
        "inline",
        "int",
        "long",
        "mutable",
        "namespace",
        "new",
        "not",
        "operator",
        "or",
        "private",
        "protected",
        "public",
        "register",
        "short",
        "signed",
        "sizeof",
        "switch",
        "template",
        "this",
        "throw",
        "typedef",
        "union",
        "unsigned",
        "void",
        "volatile",
    ];
    let name = name.trim_start_matches("r#");
    if WORDS.contains(&name) {
        format!("{name}_")
    } else {
        name.into()
    }
}

/// The Rust module. With the feature `bytemuck` of the crate that includes it, the structures are
/// `Pod`.
pub fn rust_module(layouts: &Layouts) -> String {
    let mut text = format!(
        "// Generated by hankel {VERSION}. Do not edit.\n\
         // The structures of the kernels' buffers, laid out as the shaders read them (std430).\n\
         // Every byte is a field's: with a feature `bytemuck`, they derive Pod and Zeroable.\n"
    );
    for (name, layout) in layouts.iter() {
        let _ = write!(
            text,
            "\n/// `{}`, {} bytes.\n#[derive(Clone, Copy, Debug, PartialEq)]\n\
             #[cfg_attr(feature = \"bytemuck\", derive(bytemuck::Pod, bytemuck::Zeroable))]\n\
             #[repr(C)]\npub struct {name} {{\n",
            layout.name, layout.size
        );
        for part in parts(layout) {
            match part {
                Part::Padding { bytes, number } => {
                    let _ = writeln!(
                        text,
                        "    /// Padding: any value.\n    pub hankel_pad{number}: [u8; {bytes}],"
                    );
                }
                Part::Field(field) => {
                    let summary = one_line(&field.summary);
                    let summary = if summary.is_empty() {
                        field.name.as_str()
                    } else {
                        &summary
                    };
                    let ty = rust_type(layouts, &field.ty);
                    let _ = writeln!(text, "    /// {summary}\n    pub {}: {ty},", field.name);
                }
            }
        }
        let _ = writeln!(text, "}}");
        let _ = writeln!(
            text,
            "const _: () = assert!(core::mem::size_of::<{name}>() == {});",
            layout.size
        );
        for field in &layout.fields {
            let _ = writeln!(
                text,
                "const _: () = assert!(core::mem::offset_of!({name}, {}) == {});",
                field.name, field.offset
            );
        }
    }
    text
}

fn rust_type(layouts: &Layouts, ty: &Type) -> String {
    match ty {
        Type::Scalar { scalar } => scalar_name(*scalar).into(),
        Type::Vector { scalar, size } => format!("[{}; {size}]", scalar_name(*scalar)),
        Type::Array {
            element,
            length,
            stride,
        } => {
            let element = match padded(element, *stride) {
                Some((scalar, count)) => format!("[{}; {count}]", scalar_name(scalar)),
                None => rust_type(layouts, element),
            };
            format!("[{element}; {length}]")
        }
        Type::Struct { layout } => layouts.name(layout),
    }
}

fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}
