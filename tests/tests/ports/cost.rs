//! What the ports cost beside the same in WGSL by hand: lines, operations, time.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::time::Instant;

use hankel_codegen::cost::Cost;
use hankel_codegen::finish::cost_after_optimisation;
use rspirv::binary::Assemble;
use rspirv::dr::{Module, Operand};
use rspirv::spirv::{Decoration, Op, StorageClass};

use crate::run::{Port, Ports, Prepared, Runner, Scale, Way, folder};

/// Lines of a program: not those that are empty, or comments, or for the host alone, which come last.
fn lines(text: &str) -> usize {
    let before_inputs = text.split("#[cfg(not(target_arch").next().unwrap_or(text);
    before_inputs
        .lines()
        .map(str::trim)
        .filter(|line| !line.is_empty() && !line.starts_with("//"))
        .count()
}

/// Lines of the WGSL of some kernels.
fn lines_of(texts: &BTreeMap<String, String>, kernels: &[&str]) -> usize {
    kernels.iter().map(|kernel| lines(&texts[*kernel])).sum()
}

/// Operations of WGSL that naga makes SPIR-V of, optimised.
fn cost(text: &str, name: &str) -> Cost {
    let module = naga::front::wgsl::parse_str(text)
        .unwrap_or_else(|e| panic!("{name}: {}", e.emit_to_string(text)));
    let info = naga::valid::Validator::new(
        naga::valid::ValidationFlags::all(),
        naga::valid::Capabilities::all(),
    )
    .validate(&module)
    .unwrap_or_else(|e| panic!("{name}: {e}"));
    let options = naga::back::spv::Options {
        flags: naga::back::spv::WriterFlags::empty(),
        bounds_check_policies: naga::proc::BoundsCheckPolicies::default(),
        ..Default::default()
    };
    let words = naga::back::spv::write_vec(&module, &info, &options, None)
        .unwrap_or_else(|e| panic!("{name}: {e}"));
    let mut spirv = rspirv::dr::load_words(words).unwrap_or_else(|e| panic!("{name}: {e:?}"));
    without_strides_in_workgroups(&mut spirv);
    let bytes: Vec<u8> = spirv
        .assemble()
        .into_iter()
        .flat_map(u32::to_le_bytes)
        .collect();
    cost_after_optimisation(&bytes, name).unwrap_or_else(|e| panic!("{name}: {e}"))
}

/// Takes the strides off arrays in workgroup memory: naga gives them to all arrays, and spirv-val refuses
/// them there.
fn without_strides_in_workgroups(module: &mut Module) {
    let shared: Vec<Operand> = module
        .types_global_values
        .iter()
        .filter(|i| i.class.opcode == Op::TypePointer)
        .filter(|i| i.operands[0] == Operand::StorageClass(StorageClass::Workgroup))
        .map(|i| i.operands[1].clone())
        .collect();
    let stride = Operand::Decoration(Decoration::ArrayStride);
    module
        .annotations
        .retain(|i| i.operands.get(1) != Some(&stride) || !shared.contains(&i.operands[0]));
}

/// The sums of the operations of some kernels.
fn operations(texts: &BTreeMap<String, String>, kernels: &[&str]) -> u32 {
    kernels
        .iter()
        .map(|kernel| cost(&texts[*kernel], kernel).operations)
        .sum()
}

/// Rounds of a measurement.
const ROUNDS: usize = 21;

/// Milliseconds of a port.
struct Times {
    /// Medians.
    generated: f64,
    hand: f64,
    /// The median of the rounds' ratios: what else the machine does meets both texts of a round alike.
    ratio: f64,
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut all: Vec<f64> = values.collect();
    all.sort_by(f64::total_cmp);
    all[all.len() / 2]
}

/// Times both texts in turn; each begins every other round.
fn times(ports: &Ports, port: &Port) -> Times {
    let mut both: Vec<(Runner<'_>, Prepared)> = [Way::Generated, Way::Hand]
        .into_iter()
        .map(|way| {
            let mut runner = ports.runner(way);
            let prepared = (port.prepare)(&mut runner, Scale::Large);
            (runner, prepared)
        })
        .collect();
    let wait = |runner: &mut Runner<'_>| runner.device.wait().unwrap_or_else(|e| panic!("{e}"));
    let mut rounds = Vec::new();
    for round in 0..=ROUNDS {
        let mut taken = [0.0; 2];
        for turn in 0..2 {
            let which = (round + turn) % 2;
            let (runner, prepared) = &mut both[which];
            wait(runner);
            let begin = Instant::now();
            (prepared.work)(runner);
            wait(runner);
            taken[which] = begin.elapsed().as_secs_f64() * 1e3;
        }
        // The first round compiles.
        if round > 0 {
            rounds.push(taken);
        }
    }
    Times {
        generated: median(rounds.iter().map(|t| t[0])),
        hand: median(rounds.iter().map(|t| t[1])),
        ratio: median(rounds.iter().map(|t| t[0] / t[1])),
    }
}

/// What stands in the table of a port besides its times.
fn row(ports: &Ports, port: &Port) -> String {
    let path = folder().join(format!("src/{}.rs", port.file));
    let rust = fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    format!(
        "| [{0}](src/{0}.rs) | {1} | {2} | {3} | {4} | {5} | {6} |",
        port.file,
        port.what,
        lines(&rust),
        lines_of(&ports.generated, port.kernels),
        lines_of(&ports.hand, port.kernels),
        operations(&ports.generated, port.kernels),
        operations(&ports.hand, port.kernels),
    )
}

const HEAD: &str = "\
| port | what | lines of Rust | of WGSL, generated | of WGSL, by hand | operations, generated | operations, by hand | ms, generated | ms, by hand | ratio |
| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |
";

/// Compares the table in the README with what the code gives now, but for the times;
/// `INSTA_UPDATE=always` measures, and writes it anew.
pub fn check(list: &[Port]) {
    let ports = Ports::new();
    let path = folder().join("README.md");
    let text = fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let (start, end) = ("<!-- costs -->\n", "<!-- /costs -->");
    let (before, rest) = text.split_once(start).expect("the table's first mark");
    let (stands, after) = rest.split_once(end).expect("the table's last mark");
    let rows = list.iter().map(|port| (port, row(&ports, port)));
    if std::env::var("INSTA_UPDATE").is_ok_and(|v| v == "always") {
        let mut table = HEAD.to_owned();
        for (port, row) in rows {
            let t = times(&ports, port);
            let _ = writeln!(
                table,
                "{row} {:.2} | {:.2} | {:.2} |",
                t.generated, t.hand, t.ratio
            );
        }
        println!("{table}");
        fs::write(&path, format!("{before}{start}{table}{end}{after}")).expect("it can be written");
        return;
    }
    let mut wrong = String::new();
    for (_, row) in rows {
        if !stands.lines().any(|line| line.starts_with(&row)) {
            let _ = writeln!(wrong, "+ {row}");
        }
    }
    assert!(
        wrong.is_empty() && stands.starts_with(HEAD),
        "the table of {} is not current; INSTA_UPDATE=always cargo test --release -p hankel-tests --test ports \
         writes it:\n{wrong}",
        path.display()
    );
}
