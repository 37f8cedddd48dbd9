// Step: activates, on the `_out` side, every block that a particle can scatter to within this step: the
// blocks that hold particles and their 26 neighbours, because a particle moves less than a cell. If
// they do not all have a slot, the step is not begun, and the host grows the grid.
// One workgroup a work item, one lane a neighbour. Blocks are claimed by compare-and-swap; which
// slot a block gets varies from run to run and has no influence on any value.
//
// uses explicit/claim

@compute @workgroup_size(32)
fn main(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) count: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let item = group_index(id, count);
    if (atomicLoad(&report.halt) != 0u || item >= report.work || lane >= 27u) {
        return;
    }
    let b = beside(work[item], neighbour(lane));
    if (b >= 0) {
        claim(u32(b));
    }
}
