@group(0) @binding(0) var<storage, read> values: array<u32>;
@group(0) @binding(1) var<storage, read_write> result: array<u32>;

@compute @workgroup_size(1)
fn main() {
    var n = 0u;
    loop {
        let is_last = n == values[0];
        n += 1u;
        continuing {
            break if is_last;
        }
    }
    result[0] = n;
}
