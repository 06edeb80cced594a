use hankel_toolchain::{Method, Options, Toolchain, install, pack, status};

use crate::args::{Format, ToolchainCommand, ToolchainInstall, ToolchainPack, ToolchainStatus};
use crate::failure::{Failure, Outcome, Result};
use crate::print::{self, say};
use crate::progress::Progress;

pub fn run(args: &crate::args::Toolchain, quiet: bool) -> Result<Outcome> {
    match &args.command {
        ToolchainCommand::Status(args) => show(args),
        ToolchainCommand::Install(args) => add(args, quiet),
        ToolchainCommand::Pack(args) => share(args, quiet),
    }
}

/// Exit code 1 if there is no compiler: scripts can ask.
fn show(args: &ToolchainStatus) -> Result<Outcome> {
    let status = status(&Options::from_env());
    if args.format == Format::Json {
        print::json(&status);
    } else {
        say!("{status}");
    }
    Ok(Outcome::of(status.used.is_some()))
}

fn add(args: &ToolchainInstall, quiet: bool) -> Result<Outcome> {
    let mut options = Options::from_env();
    if args.sha256.is_some() {
        options.sha256.clone_from(&args.sha256);
    }
    let method = match (&args.from, args.method) {
        (Some(file), _) => Some(Method::Archive(file.clone())),
        (None, Some(crate::args::Method::Rustup)) => Some(Method::Rustup),
        (None, Some(crate::args::Method::Source)) => Some(Method::Source),
        (None, None) => None,
    };
    let mut progress = Progress::new(quiet);
    let toolchain = install(&options, method, &mut progress)?;
    drop(progress);
    if !quiet {
        say!("{}", describe(&toolchain));
    }
    Ok(Outcome::Fine)
}

fn share(args: &ToolchainPack, quiet: bool) -> Result<Outcome> {
    let options = Options::from_env();
    let Some(toolchain) = hankel_toolchain::find(&options)? else {
        return Err(Failure::machine(
            "there is no compiler to pack",
            Some("`hankel toolchain install` installs one.".into()),
        ));
    };
    let mut progress = Progress::new(quiet);
    let packed = pack(&toolchain, &args.folder, &mut progress)?;
    drop(progress);
    say!("{}  {}", packed.sha256, packed.path.display());
    Ok(Outcome::Fine)
}

fn describe(toolchain: &Toolchain) -> String {
    format!(
        "rust-gpu {} with {} is in {}",
        toolchain.rust_gpu_version,
        toolchain.rustc_version,
        toolchain.root.display()
    )
}
