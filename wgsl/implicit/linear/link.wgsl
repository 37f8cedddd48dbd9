// Ties the nodes of a level to those of the next: parents[k * stride + row] is a parent's row or
// NONE, children[k * coarse stride + coarse row] a child's row plus 1 (0, as the buffer was
// cleared: no child). A thread a fine node. A parent's child k is one node only: no race.
//
// uses implicit/linear/level, implicit/linear/parents

@group(0) @binding(0) var<uniform> fine: Level;
@group(0) @binding(1) var<uniform> coarse: Level;
@group(0) @binding(2) var<storage, read> fine_ids: array<vec4<i32>>;
@group(0) @binding(3) var<storage, read> table: array<u32>;
@group(0) @binding(4) var<storage, read_write> fine_parents: array<u32>;
@group(0) @binding(5) var<storage, read_write> children: array<u32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) thread: vec3<u32>) {
    let row = thread.x;
    if (row >= fine.rows) {
        return;
    }
    for (var k = 0u; k < 8u; k++) {
        let p = parent(coarse, fine_ids[row], k);
        var to = NONE;
        if (p.exists) {
            to = table[entry_of(coarse, p.id)];
            children[p.child * coarse.stride + to] = row + 1u;
        }
        fine_parents[k * fine.stride + row] = to;
    }
}
