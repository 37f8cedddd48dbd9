// Blocks of 4³ nodes in the dense table of the domain, and workgroups of folded dispatches.

fn block_coordinates(block: u32) -> vec3<i32> {
    let n = params.blocks;
    return vec3<i32>(vec3<u32>(block % n.x, (block / n.x) % n.y, block / (n.x * n.y)));
}

/// Index in the block table, wrapped on periodic axes; -1 outside.
fn block_index(c: vec3<i32>) -> i32 {
    let n = vec3<i32>(params.blocks);
    let wrapped = select(c, ((c % n) + n) % n, params.periodic == vec3<u32>(1u));
    if (any(wrapped < vec3<i32>(0)) || any(wrapped >= n)) {
        return -1;
    }
    return (wrapped.z * n.y + wrapped.y) * n.x + wrapped.x;
}

/// Linear index of a workgroup in a dispatch that was folded into two dimensions.
fn group_index(id: vec3<u32>, count: vec3<u32>) -> u32 {
    return id.y * count.x + id.x;
}
