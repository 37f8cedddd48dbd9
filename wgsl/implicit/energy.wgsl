// Adds up the energies of blocks, in a fixed order. One workgroup.
//
// uses implicit/pair, shared/kernel_*

@compute @workgroup_size(LANES)
fn main(@builtin(local_invocation_index) lane: u32) {
    var sum = vec2<f32>(0.0);
    for (var k = lane; k < report.blocks * (1u + GRIDS); k += LANES) {
        sum = add_pairs(sum, partials[k]);
    }
    let total = sum_lanes(sum, lane);
    if (lane == 0u && control[0] == 0u) {
        energy[0] = total.x;
        energy[1] = total.y;
    }
}
