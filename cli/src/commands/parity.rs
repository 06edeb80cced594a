use std::collections::BTreeSet;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::time::Duration;

use hankel_codegen::Language;
use hankel_codegen::build::generate;
use hankel_codegen::translate::Options;
use hankel_host::device::VulkanDevice;
use hankel_matrix::absent::Absent;
use hankel_matrix::column::Column;
use hankel_matrix::compile::SHADER_MODEL;
use hankel_matrix::known::Known;
use hankel_matrix::run::Request;
use hankel_matrix::subject::Subject;
use hankel_matrix::tools::Tools;
use hankel_system::{input, output};

use crate::args::{Format, Parity};
use crate::failure::{Failure, Outcome, Result};
use crate::print::{self, say};
use crate::progress::Progress;
use crate::session::{Session, this_program};

/// Cells of the built-in kernels that are known not to run.
const ABSENT: &str = include_str!("../../../snapshots/absent-cells.toml");

/// Known differences of the built-in kernels.
const KNOWN: &str = include_str!("../../../snapshots/known-differences.toml");

/// Most bytes of a table of absent cells.
const MAX_BYTES: u64 = 16 << 20;

pub fn run(args: &Parity, quiet: bool) -> Result<Outcome> {
    let own = &args.of_matrix;
    let limit = Duration::from_secs(args.limit);
    let (columns, required) = if args.matrix {
        let required = if own.require.iter().any(|r| r == "all") {
            Column::ALL.into()
        } else {
            columns_named(&own.require)?
        };
        (columns(&own.columns)?, required)
    } else {
        // Whether there is a driver shows before the long work starts.
        drop(VulkanDevice::new()?);
        (Column::PLAIN.into(), Column::PLAIN.into())
    };
    let whole = args.matrix && args.kernels.is_empty() && own.columns.is_empty();
    let built_in = args.source.manifest_path.is_none();
    let known = match &own.known {
        Some(file) => Known::read(file),
        None if built_in => Known::parse(KNOWN),
        None => Ok(Known::default()),
    }
    .map_err(|e| Failure::input(e, "Fix the list of known differences."))?;
    let absent = match &own.absent {
        Some(file) => {
            let text = input::read_text(file, MAX_BYTES).map_err(|e| e.to_string());
            Some(text.and_then(|text| {
                Absent::parse(&text).map_err(|e| format!("{}: {e}", file.display()))
            }))
        }
        None if built_in => Some(Absent::parse(ABSENT)),
        None => None,
    }
    .transpose()
    .map_err(|e| Failure::input(e, "Fix the table of absent cells."))?;
    // Whether reports can be written shows before the long work starts.
    let files: Vec<&Path> = [&own.write_absent, &own.json, &own.html, &own.markdown]
        .into_iter()
        .flatten()
        .map(PathBuf::as_path)
        .collect();
    let inputs: Vec<&Path> = [&own.known, &own.absent]
        .into_iter()
        .flatten()
        .map(PathBuf::as_path)
        .collect();
    let mut outputs = output::create_all(&files, &inputs)?.into_iter();
    let session = Session::open(args.source.manifest_path.as_deref(), quiet)?;
    let options = Options {
        shader_model: SHADER_MODEL.parse()?,
        ..Options::default()
    };
    let targets: BTreeSet<Language> = columns.iter().filter_map(|c| c.language()).collect();
    let targets = targets.into_iter().collect();
    let request = session.request_for(args.kernels.clone(), targets, options);
    let modules = session.modules(&request)?;
    let generated = generate(&request, &modules)?;
    let krate = session.native(generated.manifest.kernels.keys(), limit)?;
    let subjects = Subject::with_constants(&generated, &request, &modules, &krate.entries)?;

    let cache = hankel_toolchain::Options::from_env().cache_folder().ok();
    let request = Request {
        columns,
        seed: args.seed,
        limit,
        tools: tools(),
        runner: vec![
            this_program()?.into_os_string(),
            OsString::from("matrix-runner"),
        ],
        cache: cache.filter(|_| !own.no_cache && !in_ci()),
        known,
        absent: absent.filter(|_| whole && own.write_absent.is_none()),
        whole,
        required,
    };
    let progress = Progress::new(quiet);
    progress.begin(&format!(
        "Running {} kernels in {} columns",
        subjects.len(),
        request.columns.len()
    ));
    let report = hankel_matrix::run::run(&request, &subjects, &|what| progress.detail(what))
        .map_err(|e| Failure::machine(e.to_string(), None))?;
    drop(progress);
    // In the order in which the files were opened.
    let mut write = |text: String| -> Result<()> {
        match outputs.next() {
            Some(output) => Ok(output.finish(text.as_bytes())?),
            None => Ok(()),
        }
    };
    if own.write_absent.is_some() {
        write(Absent::of(&report).text())?;
    }
    if own.json.is_some() {
        let text = serde_json::to_string_pretty(&report).map_err(|e| {
            Failure::machine(format!("the report cannot be written as JSON: {e}"), None)
        })?;
        write(text)?;
    }
    if own.html.is_some() {
        write(hankel_matrix::html::page(&report))?;
    }
    if own.markdown.is_some() {
        write(report.markdown())?;
    }
    match args.format {
        Format::Json => print::json(&report),
        Format::Text => say!("{report}"),
    }
    Ok(Outcome::of(report.passed))
}

/// Whether this is a run of continuous integration, where results of other runs count for nothing.
fn in_ci() -> bool {
    std::env::var_os("CI").is_some_and(|v| v == "true" || v == "1")
}

/// A process that the matrix runs kernels in.
pub fn serve(which: &str) -> Result<Outcome> {
    hankel_matrix::serve(which)
        .map(|()| Outcome::Fine)
        .map_err(|e| Failure::machine(e, None))
}

/// Where foreign programs are looked for.
pub fn tools() -> Tools {
    let cache = hankel_toolchain::Options::from_env().cache_folder().ok();
    Tools::of_cache(cache.as_deref())
}

fn columns(names: &[String]) -> Result<Vec<Column>> {
    if names.is_empty() {
        Ok(Column::ALL.into())
    } else {
        columns_named(names)
    }
}

fn columns_named(names: &[String]) -> Result<Vec<Column>> {
    let mut all = names
        .iter()
        .map(|n| n.parse::<Column>())
        .collect::<std::result::Result<Vec<_>, _>>()
        .map_err(|e| Failure::input(e, "Give one of these names."))?;
    all.sort();
    all.dedup();
    Ok(all)
}
