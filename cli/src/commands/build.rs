use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use hankel_codegen::Language;
use hankel_codegen::build::{MANIFEST_FILE, Report, check_output, is_own, write};
use hankel_codegen::functions::api;
use hankel_system::output::{self, Output};

use super::functions;
use crate::args::{Build, Form, Format};
use crate::depfile;
use crate::failure::{Failure, Outcome, Result};
use crate::print::{self, say};
use crate::session::{Followed, Session, this_program};
use crate::watch::Edits;

pub fn run(args: &Build, quiet: bool) -> Result<Outcome> {
    // Whether a rule can hold the name and can be written, before anything is; a folder within the output's may be
    // made by the build.
    if args.depfile.is_some() {
        depfile::rule(&args.out, &[])?;
    }
    let within = args.depfile.as_deref().and_then(|it| within(it, &args.out));
    if let Some(own) = within.as_deref().filter(|it| is_own(it)) {
        return Err(Failure::input(
            format!(
                "--depfile: {} in the output is the build's own",
                own.display()
            ),
            "Give it a name beside the folders of the output, such as OUT/shaders.d, or another folder.",
        ));
    }
    if let Some(file) = args.depfile.as_ref().filter(|_| within.is_none()) {
        let mut read: Vec<&Path> = args
            .generate
            .placement
            .bindings
            .iter()
            .map(PathBuf::as_path)
            .collect();
        #[cfg(feature = "frames")]
        read.extend(args.frame.scene.as_deref());
        drop(Output::create(file, &read)?);
    }
    if args.form == Form::Kernels {
        if !args.functions.is_empty() {
            return Err(Failure::input(
                "--function: it is for libraries, and shaders have kernels",
                "Add --form functions, or choose kernels with --kernel.",
            ));
        }
        if args.prefix.is_some() {
            return Err(Failure::input(
                "--prefix: it is for libraries, and shaders have the names of their kernels",
                "Add --form functions, or leave it out.",
            ));
        }
    }
    #[cfg(feature = "frames")]
    match &args.frame.scene {
        Some(scene) => return super::frame::build(args, scene, quiet),
        None if !args.frame.maps.is_empty() => {
            return Err(Failure::input(
                "--size, --filter, --fit and --multisampling are for the maps of a scene",
                "Give the scene with --scene, and --technique auto --error 0.05.",
            ));
        }
        None => {}
    }
    if args.form == Form::Functions
        && let Some(option) = args.generate.first_option()
    {
        return Err(Failure::input(
            format!("{option}: it is for shaders, and --form functions writes libraries"),
            "Leave it out: a library is written in every form, and --function chooses from it.",
        ));
    }
    if args.watch {
        return watch(args, quiet);
    }
    once(args, quiet)?;
    Ok(Outcome::Fine)
}

/// The path of a file below a folder, however both are written.
fn within(file: &Path, folder: &Path) -> Option<PathBuf> {
    let (file, folder) = (
        std::path::absolute(file).ok()?,
        std::path::absolute(folder).ok()?,
    );
    file.strip_prefix(folder).ok().map(Path::to_owned)
}

/// Builds after each edit, until the program is stopped.
fn watch(args: &Build, quiet: bool) -> Result<Outcome> {
    let sources =
        Session::sources(args.generate.source.manifest_path.as_deref()).ok_or_else(|| {
            Failure::input(
                "--watch: the built-in kernels have no sources here",
                "Give a kernel crate with --manifest-path, or run it in Hankel's repository.",
            )
        })?;
    let mut edits = Edits::new(&args.out)?;
    let places = places(args)?;
    loop {
        // Before the build: what is edited meanwhile is built next.
        edits.add(&places, &sources);
        match once(args, quiet) {
            Ok(followed) => edits.add(&followed.paths, &sources),
            Err(failure) => print::note(format_args!("{:?}", miette::Report::new(failure))),
        }
        edits.wait()?;
    }
}

/// Builds. Gives what the output follows from beside this program, if that was asked for.
fn once(args: &Build, quiet: bool) -> Result<Followed> {
    let (followed, record) = match args.form {
        Form::Functions => {
            let paths = functions::build(args, quiet)?;
            let environment = Vec::new();
            (Followed { paths, environment }, api::FILE)
        }
        Form::Kernels => (shaders(args, quiet)?, MANIFEST_FILE),
    };
    depend(args, record, &followed)?;
    Ok(followed)
}

/// Writes what the file `record` of the output follows from, as far as that was asked for.
pub fn depend(args: &Build, record: &str, followed: &Followed) -> Result<()> {
    let record = args.out.join(record);
    let mut paths = followed.paths.clone();
    paths.push(this_program()?);
    let mut read: Vec<&Path> = paths.iter().map(PathBuf::as_path).collect();
    read.push(&record);
    if let Some(file) = &args.depfile {
        let text = depfile::rule(&record, &paths)?;
        Output::create(file, &read)?.finish(text.as_bytes())?;
        // Make compares times: a record that stays as it was must not be older than its inputs.
        touch(&record)?;
    }
    if let Some(file) = &args.environment {
        let text: String = followed
            .environment
            .iter()
            .map(|name| format!("{name}\n"))
            .collect();
        Output::create(file, &read)?.finish(text.as_bytes())?;
    }
    Ok(())
}

/// The file with places of bindings, as an absolute path.
fn places(args: &Build) -> Result<Vec<PathBuf>> {
    let files = args.generate.placement.bindings.iter();
    files
        .map(|file| {
            std::path::absolute(file)
                .map_err(|e| Failure::machine(format!("{}: {e}", file.display()), None))
        })
        .collect()
}

/// Gives a file the present time.
fn touch(file: &Path) -> Result<()> {
    std::fs::File::options()
        .append(true)
        .open(file)
        .and_then(|file| file.set_modified(SystemTime::now()))
        .map_err(|e| Failure::machine(format!("{}: {e}", file.display()), None))
}

/// Refuses to replace a file that the build reads. Without `--force`, any file of others is in the way.
pub fn keep<'a>(
    args: &Build,
    files: impl Iterator<Item = &'a String>,
    inputs: &[PathBuf],
) -> Result<()> {
    if args.force {
        output::refuse_inputs(files.map(|file| args.out.join(file)), inputs)?;
    }
    Ok(())
}

/// Writes shaders. Gives what they follow from, if that was asked for.
fn shaders(args: &Build, quiet: bool) -> Result<Followed> {
    check_output(&args.out)?;
    let session = Session::to_generate(
        args.generate.source.manifest_path.as_deref(),
        &args.generate.kernels,
        quiet,
    )?;
    let request = session.request(&args.generate)?;
    // What is wrong with the request is told before anything is compiled.
    request.chosen()?;
    let generated = session.generate(&request)?;
    let is_asked = args.watch || args.depfile.is_some() || args.environment.is_some() || args.force;
    let mut followed = Followed::default();
    if is_asked {
        followed = session.inputs(&request)?;
        followed.paths.extend(places(args)?);
    }
    keep(args, generated.files.keys(), &followed.paths)?;
    let report = write(&generated, &args.out, args.force)?;
    tell(args, &report, quiet);
    Ok(followed)
}

/// Most kernels without a language that are named in a line; manifest.json has them all.
const MAX_NAMED: usize = 6;

/// Prints what a build did.
pub fn tell(args: &Build, report: &Report, quiet: bool) {
    if args.format == Format::Json {
        print::json(report);
        return;
    }
    if quiet {
        return;
    }
    say!(
        "{}: {} kernels, {} files written, {} unchanged, {} removed",
        args.out.display(),
        report.kernels,
        report.written.len(),
        report.unchanged,
        report.removed.len()
    );
    let mut missing: BTreeMap<(Language, &str), Vec<&str>> = BTreeMap::new();
    for (kernel, language, why) in &report.unsupported {
        let kernels = missing.entry((*language, why.as_str())).or_default();
        kernels.push(kernel.as_str());
    }
    for ((language, why), kernels) in missing {
        let (named, others) = kernels.split_at(kernels.len().min(MAX_NAMED));
        let more = match others.len() {
            0 => String::new(),
            more => format!(" and {more} more"),
        };
        say!("no {language} of {}{more}: {why}", named.join(", "));
    }
}
