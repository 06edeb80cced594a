struct Contrast {
    relative: f32,
    absolute: f32,
    thin: f32,
    padding: f32,
}

@group(0) @binding(0) var<uniform> contrast: Contrast;
@group(0) @binding(1) var source: texture_2d<f32>;
@group(0) @binding(2) var linear: sampler;
@group(0) @binding(3) var picture: texture_storage_2d<rgba8unorm, write>;

fn luma(colour: vec4f) -> f32 {
    return dot(colour.rgb, vec3f(0.299, 0.587, 0.114));
}

fn near(at: vec2i) -> f32 {
    return luma(textureLoad(source, clamp(at, vec2i(), vec2i(textureDimensions(source)) - 1), 0));
}

fn beside(place: vec2f) -> f32 {
    return luma(textureSampleLevel(source, linear, place / vec2f(textureDimensions(source)), 0));
}

@compute @workgroup_size(8, 8)
fn fxaa(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= textureDimensions(picture)) {
        return;
    }
    let at = vec2i(id.xy);
    let colour = textureLoad(source, at, 0);
    let m = luma(colour);
    let n = near(at + vec2i(0, -1));
    let s = near(at + vec2i(0, 1));
    let w = near(at + vec2i(-1, 0));
    let e = near(at + vec2i(1, 0));
    let most = max(max(max(n, s), max(w, e)), m);
    let range = most - min(min(min(n, s), min(w, e)), m);
    if range < max(contrast.absolute, most * contrast.relative) {
        textureStore(picture, id.xy, colour);
        return;
    }
    let nw = near(at + vec2i(-1, -1));
    let ne = near(at + vec2i(1, -1));
    let sw = near(at + vec2i(-1, 1));
    let se = near(at + vec2i(1, 1));

    let rows = abs(n + s - 2 * m) * 2 + abs(nw + sw - 2 * w) + abs(ne + se - 2 * e);
    let columns = abs(w + e - 2 * m) * 2 + abs(nw + ne - 2 * n) + abs(sw + se - 2 * s);
    let is_flat = rows >= columns;
    let sides = select(vec2f(w, e), vec2f(n, s), is_flat);
    let rises = abs(sides - m);
    let is_before = rises.x >= rises.y;
    let beyond = select(sides.y, sides.x, is_before);
    let rise = max(rises.x, rises.y);
    let on_edge = 0.5 * (m + beyond);

    let side = select(1.0, -1.0, is_before);
    let across = select(vec2f(side, 0), vec2f(0, side), is_flat);
    let along = select(vec2f(0, 1), vec2f(1, 0), is_flat);
    let here = vec2f(id.xy) + 0.5;
    let start = here + 0.5 * across;
    var back = 1.0;
    var end_back = beside(start - along) - on_edge;
    while abs(end_back) < rise / 4 && back < 10 {
        back += 1;
        end_back = beside(start - along * back) - on_edge;
    }
    var forth = 1.0;
    var end_forth = beside(start + along) - on_edge;
    while abs(end_forth) < rise / 4 && forth < 10 {
        forth += 1;
        end_forth = beside(start + along * forth) - on_edge;
    }
    let end = select(end_forth, end_back, back < forth);
    let shift = select(0.0, 0.5 - min(back, forth) / (back + forth), (end < 0) != (m < on_edge));

    let around = (2 * (n + s + w + e) + nw + ne + sw + se) / 12;
    let stands_out = smoothstep(0.0, 1.0, abs(around - m) / range);
    let thin = stands_out * stands_out * contrast.thin;
    let place = (here + across * max(shift, thin)) / vec2f(textureDimensions(source));
    textureStore(picture, id.xy, textureSampleLevel(source, linear, place, 0));
}
