@group(0) @binding(0) var<storage> numbers: array<u32>;
@group(0) @binding(1) var<storage, read_write> totals: array<u32>;
@group(0) @binding(2) var<storage, read_write> before: array<u32>;

var<workgroup> sums: array<u32, 256>;

// The sum of what the invocations before this one give.
fn sum_before(me: u32, mine: u32) -> u32 {
    var sum = mine;
    sums[me] = sum;
    for (var reach = 1u; reach < 256u; reach *= 2u) {
        workgroupBarrier();
        if me >= reach {
            sum += sums[me - reach];
        }
        workgroupBarrier();
        sums[me] = sum;
    }
    workgroupBarrier();
    return sum - mine;
}

@compute @workgroup_size(256)
fn scan_blocks(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(local_invocation_index) me: u32,
    @builtin(workgroup_id) group: vec3u,
) {
    var mine = 0u;
    if id.x < arrayLength(&numbers) {
        mine = numbers[id.x];
    }
    let sum = sum_before(me, mine);
    if me == 255 {
        totals[group.x] = sum + mine;
    }
    if id.x < arrayLength(&before) {
        before[id.x] = sum;
    }
}
