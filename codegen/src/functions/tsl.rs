//! TSL, the shading language of three.js: an ES module of functions that three.js makes WGSL of for its
//! WebGPU renderer and GLSL ES 3.00 for WebGL 2, with a file of types beside it. Names are as they are in
//! JavaScript: `hamburgerBound`. Neither TSL nor what is made of it has a word against contraction or
//! reordering, so nothing is pinned.
//!
//! A function has a layout, so it is a function in the shader, too, and is written there once. One that
//! looks something up is a function in JavaScript, whose argument is the host's: its nodes stand in the
//! shader where it is called.

use std::collections::HashSet;

use super::ir::{
    Binary, Builtin, Function, Id, Leave, Library, Literal, Native, Scalar, Signature, Type, Unary,
};
use super::names::camel;
use super::print::{
    Dialect, Naming, Piece, WIDTH, atom, block_comment, called, column, components, digits,
    documented, function, list, members, provenance, reflowed, signed, wrapped,
};
use super::wgsl::looks_up;

/// What texts import from `three/tsl`, if they use it.
const IMPORTS: [&str; 44] = [
    "Fn",
    "Break",
    "Continue",
    "If",
    "Loop",
    "abs",
    "acos",
    "asin",
    "atan",
    "bool",
    "bvec2",
    "bvec3",
    "bvec4",
    "cos",
    "exp",
    "exp2",
    "float",
    "floatBitsToUint",
    "floor",
    "int",
    "ivec2",
    "ivec3",
    "ivec4",
    "log",
    "log2",
    "mat2",
    "mat3",
    "mat4",
    "max",
    "min",
    "pow",
    "select",
    "sin",
    "sqrt",
    "struct",
    "tan",
    "uint",
    "uintBitsToFloat",
    "uvec2",
    "uvec3",
    "uvec4",
    "vec2",
    "vec3",
    "vec4",
];

/// Names that JavaScript has, besides those that no language's local has.
const TAKEN: [&str; 7] = [
    "API",
    "Infinity",
    "NaN",
    "arguments",
    "eval",
    "globalThis",
    "undefined",
];

/// The names under which a module gives its functions.
struct Exports<'a> {
    naming: &'a Naming,
    /// By their names in Rust.
    functions: Vec<(String, String)>,
    /// Everything that a local must not hide.
    taken: HashSet<String>,
}

impl<'a> Exports<'a> {
    fn new(library: &Library, naming: &'a Naming) -> Self {
        let mut taken: HashSet<String> = IMPORTS
            .iter()
            .chain(&TAKEN)
            .map(|name| (*name).to_owned())
            .collect();
        taken.extend(library.constants.iter().map(|c| c.name.clone()));
        taken.extend(library.structs.iter().map(|s| s.name.clone()));
        let functions = library
            .functions
            .iter()
            .map(|f| (f.name.clone(), free(&f.name, &mut taken)))
            .collect();
        Self {
            naming,
            functions,
            taken,
        }
    }

    fn function(&self, name: &str) -> String {
        let found = self.functions.iter().find(|(rust, _)| rust == name);
        found.map_or_else(|| camel(name), |(_, own)| own.clone())
    }

    /// The function with JavaScript's names for its locals.
    fn renamed(&self, function: &Function) -> Function {
        let mut taken = self.taken.clone();
        let mut function = function.clone();
        // Parameters first: their names are the signature's.
        let params: Vec<Id> = function.params.iter().map(|p| p.id).collect();
        let others = (0..function.locals.len()).filter(|id| !params.contains(id));
        for id in params.iter().copied().chain(others) {
            let name = &mut function.locals[id].name;
            // Locals that are not there any more have none.
            if !name.is_empty() {
                *name = free(name, &mut taken);
            }
        }
        function
    }
}

/// A name as JavaScript writes it that nothing else has.
fn free(name: &str, taken: &mut HashSet<String>) -> String {
    let mut own = camel(name);
    while super::names::is_taken(&own) || !taken.insert(own.clone()) {
        own.push('_');
    }
    own
}

/// The text of a library: the module.
pub fn write(library: &Library, naming: &Naming, sha256: &str) -> String {
    let exports = Exports::new(library, naming);
    let mut text = format!(
        "\n/** Rises when a signature changes. */\nexport const API = {};\n",
        library.api
    );
    let plain = Tsl {
        exports: &exports,
        in_place: None,
    };
    for c in &library.constants {
        text.push('\n');
        text.push_str(&jsdoc(&c.docs));
        let value = plain.node(&components(&plain, c));
        let line = format!("export const {} = /*@__PURE__*/ {value};", c.name);
        text.push_str(&lines(&line));
    }
    for s in &library.structs {
        text.push('\n');
        text.push_str(&jsdoc(&s.docs));
        text.push_str(&format!(
            "export const {} = /*@__PURE__*/ struct({{\n",
            s.name
        ));
        text.push_str(&members(s, "//", &|name, ty| {
            format!("{name}: '{}',", plain.ty(ty))
        }));
        text.push_str(&format!("}}, '{}');\n", naming.structure(&s.name)));
    }
    for f in &library.functions {
        text.push('\n');
        text.push_str(&jsdoc(&f.docs));
        let d = Tsl {
            exports: &exports,
            in_place: looks_up(f).then(|| naming.function(&f.name)),
        };
        text.push_str(&function(&d, &exports.renamed(f)));
    }
    let mut head = documented(&provenance(library, sha256), "//");
    head.push_str(&documented(&in_javascript(&library.docs), "//"));
    let used: Vec<&str> = IMPORTS
        .into_iter()
        .filter(|name| calls(&text, name))
        .collect();
    if !used.is_empty() {
        let list = lines(&format!("    {}", used.join(", ")));
        head.push_str(&format!("\nimport {{\n{list}}} from 'three/tsl';\n"));
    }
    head + &text
}

/// The types of a library's module.
pub fn write_types(library: &Library, naming: &Naming, sha256: &str) -> String {
    let exports = Exports::new(library, naming);
    let mut text = documented(&provenance(library, sha256), "//");
    text.push_str(
        "\nimport type {\n    Matrix2, Matrix3, Matrix4, Node, Vector2, Vector3, Vector4,\n} from 'three/webgpu';\n\
         import type { struct } from 'three/tsl';\n\n\
         type Float = Node<'float'> | number;\ntype Vec2 = Node<'vec2'> | Vector2;\n\
         type Vec3 = Node<'vec3'> | Vector3;\ntype Vec4 = Node<'vec4'> | Vector4;\n\
         type Mat2 = Node<'mat2'> | Matrix2;\ntype Mat3 = Node<'mat3'> | Matrix3;\n\
         type Mat4 = Node<'mat4'> | Matrix4;\n\n\
         /** Rises when a signature changes. */\n",
    );
    text.push_str(&format!("export const API: {};\n", library.api));
    for c in &library.constants {
        text.push('\n');
        text.push_str(&jsdoc(&c.docs));
        text.push_str(&format!("export const {}: {};\n", c.name, given(&c.ty)));
    }
    for s in &library.structs {
        let mut docs = s.docs.clone();
        docs.extend(
            s.members
                .iter()
                .map(|(name, ty, _)| format!("`get('{name}')` is a `{}`.", type_name(ty))),
        );
        text.push('\n');
        text.push_str(&jsdoc(&docs));
        text.push_str(&format!(
            "export const {}: ReturnType<typeof struct>;\n",
            s.name
        ));
    }
    for f in &library.functions {
        let function = exports.renamed(f);
        let params: Vec<String> = function
            .params
            .iter()
            .map(|p| format!("{}: {}", function.locals[p.id].name, taken(&p.ty)))
            .collect();
        text.push('\n');
        text.push_str(&jsdoc(&f.docs));
        let (own, result) = (exports.function(&f.name), given(&f.result));
        let line = format!("export function {own}({}): {result};\n", params.join(", "));
        text.push_str(&if line.chars().count() > WIDTH {
            format!(
                "export function {own}(\n    {},\n): {result};\n",
                params.join(",\n    ")
            )
        } else {
            line
        });
    }
    text
}

/// A line, broken where it is too long.
fn lines(line: &str) -> String {
    wrapped(line, "    ").join("\n") + "\n"
}

/// Documentation as editors show it.
fn jsdoc(docs: &[String]) -> String {
    let docs = in_javascript(docs);
    match reflowed(&docs).as_slice() {
        [line] if !line.contains("*/") => format!("/** {line} */\n"),
        _ => block_comment(&docs),
    }
}

/// Documentation with names in it as the module has them.
fn in_javascript(docs: &[String]) -> Vec<String> {
    let name = |part: &str| {
        part.starts_with(|c: char| c.is_ascii_lowercase())
            && part
                .chars()
                .all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_')
    };
    docs.iter()
        .map(|line| {
            let parts: Vec<String> = line
                .split('`')
                .enumerate()
                .map(|(i, part)| match i % 2 {
                    1 if name(part) => camel(part),
                    _ => part.to_owned(),
                })
                .collect();
            parts.join("`")
        })
        .collect()
}

/// Whether a text calls a function of this name, and not a method.
fn calls(text: &str, name: &str) -> bool {
    text.match_indices(&format!("{name}(")).any(|(at, _)| {
        let before = text[..at].chars().next_back();
        !before.is_some_and(|c| c.is_ascii_alphanumeric() || matches!(c, '_' | '.'))
    })
}

/// A type's name in TSL; of structures, that in Rust.
fn type_name(ty: &Type) -> String {
    match ty {
        Type::Scalar(s) => super::print::c_like(*s).into(),
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
        Type::Struct(name) => name.clone(),
        Type::Lookup(_) => String::new(),
    }
}

/// What TypeScript calls a result.
fn given(ty: &Type) -> String {
    match ty {
        Type::Struct(_) => "Node".into(),
        _ => format!("Node<'{}'>", type_name(ty)),
    }
}

/// What TypeScript calls an argument.
fn taken(ty: &Type) -> String {
    match ty {
        Type::Scalar(Scalar::F32) => "Float".into(),
        Type::Scalar(Scalar::Bool) => format!("{} | boolean", given(ty)),
        Type::Vector(Scalar::F32, n) => format!("Vec{n}"),
        Type::Matrix(n) => format!("Mat{n}"),
        Type::Lookup(signature) => {
            let params: Vec<String> = signature
                .params
                .iter()
                .enumerate()
                .map(|(i, ty)| {
                    format!(
                        "{}: {}",
                        ["a", "b", "c", "d"].get(i).unwrap_or(&"e"),
                        given(ty)
                    )
                })
                .collect();
            format!("({}) => {}", params.join(", "), given(&signature.result))
        }
        _ => given(ty),
    }
}

struct Tsl<'a> {
    exports: &'a Exports<'a>,
    /// The function whose text this is, if its nodes stand in its caller's text: names in the shader are
    /// three.js' then, for it may stand there twice, and beside the caller's own.
    in_place: Option<String>,
}

impl Tsl<'_> {
    /// What has methods: numbers have none.
    fn node(&self, piece: &Piece) -> String {
        if piece.0.parse::<f32>().is_ok() {
            format!("float({})", piece.0)
        } else {
            piece.0.clone()
        }
    }

    fn method(&self, of: &Piece, name: &str, args: &[Piece]) -> Piece {
        atom(format!("{}.{name}({})", self.node(of), list(args)))
    }

    fn kept(&self, name: &str, value: &Piece, as_what: &str) -> String {
        let named = match self.in_place {
            None => format!("'{name}'"),
            Some(_) => String::new(),
        };
        format!("const {name} = {}.{as_what}({named});", self.node(value))
    }
}

impl Dialect for Tsl<'_> {
    fn naming(&self) -> &Naming {
        self.exports.naming
    }

    fn ty(&self, ty: &Type) -> String {
        match ty {
            Type::Struct(name) => self.naming().structure(name),
            _ => type_name(ty),
        }
    }

    fn literal(&self, literal: Literal) -> Piece {
        match literal {
            // three.js writes JavaScript's -0 as 0.
            Literal::F32(v) if v == 0.0 && v.is_sign_negative() => atom("float(0).negate()"),
            Literal::F32(v) => {
                let text = digits(v);
                signed(text.strip_suffix(".0").unwrap_or(&text).to_owned())
            }
            Literal::U32(v) => atom(format!("uint({v})")),
            Literal::I32(v) => atom(format!("int({v})")),
            Literal::Bool(v) => atom(format!("bool({v})")),
        }
    }

    fn builtin(&self, which: Builtin, args: &[Piece], _: &[&Type]) -> Piece {
        let name = match which {
            Builtin::Min => "min",
            Builtin::Max => "max",
            Builtin::Abs => "abs",
            Builtin::Sqrt => "sqrt",
            Builtin::Floor => "floor",
            Builtin::Select => "select",
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
        called(&type_name(ty), parts)
    }

    fn head(&self, function: &Function) -> String {
        let own = self.exports.function(&function.name);
        let names = |all: &dyn Fn(&Type) -> bool| -> String {
            let names: Vec<&str> = function
                .params
                .iter()
                .filter(|p| all(&p.ty))
                .map(|p| function.locals[p.id].name.as_str())
                .collect();
            names.join(", ")
        };
        let values = names(&|ty| !matches!(ty, Type::Lookup(_)));
        let taken = match values.as_str() {
            "" => String::new(),
            _ => format!("[{values}]"),
        };
        if looks_up(function) {
            let all = names(&|_| true);
            format!("export const {own} = ({all}) => Fn(({taken}) => {{")
        } else {
            format!("export const {own} = /*@__PURE__*/ Fn(({taken}) => {{")
        }
    }

    fn end(&self, function: &Function) -> String {
        let values: Vec<(&str, String)> = function
            .params
            .iter()
            .filter(|p| !matches!(p.ty, Type::Lookup(_)))
            .map(|p| (function.locals[p.id].name.as_str(), self.ty(&p.ty)))
            .collect();
        if looks_up(function) {
            let names: Vec<&str> = values.iter().map(|(name, _)| *name).collect();
            return format!("}})({});", names.join(", "));
        }
        let inputs: Vec<String> = values
            .iter()
            .map(|(name, ty)| format!("{{ name: '{name}', type: '{ty}' }}"))
            .collect();
        format!(
            "}}).setLayout({{\n    name: '{}', type: '{}', inputs: [\n        {},\n    ],\n}});",
            self.naming().function(&function.name),
            self.ty(&function.result),
            inputs.join(",\n        ")
        )
    }

    fn constant_local(&self, name: &str, _: &Type, value: &Piece) -> String {
        self.kept(name, value, "toConst")
    }

    fn variable(&self, name: &str, _: &Type, value: &Piece) -> String {
        self.kept(name, value, "toVar")
    }

    fn assign(&self, name: &str, value: &Piece) -> String {
        format!("{name}.assign({});", value.0)
    }

    fn counting(&self, name: &str, ty: &Type, from: &Piece, to: &Piece) -> String {
        let range = format!("start: {}, end: {}, type: '{}'", from.0, to.0, self.ty(ty));
        match &self.in_place {
            None => {
                format!("Loop({{ {range}, condition: '<', name: '{name}' }}, ({{ {name} }}) => {{")
            }
            // A loop in the host's function would hide the name, so that the host is given a copy.
            Some(function) => format!(
                "Loop({{ {range}, condition: '<', name: '{function}_{name}' }}, (each) => {{\n    \
                 const {name} = each.{function}_{name}.toConst();"
            ),
        }
    }

    /// A function of JavaScript makes the branch, and its `return` would be that function's.
    fn returns_early(&self) -> bool {
        false
    }

    fn leave(&self, what: Leave) -> &'static str {
        match what {
            Leave::Loop => "Break();",
            Leave::Turn => "Continue();",
        }
    }

    fn end_of_loop(&self) -> &'static str {
        "});"
    }

    fn condition(&self, condition: &Piece) -> String {
        format!("If({}, () => {{", condition.0)
    }

    fn otherwise(&self) -> &'static str {
        "}).Else(() => {"
    }

    fn end_of_branch(&self) -> &'static str {
        "});"
    }

    fn give(&self, _: &Type, value: &Piece) -> String {
        format!("return {};", self.node(value))
    }

    fn member(&self, of: &Piece, ty: &Type, name: &str) -> Piece {
        match ty {
            Type::Struct(_) => atom(format!("{}.get('{name}')", of.0)),
            Type::Matrix(_) => atom(format!("{}.element({})", of.0, column(name))),
            _ => atom(format!("{}.{name}", of.0)),
        }
    }

    fn unary(&self, op: Unary, x: &Piece) -> Piece {
        let name = match op {
            Unary::Negate => "negate",
            Unary::Not => "not",
            Unary::Invert => "bitNot",
        };
        self.method(x, name, &[])
    }

    fn binary(&self, op: Binary, a: &Piece, b: &Piece, _: &Type) -> Piece {
        let name = match op {
            Binary::Add => "add",
            Binary::Subtract => "sub",
            Binary::Multiply => "mul",
            Binary::Divide => "div",
            Binary::Less => "lessThan",
            Binary::LessEqual => "lessThanEqual",
            Binary::Greater => "greaterThan",
            Binary::GreaterEqual => "greaterThanEqual",
            Binary::Equal => "equal",
            Binary::NotEqual => "notEqual",
            Binary::And => "and",
            Binary::Or => "or",
            Binary::BitAnd => "bitAnd",
            Binary::BitOr => "bitOr",
            Binary::BitXor => "bitXor",
            Binary::ShiftLeft => "shiftLeft",
            Binary::ShiftRight => "shiftRight",
        };
        self.method(a, name, std::slice::from_ref(b))
    }

    fn call(&self, name: &str, args: &[Piece]) -> Piece {
        called(&self.exports.function(name), args)
    }

    fn lookup(&self, function: &Function, id: Id, _: &Signature, args: &[Piece]) -> Piece {
        called(&function.locals[id].name, args)
    }
}
