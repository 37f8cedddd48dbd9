// Gives marked blocks their slots, in the order of the table. In: marks, and their sums before each
// block.
// One lane a block of the table.
//
// uses implicit/nodes

@compute @workgroup_size(LANES)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let b = item(group, groups, lane);
    if (b >= arrayLength(&table)) {
        return;
    }
    let slot = prefix[b];
    let marked = table[b] != 0u;
    if (b == arrayLength(&table) - 1u) {
        report.blocks = slot + select(0u, 1u, marked);
    }
    if (marked && slot < params.capacity) {
        table[b] = slot + 1u;
        block_list[slot] = b;
    } else {
        table[b] = 0u;
    }
}
