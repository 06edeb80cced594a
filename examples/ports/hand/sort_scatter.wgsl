@group(0) @binding(0) var<uniform> shift: u32;
@group(0) @binding(1) var<storage> keys: array<u32>;
@group(0) @binding(2) var<storage> values: array<u32>;
@group(0) @binding(3) var<storage> offsets: array<u32>;
@group(0) @binding(4) var<storage, read_write> sorted_keys: array<u32>;
@group(0) @binding(5) var<storage, read_write> sorted_values: array<u32>;

var<workgroup> block_keys: array<u32, 256>;
var<workgroup> block_values: array<u32, 256>;
var<workgroup> starts: array<u32, 16>;
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

fn digit(key: u32) -> u32 {
    return (key >> shift) & 15;
}

@compute @workgroup_size(256)
fn sort_scatter(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(local_invocation_index) me: u32,
    @builtin(workgroup_id) group: vec3u,
) {
    let n = arrayLength(&keys);
    var key = 0xffffffffu;
    var value = 0u;
    if id.x < n {
        key = keys[id.x];
        value = values[id.x];
    }
    for (var bit = 0u; bit < 4; bit++) {
        let one = (key >> (shift + bit)) & 1;
        let zeros = sum_before(me, 1 - one);
        let place = select(zeros, sums[255] + me - zeros, one == 1);
        block_keys[place] = key;
        block_values[place] = value;
        workgroupBarrier();
        key = block_keys[me];
        value = block_values[me];
    }
    let mine = digit(key);
    if me == 0 || mine != digit(block_keys[me - 1]) {
        starts[mine] = me;
    }
    workgroupBarrier();
    if id.x < n {
        let place = offsets[mine * ((n + 255) / 256) + group.x] + me - starts[mine];
        sorted_keys[place] = key;
        sorted_values[place] = value;
    }
}
