struct Views {
    to_clip: mat4x4f,
    to_map: mat4x4f,
}

struct Vertex {
    @builtin(position) position: vec4f,
    @location(0) place: vec3f,
}

@group(0) @binding(0) var<uniform> views: Views;

@vertex
fn shadow_vertex(@location(0) position: vec3f) -> Vertex {
    let p = vec4f(position, 1);
    return Vertex(views.to_clip * p, (views.to_map * p).xyz);
}
