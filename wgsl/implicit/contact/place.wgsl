// Where particles are at faces. Twin: Faces::place in src/engine/implicit/physics/contact.rs.
// Positions relative to domain.min (m).
//
// A face is seen from its collider: there a particle's way is that of its motion relative to the
// collider, which is small and has all digits.
//
// uses implicit/contact/springs, implicit/particle, shared/kernel_*

/// A collider's pose at the start of the step, or after it (`later` = 1).
fn pose_at(c: u32, later: u32) -> Pose {
    return poses[later * params.colliders + c];
}

/// Where a particle is at the step's start, in the domain's own period.
fn start_of(p: u32) -> vec3<f32> {
    let cells = vec3<f32>(4 * block_coordinates(position[p].w) - params.pad) + offset_of(p) + SHIFT;
    let periods = floor(cells / params.cells);
    return (cells - vec3<f32>(params.periodic) * params.cells * periods) * params.dx;
}

/// What is left of a way (m) from `x` where the collider carries `x` along.
fn relative(c: u32, x: vec3<f32>, way: vec3<f32>) -> vec3<f32> {
    return way - params.dt * surface_velocity(pose_at(c, 0u), x);
}

/// A way relative to the collider, in its own coordinates.
fn local_way(c: u32, relative_way: vec3<f32>) -> vec3<f32> {
    let after = pose_at(c, 1u);
    return vec3<f32>(dot(after.r0.xyz, relative_way), dot(after.r1.xyz, relative_way), dot(after.r2.xyz, relative_way));
}

/// Outward unit normal, after the step, at a place in the collider's coordinates whose distance is given.
fn normal_at(c: u32, local: vec3<f32>, distance: f32) -> vec3<f32> {
    return surface_normal(colliders[c], pose_at(c, 1u), local, normal_step(distance));
}

/// At a face, at the end of a way (m) from `x`. One that has gone through is at the plane of the face
/// where it went in: it stays on the side where it began, however thin the plate.
fn place_at(c: u32, x: vec3<f32>, way: vec3<f32>, memory: Memory, body: Body) -> Place {
    let collider = colliders[c];
    let start = to_local(pose_at(c, 0u), x);
    let by = relative(c, x, way);
    let seen = local_way(c, by);
    let share = min(meets(collider, start, start + seen, STANDOFF * body.spacing), 1.0);
    let at = start + share * seen;
    let distance = distance_to(collider, at);
    let normal = normal_at(c, at, distance);
    var held = vec3<f32>(0.0);
    if (memory.holds == c + 1u) {
        held = turned_along(pose_at(c, 0u), pose_at(c, 1u), memory.stretch);
    }
    return Place(distance + (1.0 - share) * dot(by, normal) - memory.radius, normal, held + by);
}
