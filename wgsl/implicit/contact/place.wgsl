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

/// Where a particle is at the step's start, in the domain's own period, and what rounding has left of
/// it, which is not small beside a gap (m).
struct Start { x: vec3<f32>, rest: vec3<f32> }

fn start_of(p: u32) -> Start {
    let corner = vec3<f32>(4 * block_coordinates(position[p].w) - params.pad);
    let y = offset_of(p) + SHIFT;
    let periods = floor((corner + y) / params.cells);
    let first = corner - vec3<f32>(params.periodic) * params.cells * periods;
    let cells = first + y;
    let x = cells * params.dx;
    let rest = (rounded_off(offset_of(p), vec3<f32>(SHIFT)) + rounded_off(first, y)) * params.dx;
    return Start(x, rest + product_rest(cells, params.dx, x));
}

/// a + b less its f32 (Knuth).
fn rounded_off(a: vec3<f32>, b: vec3<f32>) -> vec3<f32> {
    let sum = a + b;
    let v = sum - a;
    return (a - (sum - v)) + (b - v);
}

/// a b less its f32 (Dekker); products of halves of the digits are exact.
fn product_rest(a: vec3<f32>, b: f32, product: vec3<f32>) -> vec3<f32> {
    let high = bitcast<vec3<f32>>(bitcast<vec3<u32>>(a) & vec3<u32>(0xfffff000u));
    let b_high = bitcast<f32>(bitcast<u32>(b) & 0xfffff000u);
    let low = a - high;
    let b_low = b - b_high;
    return ((high * b_high - product) + high * b_low + low * b_high) + low * b_low;
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

/// At a face, at the end of a way (m) from where it began. One that has gone through is at the plane of the face
/// where it went in: it stays on the side where it began, however thin the plate.
fn place_at(c: u32, begun: Start, way: vec3<f32>, memory: Memory, body: Body) -> Place {
    let collider = colliders[c];
    let start = to_local(pose_at(c, 0u), begun.x);
    let by = relative(c, begun.x, way);
    let seen = local_way(c, by);
    let share = min(meets(collider, start, start + seen, STANDOFF * body.spacing), 1.0);
    let at = start + share * seen;
    let distance = distance_to(collider, at);
    let normal = normal_at(c, at, distance);
    var held = vec3<f32>(0.0);
    if (memory.holds == c + 1u) {
        held = turned_along(pose_at(c, 0u), pose_at(c, 1u), memory.stretch);
    }
    let after = pose_at(c, 1u);
    let lost = share * seen - (at - start);
    let rest = begun.rest + lost.x * after.r0.xyz + lost.y * after.r1.xyz + lost.z * after.r2.xyz;
    let gap = (distance - memory.radius) + dot((1.0 - share) * by + rest, normal);
    return Place(gap, normal, held + by);
}
