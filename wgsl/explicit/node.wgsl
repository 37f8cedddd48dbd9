// Where the values of a node lie in `grid_*`.
//
// uses explicit/table, shared/kernel_*

/// Of a block's slot, and a node's place in the block: its mass; other channels follow at multiples
/// of CHANNEL.
fn place_in(slot: u32, grid: u32, node: vec3<u32>) -> u32 {
    return (slot * GRIDS + grid) * GRID_STRIDE + node.x + 4u * node.y + 16u * node.z;
}

/// Where the sums of a node are, in the layer that begins with block `first`, on the `_in` side; NOWHERE if
/// its block is not active.
fn place_of(first: u32, n: vec3<i32>, grid: u32) -> u32 {
    let c = n + params.pad;
    let block = block_index(c >> vec3<u32>(2u));
    if (block < 0) {
        return NOWHERE;
    }
    let slot = slot_in(first + u32(block));
    if (slot == 0u) {
        return NOWHERE;
    }
    return place_in(slot - 1u, grid, vec3<u32>(c & vec3<i32>(3)));
}
