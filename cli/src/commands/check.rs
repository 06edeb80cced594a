use std::path::Path;

use hankel_codegen::build::Generated;
use hankel_codegen::check::{Config, check};

use super::functions;
use crate::args::{Check, Format};
use crate::failure::{Failure, Outcome, Result};
use crate::print::{self, say};
use crate::session::Session;

/// The budget that is used without being named.
const DEFAULT_BUDGET: &str = "hankel.toml";

pub fn run(args: &Check, quiet: bool) -> Result<Outcome> {
    if !args.folder.is_dir() {
        let problem = if args.folder.exists() {
            "it is not a folder"
        } else {
            "there is no such folder"
        };
        return Err(Failure::input(
            format!("{}: {problem}", args.folder.display()),
            "Give the folder that `hankel build --out` made and that is committed.",
        ));
    }
    if let Some(record) = hankel_codegen::functions::folder::read(&args.folder)? {
        if let Some(option) = of_shaders(args) {
            return Err(Failure::input(
                format!(
                    "{option}: it is for shaders, and this folder holds libraries of functions"
                ),
                "Leave it out: functions.json says what the folder was built with.",
            ));
        }
        let manifest = args.generate.source.manifest_path.as_deref();
        return functions::check(manifest, &record, &args.folder, args.format, quiet);
    }
    let budget = match &args.budget {
        Some(file) => Config::read(file)?.budget,
        // A link that leads nowhere, too: what cannot be read is no missing budget.
        None if Path::new(DEFAULT_BUDGET).symlink_metadata().is_ok() => {
            Config::read(Path::new(DEFAULT_BUDGET))?.budget
        }
        None => Config::default().budget,
    };
    let generated = expected(args, quiet)?;
    let report = check(&generated, &args.folder, &budget)?;
    if args.format == Format::Json {
        print::json(&report);
    } else if !quiet || !report.is_fine() {
        say!("{report}");
    }
    Ok(Outcome::of(report.is_fine()))
}

/// The first option that is for folders of shaders.
fn of_shaders(args: &Check) -> Option<&'static str> {
    #[cfg(feature = "frames")]
    let scene = args.scene.is_some();
    #[cfg(not(feature = "frames"))]
    let scene = false;
    let own = [("--scene", scene), ("--budget", args.budget.is_some())];
    let own = own
        .into_iter()
        .find_map(|(option, given)| given.then_some(option));
    own.or_else(|| args.generate.first_option())
}

/// What the folder must hold.
fn expected(args: &Check, quiet: bool) -> Result<Generated> {
    #[cfg(feature = "frames")]
    {
        if let Some(scene) = &args.scene {
            return super::frame::expected(args, scene, quiet);
        }
        super::frame::refuse_without_scene(args)?;
    }
    let session = Session::to_generate(
        args.generate.source.manifest_path.as_deref(),
        &args.generate.kernels,
        quiet,
    )?;
    let request = session.request_again(&args.generate, &args.folder)?;
    // What is wrong with the request is told before anything is compiled.
    request.chosen()?;
    session.generate(&request)
}
