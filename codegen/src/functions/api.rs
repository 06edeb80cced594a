//! What a library's users rely on: its signatures, and the number that rises when they change.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::ir::{Function, Library, Scalar, Type};

/// The file that says what a folder of libraries holds.
pub const FILE: &str = "functions.json";

/// What a folder of libraries holds.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Record {
    /// What wrote it.
    pub hankel: String,
    /// What names begin with.
    pub prefix: String,
    /// The functions that it was built with, by name or pattern; none: all.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub functions: Vec<String>,
    /// The libraries, by name.
    pub libraries: BTreeMap<String, LibraryRecord>,
    /// SHA-256 of each file, by path.
    pub files: BTreeMap<String, String>,
}

/// What the users of a library rely on.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LibraryRecord {
    /// Rises when a signature changes.
    pub api: u32,
    /// Signatures, by function; also those of structures and constants.
    pub signatures: BTreeMap<String, String>,
}

impl LibraryRecord {
    /// Of a library.
    #[must_use]
    pub fn of(library: &Library) -> Self {
        let functions = library
            .functions
            .iter()
            .map(|f| (f.name.clone(), signature(f)));
        let structs = library.structs.iter().map(|s| {
            let members: Vec<String> = s
                .members
                .iter()
                .map(|(name, ty, _)| format!("{name}: {}", shown(ty)))
                .collect();
            (
                s.name.clone(),
                format!("struct {{ {} }}", members.join(", ")),
            )
        });
        // A constant's value may be measured anew; its type is what texts rely on.
        let constants = library
            .constants
            .iter()
            .map(|c| (c.name.clone(), format!("const {}", shown(&c.ty))));
        Self {
            api: library.api,
            signatures: functions.chain(structs).chain(constants).collect(),
        }
    }

    /// What keeps users of `before` from taking this one: its changed and missing signatures. What is
    /// new breaks nothing.
    #[must_use]
    pub fn breaks(&self, before: &Self) -> Vec<String> {
        before
            .signatures
            .iter()
            .filter_map(|(name, old)| match self.signatures.get(name) {
                None => Some(format!("`{name}` is gone")),
                Some(new) if new != old => Some(format!("`{name}` was {old} and is {new}")),
                Some(_) => None,
            })
            .collect()
    }
}

/// `(moments: vec4<f32>, depth: f32) -> f32`
fn signature(function: &Function) -> String {
    let params: Vec<String> = function
        .params
        .iter()
        .map(|p| format!("{}: {}", function.locals[p.id].name, shown(&p.ty)))
        .collect();
    format!("({}) -> {}", params.join(", "), shown(&function.result))
}

fn shown(ty: &Type) -> String {
    let scalar = |s: &Scalar| match s {
        Scalar::F32 => "f32",
        Scalar::U32 => "u32",
        Scalar::I32 => "i32",
        Scalar::Bool => "bool",
    };
    match ty {
        Type::Scalar(s) => scalar(s).into(),
        Type::Vector(s, n) => format!("vec{n}<{}>", scalar(s)),
        Type::Matrix(n) => format!("mat{n}"),
        Type::Struct(name) => name.clone(),
        Type::Lookup(signature) => {
            let params: Vec<String> = signature.params.iter().map(shown).collect();
            format!("fn({}) -> {}", params.join(", "), shown(&signature.result))
        }
    }
}
