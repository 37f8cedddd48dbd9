// Counts the particles of each cell. One lane a particle; counts are integers, and the ranks that
// lanes get do not decide the order.
//
// uses implicit/cells

@compute @workgroup_size(LANES)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item(group, groups, lane);
    if (i >= params.particles) {
        return;
    }
    let at = position_in[i];
    let slot = table[at.w] - 1u;
    if (slot == NO_NODE) {
        // No slot was left; the host makes room and begins again.
        keys[i] = vec2<u32>(NO_NODE, 0u);
        return;
    }
    let key = slot * IN_BLOCK + cell_of(bitcast<vec3<f32>>(at.xyz));
    keys[i] = vec2<u32>(key, atomicAdd(&counts[key], 1u));
}
