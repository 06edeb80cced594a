//! Shaders are never called right that no longer follow from what they were made from, wherever
//! that is. These tests compile to SPIR-V: without rust-gpu's compiler they are skipped, and say
//! so; with `HANKEL_REQUIRE_COMPILER`, which CI sets where it has one, they fail instead.

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::time::SystemTime;

use hankel_codegen::compile::{LINKED_SUBFOLDER, LINKS_AT_ONCE};
use tempfile::TempDir;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .expect("cli/ lies in the repository")
}

/// Whether there is a compiler; says so if not.
fn has_compiler() -> bool {
    let options = hankel_toolchain::Options::from_env();
    match hankel_toolchain::ensure(&options, &mut hankel_toolchain::Silent) {
        Ok(_) => true,
        Err(hankel_toolchain::Error::NotInstalled { .. }) => {
            assert!(
                std::env::var_os("HANKEL_REQUIRE_COMPILER").is_none(),
                "HANKEL_REQUIRE_COMPILER is set, but there is no rust-gpu compiler"
            );
            eprintln!("SKIPPED: there is no rust-gpu compiler here");
            false
        }
        Err(error) => panic!("{error}"),
    }
}

/// A folder outside of the repository, where a test works.
struct Desk(TempDir);

impl Desk {
    fn new() -> Self {
        Self(tempfile::tempdir().expect("a temporary folder"))
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn write(&self, name: &str, text: &str) {
        let path = self.path(name);
        fs::create_dir_all(path.parent().expect("it lies in a folder")).expect("a folder");
        fs::write(path, text).expect("the desk can be written");
    }

    fn write_with_an_old_date(&self, name: &str, text: &str) {
        self.write(name, text);
        let file = fs::File::options().write(true).open(self.path(name));
        let dated = file.and_then(|file| file.set_modified(SystemTime::UNIX_EPOCH));
        dated.expect("a date can be set");
    }

    /// `hankel` with these words, in the crate's folder, with an environment variable.
    fn hankel_with(&self, line: &str, offset: &str) -> Run {
        let output = Command::new(env!("CARGO_BIN_EXE_hankel"))
            .args(line.split_whitespace())
            .current_dir(self.path("my-kernels"))
            // What this repository has compiled for the DSL serves here, too.
            .env("CARGO_TARGET_DIR", root().join("target"))
            .env("HANKEL_TEST_OFFSET", offset)
            .output()
            .expect("hankel starts");
        Run(output)
    }

    fn hankel(&self, line: &str) -> Run {
        self.hankel_with(line, "1")
    }
}

struct Run(Output);

impl Run {
    fn out(&self) -> String {
        String::from_utf8_lossy(&self.0.stdout).into_owned()
    }

    fn code(&self, expected: i32) -> &Self {
        assert_eq!(
            self.0.status.code(),
            Some(expected),
            "{}\n{}",
            self.out(),
            String::from_utf8_lossy(&self.0.stderr)
        );
        self
    }
}

/// Makes a crate with `hankel new`, and lets it have what a test needs. Its dependencies are the
/// repository's, so that nothing is fetched.
fn new_crate() -> Desk {
    let desk = Desk::new();
    let output = Command::new(env!("CARGO_BIN_EXE_hankel"))
        .arg("new")
        .arg(desk.path("my-kernels"))
        .output()
        .expect("hankel starts");
    Run(output).code(0);
    let lock = desk.path("my-kernels/Cargo.lock");
    fs::copy(root().join("Cargo.lock"), lock).expect("a copy");
    desk
}

const KERNEL: &str = r#"
#![no_std]
use hankel_dsl::{Element, kernel};

#[path = "../../outside.rs"]
mod outside;
#[path = "../tests/table.rs"]
mod table;
mod native;
mod generated {
    include!(concat!(env!("OUT_DIR"), "/generated.rs"));
}

const INCLUDED: f32 = include!("../coefficient.txt");
const BYTES: f32 = include_bytes!("../../table.bin")[0] as f32;
const OF_SCRIPT: f32 = (env!("HANKEL_TEST_WEIGHT").as_bytes()[0] - b'0') as f32;
const OF_CALLER: f32 = (env!("HANKEL_TEST_OFFSET").as_bytes()[0] - b'0') as f32;

/// A number.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Number {
    /// The number.
    pub x: f32,
}

/// Adds everything that the crate is made from.
#[kernel(compute, threads(64))]
pub fn add(#[element] number: Number) -> Number {
    let x = number.x * INCLUDED + number.x * number.x * BYTES;
    let x = x * OF_SCRIPT + number.x * OF_CALLER;
    let x = x * outside::FACTOR + number.x * table::FACTOR;
    let x = x * native::FACTOR + number.x * percent_encoding::FACTOR;
    Number { x: x * generated::FACTOR + number.x }
}

hankel_dsl::kernels![add];
"#;

/// One crate that is made from everything that a crate can be made from. What is edited is found,
/// and only that.
#[test]
fn every_input_counts_wherever_it_is() {
    if !has_compiler() {
        return;
    }
    let desk = new_crate();
    let lock = fs::read_to_string(desk.path("my-kernels/Cargo.lock")).expect("it was copied");
    let version = lock
        .lines()
        .skip_while(|line| *line != "name = \"percent-encoding\"")
        .find_map(|line| line.strip_prefix("version = \"")?.strip_suffix('"'))
        .expect("percent-encoding is in the lock file");
    let manifest = fs::read_to_string(desk.path("my-kernels/Cargo.toml")).expect("it was made");
    let manifest = manifest.replace(
        "[dependencies]\n",
        &format!("[dependencies]\npercent-encoding = \"={version}\"\n"),
    );
    desk.write(
        "my-kernels/Cargo.toml",
        &format!("{manifest}\n[patch.crates-io]\npercent-encoding = {{ path = \"../patched\" }}\n"),
    );
    let factor = |value: u32| format!("/// A factor.\npub const FACTOR: f32 = {value}.5;\n");
    desk.write(
        "patched/Cargo.toml",
        &format!(
            "[package]\nname = \"percent-encoding\"\nversion = \"{version}\"\nedition = \"2024\"\n"
        ),
    );
    desk.write("patched/src/lib.rs", &format!("#![no_std]\n{}", factor(1)));
    desk.write("outside.rs", &factor(2));
    desk.write("table.bin", "3");
    desk.write("my-kernels/tests/table.rs", &factor(4));
    desk.write(
        "my-kernels/src/native/mod.rs",
        "mod deep;\npub use deep::FACTOR;\n",
    );
    desk.write("my-kernels/src/native/deep.rs", &factor(5));
    desk.write("my-kernels/coefficient.txt", "6.5");
    desk.write("my-kernels/weight.txt", "7");
    desk.write("my-kernels/data/a.txt", "8");
    desk.write(
        "my-kernels/build.rs",
        r#"
fn main() {
    println!("cargo::rerun-if-changed=weight.txt");
    println!("cargo::rerun-if-changed=data");
    let weight = std::fs::read_to_string("weight.txt").unwrap();
    println!("cargo::rustc-env=HANKEL_TEST_WEIGHT={}", weight.trim());
    let sum: u32 = std::fs::read_dir("data")
        .unwrap()
        .map(|it| std::fs::read_to_string(it.unwrap().path()).unwrap().trim().parse::<u32>().unwrap())
        .sum();
    let out = std::env::var("OUT_DIR").unwrap();
    std::fs::write(format!("{out}/generated.rs"), format!("pub const FACTOR: f32 = {sum}.0;")).unwrap();
}
"#,
    );
    desk.write("my-kernels/src/lib.rs", KERNEL);
    let shader = || fs::read_to_string(desk.path("my-kernels/shaders/wgsl/add.wgsl"));
    desk.hankel("build --manifest-path Cargo.toml --target wgsl --depfile rule.d")
        .code(0);
    let mut before = shader().expect("it was built");
    // Of a folder that a build script watches, its files: editing one does not change the folder.
    let rule = fs::read_to_string(desk.path("my-kernels/rule.d")).expect("it was written");
    for file in [
        "my-kernels/weight.txt",
        "my-kernels/data",
        "my-kernels/data/a.txt",
    ] {
        assert!(rule.contains(&format!("{file} ")), "no {file} in {rule}");
    }
    let built = |before: &mut String, what: &str, offset: &str| {
        let line = "build --manifest-path Cargo.toml --target wgsl";
        desk.hankel_with(line, offset).code(0);
        let now = shader().expect("it was built");
        assert_ne!(now, *before, "{what}");
        *before = now;
    };
    for (path, text) in [
        ("my-kernels/coefficient.txt", "1.25".to_owned()),
        ("table.bin", "5".into()),
        ("my-kernels/src/native/deep.rs", factor(15)),
        ("outside.rs", factor(12)),
        ("my-kernels/tests/table.rs", factor(14)),
        ("my-kernels/weight.txt", "9".into()),
        ("my-kernels/data/b.txt", "3".into()),
        ("patched/src/lib.rs", format!("#![no_std]\n{}", factor(11))),
    ] {
        desk.write(path, &text);
        built(&mut before, path, "1");
    }
    built(&mut before, "the environment", "2");
    // Nothing of it was the build's own output, and what nobody read does not count.
    desk.write("my-kernels/README.md", "Other words.\n");
    desk.write("my-kernels/src/not-a-module.rs", "Not Rust.\n");
    let check = |offset: &str| {
        let line = "check shaders --manifest-path Cargo.toml --target wgsl";
        desk.hankel_with(line, offset)
    };
    check("2").code(0);
    let out = check("1").code(1).out();
    assert!(out.contains("+++ generated/wgsl/add.wgsl"), "{out}");
    // A module that moves.
    fs::create_dir(desk.path("my-kernels/src/native/deep")).expect("a folder");
    fs::remove_file(desk.path("my-kernels/src/native/deep.rs")).expect("it is removed");
    desk.write("my-kernels/src/native/deep/mod.rs", &factor(25));
    built(&mut before, "deep/mod.rs", "2");
    // What comes with an old date is no older for that: cargo goes by dates.
    for (path, text) in [
        ("outside.rs", factor(42)),
        ("patched/src/lib.rs", format!("#![no_std]\n{}", factor(41))),
    ] {
        desk.write_with_an_old_date(path, &text);
        built(&mut before, path, "2");
    }
}

/// What runs natively, and what a kernel is said to be, are of the present source, too.
#[test]
fn native_code_follows_a_source_with_an_old_date() {
    let desk = new_crate();
    desk.write("my-kernels/rows.csv", "x\n1\n");
    let line = "eval smooth_step --manifest-path Cargo.toml --input rows.csv --output out.csv";
    let path = desk.path("my-kernels/src/lib.rs");
    let text = fs::read_to_string(&path).expect("it was made");
    let edited = text
        .replace("lit!(3.0)", "lit!(3.5)")
        .replace("pub y: R", "pub z: R")
        .replace("Step { y:", "Step { z:");
    // The column's name is the description's, the number is the native code's.
    for (text, result) in [(text, "y\n1.0\n"), (edited, "z\n1.5\n")] {
        desk.write_with_an_old_date("my-kernels/src/lib.rs", &text);
        desk.hankel(line).code(0);
        let rows = fs::read_to_string(desk.path("my-kernels/out.csv")).expect("it was written");
        assert_eq!(rows, result);
    }
}

/// The example of `hankel new --help`, and the check of what it made.
#[test]
fn a_new_crate_is_built_and_checked() {
    if !has_compiler() {
        return;
    }
    let desk = new_crate();
    let out = desk
        .hankel("build --manifest-path Cargo.toml")
        .code(0)
        .out();
    assert!(out.contains("2 kernels"), "{out}");
    let check = "check shaders --manifest-path Cargo.toml";
    desk.hankel(check).code(0);
    let out = desk
        .hankel("build --manifest-path Cargo.toml")
        .code(0)
        .out();
    assert!(out.contains(" 0 files written"), "{out}");
    // Texts name the licence, which no SPIR-V does.
    let manifest = desk.path("my-kernels/Cargo.toml");
    let text = fs::read_to_string(&manifest).expect("it was made");
    let licensed = text.replacen("[package]\n", "[package]\nlicense = \"Zlib\"\n", 1);
    desk.write("my-kernels/Cargo.toml", &licensed);
    desk.hankel(check).code(1);
    desk.hankel("build --manifest-path Cargo.toml").code(0);
    for file in fs::read_dir(desk.path("my-kernels/shaders/wgsl")).expect("it was built") {
        let file = file.expect("it can be read").path();
        let text = fs::read_to_string(&file).expect("a text");
        assert!(
            text.starts_with("// SPDX-License-Identifier: Zlib\n"),
            "{text}"
        );
    }
    desk.write("my-kernels/Cargo.toml", &text);
    desk.hankel("build --manifest-path Cargo.toml").code(0);
    // An editor's lock on a file that is being edited is no source.
    #[cfg(unix)]
    std::os::unix::fs::symlink("user@host.1:2", desk.path("my-kernels/src/.#lib.rs"))
        .expect("a dangling link");
    desk.hankel(check).code(0);
    let path = desk.path("my-kernels/src/lib.rs");
    let text = fs::read_to_string(&path).expect("it was made");
    fs::write(&path, text.replace("lit!(3.0)", "lit!(3.5)")).expect("it can be written");
    desk.hankel(check).code(1);
    // What rust-gpu refuses of rustc's optimiser is compiled without that.
    let case = root().join("tests/upstream/rust-gpu-equal-branches/case.rs");
    let case = fs::read_to_string(case).expect("the case is there");
    let uses = "#![no_std]\nuse hankel_dsl::glam::UVec2;\nuse hankel_dsl::{Buffer, kernel};\n";
    fs::write(
        &path,
        format!("{uses}{case}hankel_dsl::kernels![nearer];\n"),
    )
    .expect("it can be written");
    desk.hankel("build --manifest-path Cargo.toml --out guarded")
        .code(0);
}

const EIGHT_KERNELS: &str = r#"
#![no_std]
use hankel_dsl::{Element, kernel};

/// A number.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Number {
    /// The number.
    pub x: f32,
}

fn doubled(x: f32) -> f32 {
    x * 2.0
}

/// Doubles a number.
#[kernel(compute, threads(64))]
pub fn double(#[element] number: Number) -> Number {
    Number { x: doubled(number.x) }
}

macro_rules! more {
    ($($name:ident $by:literal)*) => {$(
        /// Multiplies a number.
        #[kernel(compute, threads(64))]
        pub fn $name(#[element] number: Number) -> Number {
            Number { x: number.x * $by }
        }
    )*};
}
more! { halve 0.5 third 0.3 fourth 0.25 fifth 0.2 sixth 0.16 seventh 0.14 eighth 0.125 }

hankel_dsl::kernels![double, halve, third, fourth, fifth, sixth, seventh, eighth];
"#;

/// Gives the crate a name that no other test has: modules are kept by it.
fn rename(desk: &Desk, name: &str) {
    for file in ["my-kernels/Cargo.toml", "my-kernels/Cargo.lock"] {
        let text = fs::read_to_string(desk.path(file)).expect("it was made");
        let new = format!("name = \"{name}\"");
        desk.write(file, &text.replacen("name = \"my-kernels\"", &new, 1));
    }
}

#[test]
fn errors_name_the_line_where_it_is_now() {
    if !has_compiler() {
        return;
    }
    let desk = new_crate();
    rename(&desk, "eight-errors");
    let line = "build --manifest-path Cargo.toml --target spirv --out out";
    for (wrong, message, at) in [
        // Found in the module that was linked, which has no lines: that of the kernel is told.
        (
            "{ let (a, b) = ([x, 1.0], [2.0, x]); let c = if x > 0.5 { &a } else { &b }; c[(x as u32 & 1) as usize] }",
            "a reference to one of several arrays",
            "#[kernel",
        ),
        // Found by the linker.
        (
            "(core::ptr::from_ref(&x) as usize as u32) as f32",
            "cannot convert pointers to integers",
            "from_ref",
        ),
    ] {
        for above in ["", "// A line more.\n"] {
            let text = EIGHT_KERNELS
                .replace("x * 2.0", wrong)
                .replace("fn doubled", &format!("{above}fn doubled"));
            desk.write("my-kernels/src/lib.rs", &text);
            let run = desk.hankel(line);
            let said = String::from_utf8_lossy(&run.0.stderr).into_owned();
            let at = text.lines().position(|it| it.contains(at));
            let place = format!("src/lib.rs:{}:", at.expect("it stands there") + 1);
            assert!(!run.0.status.success(), "{said}");
            assert!(
                said.contains(message) && said.contains(&place),
                "{place} {said}"
            );
        }
    }
    // What rust-gpu refuses of rustc's optimiser is compiled without that.
    let case = root().join("tests/upstream/rust-gpu-equal-branches/case.rs");
    let case = fs::read_to_string(case).expect("the case is there");
    let text = EIGHT_KERNELS
        .replace(
            "use hankel_dsl::{Element,",
            "use hankel_dsl::glam::UVec2;\nuse hankel_dsl::{Buffer, Element,",
        )
        .replace("kernels![", "kernels![nearer, ")
        + &case;
    desk.write("my-kernels/src/lib.rs", &text);
    desk.hankel(line).code(0);
    desk.write("my-kernels/src/lib.rs", EIGHT_KERNELS);
    desk.hankel(line).code(0);
    let noted = root().join("target").join(LINKS_AT_ONCE);
    assert!(
        !noted.exists(),
        "an author's error says nothing of the compiler"
    );
}

#[test]
fn an_edit_links_again_what_it_reaches_and_nothing_else() {
    if !has_compiler() {
        return;
    }
    let desk = new_crate();
    rename(&desk, "eight-kernels");
    let kept = root()
        .join("target")
        .join(LINKED_SUBFOLDER)
        .join("eight_kernels");
    if kept.exists() {
        fs::remove_dir_all(&kept).expect("it can be removed");
    }
    let built = |text: &str| -> (BTreeSet<OsString>, Vec<u8>) {
        desk.write("my-kernels/src/lib.rs", text);
        desk.hankel("build --manifest-path Cargo.toml --target spirv --out out")
            .code(0);
        let entries = fs::read_dir(&kept).expect("modules are kept");
        let names = entries.map(|it| it.expect("it can be read").file_name());
        let read = |name: String| fs::read(desk.path(&name)).expect("it was built");
        let texts = ["double", "halve"].map(|it| read(format!("my-kernels/out/spirv/{it}.spv")));
        (names.collect(), texts.concat())
    };
    let (first, _) = built(EIGHT_KERNELS);
    assert_eq!(first.len(), 8);
    let moved = EIGHT_KERNELS.replace("fn doubled", "// A line more.\nfn doubled");
    assert_eq!(built(&moved).0, first, "lines do not count");
    let edited = moved.replace("x * 2.0", "x + x");
    let (second, modules) = built(&edited);
    assert_eq!(second.len(), 8);
    assert_eq!(
        second.intersection(&first).count(),
        7,
        "all but `double` have stayed"
    );
    // From nothing, the same modules.
    fs::remove_dir_all(&kept).expect("it can be removed");
    built(&EIGHT_KERNELS.replace("halve 0.5", "halve 0.75"));
    fs::remove_dir_all(&kept).expect("it can be removed");
    let (third, again) = built(&edited);
    assert_eq!((third, again), (second, modules));
}
