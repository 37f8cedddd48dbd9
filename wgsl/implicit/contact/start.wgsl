// Faces near a particle at the step's start.
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

/// A face where a particle begins: its distance (m) and normal.
struct FirstFace { distance: f32, normal: vec3<f32> }

fn first_face(c: u32, start: Start) -> FirstFace {
    let pose = pose_at(c, 0u);
    let local = to_local(pose, start.x);
    let normal = surface_normal(colliders[c], pose, local, NORMAL_STEP * params.dx);
    return FirstFace(distance_to(colliders[c], local) + dot(start.rest, normal), normal);
}
