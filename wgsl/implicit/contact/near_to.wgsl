// Which faces are near a particle at the step's start.
//
// uses implicit/contact/place

/// Distance (dx) from a face, beyond what the face moves, up to which a particle may meet it within a
/// step; it goes no farther than a cell.
const REACH = 2.0;

fn is_near(c: u32, x: vec3<f32>, holds: u32) -> bool {
    let collider = colliders[c];
    let pose = pose_at(c, 0u);
    if (collider.touches == 0u || pose.linear.w == 0.0) {
        return false;
    }
    let reach = REACH * params.dx + params.dt * length(surface_velocity(pose, x)) + collider.slack;
    return holds == c + 1u || distance_to(collider, to_local(pose, x)) <= reach;
}
