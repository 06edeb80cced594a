//! What runs a column's kernels: compilers, and a runner that lives as long as it does not fail.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use hankel_dsl::native::describe::Kernel;
use hankel_host::parity::execute::Written;
use serde::Serialize;

use super::Request;
use super::cells::Unit;
use crate::column::Column;
use crate::job::{Driver, Job};
use crate::process::{Failure, Runner};
use crate::tools::{Dxc, Tool};
use crate::vulkan::{VulkanJob, Way};
use crate::{compile, msl, webgpu};

/// What runs a column's kernels, one after the other.
pub(super) struct Engine<'a> {
    request: &'a Request,
    /// The folder of the whole run.
    work: &'a Path,
    column: Column,
    /// A folder of its own.
    folder: PathBuf,
    runner: Option<Runner>,
    /// Why no runner starts: it would not for the next kernel either.
    broken: Option<Failure>,
    dxc: Option<Dxc>,
    /// What runs them, once it has been started.
    pub(super) driver: Option<Driver>,
}

impl<'a> Engine<'a> {
    pub(super) fn new(request: &'a Request, work: &'a Path, column: Column, line: usize) -> Self {
        Self {
            request,
            work,
            column,
            folder: work.join(format!("{column}-{line}")),
            runner: None,
            broken: None,
            dxc: None,
            driver: None,
        }
    }

    /// Runs a kernel.
    pub(super) fn run(&mut self, unit: &Unit<'_>) -> Result<Vec<Written>, Failure> {
        let io = |what: &str, e: io::Error| Failure::refused(format!("{what}: {e}"));
        let kernel = unit.it.kernel();
        let extension = self.column.language().map_or("", |l| l.name());
        let folder = self.folder.join(&unit.it.subject.name);
        fs::create_dir_all(&folder).map_err(|e| io("making a folder for the work", e))?;
        let code = folder.join(format!("{}.{extension}", kernel.name));
        fs::write(&code, &unit.code.bytes).map_err(|e| io("writing the code", e))?;
        let results = folder.join("results");
        let mut job = unit
            .it
            .prepared
            .job(kernel, unit.code, &code, &unit.it.inputs, &results)
            .map_err(Failure::refused)?;
        job.id = unit.row as u64 + 1;
        let done = self.execute(&job, kernel, &folder);
        let bytes =
            done.and_then(|()| fs::read(&results).map_err(|e| io("the runner left no results", e)));
        // The work's folder would otherwise hold the results of all kernels at once.
        let _ = fs::remove_dir_all(&folder);
        unit.it
            .prepared
            .results(kernel, &bytes?)
            .map_err(Failure::refused)
    }

    fn execute(&mut self, job: &Job, kernel: &Kernel, folder: &Path) -> Result<(), Failure> {
        let limit = self.request.limit;
        let tools = &self.request.tools;
        let out = folder.join("compiled.spv");
        let missing = |tool: Tool| Failure::refused(format!("{} is gone", tool.name()));
        let compiled = match self.column {
            Column::Glsl => {
                let glslang = tools.glslang().ok_or_else(|| missing(Tool::Glslang))?;
                Some(compile::glsl(&glslang, job, &out, limit)?)
            }
            Column::HlslGlslang => {
                let glslang = tools.glslang().ok_or_else(|| missing(Tool::Glslang))?;
                Some(compile::hlsl_glslang(&glslang, job, &out, limit)?)
            }
            Column::HlslDxc => {
                let dxc = match self.dxc.take() {
                    Some(dxc) => dxc,
                    None => tools.dxc().map_err(Failure::refused)?,
                };
                let dxc = self.dxc.insert(dxc);
                Some(compile::hlsl_dxc(dxc, job, &out, limit)?)
            }
            Column::Msl => {
                let clang = tools.clang().ok_or_else(|| missing(Tool::Clang))?;
                let shared = self.work.join("msl");
                fs::create_dir_all(&shared)
                    .map_err(|e| Failure::refused(format!("making a folder: {e}")))?;
                return msl::run(&clang, &shared, job, limit);
            }
            _ => None,
        };
        let way = match self.column {
            Column::SpirvNaga => Way::SpirvThroughNaga,
            Column::Wgsl => Way::Wgsl,
            _ => Way::Spirv,
        };
        let job = match compiled {
            None => job.clone(),
            Some(words) => {
                let adopted = folder.join("adopted.spv");
                fs::write(&adopted, words)
                    .map_err(|e| Failure::refused(format!("writing SPIR-V: {e}")))?;
                Job {
                    code: adopted,
                    entry_point: job.kernel.clone(),
                    ..job.clone()
                }
            }
        };
        let id = job.id;
        let foreign = matches!(
            self.column,
            Column::Essl310 | Column::Essl300 | Column::WgslDawn | Column::WgslChromium
        );
        if foreign {
            self.ask(&job, id)
        } else {
            let job = VulkanJob {
                job,
                description: kernel.clone(),
                way,
            };
            self.ask(&job, id)
        }
    }

    fn ask(&mut self, job: &impl Serialize, id: u64) -> Result<(), Failure> {
        // Runners that start something themselves have the shorter limit for that.
        let limit = self.request.limit + Duration::from_secs(10);
        if let Some(failure) = &self.broken {
            return Err(failure.clone());
        }
        let lives = self.runner.as_mut().is_some_and(Runner::lives);
        let mut runner = match self.runner.take().filter(|_| lives) {
            Some(runner) => runner,
            None => self.start(limit)?,
        };
        let done = runner.ask(job, id, limit);
        // What one kernel broke is not the next one's: a driver may have lost its device.
        if matches!(done, Ok(()) | Err(Failure::Lacks { .. })) {
            self.runner = Some(runner);
        }
        done
    }

    fn start(&mut self, limit: Duration) -> Result<Runner, Failure> {
        let mut command = self.command()?;
        match Runner::start(&mut command, limit) {
            Ok(runner) => {
                self.driver = Some(Driver {
                    flushes: self.column.flushes() || runner.driver.flushes,
                    ..runner.driver.clone()
                });
                Ok(runner)
            }
            Err(failure) => {
                self.broken = Some(failure.clone());
                Err(failure)
            }
        }
    }

    /// The command of this column's runner.
    fn command(&self) -> Result<Command, Failure> {
        let request = self.request;
        let own = |mode: &str| {
            let mut command = Command::new(request.runner.first().map_or("".into(), |p| p.clone()));
            command.args(request.runner.iter().skip(1)).arg(mode);
            command
        };
        let swiftshader = || {
            request
                .tools
                .swiftshader()
                .ok_or_else(|| Failure::refused("SwiftShader is gone"))
        };
        let mut command = match self.column {
            Column::Essl310 | Column::Essl300 => own("gl"),
            Column::WgslDawn | Column::WgslChromium => {
                fs::create_dir_all(&self.folder)
                    .map_err(|e| Failure::refused(format!("making a folder: {e}")))?;
                webgpu::command(self.column, &request.tools, &self.folder, request.limit)
                    .map_err(Failure::refused)?
            }
            // What it is compared with flushes, too.
            Column::SpirvSwiftshader => own("vulkan-as-it-is"),
            _ => own("vulkan"),
        };
        // Mesa's layer for choosing among several GPUs complains on a machine without a desktop.
        command.env("NODEVICE_SELECT", "1");
        if matches!(
            self.column,
            Column::SpirvSwiftshader | Column::WgslDawn | Column::WgslChromium
        ) {
            let driver = swiftshader()?;
            command.env("VK_DRIVER_FILES", &driver);
            command.env("VK_ICD_FILENAMES", &driver);
        }
        Ok(command)
    }
}
