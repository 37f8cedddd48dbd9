// Neighbours of a coarse level's nodes. A thread a row and slot.
//
// uses implicit/linear/level, implicit/linear/stencil_*

@group(0) @binding(0) var<uniform> level: Level;
@group(0) @binding(1) var<storage, read> ids: array<vec4<i32>>;
@group(0) @binding(2) var<storage, read> table: array<u32>;
@group(0) @binding(3) var<storage, read_write> columns: array<u32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) thread: vec3<u32>) {
    let row = thread.x;
    if (row >= level.rows) {
        return;
    }
    let id = ids[row];
    let n = neighbour(thread.y, id.w);
    let at = vec4<i32>(wrapped(level, id.xyz + n.offset), select(id.w, 1 - id.w, n.other));
    let entry = entry_of(level, at);
    columns[thread.y * level.stride + row] = select(table[min(entry, entries(level) - 1u)], NONE, entry == NONE);
}
