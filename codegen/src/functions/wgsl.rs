//! WGSL: as it stands, as a module of naga_oil (`#define_import_path`), as Bevy composes shaders, and
//! as a module of WESL. WGSL has no word against contraction or reordering, so nothing is pinned.
//!
//! There are neither functions as values nor macros, so a function that looks something up is left out.

use super::ir::{Builtin, Function, Library, Literal, Scalar, Type};
use super::print::{
    Bond, Dialect, Naming, Piece, atom, bracketed, called, components, digits, documented,
    function, members, provenance, signed,
};

/// The form of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// A text that is put before or after others.
    Plain,
    /// A module of naga_oil.
    NagaOil,
    /// A module of WESL.
    Wesl,
}

struct Wgsl<'a>(&'a Naming);

/// The text of a library.
pub fn write(library: &Library, naming: &Naming, sha256: &str, form: Form) -> String {
    let d = Wgsl(naming);
    let mut text = String::new();
    if form == Form::NagaOil {
        text.push_str(&format!(
            "#define_import_path {}::{}\n",
            naming.prefix, naming.library
        ));
    }
    text.push_str(&documented(&provenance(library, sha256), "//"));
    text.push_str(&documented(&library.docs, "//"));
    text.push_str(&format!(
        "\nconst {}_API: u32 = {}u;\n",
        naming.guard(),
        library.api
    ));
    for c in &library.constants {
        text.push('\n');
        text.push_str(&documented(&c.docs, "///"));
        text.push_str(&format!(
            "const {}: {} = {};\n",
            naming.constant(&c.name),
            d.ty(&c.ty),
            components(&d, c).0
        ));
    }
    for s in &library.structs {
        text.push('\n');
        text.push_str(&documented(&s.docs, "///"));
        text.push_str(&format!("struct {} {{\n", naming.structure(&s.name)));
        text.push_str(&members(s, "///", &|name, ty| {
            format!("{name}: {},", d.ty(ty))
        }));
        text.push_str("}\n");
    }
    for f in library.functions.iter().filter(|f| !looks_up(f)) {
        text.push('\n');
        text.push_str(&documented(&f.docs, "///"));
        text.push_str(&function(&d, f));
    }
    text
}

impl Dialect for Wgsl<'_> {
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
            Type::Vector(s, n) => format!("vec{n}<{}>", scalar(s)),
            Type::Matrix(n) => format!("mat{n}x{n}<f32>"),
            Type::Struct(name) => self.0.structure(name),
            Type::Lookup(_) => String::new(),
        }
    }

    fn literal(&self, literal: Literal) -> Piece {
        match literal {
            Literal::F32(v) => signed(digits(v)),
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
            Builtin::Select => {
                let turned = [args[2].clone(), args[1].clone(), args[0].clone()];
                return called("select", &turned);
            }
            Builtin::ToF32 => "f32",
            Builtin::ToU32 => "u32",
            Builtin::ToI32 => "i32",
            Builtin::BitsOf => "bitcast<u32>",
            Builtin::FromBits => "bitcast<f32>",
            Builtin::Native(native) => native.name(),
        };
        called(name, args)
    }

    fn construct(&self, ty: &Type, parts: &[Piece]) -> Piece {
        called(&self.ty(ty), parts)
    }

    fn head(&self, function: &Function) -> String {
        let params: Vec<String> = function
            .params
            .iter()
            .map(|p| format!("{}: {}", function.locals[p.id].name, self.ty(&p.ty)))
            .collect();
        format!(
            "fn {}({}) -> {} {{",
            self.0.function(&function.name),
            params.join(", "),
            self.ty(&function.result)
        )
    }

    fn constant_local(&self, name: &str, _: &Type, value: &Piece) -> String {
        format!("let {name} = {};", value.0)
    }

    fn variable(&self, name: &str, ty: &Type, value: &Piece) -> String {
        format!("var {name}: {} = {};", self.ty(ty), value.0)
    }

    fn counting(&self, name: &str, ty: &Type, from: &Piece, to: &Piece) -> String {
        format!(
            "for (var {name}: {} = {}; {name} < {}; {name}++) {{",
            self.ty(ty),
            from.0,
            bracketed(to, Bond::Sum)
        )
    }
}

/// Whether a function needs something of the host.
pub fn looks_up(function: &Function) -> bool {
    function
        .params
        .iter()
        .any(|p| matches!(p.ty, Type::Lookup(_)))
}
