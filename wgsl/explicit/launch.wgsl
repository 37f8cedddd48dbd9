// Start of a frame: publishes the number of work items that the first binning made, for p2g. One
// thread.
//
// uses explicit/dispatch

@compute @workgroup_size(1)
fn main() {
    want(GROUPS_WORK, select(atomicLoad(&report.work_count), 0u, halted()));
}
