use std::path::Path;

use hankel_codegen::scaffold::{Dsl, scaffold};

use crate::args::New;
use crate::failure::{Outcome, Result};

pub fn run(args: &New, quiet: bool) -> Result<Outcome> {
    let start = std::path::absolute(&args.path).unwrap_or_else(|_| args.path.clone());
    let files = scaffold(&args.path, &dsl(&start))?;
    if !quiet {
        for file in files {
            println!("{}", file.display());
        }
    }
    Ok(Outcome::Fine)
}

/// The DSL of the checkout around `start`, or of the one that this program was built from, or else
/// the published one.
fn dsl(start: &Path) -> Dsl {
    match Dsl::find(start) {
        Dsl::Version(version) => Path::new(env!("CARGO_MANIFEST_DIR"))
            .parent()
            .map(|root| root.join("kernels/dsl"))
            .filter(|dsl| dsl.join("Cargo.toml").is_file())
            .map_or(Dsl::Version(version), Dsl::Path),
        found => found,
    }
}
