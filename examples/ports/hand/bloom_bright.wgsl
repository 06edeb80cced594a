struct Glow {
    threshold: f32,
    spread: f32,
    strength: f32,
    padding: f32,
}

@group(0) @binding(0) var<uniform> glow: Glow;
@group(0) @binding(1) var source: texture_2d<f32>;
@group(0) @binding(2) var linear: sampler;
@group(0) @binding(3) var bright: texture_storage_2d<rgba16float, write>;

@compute @workgroup_size(8, 8)
fn bloom_bright(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= textureDimensions(bright)) {
        return;
    }
    var taps = array(vec2f(-1, -1), vec2f(1, -1), vec2f(-1, 1), vec2f(1, 1));
    let size = vec2f(textureDimensions(source));
    let middle = vec2f(id.xy) * 2 + 1;
    var sum = vec4f();
    for (var i = 0; i < 4; i++) {
        let colour = textureSampleLevel(source, linear, (middle + taps[i]) / size, 0).rgb;
        let brightest = max(max(colour.r, colour.g), colour.b);
        let above = max(brightest - glow.threshold, 0) / max(brightest, 1e-4);
        sum += vec4f(colour * above, 1) / (1 + brightest);
    }
    textureStore(bright, id.xy, vec4f(sum.rgb / sum.a, 1));
}
