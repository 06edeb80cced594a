struct Grid {
    cells: vec3u,
    level: f32,
}

struct Triangle {
    a: vec4f,
    b: vec4f,
    c: vec4f,
}

@group(0) @binding(0) var<uniform> grid: Grid;
@group(0) @binding(1) var<storage> values: array<f32>;
@group(0) @binding(2) var<storage> table: array<vec2u>;
@group(0) @binding(3) var<storage, read_write> count: atomic<u32>;
@group(0) @binding(4) var<storage, read_write> triangles: array<Triangle>;

fn offset(corner: u32) -> vec3u {
    return vec3u(corner & 1, (corner >> 1) & 1, corner >> 2);
}

fn value(cell: vec3u) -> f32 {
    let points = grid.cells + 1;
    return values[cell.x + points.x * (cell.y + points.y * cell.z)];
}

fn point(cell: vec3u, edge: u32) -> vec4f {
    let u = edge & 1;
    let v = (edge >> 1) & 1;
    var start: vec3u;
    var axis: vec3u;
    if edge < 4 {
        start = vec3u(0, u, v);
        axis = vec3u(1, 0, 0);
    } else if edge < 8 {
        start = vec3u(u, 0, v);
        axis = vec3u(0, 1, 0);
    } else {
        start = vec3u(u, v, 0);
        axis = vec3u(0, 0, 1);
    }
    let a = value(cell + start);
    let b = value(cell + start + axis);
    return vec4f(vec3f(cell + start) + vec3f(axis) * (grid.level - a) / (b - a), 1);
}

fn edge_of(words: vec2u, i: u32) -> u32 {
    return (select(words.y, words.x, i < 8) >> (4 * (i & 7))) & 15;
}

@compute @workgroup_size(4, 4, 4)
fn marching_cubes(@builtin(global_invocation_id) cell: vec3u) {
    if any(cell >= grid.cells) {
        return;
    }
    var case_ = 0u;
    for (var corner = 0u; corner < 8; corner++) {
        case_ |= u32(value(cell + offset(corner)) < grid.level) << corner;
    }
    let words = table[case_];
    let number = min(words.y >> 28, 5);
    if number == 0 {
        return;
    }
    let first = atomicAdd(&count, number);
    for (var i = 0u; i < number && first + i < arrayLength(&triangles); i++) {
        triangles[first + i] = Triangle(
            point(cell, edge_of(words, 3 * i)),
            point(cell, edge_of(words, 3 * i + 1)),
            point(cell, edge_of(words, 3 * i + 2)),
        );
    }
}
