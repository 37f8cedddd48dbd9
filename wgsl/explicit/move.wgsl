// Where particles are and go.
//
// uses explicit/layout, shared/blocks, shared/kernel_*

/// Cells from the domain's corner to a block's.
fn block_corner(block: u32) -> vec3<f32> {
    return vec3<f32>(4 * block_coordinates(block) - params.pad);
}

/// Where a particle at `y` in the block at `corner` is after it moved by `way` (cells). The plane of a sticky
/// wall stops those that come from inside.
fn moved(corner: vec3<f32>, y: vec3<f32>, way: vec3<f32>) -> vec3<f32> {
    var out = y + way;
    for (var a = 0u; a < 3u; a++) {
        if (params.periodic[a] == 0u) {
            let low = -corner[a] - SHIFT;
            let high = params.cells[a] - corner[a] - SHIFT;
            if (u32(params.walls[2u * a].x) == STICKY && y[a] >= low) {
                out[a] = max(out[a], low);
            }
            if (u32(params.walls[2u * a + 1u].x) == STICKY && y[a] <= high) {
                out[a] = min(out[a], high);
            }
        }
    }
    return out;
}
