//! What vertex and fragment kernels say is in the texts and in the manifest, or is refused.

use hankel_codegen::Language::{Essl300, Essl310, Glsl, Hlsl, Msl, Wgsl};
use hankel_codegen::build::Generated;
use hankel_codegen::manifest::BindingKind;
use hankel_tests::Crate;

fn text(generated: &Generated, kernel: &str, extension: &str) -> String {
    let found = generated.files.iter().find(|(path, _)| {
        format!("/{path}").contains(&format!("/{kernel}.")) && path.ends_with(extension)
    });
    let (_, bytes) = found.unwrap_or_else(|| panic!("no {extension} of {kernel}"));
    String::from_utf8(bytes.clone()).expect("it is text")
}

#[test]
fn what_is_not_interpolated_is_said() {
    let generated = Crate::conformance().generate();
    let wgsl = text(&generated, "flat", ".wgsl");
    assert_eq!(wgsl.matches("@interpolate(flat").count(), 3, "{wgsl}");
    let hlsl = text(&generated, "flat", ".hlsl");
    assert_eq!(hlsl.matches("nointerpolation").count(), 3, "{hlsl}");
    let kernel = &generated.manifest.kernels["flat"];
    assert!(
        kernel
            .inputs
            .iter()
            .all(|input| input.interpolation.as_deref() == Some("flat"))
    );
    let vertex = &generated.manifest.kernels["numbered"];
    let flat = vertex
        .outputs
        .iter()
        .filter(|output| output.interpolation.as_deref() == Some("flat"))
        .count();
    assert_eq!(flat, 3);
}

#[test]
fn interpolation_is_said_by_both_stages() {
    let generated = Crate::conformance().generate();
    let ways = [
        None,
        Some("perspective, centroid"),
        Some("linear"),
        Some("linear, centroid"),
        Some("perspective, sample"),
        Some("linear, sample"),
    ];
    let kernels = &generated.manifest.kernels;
    let varyings = |all: &[hankel_codegen::manifest::Interface]| -> Vec<Option<String>> {
        let varyings = all.iter().filter(|it| it.kind == "varying");
        varyings.map(|it| it.interpolation.clone()).collect()
    };
    let ways: Vec<Option<String>> = ways.map(|it| it.map(str::to_owned)).into();
    assert_eq!(varyings(&kernels["interpolated"].outputs), ways);
    assert_eq!(varyings(&kernels["at_samples"].inputs), ways);
    for kernel in ["interpolated", "at_samples"] {
        for (extension, words) in [
            (
                ".wgsl",
                [
                    "@interpolate(perspective, centroid)",
                    "@interpolate(linear)",
                    "@interpolate(linear, centroid)",
                    "@interpolate(perspective, sample)",
                    "@interpolate(linear, sample)",
                ],
            ),
            (
                ".hlsl",
                [
                    "centroid float2",
                    "noperspective float3",
                    "noperspective centroid float",
                    "sample float",
                    "noperspective sample float",
                ],
            ),
        ] {
            let text = text(&generated, kernel, extension);
            for word in words {
                assert!(text.contains(word), "{word}:\n{text}");
            }
        }
        assert!(kernels[kernel].unsupported.contains_key(&Essl310));
    }
    assert!(kernels["covered_place"].unsupported.is_empty());
}

#[test]
fn masks_and_numbers_of_primitives_are_said() {
    let generated = Crate::conformance().generate();
    for (kernel, extension, word) in [
        ("coverage", ".wgsl", "@builtin(sample_mask)"),
        ("coverage", ".hlsl", "SV_Coverage"),
        ("coverage", ".metal", "[[sample_mask]]"),
        ("coverage", "glsl/coverage.frag", "gl_SampleMask[0] = int("),
        ("primitives", ".wgsl", "@builtin(primitive_index)"),
        ("primitives", ".hlsl", "SV_PrimitiveID"),
        ("primitives", ".metal", "[[primitive_id]]"),
    ] {
        let text = text(&generated, kernel, extension);
        assert!(text.contains(word), "{word}:\n{text}");
    }
    let kernels = &generated.manifest.kernels;
    for language in [Essl310, Essl300] {
        assert!(kernels["coverage"].unsupported[&language].contains("masks of samples"));
    }
    assert!(kernels["primitives"].unsupported[&Essl300].contains("primitive's number"));
    for (kernel, language, feature) in [
        ("primitives", Wgsl, "primitive-index"),
        ("primitives", Essl310, "GL_OES_geometry_shader"),
        ("cubes_lit", Glsl, "GL_EXT_texture_shadow_lod"),
    ] {
        let requires = &kernels[kernel].languages[&language].requires;
        assert!(requires.iter().any(|it| it == feature), "{requires:?}");
    }
}

#[test]
fn texels_beside_others_are_asked_for_by_offsets() {
    let generated = Crate::conformance().generate();
    for (kernel, extension, word) in [
        ("blurred_sideways", ".wgsl", "vec2<i32>(-1i, 0i)"),
        ("blurred_sideways", ".hlsl", "int2(int(-1), int(0))"),
        ("blurred_sideways", ".metal", "metal::int2(-1, 0)"),
        (
            "blurred_sideways",
            "essl310/blurred_sideways.frag",
            "textureOffset(",
        ),
        ("four_by_offsets", ".wgsl", "textureSampleCompareLevel("),
    ] {
        let text = text(&generated, kernel, extension);
        assert!(text.contains(word), "{word}:\n{text}");
    }
}

#[test]
fn depths_and_dropped_fragments_are_said() {
    let generated = Crate::conformance().generate();
    let kernel = &generated.manifest.kernels["deep"];
    assert!(kernel.outputs.iter().any(|output| output.kind == "depth"));
    for (extension, depth, drop) in [
        (".wgsl", "frag_depth", "discard"),
        (".hlsl", "SV_Depth", "discard"),
        (".metal", "depth(any)", "discard_fragment"),
    ] {
        let text = text(&generated, "deep", extension);
        assert!(text.contains(depth) && text.contains(drop), "{text}");
    }
}

#[test]
fn what_a_language_cannot_ask_for_is_refused() {
    let generated = Crate::conformance().generate();
    let slopes = &generated.manifest.kernels["grained_slopes"];
    for language in [Msl, Essl310] {
        let reason = &slopes.unsupported[&language];
        assert!(reason.contains("no coarse and no fine"), "{reason}");
    }
    for language in [Wgsl, Hlsl] {
        assert!(slopes.languages.contains_key(&language));
    }
    let sample = &generated.manifest.kernels["sample"];
    assert!(sample.unsupported.contains_key(&Essl310));
    let gathered = &generated.manifest.kernels["gathered"];
    assert!(gathered.unsupported[&Essl300].contains("gather"));
    assert!(gathered.languages.contains_key(&Essl310));
}

/// An image pass whose format a language cannot store is drawn in it.
#[test]
fn image_passes_are_drawn_where_they_cannot_be_stored() {
    let generated = Crate::conformance().generate();
    let kernels = &generated.manifest.kernels;
    let form = Some("two_forms_fragment");
    for compute in [
        "two_forms_rgba16unorm",
        "two_forms_rgba32float",
        "two_forms_rgba8unorm",
    ] {
        assert_eq!(kernels[compute].fragment_form.as_deref(), form);
        assert!(!kernels[compute].full_screen);
    }
    let stored = &kernels["two_forms_rgba16unorm"].unsupported;
    assert!(stored[&Essl310].contains("storage textures"), "{stored:?}");
    assert!(stored[&Essl300].contains("no compute"), "{stored:?}");
    let fragment = &kernels["two_forms_fragment"];
    assert!(fragment.full_screen && fragment.unsupported.is_empty());
    assert_eq!(fragment.bindings.len(), 2);
    let several = &kernels["several_forms_fragment"];
    let types: Vec<&str> = several.outputs.iter().map(|it| it.ty.as_str()).collect();
    assert_eq!(types, ["u32", "vec2<u32>", "vec4<i32>", "f32"]);
    assert!(several.unsupported.is_empty());
    let essl = text(&generated, "essl300/two_forms_fragment", ".frag");
    assert!(essl.contains("gl_FragCoord"), "{essl}");
}

/// Which passes of a shadow map WebGL 2 can run, and what keeps it from the others.
#[test]
fn filters_run_in_webgl_2() {
    let generated = Crate::shadows().generate();
    let kernels = &generated.manifest.kernels;
    let fragments = kernels.iter().filter(|(_, kernel)| kernel.full_screen);
    for (name, kernel) in fragments {
        assert!(!kernel.unsupported.contains_key(&Essl310), "{name}");
        let reads_samples = kernel.bindings.iter().any(|it| it.is_multisampled());
        match kernel.unsupported.get(&Essl300) {
            None => assert!(!reads_samples, "{name}"),
            Some(why) => assert!(why.contains("no multisampled textures"), "{name}: {why}"),
        }
    }
    for name in [
        "blur_fragment",
        "halve_fragment",
        "blur_packed_10_fragment",
        "resolve_single_symmetric_fragment",
        "resolve_single_packed_10_fragment",
    ] {
        assert!(kernels[name].languages.contains_key(&Essl300), "{name}");
    }
    assert!(kernels["full_screen"].languages.contains_key(&Essl300));
}

#[test]
fn what_textures_are_sampled_with_is_in_the_texts() {
    let generated = Crate::conformance().generate();
    for (kernel, wgsl, hlsl, msl) in [
        (
            "levels",
            "textureDimensions(source, ",
            ".GetDimensions(",
            ".get_width(",
        ),
        (
            "level_count",
            "textureNumLevels",
            "GetDimensions",
            "get_num_mip_levels",
        ),
        (
            "trilinear",
            "textureSampleLevel",
            "SampleLevel",
            "metal::level(",
        ),
        (
            "by_gradients",
            "textureSampleGrad",
            "SampleGrad",
            "gradient2d(",
        ),
        (
            "receding",
            "textureSampleBias",
            "SampleBias",
            "metal::bias(",
        ),
        (
            "soft",
            "textureSampleCompareLevel",
            "SampleCmpLevelZero",
            "sample_compare(",
        ),
        (
            "four_lit",
            "textureGatherCompare",
            "GatherCmp",
            "gather_compare(",
        ),
        (
            "stacked",
            "texture_2d_array",
            "Texture2DArray",
            "texture2d_array",
        ),
        ("around", "texture_cube", "TextureCube", "texturecube"),
        (
            "surroundings",
            "texture_cube_array",
            "TextureCubeArray",
            "texturecube_array",
        ),
        ("along", "texture_1d", "Texture1D", "texture1d"),
    ] {
        for (extension, word) in [(".wgsl", wgsl), (".hlsl", hlsl), (".metal", msl)] {
            let text = text(&generated, kernel, extension);
            assert!(text.contains(word), "no {word} in {text}");
        }
    }
    let binding = |kernel: &str, name: &str| {
        let bindings = &generated.manifest.kernels[kernel].bindings;
        let found = bindings.iter().find(|binding| binding.name == name);
        found.unwrap_or_else(|| panic!("{kernel} has no {name}"))
    };
    let depths = binding("layers_lit", "depths");
    assert_eq!(depths.texture.as_deref(), Some("depth-2d-array"));
    assert_eq!(depths.view_dimension(), Some("2d-array"));
    assert!(depths.is_depth() && !depths.is_multisampled());
    let sampler = binding("layers_lit", "sampler");
    assert_eq!(sampler.kind, BindingKind::ComparisonSampler);
    let cubes = binding("surroundings", "source");
    assert_eq!(cubes.texture.as_deref(), Some("cube-array"));
    let header = |name: &str| {
        let found = generated
            .files
            .iter()
            .find(|(path, _)| path.ends_with(name));
        let (_, bytes) = found.unwrap_or_else(|| panic!("no {name}"));
        String::from_utf8(bytes.clone()).expect("it is text")
    };
    for (name, words) in [
        (
            "hankel.js",
            ["\"comparison\"", "\"depth\"", "\"cube-array\""],
        ),
        (
            "hankel_wgpu.rs",
            [
                "BindingType::Comparison",
                "SampleType::Depth",
                "Dimension::CubeArray",
            ],
        ),
    ] {
        let text = header(name);
        for word in words {
            assert!(text.contains(word), "no {word} in {name}");
        }
    }
}

#[test]
fn what_a_language_does_not_sample_is_refused() {
    let generated = Crate::conformance().generate();
    for (kernel, languages, word) in [
        ("level_count", &[Essl310][..], "TEXTURE_LEVELS"),
        ("blockers", &[Glsl, Essl310], "once more"),
        ("layers_lit", &[Glsl, Essl310], "a gather of comparisons"),
        ("along", &[Essl310], "one-dimensional"),
    ] {
        let kernel = &generated.manifest.kernels[kernel];
        for language in languages {
            let reason = &kernel.unsupported[language];
            assert!(reason.contains(word), "{reason}");
        }
    }
}

#[test]
fn what_stages_return_beside_places_and_colours_is_in_the_texts() {
    let generated = Crate::conformance().generate();
    for (kernel, extension, words) in [
        (
            "clipped",
            ".wgsl",
            &["enable clip_distances;", "@invariant"][..],
        ),
        (
            "clipped",
            ".hlsl",
            &["precise float4 ", "float2 clip_distances"],
        ),
        (
            "clipped",
            ".metal",
            &["[[position, invariant]]", "[[clip_distance]] [2]"],
        ),
        (
            "clipped",
            ".vert",
            &["invariant gl_Position;", "float gl_ClipDistance[2];"],
        ),
        (
            "boxed",
            ".hlsl",
            &["float4 clip_distances", "_more : SV_ClipDistance1"],
        ),
        ("stained", ".wgsl", &["@blend_src(0)", "@blend_src(1)"]),
        ("stained", ".hlsl", &["SV_Target0", "SV_Target1"]),
        ("stained", ".metal", &["[[color(0), index(1)]]"]),
        ("stained", ".frag", &["layout(location = 0, index = 1)"]),
    ] {
        let text = text(&generated, kernel, extension);
        for word in words {
            assert!(text.contains(word), "no {word} in {text}");
        }
    }
    let requires = |kernel: &str, language| {
        let of_kernel = &generated.manifest.kernels[kernel].languages[&language];
        of_kernel.requires.clone()
    };
    assert_eq!(requires("clipped", Wgsl), ["clip-distances"]);
    assert_eq!(requires("clipped", Essl300), ["GL_EXT_clip_cull_distance"]);
    assert_eq!(requires("stained", Wgsl), ["dual-source-blending"]);
    let blockers = &generated.manifest.kernels["blockers"].bindings;
    let nearest = blockers.iter().find(|it| it.name == "nearest");
    assert_eq!(nearest.unwrap().kind, BindingKind::NonFilteringSampler);
}
