//! The arguments, as clap reads them.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};
#[cfg(feature = "frames")]
use hankel_frames::graph::ImagePasses;
#[cfg(feature = "frames")]
use hankel_frames::scene::Scene;

/// Shaders for every language from kernels written once in Rust.
///
/// Exit codes: 0 fine; 1 a check failed or a kernel does not compile; 2 misuse: wrong arguments or
/// input files; 3 the machine lacks something: a compiler, a driver, space, permission.
#[derive(Debug, Parser)]
#[command(
    name = "hankel",
    version,
    about,
    long_about,
    after_help = "\
Examples:
  hankel build --out shaders              all built-in kernels in every language
  hankel list                             the kernels, and what they cost
  hankel parity                           does every backend compute the same?
  hankel render scenes/scan.toml --out scan.png --compare
  hankel bench bounds --quick             how fast are moment bounds here?
  hankel stress                           how large are their errors, on every kind of input?"
)]
pub struct Arguments {
    /// Print nothing but results and errors.
    #[arg(long, short, global = true)]
    pub quiet: bool,
    #[command(subcommand)]
    pub command: Command,
}

#[derive(Debug, Subcommand)]
pub enum Command {
    /// Generate shaders, headers and a manifest.
    Build(Build),
    /// Fail if committed shaders are not what their sources give now.
    Check(Check),
    /// Show what changed between two builds.
    Diff(Diff),
    /// Show kernels, their bindings and what they cost.
    List(List),
    /// Make a kernel crate.
    New(New),
    /// Run every kernel on every backend and compare.
    Parity(Parity),
    /// Run kernels natively and check every memory access, in several orders: finds data races, memory
    /// that is read before it is written, results that depend on order, overflow, indices out of range.
    Sanitize(Sanitize),
    /// Run a kernel on the rows of a table.
    Eval(Eval),
    /// Render a scene with shadows.
    #[cfg(feature = "frames")]
    Render(Render),
    /// Find the fastest way to make a scene's shadows within an error.
    #[cfg(feature = "frames")]
    Plan(Plan),
    #[cfg(feature = "measure")]
    #[command(flatten)]
    Measure(crate::measure::Command),
    /// Find or install rust-gpu's compiler.
    #[command(after_help = "\
Examples:
  hankel toolchain status      which compiler would be used, and what is missing
  hankel toolchain install     install it, the first way that is possible")]
    Toolchain(Toolchain),
    /// Show which compilers, drivers and browsers are installed, and how to install the others.
    Doctor(Doctor),
    /// Print a completion script for a shell.
    #[command(after_help = "\
Examples:
  hankel completions bash >/etc/bash_completion.d/hankel
  hankel completions fish >~/.config/fish/completions/hankel.fish")]
    Completions(Completions),
    /// Serve as the process that runs native kernels of another crate.
    #[command(name = crate::session::WORKER, hide = true)]
    KernelWorker {
        /// The crate's plug-in.
        library: PathBuf,
    },
    /// Serve as a process that runs kernels for the matrix.
    #[command(name = "matrix-runner", hide = true)]
    MatrixRunner {
        /// `vulkan` or `gl`.
        which: String,
    },
}

/// Which kernels.
#[derive(Debug, Args)]
pub struct Source {
    /// Cargo.toml of a kernel crate; without it, the built-in kernels.
    #[arg(long, value_name = "FILE")]
    pub manifest_path: Option<PathBuf>,
}

/// What is generated, and how.
#[derive(Debug, Args)]
pub struct Generate {
    #[command(flatten)]
    pub source: Source,
    /// Only this language; may be repeated [spirv, wgsl, hlsl, msl, glsl, essl310, essl300].
    #[arg(long = "target", value_name = "LANGUAGE")]
    pub targets: Vec<String>,
    /// Only this kernel, by its own name or its function's; `*` stands for any letters; may be
    /// repeated.
    #[arg(long = "kernel", value_name = "NAME")]
    pub kernels: Vec<String>,
    /// Fix a specialisation constant's value in every language; may be repeated.
    #[arg(long = "set", value_name = "CONSTANT=VALUE")]
    pub set: Vec<String>,
    /// Write the kernels that have these constants once more, with their values fixed and SUFFIX at
    /// the end of the name; may be repeated.
    #[arg(long = "variant", value_name = "SUFFIX:CONSTANT=VALUE[,…]")]
    pub variants: Vec<String>,
    /// Leave the specialisation constants that are not fixed open in HLSL and GLSL (as macros) and MSL (as
    /// function constants), too, as they are in SPIR-V and WGSL.
    #[arg(long)]
    pub open_constants: bool,
    #[command(flatten)]
    pub placement: Placed,
    /// Bounds checks in HLSL, MSL and GLSL beyond the one guard of each invocation
    /// [unchecked, restrict, readzwrite; default: unchecked].
    #[arg(long, value_name = "POLICY")]
    pub bounds_checks: Option<String>,
    /// HLSL's shader model [5.1, 6.0 to 6.9; default: 6.0].
    #[arg(long, value_name = "VERSION")]
    pub shader_model: Option<String>,
    /// Metal's language version [1.0 to 4.0; default: 2.4].
    #[arg(long, value_name = "VERSION")]
    pub msl_version: Option<String>,
}

impl Generate {
    /// The first option that is given: of what is chosen and how it is written, not of where its source is.
    pub fn first_option(&self) -> Option<&'static str> {
        let placed = &self.placement;
        [
            ("--target", !self.targets.is_empty()),
            ("--kernel", !self.kernels.is_empty()),
            ("--set", !self.set.is_empty()),
            ("--variant", !self.variants.is_empty()),
            ("--open-constants", self.open_constants),
            ("--hlsl-space", placed.hlsl_space.is_some()),
            ("--register-base", placed.register_base.is_some()),
            ("--wgsl-group", placed.wgsl_group.is_some()),
            ("--msl-slot-base", placed.msl_slot_base.is_some()),
            ("--glsl-binding-base", placed.glsl_binding_base.is_some()),
            ("--bindings", placed.bindings.is_some()),
            ("--bounds-checks", self.bounds_checks.is_some()),
            ("--shader-model", self.shader_model.is_some()),
            ("--msl-version", self.msl_version.is_some()),
        ]
        .into_iter()
        .find_map(|(option, given)| given.then_some(option))
    }
}

/// Where bindings are in the texts.
#[derive(Debug, Args)]
pub struct Placed {
    /// HLSL: the register space of every binding [default: 0].
    #[arg(long, value_name = "SPACE")]
    pub hlsl_space: Option<u8>,
    /// HLSL: the first register of every class (t, u, b, s) [default: 0].
    #[arg(long, value_name = "REGISTER")]
    pub register_base: Option<u16>,
    /// WGSL: the group of every binding [default: 0].
    #[arg(long, value_name = "GROUP")]
    pub wgsl_group: Option<u8>,
    /// MSL: the first slot of buffers, of textures and of samplers [default: 0].
    #[arg(long, value_name = "SLOT")]
    pub msl_slot_base: Option<u8>,
    /// GLSL 4.50 and GLSL ES 3.10: what is added to every binding [default: 0].
    #[arg(long, value_name = "BINDING")]
    pub glsl_binding_base: Option<u8>,
    /// Places of single bindings (TOML).
    #[arg(long, value_name = "FILE")]
    pub bindings: Option<PathBuf>,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  hankel build --out shaders
  hankel build --out shaders --target hlsl --shader-model 5.1 --kernel 'shade_*'
  hankel build --out shaders --set encoding=1 --kernel shade_hamburger
  hankel build --out shaders --variant _unit:encoding=1 --kernel shade_hamburger
  hankel build --out shaders --hlsl-space 2 --wgsl-group 1 --msl-slot-base 8 --bindings places.toml
  hankel build --out shaders --manifest-path my-kernels/Cargo.toml
  hankel build --form functions --out libraries
  hankel build --form functions --function 'hamburger_*' --function mix_bias --out libraries
  hankel build --scene scenes/fence.toml --out frame
  hankel build --scene scenes/fence.toml --technique auto --error 0.1 --target wgsl --out frame

The folder gets LANGUAGE/KERNEL.EXTENSION, manifest.json and include/. Files that are up to date
are not written. A build that was interrupted is completed by the next one.

The file of --bindings puts single bindings elsewhere, with names as in manifest.json:
  [shade_hamburger.map]
  hlsl = { register = 4, space = 2 }
  wgsl = { group = 2, binding = 0 }
  msl = { slot = 7 }
  glsl = { binding = 3 }
  essl310 = { binding = 1 }

With --scene it gets the shaders of that scene's frame only, their constants frozen, frame.json, which says
how to run them in another engine, and what buffers hold in frame/NAME.bin.

With --form functions it gets FORM/PREFIX_LIBRARY.EXTENSION, libraries of functions to include and call,
and functions.json, for each form: wgsl, naga-oil, wesl, hlsl, glsl, godot, msl, tsl, slang, c, rust.")]
pub struct Build {
    #[command(flatten)]
    pub generate: Generate,
    #[cfg(feature = "frames")]
    #[command(flatten)]
    pub frame: OfScene,
    /// What to generate: shaders with entry points, or libraries of functions.
    #[arg(long, value_enum, default_value_t)]
    pub form: Form,
    /// Libraries: the prefix of their names [default: hankel].
    #[arg(long, value_name = "NAME")]
    pub prefix: Option<String>,
    /// Libraries: only this function, and what it calls; `*` stands for any letters; may be repeated.
    #[arg(long = "function", value_name = "NAME")]
    pub functions: Vec<String>,
    /// Folder for the output.
    #[arg(long, value_name = "FOLDER", default_value = "shaders")]
    pub out: PathBuf,
    /// Overwrite files that hankel did not write, or that were edited after it wrote them.
    #[arg(long)]
    pub force: bool,
    /// Write the list of files that the shaders or libraries are made from to this file, as a rule in
    /// Make's syntax for OUT/manifest.json or OUT/functions.json.
    #[arg(long, value_name = "FILE")]
    pub depfile: Option<PathBuf>,
    /// Write the names of the environment variables that the shaders follow from to this file, one a line. For
    /// `hankel_build`: cargo follows variables, rules of Make do not.
    #[arg(long, value_name = "FILE", hide = true)]
    pub environment: Option<PathBuf>,
    /// Keep running, and build again after each edit. A kernel that does not compile is reported, and
    /// the output of the last good build stays.
    #[arg(long)]
    pub watch: bool,
    /// How the report is printed.
    #[arg(long, value_enum, default_value_t)]
    pub format: Format,
}

/// What is generated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Form {
    /// Shaders with entry points.
    #[default]
    Kernels,
    /// Libraries of functions.
    Functions,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  hankel check shaders
  hankel check shaders --budget hankel.toml --format json
  hankel check frame --scene scenes/fence.toml

A budget is a TOML file:
  [budget]
  branches = 4
  findings = 0
  [budget.kernels.hamburger_4msm]
  operations = 120

It limits arithmetic, operations, registers, branches, texture, total (see `hankel list`), and findings:
loops that cannot be unrolled and dynamic indices into a function's own arrays.

Without options, the command takes them from manifest.json. If you give one, give all that the folder was built
with.")]
pub struct Check {
    /// The committed folder.
    #[arg(value_name = "FOLDER")]
    pub folder: PathBuf,
    #[command(flatten)]
    pub generate: Generate,
    /// The scene (TOML) whose frame the folder holds.
    #[cfg(feature = "frames")]
    #[arg(long, value_name = "SCENE")]
    pub scene: Option<PathBuf>,
    /// With --scene: the technique that the frame was built with, if not the scene's; `auto`: the one
    /// that a plan chose then, as frame.json has it.
    #[cfg(feature = "frames")]
    #[arg(long, value_name = "NAME", requires = "scene")]
    pub technique: Option<String>,
    /// Limits of the kernels' cost [default: hankel.toml in the present folder, if there is one].
    #[arg(long, value_name = "FILE")]
    pub budget: Option<PathBuf>,
    /// How the report is printed.
    #[arg(long, value_enum, default_value_t)]
    pub format: Format,
}

/// What changes `hankel diff` fails for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Deny {
    /// Fail if an interface changed.
    Interface,
    /// Fail on any change.
    Any,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  hankel diff old/shaders shaders
  hankel diff old/shaders shaders --deny interface --format json
  hankel diff old/shaders shaders --run
  hankel diff old/shaders shaders --scene scenes/hard.toml --out hard.png

An interface changed if code that binds or calls the shader may have to change, too: bindings, layouts,
workgroup sizes, entry points, signatures. All other changes are of the text, of its cost (see
`hankel list`), or of its description.")]
pub struct Diff {
    /// The folder of the old build.
    #[arg(value_name = "OLD")]
    pub old: PathBuf,
    /// The folder of the new build.
    #[arg(value_name = "NEW")]
    pub new: PathBuf,
    /// Run the old and the new SPIR-V on Vulkan with the inputs of `hankel parity`, and compare the
    /// numbers. Only for kernels whose interface is the same.
    #[arg(long)]
    pub run: bool,
    /// With --run: Cargo.toml of the kernel crate; its descriptions define the inputs.
    #[arg(long, value_name = "FILE", requires = "run")]
    pub manifest_path: Option<PathBuf>,
    /// Seed of the generated inputs.
    #[arg(
        long,
        value_name = "NUMBER",
        allow_negative_numbers = true,
        default_value_t = 1,
        requires = "run"
    )]
    pub seed: u64,
    /// Render this scene (TOML) on Vulkan with the shaders of each build, and compare the pictures.
    #[cfg(feature = "frames")]
    #[arg(long, value_name = "SCENE", requires = "out")]
    pub scene: Option<PathBuf>,
    /// With --scene: the picture (PNG) by the new shaders; OUT-old and OUT-difference are written beside
    /// it.
    #[cfg(feature = "frames")]
    #[arg(long, value_name = "FILE", requires = "scene")]
    pub out: Option<PathBuf>,
    /// Exit with code 1 if there is such a change.
    #[arg(long, value_enum)]
    pub deny: Option<Deny>,
    /// How the changes are printed.
    #[arg(long, value_enum, default_value_t)]
    pub format: Format,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  hankel list
  hankel list --kernel hamburger_4msm --bindings
  hankel list --format json")]
pub struct List {
    #[command(flatten)]
    pub source: Source,
    /// Only this kernel; `*` stands for any letters; may be repeated.
    #[arg(long = "kernel", value_name = "NAME")]
    pub kernels: Vec<String>,
    /// Show bindings and layouts too.
    #[arg(long)]
    pub bindings: bool,
    /// How the list is printed.
    #[arg(long, value_enum, default_value_t)]
    pub format: Format,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Example:
  hankel new my-kernels
  cd my-kernels && cargo test && hankel build --manifest-path Cargo.toml")]
pub struct New {
    /// Folder to make; its name is the crate's.
    #[arg(value_name = "PATH")]
    pub path: PathBuf,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  hankel parity
  hankel parity --kernel 'hamburger*' --seed 7
  hankel parity --manifest-path my-kernels/Cargo.toml --format json

  hankel parity --matrix --require all --html matrix.html
  hankel parity --matrix --column hlsl-dxc --column msl --kernel 'shade_*'

With --matrix, every generated language is compiled and run by compilers and drivers of others;
`hankel doctor` shows which are installed. VK_DRIVER_FILES chooses among several Vulkan drivers;
HANKEL_SIMD chooses the instruction set of the SIMD lanes.")]
pub struct Parity {
    #[command(flatten)]
    pub source: Source,
    /// Only this kernel; `*` stands for any letters; may be repeated.
    #[arg(long = "kernel", value_name = "NAME")]
    pub kernels: Vec<String>,
    /// Seed of the generated inputs.
    #[arg(
        long,
        value_name = "NUMBER",
        allow_negative_numbers = true,
        default_value_t = 1
    )]
    pub seed: u64,
    /// Seconds that a kernel of another crate may run natively, and with --matrix a compiler or
    /// device for one kernel.
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, default_value_t = 120,
          value_parser = clap::value_parser!(u64).range(1..=3600))]
    pub limit: u64,
    /// How the report is printed.
    #[arg(long, value_enum, default_value_t)]
    pub format: Format,
    /// Every kernel in every language on every compiler and driver; without it, natively and through
    /// Vulkan as SPIR-V and WGSL.
    #[arg(long)]
    pub matrix: bool,
    #[command(flatten)]
    pub of_matrix: OfMatrix,
}

/// What a sanitized run looks for.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  hankel sanitize
  hankel sanitize --manifest-path my-kernels/Cargo.toml --kernel 'sort_*'

Kernels run natively on the inputs of `hankel parity`, their invocations in ascending, descending and
shuffled order. A fault is named with the line of the kernel's source and the invocations that took
part. Integers that overflow, and shifts by too many bits, are found in crates that are given by
--manifest-path: those are built with the checks.")]
pub struct Sanitize {
    #[command(flatten)]
    pub source: Source,
    /// Only this kernel; `*` stands for any letters; may be repeated.
    #[arg(long = "kernel", value_name = "NAME")]
    pub kernels: Vec<String>,
    /// Seed of the generated inputs.
    #[arg(
        long,
        value_name = "NUMBER",
        allow_negative_numbers = true,
        default_value_t = 1
    )]
    pub seed: u64,
    /// Seconds that a kernel of another crate may run.
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, default_value_t = 120,
          value_parser = clap::value_parser!(u64).range(1..=3600))]
    pub limit: u64,
    /// How the report is printed.
    #[arg(long, value_enum, default_value_t)]
    pub format: Format,
}

/// Choices for the matrix.
#[derive(Debug, Args)]
pub struct OfMatrix {
    /// Only this column; may be repeated [native, native-simd, spirv, spirv-naga, wgsl,
    /// spirv-swiftshader, glsl, essl310, essl300, hlsl-dxc, hlsl-glslang, msl, wgsl-dawn,
    /// wgsl-chromium].
    #[arg(long = "column", value_name = "NAME", requires = "matrix")]
    pub columns: Vec<String>,
    /// A column that must run, or `all`: if its tools are not installed, the command fails; may be
    /// repeated.
    #[arg(long, value_name = "NAME", requires = "matrix")]
    pub require: Vec<String>,
    /// Write the report as an HTML page.
    #[arg(long, value_name = "FILE")]
    pub html: Option<PathBuf>,
    /// Write the report as JSON.
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Write the table as Markdown.
    #[arg(long, value_name = "FILE")]
    pub markdown: Option<PathBuf>,
    /// List of known differences; without it, the built-in kernels have their own.
    #[arg(long, value_name = "FILE", requires = "matrix")]
    pub known: Option<PathBuf>,
    /// Table of cells that are known not to run; without it, the built-in kernels have their own. A run
    /// with all kernels in all columns is compared with it.
    #[arg(long, value_name = "FILE", requires = "matrix")]
    pub absent: Option<PathBuf>,
    /// Write that table as this run finds it.
    #[arg(
        long,
        value_name = "FILE",
        requires = "matrix",
        conflicts_with = "absent"
    )]
    pub write_absent: Option<PathBuf>,
    /// Run everything again, without cached results, as with CI=true.
    #[arg(long, requires = "matrix")]
    pub no_cache: bool,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  hankel doctor
  hankel doctor --format json

Environment: HANKEL_TOOLS, the folder of DXC's library and npm's packages; HANKEL_CLANG, HANKEL_GLSLANG,
HANKEL_DXC, HANKEL_NODE, HANKEL_CHROMIUM, HANKEL_SWIFTSHADER (its driver's JSON file), each a path.")]
pub struct Doctor {
    /// How the report is printed.
    #[arg(long, value_enum, default_value_t)]
    pub format: Format,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  hankel eval hamburger_4msm --input rows.csv --output shadows.csv --set moment_bias=3e-5
  hankel eval hamburger_4msm --input rows.csv --output shadows.csv --backend vulkan
  hankel eval vsm --input rows.csv --output shadows.csv --precision f64

The table's columns are the input's fields; `hankel list --kernel NAME --bindings` shows them.")]
pub struct Eval {
    /// The kernel, or its function.
    #[arg(value_name = "KERNEL")]
    pub kernel: String,
    #[command(flatten)]
    pub source: Source,
    /// Table to read: CSV with a header.
    #[arg(long, value_name = "FILE")]
    pub input: PathBuf,
    /// Table to write.
    #[arg(long, value_name = "FILE")]
    pub output: PathBuf,
    /// Where to run it.
    #[arg(long, value_enum, default_value_t)]
    pub backend: Backend,
    /// In which precision [default: the kernel's first].
    #[arg(long, value_enum)]
    pub precision: Option<Precision>,
    /// A uniform's field or a specialisation constant; may be repeated.
    #[arg(long = "set", value_name = "NAME=VALUE")]
    pub set: Vec<String>,
    /// Run the kernel that is named, even if there is another one that computes the same in about twice
    /// the digits.
    #[arg(long)]
    pub fast: bool,
    /// Seconds that a kernel of another crate may run natively for 65536 rows.
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, default_value_t = 120,
          value_parser = clap::value_parser!(u64).range(1..=3600))]
    pub limit: u64,
}

#[cfg(feature = "frames")]
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  hankel render scenes/scan.toml --out scan.png
  hankel render scenes/hard.toml --out hard.png --backend vulkan
  hankel render scenes/scan.toml --out scan.png --compare
  hankel render scenes/hard.toml --out hard.png --errors
  hankel render scenes/lamp.toml --out lamp.exr
  hankel render scenes/fence.toml --out fence.png --technique auto --error 0.05

With --compare, OUT is the native picture; OUT-vulkan and OUT-difference are written beside it.")]
pub struct Render {
    /// Scene file (TOML).
    #[arg(value_name = "SCENE")]
    pub scene: PathBuf,
    /// Picture to write: PNG, or linear light in floats if its name ends with .exr.
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Where to render.
    #[arg(long, value_enum, default_value_t, conflicts_with = "compare")]
    pub backend: Backend,
    /// Render on both backends and compare.
    #[arg(long)]
    pub compare: bool,
    /// With --compare: fail if more than this share of the pixels, in percent, differs by more than
    /// 1/255. The default is the share that rounding can change at the scene's edges.
    #[arg(long, value_name = "PERCENT", requires = "compare",
          value_parser = percentage)]
    pub limit: Option<f64>,
    /// The technique, instead of the scene's; `auto`: the fastest within --error, as `hankel plan`
    /// finds it for the backend, with its map's size, filter and format.
    #[arg(long, value_name = "NAME", conflicts_with = "compare")]
    pub technique: Option<String>,
    /// With --technique auto: the greatest root mean square error of the light, against rays. --size,
    /// --filter, --fit and --multisampling limit the choice.
    #[arg(long, value_name = "ERROR", allow_negative_numbers = true, requires = "technique", value_parser = budget)]
    pub error: Option<f64>,
    #[command(flatten)]
    pub maps: Maps,
    /// How passes run that give one texel for each index: as compute passes (`compute`), or as draws into
    /// render targets where the kernel has a fragment form (`fragment`).
    #[arg(long, value_name = "FORM", default_value_t)]
    pub image_passes: ImagePasses,
    /// How much the difference picture is amplified.
    #[arg(long, value_name = "FACTOR", allow_negative_numbers = true, default_value_t = hankel_frames::AMPLIFICATION, requires = "compare",
        value_parser = clap::value_parser!(u32).range(1..))]
    pub amplify: u32,
    /// Also measure the shadow's error, against ray-traced light and against filtering without moments;
    /// takes some minutes for a large picture.
    #[arg(long)]
    pub errors: bool,
    /// How the report is printed.
    #[arg(long, value_enum, default_value_t)]
    pub format: Format,
}

/// The frame of a scene, to be built.
#[cfg(feature = "frames")]
#[derive(Debug, Args)]
pub struct OfScene {
    /// Write the shaders of the frame of this scene (TOML) only, and frame.json.
    #[arg(long, value_name = "SCENE")]
    pub scene: Option<PathBuf>,
    /// With --scene: the technique, instead of the scene's; `auto`: the fastest within --error, as
    /// `hankel plan` finds it for the backend, with its map's size, filter and format.
    #[arg(long, value_name = "NAME", requires = "scene")]
    pub technique: Option<String>,
    /// With --technique auto: the greatest root mean square error of the light, against rays. --size,
    /// --filter, --fit and --multisampling limit the choice.
    #[arg(long, value_name = "ERROR", allow_negative_numbers = true, requires = "technique", value_parser = budget)]
    pub error: Option<f64>,
    /// With --technique auto: where the frame will run [default: native].
    #[arg(long, value_enum, requires = "error")]
    pub backend: Option<Backend>,
    #[command(flatten)]
    pub maps: Maps,
    /// With --scene: how passes run that give one texel for each index: as compute passes (`compute`), or as
    /// draws into render targets where the kernel has a fragment form (`fragment`) [default: compute].
    #[arg(long, value_name = "FORM", requires = "scene")]
    pub image_passes: Option<ImagePasses>,
}

/// Ways to make shadows.
#[cfg(feature = "frames")]
#[derive(Debug, Args)]
pub struct Choose {
    /// Only this technique; several with commas between, or repeated [default: all].
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    pub technique: Vec<String>,
    /// Only this technique of scattering, in scenes with a medium; several with commas between, or repeated
    /// [default: all].
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    pub scattering: Vec<String>,
    /// Steps along each ray, of techniques of scattering that march along rays, 1 to 4096; several with commas
    /// between [default: 8,32,128].
    #[arg(long, value_name = "STEPS", value_delimiter = ',',
          value_parser = clap::value_parser!(u32).range(1..=i64::from(Scene::MAX_STEPS)))]
    pub steps: Vec<u32>,
    #[command(flatten)]
    pub maps: Maps,
}

/// Shadow maps to choose from.
#[cfg(feature = "frames")]
#[derive(Debug, Args)]
pub struct Maps {
    /// Texels along an edge of the map, 16 to 4096; several with commas between
    /// [default: 256,512,1024,2048].
    #[arg(long, value_name = "TEXELS", value_delimiter = ',',
          value_parser = clap::value_parser!(u32).range(16..=i64::from(Scene::MAX_MAP)))]
    pub size: Vec<u32>,
    /// Taps of the filter along an axis, odd, 1 (none) to 31; several with commas between
    /// [default: 1,3,5,9].
    #[arg(long, value_name = "TAPS", value_delimiter = ',', value_parser = taps)]
    pub filter: Vec<u32>,
    /// What the map holds: all of the scene, or what the camera sees; both with a comma between
    /// [default: both].
    #[arg(long, value_enum, value_name = "WHAT", value_delimiter = ',')]
    pub fit: Vec<Fitted>,
    /// Samples of depth in a texel of the map, 4 or 1; both with a comma between [default: both].
    /// Techniques that look at the samples themselves always have 4.
    #[arg(long, value_name = "SAMPLES", value_delimiter = ',', value_parser = samples)]
    pub multisampling: Vec<u32>,
}

#[cfg(feature = "frames")]
impl Maps {
    /// Whether nothing was said of them.
    pub const fn is_empty(&self) -> bool {
        self.size.is_empty()
            && self.filter.is_empty()
            && self.fit.is_empty()
            && self.multisampling.is_empty()
    }
}

/// What a shadow map holds.
#[cfg(feature = "frames")]
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Fitted {
    /// All of the scene.
    Scene,
    /// What the camera sees, and its casters.
    Camera,
}

#[cfg(feature = "frames")]
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  hankel plan scenes/fence.toml --error 0.05
  hankel plan scenes/fence.toml --error 0.05 --backend vulkan --time 20 --memory 30
  hankel plan scenes/fence.toml --error 0.1 --technique hamburger,vsm --format json

The error is the root mean square difference from ray-traced light. Light is 1 minus the shadow, and 0 where a
surface faces away from the light. In a scene with a medium, it is the light that comes through the medium, plus the
light that the medium scatters. To find the plan, the command measures on the backend: times of small maps, and
errors against rays through some of the pixels.

Exit code 1: no configuration is within the limits.")]
pub struct Plan {
    /// Scene file (TOML). What it says of its shadow is not used.
    #[arg(value_name = "SCENE")]
    pub scene: PathBuf,
    /// The greatest root mean square error.
    #[arg(long, value_name = "ERROR", allow_negative_numbers = true, value_parser = budget)]
    pub error: f64,
    /// The greatest time of a frame in milliseconds.
    #[arg(long, value_name = "MILLISECONDS", allow_negative_numbers = true, value_parser = positive)]
    pub time: Option<f64>,
    /// The most memory on the device in megabytes (10^6 bytes).
    #[arg(long, value_name = "MEGABYTES", allow_negative_numbers = true, value_parser = positive)]
    pub memory: Option<f64>,
    /// Where the frame will run.
    #[arg(long, value_enum, default_value_t)]
    pub backend: Backend,
    #[command(flatten)]
    pub choose: Choose,
    /// How the plan is printed.
    #[arg(long, value_enum, default_value_t)]
    pub format: Format,
}

#[derive(Debug, Args)]
pub struct Toolchain {
    #[command(subcommand)]
    pub command: ToolchainCommand,
}

#[derive(Debug, Subcommand)]
pub enum ToolchainCommand {
    /// Show which compiler would be used, why, and what is missing.
    #[command(after_help = "\
Examples:
  hankel toolchain status                which compiler would be used
  hankel toolchain status --format json  the same for a program

Environment:
  HANKEL_TOOLCHAIN          folder of a toolchain to use before all others
  HANKEL_TOOLCHAIN_ARCHIVE  archive to unpack when nothing is installed
  HANKEL_CACHE              folder for what is kept between runs")]
    Status(ToolchainStatus),
    /// Install the compiler, from an archive, through rustup or from source.
    #[command(after_help = "\
Examples:
  hankel toolchain install                      in the first way that is possible
  hankel toolchain install --from FILE.tar.zst  from an archive
  hankel toolchain install --method source      from Debian's rust-src and crates.io, without LLVM")]
    Install(ToolchainInstall),
    /// Pack an installed compiler into an archive, to share it.
    #[command(after_help = "\
Examples:
  hankel toolchain pack archives    writes archives/rust-gpu-….tar.zst, for `hankel toolchain install --from`")]
    Pack(ToolchainPack),
}

#[derive(Debug, Args)]
pub struct ToolchainStatus {
    /// How the report is printed.
    #[arg(long, value_enum, default_value_t)]
    pub format: Format,
}

#[derive(Debug, Args)]
pub struct ToolchainInstall {
    /// Archive to install from.
    #[arg(long, value_name = "FILE")]
    pub from: Option<PathBuf>,
    /// SHA-256 of the archive, if hankel does not know it.
    #[arg(long, value_name = "HEX", requires = "from")]
    pub sha256: Option<String>,
    /// How to install [default: the first that is possible].
    #[arg(long, value_enum, conflicts_with = "from")]
    pub method: Option<Method>,
}

#[derive(Debug, Args)]
pub struct ToolchainPack {
    /// Folder for the archive.
    #[arg(value_name = "FOLDER")]
    pub folder: PathBuf,
}

#[derive(Debug, Args)]
pub struct Completions {
    /// The shell.
    #[arg(value_enum)]
    pub shell: clap_complete::Shell,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// For people.
    #[default]
    Text,
    /// For programs.
    Json,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Backend {
    /// This machine's processor.
    #[default]
    Native,
    /// A Vulkan device.
    Vulkan,
}

impl From<Backend> for hankel_host::device::Backend {
    fn from(backend: Backend) -> Self {
        match backend {
            Backend::Native => Self::Native,
            Backend::Vulkan => Self::Vulkan,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Precision {
    /// 32 bits.
    F32,
    /// 64 bits.
    F64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Method {
    /// A nightly with rustc-dev, and rust-gpu's backend built with it.
    Rustup,
    /// The compiler without LLVM, from Debian's rust-src package and crates.io.
    Source,
}

/// A number from 0 to 100.
#[cfg(feature = "frames")]
fn percentage(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if (0.0..=100.0).contains(&x) => Ok(x),
        _ => Err("give a number from 0 to 100".into()),
    }
}

/// An odd number from 1 to 31.
#[cfg(feature = "frames")]
pub fn taps(text: &str) -> Result<u32, String> {
    match text.parse::<u32>() {
        Ok(taps) if (1..=Scene::MAX_FILTER).contains(&taps) && taps % 2 == 1 => Ok(taps),
        _ => Err(format!(
            "give an odd number from 1 to {}",
            Scene::MAX_FILTER
        )),
    }
}

/// Samples of depth in a texel.
#[cfg(feature = "frames")]
pub fn samples(text: &str) -> Result<u32, String> {
    match text {
        "1" => Ok(1),
        "4" => Ok(4),
        _ => Err("give 4 or 1".into()),
    }
}

/// An error of the light, which is from 0 to 1.
#[cfg(feature = "frames")]
pub fn budget(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if x > 0.0 && x <= 1.0 => Ok(x),
        _ => Err("give a number above 0, at most 1".into()),
    }
}

/// A number above 0.
#[cfg(feature = "frames")]
fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if x > 0.0 && x.is_finite() => Ok(x),
        _ => Err("give a number above 0".into()),
    }
}
