//! A crate's sources from disk.

use std::path::Path;

use toml::{Table, Value};

use super::source::CrateText;
use crate::error::{During, Error, Result};
use crate::source_hash::Sources;

/// The texts of a kernel crate, which is the first, and of the crates that it depends on by path.
///
/// # Errors
/// A file that cannot be read, or a Cargo.toml that is none.
pub fn texts(sources: &Sources) -> Result<Vec<CrateText>> {
    let mut all = Vec::new();
    for folder in &sources.folders {
        let manifest = folder.join("Cargo.toml");
        let table = table(&manifest)?;
        let package = table.get("package").and_then(Value::as_table);
        let field = |key: &str| -> Result<String> {
            let value = package.and_then(|p| p.get(key));
            if let Some(text) = value.and_then(Value::as_str) {
                return Ok(text.into());
            }
            // `key.workspace = true`
            for above in folder.ancestors().skip(1) {
                let root = above.join("Cargo.toml");
                if !root.is_file() {
                    continue;
                }
                let table = self::table(&root)?;
                if let Some(workspace) = table.get("workspace") {
                    let text = workspace
                        .get("package")
                        .and_then(|p| p.get(key))
                        .and_then(Value::as_str);
                    return Ok(text.unwrap_or_default().into());
                }
            }
            Ok(String::new())
        };
        let mut krate = CrateText {
            name: field("name")?,
            version: field("version")?,
            licence: field("license")?,
            ..CrateText::default()
        };
        for file in &sources.files {
            let Ok(relative) = file.strip_prefix(folder) else {
                continue;
            };
            if relative.extension().is_none_or(|e| e != "rs") || !relative.starts_with("src") {
                continue;
            }
            let parts: Vec<_> = relative
                .components()
                .map(|c| c.as_os_str().to_string_lossy())
                .collect();
            let text = std::fs::read_to_string(file).during("read", file)?;
            krate
                .files
                .insert(parts.join("/"), text.replace("\r\n", "\n"));
        }
        if krate.name == sources.name {
            all.insert(0, krate);
        } else {
            all.push(krate);
        }
    }
    Ok(all)
}

fn table(path: &Path) -> Result<Table> {
    let text = std::fs::read_to_string(path).during("read", path)?;
    text.parse().map_err(|e: toml::de::Error| Error::Manifest {
        path: path.into(),
        problem: e.to_string(),
    })
}
