use clap::CommandFactory;

use crate::args::{Arguments, Completions};
use crate::failure::{Outcome, Result};

pub fn run(args: &Completions) -> Result<Outcome> {
    let mut command = Arguments::command();
    clap_complete::generate(args.shell, &mut command, "hankel", &mut std::io::stdout());
    Ok(Outcome::Fine)
}
