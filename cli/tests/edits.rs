//! Builds that follow an edit: dependency files in other build systems, and `--watch`.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use tempfile::TempDir;

const HANKEL: &str = env!("CARGO_BIN_EXE_hankel");

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .expect("cli/ lies in the repository")
}

fn kernels() -> PathBuf {
    root().join("kernels/shadows/Cargo.toml")
}

fn run(program: &str, folder: &Path, args: &[&str]) -> Output {
    let output = Command::new(program)
        .args(args)
        .current_dir(folder)
        .output()
        .unwrap_or_else(|e| panic!("{program}: {e}; `./check` installs it"));
    assert!(output.status.success(), "{program} {args:?}: {output:?}");
    output
}

fn desk() -> TempDir {
    tempfile::tempdir().expect("a temporary folder")
}

fn example(name: &str, desk: &Path) {
    let from = root().join("examples").join(name);
    for entry in fs::read_dir(from).expect("the example is committed") {
        let entry = entry.expect("it can be read");
        fs::copy(entry.path(), desk.join(entry.file_name())).expect("a copy");
    }
}

/// The text that a build system prints when it had nothing to do, and when it built.
fn follows(desk: &Path, build: &dyn Fn() -> Output) {
    let text = |output: &Output| String::from_utf8_lossy(&output.stdout).into_owned();
    let first = text(&build());
    assert!(
        first.contains("SHADERS") || first.contains("Shaders"),
        "{first}"
    );
    assert!(desk.join("shaders/wgsl/vsm.wgsl").is_file());
    let second = text(&build());
    assert!(
        !second.contains("SHADERS") && !second.contains("Shaders"),
        "{second}"
    );
}

#[test]
fn ninja_builds_when_a_source_is_newer() {
    let desk = desk();
    let desk = desk.path();
    example("ninja", desk);
    let paths = format!("hankel = {HANKEL}\nkernels = {}\n", kernels().display());
    fs::write(desk.join("paths.ninja"), paths).expect("it can be written");
    let build = || run("ninja", desk, &[]);
    follows(desk, &build);
    let inputs = run("ninja", desk, &["-t", "deps"]);
    let inputs = String::from_utf8_lossy(&inputs.stdout).into_owned();
    for file in [
        "kernels/shadows/src/bounds.rs",
        "kernels/moments/src/variance.rs",
    ] {
        assert!(inputs.contains(file), "{inputs}");
    }
}

#[test]
fn cmake_builds_when_a_source_is_newer() {
    let desk = desk();
    let desk = desk.path();
    example("cmake", desk);
    let kernels = format!("-DKERNELS={}", kernels().display());
    let hankel = format!("-DHANKEL={HANKEL}");
    run(
        "cmake",
        desk,
        &[
            "-G",
            "Unix Makefiles",
            &kernels,
            &hankel,
            "-S",
            ".",
            "-B",
            ".",
        ],
    );
    let build = || run("cmake", desk, &["--build", "."]);
    let first = build();
    assert!(first.status.success());
    let shader = desk.join("shaders/manifest.json");
    let built = |file: &Path| {
        fs::metadata(file)
            .expect("it is there")
            .modified()
            .expect("a time")
    };
    let before = built(&shader);
    build();
    assert_eq!(built(&shader), before, "nothing had changed");
    // As if every source were newer than the shaders.
    let past = std::time::SystemTime::UNIX_EPOCH + Duration::from_secs(1_000_000_000);
    let file = fs::File::options()
        .append(true)
        .open(&shader)
        .expect("it is there");
    file.set_modified(past).expect("its time can be set");
    build();
    assert!(built(&shader) >= before, "it was built again");
}

/// Stops the program whatever happens.
struct Watching(Child);

impl Drop for Watching {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn until(what: &str, mut done: impl FnMut() -> bool) {
    let start = Instant::now();
    while !done() {
        assert!(start.elapsed() < Duration::from_secs(60), "never: {what}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// With the built-in kernels, since their SPIR-V is there: an edit that changes no bytes of it is
/// not needed to see that the program waits, wakes and builds.
#[test]
fn watching_builds_after_each_edit_and_survives_errors() {
    let desk = desk();
    let desk = desk.path();
    let crate_folder = desk.join("broken");
    fs::create_dir_all(crate_folder.join("src")).expect("a folder");
    let manifest = crate_folder.join("Cargo.toml");
    fs::write(&manifest, "[package]\nname = \"broken\"\n").expect("it can be written");
    fs::write(crate_folder.join("src/lib.rs"), "one").expect("it can be written");
    let errors = desk.join("errors.txt");
    let log = fs::File::create(&errors).expect("a file");
    let child = Command::new(HANKEL)
        .args(["build", "--watch", "--manifest-path"])
        .arg(&manifest)
        .arg("--out")
        .arg(desk.join("out"))
        .stdout(Stdio::null())
        .stderr(log)
        .spawn()
        .expect("hankel starts");
    let mut watching = Watching(child);
    let failures = || {
        let text = fs::read_to_string(&errors).unwrap_or_default();
        text.matches("×").count() + text.matches("error:").count()
    };
    until("the first error is reported", || failures() > 0);
    let first = failures();
    std::thread::sleep(Duration::from_millis(300));
    fs::write(crate_folder.join("src/lib.rs"), "two").expect("it can be written");
    until("an edit makes it try again", || failures() > first);
    assert!(watching.0.try_wait().expect("it can be asked").is_none());
    assert!(!desk.join("out").exists(), "nothing was written");
}
