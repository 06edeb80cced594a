mod numbers;
#[cfg(feature = "frames")]
mod pictures;

use std::collections::BTreeMap;
use std::path::Path;

use hankel_codegen::Language;
use hankel_codegen::diff::{Item, compare, spirv};
use hankel_codegen::finish::validate;
use hankel_codegen::spirv::words;
use hankel_host::parity::numbers::Found;
use serde::Serialize;

use crate::args::{Deny, Diff, Format};
use crate::failure::{Outcome, Result};
use crate::print::{self, say};

#[derive(Serialize)]
struct Report {
    #[serde(flatten)]
    diff: hankel_codegen::diff::Diff,
    /// How far the new SPIR-V's numbers are from the old one's, by kernel.
    #[serde(skip_serializing_if = "Option::is_none")]
    numbers: Option<BTreeMap<String, Found>>,
    /// A scene by the shaders of either build.
    #[cfg(feature = "frames")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pictures: Option<pictures::Pictures>,
}

pub fn run(args: &Diff, quiet: bool) -> Result<Outcome> {
    let diff = compare(&args.old, &args.new)?;
    let outcome = Outcome::of(match args.deny {
        None => true,
        Some(Deny::Interface) => !diff.changes_interface(),
        Some(Deny::Any) => diff.is_empty(),
    });
    let changed: Vec<String> = diff
        .items
        .iter()
        .filter_map(|(name, item)| match item {
            Item::Changed { texts, .. }
                if texts.contains(&Language::Spirv) && !item.changes_interface() =>
            {
                name.strip_prefix("kernel ").map(str::to_owned)
            }
            _ => None,
        })
        .collect();
    let numbers = match args.run {
        true => Some(numbers::numbers(args, &changed, quiet)?),
        false => None,
    };
    let report = Report {
        diff,
        numbers,
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
            say!(
                "{kernel}: {} of {} numbers differ, by at most {} ulp or {}",
                found.beyond,
                found.values,
                found.largest_ulp,
                match found.largest_absolute {
                    Some(x) => format!("{x:.2e}"),
                    None => "infinity".into(),
                }
            );
        }
    }
    #[cfg(feature = "frames")]
    if let Some(pictures) = &report.pictures {
        say!("{pictures}");
    }
    Ok(outcome)
}

/// The valid SPIR-V of a kernel in a folder.
fn module(folder: &Path, name: &str) -> Result<Vec<u32>> {
    let words = words(&spirv(folder, name)?, name).map_err(hankel_codegen::Error::from)?;
    // The driver gets it as it is.
    validate(&words, name).map_err(hankel_codegen::Error::from)?;
    Ok(words)
}
