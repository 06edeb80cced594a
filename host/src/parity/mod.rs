//! Whether every way to run a kernel gives what its native scalar code gives.
//!
//! The reference is the native run on one thread, invocation by invocation, without SIMD lanes.
//! Against it: the native run on lanes and all cores; the SPIR-V handed to the driver as it is;
//! the same SPIR-V read and written anew by naga; and the WGSL, read by naga. The driver is
//! forbidden to reorder what naga wrote ([`translate`]). A difference that the first of
//! these shows comes from rust-gpu or the driver, one that only the others show from naga.
//!
//! A kernel without tolerance gives the same bits for all inputs. A tolerance is for inputs as in
//! use; absurd ones, for which no condition is bounded, are then compared in that what is finite
//! in the reference is finite.
//!
//! NaN equals NaN, and zeros are equal whatever their signs. Vertex and fragment stages get no
//! subnormal numbers, and theirs count as zero ([`inputs::flushes`]).

pub mod capture;
pub mod compare;
pub mod execute;
pub mod numbers;
mod table;
pub mod translate;

use std::fmt;

use hankel_dsl::native::Mode;
use hankel_dsl::native::describe::{Kernel, Tolerance};
use serde::{Deserialize, Serialize};

use crate::crates::KernelEntry;
use crate::device::slots::{self, Use};
use crate::device::{Device, NativeDevice, Shader};
use crate::flat;
use crate::inputs::{self, Case, Class, Input};
use execute::Arithmetic;
use numbers::{Found, Numbers, Rules};

/// A way to run a kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Path {
    /// Natively, on SIMD lanes and all cores.
    NativeLanes,
    /// SPIR-V as it is.
    SpirvPassthrough,
    /// SPIR-V through naga.
    SpirvThroughNaga,
    /// WGSL.
    Wgsl,
}

impl Path {
    /// All of them.
    pub const ALL: [Self; 4] = [
        Self::NativeLanes,
        Self::SpirvPassthrough,
        Self::SpirvThroughNaga,
        Self::Wgsl,
    ];
}

impl fmt::Display for Path {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NativeLanes => "native lanes",
            Self::SpirvPassthrough => "SPIR-V",
            Self::SpirvThroughNaga => "SPIR-V via naga",
            Self::Wgsl => "WGSL",
        })
    }
}

/// WGSL of a kernel.
#[derive(Clone, Copy, Debug)]
pub struct Wgsl<'a> {
    /// The text, with the constants' defaults in it.
    pub text: &'a str,
    /// The entry point's name in it.
    pub entry_point: &'a str,
}

/// A kernel with all its code. A text in place of code says why there is none.
#[derive(Clone, Debug)]
pub struct Subject<'a> {
    /// Description and native code.
    pub entry: &'a KernelEntry,
    /// Its SPIR-V.
    pub spirv: Result<&'a [u32], String>,
    /// Its WGSL.
    pub wgsl: Result<Wgsl<'a>, String>,
}

/// What was found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// The native device.
    pub native: String,
    /// The Vulkan device.
    pub vulkan: String,
    /// Seed of the inputs.
    pub seed: u64,
    /// The kernels.
    pub kernels: Vec<KernelReport>,
    /// Whether all passed.
    pub passed: bool,
}

/// What was found for one kernel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct KernelReport {
    /// Its name.
    pub kernel: String,
    /// What it may differ by on Vulkan, and why.
    pub tolerance: Tolerance,
    /// Invocations of each class.
    pub cases: Vec<(Class, u64)>,
    /// Values of the reference that are not finite, though every input is.
    pub non_finite: u64,
    /// Why the reference itself did not run.
    pub error: Option<String>,
    /// The ways it was run.
    pub paths: Vec<PathReport>,
    /// Whether all passed.
    pub passed: bool,
}

/// What was found for one way to run a kernel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PathReport {
    /// Which way.
    pub path: Path,
    /// How it ended.
    pub outcome: Outcome,
    /// What the comparison found.
    #[serde(flatten)]
    pub found: Found,
}

/// How a way to run a kernel ended.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "kind")]
pub enum Outcome {
    /// All numbers are within the tolerance.
    Passed,
    /// Some are not.
    Failed,
    /// It did not run.
    Error {
        /// Why.
        message: String,
    },
    /// There is no such code.
    Unavailable {
        /// Why.
        reason: String,
    },
}

/// What the lanes promise.
fn lanes_tolerance() -> Tolerance {
    Tolerance {
        ulp: 0,
        absolute: 0.0,
        why: "SIMD lanes neither fuse nor reorder".into(),
    }
}

/// Compares all ways to run each of `subjects` on `vulkan` and natively. `progress` gets each
/// kernel's name before it runs.
///
/// Failures of a kernel are part of the report; nothing stops the others.
pub fn run(
    vulkan: &mut dyn Device,
    subjects: &[Subject<'_>],
    seed: u64,
    progress: &mut dyn FnMut(&str),
) -> Report {
    let mut lanes = NativeDevice::new();
    let mut kernels = Vec::with_capacity(subjects.len());
    for subject in subjects {
        progress(&subject.entry.kernel.name);
        kernels.push(kernel(vulkan, &mut lanes, subject, seed));
    }
    Report {
        native: lanes.name().into(),
        vulkan: vulkan.name().into(),
        seed,
        passed: kernels.iter().all(|k| k.passed),
        kernels,
    }
}

fn kernel(
    vulkan: &mut dyn Device,
    lanes: &mut NativeDevice,
    subject: &Subject<'_>,
    seed: u64,
) -> KernelReport {
    let kernel = &subject.entry.kernel;
    let cases = inputs::cases(kernel, seed);
    let mut report = KernelReport {
        kernel: kernel.name.clone(),
        tolerance: kernel.tolerance.clone(),
        cases: count(&cases),
        non_finite: 0,
        error: None,
        paths: Vec::new(),
        passed: false,
    };
    let mut scalar = NativeDevice::with_mode(Mode::REFERENCE);
    let program = subject.entry.program(None, &[]);
    let mut references = Vec::with_capacity(cases.len());
    for case in &cases {
        match execute::dispatch(&mut scalar, &program, case) {
            Ok(written) => references.push(written),
            Err(e) => {
                report.error = Some(format!("{} inputs, native scalar run: {e}", case.class));
                return report;
            }
        }
    }
    let numbers = Numbers::of(kernel);
    report.non_finite = references.iter().map(|w| numbers.non_finite(w)).sum();
    for path in Path::ALL {
        let (shader, tolerance) = match path {
            Path::NativeLanes => (Ok(None), lanes_tolerance()),
            Path::SpirvPassthrough => (
                subject
                    .spirv
                    .as_ref()
                    .map(|w| Some(Shader::SpirvPassthrough(w))),
                kernel.tolerance.clone(),
            ),
            Path::SpirvThroughNaga => (
                subject
                    .spirv
                    .as_ref()
                    .map(|w| Some(Shader::SpirvThroughNaga(w))),
                kernel.tolerance.clone(),
            ),
            Path::Wgsl => (
                subject.wgsl.as_ref().map(|w| {
                    Some(Shader::Wgsl {
                        text: w.text,
                        entry_point: w.entry_point,
                    })
                }),
                kernel.tolerance.clone(),
            ),
        };
        let rules = Rules::of(kernel, tolerance);
        let mut there = PathReport {
            path,
            outcome: Outcome::Passed,
            found: Found::default(),
        };
        match shader {
            Err(reason) => {
                there.outcome = Outcome::Unavailable {
                    reason: reason.clone(),
                }
            }
            Ok(shader) => {
                let program = subject.entry.program(shader, &[]);
                for (case, reference) in cases.iter().zip(&references) {
                    let result = if path == Path::NativeLanes {
                        execute::dispatch(lanes, &program, case).map_err(|e| e.to_string())
                    } else {
                        execute::on_vulkan(vulkan, &program, case, Arithmetic::Pinned)
                            .map_err(|e| e.to_string())
                    };
                    match result {
                        Ok(written) => {
                            numbers.compare(case, &rules, reference, &written, &mut there.found);
                        }
                        Err(message) => {
                            let message = format!("{} inputs: {message}", case.class);
                            there.outcome = Outcome::Error { message };
                            break;
                        }
                    }
                }
            }
        }
        if there.found.beyond > 0 && there.outcome == Outcome::Passed {
            there.outcome = Outcome::Failed;
        }
        report.paths.push(there);
    }
    report.passed = report
        .paths
        .iter()
        .all(|p| matches!(p.outcome, Outcome::Passed | Outcome::Unavailable { .. }));
    report
}

fn count(cases: &[Case]) -> Vec<(Class, u64)> {
    Class::ALL
        .into_iter()
        .map(|class| {
            let of_class = cases.iter().filter(|c| c.class == class);
            (class, of_class.map(|c| c.invocations as u64).sum())
        })
        .collect()
}

/// Whether a case's arguments hold only finite numbers, for tests of the inputs themselves.
#[must_use]
pub fn is_finite(kernel: &Kernel, case: &Case) -> bool {
    slots::slots(kernel)
        .iter()
        .zip(&case.args)
        .all(|(slot, arg)| {
            let (Input::Bytes(bytes), Some(stride)) = (arg, slot.role.element_bytes()) else {
                return true;
            };
            let leaves = match slot.role {
                Use::Uniform(l) | Use::Element(l) | Use::Storage(l) => flat::leaves(l),
                Use::Attribute(_, ty) | Use::Varying(_, ty) => flat::type_leaves(ty),
                _ => return true,
            };
            bytes.chunks_exact(stride).all(|e| {
                leaves.iter().all(|l| {
                    flat::Number::read(l.scalar, &e[l.offset..])
                        .to_f64()
                        .is_finite()
                })
            })
        })
}
