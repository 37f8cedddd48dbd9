// The nodes' velocities at the step's end: what they had, or what is prescribed, and Δv. One lane a
// dense node.
//
// uses implicit/layout, shared/kernel_*

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
    if (row != NO_NODE) {
        moving[at] += vec4<f32>(dv[row], dv[params.stride + row], dv[2u * params.stride + row], 0.0);
    }
}
