//! GLSL 3.30 and later and GLSL ES 3.00 and later in one text, without `#version` and `#extension`, and
//! with `highp` at every float, so that a host's `precision mediump float;` changes nothing; and the
//! same as an include file of Godot 4. Where the version has the word, locals are `precise`.

use super::ir::{Builtin, Function, Id, Library, Literal, Native, Scalar, Signature, Type};
use super::print::{
    Dialect, Naming, Piece, atom, called, choice, components, digits, documented, function,
    members, provenance, rounds, signed,
};
use super::wgsl::looks_up;

/// The form of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// GLSL and GLSL ES.
    Plain,
    /// Godot 4.
    Godot,
}

struct Glsl<'a> {
    naming: &'a Naming,
    form: Form,
}

/// The text of a library.
pub fn write(library: &Library, naming: &Naming, sha256: &str, form: Form) -> String {
    let d = Glsl { naming, form };
    let guard = format!("{}_GLSL", naming.guard());
    let mut text = documented(&provenance(library, sha256), "//");
    text.push_str(&documented(&library.docs, "//"));
    text.push_str(&format!(
        "#ifndef {guard}\n#define {guard}\n#define {}_API {}\n",
        naming.guard(),
        library.api
    ));
    if form == Form::Plain {
        let precise = d.precise();
        text.push_str(&format!(
            "\n#ifdef GL_ES\n#if __VERSION__ >= 320\n#define {precise} precise\n#endif\n\
             #elif __VERSION__ >= 400\n#define {precise} precise\n#endif\n\
             #ifndef {precise}\n#define {precise}\n#endif\n"
        ));
    }
    for c in &library.constants {
        text.push('\n');
        text.push_str(&documented(&c.docs, "///"));
        text.push_str(&format!(
            "const {} {} = {};\n",
            d.ty(&c.ty),
            naming.constant(&c.name),
            components(&d, c).0
        ));
    }
    for s in &library.structs {
        text.push('\n');
        text.push_str(&documented(&s.docs, "///"));
        text.push_str(&format!("struct {} {{\n", naming.structure(&s.name)));
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

/// A function that looks something up is there if the host has defined how, as a macro.
pub fn by_macro(naming: &Naming, function: &Function, body: &str) -> String {
    if !looks_up(function) {
        return body.into();
    }
    let mut body = body.to_owned();
    let mut names: Vec<String> = Vec::new();
    for p in &function.params {
        if matches!(p.ty, Type::Lookup(_)) {
            let local = &function.locals[p.id].name;
            let name = naming.function(local).to_uppercase();
            // What is said of it names the macro.
            body = body.replace(&format!("`{local}`"), &format!("`{name}`"));
            names.push(format!("defined({name})"));
        }
    }
    format!("#if {}\n{body}#endif\n", names.join(" && "))
}

impl Glsl<'_> {
    fn precise(&self) -> String {
        self.naming.function("precise").to_uppercase()
    }

    fn plain(&self, ty: &Type) -> String {
        match ty {
            Type::Scalar(Scalar::F32) => "float".into(),
            Type::Scalar(Scalar::U32) => "uint".into(),
            Type::Scalar(Scalar::I32) => "int".into(),
            Type::Scalar(Scalar::Bool) => "bool".into(),
            Type::Vector(s, n) => {
                let letter = match s {
                    Scalar::F32 => "",
                    Scalar::U32 => "u",
                    Scalar::I32 => "i",
                    Scalar::Bool => "b",
                };
                format!("{letter}vec{n}")
            }
            Type::Matrix(n) => format!("mat{n}"),
            Type::Struct(name) => self.naming.structure(name),
            Type::Lookup(_) => String::new(),
        }
    }
}

impl Dialect for Glsl<'_> {
    fn naming(&self) -> &Naming {
        self.naming
    }

    fn ty(&self, ty: &Type) -> String {
        let plain = self.plain(ty);
        match ty.scalar() {
            Some(Scalar::F32 | Scalar::U32 | Scalar::I32) => format!("highp {plain}"),
            _ => plain,
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
            Builtin::Select => return choice(args),
            Builtin::ToF32 => "float",
            Builtin::ToU32 => "uint",
            Builtin::ToI32 => "int",
            Builtin::BitsOf => "floatBitsToUint",
            Builtin::FromBits => "uintBitsToFloat",
            Builtin::Native(Native::Atan2) => "atan",
            Builtin::Native(native) => native.name(),
        };
        called(name, args)
    }

    fn construct(&self, ty: &Type, parts: &[Piece]) -> Piece {
        called(&self.plain(ty), parts)
    }

    fn head(&self, function: &Function) -> String {
        let params: Vec<String> = function
            .params
            .iter()
            .filter(|p| !matches!(p.ty, Type::Lookup(_)))
            .map(|p| format!("{} {}", self.ty(&p.ty), function.locals[p.id].name))
            .collect();
        format!(
            "{} {}({}) {{",
            self.ty(&function.result),
            self.naming.function(&function.name),
            params.join(", ")
        )
    }

    fn give(&self, ty: &Type, value: &Piece) -> String {
        // `precise` is for variables: what is returned at once is not pinned.
        if self.form == Form::Plain && rounds(ty, value) {
            let (precise, ty) = (self.precise(), self.ty(ty));
            return format!("{precise} {ty} given = {};\nreturn given;", value.0);
        }
        format!("return {};", value.0)
    }

    fn constant_local(&self, name: &str, ty: &Type, value: &Piece) -> String {
        let precise = match (self.form, ty) {
            (Form::Plain, Type::Scalar(Scalar::F32)) => format!("{} ", self.precise()),
            _ => String::new(),
        };
        format!("{precise}{} {name} = {};", self.ty(ty), value.0)
    }

    fn lookup(&self, function: &Function, id: Id, _: &Signature, args: &[Piece]) -> Piece {
        let name = self.naming.function(&function.locals[id].name);
        called(&name.to_uppercase(), args)
    }

    fn call(&self, name: &str, args: &[Piece]) -> Piece {
        let args: Vec<Piece> = args.iter().filter(|a| !a.0.is_empty()).cloned().collect();
        called(&self.naming.function(name), &args)
    }

    fn passed(&self, _: &Function, _: Id) -> Piece {
        atom("")
    }
}
