//! From generated text to SPIR-V, through the compilers that other people have.

use std::fs;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

use crate::adopt;
use crate::job::{Job, Stage};
use crate::process::{Failure, run};
use crate::tools::Dxc;

/// GLSL 4.50 through glslang.
///
/// # Errors
/// [`Failure::Refused`] with the compiler's words; a crash or time-out.
pub fn glsl(glslang: &Path, job: &Job, out: &Path, limit: Duration) -> Result<Vec<u8>, Failure> {
    // OpenGL's names of what Vulkan calls otherwise; the numbers are the same where both begin at 0.
    let mut code = job.code.clone();
    if job.stage == Stage::Vertex {
        let refused = |e: std::io::Error| Failure::refused(format!("{}: {e}", code.display()));
        let text = fs::read_to_string(&code).map_err(refused)?;
        let text = text
            .replace("gl_VertexID", "gl_VertexIndex")
            .replace("gl_InstanceID", "gl_InstanceIndex");
        let adopted = out.with_extension("vulkan.vert");
        fs::write(&adopted, text).map_err(refused)?;
        code = adopted;
    }
    let mut command = Command::new(glslang);
    command
        .args(["-V", "--target-env", "vulkan1.1", "-S", stage(job), "-o"])
        .args([out, &code]);
    compile(&mut command, "glslangValidator", folder(job), limit)?;
    adopt::glsl(&compiled(out)?, job).map_err(Failure::refused)
}

/// HLSL through glslang's second front end. It does not know the attribute that says a storage
/// texture's format, so the format is the texture's own.
///
/// # Errors
/// As for [`glsl`].
pub fn hlsl_glslang(
    glslang: &Path,
    job: &Job,
    out: &Path,
    limit: Duration,
) -> Result<Vec<u8>, Failure> {
    let mut command = Command::new(glslang);
    command.args(["-D", "-V", "--target-env", "vulkan1.1", "-S", stage(job)]);
    command.args(["-e", &job.entry_point, "--no-storage-format"]);
    let registers = registers(job)?;
    if !registers.is_empty() {
        command.args(["--resource-set-binding", stage(job)]);
    }
    for (register, binding) in registers {
        command.args([register.as_str(), "0", &binding.to_string()]);
    }
    command.arg("-o").args([out, &job.code]);
    compile(&mut command, "glslangValidator", folder(job), limit)?;
    adopt::hlsl_glslang(&compiled(out)?, job).map_err(Failure::refused)
}

/// HLSL through DXC: for Direct3D, to see that it compiles, and to SPIR-V, which is given back.
/// Constant buffers are laid out as Direct3D does.
///
/// # Errors
/// As for [`glsl`].
pub fn hlsl_dxc(dxc: &Dxc, job: &Job, out: &Path, limit: Duration) -> Result<Vec<u8>, Failure> {
    let model = match job.stage {
        Stage::Compute { .. } => "cs",
        Stage::Vertex => "vs",
        Stage::Fragment => "ps",
    };
    let profile = format!("{model}_{}", SHADER_MODEL.replace('.', "_"));
    let numbers = option_of_numbers(&job.code)?;
    let mut direct3d = dxc.command(&job.code, &job.entry_point, &profile, out);
    direct3d.args(numbers);
    compile(&mut direct3d, "dxc", folder(job), limit)?;
    let mut arguments: Vec<String> = ["-spirv", "-fspv-target-env=vulkan1.1", "-fvk-use-dx-layout"]
        .map(String::from)
        .into();
    for (register, binding) in registers(job)? {
        arguments.extend([
            "-fvk-bind-register".into(),
            register,
            "0".into(),
            binding.to_string(),
            "0".into(),
        ]);
    }
    let mut command = dxc.command(&job.code, &job.entry_point, &profile, out);
    command.args(arguments);
    command.args(numbers);
    compile(&mut command, "dxc", folder(job), limit)?;
    adopt::hlsl(&compiled(out)?, job).map_err(Failure::refused)
}

/// DXC's option for a text with halves: without it a `half` is a `float`.
fn option_of_numbers(code: &Path) -> Result<Option<&'static str>, Failure> {
    let text = fs::read_to_string(code).map_err(|error| Failure::refused(error.to_string()))?;
    let mut words = text.split(|letter: char| !letter.is_alphanumeric() && letter != '_');
    let is_half = |word: &str| matches!(word, "half" | "half2" | "half3" | "half4");
    Ok(words.any(is_half).then_some("-enable-16bit-types"))
}

/// The shader model that HLSL is written and compiled for: the first with 64-bit floats in
/// buffers.
pub const SHADER_MODEL: &str = "6.2";

/// The registers that the manifest names, and the bindings that they stand for. A compiler refuses
/// a text with others, or they stay unbound.
fn registers(job: &Job) -> Result<Vec<(String, u32)>, Failure> {
    let bound = job
        .slots
        .iter()
        .filter_map(|s| Some((s, s.binding?, s.place.as_ref()?)));
    bound
        .map(|(slot, binding, place)| match place.index {
            Some(index) => Ok((format!("{}{index}", place.class), binding)),
            None => Err(Failure::refused(format!("`{}` has no register", slot.name))),
        })
        .collect()
}

const fn stage(job: &Job) -> &'static str {
    match job.stage {
        Stage::Compute { .. } => "comp",
        Stage::Vertex => "vert",
        Stage::Fragment => "frag",
    }
}

/// Runs a compiler on a file in `folder`. Its words name the file; here they need not say where it
/// lies.
///
/// # Errors
/// [`Failure::Refused`] with its words; a crash or time-out.
pub(crate) fn compile(
    command: &mut Command,
    program: &str,
    folder: &Path,
    limit: Duration,
) -> Result<(), Failure> {
    let done = run(command, limit)?;
    if done.status.success() {
        return Ok(());
    }
    let words = done.words().replace(&format!("{}/", folder.display()), "");
    Err(match done.crash() {
        Some(how) => Failure::Crashed {
            program: program.into(),
            how,
            log: words,
        },
        None => Failure::refused(format!("{program}: {words}")),
    })
}

fn folder(job: &Job) -> &Path {
    job.code.parent().unwrap_or(Path::new(""))
}

fn compiled(out: &Path) -> Result<Vec<u8>, Failure> {
    fs::read(out).map_err(|e| Failure::refused(format!("the compiler left no SPIR-V: {e}")))
}
