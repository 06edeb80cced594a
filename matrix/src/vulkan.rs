//! The runner for Vulkan, and for OpenGL ES as wgpu itself writes it: a process of its own around
//! `hankel_host`'s device.

use std::fs;

use hankel_dsl::native::describe::{Kernel, TexelFormat};
use hankel_host::device::{
    Device, DeviceError, Floats, Format, Program, Shader, TextureShape, VulkanDevice,
};
use hankel_host::inputs::{Case, Class, Input};
use hankel_host::parity::execute::{self, ExecuteError};
use serde::{Deserialize, Serialize};

use crate::adopt;
use crate::job::{Arg, Driver, Job, Kind};
use crate::serve::{self, Problem};

/// A job with what the host's device needs beyond it.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct VulkanJob {
    /// The job.
    #[serde(flatten)]
    pub job: Job,
    /// The kernel's description.
    pub description: Kernel,
    /// What the code is, and how it reaches the driver.
    pub way: Way,
}

/// How code reaches the driver.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Way {
    /// SPIR-V as it is.
    Spirv,
    /// SPIR-V, read and written anew by naga.
    SpirvThroughNaga,
    /// WGSL, read by naga.
    Wgsl,
}

/// Opens the device, and does the jobs of standard input until it ends. With `as_it_is` the device
/// computes as it does by itself; otherwise as IEEE 754 says, as far as it can.
///
/// # Errors
/// In words: why there is no device. What goes wrong with a job is its reply.
pub fn serve(as_it_is: bool) -> Result<(), String> {
    let mut device = VulkanDevice::new().map_err(|e| e.to_string())?;
    let mut name = device.name().to_owned();
    let mut floats = Floats::IEEE_754;
    if !as_it_is {
        floats = device.floats().map_err(|e| e.to_string())?;
        if !floats.are_ieee_754() {
            name = format!("{name}, {floats}");
        }
    }
    let rounds_products = device.rounds_products().map_err(|e| e.to_string())?;
    if rounds_products {
        name += ", samplers round products of weights";
    }
    let driver = Driver {
        name,
        flushes: floats.flushes && !floats.keeps_subnormals,
        rounds_products,
    };
    serve::serve(&driver, |job: &VulkanJob| {
        (job.job.id, run(&mut device, &floats, job))
    })
}

impl From<ExecuteError> for Problem {
    fn from(error: ExecuteError) -> Self {
        match error {
            ExecuteError::Device(DeviceError::Missing { feature, .. }) => Self {
                kind: Kind::Lacks,
                words: feature,
            },
            other => other.to_string().into(),
        }
    }
}

fn run(device: &mut VulkanDevice, floats: &Floats, it: &VulkanJob) -> Result<(), Problem> {
    let job = &it.job;
    let read = |path: &std::path::Path| {
        fs::read(path).map_err(|e| format!("cannot read {}: {e}", path.display()))
    };
    let code = read(&job.code)?;
    let inputs = read(&job.inputs)?;
    if it.way == Way::Spirv {
        adopt::check_formats(&code, job)?;
    }
    let words: Vec<u32> = code
        .chunks_exact(4)
        .map(|w| u32::from_le_bytes([w[0], w[1], w[2], w[3]]))
        .collect();
    let text = String::from_utf8_lossy(&code);
    let shader = match it.way {
        Way::Spirv => Shader::SpirvPassthrough(&words),
        Way::SpirvThroughNaga => Shader::SpirvThroughNaga(&words),
        Way::Wgsl => Shader::Wgsl {
            text: &text,
            entry_point: &job.entry_point,
        },
    };
    let program = Program {
        kernel: &it.description,
        constants: &[],
        native: None,
        shader: Some(shader),
    };
    let mut results = Vec::new();
    for case in cases(job, &inputs)? {
        let written = execute::on_vulkan(device, &program, &case, floats)?;
        results.extend(written.into_iter().flatten());
    }
    fs::write(&job.results, results)
        .map_err(|e| format!("cannot write {}: {e}", job.results.display()).into())
}

/// The cases as the host has them.
fn cases(job: &Job, inputs: &[u8]) -> Result<Vec<Case>, String> {
    let bytes = |offset: u64, length: u64| {
        usize::try_from(offset)
            .ok()
            .zip(usize::try_from(length).ok())
            .and_then(|(offset, length)| inputs.get(offset..)?.get(..length))
            .map(<[u8]>::to_vec)
            .ok_or_else(|| "an argument lies outside of the inputs".to_owned())
    };
    let arg = |arg: &Arg| -> Result<Input, String> {
        Ok(match arg {
            Arg::Bytes { offset, length } => Input::Bytes(bytes(*offset, *length)?),
            Arg::Texture {
                format,
                dimensions,
                size,
                levels,
                layers,
                samples,
                offset,
                length,
            } => {
                let format = if format == Format::Depth32.name() {
                    Format::Depth32
                } else {
                    let texel: TexelFormat = serde_json::from_value(format.as_str().into())
                        .map_err(|_| format!("`{format}` is not a format"))?;
                    Format::Texel(texel)
                };
                Input::Texture {
                    shape: TextureShape {
                        dimensions: *dimensions,
                        size: *size,
                        levels: *levels,
                        layers: *layers,
                        samples: *samples,
                        format,
                    },
                    bytes: bytes(*offset, *length)?,
                }
            }
            Arg::Sampler(sampler) => Input::Sampler(*sampler),
        })
    };
    job.cases
        .iter()
        .map(|case| {
            Ok(Case {
                class: Class::Ordinary,
                what: None,
                args: case.args.iter().map(arg).collect::<Result<_, _>>()?,
                invocations: case.invocations as usize,
            })
        })
        .collect()
}
