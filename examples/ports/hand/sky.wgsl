struct Model {
    perez: array<vec4f, 5>,
    scale: vec4f,
    sun: vec4f,
}

@group(0) @binding(0) var<uniform> size: vec2u;
@group(0) @binding(1) var<uniform> model: Model;
@group(0) @binding(2) var picture: texture_storage_2d<rgba16float, write>;

// By rows, so it multiplies from the right.
const XYZ_TO_RGB = mat3x3f(3.2406, -1.5372, -0.4986, -0.9689, 1.8758, 0.0415, 0.0557, -0.2040, 1.0570);

@compute @workgroup_size(8, 8)
fn sky(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= textureDimensions(picture)) {
        return;
    }
    let uv = (vec2f(id.xy) + 0.5) / vec2f(size) * 2 - 1;
    let radius = dot(uv, uv);
    if radius > 0.99 {
        textureStore(picture, id.xy, vec4f(0, 0, 0, 1));
        return;
    }
    let cosine = 1 - radius;
    let direction = vec3f(uv * sqrt(2 - radius), cosine);
    let cos_angle = clamp(dot(direction, model.sun.xyz), -1, 1);
    let value = (1 + model.perez[0].xyz * exp(model.perez[1].xyz / cosine))
        * (1 + model.perez[2].xyz * exp(model.perez[3].xyz * acos(cos_angle))
            + model.perez[4].xyz * cos_angle * cos_angle)
        * model.scale.xyz;
    let per_y = value.z / max(value.y, 0.03);
    let xyz = vec3f(value.x * per_y, value.z, (1 - value.x - value.y) * per_y);
    textureStore(picture, id.xy, vec4f(clamp(xyz * XYZ_TO_RGB, vec3f(), vec3f(60000)), 1));
}
