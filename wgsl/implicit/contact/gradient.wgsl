// What faces add to the gradient, ∇E_i −= S dt Σ w f.
// One workgroup a block and grid, one lane a node, which gathers in the order of the particles.
//
// uses implicit/contact/pressed, implicit/freedom

var<workgroup> near: atomic<u32>;

@compute @workgroup_size(LANES)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let k = group_index(group, groups);
    let there = k < report.blocks * GRIDS && control[0] == 0u;
    if (lane == 0u) {
        atomicStore(&near, 0u);
    }
    workgroupBarrier();
    if (there && lane < 8u && is_touched(k / GRIDS, lane)) {
        atomicStore(&near, 1u);
    }
    workgroupBarrier();
    if (!there || atomicLoad(&near) == 0u) {
        return;
    }
    let row = row_of[k * LANES + lane];
    if (row == NO_NODE) {
        return;
    }
    let force = projection(freedoms[row]) * pressed(node_of(block_list[k / GRIDS], lane), k % GRIDS);
    for (var a = 0u; a < 3u; a++) {
        gradient[a * params.stride + row] -= params.dt * force[a];
    }
}
