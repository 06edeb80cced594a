//! C99, also as C++: a header for the processor. Functions are `static inline` and forbid contraction
//! where the compiler listens to the standard's pragma; GCC wants `-ffp-contract=off` (or `-std=c99`)
//! on processors that fuse.

use super::ir::{Builtin, COLUMNS, Function, Id, Library, Literal, Scalar, Signature, Type};
use super::print::{
    Bond, Dialect, Naming, Piece, atom, block_comment, bracketed, called, choice, components,
    digits, documented, function, list, members, provenance, signed,
};

struct C<'a>(&'a Naming);

/// The text of a library.
pub fn write(library: &Library, naming: &Naming, sha256: &str) -> String {
    let d = C(naming);
    let guard = format!("{}_H", naming.guard());
    let lines = |all: &[String]| -> String {
        documented(all, "")
            .lines()
            .map(|l| format!("/*{} */\n", if l.is_empty() { "" } else { l }))
            .collect()
    };
    let mut text = lines(&provenance(library, sha256));
    text.push_str(&block_comment(&library.docs));
    text.push_str(&format!(
        "#ifndef {guard}\n#define {guard}\n#define {}_API {}\n\n\
         #include <math.h>\n#include <stdbool.h>\n#include <stdint.h>\n#include <string.h>\n",
        naming.guard(),
        library.api
    ));
    text.push_str(&d.vectors());
    for c in &library.constants {
        text.push('\n');
        text.push_str(&block_comment(&c.docs));
        let value = match &c.ty {
            Type::Vector(..) => {
                let parts: Vec<Piece> = c.values.iter().map(|v| d.literal(*v)).collect();
                format!("{{{}}}", list(&parts))
            }
            _ => components(&d, c).0,
        };
        text.push_str(&format!(
            "static const {} {} = {value};\n",
            d.ty(&c.ty),
            naming.constant(&c.name),
        ));
    }
    for s in &library.structs {
        text.push('\n');
        text.push_str(&block_comment(&s.docs));
        let name = naming.structure(&s.name);
        text.push_str(&format!("typedef struct {name} {{\n"));
        text.push_str(
            &members(s, "//", &|name, ty| format!("{} {name};", d.ty(ty)))
                .lines()
                .map(|l| match l.trim_start().strip_prefix("//") {
                    Some(doc) => format!("    /*{doc} */\n"),
                    None => format!("{l}\n"),
                })
                .collect::<String>(),
        );
        text.push_str(&format!("}} {name};\n"));
    }
    for f in &library.functions {
        text.push('\n');
        text.push_str(&block_comment(&f.docs));
        text.push_str(&function(&d, f));
    }
    text.push_str("\n#endif\n");
    text
}

impl C<'_> {
    fn own(&self, name: &str) -> String {
        self.0.function(name)
    }

    /// Vectors, matrices by their columns, and small functions, which other libraries may have declared before.
    fn vectors(&self) -> String {
        let guard = self.own("vectors_h").to_uppercase();
        let mut text = format!("\n#ifndef {guard}\n#define {guard}\n");
        for (scalar, name) in [("float", "float"), ("uint32_t", "uint"), ("int32_t", "int")] {
            for n in 2..=4 {
                let fields = ["x", "y", "z", "w"][..n].join(", ");
                let own = self.own(&format!("{name}{n}"));
                let params: Vec<String> = ["x", "y", "z", "w"][..n]
                    .iter()
                    .map(|f| format!("{scalar} {f}"))
                    .collect();
                let made = self.own(&format!("make_{name}{n}"));
                text.push_str(&format!(
                    "typedef struct {own} {{ {scalar} {fields}; }} {own};\n\
                     static inline {own} {made}({}) {{\n    {own} v = {{{fields}}};\n    return v;\n}}\n",
                    params.join(", ")
                ));
            }
        }
        for n in 2..=4 {
            let (own, made) = (format!("float{n}x{n}"), format!("make_float{n}x{n}"));
            let (own, made) = (self.own(&own), self.own(&made));
            let (column, names) = (self.own(&format!("float{n}")), &COLUMNS[..n]);
            let params: Vec<String> = names.iter().map(|c| format!("{column} {c}")).collect();
            let names = names.join(", ");
            text.push_str(&format!(
                "typedef struct {own} {{ {column} {names}; }} {own};\n\
                 static inline {own} {made}(\n    {}) {{\n    {own} m = {{{names}}};\n    return m;\n}}\n",
                params.join(",\n    ")
            ));
        }
        for (scalar, name) in [("float", "f"), ("uint32_t", "u"), ("int32_t", "i")] {
            for (which, sign) in [("min", "<"), ("max", ">")] {
                let own = self.own(&format!("{which}{name}"));
                text.push_str(&format!(
                    "static inline {scalar} {own}({scalar} a, {scalar} b) {{ return a {sign} b ? a : b; }}\n"
                ));
            }
        }
        let (bits, float) = (self.own("bits_of"), self.own("from_bits"));
        text.push_str(&format!(
            "static inline uint32_t {bits}(float x) {{ uint32_t b; memcpy(&b, &x, 4); return b; }}\n\
             static inline float {float}(uint32_t b) {{ float x; memcpy(&x, &b, 4); return x; }}\n\
             #endif\n"
        ));
        text
    }
}

impl Dialect for C<'_> {
    fn naming(&self) -> &Naming {
        self.0
    }

    fn ty(&self, ty: &Type) -> String {
        match ty {
            Type::Scalar(Scalar::F32) => "float".into(),
            Type::Scalar(Scalar::U32) => "uint32_t".into(),
            Type::Scalar(Scalar::I32) => "int32_t".into(),
            Type::Scalar(Scalar::Bool) => "bool".into(),
            Type::Vector(s, n) => self.own(&format!("{}{n}", super::print::c_like(*s))),
            Type::Matrix(n) => self.own(&format!("float{n}x{n}")),
            Type::Struct(name) => self.0.structure(name),
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

    fn builtin(&self, which: Builtin, args: &[Piece], types: &[&Type]) -> Piece {
        let letter = match types.first().and_then(|t| t.scalar()) {
            Some(Scalar::U32) => "u",
            Some(Scalar::I32) => "i",
            _ => "f",
        };
        let cast = |to: &str| {
            (
                format!("({to}){}", bracketed(&args[0], Bond::Atom)),
                Bond::Sign,
            )
        };
        match which {
            Builtin::Min => called(&self.own(&format!("min{letter}")), args),
            Builtin::Max => called(&self.own(&format!("max{letter}")), args),
            Builtin::Abs => called("fabsf", args),
            Builtin::Sqrt => called("sqrtf", args),
            Builtin::Floor => called("floorf", args),
            Builtin::Select => choice(args),
            Builtin::ToF32 => cast("float"),
            Builtin::ToU32 => cast("uint32_t"),
            Builtin::ToI32 => cast("int32_t"),
            Builtin::BitsOf => called(&self.own("bits_of"), args),
            Builtin::FromBits => called(&self.own("from_bits"), args),
            Builtin::Native(native) => called(&format!("{}f", native.name()), args),
        }
    }

    fn construct(&self, ty: &Type, parts: &[Piece]) -> Piece {
        match ty {
            Type::Vector(s, n) => {
                let name = self.own(&format!("make_{}{n}", super::print::c_like(*s)));
                called(&name, parts)
            }
            Type::Matrix(n) => called(&self.own(&format!("make_float{n}x{n}")), parts),
            _ => atom(format!("{{{}}}", list(parts))),
        }
    }

    fn give(&self, ty: &Type, value: &Piece) -> String {
        match ty {
            Type::Struct(_) if value.0.starts_with('{') => {
                format!("{} given = {};\nreturn given;", self.ty(ty), value.0)
            }
            _ => format!("return {};", value.0),
        }
    }

    fn member(&self, of: &Piece, _: &Type, name: &str) -> Piece {
        atom(format!("{}.{name}", bracketed(of, Bond::Atom)))
    }

    fn head(&self, function: &Function) -> String {
        let params: Vec<String> = function
            .params
            .iter()
            .map(|p| {
                let name = &function.locals[p.id].name;
                let Type::Lookup(signature) = &p.ty else {
                    return format!("{} {name}", self.ty(&p.ty));
                };
                let types: Vec<String> = signature.params.iter().map(|t| self.ty(t)).collect();
                format!(
                    "{} (*{name})(void *context, {}), void *{name}_context",
                    self.ty(&signature.result),
                    types.join(", ")
                )
            })
            .collect();
        format!(
            "static inline {} {}({}) {{\n#ifndef __GNUC__\n#pragma STDC FP_CONTRACT OFF\n#endif",
            self.ty(&function.result),
            self.0.function(&function.name),
            params.join(", ")
        )
        .replace(
            "#ifndef __GNUC__",
            "#if !defined(__GNUC__) || defined(__clang__)",
        )
    }

    fn constant_local(&self, name: &str, ty: &Type, value: &Piece) -> String {
        format!("const {} {name} = {};", self.ty(ty), value.0)
    }

    fn variable(&self, name: &str, ty: &Type, value: &Piece) -> String {
        format!("{} {name} = {};", self.ty(ty), value.0)
    }

    fn lookup(&self, function: &Function, id: Id, _: &Signature, args: &[Piece]) -> Piece {
        let name = &function.locals[id].name;
        let mut all = vec![atom(format!("{name}_context"))];
        all.extend(args.iter().cloned());
        called(name, &all)
    }

    fn passed(&self, function: &Function, id: Id) -> Piece {
        let name = &function.locals[id].name;
        atom(format!("{name}, {name}_context"))
    }

    fn comment(&self, text: &str) -> String {
        format!("/* {} */", text.replace("*/", "* /"))
    }
}
