@group(0) @binding(0) var<uniform> shift: u32;
@group(0) @binding(1) var<storage> keys: array<u32>;
@group(0) @binding(2) var<storage, read_write> counts: array<u32>;

var<workgroup> bins: array<atomic<u32>, 16>;

@compute @workgroup_size(256)
fn sort_count(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(local_invocation_index) me: u32,
    @builtin(workgroup_id) group: vec3u,
) {
    if me < 16 {
        atomicStore(&bins[me], 0);
    }
    workgroupBarrier();
    let n = arrayLength(&keys);
    if id.x < n {
        atomicAdd(&bins[(keys[id.x] >> shift) & 15], 1);
    }
    workgroupBarrier();
    if me < 16 {
        counts[me * ((n + 255) / 256) + group.x] = atomicLoad(&bins[me]);
    }
}
