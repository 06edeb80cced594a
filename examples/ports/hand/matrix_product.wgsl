struct Shape {
    size: vec2u,
    inner: u32,
    padding: u32,
}

@group(0) @binding(0) var<uniform> shape: Shape;
@group(0) @binding(1) var<storage> a: array<f32>;
@group(0) @binding(2) var<storage> b: array<f32>;
@group(0) @binding(3) var<storage, read_write> product: array<f32>;

const TILE = 16u;
var<workgroup> left: array<f32, TILE * TILE>;
var<workgroup> right: array<f32, TILE * TILE>;

@compute @workgroup_size(TILE, TILE)
fn matrix_product(
    @builtin(global_invocation_id) at: vec3u,
    @builtin(local_invocation_id) local: vec3u,
    @builtin(local_invocation_index) me: u32,
) {
    let columns = shape.size.x;
    let rows = shape.size.y;
    var sum = 0.0;
    for (var start = 0u; start < shape.inner; start += TILE) {
        let column = start + local.x;
        let row = start + local.y;
        var of_left = 0.0;
        if at.y < rows && column < shape.inner {
            of_left = a[at.y * shape.inner + column];
        }
        var of_right = 0.0;
        if row < shape.inner && at.x < columns {
            of_right = b[row * columns + at.x];
        }
        left[me] = of_left;
        right[me] = of_right;
        workgroupBarrier();
        for (var k = 0u; k < TILE; k++) {
            sum += left[local.y * TILE + k] * right[k * TILE + local.x];
        }
        workgroupBarrier();
    }
    if at.x < columns && at.y < rows {
        product[at.y * columns + at.x] = sum;
    }
}
