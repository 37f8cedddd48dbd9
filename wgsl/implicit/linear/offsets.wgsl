// Turns the counts of a table's parts into what comes before each, and their sum into the level's
// number of nodes. One workgroup.
//
// uses implicit/linear/level, shared/prefix

@group(0) @binding(0) var<uniform> level: Level;
@group(0) @binding(1) var<storage, read_write> sums: array<u32>;
@group(0) @binding(2) var<storage, read_write> total: array<u32, 1>;

@compute @workgroup_size(256)
fn main(@builtin(local_invocation_index) lane: u32) {
    let parts = (entries(level) + 1023u) / 1024u;
    var before = 0u;
    for (var first = 0u; first < parts; first += 256u) {
        let at = first + lane;
        let own = select(0u, sums[min(at, parts - 1u)], at < parts);
        let upto = inclusive(lane, own);
        if (at < parts) {
            sums[at] = before + upto - own;
        }
        before += lanes[255];
        workgroupBarrier();
    }
    if (lane == 0u) {
        total[0] = before;
    }
}
