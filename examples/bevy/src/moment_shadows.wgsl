// Takes the place of Bevy's lookup in the shadow maps of directional lights and spotlights: a map holds
// four moments of depths in [-1, 1].
#define_import_path moment_shadows
#import bevy_pbr::shadow_sampling
#import hankel::shadows as hankel

@group(#{MATERIAL_BIND_GROUP}) @binding(100) var moment_maps: texture_2d_array<f32>;
@group(#{MATERIAL_BIND_GROUP}) @binding(101) var moment_sampler: sampler;

override fn bevy_pbr::shadow_sampling::sample_shadow_map(uv: vec2f, z: f32, layer: i32, at: vec2f, size: f32) -> f32 {
    let stored = textureSampleLevel(moment_maps, moment_sampler, uv, layer, 0.0);
    let moments = hankel::hankel_mix_bias(stored, hankel::HANKEL_SHADOWS_SYMMETRIC_FOUR_FLOAT_TARGET,
        hankel::HANKEL_SHADOWS_SYMMETRIC_FOUR_FLOAT_STRENGTH);
    // Bevy's depths are 1 at the near plane.
    return 1.0 - hankel::hankel_cut_leak(hankel::hankel_hamburger_bound(moments, 1.0 - 2.0 * z), 0.02);
}
