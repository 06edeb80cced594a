//! What cargo says of a build, as JSON: a line for each message.

use std::path::PathBuf;

use serde::Deserialize;

/// What is read of cargo's messages.
#[derive(Deserialize)]
#[serde(tag = "reason", rename_all = "kebab-case")]
enum Message {
    CompilerArtifact(Artifact),
    BuildScriptExecuted(Script),
    #[serde(other)]
    Other,
}

/// A unit that was compiled, now or before.
#[derive(Debug, Deserialize)]
pub(crate) struct Artifact {
    pub package_id: String,
    pub manifest_path: PathBuf,
    pub target: Target,
    /// Those that are there: rustc may have been told to write none.
    pub filenames: Vec<PathBuf>,
    /// cargo thinks that it was made before.
    pub fresh: bool,
}

/// What a unit is of its package.
#[derive(Debug, Deserialize)]
pub(crate) struct Target {
    pub name: String,
    pub crate_types: Vec<String>,
}

/// A build script that ran, now or before.
#[derive(Debug, Deserialize)]
pub(crate) struct Script {
    pub package_id: String,
    pub out_dir: PathBuf,
    pub env: Vec<(String, String)>,
}

/// The messages of a build.
#[derive(Debug, Default)]
pub(crate) struct Messages {
    pub artifacts: Vec<Artifact>,
    pub scripts: Vec<Script>,
}

impl Messages {
    /// Reads what cargo wrote to the standard output. Lines that are no JSON are the compiler's.
    pub(crate) fn read(text: &str) -> serde_json::Result<Self> {
        let mut all = Self::default();
        for line in text.lines().filter(|line| line.starts_with('{')) {
            match serde_json::from_str(line)? {
                Message::CompilerArtifact(artifact) => all.artifacts.push(artifact),
                Message::BuildScriptExecuted(script) => all.scripts.push(script),
                Message::Other => {}
            }
        }
        Ok(all)
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// cargo's message of a unit.
    pub(crate) fn artifact(name: &str, crate_type: &str, fresh: bool) -> String {
        format!(
            "{{\"reason\":\"compiler-artifact\",\"package_id\":\"p\",\"manifest_path\":\"/p/Cargo.toml\",\
             \"target\":{{\"name\":\"{name}\",\"crate_types\":[\"{crate_type}\"]}},\
             \"filenames\":[\"/t/lib{name}.rlib\"],\"fresh\":{fresh}}}\n"
        )
    }

    #[test]
    fn what_cargo_says_is_read_among_what_others_say() {
        let text = artifact("a", "lib", true) + "noise\n{\"reason\":\"build-finished\"}\n";
        let read = Messages::read(&text).unwrap();
        assert_eq!(read.artifacts.len(), 1);
        assert_eq!(read.artifacts[0].target.name, "a");
        assert!(read.scripts.is_empty());
        assert!(Messages::read("{\"reason\":\"compiler-artifact\"}").is_err());
    }
}
