use std::collections::BTreeMap;

use hankel_codegen::Language;
use hankel_codegen::build::{build, check_output};

use super::print_json;
use crate::args::{Build, Format};
use crate::failure::{Outcome, Result};
use crate::session::Session;

pub fn run(args: &Build, quiet: bool) -> Result<Outcome> {
    check_output(&args.out)?;
    let session = Session::open(args.generate.source.manifest_path.as_deref(), quiet)?;
    let request = session.request(&args.generate)?;
    // What is wrong with the request is told before anything is compiled.
    request.chosen()?;
    let report = build(&request, &session.modules()?, &args.out, args.force)?;
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
