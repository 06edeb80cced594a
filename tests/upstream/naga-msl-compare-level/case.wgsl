@group(0) @binding(0) var depths: texture_depth_2d;
@group(0) @binding(1) var compare: sampler_comparison;

@fragment
fn main(@builtin(position) at: vec4<f32>) -> @location(0) f32 {
    return textureSampleCompareLevel(depths, compare, at.xy, 0.5);
}
