// Vectors of the nodes that a block's particles touch, in workgroup memory: 6³ nodes of each grid.
//
// uses implicit/nodes, shared/mls

const TILE = 216u;

var<workgroup> tile: array<array<f32, 3>, TILE * GRIDS>;

fn tile_node(block: u32, t: u32) -> vec3<i32> {
    return 4 * block_coordinates(block) + vec3<i32>(vec3<u32>(t % 6u, (t / 6u) % 6u, t / 36u));
}

fn tile_at(n: vec3<i32>, grid: u32) -> vec3<f32> {
    let v = tile[grid * TILE + u32(n.x + 6 * (n.y + 6 * n.z))];
    return vec3<f32>(v[0], v[1], v[2]);
}

/// dx ∇v = share Σ v_i g_iᵀ at a particle. Of differences to its first node's vector: Σ g = 0 holds
/// only to rounding.
fn tile_gradient(y: vec3<f32>) -> mat3x3<f32> {
    var s = stencil(y);
    let first = tile_at(s.base[0], 0u);
    var out: mat3x3<f32>;
    for (var grid = 0u; grid < GRIDS; grid++) {
        let m = arms_mean(y, grid);
        for (var k = 0u; k < NODES; k++) {
            for (var j = 0u; j < NODES; j++) {
                for (var i = 0u; i < NODES; i++) {
                    let w = vec3<f32>(s.w[grid][i].x, s.w[grid][j].y, s.w[grid][k].z);
                    let n = vec3<u32>(i, j, k);
                    let v = GRID_SHARE * (tile_at(s.base[grid] + vec3<i32>(n), grid) - first);
                    var g: vec3<f32>;
                    if (MLS) {
                        g = (w.x * w.y * w.z) * (s.d[grid] - m + vec3<f32>(n));
                    } else {
                        g = vec3<f32>(s.dw[grid][i].x, s.dw[grid][j].y, s.dw[grid][k].z)
                            * vec3<f32>(w.y * w.z, w.x * w.z, w.x * w.y);
                    }
                    out += mat3x3<f32>(v * g.x, v * g.y, v * g.z);
                }
            }
        }
    }
    if (MLS) {
        out = times_inverse_arms(out, y);
    }
    return out;
}
