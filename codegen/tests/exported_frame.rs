//! Exported frames, of kernels made by hand.

mod support;

use std::collections::BTreeMap;

use hankel_codegen::frame::{CONTENTS, Draft, FRAME_FILE, Frame, Frozen, fields, generate};
use hankel_codegen::spirv::words;
use hankel_codegen::{Error, Language, finish};
use hankel_dsl::native::describe::{Field, Inputs, Layout, Scalar, Type};
use serde_json::json;

/// Two passes of one kernel with different constants, and a draw.
fn draft() -> Draft {
    let compute = |shader: &str| {
        json!({
            "kind": "compute", "label": shader, "invocations": [16, 16, 1], "workgroups": [2, 2, 1],
            "call": { "shader": shader, "bind": {
                "source": { "texture": "map" }, "linear": { "sampler": "linear" },
                "depth": { "texture": "depth" }, "out": { "texture": "out" },
            } },
        })
    };
    let frame = json!({
        "format": 1,
        "made_by": { "hankel": "", "rust_gpu": "", "spirv_tools": "", "naga": "" },
        "scene": "hand.toml",
        "shadow": {
            "technique": "none", "format": "rgba16unorm", "depth_range": "unit", "size": 16, "filter": 1,
            "fit": "scene", "samples": [1, 1], "moment_bias": 6e-5, "depth_bias": 0.0, "leak_cut": 0.02,
        },
        "picture": "picture",
        "buffers": {}, "textures": {}, "samplers": {}, "uniforms": {}, "shaders": {},
        "passes": [compute("resample_taps_3"), compute("resample_taps_5"), {
            "kind": "draw", "label": "tint",
            "vertex": { "shader": "fullscreen", "bind": {} },
            "fragment": { "shader": "tint", "bind": {} },
            "attributes": [],
            "indices": { "buffer": "indices", "format": "uint32", "count": 3 },
            "topology": "triangle-list", "cull_mode": "none", "samples": 1, "colour_targets": [],
        }],
    });
    let frozen = |kernel: &str, constants: &[(&str, u32)]| Frozen {
        kernel: kernel.into(),
        constants: constants
            .iter()
            .map(|(n, v)| ((*n).into(), (*v).into()))
            .collect(),
    };
    Draft {
        frame: Frame::from_json(frame.to_string().as_bytes()).unwrap(),
        shaders: BTreeMap::from([
            ("resample_taps_3".into(), frozen("resample", &[("taps", 3)])),
            ("resample_taps_5".into(), frozen("resample", &[("taps", 5)])),
            ("fullscreen".into(), frozen("fullscreen", &[])),
            ("tint".into(), frozen("tint", &[])),
        ]),
        contents: BTreeMap::from([(format!("{CONTENTS}/indices.bin"), vec![0; 12])]),
    }
}

#[test]
fn each_shader_is_there_once_with_its_constants_frozen() {
    let generated = generate(&support::request(), &draft(), &support::modules()).unwrap();
    let frame = Frame::from_json(&generated.files[FRAME_FILE]).unwrap();
    assert_eq!(frame.to_json().as_bytes(), generated.files[FRAME_FILE]);
    assert_eq!(frame.shaders.len(), 4);
    assert_eq!(generated.manifest.kernels.len(), 4);
    assert!(generated.manifest.files.contains_key(FRAME_FILE));
    assert!(generated.manifest.files.contains_key("frame/indices.bin"));
    let text = |file: &str| String::from_utf8(generated.files[file].clone()).unwrap();
    let three = text("wgsl/resample_taps_3.wgsl");
    let five = text("wgsl/resample_taps_5.wgsl");
    for wgsl in [&three, &five] {
        assert!(
            !wgsl.contains("override") && !wgsl.contains("@id"),
            "{wgsl}"
        );
    }
    assert_ne!(three.replace("taps_3", ""), five.replace("taps_5", ""));
    // Alike from another order of kernels, and without what the frame does not have.
    let mut turned = support::request();
    turned.kernels.reverse();
    let other = generate(&turned, &draft(), &support::modules()).unwrap();
    assert_eq!(other.files, generated.files);
}

#[test]
fn the_stages_of_a_draw_share_no_place() {
    let mut request = support::request();
    request.options.placement.wgsl_group = 2;
    let generated = generate(&request, &draft(), &support::modules()).unwrap();
    let frame = Frame::from_json(&generated.files[FRAME_FILE]).unwrap();
    let space = |shader: &str, language| {
        let places = &frame.shaders[shader].bindings[0].places;
        places[&language].space
    };
    assert_eq!(space("resample_taps_3", Language::Wgsl), Some(2));
    assert_eq!(space("tint", Language::Wgsl), Some(3));
    assert_eq!(space("tint", Language::Hlsl), Some(1));
    assert_eq!(space("resample_taps_3", Language::Spirv), Some(0));
    assert_eq!(space("tint", Language::Spirv), Some(1));
    assert_eq!(frame.shaders["tint"].bindings[0].set, 1);
    let wgsl = String::from_utf8(generated.files["wgsl/tint.wgsl"].clone()).unwrap();
    assert!(
        wgsl.contains("@group(3)") && !wgsl.contains("@group(2)"),
        "{wgsl}"
    );
    let module = words(&generated.files["spirv/tint.spv"], "tint").unwrap();
    finish::validate(&module, "tint").unwrap();
}

#[test]
fn what_cannot_be_written_is_named() {
    let fails = |draft: &Draft| -> Error {
        generate(&support::request(), draft, &support::modules()).unwrap_err()
    };
    let mut unknown = draft();
    unknown.shaders.get_mut("tint").unwrap().kernel = "taint".into();
    let text = fails(&unknown).to_string();
    assert!(
        text.contains("`taint`") && text.contains("fullscreen"),
        "{text}"
    );
    let mut large = draft();
    let file = format!("{CONTENTS}/indices.bin");
    large.contents.insert(file, vec![0; (64 << 20) + 1]);
    let text = fails(&large).to_string();
    assert!(
        text.starts_with("frame/indices.bin: it would have 67108865 bytes"),
        "{text}"
    );
    let mut request = support::request();
    request.options.placement.hlsl_space = 255;
    let error = generate(&request, &draft(), &support::modules()).unwrap_err();
    assert!(
        error.to_string().starts_with("--hlsl-space 255: fragment"),
        "{error}"
    );
    let text = Frame::from_json(b"{ \"format\": 2 }").unwrap_err();
    assert_eq!(text, "its format is 2, this hankel reads 1");
}

/// Values come out by their paths, offsets and types, whatever they are nested in.
#[test]
fn uniforms_are_taken_apart() {
    let field = |name: &str, ty: Type, offset: u32, size: u32| Field {
        name: name.into(),
        summary: format!("Of {name}."),
        ty,
        offset,
        size,
        inputs: Inputs::default(),
    };
    let scalar = |scalar| Type::Scalar { scalar };
    let inner = Layout {
        name: "Inner".into(),
        size: 8,
        align: 4,
        fields: vec![
            field("first", scalar(Scalar::F32), 0, 4),
            field("second", scalar(Scalar::I32), 4, 4),
        ],
    };
    let vector = Type::Vector {
        scalar: Scalar::F32,
        size: 2,
    };
    let array = Type::Array {
        element: Box::new(scalar(Scalar::U32)),
        length: 2,
        stride: 4,
    };
    let outer = Layout {
        name: "Outer".into(),
        size: 24,
        align: 4,
        fields: vec![
            field("inner", Type::Struct { layout: inner }, 0, 8),
            field("pair", vector, 8, 8),
            field("counts", array, 16, 8),
        ],
    };
    let mut bytes = Vec::new();
    bytes.extend(0.5_f32.to_le_bytes());
    bytes.extend((-3_i32).to_le_bytes());
    bytes.extend(f32::NAN.to_le_bytes());
    bytes.extend(2.0_f32.to_le_bytes());
    bytes.extend([7_u32, 9].into_iter().flat_map(u32::to_le_bytes));
    let all = fields(&outer, &bytes);
    let seen: Vec<_> = all
        .iter()
        .map(|it| {
            (
                it.name.as_str(),
                it.offset,
                it.ty.as_str(),
                it.value.clone(),
            )
        })
        .collect();
    assert_eq!(
        seen,
        [
            ("inner.first", 0, "f32", json!(0.5)),
            ("inner.second", 4, "i32", json!(-3)),
            ("pair", 8, "vec2<f32>", json!([null, 2.0])),
            ("counts", 16, "array<u32, 2>", json!([7, 9])),
        ]
    );
    assert_eq!(all[1].meaning, "Of second.");
    // Bytes that are not there are no numbers.
    assert_eq!(fields(&outer, &bytes[..6])[1].value, json!(null));
}
