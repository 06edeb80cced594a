//! Hand-written kernels through the whole runner. They need clang++.

use std::fs;
use std::path::PathBuf;
use std::sync::{Arc, Weak};
use std::time::Duration;

use super::*;
use crate::job::{Case, Place};
use crate::tools::{Tool, Tools};
use hankel_dsl::native::{Address, Filter, Sampler};

fn compiler() -> PathBuf {
    let status = Tools::of_cache(None).status(Tool::Clang);
    status
        .path
        .unwrap_or_else(|| panic!("clang++ is missing: {}", status.install))
}

/// One for all tests that run at the same time, so that the headers are compiled once; the last one
/// removes it.
fn work() -> Arc<tempfile::TempDir> {
    static WORK: Mutex<Weak<tempfile::TempDir>> = Mutex::new(Weak::new());
    let mut work = WORK.lock().unwrap();
    work.upgrade().unwrap_or_else(|| {
        let made = Arc::new(tempfile::tempdir().unwrap());
        *work = Arc::downgrade(&made);
        made
    })
}

/// What a slot is, what it is given, and the bytes that are in it.
struct Given {
    role: Role,
    place: Option<(&'static str, u32)>,
    bytes: Vec<u8>,
    /// Of a texture.
    texture: Option<(&'static str, [u32; 3], u32)>,
    /// Of a sampler: linear, repeat.
    sampler: Option<(bool, bool)>,
}

fn buffer<T: Copy>(role: Role, n: u32, values: &[T], bytes_of: impl Fn(T) -> [u8; 4]) -> Given {
    Given {
        role,
        place: Some(("buffer", n)),
        bytes: values.iter().flat_map(|&v| bytes_of(v)).collect(),
        texture: None,
        sampler: None,
    }
}

fn floats(role: Role, n: u32, values: &[f32]) -> Given {
    buffer(role, n, values, f32::to_le_bytes)
}

fn uints(role: Role, n: u32, values: &[u32]) -> Given {
    buffer(role, n, values, u32::to_le_bytes)
}

fn texture(written: bool, n: u32, format: &'static str, size: [u32; 3], bytes: Vec<u8>) -> Given {
    Given {
        role: if written {
            Role::StorageTexture {
                format: format.into(),
                view: "2d".into(),
                access: "write-only".into(),
            }
        } else {
            Role::Texture {
                view: "2d".into(),
                depth: false,
                multisampled: false,
            }
        },
        place: Some(("texture", n)),
        bytes,
        texture: Some((format, size, 1)),
        sampler: None,
    }
}

/// The bytes of all written slots after one run of the kernel `k` by `groups` workgroups.
fn run_kernel(
    text: &str,
    stage: Stage,
    groups: [u32; 3],
    given: Vec<Given>,
) -> Result<Vec<u8>, Failure> {
    run_within(text, stage, groups, given, Duration::from_secs(60))
}

fn run_within(
    text: &str,
    stage: Stage,
    groups: [u32; 3],
    given: Vec<Given>,
    timeout: Duration,
) -> Result<Vec<u8>, Failure> {
    let folder = tempfile::tempdir().unwrap();
    let mut inputs = Vec::new();
    let mut slots = Vec::new();
    let mut args = Vec::new();
    for (i, given) in given.into_iter().enumerate() {
        let (offset, length) = (inputs.len() as u64, given.bytes.len() as u64);
        inputs.extend(given.bytes);
        slots.push(Slot {
            name: format!("slot{i}"),
            binding: Some(i as u32),
            place: given.place.map(|(class, index)| Place {
                name: None,
                class: class.into(),
                index: Some(index),
                block: None,
                combined_with: Vec::new(),
            }),
            role: given.role,
        });
        args.push(match (given.texture, given.sampler) {
            (Some((format, size, samples)), _) => Arg::Texture {
                format: format.into(),
                dimensions: 2,
                size,
                levels: 1,
                layers: 1,
                samples,
                offset,
                length,
            },
            (None, Some((linear, repeat))) => {
                let filter = if linear {
                    Filter::Linear
                } else {
                    Filter::Nearest
                };
                let address = if repeat {
                    Address::Repeat
                } else {
                    Address::ClampToEdge
                };
                Arg::Sampler(Sampler::new(filter, address))
            }
            (None, None) => Arg::Bytes { offset, length },
        });
    }
    let job = Job {
        id: 0,
        kernel: "k".into(),
        entry_point: "k".into(),
        stage,
        code: folder.path().join("k.metal"),
        slots,
        sizes_slot: None,
        sized: Vec::new(),
        cases: vec![Case {
            invocations: 4,
            groups,
            args,
        }],
        inputs: folder.path().join("in"),
        results: folder.path().join("out"),
    };
    fs::write(
        &job.code,
        format!("#include <metal_stdlib>\n#include <simd/simd.h>\n{text}"),
    )
    .unwrap();
    fs::write(&job.inputs, inputs).unwrap();
    let work = work();
    run(&compiler(), work.path(), &job, timeout)?;
    Ok(fs::read(&job.results).unwrap())
}

fn as_floats(bytes: &[u8]) -> Vec<f32> {
    bytes
        .chunks_exact(4)
        .map(|b| f32::from_le_bytes(b.try_into().unwrap()))
        .collect()
}

fn as_uints(bytes: &[u8]) -> Vec<u32> {
    as_floats(bytes).into_iter().map(f32::to_bits).collect()
}

const ONE: Stage = Stage::Compute { threads: [1; 3] };

/// What the kernel writes to an array of floats at buffer 0, whose contents were 0, run once.
fn values(body: &str, count: usize) -> Vec<f32> {
    let text = format!(
        "using namespace metal;\nkernel void k(device float* out [[buffer(0)]]) {{ {body} }}"
    );
    let out = floats(Role::Write, 0, &vec![0.0; count]);
    as_floats(&run_kernel(&text, ONE, [1; 3], vec![out]).unwrap())
}

#[test]
fn literals_vectors_and_swizzles() {
    let got = values(
        "float4 a = float4(float2(1, 2), 3.5, 4);
         a.zx = a.xz * 2;
         a.w += 0.1;
         out[0] = a.x; out[1] = a.y; out[2] = a.z; out[3] = a.w;
         int2 i = int2(float2(-2.7, 2.7));
         out[4] = i.x; out[5] = i.y;
         out[6] = as_type<float>(as_type<uint>(1.5) + 1u);
         out[7] = dot(a.wwzz, float4(1, -1, 1, 1));
         bool3 b = float3(1, 2, 3) > 1.5;
         out[8] = all(b) ? 1 : any(b.xy) ? 2 : 3;
         float3x3 m = float3x3(float3(1, 0, 0), float3(0, 2, 0), float3(1, 0, 3));
         float3 v = m * float3(1, 1, 2);
         out[9] = v.x + 10 * v.y + 100 * v.z;
         out[10] = (float3(1, 1, 2) * m).z;
         out[11] = sizeof(float3) + 100 * sizeof(packed_float3);",
        12,
    );
    assert_eq!(
        got,
        [
            7.0,
            2.0,
            2.0,
            4.1,
            -2.0,
            2.0,
            f32::from_bits(1.5_f32.to_bits() + 1),
            4.0,
            2.0,
            623.0,
            7.0,
            1216.0
        ]
    );
}

#[test]
fn functions() {
    let got = values(
        "out[0] = min(NAN, 2.0); out[1] = max(3.0, NAN);
         out[2] = round(2.5); out[3] = rint(2.5); out[4] = fract(-0.25);
         out[5] = clamp(5.0, 0.0, 1.0); out[6] = mix(1.0, 3.0, 0.25); out[7] = sign(-3.0);
         out[8] = select(1.0, 2.0, true);
         out[9] = popcount(0xF0u) + 10 * clz(1u) + 1000 * ctz(8u);
         out[10] = reverse_bits(1u) == 0x80000000u;
         out[11] = extract_bits(-16, 4u, 4u);
         out[12] = insert_bits(0xFFFFu, 0u, 4u, 8u);
         int e; out[13] = frexp(12.0, e) * 100 + e;
         float w; out[14] = modf(2.75, w) + w * 10; out[15] = ldexp(0.75, 3);
         out[16] = cross(float3(1, 0, 0), float3(0, 1, 0)).z;
         out[17] = length(float2(3, 4)); out[18] = half(2049.0); out[19] = clz(0u);",
        20,
    );
    assert_eq!(
        got,
        [
            2.0, 3.0, 3.0, 2.0, 0.75, 1.0, 1.5, -1.0, 2.0, 3314.0, 1.0, -1.0, 61455.0, 79.0, 20.75,
            6.0, 1.0, 5.0, 2048.0, 32.0
        ]
    );
}

#[test]
fn sums_and_products_are_not_contracted() {
    let text = "kernel void k(device float* x [[buffer(0)]]) { x[3] = x[0] * x[1] + x[2]; }";
    let (a, b) = (1.0 + f32::EPSILON, 1.0 - f32::EPSILON);
    let got = run_kernel(
        text,
        ONE,
        [1; 3],
        vec![floats(Role::Write, 0, &[a, b, -1.0, 9.0])],
    );
    assert_eq!(as_floats(&got.unwrap())[3], 0.0);
}

/// The sum of a workgroup's neighbours, through memory that one barrier protects.
const NEIGHBOURS: &str = "
kernel void k(uint i [[thread_index_in_threadgroup]],
              metal::uint3 g [[threadgroup_position_in_grid]],
              threadgroup metal::array<uint, 32>& shared,
              device uint* out [[buffer(0)]]) {
    shared[i] = i + 100 * g.x;
    metal::threadgroup_barrier(metal::mem_flags::mem_threadgroup);
    out[g.x * 32 + i] = shared[i ^ 31];
}";

const WORKGROUP: Stage = Stage::Compute { threads: [8, 2, 2] };

#[test]
fn a_barrier_holds_and_its_absence_shows() {
    let out = || vec![uints(Role::Write, 0, &[0; 64])];
    let expected: Vec<u32> = (0..64).map(|i| ((i % 32) ^ 31) + i / 32 * 100).collect();
    let got = run_kernel(NEIGHBOURS, WORKGROUP, [2, 1, 1], out()).unwrap();
    assert_eq!(as_uints(&got), expected);
    let without = NEIGHBOURS.replace("metal::threadgroup_barrier", "(void)");
    let got = run_kernel(&without, WORKGROUP, [2, 1, 1], out()).unwrap();
    assert_ne!(as_uints(&got), expected);
}

#[test]
fn a_barrier_that_some_threads_miss_is_an_error() {
    for barrier in [
        "if (i != 7) metal::threadgroup_barrier",
        "if (i == 7) return; metal::threadgroup_barrier",
        "if (i == 7) metal::threadgroup_barrier(metal::mem_flags::mem_none); else\n\
         metal::threadgroup_barrier",
    ] {
        let text = NEIGHBOURS.replace("metal::threadgroup_barrier", barrier);
        let out = vec![uints(Role::Write, 0, &[0; 64])];
        match run_kernel(&text, WORKGROUP, [2, 1, 1], out) {
            Err(Failure::Crashed { log, .. }) => assert!(log.contains("not all threads"), "{log}"),
            other => panic!("{other:?}"),
        }
    }
}

#[test]
fn atomics_count() {
    let text = "
kernel void k(device metal::atomic_uint* bins [[buffer(0)]],
              metal::uint3 id [[thread_position_in_grid]]) {
    metal::atomic_fetch_add_explicit(&bins[id.x & 1], id.x, metal::memory_order_relaxed);
    metal::atomic_fetch_max_explicit(&bins[2], id.x, metal::memory_order_relaxed);
    uint expected = id.x;
    metal::atomic_compare_exchange_weak_explicit(&bins[3], &expected, id.x + 1,
        metal::memory_order_relaxed, metal::memory_order_relaxed);
}";
    let stage = Stage::Compute { threads: [4, 1, 1] };
    let got = run_kernel(
        text,
        stage,
        [2, 1, 1],
        vec![uints(Role::Atomic, 0, &[0; 4])],
    );
    assert_eq!(as_uints(&got.unwrap()), [12, 16, 7, 8]);
}

#[test]
fn templates_for_both_address_spaces_are_one() {
    let template = |space: &str| {
        format!(
            "template <typename A>\nuint add(\n    {space} A *p,\n    uint v\n) {{\n    return \
             metal::atomic_fetch_add_explicit(p, v, metal::memory_order_relaxed);\n}}\n"
        )
    };
    let text = format!(
        "using metal::uint;\n{}{}
kernel void k(device metal::atomic_uint* bins [[buffer(0)]],
              metal::uint3 id [[thread_position_in_grid]]) {{
    add(&bins[0], id.x);
}}",
        template("device"),
        template("threadgroup")
    );
    let stage = Stage::Compute { threads: [4, 1, 1] };
    let got = run_kernel(&text, stage, [1, 1, 1], vec![uints(Role::Atomic, 0, &[0])]);
    assert_eq!(as_uints(&got.unwrap()), [6]);
}

#[test]
fn accesses_out_of_bounds_are_caught() {
    for (statement, words) in [
        ("x[i] = 1.0", "byte 12 was touched"),
        ("y[i] = x[i]", "byte 12 was touched"),
        ("x[-2000000] = 1.0", "was touched"),
        ("x[-1] = 1.0", "byte -4 was written"),
        ("y[4 * i] = 1.0", "byte 48 was touched"),
        ("const_cast<float&>(y[0]) = 1.0", "only read"),
        (
            "float a[3] = {}; a[int(x[0]) * i] = x[1]; x[2] = a[i - 1]",
            "an index beyond an array",
        ),
        (
            "int n = 2147483647; x[0] = n + i",
            "overflow of a signed integer",
        ),
    ] {
        let text = format!(
            "kernel void k(device float* x [[buffer(0)]], device float* y [[buffer(1)]],
                           constant int& i [[buffer(2)]]) {{ {statement}; }}"
        );
        let given = vec![
            floats(Role::Write, 0, &[1.0; 3]),
            floats(Role::Read, 1, &[0.0; 4]),
            uints(Role::Uniform, 2, &[3]),
        ];
        match run_kernel(&text, ONE, [1; 3], given) {
            Err(Failure::Crashed { log, how, .. }) => {
                assert!(log.contains(words), "{statement}: {how}: {log}");
            }
            other => panic!("{statement}: {other:?}"),
        }
    }
}

#[test]
fn reads_outside_of_a_texture_are_zero_and_writes_vanish() {
    let text = "
kernel void k(metal::uint3 id [[thread_position_in_grid]],
              metal::texture2d<float, metal::access::sample> t [[texture(0)]],
              metal::texture2d<float, metal::access::write> out [[texture(1)]]) {
    out.write(t.read(metal::uint2(id.x, 0)), id.xy);
}";
    let texels = [1.0_f32, 2.0].map(f32::to_le_bytes).concat();
    let given = vec![
        texture(false, 0, "r32float", [2, 1, 1], texels),
        texture(true, 1, "rgba32float", [3, 1, 1], vec![0xFF; 48]),
    ];
    let got = run_kernel(text, ONE, [5, 2, 1], given).unwrap();
    assert_eq!(
        as_floats(&got),
        [1.0, 0.0, 0.0, 1.0, 2.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]
    );
}

/// Writes the same four floats to a texture of the format, one texel.
fn stored(format: &'static str, bytes: usize, channels: [f32; 4]) -> Vec<u8> {
    let text = "
kernel void k(metal::texture2d<float, metal::access::write> out [[texture(0)]],
              constant metal::float4& v [[buffer(0)]]) { out.write(v, metal::uint2(0)); }";
    let given = vec![
        texture(true, 0, format, [1, 1, 1], vec![0; bytes]),
        floats(Role::Uniform, 0, &channels),
    ];
    run_kernel(text, ONE, [1; 3], given).unwrap()
}

#[test]
fn a_format_rounds_what_is_written() {
    // 0.1 × 255 = 25.5, which is a tie in exact arithmetic; as a float it rounds to 25.5 too.
    assert_eq!(
        stored("rgba8unorm", 4, [0.1, 0.5, -1.0, f32::NAN]),
        [26, 128, 0, 0]
    );
    assert_eq!(
        stored("rgba16unorm", 8, [0.5, 2.0, f32::INFINITY, 1.0 / 65535.0]),
        [0, 128, 255, 255, 255, 255, 1, 0]
    );
    // 2049 and 2051 are ties of halves: to even.
    assert_eq!(
        stored("rgba16float", 8, [2049.0, 2051.0, 1e9, -0.0]),
        [0x6800_u16, 0x6802, 0x7C00, 0x8000]
            .map(u16::to_le_bytes)
            .concat()
    );
    assert_eq!(
        stored("r32float", 4, [0.1, 5.0, 5.0, 5.0]),
        0.1_f32.to_le_bytes()
    );
}

#[test]
fn a_sampler_filters_and_wraps() {
    let text = "
kernel void k(metal::texture2d<float, metal::access::sample> t [[texture(0)]],
              metal::sampler s [[sampler(0)]],
              device metal::float2* out [[buffer(0)]]) {
    float at[6] = {0.5, 0.25, 0.375, 0.0, 1.0, -0.25};
    for (int i = 0; i < 6; i++)
        out[i] = t.sample(s, metal::float2(at[i], 0.5), metal::level(0.0)).xw;
}";
    for (linear, repeat, expected) in [
        (true, false, [1.5, 1.0, 1.25, 1.0, 2.0, 1.0]),
        (true, true, [1.5, 1.0, 1.25, 1.5, 1.5, 2.0]),
        (false, false, [2.0, 1.0, 1.0, 1.0, 2.0, 1.0]),
        (false, true, [2.0, 1.0, 1.0, 1.0, 1.0, 2.0]),
    ] {
        let texels = [1.0_f32, 2.0].map(f32::to_le_bytes).concat();
        let given = vec![
            texture(false, 0, "r32float", [2, 1, 1], texels),
            Given {
                role: Role::Sampler,
                place: Some(("sampler", 0)),
                bytes: Vec::new(),
                texture: None,
                sampler: Some((linear, repeat)),
            },
            floats(Role::Write, 0, &[0.0; 12]),
        ];
        let got = as_floats(&run_kernel(text, ONE, [1; 3], given).unwrap());
        let expected: Vec<f32> = expected.iter().flat_map(|&x| [x, 1.0]).collect();
        assert_eq!(got, expected, "linear {linear}, repeat {repeat}");
    }
}

#[test]
fn a_vertex_stage_takes_and_gives() {
    let text = "
struct In { metal::float3 p [[attribute(1)]]; uint n [[attribute(0)]]; };
struct Out { metal::float4 position [[position]]; metal::uint2 pair [[user(loc2), flat]]; };
vertex Out k(In in [[stage_in]], uint i [[vertex_id]], constant float& scale [[buffer(0)]]) {
    return Out { metal::float4(in.p * scale, 1.0), metal::uint2(in.n, i) };
}";
    let value = |scalar, size| Value { scalar, size };
    let own = |role, bytes: Vec<u8>| Given {
        role,
        place: None,
        bytes,
        texture: None,
        sampler: None,
    };
    let points: Vec<u8> = (0..12_u8)
        .flat_map(|i| f32::from(i).to_le_bytes())
        .collect();
    let numbers: Vec<u8> = (7..11_u32).flat_map(u32::to_le_bytes).collect();
    let given = vec![
        own(
            Role::Attribute {
                location: 0,
                value: value(Scalar::U32, 1),
            },
            numbers,
        ),
        own(
            Role::Attribute {
                location: 1,
                value: value(Scalar::F32, 3),
            },
            points,
        ),
        floats(Role::Uniform, 0, &[2.0]),
        own(
            Role::Passed {
                location: 2,
                value: value(Scalar::U32, 2),
            },
            vec![0; 32],
        ),
        own(Role::Position, vec![0; 64]),
    ];
    let got = run_kernel(text, Stage::Vertex, [1; 3], given).unwrap();
    assert_eq!(as_uints(&got[..32]), [7, 0, 8, 1, 9, 2, 10, 3]);
    assert_eq!(
        as_floats(&got[32..64]),
        [0.0, 2.0, 4.0, 1.0, 6.0, 8.0, 10.0, 1.0]
    );
    assert_eq!(got.len(), 96);
}

#[test]
fn what_goes_wrong_has_words() {
    let out = || vec![floats(Role::Write, 0, &[0.0])];
    let of = |text: &str, timeout| run_within(text, ONE, [1; 3], out(), timeout);
    let minute = Duration::from_secs(60);
    match of(
        "kernel void k(device float* x [[buffer(0)]]) { x[0] = y; }",
        minute,
    ) {
        Err(Failure::Refused { message: log }) => assert!(log.contains("kernel.metal:3"), "{log}"),
        other => panic!("{other:?}"),
    }
    match of(
        "kernel void k(constant float* x [[buffer(0)]]) { x[0] = 1.0; }",
        minute,
    ) {
        Err(Failure::Refused { message: log }) => assert!(log.contains("const"), "{log}"),
        other => panic!("{other:?}"),
    }
    match of("kernel void k(device float* x [[buffer(1)]]) {}", minute) {
        Err(Failure::Refused { message: problem }) => {
            assert!(problem.contains("buffer(1)"), "{problem}")
        }
        other => panic!("{other:?}"),
    }
    match of(
        "kernel void k(device float* x [[buffer(0)]], uint i) {}",
        minute,
    ) {
        Err(Failure::Refused { message: problem }) => {
            assert!(problem.contains("uint i"), "{problem}")
        }
        other => panic!("{other:?}"),
    }
    match of(
        "kernel void k(device float* x [[buffer(0)]]) { while (true) {} }",
        Duration::from_secs(3),
    ) {
        Err(Failure::TimedOut { program, .. }) => assert_eq!(program, "program"),
        other => panic!("{other:?}"),
    }
}
