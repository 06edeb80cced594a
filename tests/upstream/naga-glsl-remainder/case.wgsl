@group(0) @binding(0) var<storage> values: array<i32>;
@group(0) @binding(1) var<storage, read_write> result: array<i32>;

@compute @workgroup_size(1)
fn main() {
    result[0] = values[0] % 7i;
}
