struct Material {
    f0: vec3f,
    roughness: f32,
    diffuse: vec4f,
}

@group(0) @binding(0) var<uniform> material: Material;
@group(0) @binding(1) var environment: texture_cube<f32>;
@group(0) @binding(2) var trilinear: sampler;

@fragment
fn reflection(@location(0) across: vec3f, @location(1) to_eye: vec3f) -> @location(0) vec4f {
    let normal = normalize(across);
    let view = normalize(to_eye);
    let last = f32(textureNumLevels(environment) - 1);
    let sharp = textureSampleLevel(environment, trilinear, reflect(-view, normal), material.roughness * last).rgb;
    let around = textureSampleLevel(environment, trilinear, normal, last).rgb;
    let fresnel = pow(1 - saturate(dot(normal, view)), 5);
    let reflectance = mix(material.f0, vec3f(1), fresnel);
    return vec4f(mix(material.diffuse.rgb * around, sharp, reflectance), 1);
}
