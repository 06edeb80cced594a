//! The libraries of functions: every function in every language, in a stub that includes the shipped
//! text, through the matrix' compilers and drivers and on the processor, compared with the native
//! function to the bit.
//!
//! The stubs are hostile hosts: they include the text twice where the language has a guard, have a
//! structure `Light` and a function `lerp` of their own, take the first registers, and say
//! `precision mediump float;`.

mod lookups;
mod modules;
mod sample;
mod tsl;

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use hankel_codegen::Language;
use hankel_codegen::functions::ir::Library;
use hankel_codegen::functions::print::Naming;
use hankel_codegen::functions::{self, FORMS, crates};
use hankel_codegen::translate::Place;
use hankel_dsl::native::call::{Arg, CallError};
use hankel_dsl::native::describe::{
    Domain, Field, Inputs, Kernel, Layout, Output, Param, Range, Role, Rounding, Scalar, Stage,
    Subgroups, Tolerance, Type,
};
use hankel_dsl::native::function::Function;
use hankel_dsl::native::inputs::{self, Given, Source};
use hankel_host::crates::KernelEntry;
use hankel_matrix::column::Column;
use hankel_matrix::known::Known;
use hankel_matrix::run::{self, Request};
use hankel_matrix::subject::{Code, Subject};
use hankel_matrix::tools::Tools;
use hankel_shadows::library::shadows_library;

const PREFIX: &str = "hankel";

fn root() -> PathBuf {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    here.parent().expect("tests/ lies in the root").to_owned()
}

/// The built-in library, translated from its sources once for each thread: its expressions are
/// shared within it, not between threads.
fn library() -> &'static Library {
    thread_local! {
        static LIBRARY: &'static Library = {
            let manifest = root().join("kernels/shadows/Cargo.toml");
            let sources = crates::sources(&manifest).expect("the sources can be read");
            let mut libraries = functions::read(&sources.texts).unwrap_or_else(|e| panic!("{e}"));
            assert_eq!(libraries.len(), 1);
            Box::leak(Box::new(libraries.remove(0)))
        };
    }
    LIBRARY.with(|library| *library)
}

fn tools() -> Tools {
    let cache = hankel_toolchain::Options::from_env().cache_folder().ok();
    Tools::of_cache(cache.as_deref())
}

fn naming(library: &Library) -> Naming {
    Naming {
        prefix: PREFIX.into(),
        library: library.name.clone(),
    }
}

/// A library's text in a form.
fn written(library: &Library, form: &str) -> String {
    let form = FORMS.iter().find(|f| f.name == form).expect("a form");
    form.text(library, &naming(library), &"0".repeat(64))
}

/// The path and text of what lies beside it.
fn beside(library: &Library, form: &str) -> Option<(String, String)> {
    let form = FORMS.iter().find(|f| f.name == form).expect("a form");
    form.beside(library, &naming(library), &"0".repeat(64))
}

/// The shipped text in a form.
fn text(form: &str) -> String {
    written(library(), form)
}

/// A scalar of a function's arguments or result.
struct Word {
    name: String,
    scalar: Scalar,
}

fn parts(ty: &Type) -> (Scalar, usize) {
    match ty {
        Type::Scalar { scalar } => (*scalar, 1),
        Type::Vector { scalar, size } => (*scalar, *size as usize),
        _ => panic!("a function's types are scalars and vectors"),
    }
}

/// The scalars of a function's arguments. Moments are named so that the inputs are those of depths.
fn arguments(function: &Function) -> Vec<Word> {
    let mut moments = 0;
    let mut words = Vec::new();
    for (name, ty) in &function.params {
        let (scalar, size) = parts(ty);
        for i in 0..size {
            let is_moment = matches!(*name, "moments" | "low" | "middle" | "high");
            let name = if is_moment {
                moments += 1;
                format!("b{moments}")
            } else if size == 1 {
                (*name).to_owned()
            } else {
                format!("{name}_{}", ["x", "y", "z", "w"][i])
            };
            words.push(Word { name, scalar });
        }
    }
    words
}

fn results(function: &Function) -> Vec<Word> {
    let (scalar, size) = parts(&function.result);
    ["x", "y", "z", "w"][..size]
        .iter()
        .map(|n| Word {
            name: format!("r_{n}"),
            scalar,
        })
        .collect()
}

/// Where the numbers of an argument lie.
fn inputs_of(word: &Word) -> Inputs {
    let (least, most) = match word.name.as_str() {
        "one" => (1.0, 16_777_216.0),
        "texels" => (1.0, 1024.0),
        "total" | "leak" | "overestimation" | "strength" | "opacity" | "sine" => (0.0, 1.0),
        "exponent" => (0.0, 90.0),
        "positive_exponent" | "negative_exponent" => (0.0, 45.0),
        "mean" | "distance" | "extinction" => (0.0, 10.0),
        "inclination" => (0.0, std::f64::consts::PI),
        name if [
            "channels", "first", "second", "cosines", "sines", "high_", "weights", "front",
            "behind",
        ]
        .iter()
        .any(|n| name.starts_with(n)) =>
        {
            (0.0, 1.0)
        }
        name if ["warped", "spread"].iter().any(|n| name.starts_with(n)) => (0.0, 100.0),
        name if ["place", "reach"].iter().any(|n| name.starts_with(n)) => (-8.0, 8.0),
        _ if word.scalar == Scalar::F32 => (-1.0, 1.0),
        _ => return Inputs::default(),
    };
    Inputs {
        domain: Some(Domain::Range { least, most }),
        ..Inputs::default()
    }
}

fn layout(name: &str, words: &[Word]) -> Layout {
    let fields = words.iter().enumerate().map(|(i, w)| Field {
        name: w.name.clone(),
        summary: String::new(),
        ty: Type::Scalar { scalar: w.scalar },
        offset: 4 * i as u32,
        size: 4,
        inputs: inputs_of(w),
    });
    Layout {
        name: name.into(),
        size: 4 * words.len() as u32,
        align: 4,
        fields: fields.collect(),
    }
}

fn stub_name(function: &Function) -> String {
    format!("{}_stub", function.name)
}

/// The function as a map over rows.
fn entry(function: &Function) -> KernelEntry {
    let kernel = Kernel {
        name: stub_name(function),
        function: stub_name(function),
        summary: String::new(),
        file: "stub".into(),
        line: 1,
        licence: String::new(),
        stage: Stage::Compute {
            threads: [64, 1, 1],
            dimensions: 1,
            cooperative: false,
            workgroup_bytes: 0,
            range: Range::Outputs,
        },
        precision: None,
        params: vec![Param {
            name: "row".into(),
            role: Role::Element {
                binding: 0,
                layout: layout("Row", &arguments(function)),
            },
            inputs: Inputs::default(),
        }],
        outputs: vec![Output::Buffer {
            binding: 1,
            layout: layout("Given", &results(function)),
        }],
        tolerance: Tolerance {
            ulp: 0,
            absolute: 0.0,
            // Sums and products of hostile rows overflow.
            non_finite: true,
            why: String::new(),
        },
        rounding: Rounding::Pinned,
        subgroups: Subgroups::Unused,
        compensated: None,
        image_pass: None,
        invariant: false,
    };
    let (run, words, described) = (function.run, arguments(function).len(), function.clone());
    KernelEntry::new(kernel, move |call| {
        let wrong = CallError::Count {
            expected: 2,
            got: call.args.len(),
        };
        let [Arg::Bytes(rows), Arg::BytesMut(out)] = call.args.as_mut_slice() else {
            return Err(wrong);
        };
        out.copy_from_slice(&mapped(run, rows, words));
        Ok(())
    })
    .with_inputs(move |request| Ok(Some(vec![of_distributions(&described, request)])))
}

/// Rows whose moments are those of distributions of depths.
fn of_distributions(function: &Function, request: &inputs::Request) -> Given {
    let mut source = Source::new(request.seed);
    let words = arguments(function);
    let is_moment = |word: &Word| {
        let digits = word.name.strip_prefix('b').unwrap_or_default();
        !digits.is_empty() && digits.bytes().all(|b| b.is_ascii_digit())
    };
    let moments = words.iter().filter(|w| is_moment(w)).count();
    let mut rows: Vec<u32> = Vec::new();
    for _ in 0..2000 {
        let mut powers = hankel_shadows::inputs::powers(moments, &mut source).into_iter();
        for word in &words {
            let own = is_moment(word).then(|| powers.next()).flatten();
            let (least, most) = match inputs_of(word).domain {
                Some(Domain::Range { least, most }) => (least, most),
                _ => (0.0, f64::from(u32::MAX)),
            };
            let number = own.unwrap_or_else(|| source.between(least, most));
            rows.push(match word.scalar {
                Scalar::F32 => (number as f32).to_bits(),
                Scalar::I32 => number as i32 as u32,
                _ => number as u32,
            });
        }
    }
    Given::new("moments of distributions").buffer("row", &rows)
}

/// Runs a function on rows of words.
fn mapped(run: fn(&[u32], &mut Vec<u32>), rows: &[u8], words: usize) -> Vec<u8> {
    let mut given = Vec::new();
    for row in rows.chunks_exact(4 * words) {
        let row: Vec<u32> = row
            .chunks_exact(4)
            .map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]))
            .collect();
        run(&row, &mut given);
    }
    given.into_iter().flat_map(u32::to_le_bytes).collect()
}

/// How a language writes what a stub needs.
struct Host {
    /// Scalars' names.
    scalars: [&'static str; 3],
    /// A vector of a scalar and size.
    vector: fn(&str, usize) -> String,
    /// A call's name.
    call: fn(&str) -> String,
}

fn scalar(host: &Host, scalar: Scalar) -> &'static str {
    match scalar {
        Scalar::F32 => host.scalars[0],
        Scalar::U32 => host.scalars[1],
        Scalar::I32 => host.scalars[2],
        Scalar::F64 | Scalar::U64 | Scalar::I64 | Scalar::Bool | Scalar::F16 => {
            panic!("functions are of 32-bit numbers")
        }
    }
}

/// `hankel_f(vec4(row.b1, …), row.depth)`
fn call(host: &Host, function: &Function, row: &str) -> String {
    let mut words = arguments(function).into_iter();
    let args: Vec<String> = function
        .params
        .iter()
        .map(|(_, ty)| {
            let (kind, size) = parts(ty);
            let own: Vec<String> = words
                .by_ref()
                .take(size)
                .map(|w| format!("{row}{}", w.name))
                .collect();
            if size == 1 {
                own[0].clone()
            } else {
                format!(
                    "{}({})",
                    (host.vector)(scalar(host, kind), size),
                    own.join(", ")
                )
            }
        })
        .collect();
    format!("{}({})", (host.call)(function.name), args.join(", "))
}

/// `to.r_x = given.x;`
fn stores(function: &Function, to: &str) -> String {
    let size = results(function).len();
    let mut text = String::new();
    for name in &["x", "y", "z", "w"][..size] {
        let part = if size == 1 {
            String::new()
        } else {
            format!(".{name}")
        };
        let _ = writeln!(text, "        {to}r_{name} = given{part};");
    }
    text
}

fn result_type(host: &Host, function: &Function) -> String {
    let (kind, size) = parts(&function.result);
    match size {
        1 => scalar(host, kind).into(),
        _ => (host.vector)(scalar(host, kind), size),
    }
}

fn fields(host: &Host, words: &[Word], line: fn(&str, &str) -> String) -> String {
    words
        .iter()
        .map(|w| line(scalar(host, w.scalar), &w.name))
        .collect()
}

fn place(name: &str, class: &str, index: u32) -> Place {
    Place {
        name: Some(name.into()),
        class: class.into(),
        index: Some(index),
        space: Some(0),
        block: None,
        combined_with: Vec::new(),
    }
}

fn wgsl(function: &Function, library: &str) -> Code {
    let host = Host {
        scalars: ["f32", "u32", "i32"],
        vector: |s, n| format!("vec{n}<{s}>"),
        call: |name| format!("{PREFIX}_{name}"),
    };
    let line = |ty: &str, name: &str| format!("    {name}: {ty},\n");
    let text = format!(
        "struct Light {{ color: vec4<f32> }}\n\
         struct Row {{\n{}}}\nstruct Given {{\n{}}}\n\
         @group(0) @binding(0) var<storage, read> rows: array<Row>;\n\
         @group(0) @binding(1) var<storage, read_write> results: array<Given>;\n\
         fn lerp(a: f32, b: f32, t: f32) -> f32 {{ return a + (b - a) * t; }}\n\
         {library}\n\
         @compute @workgroup_size(64, 1, 1)\n\
         fn {}(@builtin(global_invocation_id) id: vec3<u32>) {{\n\
         \x20   if (id.x < arrayLength(&results)) {{\n\
         \x20       let row = rows[id.x];\n        let given = {};\n{}    }}\n}}\n",
        fields(&host, &arguments(function), line),
        fields(&host, &results(function), line),
        stub_name(function),
        call(&host, function, "row."),
        stores(function, "results[id.x]."),
    );
    code(
        text,
        &stub_name(function),
        [("rows", "binding", 0), ("results", "binding", 1)],
    )
}

fn code(text: String, entry_point: &str, places: [(&str, &str, u32); 2]) -> Code {
    let places = places
        .into_iter()
        .zip(0..)
        .map(|((name, class, index), binding)| (binding, place(name, class, index)));
    Code {
        bytes: text.into_bytes(),
        entry_point: entry_point.into(),
        places: places.collect(),
        sizes_slot: None,
        sized: Vec::new(),
    }
}

/// What a host has of its own in HLSL, and where its stub's buffers are.
const HLSL_HOST: &str = "\
struct Light { float4 color; };
float mine(float a, float b, float t) { return a + (b - a) * t; }
#define saturate_of(x) clamp(x, 0.0f, 1.0f)
ByteAddressBuffer rows : register(t0);
RWByteAddressBuffer results : register(u0);
";

fn hlsl(function: &Function, library: &str) -> Code {
    let name = stub_name(function);
    code(
        format!("{HLSL_HOST}{library}\n{}", hlsl_entry(function, &name)),
        &name,
        [("rows", "t", 0), ("results", "u", 0)],
    )
}

/// The entry point of a stub in HLSL.
fn hlsl_entry(function: &Function, name: &str) -> String {
    let host = Host {
        scalars: ["float", "uint", "int"],
        vector: |s, n| format!("{s}{n}"),
        call: |name| format!("{PREFIX}_{name}"),
    };
    let words = arguments(function);
    let mut loads = String::new();
    for (i, w) in words.iter().enumerate() {
        let (ty, bits) = match w.scalar {
            Scalar::F32 => ("float", "asfloat"),
            Scalar::I32 => ("int", "asint"),
            _ => ("uint", ""),
        };
        let _ = writeln!(
            loads,
            "        {ty} in_{} = {bits}(rows.Load(id.x * {} + {}));",
            w.name,
            4 * words.len(),
            4 * i
        );
    }
    let (kind, size) = parts(&function.result);
    let bits = if kind == Scalar::F32 { "asuint" } else { "" };
    let mut stored = String::new();
    for (i, name) in ["x", "y", "z", "w"][..size].iter().enumerate() {
        let part = if size == 1 {
            String::new()
        } else {
            format!(".{name}")
        };
        let _ = writeln!(
            stored,
            "        results.Store(id.x * {} + {}, {bits}(given{part}));",
            4 * size,
            4 * i
        );
    }
    format!(
        "[numthreads(64, 1, 1)]\nvoid {name}(uint3 id : SV_DispatchThreadID)\n{{\n\
         \x20   uint bytes;\n    results.GetDimensions(bytes);\n\
         \x20   if (id.x < bytes / {}) {{\n{loads}        {} given = {};\n{stored}    }}\n}}\n",
        4 * size,
        result_type(&host, function),
        call(&host, function, "in_"),
    )
}

/// What a host says of precision before a library is included.
const MEDIUM: &str = "precision mediump float;\nprecision mediump int;";

fn glsl(function: &Function, library: &str, version: &str, precision: &str) -> Code {
    let host = Host {
        scalars: ["float", "uint", "int"],
        vector: |s, n| match s {
            "float" => format!("vec{n}"),
            _ => format!("{}vec{n}", &s[..1]),
        },
        call: |name| format!("{PREFIX}_{name}"),
    };
    let line = |ty: &str, name: &str| format!("    highp {ty} {name};\n");
    let text = format!(
        "#version {version}\n{precision}\n\
         layout(local_size_x = 64, local_size_y = 1, local_size_z = 1) in;\n\
         struct Light {{ vec4 color; }};\n\
         float lerp(float a, float b, float t) {{ return a + (b - a) * t; }}\n\
         struct Row {{\n{}}};\nstruct Given {{\n{}}};\n\
         layout(std430, binding = 0) readonly buffer RowBuffer {{ Row b_row[]; }};\n\
         layout(std430, binding = 1) buffer OutBuffer {{ Given b_out[]; }};\n\
         {library}\n\
         void main() {{\n\
         \x20   highp uvec3 id = gl_GlobalInvocationID;\n\
         \x20   if (id.x < uint(b_out.length())) {{\n\
         \x20       Row row = b_row[id.x];\n        highp {} given = {};\n{}    }}\n}}\n",
        fields(&host, &arguments(function), line),
        fields(&host, &results(function), line),
        result_type(&host, function),
        call(&host, function, "row."),
        stores(function, "b_out[id.x]."),
    );
    let mut code = code(
        text,
        "main",
        [("b_row", "buffer", 0), ("b_out", "buffer", 1)],
    );
    for (binding, block) in [(0, "RowBuffer"), (1, "OutBuffer")] {
        if let Some(place) = code.places.get_mut(&binding) {
            place.block = Some(block.into());
        }
    }
    code
}

/// The library is included by its path, so that its guard has an effect.
fn msl(function: &Function, library: &Path) -> Code {
    let host = Host {
        scalars: ["float", "uint", "int"],
        vector: |s, n| format!("metal::{s}{n}"),
        call: |name| format!("{PREFIX}::shadows::{name}"),
    };
    let line = |ty: &str, name: &str| format!("    {ty} {name};\n");
    let file = library.display();
    let given = 4 * results(function).len();
    let text = format!(
        "// language: metal2.4\n#include <metal_stdlib>\n#include <simd/simd.h>\n\
         using metal::uint;\nstruct Light {{ metal::float4 color; }};\n\
         inline float lerp(float a, float b, float t) {{ return a + (b - a) * t; }}\n\
         #include \"{file}\"\n#include \"{file}\"\n\
         struct _mslBufferSizes {{\n    uint size1;\n}};\n\
         struct Row {{\n{}}};\ntypedef Row RowBuffer[1];\n\
         struct Given {{\n{}}};\ntypedef Given GivenBuffer[1];\n\
         [[max_total_threads_per_threadgroup(64)]] kernel void {}(\n\
         \x20 metal::uint3 id [[thread_position_in_grid]]\n\
         , device GivenBuffer& out [[buffer(1)]]\n\
         , device RowBuffer const& rows [[buffer(0)]]\n\
         , constant _mslBufferSizes& _buffer_sizes [[buffer(2)]]\n) {{\n\
         \x20   if (id.x < (1 + (_buffer_sizes.size1 - {given}) / {given})) {{\n\
         \x20       Row row = rows[id.x];\n        {} given = {};\n{}    }}\n}}\n",
        fields(&host, &arguments(function), line),
        fields(&host, &results(function), line),
        stub_name(function),
        result_type(&host, function),
        call(&host, function, "row."),
        stores(function, "out[id.x]."),
    );
    let mut code = code(
        text,
        &stub_name(function),
        [("rows", "buffer", 0), ("out", "buffer", 1)],
    );
    code.sizes_slot = Some(2);
    code.sized = vec![1];
    code
}

fn subject(function: &Function, msl_file: &Path) -> Subject {
    let none = |language: Language| Err(format!("no stub in {language}"));
    let (before, after) = if looks_up(function) {
        (lookups::HLSL, lookups::HLSL_AFTER)
    } else {
        ("", "")
    };
    let text = |form: &str| {
        if sample::has(function) {
            sample::text(form)
        } else {
            text(form)
        }
    };
    let twice = |form: &str, before: &str, after: &str| {
        let text = text(form);
        format!("{before}{text}\n{text}{after}")
    };
    let in_hlsl = twice("hlsl", before, after);
    let twice = twice("glsl", &lookups::as_glsl(before), &lookups::as_glsl(after));
    let codes = Language::ALL.map(|language| {
        let code = match language {
            Language::Wgsl if looks_up(function) => none(language),
            Language::Wgsl => Ok(wgsl(function, &text("wgsl"))),
            Language::Hlsl => Ok(hlsl(function, &in_hlsl)),
            Language::Glsl => Ok(glsl(function, &twice, "450 core", MEDIUM)),
            Language::Essl310 => Ok(glsl(function, &twice, "310 es", MEDIUM)),
            Language::Msl => Ok(msl(function, msl_file)),
            other => none(other),
        };
        (language, code)
    });
    Subject {
        name: stub_name(function),
        entry: entry(function),
        codes: codes.into(),
    }
}

/// The library's functions; some only, where `HANKEL_FUNCTIONS` names them.
fn natives() -> Vec<Function> {
    let all = shadows_library::functions();
    assert!(all.len() > 50, "only {} functions", all.len());
    wanted(all)
}

fn wanted(all: Vec<Function>) -> Vec<Function> {
    let wanted = std::env::var("HANKEL_FUNCTIONS").unwrap_or_default();
    all.into_iter()
        .filter(|f| wanted.is_empty() || wanted.split(',').any(|w| w == f.name))
        .collect()
}

/// The library's functions, those of a host that give their lookups to others, and the sample's.
fn natives_and_others() -> Vec<Function> {
    let mut all = natives();
    all.extend(wanted(lookups::natives()));
    all.extend(wanted(sample::functions()));
    all
}

/// Whether it is a host's that gives its lookups.
fn looks_up(function: &Function) -> bool {
    function.name.starts_with("host_")
}

const COLUMNS: [Column; 10] = [
    Column::Native,
    Column::Wgsl,
    Column::Glsl,
    Column::Essl310,
    Column::HlslDxc,
    Column::HlslGlslang,
    Column::Msl,
    Column::SpirvSwiftshader,
    Column::WgslDawn,
    Column::WgslChromium,
];

#[test]
fn every_function_computes_the_native_bits_in_every_language() {
    let folder = tempfile::tempdir().expect("a folder");
    let msl_file = folder.path().join("hankel_shadows.h.metal");
    std::fs::write(&msl_file, text("msl")).expect("the header can be written");
    let with_lookups = folder.path().join("host.h.metal");
    let file = msl_file.display();
    let host = format!(
        "#pragma once\n#include \"{file}\"\n#include \"{file}\"\n{}",
        lookups::MSL_AFTER
    );
    std::fs::write(&with_lookups, host).expect("the header can be written");
    // Under the library's name, by which the stubs call.
    let of_sample = folder.path().join("sample.h.metal");
    let renamed = format!(
        "{}namespace {PREFIX} {{ namespace shadows {{ using namespace {PREFIX}::sample; }} }}\n",
        sample::text("msl")
    );
    std::fs::write(&of_sample, renamed).expect("the header can be written");
    let tools = tools();
    let mut subjects: Vec<Subject> = natives_and_others()
        .iter()
        .map(|f| {
            let header = if looks_up(f) {
                &with_lookups
            } else if sample::has(f) {
                &of_sample
            } else {
                &msl_file
            };
            subject(f, header)
        })
        .collect();
    subjects.extend(tsl::subjects(&tools));
    let wanted = std::env::var("HANKEL_COLUMNS").unwrap_or_default();
    let columns: Vec<Column> = COLUMNS
        .into_iter()
        .filter(|c| *c != Column::SpirvSwiftshader)
        .filter(|c| wanted.is_empty() || wanted.split(',').any(|w| w == c.id()))
        .collect();
    let known = Known::parse(include_str!(
        "../../../snapshots/known-function-differences.toml"
    ))
    .expect("the list can be read");
    agree(&subjects, columns, tools, known);
}

/// A function's stubs by a form of the library, one in each language.
fn in_form(
    function: &Function,
    form: &str,
    codes: impl IntoIterator<Item = (Language, Code)>,
) -> Subject {
    let name = format!("{}_{form}", stub_name(function));
    let mut entry = entry(function);
    entry.kernel.name.clone_from(&name);
    Subject {
        name,
        entry,
        codes: codes.into_iter().map(|(l, code)| (l, Ok(code))).collect(),
    }
}

/// Runs subjects in columns, all of which must run, and all cells must agree with the native function or be as they
/// are known.
fn agree(subjects: &[Subject], columns: Vec<Column>, tools: Tools, known: Known) {
    let request = Request {
        columns: columns.clone(),
        seed: 1,
        limit: Duration::from_secs(120),
        tools,
        runner: vec![PathBuf::from(env!("CARGO_BIN_EXE_hankel-tests-runner")).into()],
        cache: None,
        known,
        absent: None,
        whole: true,
        required: columns,
    };
    let report = run::run(&request, subjects, &|_| ()).unwrap_or_else(|e| panic!("{e}"));
    assert!(report.passed, "{report}");
}

/// Rows for a function: depths' moments, and numbers of all kinds.
fn rows(function: &Function) -> Vec<u8> {
    let cases =
        hankel_host::inputs::of_entry(&entry(function), 1).unwrap_or_else(|e| panic!("{e}"));
    let mut all = Vec::new();
    for case in cases {
        if let Some(hankel_host::inputs::Input::Bytes(bytes)) = case.args.first() {
            all.extend_from_slice(bytes);
        }
    }
    all
}

/// Compiles and runs a program that maps every function over its rows, in files beside it.
fn on_the_processor(name: &str, program: &str, compile: impl FnOnce(&Path, &Path) -> Command) {
    let folder = tempfile::tempdir().expect("a folder");
    let source = folder.path().join(name);
    let binary = folder.path().join("program");
    std::fs::write(&source, program).expect("the program can be written");
    let mut expected = BTreeMap::new();
    for f in natives_and_others() {
        let rows = rows(&f);
        std::fs::write(folder.path().join(format!("{}.in", f.name)), &rows).expect("rows");
        expected.insert(f.name, mapped(f.run, &rows, arguments(&f).len()));
    }
    let compiled = compile(&source, &binary).output().expect("a compiler");
    assert!(
        compiled.status.success(),
        "{name}:\n{}\n{}",
        String::from_utf8_lossy(&compiled.stdout),
        String::from_utf8_lossy(&compiled.stderr)
    );
    let ran = Command::new(&binary)
        .current_dir(folder.path())
        .status()
        .expect("the program runs");
    assert!(ran.success(), "{name}: {ran}");
    for (function, expected) in expected {
        let path = folder.path().join(format!("{function}.out"));
        let given = std::fs::read(path).expect("results");
        assert_eq!(given.len(), expected.len(), "{name}: {function}");
        for (i, (a, b)) in given.chunks(4).zip(expected.chunks(4)).enumerate() {
            let number = |b: &[u8]| f32::from_le_bytes([b[0], b[1], b[2], b[3]]);
            let (x, y) = (number(a), number(b));
            assert!(
                a == b
                    || x == y
                    || (x.is_nan() && y.is_nan())
                    // The error of a product is a sum of partial products in the texts, which
                    // underflow where the native ones, taken in 64 bits, do not.
                    || (x - y).abs() < f32::MIN_POSITIVE,
                "{name}: {function}, word {i}: {x:e} for {y:e}"
            );
        }
    }
}

#[test]
fn the_c_header_computes_the_native_bits_and_has_no_warnings() {
    let host = Host {
        scalars: ["float", "uint32_t", "int32_t"],
        vector: |s, n| {
            let name = match s {
                "float" => "float",
                "uint32_t" => "uint",
                _ => "int",
            };
            format!("{PREFIX}_make_{name}{n}")
        },
        call: |name| format!("{PREFIX}_{name}"),
    };
    let mut program = String::from(
        "struct Light { float color[4]; };\n#include \"hankel_shadows.h\"\n\
         #include \"hankel_shadows.h\"\n#include \"hankel_sample.h\"\n#include <stdio.h>\n#include <stdlib.h>\n",
    );
    program.push_str(lookups::C_AFTER);
    for f in natives_and_others() {
        let words = arguments(&f);
        let line = |ty: &str, name: &str| format!("    {ty} {name};\n");
        let (kind, size) = parts(&f.result);
        let ty = match (size, kind) {
            (1, _) => scalar(&host, kind).to_owned(),
            (n, Scalar::F32) => format!("{PREFIX}_float{n}"),
            (n, _) => format!("{PREFIX}_uint{n}"),
        };
        let _ = writeln!(
            program,
            "struct {0}_row {{\n{1}}};\nstatic int {0}(void) {{\n\
             \x20   struct {0}_row row;\n    FILE *in = fopen(\"{0}.in\", \"rb\");\n\
             \x20   FILE *out = fopen(\"{0}.out\", \"wb\");\n\
             \x20   if (!in || !out) return 1;\n\
             \x20   while (fread(&row, sizeof row, 1, in) == 1) {{\n\
             \x20       {ty} given = {2};\n        fwrite(&given, sizeof given, 1, out);\n    }}\n\
             \x20   fclose(in);\n    return fclose(out);\n}}",
            f.name,
            fields(&host, &words, line),
            call(&host, &f, "row."),
        );
    }
    program.push_str("int main(void) {\n    return 0");
    for f in natives_and_others() {
        let _ = write!(program, " | {}()", f.name);
    }
    program.push_str(";\n}\n");
    let header = |source: &Path| {
        let folder = source.parent().expect("a folder");
        std::fs::write(folder.join("hankel_shadows.h"), text("c")).expect("the header");
        std::fs::write(folder.join("hankel_sample.h"), sample::text("c")).expect("the header");
    };
    let warnings = [
        "-Wall",
        "-Wextra",
        "-Werror",
        "-pedantic",
        "-O2",
        "-ffp-contract=off",
    ];
    on_the_processor("program.c", &program, |source, binary| {
        header(source);
        let mut cc = Command::new("cc");
        cc.arg("-std=c99")
            .args(warnings)
            .arg(source)
            .arg("-o")
            .arg(binary)
            .arg("-lm");
        cc
    });
    on_the_processor("program.cpp", &program, |source, binary| {
        header(source);
        let mut cc = Command::new("c++");
        cc.arg("-std=c++11")
            .args(warnings)
            .arg(source)
            .arg("-o")
            .arg(binary);
        cc
    });
}

#[test]
fn the_rust_module_computes_the_native_bits() {
    let host = Host {
        scalars: ["f32", "u32", "i32"],
        vector: |_, _| String::new(),
        call: |name| {
            let of_sample = sample::functions().iter().any(|f| f.name == name);
            format!("{}::{name}", if of_sample { "sample" } else { "library" })
        },
    };
    let mut program = String::from(
        "#[path = \"hankel_shadows.rs\"]\nmod library;\n#[path = \"hankel_sample.rs\"]\nmod sample;\n\
         use std::fs;\n",
    );
    let mut main = String::from("fn main() {\n");
    for f in natives_and_others() {
        let words = arguments(&f);
        let mut at = 0;
        let args: Vec<String> = f
            .params
            .iter()
            .map(|(_, ty)| {
                let (kind, size) = parts(ty);
                let own: Vec<String> = (at..at + size)
                    .map(|i| match kind {
                        Scalar::F32 => format!("f32::from_bits(row[{i}])"),
                        Scalar::I32 => format!("row[{i}] as i32"),
                        _ => format!("row[{i}]"),
                    })
                    .collect();
                at += size;
                if size == 1 {
                    own[0].clone()
                } else {
                    format!("[{}]", own.join(", "))
                }
            })
            .collect();
        let (kind, size) = parts(&f.result);
        let given = if size == 1 { "[given]" } else { "given" };
        let bits = if kind == Scalar::F32 {
            ".to_bits()"
        } else {
            ""
        };
        let _ = writeln!(
            main,
            "    map(\"{}\", {}, |row, out| {{\n        let given = {}({});\n        \
             for x in {given} {{ out.push(x{bits}); }}\n    }});",
            f.name,
            words.len(),
            (host.call)(f.name),
            args.join(", ")
        );
    }
    main.push_str("}\n");
    program.push_str(
        "fn map(name: &str, words: usize, run: fn(&[u32], &mut Vec<u32>)) {\n\
         \x20   let rows = fs::read(format!(\"{name}.in\")).unwrap();\n\
         \x20   let mut out = Vec::new();\n\
         \x20   for row in rows.chunks_exact(4 * words) {\n\
         \x20       let row: Vec<u32> = row.chunks(4).map(|b| u32::from_le_bytes(b.try_into().unwrap())).collect();\n\
         \x20       run(&row, &mut out);\n    }\n\
         \x20   let bytes: Vec<u8> = out.into_iter().flat_map(u32::to_le_bytes).collect();\n\
         \x20   fs::write(format!(\"{name}.out\"), bytes).unwrap();\n}\n",
    );
    program.push_str(&main);
    on_the_processor("program.rs", &program, |source, binary| {
        let folder = source.parent().expect("a folder");
        let module = format!("{}{}", text("rust"), lookups::RUST_AFTER);
        std::fs::write(folder.join("hankel_shadows.rs"), module).expect("the module");
        std::fs::write(folder.join("hankel_sample.rs"), sample::text("rust")).expect("the module");
        let mut rustc = Command::new("rustc");
        rustc.args(["--edition", "2024", "-O", "-Dwarnings", "-Adead_code", "-o"]);
        rustc.arg(binary).arg(source);
        rustc
    });
}

/// It looks through all that a method's receiver was computed from, each time anew: with methods, it did not end in ten
/// minutes.
#[test]
fn clippy_comes_to_an_end() {
    let folder = tempfile::tempdir().expect("a folder");
    let source = folder.path().join("hankel_shadows.rs");
    std::fs::write(&source, text("rust")).expect("the module");
    let mut clippy = Command::new("timeout");
    clippy.args([
        "60",
        "clippy-driver",
        "--edition",
        "2024",
        "--crate-type",
        "lib",
    ]);
    clippy.args(["--emit", "metadata", "--out-dir"]);
    clippy.arg(folder.path()).arg(&source).stderr(Stdio::null());
    let status = clippy.status();
    assert!(status.expect("`timeout` runs").success());
}

#[test]
fn the_texts_are_those_under_review() {
    for form in &FORMS {
        let text = text(form.name);
        for (i, line) in text.lines().enumerate() {
            assert!(
                line.chars().count() < 120,
                "{}, line {} is {} long: {line}",
                form.name,
                i + 1,
                line.chars().count()
            );
        }
        // These differ from another form in what is said below.
        if matches!(form.name, "naga-oil" | "wesl" | "godot" | "slang") {
            continue;
        }
        let mut settings = insta::Settings::clone_current();
        settings.set_snapshot_path(root().join("snapshots/functions"));
        settings.set_prepend_module_to_snapshot(false);
        settings.set_omit_expression(true);
        settings.bind(|| {
            insta::assert_snapshot!(form.name, text);
            if let Some((_, beside)) = beside(library(), form.name) {
                insta::assert_snapshot!(format!("{}-types", form.name), beside);
            }
        });
    }
}

#[test]
fn forms_of_one_language_have_the_same_functions() {
    let wgsl = text("wgsl");
    assert_eq!(
        text("naga-oil"),
        format!("#define_import_path hankel::shadows\n{wgsl}")
    );
    assert_eq!(text("wesl"), wgsl);
    // A word more or less breaks lines elsewhere.
    let from = |text: &str, start: &str| {
        let text = &text[text.find(start).expect(start)..];
        text.split_whitespace().collect::<Vec<_>>().join(" ")
    };
    let start = "/// Target for four power moments";
    // Only plain GLSL can pin a returned value, by a `precise` local.
    let mut glsl = from(&text("glsl"), start).replace(" return given;", "");
    for ty in ["float", "vec2", "vec3", "vec4"] {
        glsl = glsl.replace(&format!("HANKEL_PRECISE highp {ty} given ="), "return");
    }
    let glsl = glsl.replace("HANKEL_PRECISE ", "");
    same_words("godot", &from(&text("godot"), start), &glsl);
    let slang = text("slang").replace("public ", "");
    // A module of Slang has nothing that a macro of its host looks up.
    let mut hlsl = from(&text("hlsl"), start);
    while let Some(at) = hlsl.find("#if defined(") {
        let end = "#endif ";
        let length = hlsl[at..].find(end).expect(end) + end.len();
        hlsl.replace_range(at..at + length, "");
    }
    same_words("slang", &format!("{} #endif", from(&slang, start)), &hlsl);
}

/// Whether two texts have the same words; if not, where they part.
fn same_words(form: &str, a: &str, b: &str) {
    let at = a.bytes().zip(b.bytes()).take_while(|(a, b)| a == b).count();
    let near = |text: &str| {
        text.chars()
            .skip(at.saturating_sub(60))
            .take(120)
            .collect::<String>()
    };
    assert!(
        a == b,
        "{form}: {:?}\n where {:?} was expected",
        near(a),
        near(b)
    );
}

#[test]
fn a_host_of_medium_precision_changes_nothing() {
    let glslang = tools().glslang().expect("glslang");
    let folder = tempfile::tempdir().expect("a folder");
    let stub = folder.path().join("stub.frag");
    let host = format!(
        "#version 310 es\nprecision mediump float;\nprecision mediump int;\n{}\n\
         layout(location = 0) in highp vec4 moments;\nlayout(location = 0) out highp float shadow;\n\
         void main() {{ shadow = hankel_hamburger_bound(moments, moments.x); }}\n",
        text("glsl")
    );
    let relaxed = |text: &str| {
        std::fs::write(&stub, text).expect("the stub can be written");
        let out = folder.path().join("stub.spv");
        let mut command = Command::new(&glslang);
        let done = command
            .args(["-V", "-o"])
            .args([&out, &stub])
            .output()
            .expect("glslang runs");
        assert!(
            done.status.success(),
            "{}",
            String::from_utf8_lossy(&done.stdout)
        );
        let words = std::fs::read(out).expect("SPIR-V");
        let module = rspirv::dr::load_bytes(words).expect("SPIR-V");
        let relaxed = rspirv::dr::Operand::Decoration(rspirv::spirv::Decoration::RelaxedPrecision);
        module
            .annotations
            .iter()
            .filter(|i| i.operands.contains(&relaxed))
            .count()
    };
    assert_eq!(relaxed(&host), 0);
    // The same without the word: the host's precision is taken.
    assert!(relaxed(&host.replace("highp float b1", "float b1")) > 0);
}
