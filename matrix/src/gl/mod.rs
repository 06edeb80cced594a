//! GLSL ES, run by the OpenGL ES of this machine, without a window.
//!
//! The context comes from EGL itself and not from wgpu, whose OpenGL backend asks for desktop
//! OpenGL first: that would read the texts as a guest. What is compiled is a job's text, unchanged.
//!
//! - Compute stages run over buffers, textures and images that are bound as the job says.
//! - What a vertex stage returns comes back by transform feedback: unclipped, nothing drawn.
//! - A fragment stage draws a point into a pixel of its own for each invocation, behind a vertex
//!   stage that hands the varyings on.

mod context;
mod run;
mod texels;
mod text;

use crate::job::{Driver, Job};

use context::Context;

/// OpenGL ES, ready for jobs. It stays on the thread that opened it.
pub struct Gl {
    context: Context,
}

impl Gl {
    /// Opens the default device.
    ///
    /// # Errors
    /// What EGL or OpenGL says if there is none, or none with OpenGL ES 3.1.
    pub fn open() -> Result<Self, String> {
        Ok(Self {
            context: Context::open()?,
        })
    }

    /// The device, and the versions of OpenGL ES and of its language.
    #[must_use]
    pub fn name(&self) -> String {
        self.context.name()
    }

    /// Runs all cases of a job and writes its results.
    ///
    /// # Errors
    /// The log of the compiler or linker, whose lines are those of the text; what OpenGL refused;
    /// a job that does not fit its text or its inputs; a file that cannot be read or written.
    pub fn run(&mut self, job: &Job) -> Result<(), String> {
        let results = run::run(&mut self.context, job);
        let released = self.context.release();
        let results = results?;
        released?;
        std::fs::write(&job.results, results)
            .map_err(|error| format!("{}: {error}", job.results.display()))
    }
}

/// The runner: takes jobs from the standard input until it ends, answers on the standard output.
///
/// # Errors
/// No device; a line that is no job; an output that cannot be written.
pub fn serve() -> Result<(), String> {
    let mut gl = Gl::open()?;
    let driver = Driver {
        name: gl.name(),
        ..Driver::default()
    };
    crate::serve::serve(&driver, |job: &Job| {
        (job.id, gl.run(job).map_err(Into::into))
    })
}
