// Δv in the tile, and a particle's F there.
//
// uses implicit/tile

fn load_trial(slot: u32, lane: u32) {
    for (var t = lane; t < TILE * GRIDS; t += LANES) {
        let at = dense_node(tile_node(block_list[slot], t % TILE), t / TILE);
        var row = NO_NODE;
        if (at != NO_NODE) {
            row = row_of[at];
        }
        tile[t] = array<f32, 3>(0.0, 0.0, 0.0);
        if (row != NO_NODE) {
            tile[t] = array<f32, 3>(trial[row], trial[params.stride + row], trial[2u * params.stride + row]);
        }
    }
}

/// F at the trial: predicted + dt ∇(Δv) Fⁿ.
fn trial_deformation(p: u32, y: vec3<f32>, F: mat3x3<f32>) -> mat3x3<f32> {
    var next: mat3x3<f32>;
    for (var c = 0u; c < 3u; c++) {
        for (var r = 0u; r < 3u; r++) {
            next[c][r] = predicted[(3u * c + r) * params.room + p];
        }
    }
    return next + (params.dt / params.dx) * (tile_gradient(y) * F);
}
