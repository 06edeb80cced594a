struct Object {
    to_world: mat4x4f,
    to_clip: mat4x4f,
    to_clip_before: mat4x4f,
    number: u32,
    roughness: f32,
    padding: vec2f,
}

struct Vertex {
    @builtin(position) position: vec4f,
    @location(0) now: vec4f,
    @location(1) before: vec4f,
    @location(2) normal: vec3f,
    @location(3) tangent: vec4f,
    @location(4) uv: vec2f,
    @location(5) @interpolate(flat) roughness: f32,
    @location(6) @interpolate(flat) number: u32,
}

@group(0) @binding(0) var<uniform> object: Object;

@vertex
fn gbuffer_vertex(
    @location(0) position: vec3f,
    @location(1) normal: vec3f,
    @location(2) tangent: vec4f,
    @location(3) uv: vec2f,
) -> Vertex {
    let place = object.to_world * vec4f(position, 1);
    let now = object.to_clip * place;
    let across = object.to_world * vec4f(tangent.xyz, 0);
    return Vertex(
        now,
        now,
        object.to_clip_before * place,
        (object.to_world * vec4f(normal, 0)).xyz,
        vec4f(across.xyz, tangent.w),
        uv,
        object.roughness,
        object.number,
    );
}
