// Stiffness of the particles at a trial Δv, pushed forward: K[3a + e][3c + f] = share dt² V0 Σ
// (∂P_ab/∂F_cd) M_eb M_fd / dx², with M = Fⁿ, for MLS E⁻¹ Fⁿ, so that A_ij[a][c] = Σ K g_i[e]
// g_j[f]. share: twice the energy and half of each ∇v on the compact kernel's grids.
// `params.tangent` says at which F the derivative is taken.
// One workgroup a block, one lane a particle at a time.
//
// uses implicit/cells, implicit/particle, implicit/plastic, implicit/trial
// uses implicit/flowing_tangent, implicit/upper

/// The SVD of F at the step's end, or R(end) R(start)ᵀ start: the start's stretch, turned to the end.
fn decomposed(end: mat3x3<f32>, start: mat3x3<f32>, is_turned: bool) -> Svd {
    var F = end;
    if (is_turned) {
        F = start;
    }
    var s = fine_svd(F);
    if (is_turned) {
        s.u = polar_rotation(end) * s.v;
    }
    return s;
}

@compute @workgroup_size(LANES)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let slot = group_index(group, groups);
    let there = slot < report.blocks;
    if (there) {
        load_trial(slot, lane);
    }
    workgroupBarrier();
    if (!there) {
        return;
    }
    for (var p = starts[slot * IN_BLOCK] + lane; p < starts[(slot + 1u) * IN_BLOCK]; p += LANES) {
        let y = offset_of(p);
        let body = bodies[tag[p].y];
        let material = materials[body.material];
        let F = deformation_of(p);
        let flows = params.tangent == FLOWING && params.flowing != 0u && is_plastic(material.model);
        let at = decomposed(trial_deformation(p, y, F), F, params.tangent != TRIAL && !flows);
        let slopes = slopes_within(material, at.sigma, plastic_of(p, material.model), flows);
        let derivative = projected(at, slopes);
        var M = F;
        if (MLS) {
            // E is symmetric.
            M = transpose(times_inverse_arms(transpose(F), y));
        }
        let rate = params.dt / params.dx;
        let factor = GRID_SHARE * body.volume * rate * rate;
        for (var j = 0u; j < 9u; j++) {
            let c = j / 3u;
            let f = j % 3u;
            var dF: mat3x3<f32>;
            for (var d = 0u; d < 3u; d++) {
                dF[d][c] = M[d][f];
            }
            let column = projected_times(derivative, dF) * transpose(M);
            for (var i = 0u; i <= j; i++) {
                tensor[upper(i, j) * params.room + p] = factor * column[i % 3u][i / 3u];
            }
        }
    }
}
