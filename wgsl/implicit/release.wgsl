// Lets go of nodes that a separating surface pulls back instead of pushing (Boundary::release in
// src/engine/implicit/physics/boundary.rs), if `weigh` found that this is more than noise. One lane
// a dense node.
//
// uses implicit/pressure, shared/kernel_*

@compute @workgroup_size(LANES)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let at = item(group, groups, lane);
    if (at >= report.blocks * GRIDS * 64u || report.released == 0u) {
        return;
    }
    let row = row_of[at];
    if (row != NO_NODE && begin[at].w == 1.0 && pressure(touches[3u * at]) < 0.0) {
        begin[at].w = 0.0;
        freedom[at] = vec4<f32>(0.0, 0.0, 0.0, FREE);
        freedoms[row] = freedom[at];
    }
}
