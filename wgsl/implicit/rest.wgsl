// Another start, where free fall is a state that a material forbids: nodes at rest in the
// directions in which they may move.
// One lane a dense node; each row is written by one.
//
// uses implicit/freedom, shared/kernel_*

@compute @workgroup_size(LANES)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let at = item(group, groups, lane);
    if (at >= report.blocks * GRIDS * 64u) {
        return;
    }
    let row = row_of[at];
    if (row == NO_NODE) {
        return;
    }
    let v = begin[at].xyz;
    let change = v - projection(freedom[at]) * v - node[at].xyz;
    for (var a = 0u; a < 3u; a++) {
        dv[a * params.stride + row] = change[a];
    }
}
