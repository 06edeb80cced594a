//! The numbers of two builds: their SPIR-V on the inputs of parity.

use std::collections::BTreeMap;
use std::time::Duration;

use hankel_dsl::native::describe::Tolerance;
use hankel_host::crates::KernelEntry;
use hankel_host::device::{Device, Floats, Shader, VulkanDevice};
use hankel_host::inputs;
use hankel_host::parity::execute;
use hankel_host::parity::numbers::{Found, Numbers, Rules};

use super::module;
use crate::args::Diff;
use crate::failure::{Failure, Result};
use crate::progress::Progress;
use crate::session::{Session, cases};

/// Seconds that the inputs of a kernel may take.
const LIMIT: Duration = Duration::from_secs(120);

/// Runs the old and the new SPIR-V of the kernels called `names`.
pub fn numbers(args: &Diff, names: &[String], quiet: bool) -> Result<BTreeMap<String, Found>> {
    let session = Session::open(args.manifest_path.as_deref(), quiet)?;
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
        let (old, new) = (module(&args.old, name)?, module(&args.new, name)?);
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
        rounds_products: false,
        hostile: true,
    };
    let numbers = Numbers::of(kernel);
    let mut found = Found::default();
    for case in &cases {
        let mut run = |words| {
            let program = entry.program(Some(Shader::SpirvPassthrough(words)), &[]);
            // Both as the device computes by itself.
            execute::on_vulkan(device, &program, case, &Floats::IEEE_754).map_err(|error| {
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
