//! Texts and SPIR-V that mean something else than what they were made of.

use super::*;

/// The SPIR-V of a case's assembly.
fn assembled(name: &str) -> Vec<u8> {
    let assembler = spirv_tools::assembler::create(Some(TargetEnv::Vulkan_1_1));
    let binary = assembler.assemble(&text(name, "case.spvasm"), AssemblerOptions::default());
    binary.unwrap_or_else(|e| panic!("{e}")).as_bytes().to_vec()
}

fn read_by_naga(name: &str) -> (naga::Module, ModuleInfo) {
    let options = naga::front::spv::Options::default();
    let read = naga::front::spv::parse_u8_slice(&assembled(name), &options);
    validated(read.unwrap_or_else(|e| panic!("{e}")))
}

fn to_wgsl((module, info): &(naga::Module, ModuleInfo)) -> String {
    naga::back::wgsl::write_string(module, info, naga::back::wgsl::WriterFlags::empty())
        .unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn dxc_takes_half_of_a_long_literal() {
    const LONG: u64 = 13_787_848_793_156_543_929;
    let longs = |spirv: &[u8]| {
        let made = module(spirv);
        let constants = all(&made, Op::Constant);
        let longs = constants.iter().filter_map(|c| match c.operands[..] {
            [Operand::LiteralBit64(bits)] => Some(bits),
            _ => None,
        });
        longs.collect::<Vec<_>>()
    };
    let source = text("dxc-long-literal", "case.hlsl");
    assert!(
        longs(&dxc(&source)).contains(&(LONG & 0xffff_ffff)),
        "mended: drop the `LL` of codegen/src/translate/text.rs, `suffixed`"
    );
    assert!(longs(&dxc(&source.replace("uL", "uLL"))).contains(&LONG));
}

#[test]
fn dxc_exchanges_bytes_by_what_direct3d_lacks() {
    let source = text("dxc-byte-swap", "case.hlsl");
    // SPIR-V is fine.
    dxc(&source);
    let dxc = tools(Tool::Dxc).dxc().unwrap_or_else(|e| panic!("{e}"));
    let out = folder();
    let (file, made) = (out.path().join("case.hlsl"), out.path().join("case.dxil"));
    fs::write(&file, source).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
    let done = finish(&mut dxc.command(&file, "main", "cs_6_2", &made));
    assert!(
        !done.status.success() && done.words().contains("llvm.bswap.i32"),
        "mended: drop the workaround in codegen/src/translate/reading.rs, `swapped_bytes`; {}",
        done.words()
    );
}

#[test]
fn glslang_refuses_zeros_for_an_array() {
    let file = case("glslang-zero-array", "case.hlsl");
    let (spirv, words) = glslang(&file, &["-D", "-e", "main"]);
    assert!(
        spirv.is_none() && words.contains("array constructor needs one argument"),
        "mended: drop the workaround in codegen/src/translate/hlsl.rs, `without_zero_arrays`; {words}"
    );
    dxc(&text("glslang-zero-array", "case.hlsl"));
}

#[test]
fn naga_leaves_remainders_to_glsl() {
    let source = to_glsl(&wgsl("naga-glsl-remainder"));
    assert!(
        source.contains(" % 7"),
        "mended: drop the workaround in codegen/src/translate/reading.rs, `remainders`\n{source}"
    );
    let six = (-6_i32) as u32;
    assert_ne!(word(On::Llvmpipe, source.as_bytes(), six), six);
}

#[test]
fn naga_counts_bits_in_low_precision() {
    let source = to_glsl(&wgsl("naga-essl-lowp-bits"));
    let counted = |source: &str| word(On::Llvmpipe, source.as_bytes(), 0x1fff);
    assert_eq!(
        counted(&source),
        1_300_000 & 0xffff,
        "mended: drop the workaround in codegen/src/translate/cleanup/bits.rs\n{source}"
    );
}

#[test]
fn naga_reads_what_a_thread_wrote_to_a_texture_without_a_fence() {
    let source = to_msl(&wgsl("naga-msl-fence"));
    assert!(
        source.contains(".write(") && !source.contains("fence"),
        "mended: drop `fenced` in codegen/src/translate/msl.rs\n{source}"
    );
}

#[test]
fn naga_writes_a_function_of_hlsl_twice() {
    let source = to_hlsl(&wgsl("naga-hlsl-size-queries"));
    let header = "uint2 NagaRWDimensions2D(RWTexture2D<float4> tex)";
    assert_eq!(
        source.matches(header).count(),
        2,
        "mended: drop `without_repetitions` in codegen/src/translate/hlsl.rs\n{source}"
    );
}

#[test]
fn naga_reads_unordered_comparisons_as_ordered() {
    let wgsl = to_wgsl(&read_by_naga("naga-unordered"));
    assert!(
        wgsl.contains(" < 0f") && !wgsl.contains('!'),
        "mended: drop the workaround in codegen/src/spirv/order.rs\n{wgsl}"
    );
    // The driver knows what it means.
    let spirv = assembled("naga-unordered");
    assert_eq!(word(On::Lavapipe, &spirv, f32::NAN.to_bits()), 1);
}

#[test]
fn naga_shifts_without_the_sign() {
    let wgsl = to_wgsl(&read_by_naga("naga-shift-sign"));
    assert!(
        wgsl.contains(" >> ") && !wgsl.contains("i32"),
        "mended: drop the conversion before the shifts in codegen/src/spirv/narrow.rs\n{wgsl}"
    );
    // The driver knows what it means.
    let spirv = assembled("naga-shift-sign");
    assert_eq!(word(On::Lavapipe, &spirv, 0x8000_0000), 0xf800_0000);
}

#[test]
fn naga_evaluates_centroids_at_the_center() {
    let wgsl = to_wgsl(&read_by_naga("naga-centroid"));
    assert!(
        !wgsl.contains("centroid"),
        "mended: drop the workaround in codegen/src/translate/cleanup/sampling.rs\n{wgsl}"
    );
}

#[test]
fn naga_panics_at_a_fetch_from_an_array_of_textures() {
    let spirv = assembled("naga-arrayed-fetch");
    let read = std::panic::catch_unwind(|| {
        naga::front::spv::parse_u8_slice(&spirv, &naga::front::spv::Options::default()).is_ok()
    });
    assert!(
        read.is_err(),
        "mended: drop the workaround in codegen/src/translate/reading.rs, `coordinate_types`"
    );
}

#[test]
fn naga_refuses_masks_of_samples_numbers_of_layers_and_gathered_depths() {
    for (case, workaround) in [
        (
            "naga-sample-mask",
            "codegen/src/translate/reading.rs, `with_number_masks`",
        ),
        ("naga-layers", "codegen/src/translate/cleanup/layers.rs"),
        (
            "naga-depth-gather",
            "codegen/src/translate/cleanup/depths.rs",
        ),
    ] {
        let options = naga::front::spv::Options::default();
        let module = naga::front::spv::parse_u8_slice(&assembled(case), &options)
            .unwrap_or_else(|e| panic!("{e}"));
        let mut validator = Validator::new(ValidationFlags::all(), Capabilities::all());
        assert!(
            validator.validate(&module).is_err(),
            "mended: drop the workaround in {workaround}"
        );
    }
}

#[test]
fn naga_writes_masks_and_layers_that_glsl_does_not_have() {
    let glsl = glsl_of(&wgsl("naga-glsl-sample-mask"), naga::ShaderStage::Fragment);
    assert!(
        glsl.contains("gl_SampleMask =") && !glsl.contains("gl_SampleMaskIn["),
        "mended: drop `with_mask_arrays` in codegen/src/translate/glsl.rs\n{glsl}"
    );
    let glsl = to_glsl(&wgsl("naga-glsl-storage-layers"));
    assert!(
        glsl.contains("imageSize(") && glsl.contains(", 0)"),
        "mended: drop `plain_queries` in codegen/src/translate/glsl.rs\n{glsl}"
    );
}

#[test]
fn naga_declares_one_clip_distance_in_hlsl() {
    let hlsl = to_hlsl(&wgsl("naga-hlsl-clip-distances"));
    assert!(
        hlsl.lines()
            .any(|line| line.trim().starts_with("float distances")
                && line.ends_with(" : SV_ClipDistance;")
                && !line.contains('[')),
        "mended: drop `with_clip_distances` in codegen/src/translate/hlsl.rs\n{hlsl}"
    );
}

#[test]
fn naga_takes_textures_of_three_dimensions_for_flat_ones() {
    let hlsl = to_hlsl(&wgsl("naga-hlsl-volume-offset"));
    assert!(
        hlsl.contains("int2(int3("),
        "mended: drop `with_offsets_in_space` in codegen/src/translate/hlsl.rs\n{hlsl}"
    );
    let msl = to_msl(&wgsl("naga-msl-gradients"));
    assert!(
        msl.contains("gradient2d("),
        "mended: drop `with_gradients` in codegen/src/translate/msl.rs\n{msl}"
    );
}

#[test]
fn naga_leaves_level_zero_to_metal() {
    let msl = to_msl(&wgsl("naga-msl-compare-level"));
    assert!(
        msl.contains(".sample_compare(") && !msl.contains("level("),
        "mended: drop `compared_at_level_zero` in codegen/src/translate/msl.rs\n{msl}"
    );
}

#[test]
fn naga_panics_at_an_operation_of_a_subgroup_on_a_value_from_a_loop() {
    let spirv = assembled("naga-subgroup-operand");
    let read = std::panic::catch_unwind(|| {
        naga::front::spv::parse_u8_slice(&spirv, &naga::front::spv::Options::default()).is_ok()
    });
    assert!(
        read.is_err(),
        "mended: drop the workaround in codegen/src/translate/reading.rs, `late_operands`"
    );
}

#[test]
fn naga_makes_an_invalid_module_of_an_atomic_operation_on_a_value_from_a_loop() {
    let options = naga::front::spv::Options::default();
    let module = naga::front::spv::parse_u8_slice(&assembled("naga-atomic-operand"), &options)
        .expect("naga reads the module");
    let (flags, all) = (ValidationFlags::all(), Capabilities::all());
    let valid = Validator::new(flags, all).validate(&module);
    assert!(
        valid.is_err(),
        "mended: drop the workaround in codegen/src/translate/reading.rs, `late_operands`"
    );
}

#[test]
fn naga_drops_the_sign_of_long_integers_in_hlsl() {
    let hlsl = to_hlsl(&wgsl("naga-hlsl-wide-sign"));
    assert!(
        hlsl.contains(" >> ") && !hlsl.contains("int64_t("),
        "mended: drop the workaround in codegen/src/translate/cleanup/bits.rs, `convert_wide_signs`\n{hlsl}"
    );
}

#[test]
fn naga_compares_at_level_0() {
    let wgsl = to_wgsl(&read_by_naga("naga-compare-level"));
    assert!(
        wgsl.contains("textureSampleCompareLevel("),
        "mended, if it is an error: drop the check in codegen/src/translate/reading.rs, `Dropped`\n{wgsl}"
    );
}

#[test]
fn naga_adds_floats_as_whole_numbers_in_hlsl() {
    let hlsl = to_hlsl(&read_by_naga("naga-hlsl-float-atomics"));
    assert!(
        hlsl.contains(".InterlockedAdd(") && hlsl.contains(", 0.5, _e"),
        "mended, if it is an error: drop the check in codegen/src/translate/mod.rs, `float_atomics`\n{hlsl}"
    );
}
