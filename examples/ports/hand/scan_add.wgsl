@group(0) @binding(0) var<storage, read_write> numbers: array<u32>;
@group(0) @binding(1) var<storage> before: array<u32>;

@compute @workgroup_size(256)
fn scan_add(@builtin(global_invocation_id) id: vec3u) {
    if id.x < arrayLength(&numbers) {
        numbers[id.x] += before[id.x / 256];
    }
}
