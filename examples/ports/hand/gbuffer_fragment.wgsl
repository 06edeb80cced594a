struct Targets {
    @location(0) colour: vec4f,
    @location(1) normal_and_motion: vec4f,
    @location(2) depth: f32,
    @location(3) number: u32,
}

@group(0) @binding(0) var colours: texture_2d<f32>;
@group(0) @binding(1) var bumps: texture_2d<f32>;
@group(0) @binding(2) var repeated: sampler;

fn octahedral(v: vec3f) -> vec2f {
    let p = v.xy / (abs(v.x) + abs(v.y) + abs(v.z));
    return select((1 - abs(p.yx)) * select(vec2f(-1), vec2f(1), p >= vec2f()), p, v.z >= 0);
}

fn on_screen(clip: vec4f) -> vec2f {
    return vec2f(clip.x, -clip.y) / clip.w * 0.5;
}

@fragment
fn gbuffer_fragment(
    @location(0) now: vec4f,
    @location(1) before: vec4f,
    @location(2) normal: vec3f,
    @location(3) tangent: vec4f,
    @location(4) uv: vec2f,
    @location(5) @interpolate(flat) roughness: f32,
    @location(6) @interpolate(flat) number: u32,
) -> Targets {
    let colour = textureSample(colours, repeated, uv).rgb;
    let bump = textureSample(bumps, repeated, uv).rgb * 2 - 1;
    let up = normalize(normal);
    let across = normalize(tangent.xyz);
    let turned = normalize(across * bump.x + cross(up, across) * tangent.w * bump.y + up * bump.z);
    return Targets(
        vec4f(colour, roughness),
        vec4f(octahedral(turned), on_screen(now) - on_screen(before)),
        now.w,
        number,
    );
}
