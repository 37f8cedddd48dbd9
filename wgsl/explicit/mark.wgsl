// Start of a frame: activates the blocks around every particle, as `activate` does from the bins
// that do not exist yet. If they do not all have a slot, the frame is not begun.
// One thread a particle.
//
// uses explicit/claim

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) count: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let id = group_index(group, count) * WORKGROUP + lane;
    if (id >= params.live) {
        return;
    }
    for (var i = 0u; i < 27u; i++) {
        let b = block_beside(frame_position[id].w, neighbour(i));
        if (b >= 0) {
            claim(u32(b));
        } else {
            fail(ERROR_DOMAIN, id);
        }
    }
}
