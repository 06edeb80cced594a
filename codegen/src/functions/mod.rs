//! Libraries of functions that an engine includes: `hankel build --form functions`.
//!
//! A kernel crate names functions and constants in a `library!`; each becomes a text in every
//! language that one includes and calls. This route does not go through SPIR-V: the functions' Rust
//! sources are translated as they stand, so that a text has the source's names, comments and order,
//! and needs no compiler to be made.
//!
//! ```text
//! sources --source--> modules and items --evaluate--> statements of scalars --tidy--> ir::Library
//!                                                                                        |
//!                                          wgsl, hlsl, glsl, msl, tsl, c, rust, slang <--+
//! ```
//!
//! - [`evaluate`] runs a function as far as it goes without knowing its arguments. Generic parameters,
//!   structures, arrays, closures, `unroll!` and constants are settled; operations on numbers that are
//!   not known are kept in their order. Constants are folded as `f32` computes them, to the bit.
//! - A function with `#[function]` stays a call where another one calls it. Every other one is put in
//!   place.
//! - Loops over what is not known stay loops, as do those of `unroll!` without an index; short ones, and those that
//!   choose elements of an array, are unrolled.
//! - A branch that returns does so in the text, too, where the language can (`ends`).
//! - What has no form is refused with file, line and reason. Nothing is guessed.
//!
//! What proves the texts are tests: each is compiled and run in stubs that include it, and compared
//! with the native function, to the bit.

pub mod api;
pub mod c;
pub mod crates;
mod ends;
pub mod evaluate;
mod expand;
mod fold;
pub mod folder;
pub mod glsl;
pub mod hlsl;
pub mod ir;
mod library;
mod linear;
pub mod msl;
mod names;
pub mod print;
pub mod refusal;
pub mod rust;
pub mod slang;
pub mod source;
mod tidy;
pub mod tsl;
mod value;
pub mod wgsl;

use std::collections::BTreeMap;

pub use library::{read, read_chosen};
pub use refusal::Refusal;

use ir::Library;
use print::Naming;

/// The name of the crate that holds what translated functions call besides each other.
const PRELUDE: &str = "hankel_prelude";

/// A form that libraries are written in.
pub struct Form {
    /// Its name on the command line.
    pub name: &'static str,
    /// Who takes it.
    pub what: &'static str,
    /// The file's name after the library's.
    suffix: &'static str,
    write: Write,
    /// What lies beside it: the end of its name, and its text.
    beside: Option<(&'static str, Write)>,
}

type Write = fn(&Library, &Naming, &str) -> String;

/// All forms. A file is `<prefix>_<library><suffix>` in a folder of the form's name.
pub const FORMS: [Form; 11] = [
    Form {
        name: "wgsl",
        what: "WGSL: put before or after your own text",
        suffix: ".wgsl",
        write: |l, n, s| wgsl::write(l, n, s, wgsl::Form::Plain),
        beside: None,
    },
    Form {
        name: "naga-oil",
        what: "WGSL with #define_import_path: Bevy",
        suffix: ".wgsl",
        write: |l, n, s| wgsl::write(l, n, s, wgsl::Form::NagaOil),
        beside: None,
    },
    Form {
        name: "wesl",
        what: "WESL",
        suffix: ".wesl",
        write: |l, n, s| wgsl::write(l, n, s, wgsl::Form::Wesl),
        beside: None,
    },
    Form {
        name: "hlsl",
        what: "HLSL: Direct3D, Unity, Unreal (.ush)",
        suffix: ".hlsl",
        write: hlsl::write,
        beside: None,
    },
    Form {
        name: "glsl",
        what: "GLSL 3.30 and later, GLSL ES 3.00 and later",
        suffix: ".glsl",
        write: |l, n, s| glsl::write(l, n, s, glsl::Form::Plain),
        beside: None,
    },
    Form {
        name: "godot",
        what: "Godot 4",
        suffix: ".gdshaderinc",
        write: |l, n, s| glsl::write(l, n, s, glsl::Form::Godot),
        beside: None,
    },
    Form {
        name: "msl",
        what: "MSL: Metal",
        suffix: ".h.metal",
        write: msl::write,
        beside: None,
    },
    Form {
        name: "tsl",
        what: "TSL: three.js, as an ES module with types",
        suffix: ".tsl.js",
        write: tsl::write,
        beside: Some((".tsl.d.ts", tsl::write_types)),
    },
    Form {
        name: "slang",
        what: "Slang",
        suffix: ".slang",
        write: slang::write,
        beside: None,
    },
    Form {
        name: "c",
        what: "C99 and C++, for the processor",
        suffix: ".h",
        write: c::write,
        beside: None,
    },
    Form {
        name: "rust",
        what: "Rust, for the processor",
        suffix: ".rs",
        write: rust::write,
        beside: None,
    },
];

impl Form {
    /// The path of a library's file.
    pub fn path(&self, naming: &Naming) -> String {
        self.path_of(naming, self.suffix)
    }

    fn path_of(&self, naming: &Naming, suffix: &str) -> String {
        format!("{}/{}{suffix}", self.name, naming.function(&naming.library))
    }

    /// The text of a library.
    pub fn text(&self, library: &Library, naming: &Naming, sha256: &str) -> String {
        (self.write)(library, naming, sha256)
    }

    /// The path and text of what lies beside it: the types of TSL's module.
    pub fn beside(
        &self,
        library: &Library,
        naming: &Naming,
        sha256: &str,
    ) -> Option<(String, String)> {
        let (suffix, write) = self.beside?;
        Some((self.path_of(naming, suffix), write(library, naming, sha256)))
    }
}

/// All files of libraries, by path.
pub fn files(libraries: &[Library], prefix: &str, sha256: &str) -> BTreeMap<String, String> {
    let mut all = BTreeMap::new();
    for library in libraries {
        let naming = Naming {
            prefix: prefix.into(),
            library: library.name.clone(),
        };
        for form in &FORMS {
            all.insert(form.path(&naming), form.text(library, &naming, sha256));
            all.extend(form.beside(library, &naming, sha256));
        }
    }
    all
}
