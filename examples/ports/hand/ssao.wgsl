struct View {
    half: vec2f,
    radius: f32,
    bias: f32,
    strength: f32,
    edge: f32,
}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var depths: texture_2d<f32>;
@group(0) @binding(2) var light: texture_storage_2d<r32float, write>;

const SAMPLES = 12;
const TURN = mat2x2f(-0.7373689, 0.6754903, -0.6754903, -0.7373689);

fn place(at: vec2i, size: vec2f) -> vec3f {
    let depth = textureLoad(depths, at, 0).x;
    return vec3f(((vec2f(at) + 0.5) / size * 2 - 1) * view.half * depth, depth);
}

fn hash(x: u32) -> u32 {
    let state = x * 747796405 + 2891336453;
    let word = ((state >> ((state >> 28) + 4)) ^ state) * 277803737;
    return (word >> 22) ^ word;
}

@compute @workgroup_size(8, 8)
fn ssao(@builtin(global_invocation_id) id: vec3u) {
    let texels = textureDimensions(depths);
    if any(id.xy >= textureDimensions(light)) {
        return;
    }
    let size = vec2f(texels);
    let last = vec2i(texels) - 1;
    let at = vec2i(id.xy);
    let here = place(at, size);
    let east = place(vec2i(min(at.x + 1, last.x), at.y), size) - here;
    let west = here - place(vec2i(max(at.x - 1, 0), at.y), size);
    let south = place(vec2i(at.x, min(at.y + 1, last.y)), size) - here;
    let north = here - place(vec2i(at.x, max(at.y - 1, 0)), size);
    let is_east = at.x < last.x && (at.x == 0 || abs(east.z) < abs(west.z));
    let is_south = at.y < last.y && (at.y == 0 || abs(south.z) < abs(north.z));
    let normal = normalize(cross(select(north, south, is_south), select(west, east, is_east)));

    let reach = clamp(view.radius / here.z / view.half.x * 0.5 * size.x, 1, 64);
    let noise = hash(id.x + texels.x * id.y);
    let t = f32(noise >> 8) / 16777216;
    var direction = vec2f(1 - t * t, 2 * t) / (1 + t * t);
    if (noise & 1) == 1 {
        direction = -direction;
    }
    if (noise & 2) == 2 {
        direction = vec2f(-direction.y, direction.x);
    }
    var sum = 0.0;
    for (var i = 0; i < SAMPLES; i++) {
        let to = vec2f(id.xy) + 0.5 + direction * reach * sqrt((f32(i) + 0.5) / f32(SAMPLES));
        direction = TURN * direction;
        let towards = place(vec2i(clamp(to, vec2f(), size - 1)), size) - here;
        let square = dot(towards, towards);
        if square < view.radius * view.radius {
            sum += max(dot(towards, normal) - view.bias * here.z, 0) / (square + 1e-4);
        }
    }
    let occlusion = 2 * view.strength * view.radius / f32(SAMPLES) * sum;
    textureStore(light, id.xy, vec4f(max(1 - occlusion, 0)));
}
