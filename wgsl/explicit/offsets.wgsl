// Turns the particle count of every block into the start of its bin, and lists the blocks that have
// particles as work.
// One thread a slot. The order of bins is the order of arrival; no value depends on it.
//
// uses explicit/layout

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) count: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let slot = group_index(id, count) * WORKGROUP + lane;
    if (slot >= report.groups[GROUPS_BLOCKS_OUT]) {
        return;
    }
    let particles = atomicLoad(&bins[slot]);
    if (particles == 0u) {
        return;
    }
    let start = atomicAdd(&report.cursor, particles);
    atomicStore(&bins[slot], start);
    let items = (particles + WORK_MAX - 1u) / WORK_MAX;
    let first = atomicAdd(&report.work_count, items);
    let block = atomicLoad(&blocks_out[slot + 1u]);
    let at = block_coordinates(block);
    for (var i = 0u; i < items; i++) {
        let count = min(WORK_MAX, particles - i * WORK_MAX);
        work[first + i] = Work(block, start + i * WORK_MAX, count, 0u, at, layer(block));
    }
}
