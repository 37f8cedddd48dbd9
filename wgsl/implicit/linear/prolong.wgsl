// x ← x + P e, e the coarse correction. A thread a fine row.
//
// uses implicit/linear/level, implicit/linear/freedom

@group(0) @binding(0) var<uniform> fine: Level;
@group(0) @binding(1) var<uniform> coarse: Level;
@group(0) @binding(2) var<storage, read> fine_parents: array<u32>;
@group(0) @binding(3) var<storage, read> freedoms: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> x_in: array<f32>;
@group(0) @binding(5) var<storage, read_write> fine_x_in: array<f32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) thread: vec3<u32>) {
    let row = thread.x;
    if (row >= fine.rows) {
        return;
    }
    var sum = vec3<f32>();
    var count = 0.0;
    for (var k = 0u; k < 8u; k++) {
        let j = fine_parents[k * fine.stride + row];
        if (j != NONE) {
            sum += vec3<f32>(x_in[j], x_in[coarse.stride + j], x_in[2u * coarse.stride + j]);
            count += 1.0;
        }
    }
    sum /= count;
    if (fine.sliding == 1u) {
        sum = projected(freedoms[row], sum);
    }
    for (var a = 0u; a < 3u; a++) {
        fine_x_in[a * fine.stride + row] += sum[a];
    }
}
