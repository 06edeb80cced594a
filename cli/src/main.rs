//! `hankel`: shaders for every language from kernels written once in Rust.
//!
//! This crate parses arguments and prints; the work is done by `hankel-codegen`, `hankel-host` and
//! `hankel-toolchain`.

mod args;
mod commands;
mod depfile;
mod failure;
mod progress;
mod session;
mod watch;

use std::process::ExitCode;

use clap::Parser;

use args::{Arguments, Command};
use failure::Outcome;

fn main() -> ExitCode {
    // clap prints help and misuse itself, and exits with 0 or 2.
    let arguments = Arguments::parse();
    let quiet = arguments.quiet;
    let outcome = match arguments.command {
        Command::Build(a) => commands::build::run(&a, quiet),
        Command::Check(a) => commands::check::run(&a, quiet),
        Command::List(a) => commands::list::run(&a, quiet),
        Command::New(a) => commands::new::run(&a, quiet),
        Command::Parity(a) => commands::parity::run(&a, quiet),
        Command::Eval(a) => commands::eval::run(&a, quiet),
        Command::Judge(a) => commands::judge::run(&a, quiet),
        Command::Render(a) => commands::render::run(&a, quiet),
        Command::Bench(a) => commands::bench::run(&a, quiet),
        Command::Stress(a) => commands::stress::run(&a, quiet),
        Command::Toolchain(a) => commands::toolchain::run(&a, quiet),
        Command::Doctor(a) => commands::doctor::run(&a),
        Command::Completions(a) => commands::completions::run(&a),
        Command::MatrixRunner { which } => commands::parity::serve(&which),
    };
    match outcome {
        Ok(Outcome::Fine) => ExitCode::SUCCESS,
        Ok(Outcome::CheckFailed) => ExitCode::from(1),
        Err(failure) => {
            let code = failure.code();
            eprintln!("{:?}", miette::Report::new(failure));
            ExitCode::from(code)
        }
    }
}
