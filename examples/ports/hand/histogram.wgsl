@group(0) @binding(0) var<storage> numbers: array<f32>;
@group(0) @binding(1) var<storage, read_write> counts: array<atomic<u32>>;

var<workgroup> bins: array<atomic<u32>, 256>;

@compute @workgroup_size(256)
fn histogram(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(local_invocation_index) me: u32,
) {
    atomicStore(&bins[me], 0);
    workgroupBarrier();
    if id.x < arrayLength(&numbers) {
        atomicAdd(&bins[u32(clamp(numbers[id.x] * 256, 0, 255))], 1);
    }
    workgroupBarrier();
    let count = atomicLoad(&bins[me]);
    if count > 0 {
        atomicAdd(&counts[me], count);
    }
}
