//! Interruptions: a command that is told to end (Ctrl-C, `kill`, a closed terminal) ends the
//! programs that it started and removes what it had only for itself, and then ends by that signal,
//! as if it had not been caught.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// What is to be undone.
#[derive(Debug)]
pub(crate) struct Ours {
    /// Process groups, by the number of the process that leads each.
    pub(crate) groups: BTreeSet<u32>,
    /// Files and folders.
    paths: BTreeSet<PathBuf>,
}

static OURS: Mutex<Ours> = Mutex::new(Ours {
    groups: BTreeSet::new(),
    paths: BTreeSet::new(),
});

/// Programs are started while this is held, so that none is started after the others were ended.
pub(crate) fn ours() -> MutexGuard<'static, Ours> {
    OURS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A file or folder that is removed if the command is interrupted.
pub fn remember(path: &Path) {
    ours().paths.insert(path.to_owned());
}

/// It is gone, or is to stay.
pub fn forget(path: &Path) {
    ours().paths.remove(path);
}

/// Ends all programs that were started and removes what was temporary. The caller ends this
/// process right after: nothing can be started or made meanwhile, for as long as the result lives.
fn tidy() -> MutexGuard<'static, Ours> {
    let ours = ours();
    for group in &ours.groups {
        crate::process::kill_group(*group);
    }
    for path in &ours.paths {
        // A program may need a moment to end, and writes until then.
        for _ in 0..20 {
            let removed = if path.is_dir() {
                std::fs::remove_dir_all(path)
            } else {
                std::fs::remove_file(path)
            };
            if removed.is_ok() || !path.exists() {
                break;
            }
            std::thread::sleep(Duration::from_millis(10));
        }
    }
    ours
}

/// Tidies up and ends this process at once with an exit code.
pub fn exit(code: i32) -> ! {
    let _held = tidy();
    std::process::exit(code)
}

/// Tidies up and ends this process as one whose reader is gone: by the signal that it would get
/// if it did not ignore it, without a word.
pub fn end_of_pipe() -> ! {
    let _held = tidy();
    #[cfg(unix)]
    {
        use signal_hook::consts::SIGPIPE;
        // What follows is for the case that the system refuses.
        let _ = signal_hook::low_level::emulate_default_handler(SIGPIPE);
    }
    std::process::exit(1)
}

/// From now on, an interruption tidies up. Signals that are ignored already (`nohup`) stay so.
/// For the main function: once is enough.
pub fn watch() {
    #[cfg(unix)]
    {
        use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
        let ignored = ignored();
        let wanted = [SIGHUP, SIGINT, SIGTERM];
        let wanted = wanted
            .into_iter()
            .filter(|signal| ignored & (1 << (signal - 1)) == 0);
        // Without a thread or handlers, interruptions are as they were: abrupt.
        let Ok(mut signals) = signal_hook::iterator::Signals::new(wanted) else {
            return;
        };
        let _ = std::thread::Builder::new()
            .name("signals".into())
            .spawn(move || {
                if let Some(signal) = signals.forever().next() {
                    let _held = tidy();
                    let _ = signal_hook::low_level::emulate_default_handler(signal);
                    std::process::exit(128 + signal);
                }
            });
    }
}

/// The signals that this process ignores, one bit each, where the system says it.
#[cfg(unix)]
fn ignored() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    status
        .lines()
        .find_map(|line| line.strip_prefix("SigIgn:"))
        .and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok())
        .unwrap_or(0)
}
