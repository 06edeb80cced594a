use hankel_codegen::scaffold::{Dsl, scaffold};

use crate::args::New;
use crate::failure::{Outcome, Result};
use crate::print::say;
use crate::session::own_checkout;

pub fn run(args: &New, quiet: bool) -> Result<Outcome> {
    // A DSL found in some folder above would be somebody else's code.
    let dsl =
        own_checkout().map_or_else(Dsl::published, |root| Dsl::Path(root.join("kernels/dsl")));
    let files = scaffold(&args.path, &dsl)?;
    if !quiet {
        for file in files {
            say!("{}", file.display());
        }
    }
    Ok(Outcome::Fine)
}
