// The blocks that a block's particles read.
//
// uses explicit/node

var<workgroup> slots_in: array<u32, 8>; // slot + 1 of the upper neighbours on the `_in` side

/// Looks up the neighbours on the `_in` side. A barrier must follow.
fn open_gather(job: Work, lane: u32) {
    if (lane < 8u) {
        let b = beside(job, vec3<i32>(vec3<u32>(lane & 1u, (lane >> 1u) & 1u, lane >> 2u)));
        var slot = 0u;
        if (b >= 0) {
            slot = slot_in(u32(b));
        }
        slots_in[lane] = slot;
    }
}
