use std::cell::RefCell;
use std::collections::BTreeMap;

use hankel_codegen::Language;
use hankel_codegen::build::build;

use super::print_json;
use crate::args::{Build, Format};
use crate::failure::{Outcome, Result};
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
        print_json(&report);
        return Ok(Outcome::Fine);
    }
    if quiet {
        return Ok(Outcome::Fine);
    }
    println!(
        "{}: {} kernels, {} files written, {} unchanged, {} removed",
        args.out.display(),
        report.kernels,
        report.written.len(),
        report.unchanged,
        report.removed.len()
    );
    let mut missing: BTreeMap<(Language, &str), Vec<&str>> = BTreeMap::new();
    for (kernel, language, why) in &report.unsupported {
        let kernels = missing.entry((*language, why.as_str())).or_default();
        kernels.push(kernel.as_str());
    }
    for ((language, why), kernels) in missing {
        println!("no {language} of {}: {why}", kernels.join(", "));
    }
    Ok(Outcome::Fine)
}
