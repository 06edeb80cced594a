// Calls Bevy's lookup of a directional light's shadow for each surface, as its fragment shaders do.
#import bevy_pbr::shadows::fetch_directional_shadow

struct Surface {
    position: vec3<f32>,
    normal: vec3<f32>,
}

@group(1) @binding(0) var<storage, read> surfaces: array<Surface>;
@group(2) @binding(0) var<storage, read_write> shadows: array<f32>;

@compute @workgroup_size(64)
fn find_shadows(@builtin(global_invocation_id) id: vec3<u32>) {
    let surface = surfaces[id.x];
    let position = vec4<f32>(surface.position, 1.0);
    // The first light; any depth within its first cascade; the pixel is for dithering, which is off.
    let lit = fetch_directional_shadow(0u, position, surface.normal, -1.0, vec2<f32>(0.0));
    shadows[id.x] = 1.0 - lit;
}
