//! SPIR-V as words: what must be known of a module before a driver gets it unseen, and the small
//! changes that need no compiler.

use std::collections::{HashMap, HashSet};

/// `OpExtension`.
const EXTENSION: u16 = 10;
/// `OpExtInstImport`.
const EXT_INST_IMPORT: u16 = 11;
/// `OpExtInst`.
const EXT_INST: u16 = 12;
/// `OpEntryPoint`.
const ENTRY_POINT: u16 = 15;
/// `OpExecutionMode`.
const EXECUTION_MODE: u16 = 16;
/// `OpCapability`.
const CAPABILITY: u16 = 17;
/// `OpTypeVoid`, the first of the types.
const TYPE_VOID: u16 = 19;
/// `OpTypeFloat`.
const TYPE_FLOAT: u16 = 22;
/// `OpTypeVector`.
const TYPE_VECTOR: u16 = 23;
/// `OpVariable`, the last of the declarations.
const VARIABLE: u16 = 59;
/// Float arithmetic: negation, sum, difference, product, quotient, remainders, and what multiplies
/// vectors and matrices.
const ARITHMETIC: [u16; 14] = [
    127, 129, 131, 133, 136, 140, 141, 142, 143, 144, 145, 146, 147, 148,
];
/// `OpFConvert`.
const CONVERT: u16 = 115;
/// `OpFDiv`.
const DIVIDE: u16 = 136;
/// `Sqrt` of `GLSL.std.450`.
const SQRT: u32 = 31;
/// Capability and execution mode `DenormPreserve`.
pub const DENORM_PRESERVE: (u32, u32) = (4464, 4459);
/// Capability and execution mode `SignedZeroInfNanPreserve`.
pub const SIGNED_ZERO_INF_NAN_PRESERVE: (u32, u32) = (4466, 4461);
/// Capability `Float64`.
const FLOAT_64: u32 = 10;
/// `OpSpecConstant`.
const SPEC_CONSTANT_TRUE: u16 = 48;
const SPEC_CONSTANT_FALSE: u16 = 49;
const SPEC_CONSTANT: u16 = 50;
/// `OpFunction`.
const FUNCTION: u16 = 54;
/// `OpFunctionEnd`.
const FUNCTION_END: u16 = 56;
/// `OpDecorate`.
const DECORATE: u16 = 71;

/// Decoration `SpecId`.
const SPEC_ID: u32 = 1;
/// Decoration `NonReadable`.
const NON_READABLE: u32 = 25;
/// Decoration `NoContraction`.
const NO_CONTRACTION: u32 = 42;
/// Decoration `Binding`.
const BINDING: u32 = 33;
/// Decoration `DescriptorSet`.
const DESCRIPTOR_SET: u32 = 34;

/// Storage class `PushConstant`.
const PUSH_CONSTANT: u32 = 9;

/// Words before the first instruction.
const HEADER: usize = 5;

/// An instruction: where it starts, its number, its operands.
struct Instruction<'a> {
    at: usize,
    opcode: u16,
    operands: &'a [u32],
}

/// The instructions of a module.
fn instructions(words: &[u32]) -> Result<Vec<Instruction<'_>>, String> {
    if words.len() < HEADER || words[0] != 0x0723_0203 {
        return Err("it does not begin as SPIR-V does".into());
    }
    let mut all = Vec::new();
    let mut at = HEADER;
    while at < words.len() {
        let length = (words[at] >> 16) as usize;
        let end = at + length;
        if length == 0 || end > words.len() {
            return Err(format!("the instruction at word {at} runs past the end"));
        }
        let opcode = (words[at] & 0xffff) as u16;
        all.push(Instruction {
            at,
            opcode,
            operands: &words[at + 1..end],
        });
        at = end;
    }
    Ok(all)
}

/// A literal string, as operands hold it.
fn string(words: &[u32]) -> String {
    let bytes: Vec<u8> = words
        .iter()
        .flat_map(|w| w.to_le_bytes())
        .take_while(|&b| b != 0)
        .collect();
    String::from_utf8_lossy(&bytes).into_owned()
}

/// A string as operands.
fn literal(text: &str) -> Vec<u32> {
    let mut bytes = text.as_bytes().to_vec();
    bytes.resize(bytes.len() / 4 * 4 + 4, 0);
    let (words, _) = bytes.as_chunks();
    words.iter().map(|word| u32::from_le_bytes(*word)).collect()
}

/// Whether a module has push constants.
pub fn has_push_constants(words: &[u32]) -> bool {
    let all = instructions(words).unwrap_or_default();
    all.iter()
        .any(|i| i.opcode == VARIABLE && i.operands.get(2) == Some(&PUSH_CONSTANT))
}

/// What is known of a module.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Summary {
    /// Execution model and name of each entry point.
    pub entry_points: Vec<(u32, String)>,
    /// Capabilities.
    pub capabilities: HashSet<u32>,
    /// Descriptor sets and bindings.
    pub bindings: Vec<(u32, u32)>,
}

/// Reads a module's entry points, capabilities and bindings.
pub fn summary(words: &[u32]) -> Result<Summary, String> {
    let mut found = Summary::default();
    let mut numbers = std::collections::BTreeMap::<u32, (u32, Option<u32>)>::new();
    let (mut functions, mut open) = (0, false);
    for i in instructions(words)? {
        match (i.opcode, i.operands) {
            (FUNCTION, _) if !open => open = true,
            (FUNCTION, _) => return Err("a function begins inside another".into()),
            (FUNCTION_END, _) => (functions, open) = (functions + 1, false),
            (ENTRY_POINT, [model, _, name @ ..]) => {
                found.entry_points.push((*model, string(name)));
            }
            (CAPABILITY, [capability]) => {
                found.capabilities.insert(*capability);
            }
            (DECORATE, [target, DESCRIPTOR_SET, set]) => {
                numbers.entry(*target).or_default().0 = *set
            }
            (DECORATE, [target, BINDING, binding]) => {
                numbers.entry(*target).or_default().1 = Some(*binding);
            }
            _ => {}
        }
    }
    if open || functions < found.entry_points.len() {
        return Err("it ends before its functions do".into());
    }
    found.bindings = numbers
        .values()
        .filter_map(|&(set, b)| b.map(|b| (set, b)))
        .collect();
    Ok(found)
}

/// The module with the values of its specialisation constants changed, `(SpecId, value)` each.
pub fn specialise(words: &[u32], values: &[(u32, u32)]) -> Result<Vec<u32>, String> {
    let mut changed = words.to_vec();
    let all = instructions(words)?;
    for &(id, value) in values {
        // A module that does not use a constant does not have it either.
        let Some(target) = all.iter().find_map(|i| match (i.opcode, i.operands) {
            (DECORATE, [target, SPEC_ID, n]) if *n == id => Some(*target),
            _ => None,
        }) else {
            continue;
        };
        for i in &all {
            match (i.opcode, i.operands) {
                (SPEC_CONSTANT, [_, result, _]) if *result == target => changed[i.at + 3] = value,
                // A truth value is the instruction itself.
                (SPEC_CONSTANT_TRUE | SPEC_CONSTANT_FALSE, [_, result]) if *result == target => {
                    let opcode = if value == 0 {
                        SPEC_CONSTANT_FALSE
                    } else {
                        SPEC_CONSTANT_TRUE
                    };
                    changed[i.at] = 3 << 16 | u32::from(opcode);
                }
                _ => {}
            }
        }
    }
    Ok(changed)
}

/// The module with all its bindings in another descriptor set.
pub fn move_to_set(words: &[u32], set: u32) -> Result<Vec<u32>, String> {
    let mut changed = words.to_vec();
    for i in instructions(words)? {
        if let (DECORATE, [_, DESCRIPTOR_SET, _]) = (i.opcode, i.operands) {
            changed[i.at + 3] = set;
        }
    }
    Ok(changed)
}

/// The module with all its float arithmetic decorated `NoContraction`, which forbids a driver to
/// fuse, factor or reorder it. What has the decoration already keeps it once.
pub fn forbid_reordering(words: &[u32]) -> Result<Vec<u32>, String> {
    let all = instructions(words)?;
    let already: HashSet<u32> = all
        .iter()
        .filter_map(|i| match (i.opcode, i.operands) {
            (DECORATE, [target, NO_CONTRACTION]) => Some(*target),
            _ => None,
        })
        .collect();
    let results = all.iter().filter_map(|i| match i.operands {
        [_, result, ..] if ARITHMETIC.contains(&i.opcode) => Some(*result),
        _ => None,
    });
    let added: Vec<u32> = results
        .filter(|id| !already.contains(id))
        .flat_map(|id| [3 << 16 | u32::from(DECORATE), id, NO_CONTRACTION])
        .collect();
    // Decorations stand together, before the first type, constant or variable.
    let Some(at) = all
        .iter()
        .find(|i| (TYPE_VOID..=VARIABLE).contains(&i.opcode))
        .map(|i| i.at)
    else {
        return Err("it declares no types".into());
    };
    let mut changed = words.to_vec();
    changed.splice(at..at, added);
    Ok(changed)
}

/// The module with these execution modes for 32-bit floats in all its entry points, capability and mode each.
pub fn with_modes(words: &[u32], modes: &[(u32, u32)]) -> Result<Vec<u32>, String> {
    let all = instructions(words)?;
    let behind_last = |opcode: u16| {
        let last = all.iter().rfind(|i| i.opcode == opcode);
        last.map(|i| i.at + 1 + i.operands.len())
    };
    // Extensions come after capabilities, and execution modes after entry points.
    let Some((capabilities, entries)) = behind_last(CAPABILITY).zip(behind_last(ENTRY_POINT))
    else {
        return Err("it has no entry points".into());
    };
    let mut changed = words[..capabilities].to_vec();
    for (capability, _) in modes {
        changed.extend([2 << 16 | u32::from(CAPABILITY), *capability]);
    }
    let extension = literal("SPV_KHR_float_controls");
    changed.push((extension.len() as u32 + 1) << 16 | u32::from(EXTENSION));
    changed.extend(extension);
    changed.extend_from_slice(&words[capabilities..entries]);
    for i in &all {
        if let (ENTRY_POINT, [_, id, ..]) = (i.opcode, i.operands) {
            for (_, mode) in modes {
                changed.extend([4 << 16 | u32::from(EXECUTION_MODE), *id, *mode, 32]);
            }
        }
    }
    changed.extend_from_slice(&words[entries..]);
    Ok(changed)
}

/// The module with its quotients and square roots of 32-bit floats computed in 64 bits and rounded, so that they are
/// those of IEEE 754 on every device that has 64-bit floats: twice rounded, from 53 bits to 24, they are as if
/// rounded once. Vulkan lets a device's own be off by 2.5 units in the last place.
pub fn round_quotients(words: &[u32]) -> Result<Vec<u32>, String> {
    let all = instructions(words)?;
    let is_sqrt = {
        let library = all.iter().find_map(|i| match (i.opcode, i.operands) {
            (EXT_INST_IMPORT, [id, name @ ..]) if string(name) == "GLSL.std.450" => Some(*id),
            _ => None,
        });
        move |set: u32, number: u32| library == Some(set) && number == SQRT
    };
    // Types of 32-bit and of 64-bit floats, by how many there are.
    let mut floats = HashMap::new();
    let mut wide = [None; 5];
    for i in &all {
        match (i.opcode, i.operands) {
            (TYPE_FLOAT, [id, 32, ..]) => _ = floats.insert(*id, 1),
            (TYPE_FLOAT, [id, 64, ..]) => wide[1] = Some(*id),
            (TYPE_VECTOR, [id, of, size @ 2..=4]) if floats.contains_key(of) => {
                floats.insert(*id, *size as usize);
            }
            (TYPE_VECTOR, [id, of, size @ 2..=4]) if wide[1] == Some(*of) => {
                wide[*size as usize] = Some(*id);
            }
            _ => {}
        }
    }
    let mut bound = words[3];
    let mut fresh = || {
        bound += 1;
        bound - 1
    };
    let mut types: Vec<u32> = Vec::new();
    let mut body: Vec<u32> = Vec::new();
    let mut first_function = None;
    for i in &all {
        let own = &words[i.at..=i.at + i.operands.len()];
        if i.opcode == FUNCTION && first_function.is_none() {
            first_function = Some(body.len());
        }
        let (ty, result, operands) = match (i.opcode, i.operands) {
            (DIVIDE, [ty, result, operands @ ..]) => (ty, *result, operands),
            (EXT_INST, [ty, result, set, number, operands @ ..]) if is_sqrt(*set, *number) => {
                (ty, *result, operands)
            }
            _ => {
                body.extend_from_slice(own);
                continue;
            }
        };
        let Some(&size) = floats.get(ty) else {
            body.extend_from_slice(own);
            continue;
        };
        for n in [1, size] {
            if wide[n].is_none() {
                let id = fresh();
                wide[n] = Some(id);
                match wide[1] {
                    Some(float) if n > 1 => {
                        types.extend([4 << 16 | u32::from(TYPE_VECTOR), id, float, n as u32]);
                    }
                    _ => types.extend([3 << 16 | u32::from(TYPE_FLOAT), id, 64]),
                }
            }
        }
        let of = wide[size].unwrap_or_default();
        let converted: Vec<u32> = operands
            .iter()
            .map(|operand| {
                let id = fresh();
                body.extend([4 << 16 | u32::from(CONVERT), of, id, *operand]);
                id
            })
            .collect();
        let exact = fresh();
        let first = own.len() - operands.len();
        let at = body.len();
        body.extend_from_slice(&own[..first]);
        body.extend(converted);
        (body[at + 1], body[at + 2]) = (of, exact);
        body.extend([4 << 16 | u32::from(CONVERT), *ty, result, exact]);
    }
    let Some(at) = first_function else {
        return Err("it has no functions".into());
    };
    body.splice(at..at, types);
    let mut changed = words[..HEADER].to_vec();
    changed[3] = bound;
    let has_wide = |i: &Instruction<'_>| (i.opcode, i.operands) == (CAPABILITY, &[FLOAT_64]);
    if bound > words[3] && !all.iter().any(has_wide) {
        changed.extend([2 << 16 | u32::from(CAPABILITY), FLOAT_64]);
    }
    changed.extend(body);
    Ok(changed)
}

/// The module with the variables at `bindings` declared as never read, which naga needs to know of
/// a storage texture that is only written.
pub fn write_only(words: &[u32], bindings: &[u32]) -> Result<Vec<u32>, String> {
    let all = instructions(words)?;
    let already: HashSet<u32> = all
        .iter()
        .filter_map(|i| match (i.opcode, i.operands) {
            (DECORATE, [target, NON_READABLE]) => Some(*target),
            _ => None,
        })
        .collect();
    let mut changed = words[..HEADER].to_vec();
    for i in &all {
        changed.extend_from_slice(&words[i.at..=i.at + i.operands.len()]);
        if let (DECORATE, [target, BINDING, n]) = (i.opcode, i.operands)
            && bindings.contains(n)
            && !already.contains(target)
        {
            changed.extend([3 << 16 | u32::from(DECORATE), *target, NON_READABLE]);
        }
    }
    Ok(changed)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A module of decorations and one constant; no driver would take it.
    fn module() -> Vec<u32> {
        let mut w = vec![0x0723_0203, 0x0001_0500, 0, 20, 0];
        let mut op = |opcode: u16, operands: &[u32]| {
            w.push((operands.len() as u32 + 1) << 16 | u32::from(opcode));
            w.extend_from_slice(operands);
        };
        op(CAPABILITY, &[10]);
        op(ENTRY_POINT, &[5, 1, u32::from_le_bytes(*b"abcd"), 0]);
        op(DECORATE, &[7, SPEC_ID, 3]);
        op(DECORATE, &[8, BINDING, 2]);
        op(DECORATE, &[8, DESCRIPTOR_SET, 0]);
        op(SPEC_CONSTANT, &[9, 7, 41]);
        op(FUNCTION, &[2, 1, 0, 3]);
        op(FUNCTION_END, &[]);
        w
    }

    #[test]
    fn a_summary_names_entry_points_and_bindings() {
        let s = summary(&module()).unwrap();
        assert_eq!(s.entry_points, [(5, "abcd".to_string())]);
        assert_eq!(s.bindings, [(0, 2)]);
        assert!(s.capabilities.contains(&10));
    }

    #[test]
    fn what_is_cut_short_is_refused() {
        let w = module();
        let cut = |n: usize| summary(&w[..w.len() - n]).unwrap_err();
        assert!(cut(1).contains("before its functions do"));
        assert!(cut(2).contains("past the end"));
        assert!(cut(6).contains("before its functions do"));
        assert!(summary(&[1, 2, 3, 4, 5]).is_err());
        assert!(summary(&[]).is_err());
        let mut zero = module();
        zero[5] = 0;
        assert!(summary(&zero).is_err());
    }

    #[test]
    fn a_constant_is_changed_by_its_number() {
        let w = specialise(&module(), &[(3, 5), (4, 6)]).unwrap();
        let at = w.len() - 7;
        assert_eq!((module()[at], w[at]), (41, 5));
        assert_eq!(
            (&w[..at], &w[at + 1..]),
            (&module()[..at], &module()[at + 1..])
        );
    }

    #[test]
    fn a_truth_value_is_changed_by_its_number() {
        let mut w = module();
        let at = w.len() - 6;
        w.splice(at - 4..at, [3 << 16 | u32::from(SPEC_CONSTANT_TRUE), 9, 7]);
        let opcode = |value: u32| {
            let w = specialise(&w, &[(3, value)]).unwrap();
            w[at - 4] as u16
        };
        assert_eq!(
            [0, 1].map(opcode),
            [SPEC_CONSTANT_FALSE, SPEC_CONSTANT_TRUE]
        );
    }

    #[test]
    fn arithmetic_is_decorated_once() {
        let mut w = module();
        let mut op = |opcode: u16, operands: &[u32]| {
            let mut i = vec![(operands.len() as u32 + 1) << 16 | u32::from(opcode)];
            i.extend_from_slice(operands);
            let end = w.len() - 1;
            w.splice(end..end, i);
        };
        op(129, &[4, 11, 12, 13]);
        // An integer's sum is none of it.
        op(128, &[4, 14, 12, 13]);
        let once = forbid_reordering(&w).unwrap();
        assert_eq!(once.len(), w.len() + 3);
        let added = [3 << 16 | u32::from(DECORATE), 11, NO_CONTRACTION];
        assert!(once.windows(3).any(|x| x == added));
        assert_eq!(summary(&once), summary(&w));
        assert_eq!(forbid_reordering(&once).unwrap(), once);
    }

    #[test]
    fn modes_stand_where_spirv_has_them() {
        let modes = [DENORM_PRESERVE, SIGNED_ZERO_INF_NAN_PRESERVE];
        let changed = with_modes(&module(), &modes).unwrap();
        let found: Vec<(u16, &[u32])> = instructions(&changed)
            .unwrap()
            .iter()
            .map(|i| (i.opcode, i.operands))
            .collect();
        let extension = literal("SPV_KHR_float_controls");
        assert_eq!(string(&extension), "SPV_KHR_float_controls");
        let expected: [(u16, &[u32]); 7] = [
            (CAPABILITY, &[FLOAT_64]),
            (CAPABILITY, &[4464]),
            (CAPABILITY, &[4466]),
            (EXTENSION, &extension),
            (ENTRY_POINT, &[5, 1, u32::from_le_bytes(*b"abcd"), 0]),
            (EXECUTION_MODE, &[1, 4459, 32]),
            (EXECUTION_MODE, &[1, 4461, 32]),
        ];
        assert_eq!(found[..7], expected);
        let rest = instructions(&module()).unwrap().len() - 2;
        assert_eq!(found.len(), expected.len() + rest);
    }

    #[test]
    fn quotients_and_roots_are_computed_in_64_bits() {
        let text = "
@group(0) @binding(0) var<storage, read_write> x: array<vec3<f32>>;
@compute @workgroup_size(1)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let v = x[id.x];
    x[id.x] = sqrt(v / v.zyx) + vec3<f32>(v.x / v.y, f32(id.x / 3u), floor(v.z));
}";
        let module = naga::front::wgsl::parse_str(text).unwrap();
        let mut validator = naga::valid::Validator::new(
            naga::valid::ValidationFlags::all(),
            naga::valid::Capabilities::all(),
        );
        let info = validator.validate(&module).unwrap();
        let options = naga::back::spv::Options::default();
        let written = naga::back::spv::write_vec(&module, &info, &options, None).unwrap();
        let rounded = round_quotients(&written).unwrap();
        let count = |words: &[u32], opcode: u16| {
            let all = instructions(words).unwrap();
            all.iter().filter(|i| i.opcode == opcode).count()
        };
        // Two quotients and a root, of five operands.
        assert_eq!(count(&rounded, CONVERT), count(&written, CONVERT) + 5 + 3);
        assert_eq!(count(&rounded, DIVIDE), 2);
        assert!(summary(&rounded).unwrap().capabilities.contains(&FLOAT_64));
        let read = |words: &[u32]| {
            let options = naga::front::spv::Options::default();
            let front = naga::front::spv::Frontend::new(words.iter().copied(), &options);
            front.parse().unwrap()
        };
        validator.validate(&read(&rounded)).unwrap();
        // 64-bit quotients stay as they are.
        assert_eq!(round_quotients(&rounded).unwrap(), rounded);
    }

    #[test]
    fn sets_and_write_only_are_declared_once() {
        let w = move_to_set(&module(), 1).unwrap();
        assert_eq!(summary(&w).unwrap().bindings, [(1, 2)]);
        let once = write_only(&module(), &[2]).unwrap();
        assert_eq!(once.len(), module().len() + 3);
        assert_eq!(write_only(&once, &[2]).unwrap(), once);
        assert_eq!(write_only(&module(), &[1]).unwrap(), module());
    }
}
