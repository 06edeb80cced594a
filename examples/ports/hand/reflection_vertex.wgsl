struct Eye {
    to_clip: mat4x4f,
    place: vec4f,
}

struct Vertex {
    @builtin(position) position: vec4f,
    @location(0) normal: vec3f,
    @location(1) to_eye: vec3f,
}

@group(0) @binding(0) var<uniform> eye: Eye;

@vertex
fn reflection_vertex(@location(0) position: vec3f, @location(1) normal: vec3f) -> Vertex {
    return Vertex(eye.to_clip * vec4f(position, 1), normal, eye.place.xyz - position);
}
