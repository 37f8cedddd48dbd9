// Contact at the start of a frame, before p2g: what faces add to velocities.
// In: states by id. Out, threads: as touch.wgsl.
//
// uses explicit/touching, explicit/move

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let item = group_index(group, groups);
    var job = Work(0u, 0u, 0u, 0u);
    if (item < report.groups[GROUPS_WORK]) {
        job = work[item];
    }
    let corner = block_corner(job.block);
    open_touching(lane);
    workgroupBarrier();
    look_around(corner, lane);
    workgroupBarrier();
    let near = atomicLoad(&close_by);
    if (lane == 0u && job.count > 0u) {
        work[item].touched = near;
    }
    if (near == 0u) {
        job.count = 0u;
    }
    for (var i = lane; i < job.count; i += 64u) {
        let id = list[job.start + i];
        let y = bitcast<vec3<f32>>(frame_position[id].xyz);
        var v: vec3<f32>;
        for (var k = 0u; k < 3u; k++) {
            v[k] = frame_velocity[k * params.particles + id];
        }
        touch_particle(item, job.start + i, id, corner, y, y, v, 0.0, kick(report.index));
    }
    workgroupBarrier();
    flush_reactions(item, lane);
}
