//! Libraries of functions: `hankel build --form functions`, and `hankel check` of such a folder.

use std::path::{Path, PathBuf};

use hankel_codegen::Error;
use hankel_codegen::functions::api::Record;
use hankel_codegen::functions::crates::Sources;
use hankel_codegen::functions::folder::Folder;
use hankel_codegen::functions::source::CrateText;
use hankel_codegen::functions::{crates, read_chosen};

use super::build::keep;
use crate::args::{Build, Format};
use crate::failure::{Outcome, Result};
use crate::print::{self, say};
use crate::session::{built_in_manifest, check_manifest};

/// What the names of libraries begin with, if nothing is said.
const PREFIX: &str = "hankel";

/// Translates the libraries of the crate at `manifest`, or of the built-in one, and names the files
/// and folders that they follow from. No kernel is compiled for it.
fn folder(
    manifest: Option<&Path>,
    prefix: &str,
    functions: &[String],
) -> Result<(Folder, Vec<PathBuf>)> {
    let manifest = match manifest {
        Some(path) if path.is_dir() => Some(path.join("Cargo.toml")),
        Some(path) => Some(path.to_owned()),
        None => built_in_manifest(),
    };
    let Sources { texts, paths } = match manifest {
        Some(manifest) => from_disk(&manifest)?,
        None => Sources {
            texts: embedded(),
            paths: Vec::new(),
        },
    };
    let sha256 = crates::hash(&texts);
    let libraries = read_chosen(&texts, functions)?;
    if libraries.is_empty() {
        let name = texts.first().map(|t| t.name.clone()).unwrap_or_default();
        return Err(Error::NoLibrary { name }.into());
    }
    Ok((Folder::new(&libraries, prefix, functions, &sha256)?, paths))
}

fn from_disk(manifest: &Path) -> Result<Sources> {
    check_manifest(manifest)?;
    Ok(crates::sources(manifest)?)
}

/// The built-in crate's sources, as this program was compiled with them.
fn embedded() -> Vec<CrateText> {
    let own = |krate: &hankel_embedded::Source| CrateText {
        name: krate.name.into(),
        version: krate.version.into(),
        licence: krate.licence.into(),
        files: krate
            .files
            .iter()
            .map(|(path, text)| ((*path).to_owned(), (*text).to_owned()))
            .collect(),
    };
    let mut all: Vec<CrateText> = hankel_embedded::TEXTS.iter().map(own).collect();
    all.sort_by_key(|krate| krate.name != hankel_embedded::CRATE_NAME);
    all
}

/// Writes the libraries. Gives the files and folders that they follow from.
pub fn build(args: &Build, quiet: bool) -> Result<Vec<PathBuf>> {
    let manifest = args.generate.source.manifest_path.as_deref();
    let prefix = args.prefix.as_deref().unwrap_or(PREFIX);
    let (folder, paths) = folder(manifest, prefix, &args.functions)?;
    keep(args, folder.files().keys(), &paths)?;
    let report = folder.write(&args.out, args.force)?;
    if args.format == Format::Json {
        print::json(&report);
    } else if !quiet {
        say!(
            "{}: {} functions, {} files written, {} unchanged, {} removed",
            args.out.display(),
            report.functions,
            report.written.len(),
            report.unchanged,
            report.removed.len()
        );
    }
    Ok(paths)
}

/// Compares a committed folder of libraries, of which `record` says how it was built, with its sources.
pub fn check(
    manifest: Option<&Path>,
    record: &Record,
    committed: &Path,
    format: Format,
    quiet: bool,
) -> Result<Outcome> {
    let differences = folder(manifest, &record.prefix, &record.functions)?
        .0
        .check(committed)?;
    if format == Format::Json {
        print::json(&differences);
    } else if !quiet || !differences.is_fine() {
        say!("{differences}");
    }
    Ok(Outcome::of(differences.is_fine()))
}
