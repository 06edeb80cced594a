struct Glow {
    threshold: f32,
    spread: f32,
    strength: f32,
    padding: f32,
}

@group(0) @binding(0) var<uniform> glow: Glow;
@group(0) @binding(1) var source: texture_2d<f32>;
@group(0) @binding(2) var bloom: texture_2d<f32>;
@group(0) @binding(3) var linear: sampler;
@group(0) @binding(4) var picture: texture_storage_2d<rgba8unorm, write>;

@compute @workgroup_size(8, 8)
fn bloom_composite(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= textureDimensions(picture)) {
        return;
    }
    let uv = (vec2f(id.xy) + 0.5) / vec2f(textureDimensions(source));
    let levels = textureNumLevels(bloom);
    var sum = vec3f();
    for (var level = 0u; level < levels; level++) {
        sum += textureSampleLevel(bloom, linear, uv, f32(level)).rgb;
    }
    let colour = textureLoad(source, id.xy, 0).rgb + sum * (glow.strength / f32(levels));
    textureStore(picture, id.xy, vec4f(colour / (colour + 1), 1));
}
