// Step, first of two sequential points: publishes how many workgroups this step's stages need, or
// none once halted.
// One thread. Inputs: counts of the last step. Outputs: `dispatches`, `report.groups`, an empty
// `_out` block list.
//
// uses explicit/dispatch

@compute @workgroup_size(1)
fn main() {
    report.index = report.step;
    if (halted()) {
        for (var i = 0u; i < 8u; i++) {
            want(i, 0u);
        }
        return;
    }
    report.stale = min(atomicLoad(&blocks_out[0]), params.capacity);
    atomicStore(&blocks_out[0], 0u);
    want(GROUPS_STALE, (report.stale + WORKGROUP - 1u) / WORKGROUP);
    want(GROUPS_WORK, atomicLoad(&report.work_count));
    want(GROUPS_BLOCKS_IN, min(blocks_in[0], params.capacity));
}
