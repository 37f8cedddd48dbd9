// Orders the particles of each cell by id, so that sums over them do not depend on which lane came
// first.
// One lane a cell sorts its part of the list by insertion: a cell has few.
//
// uses implicit/cells

@compute @workgroup_size(LANES)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let cell = item(group, groups, lane);
    if (cell >= min(report.blocks, params.capacity) * IN_BLOCK) {
        return;
    }
    let first = starts[cell];
    let end = starts[cell + 1u];
    for (var i = first + 1u; i < end; i++) {
        let moving_ = list[i];
        let id = tag_in[moving_].x;
        var at = i;
        while (at > first && tag_in[list[at - 1u]].x > id) {
            list[at] = list[at - 1u];
            at -= 1u;
        }
        list[at] = moving_;
    }
}
