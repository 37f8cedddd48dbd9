// Velocities of single particles from the grid, for few of them.
//
// uses explicit/neighbours

/// v = ½ Σ w v_i, as in `gather`, from the grid itself.
fn gather_velocity(y: vec3<f32>) -> vec3<f32> {
    let s = stencil(y);
    let first = velocity_in(0u, s.base[0]);
    var v = vec3<f32>(0.0);
    for (var grid = 0u; grid < GRIDS; grid++) {
        for (var k = 0u; k < NODES; k++) {
            for (var j = 0u; j < NODES; j++) {
                for (var i = 0u; i < NODES; i++) {
                    let w = GRID_SHARE * s.w[grid][i].x * s.w[grid][j].y * s.w[grid][k].z;
                    v += w * (velocity_in(grid, s.base[grid] + vec3<i32>(vec3<u32>(i, j, k))) - first);
                }
            }
        }
    }
    return v + first;
}

/// Of a node of the block or its upper neighbours; nodes of inactive blocks are at rest.
fn velocity_in(grid: u32, n: vec3<i32>) -> vec3<f32> {
    let high = vec3<u32>(n) >> vec3<u32>(2u);
    let slot = slots_in[high.x + 2u * high.y + 4u * high.z];
    if (slot == 0u) {
        return vec3<f32>(0.0);
    }
    let at = place_in(slot - 1u, grid, vec3<u32>(n) & vec3<u32>(3u));
    return bitcast<vec3<f32>>(vec3<i32>(grid_in[at + CHANNEL], grid_in[at + 2u * CHANNEL], grid_in[at + 3u * CHANNEL]));
}
