//! Rust for the processor, without dependencies: vectors are arrays, matrices arrays of columns.

use super::ir::{
    Binary, Builtin, Function, Id, Library, Literal, Native, Scalar, Signature, Type, Unary,
};
use super::print::{
    Bond, Dialect, Naming, Piece, atom, bracketed, called, column, component, components, digits,
    documented, function, list, members, operator, provenance, signed,
};

struct Rust<'a>(&'a Naming);

/// The text of a library: a module's.
pub fn write(library: &Library, naming: &Naming, sha256: &str) -> String {
    let d = Rust(naming);
    let mut text = documented(&provenance(library, sha256), "//");
    text.push_str(&documented(&library.docs, "//"));
    text.push_str(&format!(
        "\n/// Rises when a signature changes.\npub const API: u32 = {};\n",
        library.api
    ));
    for c in &library.constants {
        text.push('\n');
        text.push_str(&documented(&c.docs, "///"));
        text.push_str(&format!(
            "pub const {}: {} = {};\n",
            c.name,
            d.ty(&c.ty),
            components(&d, c).0
        ));
    }
    for s in &library.structs {
        text.push('\n');
        text.push_str(&documented(&s.docs, "///"));
        text.push_str(&format!(
            "#[derive(Clone, Copy, Debug, PartialEq)]\npub struct {} {{\n",
            s.name
        ));
        text.push_str(&members(s, "///", &|name, ty| {
            format!("pub {name}: {},", d.ty(ty))
        }));
        text.push_str("}\n");
        let params: Vec<String> = s
            .members
            .iter()
            .map(|(name, ty, _)| format!("{name}: {}", d.ty(ty)))
            .collect();
        let names: Vec<&str> = s.members.iter().map(|(name, ..)| name.as_str()).collect();
        text.push_str(&format!(
            "\nimpl {} {{\n    const fn of({}) -> Self {{\n        Self {{ {} }}\n    }}\n}}\n",
            s.name,
            params.join(", "),
            names.join(", ")
        ));
    }
    for f in &library.functions {
        text.push('\n');
        text.push_str(&documented(&f.docs, "///"));
        text.push_str("#[must_use]\n#[allow(unused_variables, unused_assignments)]\n");
        text.push_str("#[allow(clippy::all, clippy::pedantic)]\n");
        text.push_str(&function(&d, f));
    }
    text
}

impl Dialect for Rust<'_> {
    fn naming(&self) -> &Naming {
        self.0
    }

    fn ty(&self, ty: &Type) -> String {
        let scalar = |s: &Scalar| match s {
            Scalar::F32 => "f32",
            Scalar::U32 => "u32",
            Scalar::I32 => "i32",
            Scalar::Bool => "bool",
        };
        match ty {
            Type::Scalar(s) => scalar(s).into(),
            Type::Vector(s, n) => format!("[{}; {n}]", scalar(s)),
            Type::Matrix(n) => format!("[[f32; {n}]; {n}]"),
            Type::Struct(name) => name.clone(),
            Type::Lookup(signature) => {
                let params: Vec<String> = signature.params.iter().map(|t| self.ty(t)).collect();
                format!(
                    "&impl Fn({}) -> {}",
                    params.join(", "),
                    self.ty(&signature.result)
                )
            }
        }
    }

    fn literal(&self, literal: Literal) -> Piece {
        match literal {
            Literal::F32(v) => signed(format!("{}_f32", digits(v))),
            Literal::U32(v) => atom(format!("{v}_u32")),
            Literal::I32(v) => signed(format!("{v}_i32")),
            Literal::Bool(v) => atom(v.to_string()),
        }
    }

    fn builtin(&self, which: Builtin, args: &[Piece], types: &[&Type]) -> Piece {
        // No methods: for each, clippy looks through all that its receiver was computed from, in exponential time.
        let of_type = |name: &str| {
            let ty = types.first().map_or_else(String::new, |ty| self.ty(ty));
            called(&format!("{ty}::{name}"), args)
        };
        let cast = |to: &str| {
            (
                format!("{} as {to}", bracketed(&args[0], Bond::Sign)),
                Bond::Comparison,
            )
        };
        match which {
            Builtin::Min => of_type("min"),
            Builtin::Max => of_type("max"),
            Builtin::Abs => of_type("abs"),
            Builtin::Sqrt => of_type("sqrt"),
            Builtin::Floor => of_type("floor"),
            Builtin::Select => (
                format!(
                    "if {} {{ {} }} else {{ {} }}",
                    args[0].0, args[1].0, args[2].0
                ),
                Bond::Choice,
            ),
            Builtin::ToF32 => cast("f32"),
            Builtin::ToU32 => cast("u32"),
            Builtin::ToI32 => cast("i32"),
            Builtin::BitsOf => of_type("to_bits"),
            Builtin::FromBits => called("f32::from_bits", args),
            Builtin::Native(Native::Ln) => of_type("ln"),
            Builtin::Native(Native::Pow) => of_type("powf"),
            Builtin::Native(native) => of_type(native.name()),
        }
    }

    fn construct(&self, ty: &Type, parts: &[Piece]) -> Piece {
        match ty {
            Type::Vector(..) | Type::Matrix(_) => atom(format!("[{}]", list(parts))),
            _ => atom(format!("{}::of({})", self.ty(ty), list(parts))),
        }
    }

    fn head(&self, function: &Function) -> String {
        let params: Vec<String> = function
            .params
            .iter()
            .map(|p| format!("{}: {}", function.locals[p.id].name, self.ty(&p.ty)))
            .collect();
        format!(
            "pub fn {}({}) -> {} {{",
            function.name,
            params.join(", "),
            self.ty(&function.result)
        )
    }

    fn constant_local(&self, name: &str, _: &Type, value: &Piece) -> String {
        format!("let {name} = {};", value.0)
    }

    fn variable(&self, name: &str, ty: &Type, value: &Piece) -> String {
        format!("let mut {name}: {} = {};", self.ty(ty), value.0)
    }

    fn counting(&self, name: &str, _: &Type, from: &Piece, to: &Piece) -> String {
        format!("for {name} in {}..{} {{", from.0, bracketed(to, Bond::Atom))
    }

    fn condition(&self, condition: &Piece) -> String {
        format!("if {} {{", condition.0)
    }

    fn give(&self, _: &Type, value: &Piece) -> String {
        value.0.clone()
    }

    fn give_early(&self, _: &Type, value: &Piece) -> String {
        format!("return {};", value.0)
    }

    fn member(&self, of: &Piece, ty: &Type, name: &str) -> Piece {
        match ty {
            Type::Vector(..) => atom(format!(
                "{}[{}]",
                bracketed(of, Bond::Atom),
                component(name)
            )),
            Type::Matrix(_) => atom(format!("{}[{}]", bracketed(of, Bond::Atom), column(name))),
            _ => atom(format!("{}.{name}", bracketed(of, Bond::Atom))),
        }
    }

    fn unary(&self, op: Unary, x: &Piece) -> Piece {
        let sign = if op == Unary::Negate { "-" } else { "!" };
        (format!("{sign}{}", bracketed(x, Bond::Atom)), Bond::Sign)
    }

    fn binary(&self, op: Binary, a: &Piece, b: &Piece, ty: &Type) -> Piece {
        let name = match op {
            Binary::Add => "wrapping_add",
            Binary::Subtract => "wrapping_sub",
            Binary::Multiply => "wrapping_mul",
            _ => return operator(op, a, b),
        };
        match ty {
            Type::Scalar(Scalar::U32 | Scalar::I32) => {
                atom(format!("{}.{name}({})", bracketed(a, Bond::Atom), b.0))
            }
            _ => operator(op, a, b),
        }
    }

    fn call(&self, name: &str, args: &[Piece]) -> Piece {
        called(name, args)
    }

    fn lookup(&self, function: &Function, id: Id, _: &Signature, args: &[Piece]) -> Piece {
        called(&function.locals[id].name, args)
    }
}
