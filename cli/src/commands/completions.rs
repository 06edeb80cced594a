use clap::CommandFactory;

use crate::args::{Arguments, Completions};
use crate::failure::{Outcome, Result};
use crate::print;

pub fn run(args: &Completions) -> Result<Outcome> {
    let mut command = Arguments::command();
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut command, "hankel", &mut script);
    print::raw(&script);
    Ok(Outcome::Fine)
}
