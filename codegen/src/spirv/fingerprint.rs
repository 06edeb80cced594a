//! What an entry point is made of, as a hash: of the functions that it reaches, their types, constants, names and
//! decorations, in a module that is not linked yet. Ids do not count, nor does what else the module has. Lines of the
//! source would count, so they have to be gone: `unlinked.rs`.

use std::collections::{BTreeMap, HashMap, HashSet};

use rspirv::binary::Assemble;
use rspirv::dr::{Function, Instruction, Module, Operand};
use rspirv::spirv::{Decoration, Word};
use sha2::{Digest, Sha256};

use super::id;

/// A SHA-256.
pub type Hash = [u8; 32];

/// What is known of an entry point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fingerprint {
    /// The hash of what it reaches.
    pub hash: Hash,
    /// Instructions once every call is inlined: what linking it takes grows with that.
    pub size: u64,
}

/// The fingerprint of each entry point, by its name.
pub fn entry_points(module: &Module) -> BTreeMap<String, Fingerprint> {
    let mut all = Fingerprints::of(module);
    module
        .entry_points
        .iter()
        .filter_map(|entry| {
            let Some(Operand::LiteralString(name)) = entry.operands.get(2) else {
                return None;
            };
            let mut part = Part::default();
            let of_module = module.capabilities.iter().chain(&module.extensions);
            let modes = module.execution_modes.iter();
            let modes = modes.filter(|mode| id(mode, 0) == id(entry, 1));
            for it in of_module
                .chain(&module.memory_model)
                .chain([entry])
                .chain(modes)
            {
                all.instruction(it, &mut part);
            }
            Some((name.clone(), part.finish()))
        })
        .collect()
}

/// The hash of a module that others are linked with: of all of its functions, and of what else it exports, in the order
/// of the file.
pub fn library(module: &Module) -> Hash {
    let mut all = Fingerprints::of(module);
    let mut hasher = Sha256::new();
    for function in &module.functions {
        hasher.update(all.of_id(function.def_id().unwrap_or_default()).hash);
    }
    let exported = module.annotations.iter().filter(|it| {
        it.operands.get(1) == Some(&Operand::Decoration(Decoration::LinkageAttributes))
    });
    let exported: HashSet<Word> = exported.filter_map(|it| id(it, 0)).collect();
    let globals = module.types_global_values.iter();
    for global in globals.filter_map(|it| it.result_id) {
        if exported.contains(&global) {
            hasher.update(all.of_id(global).hash);
        }
    }
    hasher.finalize().into()
}

/// Hashes of a module's functions and of what is declared outside of them, by their ids.
struct Fingerprints<'a> {
    globals: HashMap<Word, &'a Instruction>,
    functions: HashMap<Word, &'a Function>,
    /// Names and decorations.
    notes: HashMap<Word, Vec<&'a Instruction>>,
    known: HashMap<Word, Fingerprint>,
}

/// Stack for functions that call each other, and what has to be left of it.
const STACK: usize = 16 << 20;
const RED_ZONE: usize = 256 << 10;

impl<'a> Fingerprints<'a> {
    fn of(module: &'a Module) -> Self {
        let globals = module.ext_inst_imports.iter();
        let globals = globals
            .chain(&module.debug_string_source)
            .chain(&module.types_global_values);
        let functions = module.functions.iter();
        let mut notes: HashMap<Word, Vec<&Instruction>> = HashMap::new();
        for note in module.debug_names.iter().chain(&module.annotations) {
            if let Some(target) = id(note, 0) {
                notes.entry(target).or_default().push(note);
            }
        }
        Self {
            globals: globals.filter_map(|it| Some((it.result_id?, it))).collect(),
            functions: functions
                .filter_map(|it| Some((it.def_id()?, it)))
                .collect(),
            notes,
            known: HashMap::new(),
        }
    }

    /// Of a function, or of what is declared outside of functions.
    fn of_id(&mut self, id: Word) -> Fingerprint {
        if let Some(known) = self.known.get(&id) {
            return *known;
        }
        // What refers to itself by way of others meets this; the linker refuses it.
        let unfinished = Fingerprint {
            hash: [0; 32],
            size: 0,
        };
        self.known.insert(id, unfinished);
        let mut part = Part::of(id);
        self.notes(id, &mut part);
        let all: Vec<&Instruction> = match (self.functions.get(&id), self.globals.get(&id)) {
            (Some(function), _) => function.all_inst_iter().collect(),
            (None, Some(global)) => vec![global],
            (None, None) => Vec::new(),
        };
        // Calls may be as deep as an author likes.
        stacker::maybe_grow(RED_ZONE, STACK, || {
            for it in all {
                self.instruction(it, &mut part);
            }
        });
        let made = part.finish();
        self.known.insert(id, made);
        made
    }

    /// Adds an instruction, with all that it refers to.
    fn instruction(&mut self, it: &Instruction, part: &mut Part) {
        part.size = part.size.saturating_add(1);
        part.words(&[u32::from(it.class.opcode as u16), it.operands.len() as u32]);
        for id in it.result_type.into_iter().chain(it.result_id) {
            self.reference(id, part);
        }
        for operand in &it.operands {
            match operand.id_ref_any() {
                Some(id) => self.reference(id, part),
                None => {
                    let mut words = Vec::new();
                    operand.assemble_into(&mut words);
                    part.words(&[words.len() as u32]);
                    part.words(&words);
                }
            }
        }
    }

    /// Adds an id: by its place in this part, or by what it stands for.
    fn reference(&mut self, id: Word, part: &mut Part) {
        let next = part.places.len() as u32;
        if let Some(place) = part.places.get(&id) {
            part.words(&[1, *place]);
        } else if self.globals.contains_key(&id) || self.functions.contains_key(&id) {
            let other = self.of_id(id);
            part.words(&[2]);
            part.hasher.update(other.hash);
            part.size = part.size.saturating_add(other.size);
        } else {
            part.places.insert(id, next);
            part.words(&[1, next]);
            self.notes(id, part);
        }
    }

    /// Adds the names and decorations of an id.
    fn notes(&mut self, id: Word, part: &mut Part) {
        for note in self.notes.get(&id).cloned().unwrap_or_default() {
            self.instruction(note, part);
        }
    }
}

/// A function, or what is declared outside of functions, while it is read.
#[derive(Default)]
struct Part {
    hasher: Sha256,
    /// Ids that mean something here alone, by the order in which they come.
    places: HashMap<Word, u32>,
    size: u64,
}

impl Part {
    /// What makes this id.
    fn of(id: Word) -> Self {
        Self {
            places: HashMap::from([(id, 0)]),
            ..Self::default()
        }
    }

    fn words(&mut self, words: &[u32]) {
        for word in words {
            self.hasher.update(word.to_le_bytes());
        }
    }

    fn finish(self) -> Fingerprint {
        Fingerprint {
            hash: self.hasher.finalize().into(),
            size: self.size,
        }
    }
}

#[cfg(test)]
mod tests {
    use rspirv::spirv::Op;

    use super::*;
    use crate::spirv::op;
    use crate::spirv::tests::of_wgsl;

    const SCALED: &str = "
        @group(0) @binding(0) var<storage, read_write> numbers: array<f32>;
        fn twice(x: f32) -> f32 { return x * 2.0; }
        fn scaled(x: f32) -> f32 { var product = twice(x) * 3.0; return product; }
        @compute @workgroup_size(64)
        fn scale(@builtin(global_invocation_id) id: vec3<u32>) {
            numbers[id.x] = scaled(numbers[id.x]);
        }";

    const OTHER: &str = "
        @group(0) @binding(1) var<storage, read_write> counts: array<u32>;
        @compute @workgroup_size(64)
        fn count(@builtin(global_invocation_id) id: vec3<u32>) { counts[id.x] += 7u; }";

    fn scale(text: &str) -> Fingerprint {
        entry_points(&of_wgsl(text))["scale"]
    }

    #[test]
    fn other_entry_points_do_not_count() {
        let alone = scale(SCALED);
        for text in [format!("{OTHER}{SCALED}"), format!("{SCALED}{OTHER}")] {
            assert_eq!(scale(&text), alone);
        }
    }

    #[test]
    fn all_that_is_reached_counts() {
        let before = scale(SCALED);
        for (old, new) in [
            ("* 2.0", "* 2.5"),
            ("x * 2.0", "x + 2.0"),
            ("product", "result"),
            ("size(64)", "size(32)"),
            ("binding(0)", "binding(1)"),
            ("array<f32>", "array<f32, 8>"),
            ("twice(x) * 3.0", "twice(3.0) * x"),
        ] {
            let text = SCALED.replace(old, new);
            assert_ne!(text, SCALED);
            assert_ne!(scale(&text).hash, before.hash, "{new}");
        }
    }

    #[test]
    fn sizes_are_those_after_inlining() {
        let once = scale(SCALED).size;
        let often = scale(&SCALED.replace("twice(x) *", "twice(twice(twice(x))) *")).size;
        assert!(often > once + 8, "{once}, {often}");
    }

    #[test]
    fn libraries_are_all_of_their_functions() {
        let of = |text: &str| library(&of_wgsl(text));
        assert_eq!(of(SCALED), of(SCALED));
        assert_ne!(of(SCALED), of(&SCALED.replace("3.0", "4.0")));
        // What is exported and none of its functions uses.
        let with = |value: u32, is_exported: bool| {
            let mut module = of_wgsl(SCALED);
            let next = module.header.as_ref().map_or(0, |header| header.bound);
            let float = module
                .types_global_values
                .iter()
                .find(|it| op(it) == Op::TypeFloat)
                .and_then(|it| it.result_id);
            module.types_global_values.push(Instruction::new(
                Op::Constant,
                float,
                Some(next),
                vec![Operand::LiteralBit32(value)],
            ));
            if is_exported {
                let name = Operand::LiteralString("TABLE".into());
                let operands = vec![
                    Operand::IdRef(next),
                    Operand::Decoration(Decoration::LinkageAttributes),
                    name,
                    Operand::LinkageType(rspirv::spirv::LinkageType::Export),
                ];
                let note = Instruction::new(Op::Decorate, None, None, operands);
                module.annotations.push(note);
            }
            library(&module)
        };
        assert_ne!(with(1, true), with(2, true));
        assert_eq!(with(1, false), with(2, false));
    }
}
