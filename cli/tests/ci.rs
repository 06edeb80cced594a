//! The script that the GitHub Action runs, as CI runs it: in a folder that is not Hankel's, with
//! nothing in its environment but the search path.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

const HANKEL: &str = env!("CARGO_BIN_EXE_hankel");

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .expect("cli/ lies in the repository")
}

fn clean(program: impl AsRef<std::ffi::OsStr>, folder: &Path) -> Command {
    let mut command = Command::new(program);
    command
        .current_dir(folder)
        .env_clear()
        .env("PATH", std::env::var_os("PATH").expect("there is a PATH"))
        .env("HOME", folder);
    command
}

fn script(folder: &Path, variables: &[(&str, &str)]) -> Output {
    clean(root().join("integrations/ci/check.sh"), folder)
        .env("HANKEL", HANKEL)
        .env("GITHUB_STEP_SUMMARY", folder.join("summary.md"))
        .envs(variables.iter().copied())
        .output()
        .expect("bash is there")
}

#[test]
fn the_actions_script_checks_reports_and_fails() {
    let desk = tempfile::tempdir().expect("a temporary folder");
    let desk = desk.path();
    let built = clean(HANKEL, desk)
        .args(["build", "--kernel", "vsm", "--out", "committed shaders"])
        .output()
        .expect("hankel starts");
    assert!(built.status.success(), "{built:?}");
    let variables = [
        ("HANKEL_FOLDER", "committed shaders"),
        ("HANKEL_OPTIONS", "--kernel vsm"),
        ("HANKEL_MATRIX", "true"),
        ("HANKEL_MATRIX_OPTIONS", "--kernel vsm --column native"),
    ];
    let output = script(desk, &variables);
    assert!(output.status.success(), "{output:?}");
    let summary = fs::read_to_string(desk.join("summary.md")).expect("a summary");
    assert!(summary.contains("as their sources say"), "{summary}");
    assert!(summary.contains("| `vsm`"), "{summary}");
    for file in ["check.txt", "matrix.md", "matrix.json", "matrix.html"] {
        assert!(desk.join("hankel-report").join(file).is_file(), "{file}");
    }

    // A shader that somebody edited: the summary shows the difference, and the job fails.
    let shader = desk.join("committed shaders/wgsl/vsm.wgsl");
    let text = fs::read_to_string(&shader).expect("the shader is there");
    fs::write(&shader, format!("{text}// edited\n")).expect("it can be written");
    fs::remove_file(desk.join("summary.md")).expect("it is there");
    let output = script(desk, &variables[..2]);
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    let summary = fs::read_to_string(desk.join("summary.md")).expect("a summary");
    assert!(summary.contains("`hankel check` failed"), "{summary}");
    assert!(summary.contains("// edited"), "{summary}");
}

/// Every variable that the action sets is one that the script reads, and the other way round.
#[test]
fn the_action_and_its_script_know_the_same_variables() {
    let read = |name: &str| fs::read_to_string(root().join(name)).expect("it is committed");
    let names = |text: &str| -> std::collections::BTreeSet<String> {
        text.split(|c: char| !c.is_ascii_uppercase() && c != '_')
            .filter(|word| word.starts_with("HANKEL_"))
            .map(str::to_owned)
            .collect()
    };
    let (action, script) = (read("action.yml"), read("integrations/ci/check.sh"));
    assert_eq!(names(&action), names(&script));
    assert!(action.contains("integrations/ci/check.sh"));
}
