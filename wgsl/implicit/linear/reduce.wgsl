// Sums over a level in two passes and in a fixed order: every workgroup of 256 leaves a partial
// sum, and whoever needs the whole adds these up.

var<workgroup> lanes: array<f32, 256>;

// The workgroup's sum, known to all of its lanes, all of which must call.
fn summed(lane: u32, value: f32) -> f32 {
    lanes[lane] = value;
    workgroupBarrier();
    for (var half = 128u; half > 0u; half /= 2u) {
        if (lane < half) {
            lanes[lane] += lanes[lane + half];
        }
        workgroupBarrier();
    }
    let total = lanes[0];
    workgroupBarrier();
    return total;
}
