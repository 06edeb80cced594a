@group(0) @binding(0) var<uniform> threshold: f32;
@group(0) @binding(1) var<storage> numbers: array<f32>;
@group(0) @binding(2) var<storage, read_write> count: atomic<u32>;
@group(0) @binding(3) var<storage, read_write> kept: array<f32>;

var<workgroup> base: u32;
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
fn compact_above(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(local_invocation_index) me: u32,
) {
    var number = 0.0;
    var wanted = 0u;
    if id.x < arrayLength(&numbers) {
        number = numbers[id.x];
        wanted = u32(number > threshold);
    }
    let before = sum_before(me, wanted);
    if me == 255 {
        base = atomicAdd(&count, before + wanted);
    }
    workgroupBarrier();
    if wanted == 1 {
        kept[base + before] = number;
    }
}
