//! Functions that look something up themselves: each is called with a lookup of the host's, in HLSL and GLSL by
//! its macro, in MSL by a functor, in C by a function with a context, in Rust by a closure. WGSL has no such
//! functions; what three.js makes of a lookup is in `tsl.rs`.

use hankel_dsl::glam::{UVec2, UVec4, Vec2, Vec4};
use hankel_dsl::native::describe::{Scalar, Type};
use hankel_dsl::native::function::Function;
use hankel_shadows::library::lookups::{
    mean_of_footprint, mean_of_table_four, percentage_closer, percentage_closer_weighted,
    resolve_four, resolve_quantized_four,
};

/// The sample of a texel with these depths.
fn sample(channels: Vec4, i: u32) -> f32 {
    [channels.x, channels.y, channels.z, channels.w][(i & 3) as usize]
}

/// A summed-area table of 4 x 3 entries.
fn sum(columns: u32, rows: u32) -> UVec4 {
    let texels = columns * rows;
    UVec4::new(texels * 7, texels * columns, texels * rows, texels * 3)
}

/// Whether a texel of a map is nearer than the receiver: every other one on a slant.
fn compare(at: UVec2) -> f32 {
    ((at.x * 3 + at.y) & 1) as f32
}

/// A filter's weight of a texel so far away.
fn weight(i: u32) -> f32 {
    if i == 0 { 0.5 } else { 0.25 }
}

/// A number from 0 to 1, 0 for NaN.
fn within(t: f32) -> f32 {
    if t > 0.0 { t.min(1.0) } else { 0.0 }
}

/// A map that holds its coordinates, and the width it is looked up with.
fn sample_of_width(uv: Vec2, width: f32) -> Vec4 {
    Vec4::new(within(uv.x), within(uv.y), width, 1.0)
}

/// Texels of the host's map.
const MAP: UVec2 = UVec2::new(5, 4);

/// The functions of the host, whose words are numbers.
pub fn natives() -> Vec<Function> {
    let scalar = |scalar| Type::Scalar { scalar };
    let vector = |size| Type::Vector {
        scalar: Scalar::F32,
        size,
    };
    vec![
        Function {
            name: "host_resolve_four",
            params: vec![("channels", vector(4)), ("count", scalar(Scalar::U32))],
            result: vector(4),
            run: |words, out| {
                let channels = read_four(words);
                let given = resolve_four(1 + (words[4] & 3), |i| sample(channels, i));
                write_four(given, out);
            },
        },
        Function {
            name: "host_resolve_quantized_four",
            params: vec![("channels", vector(4)), ("count", scalar(Scalar::U32))],
            result: vector(4),
            run: |words, out| {
                let channels = read_four(words);
                let given = resolve_quantized_four(1 + (words[4] & 3), |i| sample(channels, i));
                write_four(given, out);
            },
        },
        Function {
            name: "host_mean_of_table_four",
            params: vec![("place", vector(2)), ("reach", vector(2))],
            result: vector(4),
            run: |words, out| {
                let size = UVec2::new(4, 3);
                let (place, reach) = (read_pair(words, 0), read_pair(words, 2));
                write_four(mean_of_table_four(place, reach, size, 16, sum), out);
            },
        },
        Function {
            name: "host_percentage_closer",
            params: vec![("uv", vector(2)), ("radius", scalar(Scalar::U32))],
            result: scalar(Scalar::F32),
            run: |words, out| {
                let uv = read_pair(words, 0);
                out.push(percentage_closer(MAP, words[2] & 3, uv, compare).to_bits());
            },
        },
        Function {
            name: "host_percentage_closer_weighted",
            params: vec![("uv", vector(2)), ("count", scalar(Scalar::U32))],
            result: scalar(Scalar::F32),
            run: |words, out| {
                let (uv, count) = (read_pair(words, 0), 1 + (words[2] & 1));
                out.push(percentage_closer_weighted(MAP, count, uv, weight, compare).to_bits());
            },
        },
        Function {
            name: "host_mean_of_footprint",
            params: vec![("uv", vector(2)), ("dx", vector(2)), ("dy", vector(2))],
            result: vector(4),
            run: |words, out| {
                let [uv, dx, dy] = [0, 2, 4].map(|at| read_pair(words, at));
                write_four(
                    mean_of_footprint(uv, dx, dy, MAP, 4.0, sample_of_width),
                    out,
                );
            },
        },
    ]
}

fn read_pair(words: &[u32], at: usize) -> Vec2 {
    Vec2::new(f32::from_bits(words[at]), f32::from_bits(words[at + 1]))
}

fn read_four(words: &[u32]) -> Vec4 {
    let (a, b) = (read_pair(words, 0), read_pair(words, 2));
    Vec4::new(a.x, a.y, b.x, b.y)
}

fn write_four(v: Vec4, out: &mut Vec<u32>) {
    out.extend([v.x, v.y, v.z, v.w].map(f32::to_bits));
}

/// Before the library in HLSL: the host's lookups, and the macros that name them.
pub const HLSL: &str = "
static float4 host_depths;
uint4 host_sum(uint columns, uint rows)
{
    uint texels = columns * rows;
    return uint4(texels * 7u, texels * columns, texels * rows, texels * 3u);
}
float host_compare(uint2 at)
{
    return float((at.x * 3u + at.y) & 1u);
}
float host_weight(uint i)
{
    return i == 0u ? 0.5 : 0.25;
}
float host_within(float t)
{
    return t > 0.0 ? (t < 1.0 ? t : 1.0) : 0.0;
}
float4 host_sample_of_width(float2 uv, float width)
{
    return float4(host_within(uv.x), host_within(uv.y), width, 1.0);
}
#define HANKEL_COMPARE(at) host_compare(at)
#define HANKEL_WEIGHT(i) host_weight(i)
#define HANKEL_SAMPLE_OF_WIDTH(uv, width) host_sample_of_width(uv, width)
#define HANKEL_SAMPLE_DEPTH(i) host_depths[(i) & 3u]
#define HANKEL_SUM_BEFORE(columns, rows) host_sum(columns, rows)
";

/// After the library in HLSL: the host's functions.
pub const HLSL_AFTER: &str = "
float4 hankel_host_resolve_four(float4 depths, uint count)
{
    host_depths = depths;
    return hankel_resolve_four(1u + (count & 3u));
}
float4 hankel_host_resolve_quantized_four(float4 depths, uint count)
{
    host_depths = depths;
    return hankel_resolve_quantized_four(1u + (count & 3u));
}
float4 hankel_host_mean_of_table_four(float2 place, float2 reach)
{
    return hankel_mean_of_table_four(place, reach, uint2(4u, 3u), 16u);
}
float hankel_host_percentage_closer(float2 uv, uint radius)
{
    return hankel_percentage_closer(uint2(5u, 4u), radius & 3u, uv);
}
float hankel_host_percentage_closer_weighted(float2 uv, uint count)
{
    return hankel_percentage_closer_weighted(uint2(5u, 4u), 1u + (count & 1u), uv);
}
float4 hankel_host_mean_of_footprint(float2 uv, float2 dx, float2 dy)
{
    return hankel_mean_of_footprint(uv, dx, dy, uint2(5u, 4u), 4.0);
}
";

/// HLSL's words in GLSL.
pub fn as_glsl(hlsl: &str) -> String {
    let words = [
        ("static float4", "highp vec4"),
        ("uint4", "uvec4"),
        ("uint2", "uvec2"),
        ("float4", "vec4"),
        ("float2", "vec2"),
    ];
    let mut text = hlsl.to_owned();
    for (from, to) in words {
        text = text.replace(from, to);
    }
    // What has no precision of its own would have the host's.
    for ty in ["float", "vec2", "vec4", "uint", "uvec2", "uvec4"] {
        for before in ["(", ", ", "\n", "    "] {
            let (from, to) = (format!("{before}{ty} "), format!("{before}highp {ty} "));
            text = text.replace(&from, &to);
        }
    }
    text
}

/// After the library's header in MSL.
pub const MSL_AFTER: &str = "
namespace hankel {
namespace shadows {
struct HostDepths {
    metal::float4 depths;
    float operator()(uint i) const { return depths[i & 3u]; }
};
struct HostSum {
    metal::uint4 operator()(uint columns, uint rows) const
    {
        uint texels = columns * rows;
        return metal::uint4(texels * 7u, texels * columns, texels * rows, texels * 3u);
    }
};
struct HostCompare {
    float operator()(metal::uint2 at) const { return float((at.x * 3u + at.y) & 1u); }
};
struct HostWeight {
    float operator()(uint i) const { return i == 0u ? 0.5f : 0.25f; }
};
struct HostSampleOfWidth {
    static float within(float t) { return t > 0.0f ? (t < 1.0f ? t : 1.0f) : 0.0f; }
    metal::float4 operator()(metal::float2 uv, float width) const
    {
        return metal::float4(within(uv.x), within(uv.y), width, 1.0f);
    }
};
inline metal::float4 host_resolve_four(metal::float4 depths, uint count)
{
    return resolve_four(1u + (count & 3u), HostDepths{depths});
}
inline metal::float4 host_resolve_quantized_four(metal::float4 depths, uint count)
{
    return resolve_quantized_four(1u + (count & 3u), HostDepths{depths});
}
inline metal::float4 host_mean_of_table_four(metal::float2 place, metal::float2 reach)
{
    return mean_of_table_four(place, reach, metal::uint2(4u, 3u), 16u, HostSum());
}
inline float host_percentage_closer(metal::float2 uv, uint radius)
{
    return percentage_closer(metal::uint2(5u, 4u), radius & 3u, uv, HostCompare());
}
inline float host_percentage_closer_weighted(metal::float2 uv, uint count)
{
    return percentage_closer_weighted(metal::uint2(5u, 4u), 1u + (count & 1u), uv, HostWeight(), HostCompare());
}
inline metal::float4 host_mean_of_footprint(metal::float2 uv, metal::float2 dx, metal::float2 dy)
{
    return mean_of_footprint(uv, dx, dy, metal::uint2(5u, 4u), 4.0f, HostSampleOfWidth());
}
}
}
";

/// After the library's header in C.
pub const C_AFTER: &str = "
static float host_depth(void *context, uint32_t i)
{
    const hankel_float4 depths = *(const hankel_float4 *)context;
    const uint32_t at = i & 3u;
    return at == 0u ? depths.x : at == 1u ? depths.y : at == 2u ? depths.z : depths.w;
}
static hankel_uint4 host_sum(void *context, uint32_t columns, uint32_t rows)
{
    const uint32_t texels = columns * rows;
    (void)context;
    return hankel_make_uint4(texels * 7u, texels * columns, texels * rows, texels * 3u);
}
static float host_compare(void *context, hankel_uint2 at)
{
    (void)context;
    return (float)((at.x * 3u + at.y) & 1u);
}
static float host_weight(void *context, uint32_t i)
{
    (void)context;
    return i == 0u ? 0.5f : 0.25f;
}
static float host_within(float t)
{
    return t > 0.0f ? (t < 1.0f ? t : 1.0f) : 0.0f;
}
static hankel_float4 host_sample_of_width(void *context, hankel_float2 uv, float width)
{
    (void)context;
    return hankel_make_float4(host_within(uv.x), host_within(uv.y), width, 1.0f);
}
static hankel_float4 hankel_host_resolve_four(hankel_float4 depths, uint32_t count)
{
    return hankel_resolve_four(1u + (count & 3u), host_depth, &depths);
}
static hankel_float4 hankel_host_resolve_quantized_four(hankel_float4 depths, uint32_t count)
{
    return hankel_resolve_quantized_four(1u + (count & 3u), host_depth, &depths);
}
static hankel_float4 hankel_host_mean_of_table_four(hankel_float2 place, hankel_float2 reach)
{
    return hankel_mean_of_table_four(place, reach, hankel_make_uint2(4u, 3u), 16u, host_sum, 0);
}
static float hankel_host_percentage_closer(hankel_float2 uv, uint32_t radius)
{
    return hankel_percentage_closer(hankel_make_uint2(5u, 4u), radius & 3u, uv, host_compare, 0);
}
static float hankel_host_percentage_closer_weighted(hankel_float2 uv, uint32_t count)
{
    const hankel_uint2 size = hankel_make_uint2(5u, 4u);
    return hankel_percentage_closer_weighted(size, 1u + (count & 1u), uv, host_weight, 0, host_compare, 0);
}
static hankel_float4 hankel_host_mean_of_footprint(hankel_float2 uv, hankel_float2 dx, hankel_float2 dy)
{
    return hankel_mean_of_footprint(uv, dx, dy, hankel_make_uint2(5u, 4u), 4.0f, host_sample_of_width, 0);
}
";

/// After the library in Rust.
pub const RUST_AFTER: &str = "
pub fn host_resolve_four(depths: [f32; 4], count: u32) -> [f32; 4] {
    resolve_four(1 + (count & 3), &|i| depths[(i & 3) as usize])
}
pub fn host_resolve_quantized_four(depths: [f32; 4], count: u32) -> [f32; 4] {
    resolve_quantized_four(1 + (count & 3), &|i| depths[(i & 3) as usize])
}
pub fn host_mean_of_table_four(place: [f32; 2], reach: [f32; 2]) -> [f32; 4] {
    mean_of_table_four(place, reach, [4, 3], 16, &|columns, rows| {
        let texels = columns * rows;
        [texels * 7, texels * columns, texels * rows, texels * 3]
    })
}
pub fn host_percentage_closer(uv: [f32; 2], radius: u32) -> f32 {
    percentage_closer([5, 4], radius & 3, uv, &compare)
}
pub fn host_percentage_closer_weighted(uv: [f32; 2], count: u32) -> f32 {
    let weight = |i| if i == 0 { 0.5 } else { 0.25 };
    percentage_closer_weighted([5, 4], 1 + (count & 1), uv, &weight, &compare)
}
pub fn host_mean_of_footprint(uv: [f32; 2], dx: [f32; 2], dy: [f32; 2]) -> [f32; 4] {
    let within = |t: f32| if t > 0.0 { if t < 1.0 { t } else { 1.0 } } else { 0.0 };
    mean_of_footprint(uv, dx, dy, [5, 4], 4.0, &|uv, width| {
        [within(uv[0]), within(uv[1]), width, 1.0]
    })
}
fn compare(at: [u32; 2]) -> f32 {
    ((at[0] * 3 + at[1]) & 1) as f32
}
";
