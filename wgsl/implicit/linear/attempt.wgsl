// Where the line search looks: trial = Δv − α z. A thread a row.
//
// uses implicit/linear/level, implicit/linear/state

@group(0) @binding(0) var<uniform> level: Level;
@group(0) @binding(1) var<storage, read> control: array<u32, 4>;
@group(0) @binding(2) var<storage, read> state: State;
@group(0) @binding(3) var<storage, read> dv: array<f32>;
@group(0) @binding(4) var<storage, read> z: array<f32>;
@group(0) @binding(5) var<storage, read_write> trial: array<f32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) thread: vec3<u32>) {
    let n = level.stride;
    if (thread.x >= level.rows || control[0] != 0u) {
        return;
    }
    for (var k = thread.x; k < 3u * n; k += n) {
        trial[k] = dv[k] - state.alpha * z[k];
    }
}
