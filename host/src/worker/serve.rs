//! The worker's side.

use std::io::{self, BufReader, BufWriter, Write};
use std::path::Path;
use std::sync::mpsc::channel;

use hankel_dsl::native::CallError;
use hankel_dsl::native::inputs::Request;
use hankel_dsl::native::plugin::Plugin;

use crate::flush;

use super::frame::{Answer, Arrived, Asked, read_header, write_header};

/// What is asked for, with all that came with it.
enum Work {
    Call(Arrived),
    Inputs { kernel: usize, request: Request },
}

/// Loads the plug-in at `library` and runs what is asked for on the standard input stream, until
/// that ends: then this process ends, too, in the middle of a call if need be.
///
/// # Errors
/// A stream that breaks.
pub fn serve(library: &Path) -> io::Result<()> {
    restrict();
    let mut answers = BufWriter::with_capacity(1 << 16, own_stdout()?);
    let plugin = match Plugin::load(library) {
        Ok(plugin) => plugin,
        Err(error) => {
            write_header(&mut answers, &Answer::Failed(error.problem))?;
            return answers.flush();
        }
    };
    write_header(&mut answers, &Answer::Kernels(plugin.kernels().to_vec()))?;
    answers.flush()?;

    let (sender, calls) = channel::<Work>();
    std::thread::Builder::new()
        .name("calls".into())
        .spawn(move || {
            let mut from = BufReader::with_capacity(1 << 16, io::stdin());
            while let Ok(Some(asked)) = read_header::<Asked>(&mut from) {
                let work = match asked {
                    Asked::Call(request) => Arrived::read(&mut from, request).map(Work::Call),
                    Asked::Inputs { kernel, request } => Ok(Work::Inputs { kernel, request }),
                };
                if !work.is_ok_and(|work| sender.send(work).is_ok()) {
                    break;
                }
            }
            std::process::exit(0);
        })?;
    // Calls run on a thread that has the stack that every thread here has.
    let runner = std::thread::Builder::new().name("kernel".into());
    let runner = runner.spawn(move || -> io::Result<()> {
        for work in calls {
            match work {
                Work::Call(mut arrived) => {
                    let index = arrived.request.kernel;
                    let flushes = arrived.request.flushes;
                    let mut call = arrived.call();
                    let result = if flushes {
                        flush::flushed(|| plugin.run(index, &mut call)).unwrap_or_else(|| {
                            let message = "its thread cannot flush subnormal numbers".into();
                            Err(CallError::Plugin { message })
                        })
                    } else {
                        plugin.run(index, &mut call)
                    };
                    drop(call);
                    match result {
                        Ok(()) => {
                            write_header(&mut answers, &Answer::Done)?;
                            arrived.write_results(&mut answers)?;
                        }
                        Err(error) => {
                            write_header(&mut answers, &Answer::Failed(error.to_string()))?;
                        }
                    }
                }
                Work::Inputs { kernel, request } => {
                    let answer = match plugin.inputs(kernel, &request) {
                        Ok(given) => Answer::Inputs(given),
                        Err(problem) => Answer::Failed(problem),
                    };
                    write_header(&mut answers, &answer)?;
                }
            }
            answers.flush()?;
        }
        Ok(())
    })?;
    runner
        .join()
        .unwrap_or_else(|panic| std::panic::resume_unwind(panic))
}

/// The standard output stream for answers alone: what the crate prints goes to the error stream.
#[cfg(unix)]
fn own_stdout() -> io::Result<std::fs::File> {
    let own = rustix::io::dup(rustix::stdio::stdout())?;
    rustix::stdio::dup2_stdout(rustix::stdio::stderr())?;
    Ok(own.into())
}

#[cfg(not(unix))]
fn own_stdout() -> io::Result<io::Stdout> {
    Ok(io::stdout())
}

/// Limits of memory, and no picture of it on disk after a crash.
fn restrict() {
    #[cfg(unix)]
    {
        use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
        for (resource, most) in [(Resource::As, super::MEMORY), (Resource::Core, 0)] {
            let there = getrlimit(resource);
            let most = there.maximum.map_or(most, |maximum| most.min(maximum));
            // A system that cannot do it has its own limits.
            let _ = setrlimit(
                resource,
                Rlimit {
                    current: Some(most),
                    maximum: Some(most),
                },
            );
        }
    }
}
