// Contact with colliders between two grids: where particles end, and what faces add to their velocities.
// In: node velocities `_in`, particles `_in`, poses of colliders before and after. Out: springs, what
// g2p2g shall know, what colliders took.
// One workgroup a work item, one lane a particle at a time; every particle is written by one lane.
//
// uses explicit/touching, explicit/move, explicit/velocity

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
    open_gather(job.block, lane);
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
        let packed = position_in[list[job.start + i]];
        let y = bitcast<vec3<f32>>(packed.xyz);
        let v = gather_velocity(y);
        let next = moved(corner, y, v * (params.dt / params.dx));
        touch_particle(item, job.start + i, packed.w, corner, y, next, v, params.dt, kick(report.index + 1u));
    }
    workgroupBarrier();
    flush_reactions(item, lane);
}
