// Start of a frame, or of a part of one: which side of plates every particle is on, as the layer of its
// block. One thread a particle.
//
// uses explicit/beyond, explicit/move

/// How much larger than others the component of a normal is that gives the axis of a side.
const CLEARLY: f32 = 1.001;

fn side_of(x: vec3<f32>) -> u32 {
    let nearest = nearest_plate(x);
    let distance = nearest.distance / params.dx;
    if (distance > SIDE_REACH) {
        return 0u;
    }
    let pose = plate_pose(nearest.c);
    // Differences across a thin plate are short, but have the right direction.
    let n = surface_normal(colliders[nearest.c], pose, to_local(pose, x), NORMAL_STEP * params.dx);
    let s = abs(n);
    let second = s.y > CLEARLY * s.x;
    let third = s.z > CLEARLY * select(s.x, s.y, second);
    let a = select(select(0u, 1u, second), 2u, third);
    let along = select(select(n.x, n.y, a == 1u), n.z, a == 2u);
    let layer = 1u + 2u * a + select(0u, 1u, along < 0.0);
    let away = side_direction(layer);
    let before = x + (3.0 * TOUCHING * params.dx) * away;
    let side = way_through(x, -away, SIDE_REACH + SIDE_WAY) >= 0.0 && way_through(before, away, SIDE_FREE) < 0.0;
    return select(0u, layer, side);
}

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) count: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let id = group_index(group, count) * WORKGROUP + lane;
    if (id >= params.live) {
        return;
    }
    let at = frame_position[id];
    let block = at.w - layer(at.w);
    let y = bitcast<vec3<f32>>(at.xyz);
    let x = block_corner(block_coordinates(block)) + y + SHIFT;
    let wrapped = select(x, x - params.cells * floor(x / params.cells), params.periodic == vec3<u32>(1u));
    frame_position[id].w = block + side_of(wrapped * params.dx) * layer_size();
}
