// Cells that particles are sorted by: all particles of one touch the same nodes. Quadratic: one a
// node. Compact: eight, because the two grids' nodes change at different places, floor(y) and
// floor(y + ½).
//
// uses implicit/nodes

const SUB = GRIDS;             // cells a node along an axis
const ACROSS = 4u * SUB;       // cells a block along an axis
const IN_BLOCK = ACROSS * ACROSS * ACROSS;
/// Cells along an axis whose particles touch a node.
const WINDOW = select(3, 4, GRIDS == 2u);
/// Runs of cells, one behind the other in the sorted order, that a node gathers from: each row of
/// cells may lie in two blocks.
const RUNS = u32(WINDOW * WINDOW) * 2u;

/// Cell of a particle in its block.
fn cell_of(y: vec3<f32>) -> u32 {
    let c = min(vec3<u32>(y * f32(SUB)), vec3<u32>(ACROSS - 1u));
    return c.x + ACROSS * (c.y + ACROSS * c.z);
}

struct Run { first: u32, end: u32, corner: vec3<i32> } // particles; first node of their block, not wrapped

/// Particles of the r-th run of a node with coordinates `n` in the table.
fn run(n: vec3<i32>, grid: u32, r: u32) -> Run {
    // Compact: grid + needs floor(y) in {n - 1, n}, grid - floor(y + ½).
    let low = select(n - 2, 2 * n - 2 - vec3<i32>(i32(grid)), GRIDS == 2u);
    let row = i32(r >> 1u);
    let part = i32(r & 1u);
    let y = low.y + row % WINDOW;
    let z = low.z + row / WINDOW;
    let shift = vec3<u32>(1u + SUB); // log2 ACROSS
    let block = vec3<i32>(low.x, y, z) >> shift;
    let corner_x = (block.x + part) * i32(ACROSS);
    let first = max(low.x - corner_x, 0);
    let last = min(low.x + WINDOW - 1 - corner_x, i32(ACROSS) - 1);
    var out: Run;
    out.corner = 4 * (block + vec3<i32>(part, 0, 0));
    let slot = slot_of(block + vec3<i32>(part, 0, 0));
    if (slot == NO_NODE || first > last) {
        return out;
    }
    let mask = i32(ACROSS) - 1;
    let base = slot * IN_BLOCK + ACROSS * u32((y & mask) + i32(ACROSS) * (z & mask));
    out.first = starts[base + u32(first)];
    out.end = starts[base + u32(last) + 1u];
    return out;
}
