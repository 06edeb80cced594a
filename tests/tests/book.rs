//! The chapter on kernels: its examples are those of the crates of kernels here, which run everywhere.

use std::fs;

use hankel_tests::root;

/// The blocks of Rust in a text.
fn examples(text: &str) -> Vec<&str> {
    text.split("```rust\n")
        .skip(1)
        .filter_map(|rest| Some(rest.split_once("\n```")?.0))
        .collect()
}

#[test]
fn every_example_is_compiled_and_runs() {
    let mut sources = String::new();
    for folder in ["tests/conformance/src", "tests/iteration/src"] {
        for file in fs::read_dir(root().join(folder)).expect("the crate is there") {
            let path = file.expect("it can be listed").path();
            sources += &fs::read_to_string(path).expect("it is text");
        }
    }
    let text = fs::read_to_string(root().join("docs/kernels.md")).expect("the chapter is there");
    let examples = examples(&text);
    assert!(examples.len() > 20, "{} examples", examples.len());
    let listed: Vec<String> = hankel_conformance::entries()
        .iter()
        .chain(&hankel_iteration::entries())
        .map(|entry| entry.kernel.function.clone())
        .collect();
    for example in examples {
        for part in example.split("\n\n/// ") {
            assert!(
                sources.contains(part),
                "this is in no file of the crates:\n{part}"
            );
        }
        let kernels = example.split("#[kernel").skip(1);
        for kernel in kernels {
            let name = kernel
                .split_once("\npub fn ")
                .and_then(|(_, rest)| rest.split(['(', '<']).next())
                .unwrap_or_default();
            assert!(listed.iter().any(|it| it == name), "`{name}` is not listed");
        }
    }
}

/// Whatever `#[kernel]` takes is named in the chapter.
#[test]
fn nothing_is_left_out() {
    let text = fs::read_to_string(root().join("docs/kernels.md")).expect("the chapter is there");
    let macros =
        fs::read_to_string(root().join("kernels/macros/src/kernel.rs")).expect("it is there");
    let roles = macros
        .split_once("const ROLES: &str = \"")
        .and_then(|(_, rest)| rest.split_once('"'))
        .expect("the list of roles")
        .0;
    assert!(roles.split(", ").count() > 15);
    for role in roles.split(", ") {
        assert!(text.contains(&format!("#[{role}")), "#[{role}] is missing");
    }
}
