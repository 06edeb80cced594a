//! One module for each entry point of a module that has several.
//!
//! rust-gpu can do this itself (`--module-output=multiple`), by a copy of the whole module for each entry point
//! of which it then removes what that one does not reach: with 180 entry points that is half of a build's time,
//! and 9 GB of memory instead of 2.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use rspirv::dr::{Instruction, Module, Operand};
use rspirv::spirv::Word;

use super::id;

/// The module of each entry point, by its name: what the entry point reaches, in the order in which it was.
/// Capabilities and extensions are the whole module's.
pub fn entry_points(module: &Module) -> BTreeMap<String, Module> {
    let declared = Declared::of(module);
    module
        .entry_points
        .iter()
        .filter_map(|entry| match entry.operands.get(2) {
            Some(Operand::LiteralString(name)) => {
                Some((name.clone(), declared.reached_from(&[entry])))
            }
            _ => None,
        })
        .collect()
}

/// The part of a module that entry points with these names reach.
pub fn part(module: &Module, names: &BTreeSet<&str>) -> Module {
    let is_wanted = |entry: &&Instruction| match entry.operands.get(2) {
        Some(Operand::LiteralString(name)) => names.contains(name.as_str()),
        _ => false,
    };
    let entries: Vec<&Instruction> = module.entry_points.iter().filter(is_wanted).collect();
    Declared::of(module).reached_from(&entries)
}

/// What a module declares, by its ids.
struct Declared<'a> {
    module: &'a Module,
    /// The places of what makes an id outside of functions: in `ext_inst_imports`, `debug_string_source` and
    /// `types_global_values`, as if they were one list.
    globals: HashMap<Word, usize>,
    functions: HashMap<Word, usize>,
    /// The places in `annotations` of those that decorate an id.
    annotations: HashMap<Word, Vec<usize>>,
    /// The places in `debug_names` of those that name an id.
    names: HashMap<Word, Vec<usize>>,
}

/// The places of what is kept, for each list.
#[derive(Default)]
struct Reached {
    globals: Vec<bool>,
    functions: Vec<bool>,
    annotations: Vec<usize>,
    names: Vec<usize>,
}

impl<'a> Declared<'a> {
    fn of(module: &'a Module) -> Self {
        let by_target = |all: &[Instruction]| {
            let mut places: HashMap<Word, Vec<usize>> = HashMap::new();
            for (place, it) in all.iter().enumerate() {
                if let Some(target) = id(it, 0) {
                    places.entry(target).or_default().push(place);
                }
            }
            places
        };
        let functions = module.functions.iter().enumerate();
        Self {
            module,
            globals: globals(module)
                .enumerate()
                .filter_map(|(place, it)| Some((it.result_id?, place)))
                .collect(),
            functions: functions
                .filter_map(|(place, it)| Some((it.def_id()?, place)))
                .collect(),
            annotations: by_target(&module.annotations),
            names: by_target(&module.debug_names),
        }
    }

    fn reached_from(&self, entries: &[&Instruction]) -> Module {
        let reached = self.reach(entries);
        let kept = |all: &[Instruction], mut places: Vec<usize>| {
            places.sort_unstable();
            places.dedup();
            places
                .into_iter()
                .map(|place| all[place].clone())
                .collect::<Vec<_>>()
        };
        let module = self.module;
        let is_used = |id: Word| {
            let place = self.globals.get(&id);
            place.is_some_and(|place| reached.globals[*place])
        };
        let live = |all: &[Instruction]| -> Vec<Instruction> {
            all.iter()
                .filter(|it| it.result_id.map_or_else(|| ids(it).any(is_used), is_used))
                .cloned()
                .collect()
        };
        let functions: Vec<_> = entries.iter().map(|entry| id(entry, 1)).collect();
        Module {
            header: module.header.clone(),
            capabilities: module.capabilities.clone(),
            extensions: module.extensions.clone(),
            ext_inst_imports: live(&module.ext_inst_imports),
            memory_model: module.memory_model.clone(),
            entry_points: entries.iter().copied().cloned().collect(),
            execution_modes: module
                .execution_modes
                .iter()
                .filter(|mode| functions.contains(&id(mode, 0)))
                .cloned()
                .collect(),
            debug_string_source: live(&module.debug_string_source),
            debug_names: kept(&module.debug_names, reached.names),
            debug_module_processed: module.debug_module_processed.clone(),
            annotations: kept(&module.annotations, reached.annotations),
            types_global_values: live(&module.types_global_values),
            functions: module
                .functions
                .iter()
                .zip(&reached.functions)
                .filter(|(_, used)| **used)
                .map(|(it, _)| it.clone())
                .collect(),
        }
    }

    fn reach(&self, entries: &[&Instruction]) -> Reached {
        let mut reached = Reached {
            globals: vec![false; globals(self.module).count()],
            functions: vec![false; self.module.functions.len()],
            ..Reached::default()
        };
        let all: Vec<&Instruction> = globals(self.module).collect();
        let mut next: Vec<Word> = entries.iter().copied().flat_map(ids).collect();
        // What is made in a function has names and annotations, too.
        let note = |reached: &mut Reached, id: Word, next: &mut Vec<Word>| {
            reached
                .names
                .extend(self.names.get(&id).into_iter().flatten());
            let annotations = self.annotations.get(&id).into_iter().flatten();
            for place in annotations {
                reached.annotations.push(*place);
                next.extend(ids(&self.module.annotations[*place]));
            }
        };
        while let Some(id) = next.pop() {
            if let Some(place) = self.globals.get(&id) {
                if !std::mem::replace(&mut reached.globals[*place], true) {
                    next.extend(ids(all[*place]));
                    note(&mut reached, id, &mut next);
                }
            } else if let Some(place) = self.functions.get(&id)
                && !std::mem::replace(&mut reached.functions[*place], true)
            {
                for it in self.module.functions[*place].all_inst_iter() {
                    next.extend(ids(it));
                    if let Some(id) = it.result_id {
                        note(&mut reached, id, &mut next);
                    }
                }
            }
        }
        reached
    }
}

/// What makes ids outside of functions, in the order of [`Declared::globals`].
fn globals(module: &Module) -> impl Iterator<Item = &Instruction> {
    module
        .ext_inst_imports
        .iter()
        .chain(&module.debug_string_source)
        .chain(&module.types_global_values)
}

/// The ids that an instruction uses.
fn ids(instruction: &Instruction) -> impl Iterator<Item = Word> {
    let operands = instruction.operands.iter().filter_map(Operand::id_ref_any);
    instruction.result_type.into_iter().chain(operands)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::finish::validate;
    use crate::spirv::tests::of_wgsl as module;
    use crate::spirv::{canonical, store};

    const DECLARED: &str = "
        @group(0) @binding(0) var<uniform> scale: vec4<f32>;
        @group(0) @binding(1) var<storage, read_write> numbers: array<vec4<f32>>;
        @group(0) @binding(2) var<storage, read_write> counts: array<u32>;
        var<workgroup> kept: vec4<f32>;
        fn scaled(x: vec4<f32>) -> vec4<f32> { return x * scale; }";

    const SCALE: &str = "
        @compute @workgroup_size(64)
        fn scale_all(@builtin(global_invocation_id) id: vec3<u32>) {
            numbers[id.x] = scaled(numbers[id.x]);
        }";

    const COUNT: &str = "
        @compute @workgroup_size(32)
        fn count_all(@builtin(global_invocation_id) id: vec3<u32>) {
            kept = scaled(numbers[id.x]);
            workgroupBarrier();
            counts[id.x] += u32(kept.x);
        }";

    #[test]
    fn an_entry_point_keeps_what_it_reaches() {
        let both = module(&format!("{DECLARED}{SCALE}{COUNT}"));
        let divided = entry_points(&both);
        let names: Vec<&str> = divided.keys().map(String::as_str).collect();
        assert_eq!(names, ["count_all", "scale_all"]);
        for (name, module) in &divided {
            validate(&store(module), name).unwrap();
            assert_eq!(module.entry_points.len(), 1);
            assert_eq!(module.execution_modes.len(), 1);
            assert_eq!(module.functions.len(), 2, "its own and `scaled`");
        }
        let has = |entry: &str, variable: &str| {
            divided[entry].debug_names.iter().any(
                |it| matches!(it.operands.get(1), Some(Operand::LiteralString(name)) if name == variable),
            )
        };
        for variable in ["scale", "numbers", "scaled"] {
            assert!(has("scale_all", variable) && has("count_all", variable));
        }
        for variable in ["counts", "kept"] {
            assert!(!has("scale_all", variable) && has("count_all", variable));
        }
    }

    #[test]
    fn a_part_has_the_entry_points_that_are_asked_for() {
        let both = module(&format!("{DECLARED}{SCALE}{COUNT}"));
        for (names, functions) in [
            (vec!["scale_all", "count_all"], 3),
            (vec!["count_all"], 2),
            (Vec::new(), 0),
        ] {
            let part = part(&both, &names.iter().copied().collect());
            assert_eq!(part.entry_points.len(), names.len());
            assert_eq!(part.functions.len(), functions);
        }
    }

    #[test]
    fn one_entry_point_of_two_is_the_one_alone() {
        let both = module(&format!("{DECLARED}{SCALE}{COUNT}"));
        for (name, text) in [("scale_all", SCALE), ("count_all", COUNT)] {
            let alone = module(&format!("{DECLARED}{text}"));
            let ordered = |module: &Module| {
                let mut only = entry_points(module).remove(name).unwrap();
                canonical::order(&mut only);
                store(&only)
            };
            assert_eq!(ordered(&both), ordered(&alone), "{name}");
        }
    }
}
