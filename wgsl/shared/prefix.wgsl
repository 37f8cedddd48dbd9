// Inclusive prefix sums over the lanes of a workgroup of 256.

var<workgroup> lanes: array<u32, 256>;

fn inclusive(lane: u32, value: u32) -> u32 {
    lanes[lane] = value;
    workgroupBarrier();
    for (var reach = 1u; reach < 256u; reach *= 2u) {
        var below = 0u;
        if (lane >= reach) {
            below = lanes[lane - reach];
        }
        workgroupBarrier();
        lanes[lane] += below;
        workgroupBarrier();
    }
    return lanes[lane];
}
