@group(0) @binding(0) var<storage, read_write> values: array<f64>;

@compute @workgroup_size(1)
fn main() {
    values[0] = sqrt(values[0]);
    values[1] = floor(values[1]);
}
