//! Runs kernels of a plug-in, whose path it is given, for the tests of this crate; users have
//! `hankel` itself for that.

use std::path::Path;
use std::process::ExitCode;

fn main() -> ExitCode {
    let library = std::env::args_os().nth(1).unwrap_or_default();
    match hankel_host::worker::serve(Path::new(&library)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}
