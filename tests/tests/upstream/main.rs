//! Bugs of other people's tools that Hankel works around: each of `tests/upstream` is still there.
//! A test that fails here says which workaround can go.

mod meaning;

use std::env;
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use hankel_dsl::native::describe::{self, Kernel, Layout, Output, Param, TexelFormat, Tolerance};
use hankel_matrix::job::{Arg, Case, Job, Place, Role, Slot, Stage};
use hankel_matrix::process::{Finished, Runner, run};
use hankel_matrix::tools::{Tool, Tools};
use hankel_matrix::vulkan::{VulkanJob, Way};
use naga::ResourceBinding;
use naga::back::{glsl, hlsl, msl, spv};
use naga::proc::BoundsCheckPolicies;
use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};
use rspirv::dr::{self, Instruction, Operand};
use rspirv::spirv::{Decoration, GroupOperation, ImageFormat, Op};
use spirv_tools::TargetEnv;
use spirv_tools::assembler::{Assembler, AssemblerOptions};
use spirv_tools::opt::compiled::CompiledOptimizer;
use spirv_tools::opt::{Optimizer, Passes};
use tempfile::TempDir;

const LIMIT: Duration = Duration::from_secs(120);

/// A file of a case's folder.
fn case(name: &str, file: &str) -> PathBuf {
    hankel_tests::root()
        .join("tests/upstream")
        .join(name)
        .join(file)
}

fn text(name: &str, file: &str) -> String {
    let path = case(name, file);
    fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// The tools, of which `tool` is there.
fn tools(tool: Tool) -> Tools {
    let cache = hankel_toolchain::Options::from_env().cache_folder().ok();
    let tools = Tools::of_cache(cache.as_deref());
    let status = tools.status(tool);
    if let Some(problem) = &status.problem {
        panic!("{}: {problem}", status.name);
    }
    assert!(
        status.is_there(),
        "{} is not installed: {}",
        status.name,
        status.install
    );
    tools
}

fn folder() -> TempDir {
    tempfile::tempdir().unwrap_or_else(|e| panic!("a folder for a tool's output: {e}"))
}

fn finish(command: &mut Command) -> Finished {
    run(command, LIMIT).unwrap_or_else(|e| panic!("{e}"))
}

/// The SPIR-V that DXC makes of HLSL.
fn dxc(source: &str) -> Vec<u8> {
    let dxc = tools(Tool::Dxc).dxc().unwrap_or_else(|e| panic!("{e}"));
    let out = folder();
    let (text, file) = (out.path().join("case.hlsl"), out.path().join("case.spv"));
    fs::write(&text, source).unwrap_or_else(|e| panic!("{}: {e}", text.display()));
    let mut command = dxc.command(&text, "main", "cs_6_2", &file);
    let done = finish(command.args(["-spirv", "-fspv-target-env=vulkan1.1"]));
    assert!(done.status.success(), "DXC: {}\n{source}", done.words());
    read(&file)
}

/// What glslang makes of GLSL, or with `-D` of HLSL: SPIR-V unless it refuses.
fn glslang(source: &Path, arguments: &[&str]) -> (Option<Vec<u8>>, String) {
    let program = tools(Tool::Glslang).glslang();
    let out = folder();
    let file = out.path().join("case.spv");
    let mut command = Command::new(program.unwrap_or_else(|| panic!("glslang is gone")));
    command
        .args(["-V", "--target-env", "vulkan1.1", "-S", "comp"])
        .args(arguments)
        .args([OsStr::new("-o"), file.as_os_str(), source.as_os_str()]);
    let done = finish(&mut command);
    let spirv = done.status.success().then(|| read(&file));
    (spirv, done.words())
}

fn compiled(source: &Path, arguments: &[&str]) -> Vec<u8> {
    let (spirv, words) = glslang(source, arguments);
    spirv.unwrap_or_else(|| panic!("glslang: {words}"))
}

fn read(file: &Path) -> Vec<u8> {
    fs::read(file).unwrap_or_else(|e| panic!("{}: {e}", file.display()))
}

fn module(spirv: &[u8]) -> dr::Module {
    dr::load_bytes(spirv).unwrap_or_else(|e| panic!("{e}"))
}

/// The instructions of a kind.
fn all(module: &dr::Module, op: Op) -> Vec<&Instruction> {
    module
        .all_inst_iter()
        .filter(|i| i.class.opcode == op)
        .collect()
}

/// How many results must not be contracted.
fn pinned(module: &dr::Module) -> usize {
    let decorations = all(module, Op::Decorate);
    let pinned = Operand::Decoration(Decoration::NoContraction);
    decorations
        .iter()
        .filter(|i| i.operands.get(1) == Some(&pinned))
        .count()
}

fn validated(module: naga::Module) -> (naga::Module, ModuleInfo) {
    let info = Validator::new(ValidationFlags::all(), Capabilities::all())
        .validate(&module)
        .unwrap_or_else(|e| panic!("{e:?}"));
    (module, info)
}

fn wgsl(name: &str) -> (naga::Module, ModuleInfo) {
    let source = text(name, "case.wgsl");
    validated(naga::front::wgsl::parse_str(&source).unwrap_or_else(|e| panic!("{e}")))
}

fn to_hlsl((module, info): &(naga::Module, ModuleInfo)) -> String {
    let options = hlsl::Options {
        shader_model: hlsl::ShaderModel::V6_2,
        fake_missing_bindings: true,
        force_loop_bounding: false,
        restrict_indexing: false,
        ..hlsl::Options::default()
    };
    let mut source = String::new();
    hlsl::Writer::new(&mut source, &options, &hlsl::PipelineOptions::default())
        .write(module, info, None)
        .unwrap_or_else(|e| panic!("{e}"));
    source
}

fn to_msl((module, info): &(naga::Module, ModuleInfo)) -> String {
    let options = msl::Options {
        lang_version: (2, 4),
        fake_missing_bindings: true,
        force_loop_bounding: false,
        ..msl::Options::default()
    };
    let pipeline = msl::PipelineOptions::default();
    let written = msl::write_string(module, info, &options, &pipeline);
    written.unwrap_or_else(|e| panic!("{e}")).0
}

fn to_glsl(read: &(naga::Module, ModuleInfo)) -> String {
    glsl_of(read, naga::ShaderStage::Compute)
}

fn glsl_of((module, info): &(naga::Module, ModuleInfo), stage: naga::ShaderStage) -> String {
    let bound = |binding: u8| {
        let place = ResourceBinding {
            group: 0,
            binding: binding.into(),
        };
        (place, binding)
    };
    let options = glsl::Options {
        version: glsl::Version::new_gles(310),
        writer_flags: glsl::WriterFlags::empty(),
        binding_map: [bound(0), bound(1)].into(),
        zero_initialize_workgroup_memory: false,
    };
    let pipeline = glsl::PipelineOptions {
        shader_stage: stage,
        entry_point: "main".into(),
        multiview: None,
    };
    let mut source = String::new();
    glsl::Writer::new(
        &mut source,
        module,
        info,
        &options,
        &pipeline,
        BoundsCheckPolicies::default(),
    )
    .and_then(|mut writer| writer.write())
    .unwrap_or_else(|e| panic!("{e}"));
    source
}

/// Where a case is run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum On {
    /// Mesa's Vulkan driver for processors.
    Lavapipe,
    /// Mesa's OpenGL ES for processors.
    Llvmpipe,
    SwiftShader,
}

/// Runs one invocation of a shader that reads a buffer at binding 0 and writes a buffer of as many
/// bytes as `written`, or a storage texture of one texel, at binding 1.
fn result(
    on: On,
    code: &[u8],
    values: &[u8],
    written: usize,
    texel: Option<TexelFormat>,
) -> Vec<u8> {
    let work = folder();
    let at = |name: &str| work.path().join(name);
    let inputs = [values, &vec![0; written]].concat();
    for (name, bytes) in [("code", code), ("inputs", &inputs)] {
        fs::write(at(name), bytes).unwrap_or_else(|e| panic!("{name}: {e}"));
    }
    let output = Arg::Bytes {
        offset: values.len() as u64,
        length: written as u64,
    };
    let output = match texel {
        None => output,
        Some(format) => Arg::Texture {
            format: format!("{format:?}").to_lowercase(),
            dimensions: 2,
            size: [1; 3],
            levels: 1,
            layers: 1,
            samples: 1,
            offset: values.len() as u64,
            length: written as u64,
        },
    };
    let job = Job {
        id: 1,
        kernel: "main".into(),
        entry_point: "main".into(),
        stage: Stage::Compute { threads: [1; 3] },
        code: at("code"),
        slots: vec![slot(0, Role::Read), slot(1, Role::Write)],
        sizes_slot: None,
        sized: Vec::new(),
        cases: vec![Case {
            invocations: 1,
            groups: [1; 3],
            args: vec![
                Arg::Bytes {
                    offset: 0,
                    length: values.len() as u64,
                },
                output,
            ],
        }],
        inputs: at("inputs"),
        results: at("results"),
    };
    let mut runner = runner(on);
    let done = if on == On::Llvmpipe {
        runner.ask(&job, job.id, LIMIT)
    } else {
        let way = Way::Spirv;
        let description = description(texel);
        let job = VulkanJob {
            job,
            description,
            way,
        };
        runner.ask(&job, 1, LIMIT)
    };
    done.unwrap_or_else(|e| panic!("{}: {e}", runner.driver.name));
    read(&at("results"))
}

fn slot(binding: u32, role: Role) -> Slot {
    Slot {
        name: format!("binding {binding}"),
        binding: Some(binding),
        place: Some(Place {
            name: None,
            class: "buffer".into(),
            index: Some(binding),
            block: None,
            combined_with: Vec::new(),
        }),
        role,
    }
}

/// The kernel for the device: 32-bit words in, words or a texel out.
fn description(texel: Option<TexelFormat>) -> Kernel {
    let layout = Layout {
        name: "u32".into(),
        size: 4,
        align: 4,
        fields: Vec::new(),
    };
    let output = match texel {
        None => Output::Buffer {
            binding: 1,
            layout: layout.clone(),
        },
        Some(format) => Output::Texture {
            binding: 1,
            format,
            dimensions: 2,
        },
    };
    Kernel {
        name: "main".into(),
        function: "main".into(),
        summary: "A minimal case.".into(),
        file: file!().into(),
        line: 1,
        licence: String::new(),
        stage: describe::Stage::Compute {
            threads: [1; 3],
            dimensions: if texel.is_some() { 2 } else { 1 },
            cooperative: false,
            workgroup_bytes: 0,
            range: describe::Range::Outputs,
        },
        precision: None,
        params: vec![Param {
            name: "values".into(),
            role: describe::Role::Storage { binding: 0, layout },
            inputs: describe::Inputs::default(),
        }],
        outputs: vec![output],
        tolerance: Tolerance {
            ulp: 0,
            absolute: 0.0,
            non_finite: false,
            why: "the driver is wrong or it is not".into(),
        },
        rounding: describe::Rounding::Free,
        subgroups: describe::Subgroups::Unused,
        compensated: None,
        image_pass: None,
        invariant: false,
    }
}

fn runner(on: On) -> Runner {
    let mut command = Command::new(env!("CARGO_BIN_EXE_hankel-tests-runner"));
    command.env("NODEVICE_SELECT", "1");
    let (driver, device) = match on {
        On::Llvmpipe => {
            tools(Tool::Egl);
            command.arg("gl").env("LIBGL_ALWAYS_SOFTWARE", "1");
            (None, "llvmpipe")
        }
        On::Lavapipe => (tools(Tool::Vulkan).status(Tool::Vulkan).path, "llvmpipe"),
        On::SwiftShader => (tools(Tool::SwiftShader).swiftshader(), "SwiftShader"),
    };
    if let Some(driver) = driver {
        command.arg("vulkan");
        command.env("VK_DRIVER_FILES", &driver);
        command.env("VK_ICD_FILENAMES", &driver);
    }
    let runner = Runner::start(&mut command, LIMIT).unwrap_or_else(|e| panic!("{e}"));
    assert!(
        runner.driver.name.contains(device),
        "this test is about {device}; here is {}",
        runner.driver.name
    );
    runner
}

/// The word that a shader makes of a word.
fn word(on: On, code: &[u8], value: u32) -> u32 {
    let written = result(on, code, &value.to_le_bytes(), 4, None);
    let word = written.first_chunk().expect("a word was written");
    u32::from_le_bytes(*word)
}

/// The constants of 32-bit floats.
fn constants(module: &dr::Module) -> Vec<f32> {
    let is_float = |ty: &Instruction| {
        ty.class.opcode == Op::TypeFloat && ty.operands == [Operand::LiteralBit32(32)]
    };
    let types: Vec<_> = all(module, Op::TypeFloat)
        .into_iter()
        .filter(|ty| is_float(ty))
        .map(|ty| ty.result_id)
        .collect();
    all(module, Op::Constant)
        .into_iter()
        .filter(|c| types.contains(&c.result_type))
        .filter_map(|c| match c.operands[..] {
            [Operand::LiteralBit32(bits)] => Some(f32::from_bits(bits)),
            _ => None,
        })
        .collect()
}

#[test]
fn dxc_rounds_a_selection_of_literals_towards_zero() {
    let source = text("dxc-literal-selection", "case.hlsl");
    let nearest = [1.298_074_2e33f32, 1.152_921_5e18];
    assert_eq!(
        constants(&module(&dxc(&source))),
        nearest.map(f32::next_down),
        "mended: drop the workaround in codegen/src/translate/hlsl.rs, `text::suffixed`"
    );
    let suffixed = source.replace("e33", "e33f").replace("e18", "e18f");
    assert_eq!(constants(&module(&dxc(&suffixed))), nearest);
}

#[test]
fn glslang_counts_the_words_of_a_byte_address_buffer() {
    let file = case("glslang-byte-address-size", "case.hlsl");
    let made = module(&compiled(&file, &["-D", "-e", "main"]));
    assert_eq!(all(&made, Op::ArrayLength).len(), 1);
    assert_eq!(
        all(&made, Op::IMul).len() + all(&made, Op::ShiftLeftLogical).len(),
        0,
        "mended: drop the workaround in matrix/src/adopt.rs, `hlsl_glslang`"
    );
    // DXC multiplies.
    let source = text("glslang-byte-address-size", "case.hlsl");
    assert_eq!(all(&module(&dxc(&source)), Op::IMul).len(), 1);
}

#[test]
fn glslang_refuses_templated_loads() {
    let file = case("glslang-templated-load", "case.hlsl");
    let (spirv, words) = glslang(&file, &["-D", "-e", "main"]);
    assert!(
        spirv.is_none(),
        "mended: drop `lacking` of matrix/src/rules.rs"
    );
    assert!(words.contains("'Load' : no such field"), "{words}");
    // DXC takes it.
    dxc(&text("glslang-templated-load", "case.hlsl"));
}

#[test]
fn glslang_refuses_constructors_of_wide_integers() {
    let file = case("glslang-wide-constructors", "case.hlsl");
    let (spirv, words) = glslang(&file, &["-D", "-e", "main"]);
    assert!(
        spirv.is_none(),
        "mended: drop `lacking` of matrix/src/rules.rs"
    );
    assert!(words.contains("unsupported construction"), "{words}");
    // DXC takes it.
    dxc(&text("glslang-wide-constructors", "case.hlsl"));
}

#[test]
fn glslang_includes_the_own_value_in_prefix_sums() {
    let scan = |spirv: &[u8]| -> Vec<Operand> {
        let made = module(spirv);
        let sums = all(&made, Op::GroupNonUniformIAdd);
        assert_eq!(sums.len(), 1);
        sums[0].operands.clone()
    };
    let exclusive = Operand::GroupOperation(GroupOperation::ExclusiveScan);
    let file = case("glslang-wave-prefix", "case.hlsl");
    assert!(
        !scan(&compiled(&file, &["-D", "-e", "main"])).contains(&exclusive),
        "mended: drop `lacking` of matrix/src/rules.rs"
    );
    // DXC takes the invocations before this one.
    assert!(scan(&dxc(&text("glslang-wave-prefix", "case.hlsl"))).contains(&exclusive));
}

/// What spirv-opt makes of a module.
fn optimised(spirv: &[u8], passes: impl FnOnce(&mut CompiledOptimizer)) -> Vec<u8> {
    let words: Vec<u32> = spirv
        .as_chunks()
        .0
        .iter()
        .map(|&word| u32::from_le_bytes(word))
        .collect();
    let mut optimiser = CompiledOptimizer::with_env(TargetEnv::Vulkan_1_1);
    passes(&mut optimiser);
    let done = optimiser
        .optimize(&words, &mut |_| {}, None)
        .unwrap_or_else(|e| panic!("{e}"));
    done.as_bytes().to_vec()
}

#[test]
fn rust_gpus_optimiser_merges_constants() {
    let spirv = compiled(&case("rust-gpu-merged-constants", "case.comp"), &[]);
    assert_eq!(all(&module(&spirv), Op::FMul).len(), 2);
    let done = optimised(&spirv, |optimiser| {
        optimiser.register_performance_passes();
    });
    assert_eq!(
        all(&module(&done), Op::FMul).len(),
        1,
        "mended: drop `--no-spirv-opt` in codegen/src/compile.rs and the decorating in finish.rs"
    );
}

/// Set in the process that is to be aborted.
const TO_BE_ABORTED: &str = "HANKEL_TEST_TO_BE_ABORTED";

#[test]
fn spirv_opt_aborts_on_a_pinned_function_of_constants() {
    let assembler = spirv_tools::assembler::create(Some(TargetEnv::Vulkan_1_1));
    let spirv = |text: &str| {
        let binary = assembler.assemble(text, AssemblerOptions::default());
        binary.unwrap_or_else(|e| panic!("{e}")).as_bytes().to_vec()
    };
    let propagated = |spirv: &[u8]| {
        optimised(spirv, |optimiser| {
            optimiser.register_pass(Passes::ConditionalConstantPropagation);
        })
    };
    let pinned = text("spirv-opt-pinned-function", "case.spvasm");
    if env::var_os(TO_BE_ABORTED).is_some() {
        propagated(&spirv(&pinned));
        return;
    }
    let decoration = "OpDecorate %greater NoContraction";
    assert!(pinned.contains(decoration));
    let free = propagated(&spirv(&pinned.replace(decoration, "")));
    assert_eq!(constants(&module(&free)), [1.0, 2.0]);
    let this = env::current_exe().expect("the test's own program");
    let mut command = Command::new(this);
    command
        .args([
            "--exact",
            "spirv_opt_aborts_on_a_pinned_function_of_constants",
        ])
        .args(["--nocapture", "--test-threads=1"])
        .env(TO_BE_ABORTED, "yes");
    let done = finish(&mut command);
    assert!(
        done.words().contains("Unsettled value"),
        "mended: functions can be decorated, too, in codegen/src/spirv/exact.rs, `pin`; {}",
        done.words()
    );
}

#[test]
fn naga_drops_no_contraction() {
    let spirv = compiled(&case("naga-no-contraction", "case.comp"), &[]);
    assert_eq!(pinned(&module(&spirv)), 2);
    let options = naga::front::spv::Options::default();
    let read = naga::front::spv::parse_u8_slice(&spirv, &options).unwrap_or_else(|e| panic!("{e}"));
    let (naga, info) = validated(read);
    let written = spv::write_vec(&naga, &info, &spv::Options::default(), None)
        .unwrap_or_else(|e| panic!("{e}"));
    let bytes: Vec<u8> = written.into_iter().flat_map(u32::to_le_bytes).collect();
    assert_eq!(
        pinned(&module(&bytes)),
        0,
        "mended: drop the workaround in host/src/parity/execute.rs, `Arithmetic::Pinned`"
    );
}

#[test]
fn naga_loses_storage_formats_in_hlsl() {
    let source = to_hlsl(&wgsl("naga-hlsl-storage-format"));
    let made = module(&dxc(&source));
    let images = all(&made, Op::TypeImage);
    let formats: Vec<_> = images.iter().filter_map(|i| i.operands.get(6)).collect();
    assert_eq!(
        formats,
        [&Operand::ImageFormat(ImageFormat::Rgba32f)],
        "mended: drop the workaround in codegen/src/translate/hlsl.rs, `with_format`"
    );
    let line = "RWTexture2D<float4> image";
    let said = source.replace(line, &format!("[[vk::image_format(\"rgba16f\")]] {line}"));
    let made = module(&dxc(&said));
    let image = all(&made, Op::TypeImage)[0];
    let format = Operand::ImageFormat(ImageFormat::Rgba16f);
    assert_eq!(image.operands.get(6), Some(&format));
}

#[test]
fn naga_calls_functions_of_doubles_that_hlsl_lacks() {
    let source = to_hlsl(&wgsl("naga-hlsl-double-functions"));
    assert_eq!(
        all(&module(&dxc(&source)), Op::FConvert).len(),
        2,
        "mended: drop the workaround in codegen/src/translate/hlsl.rs, `Doubles`\n{source}"
    );
}

#[test]
fn naga_computes_the_condition_of_a_loop_again() {
    const MENDED: &str = "mended: drop the workaround in codegen/src/translate/cleanup/loops.rs, `plain_loops` and `has_late_loops`";
    let module = wgsl("naga-late-loops");
    let written = spv::write_vec(&module.0, &module.1, &spv::Options::default(), None);
    let words = written.unwrap_or_else(|e| panic!("{e}"));
    let spirv: Vec<u8> = words.into_iter().flat_map(u32::to_le_bytes).collect();
    assert_eq!(word(On::Lavapipe, &spirv, 2), 3);
    assert_eq!(
        word(On::Lavapipe, &dxc(&to_hlsl(&module)), 2),
        2,
        "{MENDED}"
    );
    assert_eq!(
        word(On::Llvmpipe, to_glsl(&module).as_bytes(), 2),
        2,
        "{MENDED}"
    );
    let msl = to_msl(&module);
    let again = msl
        .find("if (n == ")
        .unwrap_or_else(|| panic!("{MENDED}\n{msl}"));
    let first = msl.find("bool is_last = ").expect("the condition");
    assert!(again < first, "{MENDED}\n{msl}");
}

#[test]
fn naga_gives_an_empty_array_a_length_in_msl() {
    // 1 + (0 - 0 - 8) / 8 of unsigned numbers is 0x2000_0000.
    let msl = to_msl(&wgsl("naga-msl-empty-buffer"));
    assert!(
        msl.contains("result[0] = 1 + (_buffer_sizes.size0 - 0 - 8) / 8;"),
        "mended, if 0 bytes give 0: drop the case; the check in host/src/device/slots.rs stays\n{msl}"
    );
}

#[test]
fn llvmpipe_ends_loops_early() {
    const MENDED: &str = "mended: drop the case; Hankel works around nothing here";
    // One loop, and two nested ones, whose turns count together.
    for (file, few, sum, many, right) in [
        ("case.comp", 65_534, 65_534, 200_000, 200_000),
        ("nested.comp", 200, 40_000, 300, 90_000),
    ] {
        let source = text("llvmpipe-loop-limit", file);
        let spirv = compiled(&case("llvmpipe-loop-limit", file), &[]);
        for (on, code) in [
            (On::Llvmpipe, source.as_bytes()),
            (On::Lavapipe, spirv.as_slice()),
        ] {
            assert_eq!(word(on, code, few), sum, "{file} on {on:?}");
            assert!(word(on, code, many) <= 65_535, "{file} on {on:?}: {MENDED}");
        }
        assert_eq!(word(On::SwiftShader, &spirv, many), right);
    }
}

#[test]
fn swiftshader_overflows_half_floats_to_nan() {
    let spirv = compiled(&case("swiftshader-half-overflow", "case.comp"), &[]);
    let values: Vec<u8> = [70_000.0, f32::INFINITY]
        .into_iter()
        .flat_map(f32::to_le_bytes)
        .collect();
    let stored = |on| {
        let texel = result(on, &spirv, &values, 8, Some(TexelFormat::Rgba16Float));
        let halves = texel.chunks_exact(2);
        halves
            .map(|h| u16::from_le_bytes([h[0], h[1]]))
            .collect::<Vec<_>>()
    };
    assert_eq!(stored(On::Lavapipe), [0x7bff, 0x3c00, 0x7c00, 0x3c00]);
    assert_eq!(
        stored(On::SwiftShader),
        [0x7c46, 0x3c00, 0x7fff, 0x3c02],
        "mended, if it is [0x7bff or 0x7c00, 0x3c00, 0x7c00, 0x3c00]: \
         drop the case; Hankel works around nothing here"
    );
}

#[test]
fn node_webgpu_collects_what_devices_need() {
    let node = tools(Tool::Node).node().expect("it is there");
    let modules = tools(Tool::Dawn).node_modules();
    let driver = tools(Tool::SwiftShader).swiftshader().expect("it is there");
    let ends_well = |keep: &[&str], limit| {
        let mut command = Command::new(&node);
        command.env("VK_DRIVER_FILES", &driver);
        command.env("VK_ICD_FILENAMES", &driver);
        command.arg("--expose-gc");
        command.arg(case("node-webgpu-lifetime", "case.mjs"));
        command.arg(&modules).args(keep);
        run(&mut command, limit).is_ok_and(|done| done.status.success())
    };
    assert!(ends_well(&["keep"], LIMIT));
    // It crashes or hangs.
    assert!(
        !ends_well(&[], Duration::from_secs(5)),
        "mended: drop the workaround in matrix/src/webgpu/dawn.mjs, `child`"
    );
}
