// x ← x + P e, e the coarse correction. A thread a fine row.

@group(0) @binding(0) var<uniform> fine: Level;
@group(0) @binding(1) var<uniform> coarse: Level;
@group(0) @binding(2) var<storage, read> parents: array<u32>;
@group(0) @binding(3) var<storage, read> freedoms: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> e: array<f32>;
@group(0) @binding(5) var<storage, read_write> x: array<f32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) thread: vec3<u32>) {
    let row = thread.x;
    if (row >= fine.rows) {
        return;
    }
    var sum = vec3<f32>();
    var count = 0.0;
    for (var k = 0u; k < 8u; k++) {
        let j = parents[k * fine.stride + row];
        if (j != NONE) {
            sum += vec3<f32>(e[j], e[coarse.stride + j], e[2u * coarse.stride + j]);
            count += 1.0;
        }
    }
    sum /= count;
    if (fine.sliding == 1u) {
        sum = projected(freedoms[row], sum);
    }
    for (var a = 0u; a < 3u; a++) {
        x[a * fine.stride + row] += sum[a];
    }
}
