// The way of a particle at a trial Δv.
//
// uses implicit/nodes, implicit/particle

fn trial_velocity(n: vec3<i32>, grid: u32) -> vec3<f32> {
    let at = dense_node(n, grid);
    var v = vec3<f32>(0.0);
    if (at != NO_NODE) {
        v = moving[at].xyz;
        let row = row_of[at];
        if (row != NO_NODE) {
            v += vec3<f32>(trial[row], trial[params.stride + row], trial[2u * params.stride + row]);
        }
    }
    return v;
}

/// dt share Σ w v_i (m). Of differences to its first node's velocity: Σ w = 1 holds only to rounding.
fn trial_way(p: u32) -> vec3<f32> {
    var s = stencil(offset_of(p));
    let corner = 4 * block_coordinates(position[p].w);
    let first = trial_velocity(corner + s.base[0], 0u);
    var v = vec3<f32>(0.0);
    for (var grid = 0u; grid < GRIDS; grid++) {
        for (var k = 0u; k < NODES; k++) {
            for (var j = 0u; j < NODES; j++) {
                for (var i = 0u; i < NODES; i++) {
                    let w = s.w[grid][i].x * s.w[grid][j].y * s.w[grid][k].z;
                    let n = corner + s.base[grid] + vec3<i32>(vec3<u32>(i, j, k));
                    v += w * (trial_velocity(n, grid) - first);
                }
            }
        }
    }
    return params.dt * (first + GRID_SHARE * v);
}
