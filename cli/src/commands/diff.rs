use std::collections::BTreeMap;
use std::time::Duration;

use hankel_codegen::Language;
use hankel_codegen::diff::{Item, compare, spirv};
use hankel_codegen::finish::validate;
use hankel_codegen::spirv::words;
use hankel_dsl::native::describe::Tolerance;
use hankel_host::crates::KernelEntry;
use hankel_host::device::{Device, Shader, VulkanDevice};
use hankel_host::inputs;
use hankel_host::parity::execute;
use hankel_host::parity::numbers::{Found, Numbers, Rules};
use serde::Serialize;

use crate::args::{Deny, Diff, Format};
use crate::failure::{Failure, Outcome, Result};
use crate::print::{self, say};
use crate::progress::Progress;
use crate::session::{Session, cases};

/// Seconds that the inputs of a kernel may take.
const LIMIT: Duration = Duration::from_secs(120);

#[derive(Serialize)]
struct Report {
    #[serde(flatten)]
    diff: hankel_codegen::diff::Diff,
    /// How far the new SPIR-V's numbers are from the old one's, by kernel.
    #[serde(skip_serializing_if = "Option::is_none")]
    numbers: Option<BTreeMap<String, Found>>,
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
        true => Some(numbers(args, &changed, quiet)?),
        false => None,
    };
    let report = Report { diff, numbers };
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
    Ok(outcome)
}

/// Runs the old and the new SPIR-V of the kernels called `names`.
fn numbers(args: &Diff, names: &[String], quiet: bool) -> Result<BTreeMap<String, Found>> {
    let session = Session::open(args.source.manifest_path.as_deref(), quiet)?;
    let known = session.kernels();
    let names: Vec<&String> = names
        .iter()
        .filter(|name| known.iter().any(|kernel| kernel.name == **name))
        .collect();
    let krate = session.native(names.iter().copied(), LIMIT)?;
    let mut device = VulkanDevice::new()?;
    let progress = Progress::new(quiet);
    progress.begin(&format!("Running {} kernels, old and new", names.len()));
    let mut all = BTreeMap::new();
    for name in names {
        progress.detail(name);
        let module = |folder| -> Result<Vec<u32>> {
            let words = words(&spirv(folder, name)?, name).map_err(hankel_codegen::Error::from)?;
            // The driver gets it as it is.
            validate(&words, name).map_err(hankel_codegen::Error::from)?;
            Ok(words)
        };
        let (old, new) = (module(&args.old)?, module(&args.new)?);
        let found = between(&mut device, krate.entry(name)?, &old, &new, args.seed)?;
        all.insert(name.clone(), found);
    }
    Ok(all)
}

/// How far the numbers of a kernel's new SPIR-V are from those of its old one.
fn between(
    device: &mut dyn Device,
    entry: &KernelEntry,
    old: &[u32],
    new: &[u32],
    seed: u64,
) -> Result<Found> {
    let kernel = &entry.kernel;
    let cases = cases(entry, seed)?;
    let exact = Tolerance {
        ulp: 0,
        absolute: 0.0,
        ..kernel.tolerance.clone()
    };
    let rules = Rules {
        tolerance: exact,
        flushes: inputs::flushes(kernel),
        hostile: true,
    };
    let numbers = Numbers::of(kernel);
    let mut found = Found::default();
    for case in &cases {
        let mut run = |words| {
            let program = entry.program(Some(Shader::SpirvPassthrough(words)), &[]);
            execute::on_vulkan(device, &program, case).map_err(|error| {
                Failure::input(
                    format!("kernel `{}` does not run: {error}", kernel.name),
                    "Were the two folders built from this crate, or from an older state of it?",
                )
            })
        };
        let (before, after) = (run(old)?, run(new)?);
        numbers.compare(case, &rules, None, &before, &after, &mut found);
    }
    Ok(found)
}
