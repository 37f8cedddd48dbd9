// s ← s + α p, r ← r − α Ap. A thread a row.
//
// uses implicit/linear/level, implicit/linear/cg

@group(0) @binding(0) var<uniform> level: Level;
@group(0) @binding(1) var<storage, read> cg: Cg;
@group(0) @binding(2) var<storage, read> p_out: array<f32>;
@group(0) @binding(3) var<storage, read> ap: array<f32>;
@group(0) @binding(4) var<storage, read_write> step: array<f32>;
@group(0) @binding(5) var<storage, read_write> b: array<f32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) thread: vec3<u32>) {
    let n = level.stride;
    if (thread.x >= level.rows) {
        return;
    }
    for (var k = thread.x; k < 3u * n; k += n) {
        step[k] += cg.alpha * p_out[k];
        b[k] -= cg.alpha * ap[k];
    }
}
