use std::io::{stdin, stdout};

use hankel_codegen::Language;
use hankel_codegen::lint::Construct;
use hankel_codegen::translate::Options;
use hankel_numerics::accuracy::table_1;
use hankel_numerics::peer::default_python;
use hankel_numerics::report::{Column, Table};
use hankel_numerics::speed::{self, Program};
use hankel_system::output;

use super::args::{Bench, BenchBounds, BenchCommand, Rival};
use super::{command_line, deliver};
use crate::args::Format;
use crate::failure::{Failure, Outcome, Result};
use crate::progress::Progress;
use crate::session::{Session, this_program};

/// The hidden command that measures for another process.
const WORKER: [&str; 2] = ["bench", "worker"];

pub fn run(args: &Bench, quiet: bool) -> Result<Outcome> {
    match &args.command {
        BenchCommand::Bounds(args) => bounds(args, quiet),
        #[cfg(feature = "frames")]
        BenchCommand::Frames(args) => super::frames::run(args, quiet),
        #[cfg(feature = "frames")]
        BenchCommand::Candidates(args) => super::candidates::run(args, quiet),
        BenchCommand::Worker => worker(),
    }
}

fn bounds(args: &BenchBounds, quiet: bool) -> Result<Outcome> {
    if let Some(folder) = &args.out {
        output::folder(folder)?;
    }
    let mut options = if args.quick {
        speed::Options::quick()
    } else {
        speed::Options::full()
    };
    if !args.n.is_empty() {
        options.orders = args.n.iter().map(|n| usize::from(*n)).collect();
        options.orders.sort_unstable();
        options.orders.dedup();
    }
    if let Some(samples) = args.samples {
        options.rows = samples;
        options.error_rows = options.error_rows.min(samples);
    }
    if let Some(rounds) = args.rounds {
        options.rounds = rounds;
    }
    options.seed = args.seed;
    options.python = args
        .against
        .map(|Rival::Diffmoments| args.python.clone().unwrap_or_else(default_python));
    options.worker = Some(Program {
        path: this_program()?,
        arguments: WORKER.map(Into::into).to_vec(),
    });

    let progress = Progress::new(quiet || args.format == Format::Json);
    progress.begin("Measuring bounds");
    let speed = speed::measure(&options, &mut |step| progress.detail(step))?;
    let accuracy = table_1::Options {
        orders: options.orders.clone(),
        samples: options.rows as u64,
        seed: options.seed,
        python: options.python.clone(),
        ..table_1::Options::default()
    };
    let accuracy = table_1::measure(&accuracy, &mut |step| progress.detail(step))?;
    drop(progress);
    let mut report = speed.report(&command_line());
    report.append(accuracy.report(&command_line()));
    match instructions(quiet) {
        Ok(table) => report.tables.push(table),
        Err(failure) => report.notes.push(format!(
            "instruction counts of shaders are left out: {failure}"
        )),
    }
    deliver(
        &report,
        args.out.as_deref(),
        "bounds",
        &[],
        args.format,
        quiet,
    )?;
    Ok(Outcome::Fine)
}

/// What the bounds' shaders cost, counted in the SPIR-V that goes with this program.
fn instructions(quiet: bool) -> Result<Table> {
    let session = Session::linked(quiet);
    let request = session.request_for(
        vec!["moment_bound*".into()],
        // What has no f64 in one language has it in the other.
        vec![Language::Spirv, Language::Wgsl, Language::Glsl],
        Options::default(),
    );
    let generated = session.generate(&request)?;
    let mut table = Table::new(
        "instructions",
        "Instructions of the shaders, counted in their SPIR-V (`hankel list`): what computes, \
         branches, loops, and what a shader compiler could neither keep in registers nor unroll",
        [
            Column::text("kernel"),
            Column::text("precision"),
            Column::count("operations"),
            Column::count("arithmetic"),
            Column::count("branches"),
            Column::count("loops"),
            Column::count("memory"),
            Column::count("total"),
            Column::count("registers"),
            Column::count("dynamic indices"),
            Column::count("loops of unknown length"),
        ],
    );
    for (name, entry) in &generated.manifest.kernels {
        let found = |construct| {
            let all = entry.findings.iter();
            all.filter(|f| f.construct == construct).count()
        };
        let cost = &entry.cost;
        table.push([
            name.as_str().into(),
            entry.precision.as_deref().unwrap_or_default().into(),
            cost.operations.into(),
            cost.arithmetic.into(),
            cost.branches.into(),
            cost.loops.into(),
            cost.memory.into(),
            cost.total.into(),
            cost.registers.into(),
            found(Construct::DynamicIndex).into(),
            found(Construct::Loop).into(),
        ]);
    }
    Ok(table)
}

/// Measures for the process that started this one.
fn worker() -> Result<Outcome> {
    speed::serve(stdin().lock(), stdout().lock()).map_err(|error| {
        Failure::machine(
            format!("the process that asked for measurements is gone: {error}"),
            None,
        )
    })?;
    Ok(Outcome::Fine)
}
