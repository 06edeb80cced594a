//! Every generated language, executed: each kernel goes through the compilers and drivers that will
//! meet it, and what they compute is compared with the native scalar run.
//!
//! - [`mod@column`]: the ways to run a kernel; [`tools`]: the foreign programs that they take.
//! - [`run`]: the matrix; [`report`]: what it found; [`known`]: differences that are known;
//!   [`absent`]: cells that are known not to run.
//! - [`job`]: what the processes that run kernels are told. Every one is a process of its own
//!   ([`process`]), so that a crash or a hang is a result like others: [`vulkan`] and [`gl`] are this
//!   program again ([`serve`]), [`webgpu`] is Node.js, [`msl`] a program made for each kernel.
//! - [`compile`] and [`adopt`]: foreign SPIR-V.

pub mod absent;
pub mod adopt;
mod cache;
pub mod column;
pub mod compile;
pub mod gl;
pub mod html;
pub mod job;
pub mod known;
mod locate;
mod machine;
pub mod msl;
pub mod prepare;
pub mod process;
pub mod report;
pub mod rules;
pub mod run;
mod serve;
pub mod subject;
mod table;
pub mod tools;
pub mod vulkan;
pub mod webgpu;

/// Runs a runner of this program's own, `vulkan` or `gl`, until its standard input ends.
///
/// # Errors
/// In words: there is no such runner, or no device.
pub fn serve(which: &str) -> Result<(), String> {
    match which {
        "vulkan" => vulkan::serve(false),
        "vulkan-as-it-is" => vulkan::serve(true),
        "gl" => gl::serve(),
        _ => Err(format!(
            "`{which}` is not a runner; there are vulkan and gl"
        )),
    }
}
