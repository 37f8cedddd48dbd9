// End of a frame: grid → particles (without motion if frames begin and end with half a step's
// forces), and full states by id for read-back and for the next
// frame's p2g.
// Particles that share no node with another are reset (Bai & Schroeder §5; twin:
// src/engine/explicit/cpu/isolated.rs).
// One workgroup a work item, one lane a particle at a time; every id is written by one lane.
//
// uses explicit/advance, explicit/state_io, explicit/touched

/// Others may add this share to Σ w m_i before a particle counts as accompanied.
const ALONE = 1e-4;

/// Whether all mass on a particle's nodes is its own: ½ Σ_s Σ_i w m_i is then m ½ Σ_s Σ_i w².
fn is_alone(y: vec3<f32>, mass: f32) -> bool {
    let s = stencil(y);
    var found = 0.0;
    var own = 0.0;
    for (var grid = 0u; grid < GRIDS; grid++) {
        for (var k = 0u; k < NODES; k++) {
            for (var j = 0u; j < NODES; j++) {
                for (var i = 0u; i < NODES; i++) {
                    let w = s.w[grid][i].x * s.w[grid][j].y * s.w[grid][k].z;
                    found += w * node_mass(grid, s.base[grid] + vec3<i32>(vec3<u32>(i, j, k)));
                    own += w * w;
                }
            }
        }
    }
    return found < own * mass * (1.0 + ALONE);
}

/// [ω] for which [ω] D has the angular momentum of B: (tr D I - D) ω = L.
fn rotation_of(B: mat3x3<f32>, y: vec3<f32>) -> mat3x3<f32> {
    let D = times_moment(mat3x3<f32>(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0), y);
    let t = D[0].x + D[1].y + D[2].z;
    let inertia = mat3x3<f32>(t, 0.0, 0.0, 0.0, t, 0.0, 0.0, 0.0, t) - D;
    let momentum = vec3<f32>(B[1].z - B[2].y, B[2].x - B[0].z, B[0].y - B[1].x);
    let w = (cofactor(inertia) * momentum) / determinant(inertia);
    return mat3x3<f32>(0.0, w.z, -w.y, -w.z, 0.0, w.x, w.y, -w.x, 0.0);
}

/// Whether particles of other sides may share nodes with those of a block.
fn is_accompanied(block: u32) -> bool {
    var other = false;
    for (var k = 0u; k < params.fields * params.sided; k++) {
        let there = block - layer(block) + k * layer_size();
        other = other || (there != block && slot_in(there) != 0u);
    }
    return other;
}

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let item = group_index(group, groups);
    let job = job_of(item);
    if (item == 0u && lane == 0u && job.count > 0u) {
        report.finished = 1u;
    }
    let corner = block_corner(job.at);
    open_gather(job, lane);
    workgroupBarrier();
    load_nodes(lane);
    workgroupBarrier();
    let accompanied = is_accompanied(job.block);
    var flags = no_flags();
    for (var i = lane; i < job.count; i += WORKGROUP) {
        let to = job.start + i;
        let from_ = list[to];
        let packed = position_in[from_];
        let id = packed.w;
        let y = bitcast<vec3<f32>>(packed.xyz);
        let body = bodies[body_of[id]];
        let material = material_of(body);
        var g = gather(y);
        var principal: Principal;
        let before = load_deformation(from_, material.model);
        var at = moved(corner, y, g.v * (params.end_dt / params.dx));
        if (TOUCHES && job.touched != 0u) {
            at = touched_offset(to);
            g.v += touched_kick(to);
        }
        var next = advance(corner, at, g, before, body, material, id, params.end_dt, &principal, &flags);
        if (next.ok && params.resets != 0u && !accompanied && is_alone(y, body.mass)) {
            atomicAdd(&report.isolated, 1u);
            next.state.F = mat3x3<f32>(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
            next.state.J = 1.0;
            principal = decompose(next.state, material.model);
            g.B = times_moment(rotation_of(g.B, next.local), next.local);
        }
        let block = beside(job, next.shift);
        if (block < 0) {
            note(&flags, ERROR_DOMAIN, id);
        }
        frame_position[id] = vec4<u32>(bitcast<vec3<u32>>(next.local), u32(max(block, 0)));
        store_motion(id, g.v, g.B);
        store_frame_deformation(id, material.model, next.state);
        let stress = kirchhoff(next.state, principal, material, g.gradient * (1.0 / params.dx));
        // A comparison by bits orders numbers that are not negative; NaN shows in the next step.
        atomicMax(&report.max_demand, bitcast<u32>(body.demand * max(1.0, stress.stiffening)));
        // Bound on the speed of nodes around the particle, for the next plan: |v| + √3 dx |C|.
        let c = times_inverse_moment(g.B, next.local);
        atomicMax(&report.max_speed, bitcast<u32>(length(g.v) + 1.7320508 * sqrt(norm2(c))));
    }
    atomicMax(&report.max_shift, bitcast<u32>(flags.farthest));
    tell(flags);
}
