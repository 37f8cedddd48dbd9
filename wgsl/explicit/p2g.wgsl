// Start of a frame: transfer from full particle states, p_i = Σ w (m v + m B D⁻¹ d) + dt f_i
// (CK-MPM eqs. 15–22).
// In: states by id, bins of ids. Out: grid `_out`; particles in bin order.
// One workgroup a work item, one lane a particle at a time; sums are integers in workgroup memory,
// then in the grid.
//
// uses explicit/scatter_*, explicit/fill, explicit/state_io, explicit/touched, explicit/flags

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let item = group_index(group, groups);
    let job = job_of(item);
    open_scatter(job, lane);
    workgroupBarrier();
    var flags = no_flags();
    for (var i = lane; i < job.count; i += WORKGROUP) {
        let to = job.start + i;
        let id = list[to];
        let y = bitcast<vec3<f32>>(frame_position[id].xyz);
        let body = bodies[body_of[id]];
        let material = material_of(body);
        let state = load_frame_deformation(id, material.model);
        var v = load_velocity(id);
        let B = load_affine(id);
        if (TOUCHES && job.touched != 0u) {
            v += touched_kick(to);
        }
        let grad_v = times_inverse_moment(B, y) * (1.0 / params.dx);
        let stress = kirchhoff(state, decompose(state, material.model), material, grad_v);
        let impulse = stress.tau * (body.volume * kick(report.step) / params.dx);
        if (!scatter(id, y, body.mass, filled_cells(state, material.model, body), v, B, impulse)) {
            note(&flags, ERROR_NAN, id);
        }
        position_out[to] = vec4<u32>(frame_position[id].xyz, id);
        store_deformation(to, material.model, state);
        list[to] = to;
    }
    tell(flags);
    workgroupBarrier();
    flush_tile(lane);
}
