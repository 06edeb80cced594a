//! Names: unique within a function, and free in every language, so that they are the same in all.

use std::collections::{BTreeMap, HashSet};

use super::ir::{Function, Id, Kind, Stmt, expressions, walk};

/// Words that some language reserves, or has as a type or function that the texts use. A local of
/// such a name gets `_value` appended.
const TAKEN: &[&str] = &[
    // Types.
    "bool",
    "byte",
    "char",
    "double",
    "f16",
    "f32",
    "f64",
    "float",
    "half",
    "i32",
    "int",
    "long",
    "mat2",
    "mat3",
    "mat4",
    "matrix",
    "short",
    "size_t",
    "str",
    "u32",
    "uint",
    "ulong",
    "unsigned",
    "signed",
    "ushort",
    "vec2",
    "vec3",
    "vec4",
    "vector",
    "void",
    "string",
    "usize",
    "isize",
    "ivec2",
    "ivec3",
    "ivec4",
    "uvec2",
    "uvec3",
    "uvec4",
    "float2",
    "float3",
    "float4",
    "uint2",
    "int2",
    "ptr",
    "atomic",
    "array",
    "fixed",
    "sampler",
    "texture",
    "texture2d",
    "dword",
    "min16float",
    // Words.
    "abstract",
    "active",
    "alias",
    "alignas",
    "alignof",
    "and",
    "and_eq",
    "as",
    "asm",
    "async",
    "attribute",
    "auto",
    "await",
    "become",
    "bitand",
    "bitcast",
    "bitor",
    "box",
    "break",
    "case",
    "cast",
    "catch",
    "cbuffer",
    "centroid",
    "class",
    "coherent",
    "column_major",
    "common",
    "compile",
    "compl",
    "concept",
    "const",
    "const_cast",
    "constant",
    "constexpr",
    "consteval",
    "continue",
    "continuing",
    "crate",
    "debugger",
    "decltype",
    "default",
    "delete",
    "demote",
    "device",
    "diagnostic",
    "discard",
    "do",
    "dyn",
    "else",
    "enable",
    "enum",
    "explicit",
    "export",
    "extends",
    "extern",
    "external",
    "false",
    "filter",
    "final",
    "finally",
    "flat",
    "fn",
    "for",
    "fragment",
    "friend",
    "from",
    "function",
    "get",
    "given",
    "global",
    "goto",
    "groupshared",
    "highp",
    "if",
    "impl",
    "implements",
    "implicit",
    "import",
    "in",
    "in_place",
    "inline",
    "inout",
    "input",
    "instanceof",
    "interface",
    "invariant",
    "kernel",
    "layout",
    "let",
    "line",
    "lineadj",
    "linear",
    "loop",
    "lowp",
    "macro",
    "match",
    "mediump",
    "meta",
    "mod",
    "module",
    "move",
    "mut",
    "mutable",
    "namespace",
    "native",
    "new",
    "nil",
    "noexcept",
    "noinline",
    "nointerpolation",
    "noperspective",
    "not",
    "not_eq",
    "null",
    "nullptr",
    "of",
    "operator",
    "or",
    "or_eq",
    "out",
    "output",
    "override",
    "package",
    "packed",
    "partition",
    "pass",
    "patch",
    "pixelfragment",
    "point",
    "pragma",
    "precise",
    "precision",
    "premerge",
    "priv",
    "private",
    "protected",
    "pub",
    "public",
    "quat",
    "readonly",
    "ref",
    "register",
    "regardless",
    "reinterpret_cast",
    "require",
    "requires",
    "resource",
    "restrict",
    "return",
    "row_major",
    "sample",
    "self",
    "set",
    "shared",
    "sizeof",
    "smooth",
    "snorm",
    "stateblock",
    "static",
    "static_assert",
    "static_cast",
    "struct",
    "subroutine",
    "super",
    "superp",
    "switch",
    "target",
    "technique",
    "template",
    "this",
    "thread",
    "thread_local",
    "threadgroup",
    "throw",
    "trait",
    "triangle",
    "true",
    "try",
    "type",
    "typedef",
    "typeid",
    "typename",
    "typeof",
    "uniform",
    "union",
    "unless",
    "unorm",
    "unroll",
    "unsafe",
    "unsized",
    "use",
    "using",
    "var",
    "varying",
    "vertex",
    "vertexfragment",
    "vertexshader",
    "virtual",
    "volatile",
    "wgsl",
    "where",
    "while",
    "with",
    "workgroup",
    "writeonly",
    "xor",
    "xor_eq",
    "yield",
    "extension",
    "property",
    "associatedtype",
    "init",
    "subscript",
    "param",
    "is",
    "each",
    "expand",
    "differentiable",
    // Functions.
    "abs",
    "acos",
    "all",
    "any",
    "asfloat",
    "asin",
    "asuint",
    "atan",
    "ceil",
    "clamp",
    "cos",
    "cosh",
    "cross",
    "ddx",
    "ddy",
    "degrees",
    "determinant",
    "distance",
    "dot",
    "exp",
    "exp2",
    "fabs",
    "floor",
    "fma",
    "fmax",
    "fmin",
    "fmod",
    "fract",
    "frac",
    "frexp",
    "fwidth",
    "inverse",
    "isinf",
    "isnan",
    "ldexp",
    "length",
    "lerp",
    "log",
    "log2",
    "mad",
    "max",
    "min",
    "mix",
    "modf",
    "mul",
    "normalize",
    "pow",
    "radians",
    "rcp",
    "reflect",
    "refract",
    "round",
    "rsqrt",
    "saturate",
    "select",
    "sign",
    "sin",
    "sinh",
    "smoothstep",
    "sqrt",
    "step",
    "tan",
    "tanh",
    "transpose",
    "trunc",
    "metal",
    "main",
    "near",
    "far",
    "asm_fragment",
    "co_await",
    "co_return",
    "co_yield",
    "constinit",
    "demote_to_helper",
    "dynamic_cast",
    "fallthrough",
    "fxgroup",
    "macro_rules",
    "non_coherent",
    "noncoherent",
    "packoffset",
    "std",
    "compile_fragment",
    "frag",
];

/// Whether a name is taken by some language.
pub fn is_taken(name: &str) -> bool {
    TAKEN.contains(&name)
}

/// Gives every local a name of its own, which is no function's that is called: in MSL and Rust it would hide that. Names of those that change do not end in a digit: naga_oil
/// refuses such variables.
pub fn make_unique(function: &mut Function) {
    let mut taken: HashSet<String> = HashSet::new();
    let mut called: HashSet<String> = HashSet::new();
    let mut renamed: BTreeMap<String, String> = BTreeMap::new();
    expressions(&function.body, &mut |e| {
        walk(e, &mut |x| {
            if let Kind::Call(name, _) = &x.kind {
                called.insert(name.clone());
            }
        });
    });
    let mut order: Vec<(Id, bool)> = function.params.iter().map(|p| (p.id, false)).collect();
    in_order(&function.body, &mut order);
    for (id, changes) in order {
        let mut base = function.locals[id].name.clone();
        if is_taken(&base) || called.contains(&base) {
            let old = (!called.contains(&base)).then(|| format!("`{base}`"));
            base.push_str("_value");
            // Otherwise the function is meant.
            renamed.extend(old.map(|old| (old, format!("`{base}`"))));
        }
        let fits = |name: &str| !changes || !name.ends_with(|c: char| c.is_ascii_digit());
        let mut name = base.clone();
        let mut n = 2;
        while !fits(&name) || !taken.insert(name.clone()) {
            name = if changes {
                format!("{base}_{}", letters(n))
            } else {
                format!("{base}_{n}")
            };
            n += 1;
        }
        function.locals[id].name = name;
    }
    // What is said of them has their new names, too.
    let rename = |text: &mut String| {
        for (old, new) in &renamed {
            if text.contains(old) {
                *text = text.replace(old, new);
            }
        }
    };
    function.docs.iter_mut().for_each(rename);
    comments(&mut function.body, &rename);
}

/// Calls `with` for every comment.
fn comments(body: &mut [Stmt], with: &dyn Fn(&mut String)) {
    for stmt in body {
        match stmt {
            Stmt::Comment(text) => with(text),
            Stmt::If(_, a, b) => {
                comments(a, with);
                comments(b, with);
            }
            Stmt::For(_, _, _, body) => comments(body, with),
            Stmt::Let(..) | Stmt::Var(..) | Stmt::Assign(..) | Stmt::Leave(_) | Stmt::Return(_) => {
            }
        }
    }
}

/// 2 as `b`, 27 as `aa`.
fn letters(n: usize) -> String {
    let mut rest = n;
    let mut out = String::new();
    while rest > 0 {
        rest -= 1;
        out.insert(0, char::from(b'a' + (rest % 26) as u8));
        rest /= 26;
    }
    out
}

fn in_order(body: &[Stmt], order: &mut Vec<(Id, bool)>) {
    for stmt in body {
        match stmt {
            Stmt::Let(id, _) => order.push((*id, false)),
            Stmt::Var(id, _) => order.push((*id, true)),
            Stmt::If(_, a, b) => {
                in_order(a, order);
                in_order(b, order);
            }
            Stmt::For(id, _, _, inner) => {
                order.push((*id, true));
                in_order(inner, order);
            }
            _ => {}
        }
    }
}

/// `snake_case` as `camelCase`.
pub fn camel(name: &str) -> String {
    let mut out = String::new();
    let mut up = false;
    for c in name.chars() {
        if c == '_' {
            up = !out.is_empty();
        } else if up {
            out.extend(c.to_uppercase());
            up = false;
        } else {
            out.push(c);
        }
    }
    out
}

/// `snake_case` as `PascalCase`.
pub fn pascal(name: &str) -> String {
    let camel = camel(name);
    let mut chars = camel.chars();
    match chars.next() {
        Some(first) => first.to_uppercase().chain(chars).collect(),
        None => camel,
    }
}
