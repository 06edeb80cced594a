// What the examples draw: a ground, a fence, a block and a ball, cast by rays. Nothing of Hankel.

// Pixels of the picture, texels of the shadow map.
const SIZE: vec2<u32> = vec2<u32>(600u, 360u);
const MAP_SIZE: vec2<u32> = vec2<u32>(256u, 256u);

// The light's axes, towards it last, and half the extent that its map covers along each.
const LIGHT_RIGHT: vec3<f32> = vec3<f32>(-0.6247, 0.0, -0.78087);
const LIGHT_UP: vec3<f32> = vec3<f32>(-0.49976, 0.76838, 0.39981);
const TOWARD_LIGHT: vec3<f32> = vec3<f32>(0.6, 0.64, -0.48);
const EXTENT: vec3<f32> = vec3<f32>(7.0, 7.0, 14.0);

const EYE: vec3<f32> = vec3<f32>(-0.6, 3.4, 6.0);
const FORWARD: vec3<f32> = vec3<f32>(0.0, -0.41036, -0.91192);
const UP: vec3<f32> = vec3<f32>(0.0, 0.91192, -0.41036);

struct Hit {
    distance: f32,
    normal: vec3<f32>,
    colour: vec3<f32>,
}

fn closer(hit: Hit, distance: f32, normal: vec3<f32>, colour: vec3<f32>) -> Hit {
    if (distance > 1e-3 && distance < hit.distance) {
        return Hit(distance, normal, colour);
    }
    return hit;
}

fn with_box(hit: Hit, origin: vec3<f32>, ray: vec3<f32>, centre: vec3<f32>, size: vec3<f32>) -> Hit {
    let middle = (centre - origin) / ray;
    let reach = 0.5 * size / abs(ray);
    let enters = middle - reach;
    let leaves = middle + reach;
    let enter = max(max(enters.x, enters.y), enters.z);
    let leave = min(min(leaves.x, leaves.y), leaves.z);
    if (enter > leave) {
        return hit;
    }
    let normal = -sign(ray) * select(vec3<f32>(0.0), vec3<f32>(1.0), enters == vec3<f32>(enter));
    return closer(hit, enter, normal, vec3<f32>(0.75, 0.5, 0.3));
}

fn with_ball(hit: Hit, origin: vec3<f32>, ray: vec3<f32>, centre: vec3<f32>, radius: f32) -> Hit {
    let to_centre = centre - origin;
    let along = dot(to_centre, ray);
    let across = to_centre - along * ray;
    let rest = radius * radius - dot(across, across);
    if (rest < 0.0) {
        return hit;
    }
    let distance = along - sqrt(rest);
    return closer(hit, distance, (distance * ray - to_centre) / radius, vec3<f32>(0.35, 0.55, 0.8));
}

// The nearest surface along a ray of length 1. The sky is at distance 1000.
fn trace(origin: vec3<f32>, ray: vec3<f32>) -> Hit {
    var hit = Hit(1000.0, vec3<f32>(0.0), vec3<f32>(0.0));
    hit = closer(hit, -origin.y / ray.y, vec3<f32>(0.0, 1.0, 0.0), vec3<f32>(0.7, 0.72, 0.68));
    for (var i = 0; i < 6; i += 1) {
        hit = with_box(hit, origin, ray, vec3<f32>(f32(i) * 0.6 - 4.0, 1.1, -0.5), vec3<f32>(0.16, 2.2, 0.16));
    }
    hit = with_box(hit, origin, ray, vec3<f32>(-2.5, 1.9, -0.5), vec3<f32>(3.6, 0.14, 0.2));
    hit = with_box(hit, origin, ray, vec3<f32>(2.6, 0.9, -1.6), vec3<f32>(1.4, 1.8, 1.4));
    return with_ball(hit, origin, ray, vec3<f32>(1.1, 1.0, 0.9), 0.7);
}

// The surface in the middle of a pixel; the sky's distance is beyond 100.
fn visible(pixel: vec2<u32>) -> Hit {
    return trace(EYE, ray_of(pixel));
}

fn ray_of(pixel: vec2<u32>) -> vec3<f32> {
    let size = vec2<f32>(SIZE);
    let at = (vec2<f32>(pixel) + 0.5 - 0.5 * size) / size.y;
    return normalize(FORWARD + vec3<f32>(at.x, 0.0, 0.0) - at.y * UP);
}

// Coordinates in the light's map and depth in it, all from 0 to 1.
fn in_light(world: vec3<f32>) -> vec3<f32> {
    let at = vec3<f32>(dot(world, LIGHT_RIGHT), -dot(world, LIGHT_UP), -dot(world, TOWARD_LIGHT));
    return 0.5 + 0.5 * at / EXTENT;
}

// The depth that the light sees at a place of its map.
fn light_depth(place: vec2<f32>) -> f32 {
    let at = EXTENT.xy * (2.0 * place - 1.0);
    let start = at.x * LIGHT_RIGHT - at.y * LIGHT_UP + EXTENT.z * TOWARD_LIGHT;
    return min(0.5 * trace(start, -TOWARD_LIGHT).distance / EXTENT.z, 1.0);
}

// Whether the light does not reach a surface: by a ray, without any map. 0.5 where the surface turns away
// from the light, which leaves it dark anyway.
fn in_shadow(world: vec3<f32>, normal: vec3<f32>) -> f32 {
    if (dot(normal, TOWARD_LIGHT) < 0.1) {
        return 0.5;
    }
    return f32(trace(world + 1e-3 * normal, TOWARD_LIGHT).distance < 100.0);
}

// A surface's colour with a shadow from 0 to 1, as four bytes.
fn shaded(hit: Hit, shadow: f32) -> u32 {
    if (hit.distance > 100.0) {
        return pack4x8unorm(vec4<f32>(0.62, 0.75, 0.9, 1.0));
    }
    let sun = max(dot(hit.normal, TOWARD_LIGHT), 0.0) * (1.0 - shadow);
    return pack4x8unorm(vec4<f32>(sqrt(hit.colour * (0.85 * sun + 0.12)), 1.0));
}
