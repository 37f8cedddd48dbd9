// Contact at the start of a frame, before p2g: what faces add to velocities.
// In: states by id. Out, threads: as touch.wgsl.
//
// uses explicit/touching, explicit/move, explicit/state_io

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let item = group_index(group, groups);
    let job = job_of(item);
    let corner = block_corner(job.at);
    let count = count_near(item, job, corner, lane, true);
    for (var i = lane; i < count; i += 64u) {
        let id = list[job.start + i];
        let y = bitcast<vec3<f32>>(frame_position[id].xyz);
        touch_particle(item, job.start + i, id, corner, y, y, load_velocity(id), 0.0, kick(report.step));
    }
    workgroupBarrier();
    flush_reactions(item, lane);
}
