// Sums before each chunk, in place. One workgroup goes through the chunks, 256 at a time.
//
// uses shared/prefix

@group(0) @binding(0) var<storage, read_write> entries: array<u32>;
@group(0) @binding(2) var<storage, read_write> totals: array<u32>;

const LANES = 256u;

@compute @workgroup_size(LANES)
fn main(@builtin(local_invocation_index) lane: u32) {
    let n = (arrayLength(&entries) + 2047u) / 2048u;
    var carry = 0u;
    for (var first = 0u; first < n; first += LANES) {
        let i = first + lane;
        var mine = 0u;
        if (i < n) {
            mine = totals[i];
        }
        let upto = inclusive(lane, mine);
        if (i < n) {
            totals[i] = carry + upto - mine;
        }
        carry += lanes[LANES - 1u];
        workgroupBarrier();
    }
}
