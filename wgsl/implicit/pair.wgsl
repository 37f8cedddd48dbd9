// Sums kept as an unevaluated pair (high, low) of floats, so that a sum over millions has the
// precision of its terms.
//
// uses implicit/layout

/// Knuth's two-sum, and the low parts beside it.
fn add_pairs(a: vec2<f32>, b: vec2<f32>) -> vec2<f32> {
    let s = a.x + b.x;
    let v = s - a.x;
    let e = (a.x - (s - v)) + (b.x - v) + (a.y + b.y);
    let high = s + e;
    return vec2<f32>(high, e - (high - s));
}

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
