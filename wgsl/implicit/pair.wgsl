// Sums over the lanes of a workgroup, as pairs.
//
// uses implicit/layout, shared/pairs

var<workgroup> lane_sums: array<vec2<f32>, LANES>;

/// Sum over the lanes of a workgroup, in a fixed order; for lane 0.
fn sum_lanes(mine: vec2<f32>, lane: u32) -> vec2<f32> {
    lane_sums[lane] = mine;
    for (var half = LANES / 2u; half > 0u; half /= 2u) {
        workgroupBarrier();
        if (lane < half) {
            lane_sums[lane] = add_pairs(lane_sums[lane], lane_sums[lane + half]);
        }
    }
    return lane_sums[0];
}
