// b = R r, the children's residuals by their weights, and the first step from x = 0 of the coarse
// level's smoother: d = c D⁻¹ b, x = d.
// A thread a coarse row.
//
// uses implicit/linear/level, implicit/linear/vectors, implicit/linear/freedom

@group(0) @binding(0) var<uniform> fine: Level;
@group(0) @binding(1) var<uniform> level: Level;
@group(0) @binding(2) var<storage, read> children: array<u32>;
@group(0) @binding(3) var<storage, read> freedoms: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> fine_r: array<f32>;
@group(0) @binding(5) var<storage, read> inverse: array<f32>;
@group(0) @binding(6) var<storage, read> coefficient: vec4<f32>;
@group(0) @binding(7) var<storage, read_write> b: array<f32>;
@group(0) @binding(8) var<storage, read_write> d: array<f32>;
@group(0) @binding(9) var<storage, read_write> x_in: array<f32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) thread: vec3<u32>) {
    let row = thread.x;
    let n = level.stride;
    if (row >= level.rows) {
        return;
    }
    var sum = vec3<f32>();
    for (var child = 0u; child < 27u; child++) {
        let found = children[child * n + row];
        if (found == 0u) {
            continue;
        }
        let i = found - 1u;
        var value = vec3<f32>(fine_r[i], fine_r[fine.stride + i], fine_r[2u * fine.stride + i]);
        if (fine.sliding == 1u) {
            value = projected(freedoms[i], value);
        }
        let odd = vec3<u32>(vec3<u32>(child / 9u, child / 3u % 3u, child % 3u) != vec3<u32>(1u));
        sum += (1.0 / f32(1u << (odd.x + odd.y + odd.z))) * value;
    }
    let step = coefficient.y * inverse_times(row, sum);
    for (var a = 0u; a < 3u; a++) {
        b[a * n + row] = sum[a];
        d[a * n + row] = step[a];
        x_in[a * n + row] = step[a];
    }
}
