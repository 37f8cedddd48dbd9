// Where particles go. Out: `position_in`, so that `position` still holds the step's start.
//
// uses implicit/layout, shared/kernel_*

/// Puts a particle at an offset `y` (cells) in the block that it starts from, and says whether that lies in the
/// domain.
fn put(p: u32, id: u32, y: vec3<f32>) -> bool {
    let corner = block_coordinates(position[p].w);
    let x = vec3<f32>(4 * corner - params.pad) + y + SHIFT;
    let outside = (x < vec3<f32>(-1.0)) | (x > params.cells + 1.0);
    let step = vec3<i32>(floor(y * 0.25));
    let block = block_index(corner + step);
    if (block < 0 || any(outside & (params.periodic == vec3<u32>(0u)))) {
        fail(ERROR_DOMAIN, id);
        return false;
    }
    // Just below a block's edge the offset can round up to 4.
    let local = min(y - 4.0 * vec3<f32>(step), vec3<f32>(3.9999998));
    position_in[p] = vec4<u32>(bitcast<vec3<u32>>(local), u32(block));
    return true;
}
