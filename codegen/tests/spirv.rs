//! What is done to SPIR-V, and what is done about bad SPIR-V.

mod support;

use hankel_codegen::finish::{cost_after_optimisation, finish};
use hankel_codegen::{Step, cost};
use hankel_dsl::native::describe::{Kernel, Rounding, Subgroups};
use rspirv::binary::Disassemble;

fn disassembled(name: &str) -> String {
    let kernel = support::all()
        .into_iter()
        .find(|kernel| kernel.name == name)
        .unwrap();
    let finished = finish(&support::spirv(name), &kernel).unwrap();
    rspirv::dr::load_bytes(&finished.spirv)
        .unwrap()
        .disassemble()
}

#[test]
fn only_what_is_used_is_asked_for() {
    let text = disassembled("bound");
    // Its constants are doubles that are converted, which is done here.
    for gone in [
        "Float64",
        "ImageQuery",
        "StorageImageExtendedFormats",
        "VulkanMemoryModel",
        "FConvert",
    ] {
        assert!(!text.contains(gone), "{gone} in\n{text}");
    }
    assert!(text.contains("OpMemoryModel Logical GLSL450"), "{text}");
    let text = disassembled("resample");
    assert!(text.contains("OpCapability ImageQuery"), "{text}");
    assert!(
        text.contains("OpCapability StorageImageExtendedFormats"),
        "{text}"
    );
    assert!(!text.contains("Float64"), "{text}");
    assert!(disassembled("wide_f64").contains("OpCapability Float64"));
}

#[test]
fn atomics_do_not_need_the_newer_memory_model() {
    // As rust-gpu does: the scope of the queue family, which the older model does not have.
    let source = include_str!("fixtures/total.spvasm")
        .replace(
            "%block = OpTypeStruct %floats",
            "%uints = OpTypeRuntimeArray %uint\n%block = OpTypeStruct %uints",
        )
        .replace("%floats ArrayStride", "%uints ArrayStride")
        .replace("%floats = OpTypeRuntimeArray %float", "")
        .replace(
            "%to_float = OpTypePointer StorageBuffer %float",
            "%to_uint = OpTypePointer StorageBuffer %uint\n%family = OpConstant %uint 5",
        )
        .replace(
            "%at = OpAccessChain %to_float",
            "%at = OpAccessChain %to_uint",
        )
        .replace(
            "%to = OpAccessChain %to_float",
            "%to = OpAccessChain %to_uint",
        )
        .replace(
            "%term = OpLoad %float %at",
            "%number = OpLoad %uint %at\n%term = OpConvertUToF %float %number",
        )
        .replace(
            "OpStore %to %sum",
            "%all = OpConvertFToU %uint %sum\n%old = OpAtomicIAdd %uint %to %family %zero %all",
        );
    let finished = finish(&support::assemble(&source), &support::total()).unwrap();
    let text = rspirv::dr::load_bytes(&finished.spirv)
        .unwrap()
        .disassemble();
    assert!(
        text.contains("OpMemoryModel Logical GLSL450") && text.contains("OpAtomicIAdd"),
        "{text}"
    );
}

#[test]
fn textures_that_are_only_written_say_so() {
    let text = disassembled("resample");
    assert_eq!(text.matches("NonReadable").count(), 1, "{text}");
}

#[test]
fn arithmetic_is_not_contracted() {
    for name in ["bound", "wide_f64", "fullscreen"] {
        let text = disassembled(name);
        assert!(
            !text.contains("Fma") && !text.contains("NoContraction"),
            "{text}"
        );
        assert!(text.contains("OpFMul"), "{text}");
    }
}

#[test]
fn an_exact_kernel_forbids_contraction_for_good() {
    let kernel = support::rounding();
    let finished = finish(&support::spirv("rounding"), &kernel).unwrap();
    let module = rspirv::dr::load_bytes(&finished.spirv).unwrap();
    let text = module.disassemble();
    // Five sums and differences for the error, a product, a sum; and nothing else is decorated.
    assert_eq!(text.matches("NoContraction").count(), 8, "{text}");
    for operation in module.functions[0].all_inst_iter() {
        use rspirv::spirv::Op::{FAdd, FMul, FSub};
        if matches!(operation.class.opcode, FAdd | FSub | FMul) {
            let id = operation.result_id.unwrap();
            assert!(
                text.contains(&format!("OpDecorate %{id} NoContraction")),
                "{text}"
            );
        }
    }
    // Without the attribute, nothing is.
    let free = Kernel {
        rounding: Rounding::Free,
        subgroups: Subgroups::Unused,
        ..kernel
    };
    let finished = finish(&support::spirv("rounding"), &free).unwrap();
    let text = rspirv::dr::load_bytes(&finished.spirv)
        .unwrap()
        .disassemble();
    assert!(!text.contains("NoContraction"), "{text}");
}

#[test]
fn names_are_those_of_the_source() {
    let text = disassembled("bound");
    for name in [
        "\"settings\"",
        "\"Moments\"",
        "0 \"b1\"",
        "\"MomentsBuffer\"",
        "\"out\"",
    ] {
        assert!(text.contains(name), "{name} in\n{text}");
    }
}

#[test]
fn finishing_twice_changes_nothing() {
    for kernel in support::all() {
        let once = finish(&support::spirv(&kernel.name), &kernel).unwrap();
        let again = finish(&support::spirv(&kernel.name), &kernel).unwrap();
        assert_eq!(once.spirv, again.spirv, "{}", kernel.name);
        let twice = finish(&once.spirv, &kernel).unwrap();
        assert_eq!(once.cost, twice.cost, "{}", kernel.name);
    }
}

#[test]
fn costs_are_counted() {
    let kernel = support::bound();
    let finished = finish(&support::spirv("bound"), &kernel).unwrap();
    // 0.1 - b1, * bias, + b1, * b2, b3 * z, -, sqrt, <, z / 0.3, select, min, and the guard.
    assert_eq!(finished.cost.arithmetic, 12);
    assert_eq!(finished.cost.operations, 12);
    assert_eq!(finished.cost.branches, 1);
    assert_eq!(
        cost::of_spirv(&finished.spirv, "bound").unwrap(),
        finished.cost
    );
    assert_eq!(
        cost_after_optimisation(&support::spirv("bound"), "bound").unwrap(),
        finished.cost
    );
    // A vector operation is one instruction and as many operations as it has components.
    let resample = finish(&support::spirv("resample"), &support::resample())
        .unwrap()
        .cost;
    assert_eq!(resample.operations - resample.arithmetic, 3);
    let exchange = finish(&support::spirv("exchange"), &support::exchange())
        .unwrap()
        .cost;
    assert_eq!(exchange.barriers, 2);
}

#[test]
fn damaged_binaries_are_refused() {
    let kernel = support::bound();
    let good = support::spirv("bound");
    let step = |bytes: &[u8]| finish(bytes, &kernel).unwrap_err().step;
    assert_eq!(step(b""), Step::Read);
    assert_eq!(step(&good[..good.len() - 3]), Step::Read);
    assert_eq!(step(&[7; 64]), Step::Read);
    // Cut within the function.
    assert_eq!(step(&good[..good.len() - 64]), Step::Validate);
    // An opcode that there is not.
    let mut unknown = good.clone();
    unknown[20] = 0xee;
    unknown[21] = 0xee;
    let error = finish(&unknown, &kernel).unwrap_err();
    assert_eq!(error.step, Step::Validate);
    assert!(
        error
            .to_string()
            .starts_with("kernel `bound`: spirv-val failed"),
        "{error}"
    );
    // Every prefix and many single changed bytes: an error or a module, never a panic.
    for length in (0..good.len()).step_by(52) {
        assert!(finish(&good[..length], &kernel).is_err());
    }
    for place in (20..good.len()).step_by(7) {
        let mut changed = good.clone();
        changed[place] ^= 0x15;
        let _ = finish(&changed, &kernel);
    }
}

#[test]
fn a_description_that_does_not_fit_is_refused() {
    let module = support::spirv("bound");
    let refused = |change: &dyn Fn(&mut Kernel)| {
        let mut kernel = support::bound();
        change(&mut kernel);
        let error = finish(&module, &kernel).unwrap_err();
        assert_eq!(error.step, Step::Describe);
        error.to_string()
    };
    assert!(refused(&|kernel| kernel.name = "other".into()).contains("entry point is `bound`"));
    assert!(
        refused(&|kernel| {
            kernel.stage = hankel_dsl::native::describe::Stage::Fragment;
        })
        .contains("stage")
    );
    let text = refused(&|kernel| {
        use hankel_dsl::native::describe::Role;
        let Role::Element { layout, .. } = &mut kernel.params[1].role else {
            unreachable!()
        };
        layout.fields[2].offset = 16;
    });
    assert!(
        text.contains("`Moments::b3`") && text.contains("byte 8 in SPIR-V, 16 in Rust"),
        "{text}"
    );
}

#[test]
fn what_naga_cannot_read_is_an_error_with_advice() {
    // Valid SPIR-V that naga has no notion of.
    let source = include_str!("fixtures/total.spvasm")
        .replace("%sum1 = OpFAdd %float %sum %term", "%pair = OpIAddCarry %two %n %one\n%carry = OpCompositeExtract %uint %pair 1\n%carried = OpConvertUToF %float %carry\n%sum1 = OpFAdd %float %carried %term")
        .replace("%zero = OpConstant %uint 0", "%two = OpTypeStruct %uint %uint\n%zero = OpConstant %uint 0");
    let kernel = support::total();
    let finished = finish(&support::assemble(&source), &kernel).unwrap();
    let error = hankel_codegen::translate::Ir::read(&finished.spirv, &kernel).unwrap_err();
    assert_eq!(error.step, Step::Parse);
    assert!(error.to_string().contains("IAddCarry"), "{error}");
    assert!(error.advice().contains("--target spirv"));
}

/// Of a compute kernel with this body; `%there` is a private float, `%four` a private vector.
fn registers(body: &str) -> u32 {
    let text = format!(
        "OpCapability Shader
OpMemoryModel Logical GLSL450
OpEntryPoint GLCompute %main \"registers\"
OpExecutionMode %main LocalSize 1 1 1
%void = OpTypeVoid
%call = OpTypeFunction %void
%bool = OpTypeBool
%uint = OpTypeInt 32 0
%float = OpTypeFloat 32
%vector = OpTypeVector %float 4
%one = OpConstant %float 1
%eight = OpConstant %uint 8
%array = OpTypeArray %float %eight
%of_array = OpTypePointer Function %array
%of_float = OpTypePointer Private %float
%of_vector = OpTypePointer Private %vector
%there = OpVariable %of_float Private
%four = OpVariable %of_vector Private
%main = OpFunction %void None %call
%begin = OpLabel
{body}
OpReturn
OpFunctionEnd
"
    );
    let cost = cost::of_spirv(&support::assemble(&text), "registers").unwrap();
    cost.registers
}

#[test]
fn registers_are_what_is_alive_at_once() {
    // Three at once, then the sum of two with the third; constants are none.
    let sum = "%a = OpLoad %float %there
%b = OpLoad %float %there
%c = OpLoad %float %there
%ab = OpFAdd %float %a %b
%abc = OpFAdd %float %ab %c
%d = OpFAdd %float %abc %one
OpStore %there %d";
    assert_eq!(registers(sum), 3);
    // The same, each loaded when it is needed.
    let later = "%a = OpLoad %float %there
%b = OpLoad %float %there
%ab = OpFAdd %float %a %b
%c = OpLoad %float %there
%abc = OpFAdd %float %ab %c
OpStore %there %abc";
    assert_eq!(registers(later), 2);
    let vector = "%v = OpLoad %vector %four
%x = OpCompositeExtract %float %v 0
%y = OpCompositeExtract %float %v 1
%xy = OpFAdd %float %x %y
OpStore %there %xy";
    assert_eq!(registers(vector), 5);
    // An array of the function's own is there all the time.
    let array = "%own = OpVariable %of_array Function
%a = OpLoad %float %there
OpStore %there %a";
    assert_eq!(registers(array), 9);
}

#[test]
fn registers_are_alive_around_loops() {
    // `%kept` is used behind the loop, so it is alive in it, with the sum and the addend.
    let text = "%kept = OpLoad %float %there
OpBranch %head
%head = OpLabel
%sum = OpPhi %float %one %begin %more %next
%ends = OpFOrdLessThan %bool %sum %one
OpLoopMerge %after %next None
OpBranchConditional %ends %after %next
%next = OpLabel
%addend = OpLoad %float %there
%more = OpFAdd %float %sum %addend
OpBranch %head
%after = OpLabel
%all = OpFAdd %float %sum %kept
OpStore %there %all";
    assert_eq!(registers(text), 3);
}
