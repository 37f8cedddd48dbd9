// Start of a frame, or of a part of one: which side of plates every particle is on, as the layer of its
// block. One thread a particle.
//
// uses explicit/beyond, explicit/move

/// Least half step of a normal's differences (dx).
const LEAST_STEP: f32 = 0.00390625;

fn side_of(x: vec3<f32>) -> u32 {
    let nearest = nearest_plate(x);
    let distance = nearest.distance / params.dx;
    if (distance > SIDE_REACH) {
        return 0u;
    }
    let pose = plate_pose(nearest.c);
    let step = clamp(0.5 * distance, LEAST_STEP, NORMAL_STEP) * params.dx;
    let n = surface_normal(colliders[nearest.c], pose, to_local(pose, x), step);
    let s = abs(n);
    var a = select(0u, 1u, s.y > s.x);
    a = select(a, 2u, s.z > max(s.x, s.y));
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
    frame_position[id].w = block + side_of((block_corner(block) + y + SHIFT) * params.dx) * layer_size();
}
