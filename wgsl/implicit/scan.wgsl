// Sums before each entry, within chunks of 2048, and the chunks' totals. 256 lanes of 8 entries
// each; a lane reads and writes its own.
//
// uses shared/prefix

@group(0) @binding(0) var<storage, read_write> entries: array<u32>;
@group(0) @binding(1) var<storage, read_write> before: array<u32>; // one more than `entries`
@group(0) @binding(2) var<storage, read_write> totals: array<u32>;

const LANES = 256u;
const EACH = 8u;

@compute @workgroup_size(LANES)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let chunk = group.y * groups.x + group.x;
    let n = arrayLength(&entries);
    let first = (chunk * LANES + lane) * EACH;
    var mine = 0u;
    for (var i = first; i < min(first + EACH, n); i++) {
        mine += entries[i];
    }
    let upto = inclusive(lane, mine);
    var sum = upto - mine;
    for (var i = first; i < min(first + EACH, n); i++) {
        before[i] = sum;
        sum += entries[i];
    }
    if (first < n && first + EACH >= n) {
        before[n] = sum;
    }
    if (lane == LANES - 1u && chunk < arrayLength(&totals)) {
        totals[chunk] = upto;
    }
}
