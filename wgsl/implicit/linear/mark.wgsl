// Marks a level's nodes that marked nodes of the level below have as parents.
// In: the lower level's table of marks. Out: table, 1 where hit. A thread an entry below; all who
// write an entry write the same.
//
// uses implicit/linear/level, implicit/linear/parents

@group(0) @binding(0) var<uniform> fine: Level;
@group(0) @binding(1) var<uniform> coarse: Level;
@group(0) @binding(2) var<storage, read> fine_table: array<u32>;
@group(0) @binding(3) var<storage, read_write> table: array<atomic<u32>>;

@compute @workgroup_size(256)
fn main(@builtin(global_invocation_id) thread: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let entry = thread.y * groups.x * 256u + thread.x;
    if (entry >= entries(fine) || fine_table[entry] == 0u) {
        return;
    }
    for (var k = 0u; k < 8u; k++) {
        let p = parent(coarse, id_of(fine, entry), k);
        if (p.exists) {
            atomicStore(&table[entry_of(coarse, p.id)], 1u);
        }
    }
}
