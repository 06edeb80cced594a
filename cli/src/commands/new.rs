use hankel_codegen::scaffold::{Dsl, scaffold};

use crate::args::New;
use crate::failure::{Outcome, Result};

pub fn run(args: &New, quiet: bool) -> Result<Outcome> {
    let start = std::path::absolute(&args.path).unwrap_or_else(|_| args.path.clone());
    let files = scaffold(&args.path, &Dsl::find(&start))?;
    if !quiet {
        for file in files {
            println!("{}", file.display());
        }
    }
    Ok(Outcome::Fine)
}
