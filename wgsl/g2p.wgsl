// Last step of a frame: grid → particles, and full states by id for read-back and for the next frame's p2g.
// One workgroup a work item, one lane a particle at a time; every id is written by one lane.

@compute @workgroup_size(WORKGROUP)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let item = group_index(group, groups);
    var job = Work(0u, 0u, 0u, 0u);
    if (item < status.groups[GROUPS_WORK]) {
        job = work[item];
        if (item == 0u && lane == 0u) {
            status.finished = 1u;
        }
    }
    let corner = block_corner(job.block);
    open_gather(job.block, lane);
    workgroupBarrier();
    load_velocities(lane);
    workgroupBarrier();
    for (var i = lane; i < job.count; i += WORKGROUP) {
        let from_ = list[job.start + i];
        let packed = position_in[from_];
        let id = packed.w;
        let y = bitcast<vec3<f32>>(packed.xyz);
        let model = materials[bodies[body_of[id]].material].model;
        let g = gather(y);
        let next = advance(corner, y, g, load_deformation(from_, model), model, id);
        let block = block_index(block_coordinates(job.block) + next.shift);
        if (block < 0) {
            fail(ERROR_DOMAIN, id);
        }
        frame_position[id] = vec4<u32>(bitcast<vec3<u32>>(next.local), u32(max(block, 0)));
        for (var k = 0u; k < 3u; k++) {
            frame_velocity[k * params.particles + id] = g.v[k];
            frame_velocity[(3u + k) * params.particles + id] = g.B[0][k];
            frame_velocity[(6u + k) * params.particles + id] = g.B[1][k];
            frame_velocity[(9u + k) * params.particles + id] = g.B[2][k];
        }
        store_frame_deformation(id, model, next.state);
        // Bound on the speed of nodes around the particle, for the next plan: |v| + √3 dx |C|.
        let c = times_inverse_moment(g.B, next.local);
        atomicMax(&status.max_speed, bitcast<u32>(length(g.v) + 1.7320508 * sqrt(norm2(c))));
    }
}
