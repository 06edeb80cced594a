use std::path::Path;
use std::time::Duration;

use hankel_dsl::native::describe;
use hankel_host::device::{Arithmetic, Backend, open};
use hankel_host::eval::{Job, compensated, parse_setting, select};

use crate::args::{Eval, Precision};
use crate::failure::{Failure, Outcome, Result};
use crate::print::say;
use crate::progress::Progress;
use crate::session::Session;

pub fn run(args: &Eval, quiet: bool) -> Result<Outcome> {
    let session = Session::open(args.source.manifest_path.as_deref(), quiet)?;
    let precision = args.precision.map(|p| match p {
        Precision::F32 => describe::Precision::F32,
        Precision::F64 => describe::Precision::F64,
    });
    let named = select(&session.krate, &args.kernel, precision)?;
    // Rows are read and written in more time than it takes to compute with twice the digits.
    let chosen = match args.fast {
        true => named,
        false => compensated(&session.krate, named)?,
    };
    let name = &chosen.kernel.name;
    let krate = session.native([name], Duration::from_secs(args.limit))?;
    let entry = krate.entry(name)?;
    let settings = args
        .set
        .iter()
        .map(|s| parse_setting(s))
        .collect::<std::result::Result<Vec<_>, _>>()?;
    let backend = Backend::from(args.backend);
    let words = match backend {
        Backend::Native => None,
        Backend::Vulkan => Some(session.words(&entry.kernel.name)?),
    };
    let mut device = open(backend)?;
    let arithmetic = Arithmetic::of([&entry.kernel]);
    let job = Job {
        entry,
        shader: words.as_deref().map(|words| arithmetic.shader(words)),
        settings: &settings,
        input: &args.input,
        output: &args.output,
    };
    let progress = Progress::new(quiet);
    let rows = hankel_host::eval::run(&mut *device, &job, &mut |rows| {
        progress.detail(&format!("{rows} rows"));
    })?;
    drop(progress);
    if !quiet {
        say!(
            "{rows} rows through {} on {}",
            entry.kernel.name,
            device.name()
        );
    }
    Ok(Outcome::Fine)
}

/// Runs kernels of another crate for the process that started this one.
pub fn serve(library: &Path) -> Result<Outcome> {
    hankel_host::worker::serve(library).map_err(|error| {
        Failure::machine(
            format!("the process that asked for kernels is gone: {error}"),
            None,
        )
    })?;
    Ok(Outcome::Fine)
}
