// Marks the first coarse level's nodes that fine nodes have as parents.
// In: ids of the fine nodes. Out: table, 1 where hit. A thread a fine node; all who write an entry
// write the same.
//
// uses implicit/linear/level, implicit/linear/parents

@group(0) @binding(0) var<uniform> fine: Level;
@group(0) @binding(1) var<uniform> coarse: Level;
@group(0) @binding(2) var<storage, read> fine_ids: array<vec4<i32>>;
@group(0) @binding(3) var<storage, read_write> table: array<atomic<u32>>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) thread: vec3<u32>) {
    if (thread.x >= fine.rows) {
        return;
    }
    for (var k = 0u; k < 8u; k++) {
        let p = parent(coarse, fine_ids[thread.x], k);
        if (p.exists) {
            atomicStore(&table[entry_of(coarse, p.id)], 1u);
        }
    }
}
