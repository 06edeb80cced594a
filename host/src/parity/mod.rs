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
use compare::{Distance, Kind};
use execute::Written;

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
    /// Invocations compared.
    pub cases: u64,
    /// Numbers compared.
    pub values: u64,
    /// The largest distance in units in the last place, or in steps of an integer or normalised
    /// format.
    pub largest_ulp: u64,
    /// The largest difference as numbers; `None` if it is not finite.
    pub largest_absolute: Option<f64>,
    /// Numbers beyond the tolerance.
    pub beyond: u64,
    /// The first number beyond the tolerance; else the first that differs at all.
    pub first: Option<Difference>,
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

/// Two numbers that differ.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Difference {
    /// Class of the inputs.
    pub class: Class,
    /// Invocation, or texel counted row by row.
    pub invocation: u64,
    /// Which number of the output.
    pub value: String,
    /// The reference's.
    pub expected: String,
    /// What came out.
    pub got: String,
    /// How far apart, in units in the last place or steps.
    pub ulp: u64,
    /// What that invocation read as its own: names and values.
    pub inputs: Vec<(String, String)>,
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
    let outputs = outputs(kernel);
    report.non_finite = references.iter().map(|w| non_finite(&outputs, w)).sum();
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
        let mut found = PathReport {
            path,
            outcome: Outcome::Passed,
            cases: 0,
            values: 0,
            largest_ulp: 0,
            largest_absolute: Some(0.0),
            beyond: 0,
            first: None,
        };
        match shader {
            Err(reason) => {
                found.outcome = Outcome::Unavailable {
                    reason: reason.clone(),
                }
            }
            Ok(shader) => {
                let program = subject.entry.program(shader, &[]);
                for (case, reference) in cases.iter().zip(&references) {
                    let result = if path == Path::NativeLanes {
                        execute::dispatch(lanes, &program, case).map_err(|e| e.to_string())
                    } else {
                        execute::on_vulkan(vulkan, &program, case).map_err(|e| e.to_string())
                    };
                    match result {
                        Ok(written) => {
                            compare(
                                kernel, case, &outputs, &tolerance, reference, &written, &mut found,
                            );
                        }
                        Err(message) => {
                            let message = format!("{} inputs: {message}", case.class);
                            found.outcome = Outcome::Error { message };
                            break;
                        }
                    }
                }
            }
        }
        if found.beyond > 0 && found.outcome == Outcome::Passed {
            found.outcome = Outcome::Failed;
        }
        report.paths.push(found);
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

/// The numbers of one thing that is written.
struct Out {
    /// Bytes of an element or texel.
    stride: usize,
    /// Name, type and place of each number of it.
    values: Vec<(String, Kind, usize)>,
}

/// What a kernel writes, in the order of its slots.
fn outputs(kernel: &Kernel) -> Vec<Out> {
    let mut all = Vec::new();
    for slot in slots::slots(kernel)
        .into_iter()
        .filter(|s| s.role.is_written())
    {
        let leaves = match slot.role {
            Use::Output { layout, .. } => flat::leaves(layout),
            Use::Interface(ty) => flat::type_leaves(ty),
            Use::Atomic => {
                let ty = hankel_dsl::native::describe::Type::Scalar {
                    scalar: hankel_dsl::native::describe::Scalar::U32,
                };
                flat::type_leaves(&ty)
            }
            Use::StorageTexture { format, .. } => {
                let kind = Kind::of(format);
                let values = ["r", "g", "b", "a"]
                    .into_iter()
                    .take(format.channels())
                    .enumerate()
                    .map(|(i, c)| (format!("{}.{c}", slot.name), kind, i * kind.bytes()))
                    .collect();
                all.push(Out {
                    stride: format.bytes(),
                    values,
                });
                continue;
            }
            _ => continue,
        };
        let values = leaves
            .into_iter()
            .map(|l| {
                (
                    flat::join(&slot.name, &l.path),
                    Kind::Scalar(l.scalar),
                    l.offset,
                )
            })
            .collect();
        all.push(Out {
            stride: slot.role.element_bytes().unwrap_or(1),
            values,
        });
    }
    all
}

/// Calls `f` with every number of what was written: element, name, distance.
fn each(
    outputs: &[Out],
    reference: &Written,
    written: &Written,
    flush: bool,
    mut f: impl FnMut(usize, &str, Distance),
) {
    for ((out, a), b) in outputs.iter().zip(reference).zip(written) {
        let elements = a.chunks_exact(out.stride).zip(b.chunks_exact(out.stride));
        for (i, (a, b)) in elements.enumerate() {
            for (name, kind, offset) in &out.values {
                f(i, name, kind.compare(&a[*offset..], &b[*offset..], flush));
            }
        }
    }
}

fn non_finite(outputs: &[Out], written: &Written) -> u64 {
    let mut n = 0;
    each(outputs, written, written, false, |_, _, d| {
        n += u64::from(!d.a.is_finite())
    });
    n
}

fn difference(kernel: &Kernel, case: &Case, i: usize, name: &str, d: &Distance) -> Difference {
    Difference {
        class: case.class,
        invocation: i as u64,
        value: name.into(),
        expected: format!("{:?}", d.a),
        got: format!("{:?}", d.b),
        ulp: d.ulp,
        inputs: inputs::of_invocation(kernel, case, i),
    }
}

fn compare(
    kernel: &Kernel,
    case: &Case,
    outputs: &[Out],
    tolerance: &Tolerance,
    reference: &Written,
    written: &Written,
    found: &mut PathReport,
) {
    found.cases += case.invocations as u64;
    let exact = tolerance.ulp == 0 && tolerance.absolute == 0.0;
    if case.class == Class::Hostile && !exact {
        each(outputs, reference, written, false, |i, name, d| {
            found.values += 1;
            if d.a.is_finite() && !d.b.is_finite() {
                found.beyond += 1;
                if found.beyond == 1 {
                    found.first = Some(difference(kernel, case, i, name, &d));
                }
            }
        });
        return;
    }
    let fits = |d: &Distance| d.ulp <= tolerance.ulp.into() || d.absolute <= tolerance.absolute;
    let lengths_differ = reference
        .iter()
        .map(Vec::len)
        .ne(written.iter().map(Vec::len));
    if lengths_differ {
        found.beyond += 1;
    }
    each(
        outputs,
        reference,
        written,
        inputs::flushes(kernel),
        |i, name, d| {
            found.values += 1;
            if d.ulp == 0 {
                return;
            }
            let first_beyond = !fits(&d) && found.beyond == 0;
            found.beyond += u64::from(!fits(&d));
            found.largest_ulp = found.largest_ulp.max(d.ulp);
            found.largest_absolute = found
                .largest_absolute
                .map(|x| x.max(d.absolute))
                .filter(|x| x.is_finite());
            if found.first.is_none() || first_beyond {
                found.first = Some(difference(kernel, case, i, name, &d));
            }
        },
    );
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
