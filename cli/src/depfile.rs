//! Dependency files in Make's syntax, as Ninja, CMake (`DEPFILE`) and Make read them.

use std::path::{Path, PathBuf};

use crate::failure::{Failure, Result};

/// The rule that `target` depends on `inputs`.
///
/// # Errors
///
/// A path that no rule can hold.
pub fn rule(target: &Path, inputs: &[PathBuf]) -> Result<String> {
    let mut text = escaped(target)?;
    text.push(':');
    for input in inputs {
        text.push_str(" \\\n  ");
        text.push_str(&escaped(input)?);
    }
    text.push('\n');
    Ok(text)
}

/// A path with what has a meaning in Make marked, as Make and Ninja both read it. For some letters there is no such mark:
/// what follows a line break, for example, would be a rule of its own.
fn escaped(path: &Path) -> Result<String> {
    const UNMARKED: &str = ":;=%|*?[]'\"`&<>()\\";
    let mut text = String::new();
    for letter in path.to_string_lossy().chars() {
        match letter {
            _ if letter.is_control() || UNMARKED.contains(letter) => {
                let what = match letter {
                    '\n' | '\r' => "a line break".to_owned(),
                    other => format!("the letter {other:?}"),
                };
                return Err(Failure::input(
                    format!(
                        "--depfile: {path:?} has {what}, which rules of Make and Ninja do not have in names"
                    ),
                    "Give the folder or file another name, or leave out --depfile.",
                ));
            }
            '$' => text.push('$'),
            ' ' | '#' => text.push('\\'),
            _ => {}
        }
        text.push(letter);
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_with_a_meaning_are_marked() {
        let inputs = ["a b/lib.rs", "c#/$d.rs"].map(PathBuf::from);
        assert_eq!(
            rule(Path::new("out/manifest.json"), &inputs).unwrap(),
            "out/manifest.json: \\\n  a\\ b/lib.rs \\\n  c\\#/$$d.rs\n"
        );
        assert_eq!(rule(Path::new("x"), &[]).unwrap(), "x:\n");
    }

    #[test]
    fn letters_that_cannot_be_marked_are_refused() {
        for name in [
            "a:b", "a;b", "a=b", "a\tb", "a'b", "a&b", "a*", "a|b", "a\\ b", "a%",
        ] {
            let failure = rule(Path::new("out"), &[name.into()]).unwrap_err();
            assert_eq!(failure.code(), 2, "{name}");
        }
    }

    #[test]
    fn line_breaks_are_refused() {
        let evil = "d\nall: evil";
        for (target, input) in [(evil, "lib.rs"), ("out", evil), ("out", "a\rb")] {
            let failure = rule(Path::new(target), &[input.into()]).unwrap_err();
            assert_eq!(failure.code(), 2);
            let message = failure.to_string();
            assert!(!message.contains(['\n', '\r']), "{message}");
            assert!(
                message.contains("d\\nall: evil") || message.contains("a\\rb"),
                "{message}"
            );
        }
    }
}
