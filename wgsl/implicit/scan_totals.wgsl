// Sums before each chunk, in place. One workgroup goes through the chunks, 256 at a time.

@group(0) @binding(0) var<storage, read_write> entries: array<u32>;
@group(0) @binding(2) var<storage, read_write> totals: array<u32>;

const LANES = 256u;

var<workgroup> sums: array<u32, LANES>;

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
        sums[lane] = mine;
        for (var reach = 1u; reach < LANES; reach *= 2u) {
            workgroupBarrier();
            var left = 0u;
            if (lane >= reach) {
                left = sums[lane - reach];
            }
            workgroupBarrier();
            sums[lane] += left;
        }
        workgroupBarrier();
        if (i < n) {
            totals[i] = carry + sums[lane] - mine;
        }
        carry += sums[LANES - 1u];
        workgroupBarrier();
    }
}
