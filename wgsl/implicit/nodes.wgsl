// Where nodes are: the dense table of blocks, and places among the dense nodes.
//
// uses implicit/layout, shared/kernel_*

@group(0) @binding(2) var<storage, read_write> table: array<u32>; // block -> slot + 1, 0 = no particle near

/// Slot of a block, wrapped on periodic axes; NO_NODE if no particle is near.
fn slot_of(block: vec3<i32>) -> u32 {
    let b = block_index(block);
    if (b < 0) {
        return NO_NODE;
    }
    return table[b] - 1u; // 0 - 1 = NO_NODE
}

/// A node's place among the dense ones, for coordinates in the table.
fn dense_node(n: vec3<i32>, grid: u32) -> u32 {
    let slot = slot_of(n >> vec3<u32>(2u));
    if (slot == NO_NODE) {
        return NO_NODE;
    }
    let local = vec3<u32>(n & vec3<i32>(3));
    return (slot * GRIDS + grid) * 64u + local.x + 4u * local.y + 16u * local.z;
}

/// Coordinates in the table of a lane's node of a block.
fn node_of(block: u32, lane: u32) -> vec3<i32> {
    return 4 * block_coordinates(block) + vec3<i32>(vec3<u32>(lane & 3u, (lane >> 2u) & 3u, lane >> 4u));
}

