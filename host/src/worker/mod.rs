//! Kernels of other people's crates in a process of their own: one that never ends, or that takes
//! all of its stack or memory, is an outcome with a name, and the end of that process alone.
//!
//! [`Workers`] starts this program again, which then [`serve`]s: it loads the crate's plug-in and
//! runs one call after the other. Arguments and results go through pipes, see `frame`.

mod frame;
mod process;
mod serve;

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use hankel_dsl::native::call::{Culprit, Ending};
use hankel_dsl::native::describe::{Kernel, Output, Range, Role, Stage};
use hankel_dsl::native::inputs;
use hankel_dsl::native::{Arg, Call, CallError};

use hankel_system::temporary::Folder;

pub use serve::serve;

use crate::flat::{self, Number};
use process::Process;

/// How a worker is started, and what it may take.
#[derive(Clone, Debug)]
pub struct Worker {
    /// The program, usually the running one.
    pub program: PathBuf,
    /// What makes it call [`serve`] with the path that comes after these arguments.
    pub arguments: Vec<OsString>,
    /// How long one call may take.
    pub limit: Duration,
}

/// Bytes of stack of each of a worker's threads.
pub const STACK: usize = 8 << 20;

/// Bytes of address space of a worker.
pub const MEMORY: u64 = 8 << 30;

/// The processes of one plug-in: as many as there are calls at a time.
#[derive(Debug)]
pub struct Workers {
    worker: Worker,
    idle: Mutex<Vec<Process>>,
    /// A copy of the plug-in: cargo puts every build of a crate at the same path, and a process may
    /// be started later.
    library: PathBuf,
    _folder: Folder,
}

/// What a part of a call has at least while the culprit is searched, but never more than an eighth
/// of the whole call's time.
const LEAST: Duration = Duration::from_secs(2);

impl Workers {
    /// Loads a plug-in; gives the descriptions of its kernels, too.
    ///
    /// # Errors
    /// What is wrong with the plug-in, or how the process let us down, in words.
    pub fn load(worker: &Worker, library: &Path) -> Result<(Self, Vec<Kernel>), String> {
        let copied =
            Folder::within(library.parent().unwrap_or(Path::new("."))).and_then(|folder| {
                let copy = folder.join(library.file_name().unwrap_or_default());
                std::fs::copy(library, &copy)?;
                Ok((folder, copy))
            });
        let (folder, library) = copied.map_err(|e| format!("cannot copy its plug-in: {e}"))?;
        let (process, kernels) = Process::start(worker, &library)?;
        let workers = Self {
            worker: worker.clone(),
            idle: Mutex::new(vec![process]),
            library,
            _folder: folder,
        };
        Ok((workers, kernels))
    }

    /// Runs a kernel.
    ///
    /// # Errors
    /// [`CallError::Plugin`] with what the kernel reports; [`CallError::Ended`] with how its process
    /// ended, and at which element of a map, if one alone is enough.
    pub fn run(&self, index: usize, kernel: &Kernel, call: &mut Call<'_>) -> Result<(), CallError> {
        let error = match self.once(index, call, self.worker.limit) {
            Err(CallError::Ended { how, culprit: None }) => CallError::Ended {
                how,
                culprit: self.culprit(index, kernel, call),
            },
            other => return other,
        };
        Err(error)
    }

    fn once(&self, index: usize, call: &mut Call<'_>, limit: Duration) -> Result<(), CallError> {
        self.with_process(|process| process.call(index, call, limit))
    }

    /// The inputs that entry point `index` has of its own; none where it names no function that
    /// makes them.
    ///
    /// # Errors
    /// What the function reports, or how its process ended, in words.
    pub fn inputs(
        &self,
        index: usize,
        request: &inputs::Request,
    ) -> Result<Option<Vec<inputs::Given>>, String> {
        self.with_process(|process| process.inputs(index, request, self.worker.limit))
            .map_err(|error| match error {
                CallError::Ended { how, .. } => {
                    format!("the process of the function that makes them {how}")
                }
                other => other.to_string(),
            })
    }

    fn with_process<T>(
        &self,
        ask: impl FnOnce(&mut Process) -> Result<T, CallError>,
    ) -> Result<T, CallError> {
        let idle = self.idle().pop();
        let mut process = match idle {
            Some(process) => process,
            None => {
                let started = Process::start(&self.worker, &self.library);
                started.map_err(|message| CallError::Plugin { message })?.0
            }
        };
        let result = ask(&mut process);
        if !matches!(result, Err(CallError::Ended { .. })) {
            self.idle().push(process);
        }
        result
    }

    fn idle(&self) -> std::sync::MutexGuard<'_, Vec<Process>> {
        self.idle.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The element that ends a map's process, found by halving.
    fn culprit(&self, index: usize, kernel: &Kernel, call: &Call<'_>) -> Option<Culprit> {
        let sizes = element_sizes(kernel)?;
        let output = call.args.last()?;
        let (Arg::BytesMut(output), Some(&Some(size))) = (output, sizes.last()) else {
            return None;
        };
        let (mut low, mut high) = (0, output.len() / size);
        // As long as the call itself at most, but for the last few steps.
        let until = Instant::now() + self.worker.limit;
        let ends = |low: usize, high: usize| {
            let left = until.saturating_duration_since(Instant::now());
            let limit = (left / 2).max(LEAST.min(self.worker.limit / 8));
            part(call, &sizes, low, high, |call| {
                matches!(self.once(index, call, limit), Err(CallError::Ended { .. }))
            })
        };
        while high - low > 1 {
            let middle = low.midpoint(high);
            if ends(low, middle) {
                high = middle;
            } else {
                low = middle;
            }
        }
        // All elements together may have been too slow, and none of them alone.
        (high > low && ends(low, high)).then(|| Culprit {
            element: low,
            inputs: element_inputs(kernel, call, &sizes, low),
        })
    }
}

/// Bytes of an element of each argument; `None` for those that are not one for each invocation.
/// `None` altogether for what is not a map of one dimension.
fn element_sizes(kernel: &Kernel) -> Option<Vec<Option<usize>>> {
    let Stage::Compute {
        dimensions: 1,
        cooperative: false,
        range: Range::Outputs,
        ..
    } = kernel.stage
    else {
        return None;
    };
    let [Output::Buffer { layout: output, .. }] = &kernel.outputs[..] else {
        return None;
    };
    let mut sizes = Vec::new();
    for param in &kernel.params {
        match &param.role {
            Role::Element { layout, .. } => sizes.push(Some(layout.size as usize)),
            Role::Uniform { .. }
            | Role::Storage { .. }
            | Role::Texture { .. }
            | Role::Sampler { .. } => {
                sizes.push(None);
            }
            // What is told by its own index would not be the same alone.
            Role::Constant { .. } => {}
            _ => return None,
        }
    }
    sizes.push(Some(output.size as usize));
    sizes
        .iter()
        .flatten()
        .all(|&size| size > 0)
        .then_some(sizes)
}

/// Calls `run` with the elements from `low` to `high` only.
fn part<T>(
    call: &Call<'_>,
    sizes: &[Option<usize>],
    low: usize,
    high: usize,
    run: impl FnOnce(&mut Call<'_>) -> T,
) -> T {
    let mut output = Vec::new();
    let mut args = Vec::new();
    let mut room = Some(&mut output);
    for (arg, size) in call.args.iter().zip(sizes) {
        let range = |bytes: &'_ [u8]| match size {
            Some(size) => low * size..(high * size).min(bytes.len()),
            None => 0..bytes.len(),
        };
        args.push(match arg {
            Arg::Bytes(bytes) => Arg::Bytes(&bytes[range(bytes)]),
            Arg::BytesMut(bytes) => match room.take() {
                Some(room) => {
                    *room = bytes[range(bytes)].to_vec();
                    Arg::BytesMut(room)
                }
                // A map has one output.
                None => Arg::Bytes(&[]),
            },
            Arg::Texture(texture) => Arg::Texture(*texture),
            Arg::Sampler(sampler) => Arg::Sampler(*sampler),
            Arg::TextureMut(_) => Arg::Bytes(&[]),
        });
    }
    run(&mut Call {
        args,
        constants: call.constants.clone(),
        mode: call.mode,
    })
}

/// The values of one element's inputs: `depth = 0.5, moments.b1 = 0.25`.
fn element_inputs(
    kernel: &Kernel,
    call: &Call<'_>,
    sizes: &[Option<usize>],
    element: usize,
) -> String {
    let layouts = kernel.params.iter().filter_map(|param| match &param.role {
        Role::Element { layout, .. } => Some((param.name.as_str(), layout)),
        _ => None,
    });
    let buffers = call
        .args
        .iter()
        .zip(sizes)
        .filter_map(|(arg, size)| match (arg, size) {
            (Arg::Bytes(bytes), Some(size)) => bytes.get(element * size..(element + 1) * size),
            _ => None,
        });
    layouts
        .zip(buffers)
        .flat_map(|((name, layout), bytes)| {
            flat::leaves(layout).into_iter().map(move |leaf| {
                let name = if leaf.path.is_empty() || leaf.path.starts_with(['.', '[']) {
                    flat::join(name, &leaf.path)
                } else {
                    leaf.path.clone()
                };
                format!(
                    "{name} = {}",
                    Number::read(leaf.scalar, &bytes[leaf.offset..])
                )
            })
        })
        .collect::<Vec<_>>()
        .join(", ")
}

/// How a process ended, in words, from its status and what it said last.
fn ending(status: Option<std::process::ExitStatus>, words: &str) -> Ending {
    let last = words.lines().rev().find(|line| !line.trim().is_empty());
    let stack = words.contains("has overflowed its stack");
    #[cfg(unix)]
    let segment = {
        use std::os::unix::process::ExitStatusExt;
        status.and_then(|s| s.signal()) == Some(11)
    };
    #[cfg(not(unix))]
    let segment = false;
    if stack || segment {
        return Ending::Stack {
            mebibytes: (STACK >> 20) as u32,
        };
    }
    let how = status.map_or_else(|| "closed its output".into(), |s| format!("ended ({s})"));
    Ending::Crashed {
        how: match last {
            Some(last) => format!("{how}: {}", last.trim()),
            None => how,
        },
    }
}
