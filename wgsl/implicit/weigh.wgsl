// Whether separating surfaces together pull more than PULL of their push, and whether any surface
// has friction. One workgroup, in a fixed order.
//
// uses implicit/layout, shared/kernel_*

/// Pull of separating surfaces, as a part of their push, that a step may keep.
const PULL = 0.05;

var<workgroup> sums: array<vec3<f32>, LANES>;

@compute @workgroup_size(LANES)
fn main(@builtin(local_invocation_index) lane: u32) {
    var sum = vec3<f32>(0.0);
    for (var k = lane; k < report.blocks * GRIDS; k += LANES) {
        sum += presses[k].xyz;
    }
    sums[lane] = sum;
    for (var half = LANES / 2u; half > 0u; half /= 2u) {
        workgroupBarrier();
        if (lane < half) {
            sums[lane] += sums[lane + half];
        }
    }
    if (lane == 0u) {
        report.released = select(0u, 1u, sums[0].y > PULL * sums[0].x);
        report.rubbing = select(0u, 1u, sums[0].z > 0.0);
    }
}
