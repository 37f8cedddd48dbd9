// Step, first of two sequential points: publishes how many workgroups this step's stages need, or none once halted.
// One thread. Inputs: counts of the last step. Outputs: `dispatches`, `status.groups`, an empty `_out` block list.

// Workgroup counts (x, y, z) of the indirect dispatches, 16 bytes apart; bound alone, because indirect arguments may not be
// bound as storage in the dispatch that reads them.
@group(1) @binding(0) var<storage, read_write> dispatches: array<vec4<u32>>;

@compute @workgroup_size(1)
fn main() {
    status.index = status.step;
    if (halted()) {
        for (var i = 0u; i < 8u; i++) {
            want(i, 0u);
        }
        return;
    }
    status.stale = min(atomicLoad(&blocks_out[0]), params.capacity);
    atomicStore(&blocks_out[0], 0u);
    want(GROUPS_STALE, (status.stale + WORKGROUP - 1u) / WORKGROUP);
    want(GROUPS_WORK, atomicLoad(&status.work_count));
    want(GROUPS_BLOCKS_IN, min(blocks_in[0], params.capacity));
}
