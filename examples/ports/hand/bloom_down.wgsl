@group(0) @binding(0) var source: texture_2d<f32>;
@group(0) @binding(1) var linear: sampler;
@group(0) @binding(2) var half_size: texture_storage_2d<rgba16float, write>;

fn tap(at: vec2f) -> vec4f {
    return textureSampleLevel(source, linear, at / vec2f(textureDimensions(source)), 0);
}

@compute @workgroup_size(8, 8)
fn bloom_down(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= textureDimensions(half_size)) {
        return;
    }
    let m = vec2f(id.xy) * 2 + 1;
    let inner = tap(m + vec2f(-1, -1)) + tap(m + vec2f(1, -1)) + tap(m + vec2f(-1, 1)) + tap(m + vec2f(1, 1));
    let corners = tap(m + vec2f(-2, -2)) + tap(m + vec2f(2, -2)) + tap(m + vec2f(-2, 2)) + tap(m + vec2f(2, 2));
    let sides = tap(m + vec2f(0, -2)) + tap(m + vec2f(0, 2)) + tap(m + vec2f(-2, 0)) + tap(m + vec2f(2, 0));
    textureStore(half_size, id.xy, inner * 0.125 + corners * 0.03125 + sides * 0.0625 + tap(m) * 0.125);
}
