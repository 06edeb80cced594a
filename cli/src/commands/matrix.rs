use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::time::Duration;

use hankel_codegen::build::generate;
use hankel_codegen::translate::Options;
use hankel_matrix::column::Column;
use hankel_matrix::compile::SHADER_MODEL;
use hankel_matrix::known::Known;
use hankel_matrix::run::Request;
use hankel_matrix::subject::Subject;
use hankel_matrix::tools::Tools;
use hankel_system::output;

use crate::args::{Format, Parity};
use crate::failure::{Failure, Outcome, Result};
use crate::print::{self, say};
use crate::progress::Progress;
use crate::session::Session;

/// Known differences of the built-in kernels.
const KNOWN: &str = include_str!("../../../snapshots/known-differences.toml");

pub fn run(args: &Parity, quiet: bool) -> Result<Outcome> {
    let own = &args.of_matrix;
    let limit = Duration::from_secs(args.limit);
    let columns = columns(&own.columns)?;
    let required = if own.require.iter().any(|r| r == "all") {
        Column::ALL.into()
    } else {
        columns_named(&own.require)?
    };
    let built_in = args.source.manifest_path.is_none();
    let known = match &own.known {
        Some(file) => Known::read(file),
        None if built_in => Known::parse(KNOWN),
        None => Ok(Known::default()),
    }
    .map_err(|e| Failure::input(e, "Mend the list of known differences."))?;
    // Whether reports can be written shows before the long work starts.
    let files: Vec<&Path> = [&own.json, &own.html, &own.markdown]
        .into_iter()
        .flatten()
        .map(PathBuf::as_path)
        .collect();
    let inputs: Vec<&Path> = own.known.iter().map(PathBuf::as_path).collect();
    let mut outputs = output::create_all(&files, &inputs)?.into_iter().peekable();
    let session = Session::open(args.source.manifest_path.as_deref(), quiet)?;
    let options = Options {
        shader_model: SHADER_MODEL.parse()?,
        ..Options::default()
    };
    let request = session.request_for(args.kernels.clone(), Vec::new(), options);
    let generated = generate(&request, &session.modules()?)?;
    let krate = session.native(generated.manifest.kernels.keys(), limit)?;
    let subjects = Subject::all(&generated, &krate.entries);

    let cache = hankel_toolchain::Options::from_env().cache_folder().ok();
    let this = std::env::current_exe()
        .map_err(|e| Failure::machine(format!("this program does not find itself: {e}"), None))?;
    let request = Request {
        columns,
        seed: args.seed,
        limit,
        tools: tools(),
        runner: vec![this.into_os_string(), OsString::from("matrix-runner")],
        cache: cache.filter(|_| !own.no_cache),
        known,
        whole: args.kernels.is_empty() && own.columns.is_empty(),
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
    let mut write = |wanted: bool, text: &dyn Fn() -> Result<String>| -> Result<()> {
        match outputs.next_if(|_| wanted) {
            Some(output) => Ok(output.finish(text()?.as_bytes())?),
            None => Ok(()),
        }
    };
    write(own.json.is_some(), &|| {
        serde_json::to_string_pretty(&report)
            .map_err(|e| Failure::machine(format!("the report has no JSON form: {e}"), None))
    })?;
    write(own.html.is_some(), &|| {
        Ok(hankel_matrix::html::page(&report))
    })?;
    write(own.markdown.is_some(), &|| Ok(report.markdown()))?;
    match args.format {
        Format::Json => print::json(&report),
        Format::Text => say!("{report}"),
    }
    Ok(Outcome::of(report.passed))
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
