// Step or frame's start, after the transfer: what only concerns blocks.
// Of the `_out` side: turns the particle count of every block into the start of its bin, and lists the blocks that
// have particles as work. The order of bins is the order of arrival; no value depends on it.
// Of the `_in` side, which the next step will fill: zeroes the grid, and the block table.
// One workgroup a slot. `ran` is for those that come later: no other thread looks at it here.
//
// uses explicit/layout, shared/kernel_*

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) count: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let slot = group_index(id, count);
    let runs = running();
    if (slot == 0u && lane == 0u) {
        report.ran = u32(runs);
    }
    if (!runs || slot >= params.capacity) {
        return;
    }
    // Every slot has its share of the table.
    let entries = 1u << (32u - params.table_shift);
    let share = (entries + params.capacity - 1u) / params.capacity;
    for (var i = slot * share + lane; i < min((slot + 1u) * share, entries); i += 64u) {
        table_in[i] = vec2<u32>(0u);
    }
    if (slot < report.blocks) {
        let first = slot * GRID_STRIDE * GRIDS;
        for (var i = lane; i < GRID_STRIDE * GRIDS; i += 64u) {
            grid_in[first + i] = 0;
        }
    }
    if (lane == 0u && slot < atomicLoad(&report.wanted)) {
        open_bin(slot);
    }
}

fn open_bin(slot: u32) {
    let particles = atomicLoad(&bins[slot]);
    if (particles == 0u) {
        return;
    }
    let start = atomicAdd(&report.cursor, particles);
    atomicStore(&bins[slot], start);
    let items = (particles + WORK_MAX - 1u) / WORK_MAX;
    let first = atomicAdd(&report.work_count, items);
    let block = blocks_out[slot];
    let at = block_coordinates(block);
    for (var i = 0u; i < items; i++) {
        let count = min(WORK_MAX, particles - i * WORK_MAX);
        work[first + i] = Work(block, start + i * WORK_MAX, count, 0u, at, layer(block));
    }
}
