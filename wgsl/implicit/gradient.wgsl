// Second half of the objective: ∇E_i = S (m_i (Δv_i - dt g) + dt Σ V0 P Fⁿᵀ g_i), and the nodes'
// energies m (½ |Δv|² - dt g·Δv); with friction where it is known how strong.
// One workgroup a block and grid, one lane a node, which gathers in the order of the particles.
//
// uses implicit/cells, implicit/particle, implicit/shape, implicit/freedom, implicit/friction
// uses implicit/pair

@compute @workgroup_size(LANES)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let k = group_index(group, groups);
    let there = k < report.blocks * GRIDS && control[0] == 0u;
    var row = NO_NODE;
    if (there) {
        row = row_of[k * 64u + lane];
    }
    var sum = vec2<f32>(0.0);
    if (row != NO_NODE) {
        let grid = k % GRIDS;
        let n = node_of(block_list[k / GRIDS], lane);
        var force = vec3<f32>(0.0);
        for (var r = 0u; r < RUNS; r++) {
            let from_ = run(n, grid, r);
            for (var p = from_.first; p < from_.end; p++) {
                force += push_of(p) * shape(offset_of(p), n - from_.corner, grid).g;
            }
        }
        let change = vec3<f32>(trial[row], trial[params.stride + row], trial[2u * params.stride + row]);
        let fall = params.dt * params.gravity;
        let v = node[k * 64u + lane].xyz + change;
        let kept = u32(begin[k * 64u + lane].w);
        for (var t = 0u; t < kept; t++) {
            let touch = touches[3u * (k * 64u + lane) + t];
            if (touch.impulse.w > 0.0) {
                force += drag_gradient(touch, v);
                sum = add_pairs(sum, vec2<f32>(drag_energy(touch, v), 0.0));
            }
        }
        let total = projection(freedoms[row]) * (masses[row] * (change - fall) + force);
        for (var a = 0u; a < 3u; a++) {
            gradient[a * params.stride + row] = total[a];
        }
        sum = add_pairs(sum, vec2<f32>(masses[row] * dot(change, 0.5 * change - fall), 0.0));
    }
    let total = sum_lanes(sum, lane);
    if (there && lane == 0u) {
        partials[report.blocks + k] = total;
    }
}
