// Zeroes the grid and the bin of every active block of the `_out` side. One workgroup a block.
//
// uses explicit/layout, shared/kernel_*

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) count: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let slot = group_index(id, count);
    if (slot >= report.groups[GROUPS_BLOCKS_OUT]) {
        return;
    }
    for (var i = lane; i < GRID_STRIDE * GRIDS; i += WORKGROUP) {
        atomicStore(&grid_out[slot * GRID_STRIDE * GRIDS + i], 0);
    }
    if (lane == 0u) {
        atomicStore(&bins[slot], 0u);
    }
}
