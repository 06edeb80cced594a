struct Sphere {
    middle: vec3f,
    radius: f32,
    albedo: vec3f,
    mirror: f32,
    light: vec4f,
}

struct Camera {
    place: vec3f,
    half: f32,
    sky: vec4f,
    size: vec2u,
    paths: u32,
    bounces: u32,
    seed: u32,
    padding: u32,
    padding_2: vec2u,
}

@group(0) @binding(0) var<uniform> camera: Camera;
@group(0) @binding(1) var<storage> spheres: array<Sphere>;
@group(0) @binding(2) var<storage, read_write> picture: array<vec4f>;

var<private> bits: u32;

fn hash(x: u32) -> u32 {
    let state = x * 747796405 + 2891336453;
    let word = ((state >> ((state >> 28) + 4)) ^ state) * 277803737;
    return (word >> 22) ^ word;
}

fn random() -> f32 {
    bits = hash(bits);
    return f32(bits >> 8) / 16777216;
}

@compute @workgroup_size(8, 8)
fn path_trace(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= camera.size) {
        return;
    }
    let size = vec2f(camera.size);
    let pixel = id.y * camera.size.x + id.x;
    bits = hash(pixel ^ hash(camera.seed));
    var light = vec3f();
    for (var path = 0u; path < camera.paths; path++) {
        let x = random();
        let inside = vec2f(id.xy) + vec2f(x, random());
        let on_screen = (2 * inside - size) * camera.half / size.y;
        var origin = camera.place;
        var towards = normalize(vec3f(on_screen.x, -on_screen.y, -1));
        var share = vec3f(1);
        for (var bounce = 0u; bounce < camera.bounces; bounce++) {
            var nearest = 1e30;
            let none = arrayLength(&spheres);
            var hit = none;
            for (var i = 0u; i < none; i++) {
                let to_middle = spheres[i].middle - origin;
                let middle = dot(to_middle, towards);
                let aside = to_middle - towards * middle;
                let half = spheres[i].radius * spheres[i].radius - dot(aside, aside);
                if half > 0 {
                    let root = sqrt(half);
                    let distance = select(middle + root, middle - root, middle - root >= 1e-3);
                    if distance > 1e-3 && distance < nearest {
                        nearest = distance;
                        hit = i;
                    }
                }
            }
            if hit == none {
                light += share * camera.sky.rgb;
                break;
            }
            let sphere = spheres[hit];
            light += share * sphere.light.rgb;
            share *= sphere.albedo;
            origin += towards * nearest;
            let outside = (origin - sphere.middle) / sphere.radius;
            let normal = faceForward(outside, towards, outside);
            if sphere.mirror > 0 {
                towards = reflect(towards, normal);
            } else {
                var point = vec3f(1, 0, 0);
                for (var tries = 0; tries < 16; tries++) {
                    let u = random();
                    let v = random();
                    let tried = vec3f(u, v, random()) * 2 - 1;
                    let square = dot(tried, tried);
                    if square <= 1 && square > 1e-6 {
                        point = tried / sqrt(square);
                        break;
                    }
                }
                towards = normal + point * 0.999;
            }
            towards = normalize(towards);
        }
    }
    picture[pixel] = vec4f(light / f32(camera.paths), 1);
}
