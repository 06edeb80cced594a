struct Glow {
    threshold: f32,
    spread: f32,
    strength: f32,
    padding: f32,
}

@group(0) @binding(0) var<uniform> glow: Glow;
@group(0) @binding(1) var narrow: texture_2d<f32>;
@group(0) @binding(2) var wide: texture_2d<f32>;
@group(0) @binding(3) var linear: sampler;
@group(0) @binding(4) var both: texture_storage_2d<rgba16float, write>;

@compute @workgroup_size(8, 8)
fn bloom_up(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= textureDimensions(both)) {
        return;
    }
    let uv = (vec2f(id.xy) + 0.5) / vec2f(textureDimensions(narrow));
    let step = 1 / vec2f(textureDimensions(wide));
    let corners = textureSampleLevel(wide, linear, uv + vec2f(-1, -1) * step, 0)
        + textureSampleLevel(wide, linear, uv + vec2f(1, -1) * step, 0)
        + textureSampleLevel(wide, linear, uv + vec2f(-1, 1) * step, 0)
        + textureSampleLevel(wide, linear, uv + vec2f(1, 1) * step, 0);
    let sides = textureSampleLevel(wide, linear, uv + vec2f(0, -1) * step, 0)
        + textureSampleLevel(wide, linear, uv + vec2f(0, 1) * step, 0)
        + textureSampleLevel(wide, linear, uv + vec2f(-1, 0) * step, 0)
        + textureSampleLevel(wide, linear, uv + vec2f(1, 0) * step, 0);
    let tent = corners / 16 + sides / 8 + textureSampleLevel(wide, linear, uv, 0) / 4;
    textureStore(both, id.xy, textureLoad(narrow, id.xy, 0) + tent * glow.spread);
}
