//! The matrix of languages, compilers and drivers: one kernel of each kind passes in all columns;
//! faults planted anywhere between a kernel and a driver are caught, and by whom.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::Mutex;
use std::time::Duration;

use hankel_codegen::Language::{self, Essl310, Glsl, Hlsl, Msl, Spirv, Wgsl};
use hankel_host::crates::KernelEntry;
use hankel_matrix::column::Column;
use hankel_matrix::known::Known;
use hankel_matrix::report::{Outcome, Report};
use hankel_matrix::run::{self, Request};
use hankel_matrix::subject::Subject;
use hankel_matrix::tools::Tools;
use hankel_tests::Crate;
use rspirv::binary::Assemble;
use rspirv::dr::{self, Operand};
use rspirv::spirv::{Decoration, Op};

/// One matrix at a time: each has as many processes as there are columns.
static ONE: Mutex<()> = Mutex::new(());

fn matrix(subjects: &[Subject]) -> Report {
    matrix_in(&Column::ALL, Known::default(), subjects)
}

fn matrix_in(columns: &[Column], known: Known, subjects: &[Subject]) -> Report {
    let _one = ONE.lock().unwrap_or_else(|e| e.into_inner());
    let cache = hankel_toolchain::Options::from_env().cache_folder().ok();
    let request = Request {
        columns: columns.into(),
        seed: 1,
        limit: Duration::from_secs(120),
        tools: Tools::of_cache(cache.as_deref()),
        runner: vec![PathBuf::from(env!("CARGO_BIN_EXE_hankel-tests-runner")).into()],
        cache: None,
        known,
        absent: None,
        whole: false,
        required: columns.into(),
    };
    run::run(&request, subjects, &|_| ()).unwrap_or_else(|e| panic!("{e}"))
}

fn subjects() -> Vec<Subject> {
    subjects_of(&Crate::conformance())
}

fn subjects_of(krate: &Crate) -> Vec<Subject> {
    let entries: Vec<KernelEntry> = krate.entries.iter().cloned().map(Into::into).collect();
    Subject::with_constants(
        &krate.generate(),
        &krate.request(),
        &krate.modules(),
        &entries,
    )
    .unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn every_kind_of_kernel_passes_in_every_column() {
    let known = hankel_tests::root().join("snapshots/known-conformance-differences.toml");
    let known = Known::read(&known).unwrap_or_else(|e| panic!("{e}"));
    let report = matrix_in(&Column::ALL, known, &subjects());
    assert!(report.passed, "{report}");
    let passing = report
        .kernels
        .iter()
        .flat_map(|row| row.cells.values())
        .filter(|cell| cell.outcome == Outcome::Passed)
        .count();
    assert!(passing > 190, "only {passing} cells passed\n{report}");
}

#[test]
fn iterators_and_enums_with_data_pass_in_every_column() {
    let report = matrix(&subjects_of(&Crate::iteration()));
    assert!(report.passed, "{report}");
    let cells = report.kernels.iter().flat_map(|row| row.cells.values());
    let passing = cells.filter(|cell| cell.outcome == Outcome::Passed).count();
    assert!(passing > 190, "only {passing} cells passed\n{report}");
}

/// The cells of the list differ as it says, by as much, and no cell beside them does.
#[test]
fn known_differences_of_the_built_in_kernels_are_what_the_list_says() {
    let known = Known::read(&hankel_tests::root().join("snapshots/known-differences.toml"))
        .unwrap_or_else(|e| panic!("{e}"));
    let cells = || known.difference.iter().flat_map(|d| &d.cells);
    let columns: BTreeSet<Column> = cells().map(|cell| cell.column).collect();
    let columns: Vec<Column> = columns.into_iter().collect();
    let krate = Crate::shadows();
    let entries: Vec<KernelEntry> = krate.entries.iter().cloned().map(Into::into).collect();
    let all = Subject::with_constants(
        &krate.generate(),
        &krate.request(),
        &krate.modules(),
        &entries,
    )
    .unwrap_or_else(|e| panic!("{e}"));
    let subjects: Vec<Subject> = all
        .into_iter()
        .filter(|s| cells().any(|cell| cell.kernel == s.name))
        .collect();
    let report = matrix_in(&columns, known.clone(), &subjects);
    assert!(report.passed, "{report}");
    let named = report
        .kernels
        .iter()
        .flat_map(|row| row.cells.values())
        .filter(|cell| matches!(cell.outcome, Outcome::Known { .. }))
        .count();
    assert_eq!(named, cells().count(), "{report}");
}

/// A fault in the pipeline.
struct Fault {
    name: &'static str,
    kernel: &'static str,
    /// Where it is planted.
    language: Language,
    plant: fn(Vec<u8>) -> Vec<u8>,
    /// The columns that catch it; all others pass.
    caught_by: &'static [Column],
}

/// Every column that runs a language.
const OF_SPIRV: &[Column] = &[Column::Spirv, Column::SpirvNaga, Column::SpirvSwiftshader];
const OF_WGSL: &[Column] = &[Column::Wgsl, Column::WgslDawn, Column::WgslChromium];
const OF_HLSL: &[Column] = &[Column::HlslDxc, Column::HlslGlslang];

const FAULTS: &[Fault] = &[
    Fault {
        name: "two bindings swapped",
        kernel: "gather",
        language: Wgsl,
        plant: |code| swap(code, "@binding(0)", "@binding(1)"),
        caught_by: OF_WGSL,
    },
    Fault {
        name: "two registers swapped",
        kernel: "gather",
        language: Hlsl,
        plant: |code| swap(code, "register(t0)", "register(t1)"),
        caught_by: OF_HLSL,
    },
    Fault {
        name: "two bindings swapped",
        kernel: "gather",
        language: Spirv,
        plant: |code| {
            edit(code, |module| {
                for i in &mut module.annotations {
                    if i.operands.get(1) == Some(&Operand::Decoration(Decoration::Binding)) {
                        match &mut i.operands[2] {
                            Operand::LiteralBit32(n @ 0..=1) => *n = 1 - *n,
                            _ => continue,
                        }
                    }
                }
            })
        },
        caught_by: OF_SPIRV,
    },
    Fault {
        name: "a comparison flipped",
        kernel: "checker_rgba8unorm",
        language: Msl,
        plant: |code| once(code, " == ", " != "),
        caught_by: &[Column::Msl],
    },
    Fault {
        name: "a comparison flipped",
        kernel: "downsample",
        language: Spirv,
        plant: |code| {
            edit(code, |module| {
                let flipped = module
                    .functions
                    .iter_mut()
                    .flat_map(|f| &mut f.blocks)
                    .flat_map(|b| &mut b.instructions)
                    .filter(|i| i.class.opcode == Op::UGreaterThan)
                    .take(1)
                    .map(|i| {
                        *i = dr::Instruction::new(
                            Op::ULessThan,
                            i.result_type,
                            i.result_id,
                            i.operands.clone(),
                        )
                    })
                    .count();
                assert_eq!(flipped, 1, "there is no comparison to flip");
            })
        },
        caught_by: OF_SPIRV,
    },
    Fault {
        name: "a barrier dropped",
        kernel: "scan",
        language: Msl,
        plant: |code| {
            once(
                code,
                "metal::threadgroup_barrier(metal::mem_flags::mem_threadgroup);",
                "",
            )
        },
        caught_by: &[Column::Msl],
    },
    Fault {
        name: "a barrier dropped",
        kernel: "maximum",
        language: Wgsl,
        plant: |code| once(code, "workgroupBarrier();", ""),
        caught_by: OF_WGSL,
    },
    Fault {
        name: "a sum over the subgroup made a maximum",
        kernel: "quick_sum",
        language: Wgsl,
        plant: |code| once(code, "subgroupAdd(", "subgroupMax("),
        caught_by: OF_WGSL,
    },
    Fault {
        name: "a sum over the subgroup made a maximum",
        kernel: "quick_sum",
        language: Hlsl,
        plant: |code| once(code, "WaveActiveSum(", "WaveActiveMax("),
        caught_by: OF_HLSL,
    },
    Fault {
        name: "a sum over the subgroup made a maximum",
        kernel: "quick_sum",
        language: Glsl,
        plant: |code| once(code, "subgroupAdd(", "subgroupMax("),
        caught_by: &[Column::Glsl],
    },
    Fault {
        name: "a sum over the subgroup made a maximum",
        kernel: "quick_sum",
        language: Msl,
        plant: |code| once(code, "simd_sum(", "simd_max("),
        caught_by: &[Column::Msl],
    },
    Fault {
        name: "the value of another neighbour",
        kernel: "exchanged",
        language: Msl,
        plant: |code| once(code, "simd_shuffle_down(", "simd_shuffle_up("),
        caught_by: &[Column::Msl],
    },
    Fault {
        name: "a structure's offset wrong",
        kernel: "affine",
        language: Spirv,
        plant: |code| {
            edit(code, |module| {
                let moved = module
                    .annotations
                    .iter_mut()
                    .filter(|i| i.class.opcode == Op::MemberDecorate)
                    .filter_map(|i| match &mut i.operands[..] {
                        [
                            _,
                            _,
                            Operand::Decoration(Decoration::Offset),
                            Operand::LiteralBit32(n),
                        ] if *n == 4 => Some(n),
                        _ => None,
                    })
                    .take(1)
                    .map(|n| *n = 8)
                    .count();
                assert_eq!(moved, 1, "there is no offset to move");
            })
        },
        caught_by: OF_SPIRV,
    },
    Fault {
        name: "a structure's offset wrong",
        kernel: "gather",
        language: Hlsl,
        plant: |code| once(code, "*16+8)", "*16+12)"),
        caught_by: OF_HLSL,
    },
    Fault {
        name: "a constant changed",
        kernel: "downsample",
        language: Essl310,
        plant: |code| once(code, "0.25", "0.25000003"),
        caught_by: &[Column::Essl310],
    },
    Fault {
        name: "a format not normalised",
        kernel: "checker_rgba8unorm",
        language: Hlsl,
        plant: |code| once(code, "[[vk::image_format(\"rgba8\")]] ", ""),
        caught_by: &[Column::HlslDxc],
    },
    Fault {
        name: "a format not normalised",
        kernel: "checker_rgba8unorm",
        language: Essl310,
        plant: |code| once(code, "rgba8", "rgba16f"),
        caught_by: &[Column::Essl310],
    },
    Fault {
        name: "a format not normalised",
        kernel: "checker_rgba8unorm",
        language: Glsl,
        plant: |code| once(code, "rgba8", "rgba16f"),
        caught_by: &[Column::Glsl],
    },
];

#[test]
fn planted_faults_are_caught_where_they_are() {
    let clean = subjects();
    let mut wrong = String::new();
    for fault in FAULTS {
        let mut subject = clean
            .iter()
            .find(|s| s.entry.kernel.name == fault.kernel)
            .unwrap_or_else(|| panic!("there is no kernel `{}`", fault.kernel))
            .clone();
        let code = subject
            .codes
            .get_mut(&fault.language)
            .and_then(|c| c.as_mut().ok())
            .unwrap_or_else(|| panic!("`{}` has no {}", fault.kernel, fault.language));
        code.bytes = (fault.plant)(std::mem::take(&mut code.bytes));
        let report = matrix(&[subject]);
        let caught: BTreeSet<Column> = report.kernels[0]
            .cells
            .iter()
            .filter(|(_, cell)| cell.outcome.fails())
            .map(|(column, _)| *column)
            .collect();
        if caught != fault.caught_by.iter().copied().collect() {
            wrong.push_str(&format!(
                "{} in {} of `{}`: caught by {caught:?}, not {:?}\n",
                fault.name, fault.language, fault.kernel, fault.caught_by
            ));
        }
    }
    assert!(wrong.is_empty(), "{wrong}");
}

fn text(code: Vec<u8>) -> String {
    String::from_utf8(code).expect("a text is UTF-8")
}

/// Replaces the first place.
fn once(code: Vec<u8>, from: &str, to: &str) -> Vec<u8> {
    let code = text(code);
    assert!(code.contains(from), "there is no `{from}` in\n{code}");
    code.replacen(from, to, 1).into_bytes()
}

/// Exchanges two words.
fn swap(code: Vec<u8>, a: &str, b: &str) -> Vec<u8> {
    let code = text(code);
    assert!(
        code.contains(a) && code.contains(b),
        "no `{a}`, `{b}` in\n{code}"
    );
    code.replace(a, "\0")
        .replace(b, a)
        .replace('\0', b)
        .into_bytes()
}

fn edit(code: Vec<u8>, change: impl FnOnce(&mut dr::Module)) -> Vec<u8> {
    let mut module = dr::load_bytes(code).expect("committed SPIR-V can be read");
    change(&mut module);
    module
        .assemble()
        .into_iter()
        .flat_map(u32::to_le_bytes)
        .collect()
}
