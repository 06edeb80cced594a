//! SPIR-V as words: what must be known of a module before a driver gets it unseen, and the small
//! changes that need no compiler.

use std::collections::HashSet;

/// `OpEntryPoint`.
const ENTRY_POINT: u16 = 15;
/// `OpCapability`.
const CAPABILITY: u16 = 17;
/// `OpTypeVoid`, the first of the types.
const TYPE_VOID: u16 = 19;
/// `OpVariable`, the last of the declarations.
const VARIABLE: u16 = 59;
/// Float arithmetic: negation, sum, difference, product, quotient, remainders, and what multiplies
/// vectors and matrices.
const ARITHMETIC: [u16; 14] = [
    127, 129, 131, 133, 136, 140, 141, 142, 143, 144, 145, 146, 147, 148,
];
/// `OpSpecConstant`.
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
        for i in all.iter().filter(|i| i.opcode == SPEC_CONSTANT) {
            if let [_, result, _] = i.operands
                && *result == target
            {
                changed[i.at + 3] = value;
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
    fn sets_and_write_only_are_declared_once() {
        let w = move_to_set(&module(), 1).unwrap();
        assert_eq!(summary(&w).unwrap().bindings, [(1, 2)]);
        let once = write_only(&module(), &[2]).unwrap();
        assert_eq!(once.len(), module().len() + 3);
        assert_eq!(write_only(&once, &[2]).unwrap(), once);
        assert_eq!(write_only(&module(), &[1]).unwrap(), module());
    }
}
