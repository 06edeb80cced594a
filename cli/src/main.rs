//! `hankel`: shaders for every language from kernels written once in Rust.
//!
//! This crate parses arguments and prints; the work is done by `hankel-codegen`, `hankel-host` and
//! `hankel-toolchain`.

mod ahead;
mod args;
mod commands;
mod depfile;
mod failure;
#[cfg(feature = "measure")]
mod measure;
mod print;
mod progress;
mod session;
mod watch;

use std::io::IsTerminal;
use std::process::ExitCode;

use clap::Parser;
use clap::error::{ContextKind, ContextValue};

use args::{Arguments, Command};
use failure::Outcome;

#[cfg(target_os = "linux")]
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> ExitCode {
    hankel_system::signals::watch();
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(help_or_misuse) => return show(&help_or_misuse),
    };
    threads();
    print::unwrapped_in_pipes();
    let quiet = arguments.quiet;
    let outcome = session::check_lanes().and_then(|()| match arguments.command {
        Command::Build(a) => commands::build::run(&a, quiet),
        Command::Check(a) => commands::check::run(&a, quiet),
        Command::Diff(a) => commands::diff::run(&a, quiet),
        Command::List(a) => commands::list::run(&a, quiet),
        Command::New(a) => commands::new::run(&a, quiet),
        Command::Parity(a) => commands::parity::run(&a, quiet),
        Command::Sanitize(a) => commands::sanitize::run(&a, quiet),
        Command::Eval(a) => commands::eval::run(&a, quiet),
        #[cfg(feature = "frames")]
        Command::Render(a) => commands::render::run(&a, quiet),
        #[cfg(feature = "frames")]
        Command::Plan(a) => commands::plan::run(&a, quiet),
        #[cfg(feature = "measure")]
        Command::Measure(command) => measure::run(&command, quiet),
        Command::Toolchain(a) => commands::toolchain::run(&a, quiet),
        Command::Doctor(a) => commands::doctor::run(&a),
        Command::Completions(a) => commands::completions::run(&a),
        Command::KernelWorker { library } => commands::eval::serve(&library),
        Command::MatrixRunner { which } => commands::parity::serve(&which),
    });
    print::finish();
    match outcome {
        Ok(Outcome::Fine) => ExitCode::SUCCESS,
        Ok(Outcome::CheckFailed) => ExitCode::from(1),
        Err(failure) => {
            let code = failure.code();
            print::note(format_args!("{:?}", miette::Report::new(failure)));
            ExitCode::from(code)
        }
    }
}

/// Makes the threads that everything parallel runs on. Where no more may be made, this one is all.
fn threads() {
    if rayon::ThreadPoolBuilder::new().build_global().is_err() {
        let alone = rayon::ThreadPoolBuilder::new()
            .num_threads(1)
            .use_current_thread();
        // If even that fails, the first parallel step says so.
        let _ = alone.build_global();
    }
}

/// Commands that are part of a Cargo feature, and the feature. Where it is there, so are they, and
/// nobody asks.
const LEFT_OUT: [(&str, &str); 5] = [
    ("plan", "frames"),
    ("render", "frames"),
    ("bench", "measure"),
    ("judge", "measure"),
    ("stress", "measure"),
];

/// Prints clap's help, or what it has against the arguments: exit codes 0 and 2.
fn show(message: &clap::Error) -> ExitCode {
    let text = message.render();
    if message.use_stderr() {
        // With colours where the terminal has them; who closed the stream wants no message.
        let _ = message.print();
        if let Some(ContextValue::String(name)) = message.get(ContextKind::InvalidSubcommand)
            && let Some((_, feature)) = LEFT_OUT.iter().find(|(command, _)| command == name)
        {
            print::note(format_args!(
                "\nThis `hankel` was built without the feature `{feature}`. With it: \
                 cargo install --path cli --features {feature}"
            ));
        }
        return ExitCode::from(2);
    }
    if std::io::stdout().is_terminal() {
        print::raw(text.ansi().to_string().as_bytes());
    } else {
        print::raw(text.to_string().as_bytes());
    }
    print::finish();
    ExitCode::SUCCESS
}
