//! What rust-gpu, naga or a language means otherwise than Rust does, and what is done about it. The
//! modules are those of `tests/upstream`, where the bugs themselves are.

mod support;

use hankel_codegen::finish::finish;
use hankel_codegen::translate::{Ir, Options, Text, Written};
use hankel_codegen::{Language, Step};
use hankel_dsl::native::describe::{Kernel, Range, Stage};
use rspirv::binary::Disassemble;

/// A kernel about which nothing is said.
fn kernel(stage: Stage) -> Kernel {
    Kernel {
        name: "main".into(),
        stage,
        params: Vec::new(),
        outputs: Vec::new(),
        ..support::tint()
    }
}

fn compute() -> Kernel {
    kernel(Stage::Compute {
        threads: [1; 3],
        dimensions: 1,
        cooperative: false,
        workgroup_bytes: 0,
        range: Range::Outputs,
    })
}

fn written(source: &str, kernel: &Kernel, language: Language, options: &Options) -> Written {
    let ir = Ir::read(&support::assemble(source), kernel).unwrap_or_else(|e| panic!("{e}"));
    ir.write(language, kernel, options)
        .unwrap_or_else(|e| panic!("{e}"))
}

fn text(source: &str, kernel: &Kernel, language: Language) -> String {
    match written(source, kernel, language, &Options::default()) {
        Written::Text(Text { source, .. }) => source,
        other => panic!("{language}: {other:?}"),
    }
}

fn reason(source: &str, kernel: &Kernel, language: Language) -> String {
    match written(source, kernel, language, &Options::default()) {
        Written::Unsupported(reason) => reason,
        other => panic!("{language}: {other:?}"),
    }
}

#[test]
fn centroids_stay() {
    let source = include_str!("../../tests/upstream/naga-centroid/case.spvasm");
    let kernel = kernel(Stage::Fragment);
    for language in [
        Language::Wgsl,
        Language::Hlsl,
        Language::Msl,
        Language::Glsl,
    ] {
        let text = text(source, &kernel, language);
        assert!(text.contains("centroid"), "{language}:\n{text}");
    }
    let samples = source
        .replace("%colour Centroid", "%colour Sample")
        .replace(
            "OpCapability Shader",
            "OpCapability Shader\nOpCapability SampleRateShading",
        );
    let text = text(&samples, &kernel, Language::Wgsl);
    assert!(text.contains("@interpolate(perspective, sample)"), "{text}");
}

#[test]
fn masks_of_samples_are_numbers() {
    let source = include_str!("../../tests/upstream/naga-sample-mask/case.spvasm");
    let kernel = kernel(Stage::Fragment);
    for (language, word) in [
        (Language::Wgsl, "@builtin(sample_mask)"),
        (Language::Hlsl, "SV_Coverage"),
        (Language::Msl, "[[sample_mask]]"),
        (Language::Glsl, "gl_SampleMask[0]"),
    ] {
        let text = text(source, &kernel, language);
        assert!(text.contains(word), "{language}:\n{text}");
    }
}

#[test]
fn layers_are_counted() {
    let source = include_str!("../../tests/upstream/naga-layers/case.spvasm");
    let kernel = kernel(Stage::Fragment);
    for (language, word) in [
        (Language::Wgsl, "textureNumLayers("),
        (Language::Hlsl, "GetDimensions("),
        (Language::Msl, ".get_array_size()"),
        (Language::Glsl, ".z"),
    ] {
        let text = text(source, &kernel, language);
        assert!(text.contains(word), "{language}:\n{text}");
    }
}

#[test]
fn layers_are_fetched() {
    let source = include_str!("../../tests/upstream/naga-arrayed-fetch/case.spvasm")
        .replace("%main \"main\"", "%main \"main\" %image");
    let kernel = kernel(Stage::Fragment);
    let finished = finish(&support::assemble(&source), &kernel).unwrap_or_else(|e| panic!("{e}"));
    let ir = Ir::read(&finished.spirv, &kernel).unwrap_or_else(|e| panic!("{e}"));
    let written = ir.write(Language::Wgsl, &kernel, &Options::default());
    let text = match written.unwrap_or_else(|e| panic!("{e}")) {
        Written::Text(Text { source, .. }) => source,
        other => panic!("{other:?}"),
    };
    assert!(text.contains("textureLoad("), "{text}");
}

#[test]
fn a_comparison_at_a_level_is_refused() {
    let source = include_str!("../../tests/upstream/naga-compare-level/case.spvasm");
    let kernel = kernel(Stage::Fragment);
    for language in [
        Language::Wgsl,
        Language::Hlsl,
        Language::Msl,
        Language::Glsl,
    ] {
        assert!(reason(source, &kernel, language).contains("level 0"));
    }
    let at_zero = source.replace("OpConstant %float 2", "OpConstant %float 0");
    let text = text(&at_zero, &kernel, Language::Wgsl);
    assert!(text.contains("textureSampleCompareLevel("), "{text}");
}

#[test]
fn atomics_of_floats_are_refused_where_they_are_not() {
    let source = include_str!("../../tests/upstream/naga-hlsl-float-atomics/case.spvasm");
    let kernel = compute();
    for language in [
        Language::Wgsl,
        Language::Hlsl,
        Language::Glsl,
        Language::Essl310,
    ] {
        let reason = reason(source, &kernel, language);
        assert!(reason.contains("no atomics of floats"), "{reason}");
    }
    assert!(reason(source, &kernel, Language::Msl).contains("3.0"));
    let options = Options {
        msl_version: "3.0".parse().unwrap(),
        ..Options::default()
    };
    let newer = written(source, &kernel, Language::Msl, &options);
    assert!(matches!(newer, Written::Text(_)), "{newer:?}");
}

/// With the interface that newer SPIR-V lists.
fn listed(source: &str) -> String {
    source.replace("%main \"main\"", "%main \"main\" %input %output")
}

/// What becomes of a module.
fn finished(source: &str) -> String {
    let done =
        finish(&support::assemble(&listed(source)), &compute()).unwrap_or_else(|e| panic!("{e}"));
    rspirv::dr::load_bytes(&done.spirv).unwrap().disassemble()
}

/// A module that stores what `body` computes as `%r` from the float `%x` and the number `%n`.
fn computing(body: &str) -> String {
    let frame = include_str!("../../tests/upstream/naga-unordered/case.spvasm");
    let (before, after) = frame
        .split_once("      %below = ")
        .expect("the case compares");
    let (_, after) = after.split_once("OpStore %b %chosen").expect("and stores");
    let before = before.replace(
        "OpMemoryModel",
        "OpCapability Int64\n%glsl = OpExtInstImport \"GLSL.std.450\"\nOpMemoryModel",
    );
    let before = before.replace(
        "      %input = OpVariable",
        "        %int = OpTypeInt 32 1\n      %ulong = OpTypeInt 64 0\n      %three = OpConstant %uint 3\n\
         %long0 = OpConstant %ulong 0\n%float3 = OpConstant %float 3\n%third = OpConstant %float 0.333333343\n\
         %by29 = OpConstant %uint 29\n      %input = OpVariable",
    );
    format!(
        "{before}{body}\n%bits = OpBitcast %uint %r\n%b = OpAccessChain %b_pointer %output %zero %zero\n\
         OpStore %b %bits{after}"
    )
}

#[test]
fn comparisons_hold_for_nan_in_every_language() {
    let source = include_str!("../../tests/upstream/naga-unordered/case.spvasm");
    let text = finished(source);
    assert!(
        text.contains("OpFOrdGreaterThanEqual") && text.contains("OpLogicalNot"),
        "{text}"
    );
    let is_nan = source.replace(
        "OpFUnordLessThan %bool %x %float0",
        "OpFUnordNotEqual %bool %x %x",
    );
    let text = finished(&is_nan);
    assert!(
        text.contains("OpBitcast") && text.contains("OpUGreaterThan") && !text.contains("OpFUnord"),
        "{text}"
    );
}

#[test]
fn functions_of_libm_are_what_rust_calls_so() {
    let text = finished(&computing("%r = OpFMod %float %x %float3"));
    assert!(
        text.contains("OpFRem") && !text.contains("OpFMod"),
        "{text}"
    );
    let text = finished(&computing("%r = OpExtInst %float %glsl Round %x"));
    assert_eq!(text.matches(" Trunc ").count(), 2, "{text}");
    assert!(!text.contains(" Round "), "{text}");
    // To the third, which needs no power; its root, and to a number that is not known, which do.
    let text = finished(&computing("%r = OpExtInst %float %glsl Pow %x %float3"));
    assert_eq!(text.matches("OpFMul").count(), 2, "{text}");
    assert!(!text.contains("OpExtInst "), "{text}");
    let text = finished(&computing("%r = OpExtInst %float %glsl Pow %x %third"));
    assert!(
        text.contains("OpFNegate") && text.contains("OpSelect"),
        "{text}"
    );
    let text = finished(&computing(
        "%i = OpBitcast %int %x\n%f = OpConvertSToF %float %i\n%r = OpExtInst %float %glsl Pow %x %f",
    ));
    assert!(
        text.contains("OpBitwiseAnd") && text.contains("OpSelect"),
        "{text}"
    );
}

/// A barrier in a branch that depends on `BUILT_IN`.
const BARRIER: &str = "
    OpCapability Shader
    OpMemoryModel Logical GLSL450
    OpEntryPoint GLCompute %main \"main\" %number
    OpExecutionMode %main LocalSize 1 1 1
    OpDecorate %number BuiltIn BUILT_IN
    %void = OpTypeVoid
    %bool = OpTypeBool
    %uint = OpTypeInt 32 0
    %uvec3 = OpTypeVector %uint 3
    %pointer = OpTypePointer Input %uvec3
    %fn = OpTypeFunction %void
    %zero = OpConstant %uint 0
    %workgroup = OpConstant %uint 2
    %release = OpConstant %uint 264
    %number = OpVariable %pointer Input
    %main = OpFunction %void None %fn
    %start = OpLabel
    %all = OpLoad %uvec3 %number
    %x = OpCompositeExtract %uint %all 0
    %first = OpIEqual %bool %x %zero
    OpSelectionMerge %join None
    OpBranchConditional %first %yes %join
    %yes = OpLabel
    OpControlBarrier %workgroup %workgroup %release
    OpBranch %join
    %join = OpLabel
    OpReturn
    OpFunctionEnd";

#[test]
fn a_barrier_that_some_do_not_reach_is_refused() {
    let divided = support::assemble(&BARRIER.replace("BUILT_IN", "LocalInvocationId"));
    let error = finish(&divided, &compute()).unwrap_err();
    assert_eq!(error.step, Step::Meaning);
    let told = error.to_string();
    assert!(told.contains("src/lib.rs:7: kernel `main`: "), "{told}");
    assert!(told.contains("checked_div"), "{told}");
    // Whole workgroups take the one way or the other.
    let together = support::assemble(&BARRIER.replace("BUILT_IN", "WorkgroupId"));
    finish(&together, &compute()).unwrap_or_else(|e| panic!("{e}"));
}

#[test]
fn an_operation_of_a_subgroup_that_some_do_not_reach_is_refused() {
    let subgroup = BARRIER
        .replace(
            "OpCapability Shader",
            "OpCapability Shader\n OpCapability GroupNonUniformArithmetic",
        )
        .replace("%main \"main\" %number", "%main \"main\" %number %sums")
        .replace(
            "%main = OpFunction",
            "%place = OpTypePointer Workgroup %uint\n %sums = OpVariable %place Workgroup\n \
             %subgroup = OpConstant %uint 3\n %main = OpFunction",
        )
        .replace(
            "OpControlBarrier %workgroup %workgroup %release",
            "%sum = OpGroupNonUniformIAdd %uint %subgroup Reduce %x\n \
             %before = OpAtomicIAdd %uint %sums %workgroup %release %sum",
        );
    let divided = support::assemble(&subgroup.replace("BUILT_IN", "LocalInvocationId"));
    let error = finish(&divided, &compute()).unwrap_err();
    assert_eq!(error.step, Step::Meaning);
    let told = error.to_string();
    assert!(told.contains("of a subgroup"), "{told}");
    // Whole subgroups take the one way or the other.
    let together = support::assemble(&subgroup.replace("BUILT_IN", "WorkgroupId"));
    finish(&together, &compute()).unwrap_or_else(|e| panic!("{e}"));
    // A vote is the same for all of a subgroup, and not for the workgroup.
    let voted = subgroup
        .replace(
            "OpCapability GroupNonUniformArithmetic",
            "OpCapability GroupNonUniformArithmetic\n OpCapability GroupNonUniformVote",
        )
        .replace(
            "%first = OpIEqual %bool %x %zero",
            "%mine = OpIEqual %bool %x %zero\n %first = OpGroupNonUniformAny %bool %subgroup %mine",
        )
        .replace("BUILT_IN", "LocalInvocationId");
    finish(&support::assemble(&voted), &compute()).unwrap_or_else(|e| panic!("{e}"));
}
