//! Commands in the documentation are commands that there are: every subcommand and option in a block
//! of shell text is in the program's help.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

/// The help of a subcommand, as `bench bounds`.
fn help(command: &str) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_hankel"))
        .args(command.split_whitespace())
        .arg("--help")
        .output()
        .expect("hankel runs");
    assert!(
        output.status.success(),
        "hankel {command} --help: {}",
        String::from_utf8_lossy(&output.stderr)
    );
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// Command lines in blocks of shell text, with the page and line that they stand in.
fn commands() -> Vec<(String, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .expect("cli/ lies in the repository");
    let mut pages = vec![root.join("README.md"), root.join("CONTRIBUTING.md")];
    for entry in std::fs::read_dir(root.join("docs")).expect("docs/ can be listed") {
        let path = entry.expect("an entry").path();
        if path.extension().is_some_and(|e| e == "md") {
            pages.push(path);
        }
    }
    let mut commands = Vec::new();
    for page in pages {
        let text = std::fs::read_to_string(&page).expect("the page can be read");
        let mut in_shell = false;
        for (i, line) in text.lines().enumerate() {
            if let Some(language) = line.trim_start().strip_prefix("```") {
                in_shell = language == "sh";
                continue;
            }
            let line = line.split(" #").next().unwrap_or_default().trim();
            let line = line.strip_prefix("target/release/").unwrap_or(line);
            if in_shell && let Some(command) = line.strip_prefix("hankel ") {
                let place = format!("{}:{}", page.display(), i + 1);
                commands.push((place, command.to_owned()));
            }
        }
    }
    commands
}

#[test]
fn every_command_in_the_documentation_exists() {
    let commands = commands();
    assert!(commands.len() > 10, "{commands:?}");
    let mut helps = BTreeMap::new();
    for (place, command) in commands {
        let words: Vec<&str> = command.split_whitespace().collect();
        let deep = ["bench", "toolchain"].contains(&words[0]);
        let name = words[..if deep { 2 } else { 1 }].join(" ");
        let help = helps.entry(name.clone()).or_insert_with(|| help(&name));
        for option in words.iter().filter(|word| word.starts_with("--")) {
            let option = option.split('=').next().unwrap_or_default();
            let known = help
                .split(|c: char| !(c.is_ascii_alphanumeric() || c == '-'))
                .any(|word| word == option);
            assert!(known, "{place}: `hankel {name}` has no option {option}");
        }
    }
}
