struct View {
    half: vec2f,
    radius: f32,
    bias: f32,
    strength: f32,
    edge: f32,
}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var depths: texture_2d<f32>;
@group(0) @binding(2) var light: texture_2d<f32>;
@group(0) @binding(3) var blurred: texture_storage_2d<r32float, write>;

@compute @workgroup_size(8, 8)
fn ssao_blur(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= textureDimensions(blurred)) {
        return;
    }
    let last = vec2i(textureDimensions(depths)) - 1;
    let depth = textureLoad(depths, id.xy, 0).x;
    var sum = 0.0;
    var weights = 0.0;
    for (var y = -2; y <= 2; y++) {
        for (var x = -2; x <= 2; x++) {
            let at = clamp(vec2i(id.xy) + vec2i(x, y), vec2i(), last);
            let weight = max(1 - abs(textureLoad(depths, at, 0).x - depth) / view.edge, 0);
            sum += textureLoad(light, at, 0).x * weight;
            weights += weight;
        }
    }
    textureStore(blurred, id.xy, vec4f(sum / weights));
}
