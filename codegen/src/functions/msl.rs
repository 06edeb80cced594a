//! MSL: a header whose functions are in a namespace. Each function forbids contraction for its own
//! body, and reordering where the version has the word. What the host looks up is a functor.

use super::ir::{Builtin, Function, Library, Literal, Type};
use super::names::pascal;
use super::print::{
    Dialect, Naming, Piece, atom, c_like, called, choice, components, digits, documented, function,
    members, provenance, signed,
};

struct Msl<'a>(&'a Naming);

/// The text of a library.
pub fn write(library: &Library, naming: &Naming, sha256: &str) -> String {
    let d = Msl(naming);
    let mut text = documented(&provenance(library, sha256), "//");
    text.push_str(&documented(&library.docs, "//"));
    text.push_str(&format!(
        "#pragma once\n#include <metal_stdlib>\n\nnamespace {} {{\nnamespace {} {{\n\n\
         constant constexpr uint API = {}u;\n",
        naming.prefix, naming.library, library.api
    ));
    for c in &library.constants {
        text.push('\n');
        text.push_str(&documented(&c.docs, "///"));
        text.push_str(&format!(
            "constant {} {} = {};\n",
            d.ty(&c.ty),
            c.name,
            components(&d, c).0
        ));
    }
    for s in &library.structs {
        text.push('\n');
        text.push_str(&documented(&s.docs, "///"));
        text.push_str(&format!("struct {} {{\n", s.name));
        text.push_str(&members(s, "///", &|name, ty| {
            format!("{} {name};", d.ty(ty))
        }));
        text.push_str("};\n");
    }
    for f in &library.functions {
        text.push('\n');
        text.push_str(&documented(&f.docs, "///"));
        text.push_str(&function(&d, f));
    }
    text.push_str(&format!(
        "\n}} // {}\n}} // {}\n",
        naming.library, naming.prefix
    ));
    text
}

impl Dialect for Msl<'_> {
    fn naming(&self) -> &Naming {
        self.0
    }

    fn ty(&self, ty: &Type) -> String {
        match ty {
            Type::Scalar(s) => c_like(*s).into(),
            Type::Vector(s, n) => format!("metal::{}{n}", c_like(*s)),
            Type::Matrix(n) => format!("metal::float{n}x{n}"),
            Type::Struct(name) => name.clone(),
            Type::Lookup(_) => String::new(),
        }
    }

    fn literal(&self, literal: Literal) -> Piece {
        match literal {
            Literal::F32(v) => signed(format!("{}f", digits(v))),
            Literal::U32(v) => atom(format!("{v}u")),
            Literal::I32(v) => signed(format!("{v}")),
            Literal::Bool(v) => atom(v.to_string()),
        }
    }

    fn builtin(&self, which: Builtin, args: &[Piece], _: &[&Type]) -> Piece {
        let name = match which {
            Builtin::Min => "metal::min",
            Builtin::Max => "metal::max",
            Builtin::Abs => "metal::abs",
            Builtin::Sqrt => "metal::sqrt",
            Builtin::Floor => "metal::floor",
            Builtin::Select => return choice(args),
            Builtin::ToF32 => "float",
            Builtin::ToU32 => "uint",
            Builtin::ToI32 => "int",
            Builtin::BitsOf => "as_type<uint>",
            Builtin::FromBits => "as_type<float>",
            Builtin::Native(native) => return called(&format!("metal::{}", native.name()), args),
        };
        called(name, args)
    }

    fn construct(&self, ty: &Type, parts: &[Piece]) -> Piece {
        match ty {
            Type::Struct(name) => {
                let all: Vec<&str> = parts.iter().map(|p| p.0.as_str()).collect();
                atom(format!("{name}{{{}}}", all.join(", ")))
            }
            _ => called(&self.ty(ty), parts),
        }
    }

    fn head(&self, function: &Function) -> String {
        let mut templates = Vec::new();
        let params: Vec<String> = function
            .params
            .iter()
            .map(|p| {
                let name = &function.locals[p.id].name;
                if let Type::Lookup(_) = p.ty {
                    templates.push(format!("typename {}", pascal(name)));
                    return format!("{} {name}", pascal(name));
                }
                format!("{} {name}", self.ty(&p.ty))
            })
            .collect();
        let template = if templates.is_empty() {
            String::new()
        } else {
            format!("template <{}>\n", templates.join(", "))
        };
        format!(
            "{template}inline {} {}({}) {{\n    #pragma METAL fp contract(off)\n\
             #if __METAL_VERSION__ >= 320\n    #pragma METAL fp math_mode(safe)\n#endif",
            self.ty(&function.result),
            function.name,
            params.join(", ")
        )
    }

    fn constant_local(&self, name: &str, ty: &Type, value: &Piece) -> String {
        format!("const {} {name} = {};", self.ty(ty), value.0)
    }

    fn variable(&self, name: &str, ty: &Type, value: &Piece) -> String {
        format!("{} {name} = {};", self.ty(ty), value.0)
    }

    fn call(&self, name: &str, args: &[Piece]) -> Piece {
        called(name, args)
    }
}
