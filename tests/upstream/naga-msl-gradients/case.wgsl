@group(0) @binding(0) var image: texture_3d<f32>;
@group(0) @binding(1) var filters: sampler;
@group(0) @binding(2) var<storage, read_write> out: vec4<f32>;

@compute @workgroup_size(1) fn main() {
    out = textureSampleGrad(image, filters, vec3<f32>(0.5), vec3<f32>(0.1, 0.0, 0.0), vec3<f32>(0.0, 0.1, 0.0));
}
