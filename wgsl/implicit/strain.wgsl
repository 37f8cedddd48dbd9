// First half of the objective at a trial Δv: particles' energies V0 ψ(F), and what their stress
// brings to the nodes, dt V0 P Fⁿᵀ g_i.
// Out: A = dt V0 P Fⁿᵀ / dx in `push` (MLS: times E⁻¹), one energy a block in `partials`.
// One workgroup a block, one lane a particle at a time; energies are added up in a fixed order.
//
// uses implicit/cells, implicit/particle, implicit/plastic, implicit/trial, implicit/flowing
// uses implicit/pair

@compute @workgroup_size(LANES)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let slot = group_index(group, groups);
    let there = slot < report.blocks && control[0] == 0u;
    if (there) {
        load_trial(slot, lane);
    }
    workgroupBarrier();
    var sum = vec2<f32>(0.0);
    if (there) {
        for (var p = starts[slot * IN_BLOCK] + lane; p < starts[(slot + 1u) * IN_BLOCK]; p += LANES) {
            let y = offset_of(p);
            let body = bodies[tag[p].y];
            let material = materials[body.material];
            let F = deformation_of(p);
            var pk1: mat3x3<f32>;
            let end = trial_deformation(p, y, F);
            let density = energy_pk1(material, end, plastic_of(p, material.model), params.flowing != 0u, &pk1);
            // A forbidden state stays beyond all others, whatever the volume.
            let cost = select(f32(GRIDS) * body.volume * density, density, density >= FORBIDDEN);
            sum = add_pairs(sum, vec2<f32>(cost, 0.0));
            var A = (params.dt * body.volume / params.dx) * (pk1 * transpose(F));
            if (MLS) {
                A = times_inverse_arms(A, y);
            }
            store_push(p, A);
        }
    }
    let total = sum_lanes(sum, lane);
    if (there && lane == 0u) {
        partials[slot] = total;
    }
}
