// Counts the blocks of the finest matrix. A thread a row; sums of integers do not depend on their
// order.
//
// uses implicit/linear/level, implicit/linear/stencil_*

@group(0) @binding(0) var<uniform> level: Level;
@group(0) @binding(1) var<storage, read> columns: array<u32>;
@group(0) @binding(2) var<storage, read_write> total: atomic<u32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) thread: vec3<u32>) {
    if (thread.x >= level.rows) {
        return;
    }
    var count = 0u;
    for (var slot = 0u; slot < SLOTS; slot++) {
        count += select(1u, 0u, columns[slot * level.stride + thread.x] == NONE);
    }
    atomicAdd(&total, count);
}
