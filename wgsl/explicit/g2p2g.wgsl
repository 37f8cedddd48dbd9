// Fused step: grid n → particles → grid n + 1 (after Wang et al. 2020). Velocity and B live in
// registers only.
// In: node velocities `_in`, particles `_in` through their bins. Out: particles `_out` in bin
// order, grid `_out`, and the destination (block slot, rank) of every particle for the next
// binning.
// One workgroup a work item, one lane a particle at a time; sums are integers in workgroup memory,
// then in the grid.
//
// uses explicit/advance, explicit/state_io, explicit/touched

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let item = group_index(group, groups);
    let job = job_of(item);
    let corner = block_corner(job.block);
    open_gather(job.block, lane);
    open_scatter(job.block, lane);
    workgroupBarrier();
    load_nodes(lane);
    workgroupBarrier();
    for (var i = lane; i < job.count; i += WORKGROUP) {
        let to = job.start + i;
        let from_ = list[to];
        let packed = position_in[from_];
        let id = packed.w;
        let y = bitcast<vec3<f32>>(packed.xyz);
        let body = bodies[body_of[id]];
        let material = materials[body.material];
        let g = gather(y);
        var principal: Principal;
        var at = moved(corner, y, g.v * (params.dt / params.dx));
        var kicked = g.v;
        if (job.touched != 0u) {
            at = touched_offset(to);
            kicked += touched_kick(to);
        }
        let next = advance(corner, y, at, g, load_deformation(from_, material.model), body, id, params.dt, &principal);
        var destination = vec2<u32>(0xffffffffu, 0u);
        if (next.ok) {
            let stress = kirchhoff(next.state, principal, material, g.gradient * (1.0 / params.dx));
            if (stress.stiffening * body.demand > params.soft_demand) {
                atomicOr(&report.halt, HALT_REPLAN);
            }
            let impulse = stress.tau * (body.volume * kick(report.index + 1u) / params.dx);
            let cells = filled_cells(next.state, material.model, body);
            if (!scatter(id, next.y, body.mass, cells, kicked, g.B, impulse)) {
                fail(ERROR_NAN, id);
            }
            let n = vec3<u32>(next.shift + vec3<i32>(1));
            let neighbour = n.x + 3u * n.y + 9u * n.z;
            if (slots_out[neighbour] == 0u) {
                fail(ERROR_DOMAIN, id);
            } else {
                destination = vec2<u32>(neighbour, atomicAdd(&bin_counts[neighbour], 1u));
            }
        }
        position_out[to] = vec4<u32>(bitcast<vec3<u32>>(next.local), id);
        store_deformation(to, material.model, next.state);
        destinations[to] = destination;
    }
    workgroupBarrier();
    flush_tile(lane);
    for (var i = lane; i < 27u; i += WORKGROUP) {
        let arrivals = atomicLoad(&bin_counts[i]);
        if (arrivals != 0u) {
            bin_bases[i] = atomicAdd(&bins[slots_out[i] - 1u], arrivals);
        }
    }
    workgroupBarrier();
    for (var i = lane; i < job.count; i += WORKGROUP) {
        let d = destinations[job.start + i];
        if (d.x != 0xffffffffu) {
            destinations[job.start + i] = vec2<u32>(slots_out[d.x] - 1u, bin_bases[d.x] + d.y);
        }
    }
}
