use std::collections::BTreeMap;

use hankel_dsl::native::describe::Kernel;
use hankel_host::device::{Bind, Device, DeviceError, Program, Shader, VulkanDevice};
use hankel_numerics::accuracy::singularities;
use hankel_numerics::biases;
use hankel_numerics::families::{ORDERS, Precision};
use hankel_numerics::peer::default_python;
use hankel_numerics::report::Report;
use hankel_numerics::stress::{self, BackendError, Native, shadows};
use hankel_system::output;

use super::args::{Rival, Stress};
use super::{command_line, deliver};
use crate::args::{self, Backend, Format};
use crate::failure::{Outcome, Result};
use crate::progress::Progress;
use crate::session::Session;

/// Moment vectors whose singularities are looked at in passing.
const SINGULARITIES: u64 = 100;

pub fn run(args: &Stress, quiet: bool) -> Result<Outcome> {
    if let Some(folder) = &args.out {
        output::folder(folder)?;
    }
    let progress = Progress::new(quiet || args.format == Format::Json);
    progress.begin("Measuring bounds");
    let (report, passed) = if args.biases {
        (of_biases(args, &progress)?, true)
    } else if args.shadows {
        of_shadows(args, &progress)?
    } else if args.singularities {
        of_singularities(args, args.samples, &progress)?
    } else {
        let (mut report, passed) = of_families(args, quiet, &progress)?;
        let (rest, there) = if args.family.is_empty() {
            of_singularities(args, Some(SINGULARITIES), &progress)?
        } else {
            (Report::default(), true)
        };
        report.append(rest);
        (report, passed && there)
    };
    drop(progress);
    deliver(
        &report,
        args.out.as_deref(),
        "stress",
        &[],
        args.format,
        quiet,
    )?;
    Ok(Outcome::of(passed))
}

fn orders(args: &Stress) -> Vec<usize> {
    if args.n.is_empty() {
        return ORDERS.collect();
    }
    let mut orders: Vec<usize> = args.n.iter().map(|n| usize::from(*n)).collect();
    orders.sort_unstable();
    orders.dedup();
    orders
}

fn precisions(args: &Stress) -> Vec<Precision> {
    match args.precision {
        Some(args::Precision::F32) => vec![Precision::F32],
        Some(args::Precision::F64) => vec![Precision::F64],
        None => vec![Precision::F32, Precision::F64],
    }
}

fn python(args: &Stress) -> Option<std::path::PathBuf> {
    args.against
        .map(|Rival::Diffmoments| args.python.clone().unwrap_or_else(default_python))
}

fn of_families(args: &Stress, quiet: bool, progress: &Progress) -> Result<(Report, bool)> {
    let mut options = stress::Options {
        families: stress::Options::families_named(&args.family)?,
        orders: orders(args),
        precisions: precisions(args),
        seed: args.seed,
        python: python(args),
        ..stress::Options::default()
    };
    if let Some(samples) = args.samples {
        options.samples = samples;
    }
    let (mut scalar, mut lanes) = (Native::scalar(), Native::lanes());
    let mut backends: Vec<&mut dyn stress::Backend> = vec![&mut scalar, &mut lanes];
    let mut vulkan = match args.backend {
        Backend::Native => None,
        Backend::Vulkan => Some(Vulkan::open(quiet)?),
    };
    if let Some(vulkan) = &mut vulkan {
        backends.push(vulkan);
    }
    let found = stress::run(&options, &mut backends, &mut |step| progress.detail(step))?;
    Ok((found.report(&command_line()), found.passed()))
}

fn of_singularities(
    args: &Stress,
    samples: Option<u64>,
    progress: &Progress,
) -> Result<(Report, bool)> {
    let mut options = singularities::Options {
        orders: orders(args),
        precisions: precisions(args),
        seed: args.seed,
        python: python(args),
        ..singularities::Options::default()
    };
    if let Some(samples) = samples {
        options.samples = samples;
    }
    let found = singularities::measure(&options, &mut |step| progress.detail(step))?;
    Ok((found.report(&command_line()), found.passed()))
}

fn of_shadows(args: &Stress, progress: &Progress) -> Result<(Report, bool)> {
    let mut options = shadows::Options {
        precisions: precisions(args),
        seed: args.seed,
        ..shadows::Options::default()
    };
    if let Some(samples) = args.samples {
        options.samples = samples;
    }
    let found = shadows::measure(&options, &mut |step| progress.detail(step))?;
    Ok((found.report(&command_line()), found.passed()))
}

fn of_biases(args: &Stress, progress: &Progress) -> Result<Report> {
    let mut options = biases::Options {
        seed: args.seed,
        ..biases::Options::default()
    };
    if let Some(samples) = args.samples {
        options.samples = samples;
    }
    let found = biases::measure(&options, &mut |step| progress.detail(step))?;
    Ok(found.report(&command_line()))
}

/// A Vulkan device with the built-in kernels' SPIR-V.
struct Vulkan {
    device: VulkanDevice,
    words: BTreeMap<String, Vec<u32>>,
}

impl Vulkan {
    fn open(quiet: bool) -> Result<Self> {
        // Whether there is a driver shows before anything else is done.
        let device = VulkanDevice::new()?;
        let words = Session::linked(quiet).all_words()?;
        Ok(Self { device, words })
    }

    fn dispatch(
        &mut self,
        program: &Program<'_>,
        uniform: &[u8],
        elements: &[u8],
        output: usize,
    ) -> hankel_host::device::Result<Vec<u8>> {
        let buffer = self.device.buffer("output", output)?;
        let binds = [
            Bind::Bytes(uniform),
            Bind::Bytes(elements),
            Bind::Buffer(buffer),
        ];
        let written = self
            .device
            .dispatch(program, &binds)
            .and_then(|()| self.device.read_buffer(buffer));
        self.device.free_buffer(buffer)?;
        written
    }
}

impl stress::Backend for Vulkan {
    fn name(&self) -> String {
        self.device.name().into()
    }

    fn run(
        &mut self,
        kernel: &Kernel,
        uniform: &[u8],
        elements: &[u8],
        output: usize,
    ) -> std::result::Result<Vec<u8>, BackendError> {
        let words = self
            .words
            .get(&kernel.name)
            .cloned()
            .ok_or_else(|| BackendError::Lacks("this program has no SPIR-V of it".into()))?;
        let program = Program {
            kernel,
            constants: &[],
            native: None,
            // On purpose, pinned or not: what a driver may do with the sums is what is measured.
            shader: Some(Shader::SpirvThroughNaga(&words)),
        };
        self.dispatch(&program, uniform, elements, output)
            .map_err(|error| match error {
                DeviceError::Missing { .. } => BackendError::Lacks(error.to_string()),
                error => BackendError::Failed(error.to_string()),
            })
    }
}
