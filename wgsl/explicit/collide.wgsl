// Contact of the grid's nodes with colliders (CK-MPM §3.3), one after the other. Positions relative
// to domain.min (m).
//
// uses explicit/reactions, shared/distance, shared/kernel_*

override COLLIDERS: bool = true;

/// What is left of a node's velocity, and of its room, as if surfaces were planes.
struct Met { v: vec3<f32>, room: f32 }

/// `mass`: fixed-point momentum per velocity; `slot`: of the block, whose workgroup books what
/// colliders take; `beyond`: whether the node lies beyond a plate, so that its room is what is before that.
fn collide(v_in: vec3<f32>, x: vec3<f32>, mass: f32, slot: u32, beyond: bool) -> Met {
    var v = v_in;
    var room = 1.0;
    var nearest = 1e30;
    for (var c = 0u; c < params.colliders; c++) {
        let collider = colliders[c];
        let pose = poses[(report.step - params.first_step) * params.colliders + c];
        if (pose.linear.w == 0.0) {
            continue;
        }
        let local = to_local(pose, x);
        let distance = distance_to(collider, local);
        if (pose.center.w != 0.0) {
            // Of the nearest collider at the end.
            let away = abs(distance);
            let other = select(distance, nearest, away < abs(nearest));
            room *= inside(vec3<f32>(other / params.dx)).x;
            nearest = select(nearest, distance, away < abs(nearest));
        }
        if (distance > 0.0 || mass <= 0.0 || collider.touches != 0u) {
            continue;
        }
        let n = surface_normal(collider, pose, local, NORMAL_STEP * params.dx);
        let surface = surface_velocity(pose, x);
        let after = surface + contact(v - surface, n, collider.kind, collider.friction);
        take(slot, WALLS + c, mass * (v - after), (x - pose.center.xyz) / params.dx);
        v = after;
    }
    room *= inside(vec3<f32>(select(nearest, -abs(nearest), beyond) / params.dx)).x;
    return Met(v, room);
}
