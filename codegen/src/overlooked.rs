//! Changes that cargo overlooks. It goes by dates: a file with other contents than before, and a date before
//! the last build (`cp -p`, `rsync -t`, an unpacked archive, a clock that was set back), is not compiled again.

use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use serde::{Deserialize, Serialize};

use crate::error::{During, Error, Result};
use crate::files::{read, sha256, write_whole};
use crate::inputs::Inputs;

/// Size of the largest record.
const MOST_BYTES: u64 = 64 << 20;

/// What a crate's last build in a target folder was made from, and when it began.
#[derive(Debug, Serialize, Deserialize)]
struct Made {
    inputs: Inputs,
    began: SystemTime,
}

/// Where that is kept.
#[derive(Debug)]
pub struct LastBuild {
    target_dir: PathBuf,
    file: PathBuf,
}

impl LastBuild {
    /// That of the crate at `manifest` in `target_dir`.
    pub fn of(manifest: &Path, target_dir: &Path) -> Self {
        let crate_of = sha256(manifest.as_os_str().as_encoded_bytes());
        Self {
            file: target_dir.join(format!("hankel-inputs-{crate_of}.json")),
            target_dir: target_dir.to_owned(),
        }
    }

    /// Has cargo compile everything again if it would overlook a change of the crate in `folder`.
    pub fn forget_if_overlooked(&self, folder: &Path) -> Result<()> {
        let Ok(text) = read(&self.file, MOST_BYTES) else {
            return Ok(());
        };
        // What another version wrote says nothing.
        let Ok(made) = serde_json::from_slice::<Made>(&text) else {
            return Ok(());
        };
        if made.overlooked(folder) {
            self.forget()?;
        }
        Ok(())
    }

    /// Keeps what a build that began at `began` was made from.
    pub fn record(&self, inputs: &Inputs, began: SystemTime) -> Result<()> {
        let made = Made {
            inputs: inputs.clone(),
            began,
        };
        let text = serde_json::to_vec(&made).map_err(|error| Error::Io {
            action: "write",
            path: self.file.clone(),
            source: error.into(),
        })?;
        write_whole(&self.file, &text)
    }

    /// Removes cargo's fingerprints: those for this machine, and those for the target.
    fn forget(&self) -> Result<()> {
        let folders = std::fs::read_dir(&self.target_dir).during("list", &self.target_dir)?;
        let targets = folders.filter_map(|it| Some(it.ok()?.path()));
        for folder in targets.chain([self.target_dir.clone()]) {
            let fingerprints = folder.join("release/.fingerprint");
            match std::fs::remove_dir_all(&fingerprints) {
                Err(error)
                    if !matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) =>
                {
                    return Err(error).during("remove", &fingerprints);
                }
                _ => {}
            }
        }
        Ok(())
    }
}

impl Made {
    fn overlooked(&self, folder: &Path) -> bool {
        type Recorded = BTreeMap<String, Option<String>>;
        // Cargo says what is wrong with what cannot be read.
        let Ok(now) = Inputs::take(folder, &self.inputs.names()) else {
            return false;
        };
        let old = |one: Inputs| one.newest(folder).is_some_and(|date| date <= self.began);
        let one = |name: &String| Recorded::from([(name.clone(), None)]);
        let changed = |before: &Recorded, now: &Recorded| -> Vec<String> {
            let changed = before
                .iter()
                .filter(|(name, hash)| now.get(*name) != Some(hash));
            changed.map(|(name, _)| name.clone()).collect()
        };
        let files = changed(&self.inputs.files, &now.files);
        let folders = changed(&self.inputs.folders, &now.folders);
        files.iter().any(|name| {
            old(Inputs {
                files: one(name),
                ..Inputs::default()
            })
        }) || folders.iter().any(|name| {
            old(Inputs {
                folders: one(name),
                ..Inputs::default()
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use std::time::Duration;

    use crate::inputs::Names;

    #[test]
    fn a_change_with_an_old_date_is_found() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let put = |name: &str, text: &str, date: SystemTime| {
            fs::create_dir_all(path(name).parent().unwrap()).unwrap();
            fs::write(path(name), text).unwrap();
            let file = fs::File::options().write(true).open(path(name)).unwrap();
            file.set_modified(date).unwrap();
        };
        let began = SystemTime::now();
        let (before, after) = (
            began - Duration::from_secs(3600),
            began + Duration::from_secs(3600),
        );
        put(
            "Cargo.toml",
            "[package]\nname = \"a\"\n[workspace]\n",
            before,
        );
        put("Cargo.lock", "version = 4\n", before);
        put("src/lib.rs", "// 1", before);
        put("data/table", "1", before);
        let names = Names {
            files: ["src/lib.rs".to_owned()].into(),
            folders: ["data".to_owned()].into(),
            ..Names::default()
        };
        let target = path("target");
        let fingerprints =
            ["release", "spirv/release"].map(|it| target.join(it).join(".fingerprint"));
        let last = LastBuild::of(&path("Cargo.toml"), &target);
        let forgets = |name: &str, text: &str, date: SystemTime| {
            for it in &fingerprints {
                fs::create_dir_all(it).unwrap();
            }
            let inputs = Inputs::take(folder.path(), &names).unwrap();
            last.record(&inputs, began).unwrap();
            put(name, text, date);
            last.forget_if_overlooked(folder.path()).unwrap();
            let left = fingerprints.iter().filter(|it| it.exists()).count();
            assert!(left == 0 || left == 2, "{left}");
            left == 0
        };
        // Cargo sees what has a later date itself.
        for (name, text, date, forgotten) in [
            ("src/lib.rs", "// 1", before, false),
            ("src/lib.rs", "// 2", after, false),
            ("src/lib.rs", "// 3", before, true),
            ("data/table", "2", after, false),
            ("data/table", "3", before, true),
        ] {
            assert_eq!(forgets(name, text, date), forgotten, "{name} {text}");
        }
    }
}
