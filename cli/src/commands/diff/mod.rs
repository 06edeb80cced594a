mod numbers;
#[cfg(feature = "frames")]
mod pictures;

use std::collections::BTreeMap;
use std::path::Path;

use hankel_codegen::Language;
use hankel_codegen::diff::{Item, compare, options, spirv};
use hankel_codegen::finish::validate;
use hankel_codegen::spirv::words;
use hankel_host::parity::numbers::Found;
use serde::Serialize;

use crate::args::{Deny, Diff, Format};
use crate::failure::{Failure, Outcome, Result};
use crate::print::{self, say};

#[derive(Serialize)]
struct Report {
    #[serde(flatten)]
    diff: hankel_codegen::diff::Diff,
    /// How far the new SPIR-V's numbers are from the old one's, by kernel.
    #[serde(skip_serializing_if = "Option::is_none")]
    numbers: Option<BTreeMap<String, Found>>,
    /// Kernels that changed and were not run, and why.
    #[serde(skip_serializing_if = "Option::is_none")]
    not_run: Option<BTreeMap<String, &'static str>>,
    /// A scene by the shaders of either build.
    #[cfg(feature = "frames")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pictures: Option<pictures::Pictures>,
}

pub fn run(args: &Diff, quiet: bool) -> Result<Outcome> {
    let diff = compare(&args.old, &args.new)?;
    if args.run {
        check_spirv(&args.old)?;
        check_spirv(&args.new)?;
    }
    let outcome = Outcome::of(match args.deny {
        None => true,
        Some(Deny::Interface) => !diff.changes_interface(),
        Some(Deny::Any) => diff.is_empty(),
    });
    let (mut changed, mut not_run) = (Vec::new(), BTreeMap::new());
    for (name, item) in &diff.items {
        let Some(name) = name.strip_prefix("kernel ") else {
            continue;
        };
        match item {
            // A constant that has a value for good is no hindrance.
            Item::Changed { changes, .. }
                if changes
                    .iter()
                    .any(|it| it.interface && !it.what.starts_with("constants.")) =>
            {
                not_run.insert(name.to_owned(), "its interface changed");
            }
            Item::Changed { texts, .. } if texts.contains(&Language::Spirv) => {
                changed.push(name.to_owned());
            }
            Item::Changed { texts, .. } if !texts.is_empty() => {
                not_run.insert(name.to_owned(), "its SPIR-V is the same");
            }
            _ => {}
        }
    }
    let numbers = match args.run {
        true => Some(numbers::numbers(args, &changed, quiet)?),
        false => None,
    };
    if let Some(numbers) = &numbers {
        let others = changed.iter().filter(|name| !numbers.contains_key(*name));
        let why = "the crate has no kernel of this name, as of a variant";
        not_run.extend(others.map(|name| (name.clone(), why)));
    }
    let report = Report {
        diff,
        numbers,
        not_run: args.run.then_some(not_run),
        #[cfg(feature = "frames")]
        pictures: pictures::pictures(args, quiet)?,
    };
    if args.format == Format::Json {
        print::json(&report);
        return Ok(outcome);
    }
    say!("{}", report.diff);
    for (kernel, found) in report.numbers.iter().flatten() {
        if found.beyond == 0 {
            say!("{kernel}: the same {} numbers", found.values);
        } else {
            let most = match (found.largest_ulp, found.largest_absolute) {
                (u64::MAX, _) => "of some pairs one is NaN".into(),
                (ulp, Some(x)) => format!("by at most {ulp} ulp or {x:.2e}"),
                (ulp, None) => format!("by at most {ulp} ulp or infinity"),
            };
            say!(
                "{kernel}: {} of {} numbers differ, {most}",
                found.beyond,
                found.values
            );
        }
    }
    for (kernel, why) in report.not_run.iter().flatten() {
        say!("{kernel}: not run: {why}");
    }
    #[cfg(feature = "frames")]
    if let Some(pictures) = &report.pictures {
        say!("{pictures}");
    }
    Ok(outcome)
}

/// Whether a folder of shaders has SPIR-V, which is what runs.
fn check_spirv(folder: &Path) -> Result<()> {
    // Without languages, all were asked for.
    let targets = options(folder)?.targets;
    if targets.is_empty() || targets.contains(&Language::Spirv) {
        return Ok(());
    }
    Err(Failure::input(
        format!(
            "--run: {} has no SPIR-V, which is what runs",
            folder.display()
        ),
        "Build it with --target spirv among its languages, or leave out --run.",
    ))
}

/// The valid SPIR-V of a kernel in a folder.
fn module(folder: &Path, name: &str) -> Result<Vec<u32>> {
    let words = words(&spirv(folder, name)?, name).map_err(hankel_codegen::Error::from)?;
    // The driver gets it as it is.
    validate(&words, name).map_err(hankel_codegen::Error::from)?;
    Ok(words)
}
