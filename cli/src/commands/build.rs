use std::cell::RefCell;

use hankel_codegen::build::build;

use crate::args::{Build, Format};
use crate::failure::{Outcome, Result};
use crate::print::{self, say};
use crate::session::Session;

pub fn run(args: &Build, quiet: bool) -> Result<Outcome> {
    let session = Session::open(args.generate.source.manifest_path.as_deref(), quiet)?;
    let request = session.request(&args.generate)?;
    // `build` knows codegen's errors only: one of this crate's waits here meanwhile.
    let failure = RefCell::new(None);
    let result = build(&request, &args.out, args.force, || {
        session.modules().map_err(|e| {
            let stale = hankel_codegen::Error::Stale {
                reason: e.to_string(),
            };
            *failure.borrow_mut() = Some(e);
            stale
        })
    });
    if let Some(failure) = failure.into_inner() {
        return Err(failure);
    }
    let report = result?;
    if args.format == Format::Json {
        print::json(&report);
        return Ok(Outcome::Fine);
    }
    if quiet {
        return Ok(Outcome::Fine);
    }
    say!(
        "{}: {} kernels, {} files written, {} unchanged, {} removed",
        args.out.display(),
        report.kernels,
        report.written.len(),
        report.unchanged,
        report.removed.len()
    );
    if !report.unsupported.is_empty() {
        say!(
            "{} shaders have no form in a language; the manifest says why (for example {} in {}: {})",
            report.unsupported.len(),
            report.unsupported[0].0,
            report.unsupported[0].1,
            report.unsupported[0].2
        );
    }
    Ok(Outcome::Fine)
}
