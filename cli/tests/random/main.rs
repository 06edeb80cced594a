//! Kernels that are made at random, compiled and run on every way that kernels go; all must give the same
//! bits. What differs is reduced to the smallest kernel that still does, and printed as Rust.
//!
//! ```sh
//! HANKEL_FUZZ_SECONDS=60 cargo test --release -p hankel --test random -- --ignored --nocapture
//! HANKEL_RANDOM_COLUMNS=all HANKEL_FUZZ_SECONDS=36000 cargo test … # the whole matrix
//! HANKEL_RANDOM_SEED=7 cargo test … # other kernels: the first one's seed
//! ```
//!
//! Without `HANKEL_RANDOM_COLUMNS`, they run natively and through a Vulkan driver as SPIR-V, as SPIR-V
//! through naga, and as WGSL. The columns may also be named, with commas between them. Needs rust-gpu's
//! compiler; one run of it compiles many kernels.

mod program;
mod reduce;
mod write;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use program::{Floats, Program};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .expect("cli/ lies in the repository")
}

/// Kernels that are compiled together.
const BATCH: u64 = 32;

/// Smaller kernels that are tried together.
const CANDIDATES: usize = 40;

/// Most reductions of one kernel.
const ROUNDS: usize = 40;

/// How a kernel went wrong: by column, the outcome's name and what was said.
type Problems = BTreeMap<String, (String, String)>;

/// What came of some kernels.
#[derive(Default)]
struct Outcomes {
    /// Of each kernel, in order.
    problems: Vec<Problems>,
    /// Cells that agree with the reference.
    passed: usize,
    /// Cells whose language does not have the kernel, by the reason.
    absent: BTreeMap<String, usize>,
}

/// Where kernels are compiled and run.
struct Bench {
    folder: PathBuf,
    columns: Vec<String>,
}

impl Bench {
    fn new(name: &str, columns: Vec<String>) -> Self {
        // The same each time, so that what it depends on is compiled once.
        let folder = root().join("target/tmp").join(name);
        fs::create_dir_all(folder.join("src")).expect("a folder");
        let dsl = root().join("kernels/dsl");
        let manifest = format!(
            "[package]\nname = \"{name}\"\nversion = \"0.1.0\"\nedition = \"2024\"\n\n\
             [lib]\ncrate-type = [\"lib\", \"dylib\"]\n\n\
             [dependencies]\nhankel-dsl = {{ path = {dsl:?} }}\n\n[workspace]\n"
        );
        fs::write(folder.join("Cargo.toml"), manifest).expect("a file");
        fs::copy(root().join("Cargo.lock"), folder.join("Cargo.lock")).expect("a copy");
        Self { folder, columns }
    }

    /// Runs kernels; if they cannot be compiled together, in halves.
    fn run(&self, programs: &[&Program], columns: &[String]) -> Outcomes {
        match self.report(&write::library(programs), columns) {
            Ok(report) => Outcomes::of(&report, programs.len()),
            Err(words) if programs.len() == 1 => Outcomes {
                problems: vec![[("compiler".to_owned(), ("refused".to_owned(), words))].into()],
                ..Outcomes::default()
            },
            Err(_) => {
                let (first, second) = programs.split_at(programs.len() / 2);
                let mut all = self.run(first, columns);
                let more = self.run(second, columns);
                all.problems.extend(more.problems);
                all.passed += more.passed;
                for (reason, count) in more.absent {
                    *all.absent.entry(reason).or_default() += count;
                }
                all
            }
        }
    }

    /// The matrix's report; otherwise what the command said.
    fn report(&self, library: &str, columns: &[String]) -> Result<serde_json::Value, String> {
        fs::write(self.folder.join("src/lib.rs"), library).expect("a file");
        let file = self.folder.join("report.json");
        let _ = fs::remove_file(&file);
        let mut command = Command::new(env!("CARGO_BIN_EXE_hankel"));
        command
            .args(["parity", "--quiet", "--matrix", "--no-cache", "--json"])
            .arg(&file)
            .arg("--manifest-path")
            .arg(self.folder.join("Cargo.toml"))
            .env("CARGO_TARGET_DIR", root().join("target"));
        for column in columns {
            command.args(["--column", column]);
        }
        let output = command.output().expect("hankel starts");
        match fs::read(&file).map(|bytes| serde_json::from_slice(&bytes)) {
            Ok(Ok(report)) => Ok(report),
            _ => Err(String::from_utf8_lossy(&output.stderr).into_owned()),
        }
    }

    /// The smallest kernel found that goes wrong as `program` does, and how it does.
    fn reduce(&self, program: &Program, problems: &Problems) -> (Program, Problems) {
        let columns: Vec<String> = problems.keys().cloned().collect();
        let run = |all: &[&Program]| match columns.iter().any(|c| c == "compiler") {
            true => self.run(all, &["native".to_owned(), "spirv".to_owned()]),
            false => self.run(all, &columns),
        };
        let same = |other: &Problems| {
            let alike = |(column, (outcome, _)): (&String, &(String, String))| {
                other.get(column).is_some_and(|it| it.0 == *outcome)
            };
            problems.iter().any(alike)
        };
        let (mut least, mut how) = (program.clone(), problems.clone());
        for _ in 0..ROUNDS {
            let steps = reduce::steps(&least);
            let mut found = None;
            // The largest steps first: some of them, then some of all others.
            for some in steps.chunks(CANDIDATES).take(6) {
                let all: Vec<&Program> = some.iter().collect();
                let outcomes = run(&all).problems;
                let wrong = some.iter().zip(outcomes).find(|(_, it)| same(it));
                if let Some((smaller, it)) = wrong {
                    found = Some((smaller.clone(), it));
                    break;
                }
            }
            match found {
                Some(smaller) => (least, how) = smaller,
                None => break,
            }
        }
        (least, how)
    }
}

impl Outcomes {
    fn of(report: &serde_json::Value, kernels: usize) -> Self {
        let mut all = Self {
            problems: vec![Problems::new(); kernels],
            ..Self::default()
        };
        let rows = report["kernels"].as_array().expect("rows");
        for row in rows {
            let name = row["kernel"].as_str().unwrap_or_default();
            let number: usize = name
                .trim_start_matches('k')
                .parse()
                .expect("a kernel's name");
            let cells = row["cells"].as_object().expect("cells");
            for (column, cell) in cells {
                let outcome = &cell["outcome"];
                let kind = outcome["kind"].as_str().unwrap_or_default();
                match kind {
                    "passed" => all.passed += 1,
                    "inexpressible" | "lacking" => {
                        let reason = outcome["reason"].as_str().or(outcome["what"].as_str());
                        let reason = format!("{column}: {}", reason.unwrap_or_default());
                        *all.absent.entry(reason).or_default() += 1;
                    }
                    "not_installed" => panic!("{column} is not installed: {outcome}"),
                    _ => {
                        let words = match kind {
                            "differs" => cell["found"].to_string(),
                            _ => outcome.to_string(),
                        };
                        all.problems[number].insert(column.clone(), (kind.to_owned(), words));
                    }
                }
            }
        }
        all
    }
}

/// Whether there is rust-gpu's compiler.
fn has_compiler() -> bool {
    let options = hankel_toolchain::Options::from_env();
    match hankel_toolchain::ensure(&options, &mut hankel_toolchain::Silent) {
        Ok(_) => true,
        Err(error) => {
            assert!(
                std::env::var_os("HANKEL_REQUIRE_COMPILER").is_none(),
                "HANKEL_REQUIRE_COMPILER is set: {error}"
            );
            eprintln!("SKIPPED: {error}");
            false
        }
    }
}

fn variable<T: std::str::FromStr>(name: &str) -> Option<T> {
    std::env::var(name).ok()?.parse().ok()
}

#[test]
#[ignore = "takes as long as it is let: HANKEL_FUZZ_SECONDS"]
fn random_kernels_give_the_same_bits_everywhere() {
    if !has_compiler() {
        return;
    }
    let start = Instant::now();
    let limit = Duration::from_secs(variable("HANKEL_FUZZ_SECONDS").unwrap_or(1));
    let first: u64 = variable("HANKEL_RANDOM_SEED").unwrap_or(1);
    let columns = std::env::var("HANKEL_RANDOM_COLUMNS").unwrap_or_default();
    let columns: Vec<String> = match columns.as_str() {
        "" => ["native", "native-simd", "spirv", "spirv-naga", "wgsl"]
            .map(str::to_owned)
            .to_vec(),
        "all" => Vec::new(),
        some => some.split(',').map(str::to_owned).collect(),
    };
    let bench = Bench::new("random-kernels", columns);
    let (mut kernels, mut cells) = (0, 0);
    let mut absent: BTreeMap<String, usize> = BTreeMap::new();
    let mut seen: Vec<(Program, Problems)> = Vec::new();
    loop {
        let seeds = first + kernels..first + kernels + BATCH;
        let programs: Vec<Program> = seeds.map(program::program).collect();
        let all: Vec<&Program> = programs.iter().collect();
        let outcomes = bench.run(&all, &bench.columns);
        kernels += BATCH;
        cells += outcomes.passed;
        for (reason, count) in outcomes.absent {
            *absent.entry(reason).or_default() += count;
        }
        for (program, problems) in programs.iter().zip(outcomes.problems) {
            if !problems.is_empty() {
                seen.push((program.clone(), problems));
            }
        }
        if start.elapsed() >= limit || seen.len() >= 8 {
            break;
        }
    }
    println!(
        "{kernels} random kernels from seed {first} in {:.0} s: {cells} cells agree to the bit, {} kernels do not",
        start.elapsed().as_secs_f64(),
        seen.len()
    );
    for (reason, count) in &absent {
        println!("  {count} kernels not in {reason}");
    }
    let mut report = String::new();
    for (program, problems) in &seen {
        let (least, how) = bench.reduce(program, problems);
        report += &format!(
            "seed {}, reduced:\n{}",
            program.seed,
            write::library(&[&least])
        );
        for (column, (outcome, words)) in how {
            report += &format!("{column}: {outcome}: {words}\n");
        }
    }
    assert!(seen.is_empty(), "{report}");
}

/// What the generator found in rust-gpu is still there, and its message says what to write.
#[test]
#[ignore = "compiles with rust-gpu"]
fn rust_gpu_refuses_two_arms_that_do_nothing() {
    if !has_compiler() {
        return;
    }
    let case = root().join("tests/upstream/rust-gpu-equal-arms/case.rs");
    let case = fs::read_to_string(case).expect("the case");
    let library = format!("//! A case.\n#![no_std]\nuse hankel_dsl::*;\n{case}\nkernels![arms];\n");
    let columns = ["native".to_owned(), "spirv".to_owned()];
    let bench = Bench::new("equal-arms", columns.to_vec());
    let words = bench
        .report(&library, &columns)
        .expect_err("mended: programs may have arms that give no value, `Stmt::Match`");
    assert!(words.contains("write `if`"), "{words}");
}

/// What rust-gpu's linker loses is kept by copies, `codegen/src/spirv/assigned.rs`.
#[test]
#[ignore = "compiles with rust-gpu"]
fn choices_in_inner_loops_are_kept() {
    if !has_compiler() {
        return;
    }
    let case = root().join("tests/upstream/rust-gpu-lost-choice/case.rs");
    let case = fs::read_to_string(case).expect("the case");
    let library = format!(
        "//! A case.\n#![no_std]\nuse hankel_dsl::glam::{{UVec3, UVec4}};\nuse hankel_dsl::*;\n{case}\nkernels![wrong, vector];\n"
    );
    let columns = ["native".to_owned(), "spirv".to_owned()];
    let bench = Bench::new("lost-choice", columns.to_vec());
    let report = bench.report(&library, &columns).expect("it compiles");
    let report = report.to_string();
    assert!(!report.contains(r#""kind":"differs""#), "{report}");
    assert!(report.contains(r#""kind":"passed""#), "{report}");
}

#[test]
fn a_seed_makes_one_program_and_others_others() {
    let texts: Vec<String> = (0..50)
        .map(|seed| write::library(&[&program::program(seed)]))
        .collect();
    for (seed, text) in texts.iter().enumerate() {
        assert_eq!(*text, write::library(&[&program::program(seed as u64)]));
    }
    let mut different = texts.clone();
    different.sort();
    different.dedup();
    assert_eq!(different.len(), texts.len());
}

#[test]
fn programs_have_all_that_there_is() {
    let texts: String = (0..400)
        .map(|seed| write::library(&[&program::program(seed)]))
        .collect();
    for part in [
        "while n",
        "loop {",
        "for v",
        "match ",
        "return ",
        "break;",
        "continue;",
        "counters.add(",
        "own.set(",
        "mail.set(",
        "barrier()",
        "exact",
        " & 3) as usize] = ",
        ") = (v",
        "f1(",
        "Vec3::new(",
        "swap_bytes",
        "settings.keys",
        "table.get(",
        "floats.get(",
    ] {
        assert!(texts.contains(part), "no program has `{part}`");
    }
    let rounded = (0..400).filter(|seed| program::program(*seed).floats == Floats::Rounded);
    assert!((60..240).contains(&rounded.count()));
}

#[test]
fn steps_are_smaller_and_declare_what_they_use() {
    for seed in 0..60 {
        let program = program::program(seed);
        assert!(reduce::is_closed(&program), "seed {seed}");
        let steps = reduce::steps(&program);
        assert!(!steps.is_empty());
        for step in steps {
            assert!(step.size() < program.size());
            assert!(
                reduce::is_closed(&step),
                "seed {seed}: {}",
                write::library(&[&step])
            );
        }
    }
}

/// Reduction finds the one operation that matters.
#[test]
fn reduction_ends_with_what_matters() {
    let text = |it: &Program| write::library(&[it]);
    let matters = |it: &Program| text(it).contains(".swap_bytes()") && text(it).contains("while n");
    let mut program = (0..2000)
        .map(program::program)
        .find(matters)
        .expect("some program has both");
    while let Some(smaller) = reduce::steps(&program).into_iter().find(matters) {
        program = smaller;
    }
    assert!(program.size() <= 8, "{}", text(&program));
}
