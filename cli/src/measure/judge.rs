use hankel_numerics::judge::{DepthFunction, Judge, JudgeError, Range, table};

use super::args::Judge as Args;
use crate::failure::{Failure, Outcome, Result};
use crate::print::say;
use crate::progress::Progress;

pub fn run(args: &Args, quiet: bool) -> Result<Outcome> {
    let functions = args
        .functions
        .iter()
        .map(|name| name.parse())
        .collect::<std::result::Result<Vec<DepthFunction>, JudgeError>>()?;
    let judge = Judge::new(&functions, range(&args.range)?)?;
    let progress = Progress::new(quiet);
    let rows = table(&judge, &args.input, &args.output, &mut |rows| {
        progress.detail(&format!("{rows} rows"));
    })?;
    drop(progress);
    if !quiet {
        say!("{rows} rows judged by a linear programme");
    }
    Ok(Outcome::Fine)
}

/// Reads `LOW,HIGH` or `line`.
fn range(text: &str) -> Result<Range> {
    if text.trim() == "line" {
        return Ok(Range::Line);
    }
    let ends: Option<Vec<f64>> = text.split(',').map(|x| x.trim().parse().ok()).collect();
    match ends.as_deref() {
        Some(&[low, high]) => Ok(Range::Interval { low, high }),
        _ => Err(Failure::input(
            format!("--range {text} is not a range of depths"),
            "write two numbers with a comma between, as in --range 0,1; or --range line",
        )),
    }
}
