// The slots of a row: x slowest, z fastest.
//
// uses shared/kernel_*

const SLOTS = select(125u, 91u, GRIDS == 2u);

fn offset_in(k: u32, width: u32) -> vec3<i32> {
    return vec3<i32>(vec3<u32>(k / (width * width), (k / width) % width, k % width));
}

/// Where the neighbour of a slot lies relative to a node of `grid`, and its grid.
fn neighbour(grid: u32, slot: u32) -> vec4<i32> {
    if (GRIDS == 1u) {
        return vec4<i32>(offset_in(slot, 5u) - 2, 0);
    }
    if (slot < 27u) {
        return vec4<i32>(offset_in(slot, 3u) - 1, i32(grid));
    }
    // Node n of grid 0 is at n + ¼, of grid 1 at n - ¼.
    return vec4<i32>(offset_in(slot - 27u, 4u) - select(1, 2, grid == 1u), 1 - i32(grid));
}
