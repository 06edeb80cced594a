//! The pages of the examples show and count all lines that are there because of Hankel.
//!
//! `INSTA_UPDATE=always` writes anew what is not current.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Lines of glue that an example may have.
const MOST_GLUE: usize = 15;

fn updates() -> bool {
    std::env::var("INSTA_UPDATE").is_ok_and(|value| value == "always")
}

/// The folder of the examples.
fn examples() -> PathBuf {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    here.parent().expect("it lies in examples/").to_owned()
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// The lines of a file between `Glue:` and `End of glue.`, without their indentation; of a file without
/// such marks, all lines. Blank lines and comments do not count.
fn glue(path: &Path) -> Vec<String> {
    let text = read(path);
    let is_marked = text.contains("// Glue:");
    let mut counts = !is_marked;
    let mut indent = None;
    let mut lines = Vec::new();
    for line in text.lines() {
        let code = line.trim_start();
        if code == "// Glue:" {
            counts = true;
            indent = None;
        } else if code == "// End of glue." {
            counts = false;
        } else if counts && !code.is_empty() && !code.starts_with("//") {
            let indent = *indent.get_or_insert(line.len() - code.len());
            lines.push(line[indent..].to_owned());
        }
    }
    lines
}

/// Writes the glue of an example into its page, or compares.
fn page(example: &str, files: &[&str]) {
    let folder = examples().join(example);
    let all: Vec<_> = files
        .iter()
        .map(|file| (file, glue(&folder.join(file))))
        .collect();
    let count: usize = all.iter().map(|(_, lines)| lines.len()).sum();
    assert!(
        count > 0 && count <= MOST_GLUE,
        "{example}: {count} lines of glue"
    );
    let mut block = format!("{count} lines:\n");
    for (file, lines) in all {
        let extension = file.rsplit_once('.').map(|(_, extension)| extension);
        let language = match extension {
            Some("rs") => "rust",
            Some(other) => other,
            None => "",
        };
        let _ = write!(
            block,
            "\n[`{file}`]({file})\n\n```{language}\n{}\n```\n",
            lines.join("\n")
        );
    }
    let path = folder.join("README.md");
    let text = read(&path);
    let (before, rest) = text.split_once("<!-- glue -->\n").expect("the first mark");
    let (stands, after) = rest.split_once("<!-- /glue -->").expect("the last mark");
    if updates() {
        let text = format!("{before}<!-- glue -->\n{block}<!-- /glue -->{after}");
        std::fs::write(&path, text).expect("the page can be written");
    } else {
        assert_eq!(
            stands,
            block,
            "{}: INSTA_UPDATE=always cargo test --release -p hankel-example-renderer writes it",
            path.display()
        );
    }
}

#[test]
fn pages_count_the_lines_of_glue() {
    page("wgpu", &["build.rs", "src/lib.rs"]);
    page("three", &["page/shadows.js"]);
    page("bevy", &["src/lib.rs", "src/moment_shadows.wgsl"]);
}
