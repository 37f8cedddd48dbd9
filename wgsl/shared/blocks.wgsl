// Numbers of the blocks of 4³ nodes of a domain, and workgroups of folded dispatches. Explicit runs have a layer of
// blocks for each field.

fn block_coordinates(block: u32) -> vec3<i32> {
    let n = params.blocks;
    return vec3<i32>(vec3<u32>(block % n.x, (block / n.x) % n.y, (block / (n.x * n.y)) % n.z));
}

/// Number in the first layer, wrapped on periodic axes; -1 outside.
fn block_index(c: vec3<i32>) -> i32 {
    let n = vec3<i32>(params.blocks);
    let inward = select(select(c, c - n, c >= n), c + n, c < vec3<i32>(0));
    let wrapped = select(c, inward, params.periodic == vec3<u32>(1u));
    if (any(wrapped < vec3<i32>(0)) || any(wrapped >= n)) {
        return -1;
    }
    return (wrapped.z * n.y + wrapped.y) * n.x + wrapped.x;
}

/// Blocks of a layer.
fn layer_size() -> u32 {
    return params.blocks.x * params.blocks.y * params.blocks.z;
}

/// First block of the layer that a block is in.
fn layer(block: u32) -> u32 {
    return block - block % layer_size();
}

/// The block at an offset from another one, in its layer; -1 outside.
fn block_beside(block: u32, offset: vec3<i32>) -> i32 {
    let there = block_index(block_coordinates(block) + offset);
    return select(there + i32(layer(block)), -1, there < 0);
}

/// Linear index of a workgroup in a dispatch that was folded into two dimensions.
fn group_index(id: vec3<u32>, count: vec3<u32>) -> u32 {
    return id.y * count.x + id.x;
}
