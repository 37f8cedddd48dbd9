// Start of a frame: counts the particles of each block and gives every particle its place among
// them. One thread a particle.
// Places vary from run to run; no value depends on them.
//
// uses explicit/table

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) count: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let id = group_index(group, count) * WORKGROUP + lane;
    if (id >= params.live || !running()) {
        return;
    }
    let slot = slot_out(frame_position[id].w) - 1u;
    destinations[id] = vec2<u32>(slot, atomicAdd(&bins[slot], 1u));
}
