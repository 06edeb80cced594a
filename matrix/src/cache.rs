//! Results, kept by what they follow from: the code, the inputs and the reference's results, what
//! may differ, the versions of compilers and drivers, and this program itself.

use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use hankel_codegen::files::{sha256, write_whole};
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::column::Column;
use crate::machine::Machine;
use crate::tools::Status;

/// Another program's results are removed when none was added for so long: 30 days.
const KEPT: Duration = Duration::from_secs(30 * 24 * 60 * 60);

/// The folder of kept results.
#[derive(Debug)]
pub struct Cache {
    /// This program's.
    folder: Option<PathBuf>,
    /// SHA-256 of the program that runs things.
    program: String,
}

impl Cache {
    /// A cache in `folder`, or one that keeps nothing. `runner` is the program that runs things.
    #[must_use]
    pub fn new(folder: Option<&Path>, runner: &[OsString]) -> Self {
        let program = runner.first().and_then(|p| fs::read(p).ok());
        // Without the program's hash, what it does could change unseen.
        let all = folder
            .filter(|_| program.is_some())
            .map(|f| f.join("matrix"));
        let program = sha256(&program.unwrap_or_default());
        let folder = all.map(|all| {
            let own = all.join(&program[..16]);
            prune(&all, &own);
            own
        });
        Self { folder, program }
    }

    /// The name of what follows from `what`; none for what has no JSON form, which is not kept.
    #[must_use]
    pub fn key(&self, what: &impl Serialize) -> Option<String> {
        let text = serde_json::to_string(&(&self.program, what)).ok()?;
        Some(sha256(text.as_bytes()))
    }

    /// What was kept under a name.
    #[must_use]
    pub fn get<T: DeserializeOwned>(&self, key: &str) -> Option<T> {
        let bytes = fs::read(self.folder.as_ref()?.join(format!("{key}.json"))).ok()?;
        serde_json::from_slice(&bytes).ok()
    }

    /// Keeps something. What cannot be kept is made again next time.
    pub fn put(&self, key: &str, what: &impl Serialize) {
        let Some(folder) = &self.folder else { return };
        if let Ok(text) = serde_json::to_vec(what)
            && fs::create_dir_all(folder).is_ok()
        {
            let _ = write_whole(&folder.join(format!("{key}.json")), &text);
        }
    }

    /// The name under which the device is kept that ran a column.
    #[must_use]
    pub fn device_key(&self, column: Column, tools: &[Status]) -> Option<String> {
        let own: Vec<&Status> = column.statuses(tools).collect();
        self.key(&("device", column, own, Machine::this()))
    }
}

/// Removes what programs have left that are no longer used. What cannot be removed stays.
fn prune(all: &Path, own: &Path) {
    let now = SystemTime::now();
    for entry in fs::read_dir(all).into_iter().flatten().flatten() {
        let age = entry
            .metadata()
            .and_then(|about| about.modified())
            .map(|then| now.duration_since(then).unwrap_or_default());
        if age.is_ok_and(|age| age > KEPT) && entry.path() != own {
            let _ = fs::remove_dir_all(entry.path());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_has_no_name_is_not_kept() {
        struct Broken;
        impl Serialize for Broken {
            fn serialize<S: serde::Serializer>(&self, _: S) -> Result<S::Ok, S::Error> {
                Err(serde::ser::Error::custom("on purpose"))
            }
        }
        let cache = Cache::new(None, &[]);
        assert_eq!(cache.key(&Broken), None);
        assert_ne!(cache.key(&1), cache.key(&2));
    }

    #[test]
    fn what_another_program_left_goes_after_a_month() {
        let folder = tempfile::tempdir().unwrap();
        let program = |name: &str| {
            let path = folder.path().join(name);
            fs::write(&path, name).unwrap();
            vec![path.into_os_string()]
        };
        let (old, new) = (program("old"), program("new"));
        let open = |program: &[OsString]| Cache::new(Some(folder.path()), program);
        let key = open(&old).key(&"a question").unwrap();
        open(&old).put(&key, &"an answer");
        assert_eq!(open(&old).get(&key), Some("an answer".to_owned()));
        // Another program asks otherwise, and finds nothing under the same name.
        assert_ne!(open(&new).key(&"a question"), Some(key.clone()));
        assert_eq!(open(&new).get::<String>(&key), None);
        assert!(open(&old).get::<String>(&key).is_some());

        let left = open(&old).folder.unwrap();
        let then = SystemTime::now() - KEPT - Duration::from_secs(60);
        fs::File::open(&left).unwrap().set_modified(then).unwrap();
        assert!(open(&old).get::<String>(&key).is_some(), "one's own stay");
        open(&new);
        assert!(!left.exists());
    }
}
