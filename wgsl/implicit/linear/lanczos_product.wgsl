// p' = z + β p, and A p'; neighbours' p' are computed where they are gathered. Rows as in
// product.wgsl; a partial sum of p'·Ap' a workgroup.
//
// uses implicit/linear/level, implicit/linear/lanczos, implicit/linear/product
// uses implicit/linear/reduce

@group(0) @binding(0) var<uniform> level: Level;
@group(0) @binding(1) var<storage, read> columns: array<u32>;
@group(0) @binding(2) var<storage, read> values: array<f32>;
@group(0) @binding(3) var<storage, read> z: array<f32>;
@group(0) @binding(4) var<storage, read> p: array<f32>;
@group(0) @binding(5) var<storage, read> lanczos: Lanczos;
@group(0) @binding(6) var<storage, read_write> p_next: array<f32>;
@group(0) @binding(7) var<storage, read_write> ap: array<f32>;
@group(0) @binding(8) var<storage, read_write> products: array<f32>;
@group(0) @binding(9) var<storage, read> anchors: array<f32>;

fn gathered(row: u32) -> vec3<f32> {
    let n = level.stride;
    let beta = lanczos.beta[lanczos.count - 1u];
    return vec3<f32>(z[row], z[n + row], z[2u * n + row]) + beta * vec3<f32>(p[row], p[n + row], p[2u * n + row]);
}

@compute @workgroup_size(256)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let n = level.stride;
    let row = group.x * ROWS + lane % ROWS;
    let y = product(row, lane, row < level.rows);
    var own = 0.0;
    if (lane < ROWS && row < level.rows) {
        let direction = gathered(row);
        for (var a = 0u; a < 3u; a++) {
            p_next[a * n + row] = direction[a];
            ap[a * n + row] = y[a];
        }
        own = dot(direction, y);
    }
    let total = summed(lane, own);
    if (lane == 0u) {
        products[group.x] = total;
    }
}
