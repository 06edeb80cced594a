//! HLSL with an include guard, for Direct3D, Unity and Unreal: shader model 5 and later. Every fraction
//! has a suffix, which DXC rounds to nearest (`tests/upstream/dxc-literal-selection`), and every local is
//! `precise`: sums and products round as they are written.

use super::glsl::by_macro;
use super::ir::{Builtin, Function, Id, Library, Literal, Signature, Type};
use super::print::{
    Bond, Dialect, Naming, Piece, atom, bracketed, c_like, called, choice, column, component,
    components, digits, documented, function, list, members, provenance, rounds, signed,
};

pub(super) struct Hlsl<'a>(pub(super) &'a Naming);

/// The text of a library.
pub fn write(library: &Library, naming: &Naming, sha256: &str) -> String {
    let d = Hlsl(naming);
    let guard = format!("{}_HLSL", naming.guard());
    let mut text = documented(&provenance(library, sha256), "//");
    text.push_str(&documented(&library.docs, "//"));
    text.push_str(&format!(
        "#ifndef {guard}\n#define {guard}\n#define {}_API {}\n",
        naming.guard(),
        library.api
    ));
    for c in &library.constants {
        text.push('\n');
        text.push_str(&documented(&c.docs, "///"));
        text.push_str(&format!(
            "static const {} {} = {};\n",
            d.ty(&c.ty),
            naming.constant(&c.name),
            components(&d, c).0
        ));
    }
    for s in &library.structs {
        text.push('\n');
        text.push_str(&documented(&s.docs, "///"));
        text.push_str(&format!("struct {}\n{{\n", naming.structure(&s.name)));
        text.push_str(&members(s, "///", &|name, ty| {
            format!("{} {name};", d.ty(ty))
        }));
        text.push_str("};\n");
    }
    for f in &library.functions {
        let body = format!("{}{}", documented(&f.docs, "///"), function(&d, f));
        text.push('\n');
        text.push_str(&by_macro(naming, f, &body));
    }
    text.push_str("\n#endif\n");
    text
}

impl Dialect for Hlsl<'_> {
    fn naming(&self) -> &Naming {
        self.0
    }

    fn ty(&self, ty: &Type) -> String {
        match ty {
            Type::Scalar(s) => c_like(*s).into(),
            Type::Vector(s, n) => format!("{}{n}", c_like(*s)),
            Type::Matrix(n) => format!("float{n}x{n}"),
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

    fn builtin(&self, which: Builtin, args: &[Piece], _: &[&Type]) -> Piece {
        let name = match which {
            Builtin::Min => "min",
            Builtin::Max => "max",
            Builtin::Abs => "abs",
            Builtin::Sqrt => "sqrt",
            Builtin::Floor => "floor",
            Builtin::Select => return choice(args),
            Builtin::ToF32 => "float",
            Builtin::ToU32 => "uint",
            Builtin::ToI32 => "int",
            Builtin::BitsOf => "asuint",
            Builtin::FromBits => "asfloat",
            Builtin::Native(native) => native.name(),
        };
        called(name, args)
    }

    fn construct(&self, ty: &Type, parts: &[Piece]) -> Piece {
        match ty {
            Type::Struct(_) => atom(format!("{{ {} }}", list(parts))),
            // Of rows.
            Type::Matrix(_) => called("transpose", &[called(&self.ty(ty), parts)]),
            _ => called(&self.ty(ty), parts),
        }
    }

    /// `m[i]` is a row.
    fn member(&self, of: &Piece, ty: &Type, name: &str) -> Piece {
        match ty {
            Type::Matrix(_) => atom(format!("transpose({})[{}]", of.0, column(name))),
            _ => atom(format!("{}.{name}", bracketed(of, Bond::Atom))),
        }
    }

    fn element(&self, matrix: &Piece, _: &Type, name: &str, row: &str) -> Piece {
        let (matrix, row) = (bracketed(matrix, Bond::Atom), component(row));
        atom(format!("{matrix}[{row}][{}]", column(name)))
    }

    fn give(&self, ty: &Type, value: &Piece) -> String {
        match ty {
            // A structure is initialised where it is declared.
            Type::Struct(_) if value.0.starts_with('{') => {
                format!("{} given = {};\nreturn given;", self.ty(ty), value.0)
            }
            // `precise` is for variables: what is returned at once is not pinned.
            ty if rounds(ty, value) => {
                format!(
                    "precise {} given = {};\nreturn given;",
                    self.ty(ty),
                    value.0
                )
            }
            _ => format!("return {};", value.0),
        }
    }

    fn head(&self, function: &Function) -> String {
        let params: Vec<String> = function
            .params
            .iter()
            .filter(|p| !matches!(p.ty, Type::Lookup(_)))
            .map(|p| format!("{} {}", self.ty(&p.ty), function.locals[p.id].name))
            .collect();
        format!(
            "{} {}({})\n{{",
            self.ty(&function.result),
            self.0.function(&function.name),
            params.join(", ")
        )
    }

    fn constant_local(&self, name: &str, ty: &Type, value: &Piece) -> String {
        let precise = match ty {
            Type::Scalar(super::ir::Scalar::F32) => "precise ",
            _ => "",
        };
        format!("{precise}{} {name} = {};", self.ty(ty), value.0)
    }

    fn counting(&self, name: &str, ty: &Type, from: &Piece, to: &Piece) -> String {
        format!(
            "for ({} {name} = {}; {name} < {}; {name}++)\n{{",
            self.ty(ty),
            from.0,
            bracketed(to, Bond::Sum)
        )
        .replace(")\n{", ") {")
    }

    fn lookup(&self, function: &Function, id: Id, _: &Signature, args: &[Piece]) -> Piece {
        let name = self.0.function(&function.locals[id].name).to_uppercase();
        called(&name, args)
    }

    fn call(&self, name: &str, args: &[Piece]) -> Piece {
        let args: Vec<Piece> = args.iter().filter(|a| !a.0.is_empty()).cloned().collect();
        called(&self.0.function(name), &args)
    }

    fn passed(&self, _: &Function, _: Id) -> Piece {
        atom("")
    }
}
