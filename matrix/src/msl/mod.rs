//! Runs MSL without Metal: a C++ compiler takes the text as it is, with a stand-in for Metal's
//! standard library, and what it makes runs on the processor. The text must therefore be valid, and
//! mean what it should, but nothing is learnt of Apple's compiler.
//!
//! What a device would leave undefined ends a run: an access outside of a buffer, a write to one
//! that is only read, a barrier that not all threads reach, an overflow of a signed integer. The
//! threads of a workgroup go from barrier to barrier in an order that changes each time, so that a
//! barrier that is missing shows.

pub mod signature;
#[cfg(test)]
mod tests;

use std::collections::hash_map::DefaultHasher;
use std::fmt::Write as _;
use std::fs;
use std::hash::{Hash, Hasher};
use std::io;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use crate::compile::compile;
use crate::job::{Arg, Job, Role, Scalar, Slot, Stage, Value};
use crate::process::{Failure, run as run_program};
use signature::{Given, Member, Param, Part, Signature, Structure};

/// The files that every program is made of.
const PARTS: [(&str, &str); 5] = [
    ("metal_stdlib", include_str!("metal_stdlib")),
    ("simd/simd.h", include_str!("simd.h")),
    ("runner.h", include_str!("runner.h")),
    ("glue.h", include_str!("glue.h")),
    ("runner.cpp", include_str!("runner.cpp")),
];

/// Of every compilation. Literals without suffix are floats in MSL; nothing is contracted, so that
/// sums and products round as they do elsewhere; a loop without end must not vanish.
const FLAGS: [&str; 10] = [
    "-std=c++20",
    "-fdeclspec",
    "-ffp-contract=off",
    "-fno-strict-aliasing",
    "-fno-finite-loops",
    "-fno-exceptions",
    "-fno-rtti",
    "-Xclang",
    "-cl-single-precision-constant",
    "-w",
];

/// Of a kernel's own compilation.
const KERNEL_FLAGS: [&str; 3] = [
    "-O1",
    "-fsanitize=signed-integer-overflow,integer-divide-by-zero,float-cast-overflow,local-bounds",
    "-fsanitize-trap=all",
];

/// Runs `job`, whose text is MSL, with `compiler` (clang 16 or newer). `work` is a folder for files
/// that outlive a job: what all jobs share is compiled once. Compiler and program may each take
/// `timeout`.
///
/// # Errors
/// [`Failure`]; the results are then not written.
pub fn run(compiler: &Path, work: &Path, job: &Job, timeout: Duration) -> Result<(), Failure> {
    let text = fs::read_to_string(&job.code).doing(|| format!("read {}", job.code.display()))?;
    let signature = signature::parse(&text, &job.entry_point)
        .map_err(|problem| Failure::refused(format!("{}: {problem}", job.entry_point)))?;
    let main = main_text(job, &signature)?;
    let plan = plan(job)?;
    let shared = shared(compiler, work, timeout)?;
    let folder = tempfile::Builder::new()
        .prefix("job-")
        .tempdir_in(work)
        .doing(|| format!("make a folder in {}", work.display()))?;
    let folder = folder.path();
    write(&folder.join("kernel.metal"), &in_one_space(&text))?;
    write(&folder.join("main.cpp"), &main)?;
    write(&folder.join("plan"), &plan)?;
    let program = folder.join("program");
    let mut command = Command::new(compiler);
    command
        .args(FLAGS)
        .args(KERNEL_FLAGS)
        .arg("-include-pch")
        .arg(shared.join("glue.pch"))
        .arg("-I")
        .arg(&shared)
        .arg(folder.join("main.cpp"))
        .arg(shared.join("runner.o"))
        .args(["-nostdlib++", "-lm", "-o"])
        .arg(&program);
    compile(&mut command, "clang++", folder, timeout)?;
    let results = folder.join("results");
    let mut command = Command::new(&program);
    command
        .arg(folder.join("plan"))
        .arg(&job.inputs)
        .arg(&results);
    let done = run_program(&mut command, timeout)?;
    if !done.status.success() {
        return Err(crashed(done.status.to_string(), done.words()));
    }
    let bytes = fs::read(&results).doing(|| format!("read {}", results.display()))?;
    let expected = result_bytes(job);
    if bytes.len() as u64 != expected {
        return Err(crashed(
            "it ended well".into(),
            format!("{} bytes of results instead of {expected}", bytes.len()),
        ));
    }
    fs::write(&job.results, bytes).doing(|| format!("write {}", job.results.display()))
}

/// A failure of this machine, with what was being done.
trait Doing<T> {
    fn doing(self, what: impl FnOnce() -> String) -> Result<T, Failure>;
}

impl<T> Doing<T> for io::Result<T> {
    fn doing(self, what: impl FnOnce() -> String) -> Result<T, Failure> {
        self.map_err(|source| Failure::refused(format!("cannot {}: {source}", what())))
    }
}

fn write(path: &Path, text: &str) -> Result<(), Failure> {
    fs::write(path, text).doing(|| format!("write {}", path.display()))
}

/// What was compiled did not come to its end.
fn crashed(how: String, log: String) -> Failure {
    Failure::Crashed {
        program: "the kernel's program".into(),
        how,
        log,
    }
}

/// The folder with what all jobs share, made if it is not there: the headers, compiled, and the
/// runner. Its name tells apart versions of the parts and of the compiler.
fn shared(compiler: &Path, work: &Path, timeout: Duration) -> Result<PathBuf, Failure> {
    /// Of each compiler and folder for work, what was made.
    static MADE: Mutex<Vec<(PathBuf, PathBuf, PathBuf)>> = Mutex::new(Vec::new());
    let guard = MADE.lock();
    let mut made = guard.unwrap_or_else(PoisonError::into_inner);
    let known = made.iter().find(|(c, w, _)| c == compiler && w == work);
    if let Some((_, _, folder)) = known
        && folder.exists()
    {
        return Ok(folder.clone());
    }
    let mut hasher = DefaultHasher::new();
    (PARTS, FLAGS, KERNEL_FLAGS, compiler).hash(&mut hasher);
    let folder = work.join(format!("msl-{:016x}", hasher.finish()));
    let ready = folder.join("ready");
    if !ready.exists() {
        make_shared(compiler, &folder, timeout)?;
        write(&ready, "")?;
    }
    made.push((compiler.into(), work.into(), folder.clone()));
    Ok(folder)
}

/// Writes the parts and compiles what all programs have of them.
fn make_shared(compiler: &Path, folder: &Path, timeout: Duration) -> Result<(), Failure> {
    fs::create_dir_all(folder.join("simd")).doing(|| format!("make {}", folder.display()))?;
    for (name, text) in PARTS {
        write(&folder.join(name), text)?;
    }
    let mut header = Command::new(compiler);
    header
        .args(FLAGS)
        .args(KERNEL_FLAGS)
        .args(["-x", "c++-header", "-I"])
        .arg(folder)
        .arg(folder.join("glue.h"))
        .arg("-o")
        .arg(folder.join("glue.pch"));
    compile(&mut header, "clang++", folder, timeout)?;
    let mut runner = Command::new(compiler);
    runner
        .args([
            "-std=c++20",
            "-O2",
            "-ffp-contract=off",
            "-fno-exceptions",
            "-fno-rtti",
            "-c",
        ])
        .arg(folder.join("runner.cpp"))
        .arg("-o")
        .arg(folder.join("runner.o"));
    compile(&mut runner, "clang++", folder, timeout)
}

/// The text for a processor, which has one address space: of two templates that differ only in
/// whether a pointer is to `device` or to `threadgroup` memory, the second is taken out. Its lines
/// stay, empty, so that the compiler's messages name those of the text.
fn in_one_space(text: &str) -> String {
    const START: &str = "template <typename A>\n";
    let mut whole = String::with_capacity(text.len());
    let mut seen: Vec<String> = Vec::new();
    let mut parts = text.split(START);
    whole.push_str(parts.next().unwrap_or_default());
    for part in parts {
        let end = part.find("\n}\n").map_or(part.len(), |at| at + 3);
        let (template, rest) = part.split_at(end);
        let in_device = template.replace("threadgroup A", "device A");
        if seen.contains(&in_device) {
            let lines = START.matches('\n').count() + template.matches('\n').count();
            whole.extend(std::iter::repeat_n('\n', lines));
        } else {
            whole.push_str(START);
            whole.push_str(template);
            seen.push(in_device);
        }
        whole.push_str(rest);
    }
    whole
}

/// Bytes of all results.
fn result_bytes(job: &Job) -> u64 {
    let mut sum = 0;
    for case in &job.cases {
        for (slot, arg) in job.slots.iter().zip(&case.args) {
            if !slot.role.is_written() {
                continue;
            }
            sum += match (stream(&slot.role), arg) {
                (Some(value), _) => u64::from(case.invocations) * u64::from(value.size) * 4,
                (None, Arg::Bytes { length, .. } | Arg::Texture { length, .. }) => *length,
                (None, Arg::Sampler(_)) => 0,
            };
        }
    }
    sum
}

/// The type of what each vertex or fragment has of its own.
fn stream(role: &Role) -> Option<Value> {
    match *role {
        Role::Attribute { value, .. }
        | Role::Varying { value, .. }
        | Role::Passed { value, .. }
        | Role::ClipDistances { value }
        | Role::SecondSource { value }
        | Role::Target { value, .. } => Some(value),
        Role::Depth => Some(Value {
            scalar: Scalar::F32,
            size: 1,
        }),
        Role::Position => Some(Value {
            scalar: Scalar::F32,
            size: 4,
        }),
        _ => None,
    }
}

/// What the runner is told of the job, in words; runner.cpp reads them in this order: the stage, the
/// threads of a workgroup, how many slots and cases; of each slot its name, its kind and whether it
/// is written; of each case its invocations, its workgroups, and of each slot what it is given.
fn plan(job: &Job) -> Result<String, Failure> {
    let (stage, threads) = match job.stage {
        Stage::Compute { threads } => ("compute", threads),
        Stage::Vertex => ("vertex", [1; 3]),
        Stage::Fragment => ("fragment", [1; 3]),
    };
    let [x, y, z] = threads;
    if x.checked_mul(y)
        .and_then(|n| n.checked_mul(z))
        .is_none_or(|n| n == 0 || n > 1024)
    {
        return Err(Failure::refused(format!(
            "a workgroup of {x} × {y} × {z} threads"
        )));
    }
    let sizes = u32::from(job.sizes_slot.is_some()) as usize;
    let mut plan = format!(
        "{stage} {x} {y} {z} {} {}\n",
        job.slots.len() + sizes,
        job.cases.len()
    );
    // Writing to a string cannot fail.
    for slot in &job.slots {
        let kind = match &slot.role {
            Role::Uniform | Role::Read | Role::Write | Role::Atomic => "buffer",
            Role::Texture { .. } | Role::StorageTexture { .. } => "texture",
            Role::Sampler => "sampler",
            Role::Attribute { .. } | Role::Varying { .. } => "in",
            Role::Position
            | Role::Passed { .. }
            | Role::ClipDistances { .. }
            | Role::Depth
            | Role::Target { .. }
            | Role::SecondSource { .. } => "out",
        };
        let name: String = slot
            .name
            .chars()
            .map(|c| if c.is_ascii_graphic() { c } else { '?' })
            .take(60)
            .collect();
        let written = u32::from(slot.role.is_written());
        let _ = writeln!(plan, "_{name} {kind} {written}");
    }
    if sizes == 1 {
        plan.push_str("_sizes sizes 0\n");
    }
    for case in &job.cases {
        let [x, y, z] = case.groups;
        let _ = writeln!(plan, "{} {x} {y} {z}", case.invocations);
        if case.args.len() != job.slots.len() {
            return Err(Failure::refused(format!(
                "{} arguments for {} slots",
                case.args.len(),
                job.slots.len()
            )));
        }
        for (slot, arg) in job.slots.iter().zip(&case.args) {
            plan_arg(&mut plan, slot, arg)?;
        }
        if sizes == 1 {
            let _ = write!(plan, "{}", job.sized.len());
            for binding in &job.sized {
                let size = job
                    .slots
                    .iter()
                    .zip(&case.args)
                    .find(|(slot, _)| slot.binding == Some(*binding));
                match size {
                    Some((_, Arg::Bytes { length, .. })) => {
                        let _ = write!(plan, " {length}");
                    }
                    _ => return Err(Failure::refused(format!("the size of binding {binding}"))),
                }
            }
            plan.push('\n');
        }
    }
    Ok(plan)
}

fn plan_arg(plan: &mut String, slot: &Slot, arg: &Arg) -> Result<(), Failure> {
    let stride = stream(&slot.role).map(|value| value.size * 4);
    let _ = match (&slot.role, arg) {
        (Role::Sampler, Arg::Sampler(sampler)) => {
            if sampler.anisotropy != 1 {
                return Err(Failure::refused(
                    "which samples an anisotropic filter takes is not said",
                ));
            }
            // As runner.h numbers them.
            let [u, v, w] = sampler.address.map(|it| it as u32);
            let compare = sampler.compare.map_or(0, |it| it as u32 + 1);
            let flags = [
                (sampler.magnify as u32, 0),
                (sampler.minify as u32, 1),
                (sampler.mip as u32 + 1, 2),
                (u, 4),
                (v, 6),
                (w, 8),
                (compare, 10),
            ];
            let flags = flags.iter().fold(0, |sum, (what, at)| sum | what << at);
            writeln!(plan, "{flags}")
        }
        (
            Role::Texture { .. } | Role::StorageTexture { .. },
            Arg::Texture {
                format,
                size: [x, y, z],
                levels,
                layers,
                samples,
                offset,
                length,
                ..
            },
        ) => {
            // Depths are floats.
            let format = if format == "depth32float" {
                "r32float"
            } else {
                format
            };
            if !format.chars().all(|c| c.is_ascii_alphanumeric()) || format.is_empty() {
                return Err(Failure::refused(format!("texture format `{format}`")));
            }
            writeln!(
                plan,
                "{format} {x} {y} {z} {levels} {layers} {samples} {offset} {length}"
            )
        }
        (
            Role::Position
            | Role::Passed { .. }
            | Role::ClipDistances { .. }
            | Role::Depth
            | Role::Target { .. }
            | Role::SecondSource { .. },
            _,
        ) => {
            writeln!(plan, "{}", stride.unwrap_or_default())
        }
        (Role::Attribute { .. } | Role::Varying { .. }, Arg::Bytes { offset, length }) => {
            writeln!(plan, "{} {offset} {length}", stride.unwrap_or_default())
        }
        (
            Role::Uniform | Role::Read | Role::Write | Role::Atomic,
            Arg::Bytes { offset, length },
        ) => writeln!(plan, "{offset} {length}"),
        _ => {
            return Err(Failure::refused(format!(
                "{arg:?} for `{}`, {:?}",
                slot.name, slot.role
            )));
        }
    };
    Ok(())
}

/// The program's own text: it includes the kernel's unchanged and hands it its arguments.
fn main_text(job: &Job, signature: &Signature) -> Result<String, Failure> {
    let stage = match job.stage {
        Stage::Compute { .. } => "kernel",
        Stage::Vertex => "vertex",
        Stage::Fragment => "fragment",
    };
    if signature.stage != stage {
        return Err(Failure::refused(format!(
            "`{}` is a {}, not a {stage}",
            job.entry_point, signature.stage
        )));
    }
    let mut glue = Glue::default();
    for (i, param) in signature.params.iter().enumerate() {
        glue.param(job, i, param)?;
    }
    match &signature.returns {
        None if stage == "kernel" => {}
        None => {
            return Err(Failure::refused(format!(
                "`{}` returns nothing",
                job.entry_point
            )));
        }
        Some(_) if stage == "kernel" => {
            return Err(Failure::refused(format!(
                "`{}` returns a value",
                job.entry_point
            )));
        }
        Some(structure) => glue.returned(job, structure)?,
    }
    let Glue {
        before,
        arguments,
        after,
        buffers,
        workgroup,
    } = glue;
    let entry = &job.entry_point;
    let arguments = arguments.join(", ");
    let call = if after.is_empty() {
        format!("    ::{entry}({arguments});\n")
    } else {
        format!(
            "    auto msl_out = ::{entry}({arguments});\n    if (msl->helper)\n        return;\n{after}"
        )
    };
    Ok(format!(
        "#include \"glue.h\"\n\
         #line 1 \"kernel.metal\"\n\
         #include \"kernel.metal\"\n\
         #line 1 \"main.cpp\"\n\
         using msl_parts = msl_glue::parts<decltype(&::{entry})>;\n\
         static_assert(msl_parts::count == {params}, \"parameters\");\n\
         {tables}\
         const bool msl_has_barriers = {barriers};\n\
         const bool msl_has_derivatives = {derivatives};\n\
         void msl_invoke(const msl_call *msl) {{\n{before}{call}}}\n",
        params = signature.params.len(),
        tables = [
            table("msl_buffers", "msl_buffer_count", &buffers),
            table("msl_workgroup", "msl_workgroup_count", &workgroup)
        ]
        .concat(),
        barriers = signature.barriers,
        derivatives = signature.derivatives,
    ))
}

/// A table of parameters that are memory: the slot and the parameter's number of each.
fn table(name: &str, count: &str, rows: &[(usize, usize)]) -> String {
    let mut text = format!("const unsigned {count} = {};\n", rows.len());
    let _ = writeln!(text, "const msl_memory {name}[] = {{");
    for (slot, param) in rows {
        let target = format!("msl_glue::target<msl_parts::arg<{param}>>");
        let _ = writeln!(text, "    {{{slot}, sizeof({target}), alignof({target})}},");
    }
    // An array has at least one element.
    text.push_str("    {~0u, 0, 1},\n};\n");
    text
}

/// Parts of the function that calls the kernel.
#[derive(Default)]
struct Glue {
    before: String,
    arguments: Vec<String>,
    after: String,
    buffers: Vec<(usize, usize)>,
    workgroup: Vec<(usize, usize)>,
}

impl Glue {
    fn param(&mut self, job: &Job, i: usize, param: &Param) -> Result<(), Failure> {
        let of = format!("msl_parts::arg<{i}>");
        let argument = match &param.given {
            Given::Buffer(n) if job.sizes_slot == Some(*n) => {
                self.buffers.push((job.slots.len(), i));
                format!("msl_glue::memory<{of}>(msl->slots[{}])", job.slots.len())
            }
            Given::Buffer(n) => {
                let slot = bound(job, param, "buffer", *n)?;
                self.buffers.push((slot, i));
                format!("msl_glue::memory<{of}>(msl->slots[{slot}])")
            }
            Given::Texture(n) => {
                let slot = bound(job, param, "texture", *n)?;
                format!("msl_glue::texture<{of}>(msl->slots[{slot}])")
            }
            Given::Sampler(n) => {
                let slot = bound(job, param, "sampler", *n)?;
                format!("msl_glue::sampler<{of}>(msl->slots[{slot}])")
            }
            Given::Threadgroup => {
                self.workgroup.push((self.workgroup.len(), i));
                format!(
                    "msl_glue::memory<{of}>(msl->workgroup[{}])",
                    self.workgroup.len() - 1
                )
            }
            Given::Position(name) if job.stage == Stage::Fragment => match name.as_str() {
                "position" => format!("msl_glue::vector<{of}>(msl->coord)"),
                "front_facing" => "true".into(),
                "sample_id" => "0u".into(),
                "sample_mask" => "1u".into(),
                "primitive_id" => format!("msl_glue::number<{of}>(msl->invocation)"),
                _ => return Err(Failure::refused(format!("`{name}` in this stage"))),
            },
            Given::Position(name) => {
                let field = match (name.as_str(), job.stage) {
                    ("vertex_id", Stage::Vertex) => "invocation",
                    ("instance_id" | "base_vertex", Stage::Vertex) => "zero",
                    ("vertex_id" | "instance_id" | "base_vertex", _)
                    | (_, Stage::Vertex | Stage::Fragment) => {
                        return Err(Failure::refused(format!("`{name}` in this stage")));
                    }
                    (name, Stage::Compute { .. }) => name,
                };
                format!("msl_glue::number<{of}>(msl->{field})")
            }
            Given::StageIn(structure) => {
                let _ = writeln!(self.before, "    {} msl_in = {{}};", structure.name);
                for member in &structure.members {
                    let slot = own(job, member)?;
                    let _ = writeln!(
                        self.before,
                        "    msl_glue::fetch(msl_in.{}, msl->slots[{slot}], msl->invocation);",
                        member.name
                    );
                }
                "msl_in".into()
            }
        };
        self.arguments.push(argument);
        Ok(())
    }

    fn returned(&mut self, job: &Job, structure: &Structure) -> Result<(), Failure> {
        let mut left: Vec<usize> = (0..job.slots.len())
            .filter(|&i| job.slots[i].role.is_written() && stream(&job.slots[i].role).is_some())
            .collect();
        for member in &structure.members {
            if member.part == Part::Mask {
                let _ = writeln!(
                    self.after,
                    "    if (!(msl_out.{} & 1u))\n        return;",
                    member.name
                );
            }
        }
        for member in &structure.members {
            if member.part == Part::Mask {
                continue;
            }
            let slot = own(job, member)?;
            left.retain(|&i| i != slot);
            let value = match member.part {
                // As devices do.
                Part::Depth => format!("metal::clamp(msl_out.{}, 0.0f, 1.0f)", member.name),
                _ => format!("msl_out.{}", member.name),
            };
            let _ = writeln!(
                self.after,
                "    msl_glue::put({value}, msl->slots[{slot}], msl->invocation);"
            );
        }
        match left.first() {
            None => Ok(()),
            Some(&i) => Err(Failure::refused(format!(
                "`{}` is nothing that `{}` has",
                job.slots[i].name, structure.name
            ))),
        }
    }
}

/// The slot that is bound as `class` `n`.
fn bound(job: &Job, param: &Param, class: &str, n: u32) -> Result<usize, Failure> {
    let found = job.slots.iter().position(|slot| {
        slot.place
            .as_ref()
            .is_some_and(|place| place.class == class && place.index == Some(n))
    });
    let fits = |role: &Role| match role {
        Role::Uniform | Role::Read | Role::Write | Role::Atomic => class == "buffer",
        Role::Texture { .. } | Role::StorageTexture { .. } => class == "texture",
        Role::Sampler => class == "sampler",
        _ => false,
    };
    found
        .filter(|&i| fits(&job.slots[i].role))
        .ok_or_else(|| Failure::refused(format!("no slot for `{}` [[{class}({n})]]", param.name)))
}

/// The slot of what a vertex or fragment has of its own.
fn own(job: &Job, member: &Member) -> Result<usize, Failure> {
    let found = job.slots.iter().position(|slot| match slot.role {
        Role::Attribute { location, .. } => member.part == Part::Attribute(location),
        Role::Varying { location, .. } | Role::Passed { location, .. } => {
            member.part == Part::User(location)
        }
        Role::Target { location, .. } => member.part == Part::Colour(location),
        Role::Position => member.part == Part::Position,
        Role::ClipDistances { .. } => member.part == Part::ClipDistances,
        Role::SecondSource { .. } => member.part == Part::SecondSource,
        Role::Depth => member.part == Part::Depth,
        _ => false,
    });
    let slot =
        found.ok_or_else(|| Failure::refused(format!("no slot for member `{}`", member.name)))?;
    let scalar = |scalar| match scalar {
        Scalar::F32 => "float",
        Scalar::U32 => "uint",
        Scalar::I32 => "int",
    };
    match stream(&job.slots[slot].role) {
        Some(value) if scalar(value.scalar) == member.scalar && value.size == member.size => {
            Ok(slot)
        }
        _ => Err(Failure::refused(format!(
            "member `{}` is `{}{}`, its slot {:?}",
            member.name, member.scalar, member.size, job.slots[slot].role
        ))),
    }
}
