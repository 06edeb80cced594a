// The renderer's own passes; the scene comes before this text.

@group(0) @binding(0) var<storage, read_write> map: array<vec4<f32>>;
@group(0) @binding(1) var<storage, read_write> receivers: array<f32>;
@group(0) @binding(2) var<storage, read_write> shadows: array<f32>;
@group(0) @binding(3) var<storage, read_write> picture: array<u32>;
@group(0) @binding(4) var<storage, read_write> truth: array<f32>;

// The shadow map: mean moments of depths from -1 to 1, over four texels along each side.
@compute @workgroup_size(8, 8)
fn fill_map(@builtin(global_invocation_id) id: vec3<u32>) {
    var sum = vec4<f32>(0.0);
    for (var i = 0u; i < 64u; i += 1u) {
        let offset = (vec2<f32>(f32(i % 8u), f32(i / 8u)) - 3.5) / 2.0;
        let depth = 2.0 * light_depth((vec2<f32>(id.xy) + 0.5 + offset) / vec2<f32>(MAP_SIZE)) - 1.0;
        let square = depth * depth;
        sum += vec4<f32>(depth, square, square * depth, square * square);
    }
    map[id.y * MAP_SIZE.x + id.x] = sum / 64.0;
}

fn texel(at: vec2<i32>) -> vec4<f32> {
    let inside = clamp(at, vec2<i32>(0), vec2<i32>(MAP_SIZE) - 1);
    return map[u32(inside.y) * MAP_SIZE.x + u32(inside.x)];
}

// For each pixel what the kernel reads: four moments, and the surface's depth in the map.
@compute @workgroup_size(8, 8)
fn find_receivers(@builtin(global_invocation_id) id: vec3<u32>) {
    let hit = visible(id.xy);
    let place = in_light(EYE + hit.distance * ray_of(id.xy) + 0.03 * hit.normal);
    let row = 5u * (id.y * SIZE.x + id.x);
    // Outside of the map is light: nothing is nearer to it than -1.
    receivers[row + 4u] = -1.0;
    if (any(place != saturate(place))) {
        return;
    }
    let at = place.xy * vec2<f32>(MAP_SIZE) - 0.5;
    let corner = vec2<i32>(floor(at));
    let part = fract(at);
    let above = mix(texel(corner), texel(corner + vec2<i32>(1, 0)), part.x);
    let below = mix(texel(corner + vec2<i32>(0, 1)), texel(corner + vec2<i32>(1, 1)), part.x);
    let moments = mix(above, below, part.y);
    for (var i = 0u; i < 4u; i += 1u) {
        receivers[row + i] = moments[i];
    }
    receivers[row + 4u] = 2.0 * place.z - 1.0;
}

@compute @workgroup_size(8, 8)
fn shade(@builtin(global_invocation_id) id: vec3<u32>) {
    let hit = visible(id.xy);
    let i = id.y * SIZE.x + id.x;
    picture[i] = shaded(hit, shadows[i]);
    truth[i] = 0.0;
    if (hit.distance < 100.0) {
        truth[i] = in_shadow(EYE + hit.distance * ray_of(id.xy), hit.normal);
    }
}
