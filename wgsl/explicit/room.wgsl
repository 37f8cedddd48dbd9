// How much of a node's room is inside walls.
//
// uses explicit/layout, shared/kernel_*

/// Shares inside walls of the room of a node, by axis; `x`: its place (cells from the domain's
/// corner).
fn inside_walls(x: vec3<f32>) -> vec3<f32> {
    let share = max(inside(x) + inside(params.cells - x) - 1.0, vec3<f32>(0.0));
    return select(share, vec3<f32>(1.0), params.periodic == vec3<u32>(1u));
}
