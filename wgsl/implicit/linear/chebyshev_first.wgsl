// First step of a Chebyshev polynomial from x = 0: d = c D⁻¹ b, x = d. A thread a row.
//
// uses implicit/linear/level, implicit/linear/vectors

@group(0) @binding(0) var<uniform> level: Level;
@group(0) @binding(1) var<storage, read> inverse: array<f32>;
@group(0) @binding(2) var<storage, read> coefficient: vec4<f32>;
@group(0) @binding(3) var<storage, read> b: array<f32>;
@group(0) @binding(4) var<storage, read_write> d: array<f32>;
@group(0) @binding(5) var<storage, read_write> x_in: array<f32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) thread: vec3<u32>) {
    let row = thread.x;
    let n = level.stride;
    if (row >= level.rows) {
        return;
    }
    let step = coefficient.y * inverse_times(row, vec3<f32>(b[row], b[n + row], b[2u * n + row]));
    for (var a = 0u; a < 3u; a++) {
        d[a * n + row] = step[a];
        x_in[a * n + row] = step[a];
    }
}
