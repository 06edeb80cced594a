//! The compiler's messages, taken back to the author's line.
//!
//! rust-gpu reports at the place where a forbidden value is made, which for iterators, slices and
//! numbers lies in `core`; the author's line is in a note that says who used it. rustc's own messages
//! (`no method named sin`) are at the right line, and say what a program would do about it.

use std::path::Path;

use serde::{Deserialize, Deserializer};

use super::{Diagnostic, Level, Place};

/// One of cargo's messages, as far as it is needed.
#[derive(Deserialize)]
struct CargoMessage {
    reason: String,
    message: Option<Message>,
}

#[derive(Deserialize)]
struct Message {
    message: String,
    level: String,
    #[serde(default)]
    spans: Vec<Span>,
    #[serde(default)]
    children: Vec<Message>,
}

#[derive(Clone, Deserialize)]
struct Span {
    #[serde(deserialize_with = "file_name")]
    file_name: String,
    line_start: u32,
    line_end: u32,
    column_start: u32,
    column_end: u32,
    #[serde(default)]
    is_primary: bool,
    expansion: Option<Box<Expansion>>,
}

#[derive(Clone, Deserialize)]
struct Expansion {
    span: Span,
}

/// The file of a place. What rust-gpu's linker finds comes from the debug information of SPIR-V, whose
/// files rustc does not know: it puts their names into angle brackets.
fn file_name<'de, D: Deserializer<'de>>(from: D) -> Result<String, D::Error> {
    let name = String::deserialize(from)?;
    let inner = name.strip_prefix('<').and_then(|it| it.strip_suffix('>'));
    match inner.filter(|it| it.ends_with(".rs")) {
        Some(inner) => Ok(inner.into()),
        None => Ok(name),
    }
}

/// What messages are known: words that they contain, and what to write instead.
const KNOWN: [(&[&str], &str); 29] = [
    (
        &["memset invalid on bool pattern"],
        "an array of one truth value, `[false; N]`, cannot be made: write `[0_u32; N]`, or keep them as the bits of a `u32`",
    ),
    (
        &["unsupported unsized"],
        "a constant that is a slice, `const T: &[f32] = &[…]`, and of which rust-gpu tells no line: write an array, \
         `const T: [f32; 3] = […]`, and `for x in T`, or `&T`",
    ),
    (
        &["`const_data_from_alloc` result"],
        "an enum whose first variant holds less than another one: first the variant that holds most, \
         `enum Light { Spot { at: Vec3, toward: Vec3 }, Point { at: Vec3 } }`",
    ),
    (
        &["cannot offset a pointer"],
        "a shader cannot walk through memory by pointer, as `windows` and `chunks` do: count an \
         index, `for i in 0..N { … a[i] … }`",
    ),
    (
        &["cannot cast between pointer types", "to `*["],
        "a part of an array is only there where it is used, `&a[i..i + 2]`; what gives one part after the other, or \
         several (`windows`, `chunks`, `split_at_mut`), is not: count an index, `for i in 0..N { … a[i] … }`. An array \
         beside an iterator of references (`a.iter().zip([1, 2])`) is taken by reference, too: `.zip(&[1, 2])`. Of four \
         adapters in a row (`zip`, `skip`, `map`, `max`) compute the last ones in a loop, `for (p, q) in …`",
    ),
    (
        &["cannot cast between pointer types"],
        "memory has one type in a shader. An enum whose variants hold different types: first the variant \
         that holds most, `enum Shape { Box(Vec3, Vec3), Ball(Vec3, f32), Height(f32) }`; or a structure with a tag \
         and a field for each. An enum within a `Result` of another type: an `Option` instead. A reference to a field \
         of no size, `&self` of a unit structure: give it a field, or call it without `self`",
    ),
    (
        &["OpSwitch", "is duplicated"],
        "two arms of a `match` that do nothing become one, which rust-gpu 0.10 refuses: write `if`, or let \
         each arm give a value, `y = match x { 0 => 5, _ => y }`",
    ),
    (
        &["OpBranchConditional", "is duplicated"],
        "two arms become one, which rust-gpu 0.10 refuses, and it tells no line. A `match` of two values with a guard \
         may do so: write `if let … && … { … } else { … }`",
    ),
    (
        &["is not a logical pointer"],
        "a shader cannot choose between two places and then read. It may lie in a function of `core` that \
         takes references, as `(a..=b).contains(&x)`: compare the values, `x >= a && x <= b`",
    ),
    (
        &["OpPhi", "VariablePointers"],
        "a shader cannot choose between two places and then read: choose between two indices, or \
         read both and choose between the values",
    ),
    (
        &["no method named `sqrt`"],
        "`use hankel_dsl::Real;`, then `Real::sqrt(x)`: the same bits everywhere",
    ),
    (
        &["no method named `fract`"],
        "`use hankel_dsl::math;`, then `math::fract(x)`: the same bits everywhere",
    ),
    (
        &["no method named `floor`"],
        "`use hankel_dsl::Real;`, then `Real::floor(x)`: the same bits everywhere",
    ),
    (
        &["no method named `powi`"],
        "multiply: `x * x * x`; for a power that is not known, `hankel_dsl::math::pow(x, n as f32)`",
    ),
    (
        &["no method named `powf`"],
        "`hankel_dsl::math::pow(x, y)`, which has the same bits everywhere, or the device's own, \
         `math::native::pow(x, y)`",
    ),
    (
        &["no method named `mul_add`"],
        "`hankel_dsl::math::fma(a, b, c)`, which rounds once everywhere, or `a * b + c`",
    ),
    (
        &["no method named `rem_euclid`"],
        "`use hankel_dsl::Real;`, then `x - y * Real::floor(x / y)`",
    ),
    (
        &["no method named", "f32"],
        "a shader's crate has no `std`: call the function of that name in `hankel_dsl::math`, as `math::sin(x)`, which \
         has the same bits everywhere, or the device's own, `math::native::sin(x)`",
    ),
    (
        &["no method named", "f64"],
        "a shader's crate has no `std`: call the function of `hankel_dsl::math`, `math::sin(x)`, which \
         has the same bits everywhere",
    ),
    (
        &["signum"],
        "compare and choose: `if x < 0.0 { -1.0 } else { 1.0 }`, or `1.0_f32.copysign(x)`",
    ),
    (
        &["module has recursion"],
        "a shader has no stack: write a loop; where it branches, with an array of what is left to do",
    ),
    (
        &["indirect calls"],
        "which function is called must be known: take `impl Fn(…) -> …` or a type parameter, or match \
         on an enum",
    ),
    (
        &["VTable"],
        "a shader has no trait objects: take `impl Trait` or a type parameter, or match on an enum",
    ),
    (
        &["128"],
        "shaders have no numbers of 128 bits: two `u64`, or four `u32`",
    ),
    (
        &["Hypot not supported"],
        "write `sqrt(x * x + y * y)`, scaled by the larger of both where that may overflow",
    ),
    (
        &["cannot memcpy dynamically sized data"],
        "copy element by element, in a loop over the index",
    ),
    (
        &["cannot check pointers for equality"],
        "compare what they point to, or indices",
    ),
    (
        &["cannot convert pointers to integers"],
        "a shader's memory has no addresses: pass an index",
    ),
    (
        &["not supported yet"],
        "rust-gpu does not have this function: write it in sums and products, or take another",
    ),
];

/// What to write instead, if the message is known.
#[must_use]
pub fn advice(message: &str) -> Option<&'static str> {
    KNOWN
        .iter()
        .find(|(words, _)| words.iter().all(|word| message.contains(word)))
        .map(|(_, advice)| *advice)
}

/// The diagnostics in what `cargo --message-format=json` printed, for the crate in `folder`.
///
/// `kernels` are its entry points: a note that names one says which kernel is meant.
#[must_use]
pub fn read(messages: &str, folder: &Path) -> Vec<Diagnostic> {
    let mut found: Vec<Diagnostic> = Vec::new();
    for line in messages.lines() {
        let Ok(CargoMessage {
            reason,
            message: Some(message),
        }) = serde_json::from_str(line)
        else {
            continue;
        };
        if reason != "compiler-message" {
            continue;
        }
        let Some(diagnostic) = diagnostic(&message, folder) else {
            continue;
        };
        if !found.contains(&diagnostic) {
            found.push(diagnostic);
        }
    }
    found
}

fn diagnostic(message: &Message, folder: &Path) -> Option<Diagnostic> {
    let level = match message.level.as_str() {
        "error" | "error: internal compiler error" => Level::Error,
        "warning" => Level::Warning,
        _ => return None,
    };
    // "aborting due to 3 previous errors", "3 warnings emitted".
    let is_sum = message.spans.is_empty()
        && (message.message.starts_with("aborting due to")
            || message.message.contains("warning emitted")
            || message.message.contains("warnings emitted"));
    if is_sum {
        return None;
    }
    let place = place(message, folder);
    let elsewhere = message.spans.iter().find(|span| span.is_primary);
    let mut help: Vec<String> = Vec::new();
    help.extend(advice(&message.message).map(Into::into));
    for child in &message.children {
        // Notes that only lead from one place in `core` to the next are of no use to an author.
        let says_who = ["used from within", "called by", "used by"]
            .iter()
            .any(|words| child.message.starts_with(words));
        if !says_who && !child.message.is_empty() {
            help.push(format!("{}: {}", child.level, child.message));
        }
    }
    if let (Some(place), Some(span)) = (&place, elsewhere)
        && !place.file.ends_with(&span.file_name)
    {
        help.push(format!(
            "found at {}:{}:{}",
            short(&span.file_name),
            span.line_start,
            span.column_start
        ));
    }
    Some(Diagnostic {
        place,
        level,
        message: message.message.clone(),
        help,
    })
}

/// A library's path without the folders that it is installed in.
fn short(path: &str) -> &str {
    ["/library/", "/registry/src/"]
        .iter()
        .find_map(|mark| path.find(mark).map(|at| &path[at + mark.len()..]))
        .unwrap_or(path)
}

/// The first place of a message, or of a note to it, in the crate itself; else where it says.
fn place(message: &Message, folder: &Path) -> Option<Place> {
    let first = |message: &Message| {
        let primary = message.spans.iter().filter(|span| span.is_primary);
        let others = message.spans.iter().filter(|span| !span.is_primary);
        primary.chain(others).find_map(|span| own(span, folder))
    };
    first(message)
        .or_else(|| message.children.iter().find_map(first))
        .map(|span| located(&span, folder))
        .or_else(|| {
            let span = message.spans.iter().find(|span| span.is_primary)?;
            Some(located(span, folder))
        })
}

/// The place itself, or that of the macro call that it comes from, if it lies in the crate.
fn own(span: &Span, folder: &Path) -> Option<Span> {
    if folder.join(&span.file_name).starts_with(folder) && folder.join(&span.file_name).is_file() {
        return Some(span.clone());
    }
    own(&span.expansion.as_ref()?.span, folder)
}

fn located(span: &Span, folder: &Path) -> Place {
    let file = folder.join(&span.file_name);
    Place {
        file: match file.is_file() {
            true => super::shown(&file),
            false => span.file_name.clone(),
        },
        line: span.line_start,
        column: span.column_start,
        length: match span.line_end == span.line_start {
            true => span.column_end.saturating_sub(span.column_start).max(1),
            false => 1,
        },
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn span(file: &str, line: u32, primary: bool) -> serde_json::Value {
        json!({
            "file_name": file, "line_start": line, "line_end": line, "column_start": 9,
            "column_end": 12, "is_primary": primary, "expansion": null,
        })
    }

    #[test]
    fn a_message_from_core_comes_back_to_the_author() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("src")).unwrap();
        std::fs::write(folder.path().join("src/lib.rs"), "").unwrap();
        let note = |file: &str, line| {
            json!({
                "message": "used from within `sum`", "level": "note",
                "spans": [span(file, line, true)], "children": [],
            })
        };
        let message = json!({
            "reason": "compiler-message",
            "message": {
                "message": "cannot offset a pointer to an arbitrary element",
                "level": "error",
                "spans": [span("/x/lib/rustlib/src/rust/library/core/src/ptr/mut_ptr.rs", 900, true)],
                "children": [note("/x/library/core/src/slice/iter.rs", 7), note("src/lib.rs", 14)],
            },
        });
        let text = format!("{message}\nnoise\n{message}\n");
        let [one] = &read(&text, folder.path())[..] else {
            panic!("one message was expected")
        };
        let place = one.place.as_ref().unwrap();
        assert!(place.file.ends_with("src/lib.rs"), "{one}");
        assert_eq!((place.line, place.column, place.length), (14, 9, 3));
        assert!(one.help[0].contains("count an index"), "{one}");
        assert!(
            one.help[1].ends_with("core/src/ptr/mut_ptr.rs:900:9"),
            "{one}"
        );
    }

    #[test]
    fn files_of_the_linker_lose_their_brackets() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("src")).unwrap();
        std::fs::write(folder.path().join("src/bvh.rs"), "").unwrap();
        let note = json!({
            "message": "used from within `trace`", "level": "note",
            "spans": [span("<src/bvh.rs>", 21, true)], "children": [],
        });
        let message = json!({
            "reason": "compiler-message",
            "message": {
                "message": "cannot cast between pointer types",
                "level": "error",
                "spans": [span("</x/library/core/src/array/iter.rs>", 34, true)],
                "children": [note],
            },
        });
        let [one] = &read(&message.to_string(), folder.path())[..] else {
            panic!("one message was expected")
        };
        let place = one.place.as_ref().unwrap();
        assert!(place.file.ends_with("/src/bvh.rs"), "{one}");
        assert_eq!(place.line, 21);
        assert_eq!(
            one.help.last().unwrap(),
            "found at core/src/array/iter.rs:34:9"
        );
    }

    #[test]
    fn known_messages_say_what_to_write() {
        let said = "no method named `sin` found for type `f32` in the current scope";
        assert!(advice(said).unwrap().contains("`math::sin(x)`"));
        let said = "no method named `sqrt` found for type `f32` in the current scope";
        assert!(advice(said).unwrap().contains("`Real::sqrt(x)`"));
        let said = "cannot cast between pointer types\nfrom `*[u32; 4]`\nto `*[u32]`";
        assert!(advice(said).unwrap().contains("`windows`"));
        let said = "malformed SPIR-V (in OpSwitch: `OpPhi` (#0 in %9)'s case for source block %8 is \
                    duplicated)";
        assert!(advice(said).unwrap().contains("write `if`"));
        let said = "malformed SPIR-V (in OpBranchConditional: `OpPhi` (#0 in %9)'s case for source block %8 is \
                    duplicated)";
        assert!(advice(said).unwrap().contains("`if let"));
        assert_eq!(advice("mismatched types"), None);
    }
}
