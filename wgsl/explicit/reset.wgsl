// Deactivates the blocks of the previous use of the `_out` side. One thread a slot; each writes its
// own table entry.
//
// uses explicit/layout

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) count: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let slot = group_index(id, count) * WORKGROUP + lane;
    if (slot < report.stale) {
        atomicStore(&table_out[atomicLoad(&blocks_out[slot + 1u])], 0u);
    }
}
