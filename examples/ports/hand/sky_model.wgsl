struct Conditions {
    sun: f32,
    turbidity: f32,
}

struct Model {
    perez: array<vec4f, 5>,
    scale: vec4f,
    sun: vec4f,
}

@group(0) @binding(0) var<storage> skies: array<Conditions>;
@group(0) @binding(1) var<storage, read_write> models: array<Model>;

@compute @workgroup_size(64)
fn sky_model(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= arrayLength(&models) {
        return;
    }
    let s = clamp(skies[id.x].sun, 0, 1.5);
    let t = clamp(skies[id.x].turbidity, 1.7, 10);
    let perez = array(
        vec4f(-0.0193, -0.0167, 0.1787, 0) * t + vec4f(-0.2592, -0.2608, -1.4630, 0),
        vec4f(-0.0665, -0.0950, -0.3554, 0) * t + vec4f(0.0008, 0.0092, 0.4275, 0),
        vec4f(-0.0004, -0.0079, -0.0227, 0) * t + vec4f(0.2125, 0.2102, 5.3251, 0),
        vec4f(-0.0641, -0.0441, 0.1206, 0) * t + vec4f(-0.8989, -1.6537, -2.5771, 0),
        vec4f(-0.0033, -0.0109, -0.0670, 0) * t + vec4f(0.0452, 0.0529, 0.3703, 0),
    );
    let powers = vec4f(s * s * s, s * s, s, 1);
    let zenith = vec3f(
        dot(vec3f(t * t, t, 1), powers * mat3x4f(
            vec4f(0.00166, -0.00375, 0.00209, 0),
            vec4f(-0.02903, 0.06377, -0.03202, 0.00394),
            vec4f(0.11693, -0.21196, 0.06052, 0.25886),
        )),
        dot(vec3f(t * t, t, 1), powers * mat3x4f(
            vec4f(0.00275, -0.00610, 0.00317, 0),
            vec4f(-0.04214, 0.08970, -0.04153, 0.00516),
            vec4f(0.15346, -0.26756, 0.06670, 0.26688),
        )),
        (4.0453 * t - 4.9710) * tan((4.0 / 9 - t / 120) * (3.14159265 - 2 * s)) - 0.2155 * t + 2.4192,
    );
    let c = cos(s);
    let at_zenith = (1 + perez[0] * exp(perez[1])) * (1 + perez[2] * exp(perez[3] * s) + perez[4] * c * c);
    models[id.x] = Model(perez, vec4f(zenith / at_zenith.xyz, 0), vec4f(sin(s), 0, c, 0));
}
