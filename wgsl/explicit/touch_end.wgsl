// Contact at the end of a frame, before g2p: where particles end.
// In, out, threads: as touch.wgsl, without forces, which the next frame's start has.
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
    let count = count_near(item, job, corner, lane, params.end_dt > 0.0);
    for (var i = lane; i < count; i += 64u) {
        let packed = position_in[list[job.start + i]];
        let y = bitcast<vec3<f32>>(packed.xyz);
        let v = gather_velocity(y);
        let next = moved(corner, y, v * (params.end_dt / params.dx));
        touch_particle(item, job.start + i, packed.w, corner, y, next, v, params.end_dt, 0.0);
    }
    workgroupBarrier();
    flush_reactions(item, lane);
}
