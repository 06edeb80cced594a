// What Bevy's passes do before shading: shadow maps, and the surface at each pixel. The scene comes
// before this text.

struct Surface {
    position: vec3<f32>,
    normal: vec3<f32>,
}

@group(0) @binding(0) var moment_maps: texture_storage_2d_array<rgba32float, write>;
@group(0) @binding(1) var<storage, read_write> surfaces: array<Surface>;
@group(0) @binding(2) var<storage, read_write> shadows: array<f32>;
@group(0) @binding(3) var<storage, read_write> picture: array<u32>;
@group(0) @binding(4) var<storage, read_write> truth: array<f32>;

// Mean moments of depths from -1 to 1, over four texels along each side.
@compute @workgroup_size(8, 8)
fn fill_map(@builtin(global_invocation_id) id: vec3<u32>) {
    var sum = vec4<f32>(0.0);
    for (var i = 0u; i < 64u; i += 1u) {
        let offset = (vec2<f32>(f32(i % 8u), f32(i / 8u)) - 3.5) / 2.0;
        let depth = 2.0 * light_depth((vec2<f32>(id.xy) + 0.5 + offset) / vec2<f32>(MAP_SIZE)) - 1.0;
        let square = depth * depth;
        sum += vec4<f32>(depth, square, square * depth, square * square);
    }
    textureStore(moment_maps, id.xy, 0, sum / 64.0);
}

@compute @workgroup_size(8, 8)
fn find_surfaces(@builtin(global_invocation_id) id: vec3<u32>) {
    let hit = visible(id.xy);
    surfaces[id.y * SIZE.x + id.x] = Surface(EYE + hit.distance * ray_of(id.xy), hit.normal);
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
