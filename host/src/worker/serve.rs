//! The worker's side.

use std::io::{self, BufReader, BufWriter, Write};
use std::path::Path;
use std::sync::mpsc::channel;

use hankel_dsl::native::plugin::Plugin;

use super::frame::{Answer, Arrived, Request, read_header, write_header};

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

    let (sender, calls) = channel::<Arrived>();
    std::thread::Builder::new()
        .name("calls".into())
        .spawn(move || {
            let mut from = BufReader::with_capacity(1 << 16, io::stdin());
            while let Ok(Some(request)) = read_header::<Request>(&mut from)
                && let Ok(arrived) = Arrived::read(&mut from, request)
                && sender.send(arrived).is_ok()
            {}
            std::process::exit(0);
        })?;
    // Calls run on a thread that has the stack that every thread here has.
    let runner = std::thread::Builder::new().name("kernel".into());
    let runner = runner.spawn(move || -> io::Result<()> {
        for mut arrived in calls {
            let index = arrived.request.kernel;
            let result = plugin.run(index, &mut arrived.call());
            match result {
                Ok(()) => {
                    write_header(&mut answers, &Answer::Done)?;
                    arrived.write_results(&mut answers)?;
                }
                Err(error) => write_header(&mut answers, &Answer::Failed(error.to_string()))?,
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
