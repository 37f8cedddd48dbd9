// How large the tiles of the quadratic kernel are: a particle's first node is 0..3 of the block. One that has
// moved by less than a cell scatters to nodes from -1 on.

const READ_NODES = 216u; // 6³
const SUM_NODES = 512u;  // 8³

/// Place of a node of the block in the read tile.
fn read_place(grid: u32, n: vec3<u32>) -> u32 {
    return n.x + 6u * n.y + 36u * n.z;
}

/// The same in the tile of sums, counted from node -1.
fn sum_place(grid: u32, n: vec3<u32>) -> u32 {
    return n.x + 8u * n.y + 64u * n.z;
}

/// Place of a particle's first node, from whole numbers. All 27 nodes are inside of the tile, whatever they are.
fn first_read(grid: u32, n: vec3<f32>) -> u32 {
    return min(u32(n.x + 6.0 * n.y + 36.0 * n.z), 129u);
}

fn first_sum(grid: u32, n: vec3<f32>) -> u32 {
    return min(u32(n.x + 8.0 * n.y + 64.0 * n.z + 73.0), 365u);
}
