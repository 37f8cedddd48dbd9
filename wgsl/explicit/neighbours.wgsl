// The blocks that a block's particles read.
//
// uses explicit/node

var<workgroup> slots_in: array<u32, 8>; // slot + 1 of the upper neighbours on the `_in` side

/// Looks up the neighbours on the `_in` side. A barrier must follow.
fn open_gather(block: u32, lane: u32) {
    for (var i = lane; i < 8u; i += WORKGROUP) {
        let b = block_beside(block, vec3<i32>(vec3<u32>(i & 1u, (i >> 1u) & 1u, i >> 2u)));
        var slot = 0u;
        if (b >= 0) {
            slot = table_in[b];
        }
        slots_in[i] = slot;
    }
}
