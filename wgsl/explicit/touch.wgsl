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
    let job = job_of(item);
    let corner = block_corner(job.at);
    open_gather(job, lane);
    let count = count_near(item, job, corner, lane, true);
    for (var i = lane; i < count; i += 64u) {
        let packed = position_in[list[job.start + i]];
        let y = bitcast<vec3<f32>>(packed.xyz);
        let v = gather_velocity(y);
        let next = moved(corner, y, v * (params.dt / params.dx));
        touch_particle(item, job.start + i, packed.w, corner, y, next, v, params.dt, kick(report.step + 1u));
    }
    workgroupBarrier();
    flush_reactions(item, lane);
}
