// Where the values of a node lie in `grid_*`.
//
// uses explicit/layout, shared/kernel_*

/// Of a block's slot, and a node's place in the block: its mass; other channels follow at multiples
/// of CHANNEL.
fn place_in(slot: u32, grid: u32, node: vec3<u32>) -> u32 {
    return (slot * GRIDS + grid) * GRID_STRIDE + node.x + 4u * node.y + 16u * node.z;
}
