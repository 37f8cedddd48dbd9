// r = b − A x. Rows as in product.wgsl.
//
// uses implicit/linear/level, implicit/linear/product

@group(0) @binding(0) var<uniform> level: Level;
@group(0) @binding(1) var<storage, read> columns: array<u32>;
@group(0) @binding(2) var<storage, read> values: array<f32>;
@group(0) @binding(3) var<storage, read> b: array<f32>;
@group(0) @binding(4) var<storage, read> x_in: array<f32>;
@group(0) @binding(5) var<storage, read_write> r: array<f32>;
@group(0) @binding(6) var<storage, read> anchors: array<f32>;

fn gathered(row: u32) -> vec3<f32> {
    return vec3<f32>(x_in[row], x_in[level.stride + row], x_in[2u * level.stride + row]);
}

@compute @workgroup_size(256)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let n = level.stride;
    let row = group.x * ROWS + lane % ROWS;
    let ax = product(row, lane, row < level.rows);
    if (lane >= ROWS || row >= level.rows) {
        return;
    }
    for (var a = 0u; a < 3u; a++) {
        r[a * n + row] = b[a * n + row] - ax[a];
    }
}
