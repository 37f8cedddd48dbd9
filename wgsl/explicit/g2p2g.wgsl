// Fused step: grid n → particles → grid n + 1 (after Wang et al. 2020). Velocity and B live in
// registers only.
// In: node velocities `_in`, particles `_in` through their bins. Out: particles `_out` in bin
// order, grid `_out`, and the destination (block slot, rank) of every particle for the next
// binning.
// One workgroup a work item, one lane a particle at a time; sums are integers in workgroup memory,
// then in the grid.
//
// unchecked: first_read and first_sum keep particles' nodes inside of the tiles
// uses explicit/advance, explicit/scatter_*, explicit/state_io, explicit/touched

var<workgroup> farthest: atomic<u32>; // of all particles (cells, f32 bits)

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let item = group_index(group, groups);
    let job = job_of(item);
    let corner = block_corner(job.at);
    open_gather(job, lane);
    open_scatter(job, lane);
    if (lane == 0u) {
        atomicStore(&farthest, 0u);
    }
    workgroupBarrier();
    load_nodes(lane);
    workgroupBarrier();
    var flags = no_flags();
    let next_kick = kick(report.step + 1u) / params.dx;
    for (var i = lane; i < job.count; i += WORKGROUP) {
        let to = job.start + i;
        let from_ = list[to];
        let packed = position_in[from_];
        let id = packed.w;
        let y = bitcast<vec3<f32>>(packed.xyz);
        let body = bodies[body_of[id]];
        let material = material_of(body);
        let g = gather(y);
        var principal: Principal;
        var at = moved(corner, y, g.v * (params.dt / params.dx));
        var kicked = g.v;
        if (TOUCHES && job.touched != 0u) {
            at = touched_offset(to);
            kicked += touched_kick(to);
        }
        let next = advance(corner, at, g, load_deformation(from_, material.model), body, material, id, params.dt,
            &principal, &flags);
        var destination = vec2<u32>(0xffffffffu, 0u);
        if (next.ok) {
            let stress = kirchhoff(next.state, principal, material, g.gradient * (1.0 / params.dx));
            flags.replan = flags.replan || stress.stiffening * body.demand > params.soft_demand;
            let impulse = stress.tau * (body.volume * next_kick);
            let cells = filled_cells(next.state, material.model, body);
            if (!scatter(id, next.y, body.mass, cells, kicked, g.B, impulse)) {
                note(&flags, ERROR_NAN, id);
            }
            let n = vec3<u32>(next.shift + vec3<i32>(1));
            let neighbour = min(n.x + 3u * n.y + 9u * n.z, 26u);
            if (slots_out[neighbour] == 0u) {
                note(&flags, ERROR_DOMAIN, id);
            } else {
                destination = vec2<u32>(neighbour, atomicAdd(&bin_counts[neighbour], 1u));
            }
        }
        position_out[to] = vec4<u32>(bitcast<vec3<u32>>(next.local), id);
        store_deformation(to, material.model, next.state);
        destinations[to] = destination;
    }
    // A comparison by bits orders numbers that are not negative.
    atomicMax(&farthest, bitcast<u32>(flags.farthest));
    tell(flags);
    workgroupBarrier();
    if (lane == 0u) {
        atomicMax(&report.max_shift, atomicLoad(&farthest));
    }
    flush_tile(lane);
    if (lane < 27u) {
        let arrivals = atomicLoad(&bin_counts[lane]);
        if (arrivals != 0u) {
            bin_bases[lane] = atomicAdd(&bins[slots_out[lane] - 1u], arrivals);
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
