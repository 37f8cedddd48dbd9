// Copies the particles into their order, and C = B D⁻¹ beside them (CK-MPM eq. 22) for p2g. One
// lane a particle.
//
// uses implicit/particle, shared/kernel_*

@compute @workgroup_size(LANES)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let p = item(group, groups, lane);
    if (p >= params.particles) {
        return;
    }
    let i = list[p];
    position[p] = position_in[i];
    tag[p] = tag_in[i];
    for (var at = p; at < arrayLength(&state); at += params.room) {
        state[at] = state_in[at - p + i];
    }
    store_push(p, times_inverse_moment(affine_of(p), offset_of(p)));
}
