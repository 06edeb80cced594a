//! Modules of a few kilobytes that would become gigabytes of text, or that would take the writers'
//! stack.

mod support;

use std::fmt::Write;

use hankel_codegen::Language;
use hankel_codegen::translate::{Ir, Options, Written};

const HEAD: &str = "OpCapability Shader
OpMemoryModel Logical GLSL450
OpEntryPoint GLCompute %main \"bound\"
OpExecutionMode %main LocalSize 1 1 1
%void = OpTypeVoid
%call = OpTypeFunction %void
%uint = OpTypeInt 32 0
%float = OpTypeFloat 32
%zero = OpConstant %uint 0
%one = OpConstant %float 1
";

fn read(text: &str) -> Result<Ir, String> {
    let spirv = support::assemble(&format!("{HEAD}{text}OpReturn\nOpFunctionEnd\n"));
    Ir::read(&spirv, &support::bound()).map_err(|failure| failure.to_string())
}

/// A private array of `rows` times `columns` zeros.
fn array(rows: u32, columns: u32) -> String {
    format!(
        "%rows = OpConstant %uint {rows}
%columns = OpConstant %uint {columns}
%row = OpTypeArray %uint %columns
%table = OpTypeArray %row %rows
%of_table = OpTypePointer Private %table
%of_uint = OpTypePointer Private %uint
%null = OpConstantNull %table
%all = OpVariable %of_table Private %null
%main = OpFunction %void None %call
%begin = OpLabel
%place = OpAccessChain %of_uint %all %zero %zero
%value = OpLoad %uint %place
OpStore %place %value
"
    )
}

/// A sum of so many terms, each within the next.
fn sum(terms: u32) -> String {
    let mut text = "%of_float = OpTypePointer Private %float
%there = OpVariable %of_float Private %one
%main = OpFunction %void None %call
%begin = OpLabel
%s0 = OpLoad %float %there
"
    .to_owned();
    for i in 1..=terms {
        let _ = writeln!(text, "%s{i} = OpFAdd %float %s{} %one", i - 1);
    }
    let _ = writeln!(text, "OpStore %there %s{terms}");
    text
}

#[test]
fn a_text_of_gigabytes_is_refused() {
    read(&array(16, 16)).unwrap();
    let error = read(&array(16_384, 16_384)).unwrap_err();
    for words in ["`bound`", "268435456", "array smaller"] {
        assert!(error.contains(words), "{error}");
    }
}

/// A uniform whose only member starts so many bytes in.
fn gap(bytes: u32) -> String {
    format!(
        "OpDecorate %block Block
OpMemberDecorate %block 0 Offset {bytes}
OpDecorate %uniform DescriptorSet 0
OpDecorate %uniform Binding 0
%block = OpTypeStruct %float
%of_block = OpTypePointer Uniform %block
%of_float = OpTypePointer Uniform %float
%uniform = OpVariable %of_block Uniform
%main = OpFunction %void None %call
%begin = OpLabel
%place = OpAccessChain %of_float %uniform %zero
%value = OpLoad %float %place
"
    )
}

#[test]
fn a_structure_of_gaps_is_refused() {
    read(&gap(256)).unwrap();
    let error = read(&gap(1 << 28)).unwrap_err();
    for words in ["`bound`", "268435456 bytes", "more than 65536"] {
        assert!(error.contains(words), "{error}");
    }
}

/// So many conditions, each within the one before.
fn conditions(levels: u32) -> String {
    let mut text = "%bool = OpTypeBool
%of_float = OpTypePointer Private %float
%there = OpVariable %of_float Private %one
%main = OpFunction %void None %call
%begin = OpLabel
%value = OpLoad %float %there
"
    .to_owned();
    for i in 0..levels {
        let _ = writeln!(
            text,
            "%test{i} = OpFOrdLessThan %bool %value %one
OpSelectionMerge %end{i} None
OpBranchConditional %test{i} %inner{i} %end{i}
%inner{i} = OpLabel"
        );
    }
    text.push_str("OpStore %there %one\n");
    for i in (0..levels).rev() {
        let _ = writeln!(text, "OpBranch %end{i}\n%end{i} = OpLabel");
    }
    text
}

/// Runs a test on a stack that is smaller than any thread's.
fn on_a_small_stack(test: impl FnOnce() + Send + 'static) {
    let small = std::thread::Builder::new().stack_size(512 << 10);
    small.spawn(test).unwrap().join().unwrap();
}

#[test]
fn blocks_that_would_take_the_stack_are_refused() {
    on_a_small_stack(|| {
        read(&conditions(500)).unwrap();
        let error = read(&conditions(3000)).unwrap_err();
        for words in ["`bound`", "levels deep", "conditions"] {
            assert!(error.contains(words), "{error}");
        }
    });
}

#[test]
fn a_deep_expression_gets_variables_for_its_parts() {
    on_a_small_stack(|| {
        let kernel = support::bound();
        let ir = read(&sum(20_000)).unwrap();
        for language in [
            Language::Wgsl,
            Language::Hlsl,
            Language::Msl,
            Language::Glsl,
            Language::Essl310,
        ] {
            let written = ir.write(language, &kernel, &Options::default()).unwrap();
            let Written::Text(text) = written else {
                panic!("{language} has no text: {written:?}");
            };
            let longest = text.source.lines().map(str::len).max().unwrap();
            assert!(longest < 2000, "{language}: a line of {longest} characters");
            assert!(text.source.matches("part").count() >= 199, "{language}");
        }
    });
}
