// How large the tiles of the compact kernel are, by grid: a particle's first nodes are 0..3 of the block on grid +
// and 0..4 on grid -. One that has moved by less than a cell scatters to nodes from -1 on.

const READ_PLUS = 5u;
const READ_MINUS = 6u;
const READ_NODES = 341u; // 5³ + 6³
const SUM_PLUS = 7u;
const SUM_MINUS = 8u;
const SUM_NODES = 855u;  // 7³ + 8³

/// Place of a node of the block in the read tile; NOWHERE if it is not there.
fn read_place(grid: u32, n: vec3<u32>) -> u32 {
    if (grid == 1u) {
        return 125u + n.x + 6u * n.y + 36u * n.z;
    }
    return select(n.x + 5u * n.y + 25u * n.z, NOWHERE, any(n >= vec3<u32>(READ_PLUS)));
}

/// The same in the tile of sums, counted from node -1.
fn sum_place(grid: u32, n: vec3<u32>) -> u32 {
    if (grid == 1u) {
        return 343u + n.x + 8u * n.y + 64u * n.z;
    }
    return select(n.x + 7u * n.y + 49u * n.z, NOWHERE, any(n >= vec3<u32>(SUM_PLUS)));
}

/// Place of a particle's first node, from whole numbers. All 8 nodes are inside of the tile, whatever they are.
fn first_read(grid: u32, n: vec3<f32>) -> u32 {
    if (grid == 1u) {
        return min(u32(n.x + 6.0 * n.y + 36.0 * n.z), 172u) + 125u;
    }
    return min(u32(n.x + 5.0 * n.y + 25.0 * n.z), 93u);
}

fn first_sum(grid: u32, n: vec3<f32>) -> u32 {
    if (grid == 1u) {
        return min(u32(n.x + 8.0 * n.y + 64.0 * n.z + 73.0), 438u) + 343u;
    }
    return min(u32(n.x + 7.0 * n.y + 49.0 * n.z + 57.0), 285u);
}
