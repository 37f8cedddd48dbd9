// Step, second sequential point: after activation, either all slots fit and the step is begun, or
// it is not begun at all and the host grows the grid. One thread. Outputs: `dispatches`, `report`.
//
// uses explicit/dispatch

@compute @workgroup_size(1)
fn main() {
    let wanted = atomicLoad(&blocks_out[0]);
    report.needed = max(report.needed, wanted);
    if (wanted > params.capacity) {
        atomicOr(&report.halt, HALT_BLOCKS);
    }
    if (halted()) {
        for (var i = 0u; i < 8u; i++) {
            want(i, 0u);
        }
        return;
    }
    want(GROUPS_BLOCKS_OUT, wanted);
    want(GROUPS_SLOTS_OUT, (wanted + WORKGROUP - 1u) / WORKGROUP);
    want(GROUPS_PARTICLES, (params.live + WORKGROUP - 1u) / WORKGROUP);
    atomicStore(&report.work_count, 0u);
    atomicStore(&report.cursor, 0u);
    report.step += 1u;
}
