// Faces of colliders that act on particles, over a step. Twins: src/core/sim/surface.rs, and Placed::meets in
// src/core/sim/collider/.
//
// uses shared/distance

/// Share of a particle's spacing at which it stands from a face that it would have gone through.
const STANDOFF: f32 = 0.01;
/// Share of its spacing up to which a particle that finds a face there is bonded to it.
const BONDED: f32 = 1.01;
/// Least half step of a normal's differences (dx): below it they are noise.
const LEAST_STEP: f32 = 0.00390625;
const MOST_STEPS = 256u;
/// `touches` of a collider that has a sheet.
const SHEET = 2u;
/// Distance (standoffs) at which a particle that was stopped meets a sheet again.
const AGAIN: f32 = 0.2;

/// Half step (m) of the differences that give the normal at a distance. On thin plates they stay on the
/// particle's side.
fn normal_step(distance: f32) -> f32 {
    let near = clamp(0.5 * distance, LEAST_STEP * params.dx, NORMAL_STEP * params.dx);
    return select(NORMAL_STEP * params.dx, near, distance > 0.0);
}

/// A direction that turns with a collider.
fn turned_along(before: Pose, after: Pose, u: vec3<f32>) -> vec3<f32> {
    // What stands still keeps every bit.
    if (all(before.angular.xyz == vec3<f32>(0.0))) {
        return u;
    }
    let local = vec3<f32>(dot(before.r0.xyz, u), dot(before.r1.xyz, u), dot(before.r2.xyz, u));
    return local.x * after.r0.xyz + local.y * after.r1.xyz + local.z * after.r2.xyz;
}

/// Share of the way from `start` to `end`, both in the collider's coordinates, at which a point from
/// outside comes within `least` of the collider; 2 if it does not.
fn meets(collider: Collider, start: vec3<f32>, end: vec3<f32>, least: f32) -> f32 {
    let way = end - start;
    let size = length(way);
    let first = distance_to(collider, start);
    if (size == 0.0 || first < 0.0 || first - size > least + collider.slack) {
        return 2.0;
    }
    let trust = select(1.0, 0.5, collider.slack > 0.0);
    var gone = 0.0;
    var before = first;
    for (var i = 0u; i < MOST_STEPS && gone < size; i++) {
        let step = max(max(trust * before - 0.5 * least, 0.5 * before), 1e-3 * least);
        let next = min(gone + step, size);
        let here = distance_to(collider, start + (next / size) * way);
        if (here < least && here < before) {
            // Where a sheet fills a cell, distances jump.
            return select(next, gone, before < least || here < 0.0) / size;
        }
        gone = next;
        before = here;
    }
    return select(2.0, gone / size, gone < size);
}
