//! Dependency files in Make's syntax, as Ninja, CMake (`DEPFILE`) and Make read them.

use std::path::{Path, PathBuf};

/// The rule that `target` depends on `inputs`.
pub fn rule(target: &Path, inputs: &[PathBuf]) -> String {
    let mut text = escaped(target);
    text.push(':');
    for input in inputs {
        text.push_str(" \\\n  ");
        text.push_str(&escaped(input));
    }
    text.push('\n');
    text
}

/// A path with what has a meaning in Make marked.
fn escaped(path: &Path) -> String {
    let mut text = String::new();
    for letter in path.to_string_lossy().chars() {
        match letter {
            '$' => text.push('$'),
            ' ' | '#' => text.push('\\'),
            _ => {}
        }
        text.push(letter);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_with_a_meaning_are_marked() {
        let inputs = ["a b/lib.rs", "c#/$d.rs"].map(PathBuf::from);
        assert_eq!(
            rule(Path::new("out/manifest.json"), &inputs),
            "out/manifest.json: \\\n  a\\ b/lib.rs \\\n  c\\#/$$d.rs\n"
        );
        assert_eq!(rule(Path::new("x"), &[]), "x:\n");
    }
}
