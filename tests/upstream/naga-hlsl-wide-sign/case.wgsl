@group(0) @binding(0) var<storage> values: array<u64>;
@group(0) @binding(1) var<storage, read_write> result: array<i64>;

@compute @workgroup_size(1)
fn main() {
    result[0] = bitcast<i64>(values[0] * 3lu) >> 40u;
}
