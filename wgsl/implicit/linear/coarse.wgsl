// x = A⁻¹ b on the coarsest level, with the inverse that the host has made: a dense symmetric matrix,
// components of nodes in the order of vectors without a stride. A thread a component, neighbouring
// threads neighbouring columns.
//
// uses implicit/linear/level

@group(0) @binding(0) var<uniform> level: Level;
@group(0) @binding(1) var<storage, read> solution: array<f32>;
@group(0) @binding(2) var<storage, read> b: array<f32>;
@group(0) @binding(3) var<storage, read_write> x_in: array<f32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) thread: vec3<u32>) {
    let rows = level.rows;
    let size = 3u * rows;
    if (thread.x >= size) {
        return;
    }
    var sum = 0.0;
    for (var a = 0u; a < 3u; a++) {
        for (var j = 0u; j < rows; j++) {
            sum += solution[(a * rows + j) * size + thread.x] * b[a * level.stride + j];
        }
    }
    x_in[thread.x / rows * level.stride + thread.x % rows] = sum;
}
