// Where particles are and go.
//
// uses explicit/layout, shared/blocks, shared/kernel_*

/// Cells from the domain's corner to that of the block at some coordinates.
fn block_corner(at: vec3<i32>) -> vec3<f32> {
    return vec3<f32>(4 * at - params.pad);
}

/// Where a particle at `y` in the block at `corner` is after it moved by `way` (cells). The plane of a sticky
/// wall stops those that come from inside.
fn moved(corner: vec3<f32>, y: vec3<f32>, way: vec3<f32>) -> vec3<f32> {
    let out = y + way;
    let low = params.lowest - corner;
    let high = params.highest - corner;
    let above = select(out, max(out, low), y >= low);
    return select(above, min(above, high), y <= high);
}
