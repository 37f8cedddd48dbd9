// A step of a Chebyshev polynomial of D⁻¹A: d ← c₁ d + c₂ D⁻¹ (b − A x), x' = x + d. Rows as in
// product.wgsl; x is read, x' written elsewhere.
//
// uses implicit/linear/level, implicit/linear/vectors, implicit/linear/product

@group(0) @binding(0) var<uniform> level: Level;
@group(0) @binding(1) var<storage, read> columns: array<u32>;
@group(0) @binding(2) var<storage, read> values: array<f32>;
@group(0) @binding(3) var<storage, read> inverse: array<f32>;
@group(0) @binding(4) var<storage, read> coefficient: vec4<f32>;
@group(0) @binding(5) var<storage, read> b: array<f32>;
@group(0) @binding(6) var<storage, read> x_in: array<f32>;
@group(0) @binding(7) var<storage, read_write> d: array<f32>;
@group(0) @binding(8) var<storage, read_write> x_out: array<f32>;
@group(0) @binding(9) var<storage, read> anchors: array<f32>;

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
    let r = vec3<f32>(b[row], b[n + row], b[2u * n + row]) - ax;
    let update = coefficient.y * inverse_times(row, r);
    for (var a = 0u; a < 3u; a++) {
        // The first step of a polynomial has c₁ = 0, whatever d was.
        let step = select(0.0, coefficient.x * d[a * n + row], coefficient.x != 0.0) + update[a];
        d[a * n + row] = step;
        x_out[a * n + row] = x_in[a * n + row] + step;
    }
}
