// Adds up the energies of blocks, and of faces at particles, in a fixed order. One workgroup.
//
// uses implicit/pair, shared/kernel_*

@compute @workgroup_size(LANES)
fn main(@builtin(local_invocation_index) lane: u32) {
    var sum = vec2<f32>(0.0);
    let parts = report.blocks * (1u + GRIDS) + (params.links + LANES - 1u) / LANES;
    for (var k = lane; k < parts; k += LANES) {
        sum = add_pairs(sum, partials[k]);
    }
    let total = sum_lanes(sum, lane);
    if (lane == 0u && control[0] == 0u) {
        energy[0] = total.x;
        energy[1] = total.y;
    }
}
