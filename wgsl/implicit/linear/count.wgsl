// Counts the marks of every 1024 entries of a table. A workgroup a sum.
//
// uses implicit/linear/level

@group(0) @binding(0) var<uniform> level: Level;
@group(0) @binding(1) var<storage, read> table: array<u32>;
@group(0) @binding(2) var<storage, read_write> sums: array<u32>;

var<workgroup> lanes: array<u32, 256>;

@compute @workgroup_size(256)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let last = entries(level);
    var sum = 0u;
    for (var k = 0u; k < 4u; k++) {
        let entry = group.x * 1024u + lane * 4u + k;
        if (entry < last) {
            sum += table[entry];
        }
    }
    lanes[lane] = sum;
    workgroupBarrier();
    for (var half = 128u; half > 0u; half /= 2u) {
        if (lane < half) {
            lanes[lane] += lanes[lane + half];
        }
        workgroupBarrier();
    }
    if (lane == 0u) {
        sums[group.x] = lanes[0];
    }
}
