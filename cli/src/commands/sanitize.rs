use std::time::{Duration, Instant};

use hankel_codegen::translate::Options;
use hankel_dsl::native::Mode;
use hankel_host::crates::KernelEntry;
use hankel_host::device::NativeDevice;
use hankel_host::inputs::Case;
use hankel_host::parity::{execute, sanitize};
use serde::Serialize;

use crate::args::{Format, Sanitize};
use crate::failure::{Outcome, Result};
use crate::print::{self, say};
use crate::progress::Progress;
use crate::session::{Session, cases};

/// What is said of a kernel.
#[derive(Serialize)]
struct Checked {
    kernel: String,
    /// The first fault.
    fault: Option<String>,
    /// Seconds of one plain run of all inputs, on one thread without lanes.
    plain_seconds: f64,
    /// Seconds of one sanitized run.
    sanitized_seconds: f64,
}

pub fn run(args: &Sanitize, quiet: bool) -> Result<Outcome> {
    let manifest = args.source.manifest_path.as_deref();
    let session = Session::open(manifest, quiet)?;
    let request = session.request_for(args.kernels.clone(), Vec::new(), Options::default());
    let chosen = request.chosen()?;
    let names: Vec<String> = chosen.iter().map(|kernel| kernel.name.clone()).collect();
    let krate = session.checked(manifest, &names, Duration::from_secs(args.limit))?;
    let progress = Progress::new(quiet);
    progress.begin(&format!("Running {} kernels", names.len()));
    let mut all = Vec::new();
    for name in &names {
        progress.detail(name);
        all.push(check(krate.entry(name)?, args.seed)?);
    }
    drop(progress);
    let wrong = all.iter().filter(|it| it.fault.is_some()).count();
    match args.format {
        Format::Json => print::json(&all),
        Format::Text => {
            for it in &all {
                if let Some(fault) = &it.fault {
                    say!("{}\n  {fault}", it.kernel);
                }
            }
            say!("{} kernels: {wrong} with faults", all.len());
            let seconds = |of: fn(&Checked) -> f64| all.iter().map(of).sum::<f64>();
            let plain = seconds(|it| it.plain_seconds);
            if plain > 0.0 {
                let times = seconds(|it| it.sanitized_seconds) / plain;
                say!("A sanitized run took {times:.1} times as long as a plain one");
            }
        }
    }
    Ok(Outcome::of(wrong == 0))
}

/// Runs a kernel on all of its inputs, or up to the first fault.
fn check(entry: &KernelEntry, seed: u64) -> Result<Checked> {
    let kernel = &entry.kernel;
    let cases = cases(entry, seed)?;
    let program = entry.program(None, &[]);
    let run = |mode: Mode, case: &Case| {
        let start = Instant::now();
        let result = execute::dispatch(&mut NativeDevice::with_mode(mode), &program, case);
        (result, start.elapsed().as_secs_f64())
    };
    let mut it = Checked {
        kernel: kernel.name.clone(),
        fault: None,
        plain_seconds: 0.0,
        sanitized_seconds: 0.0,
    };
    for case in &cases {
        let mut first = None;
        let checked = sanitize::check(kernel, case, |mode, case| {
            let (result, seconds) = run(mode, case);
            first.get_or_insert(seconds);
            result
        });
        if let Err(fault) = checked {
            it.fault = Some(format!("{}: {fault}", case.called()));
            break;
        }
        it.sanitized_seconds += first.unwrap_or_default();
        it.plain_seconds += run(Mode::REFERENCE, case).1;
    }
    Ok(it)
}
