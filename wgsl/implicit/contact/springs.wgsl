// How a face holds a particle within a step: energy, force and stiffness of its springs. Twin:
// src/engine/implicit/physics/contact/hold.rs.
//
// uses implicit/contact/memory, shared/faces

// What a face does to a particle: holds it in all directions; pushes it, and will hold it once it is
// there; holds it along the normal; pushes it.
const BOND = 0u;
const ARREST = 1u;
const RAIL = 2u;
const PUSH = 3u;

/// By what the particle holds on to at the step's start.
fn hold_of(c: u32, holds: u32) -> u32 {
    let kind = colliders[c].kind;
    if (kind == STICKY && holds == 0u) {
        return ARREST;
    }
    if (kind <= SLIP && holds == c + 1u) {
        return select(RAIL, BOND, kind == STICKY);
    }
    return PUSH;
}

/// Where a particle is at a face: distance beyond the one at which the face begins to push (m), unit
/// normal towards the particle, how far it has been carried since its spring was at rest (m).
struct Place { gap: f32, normal: vec3<f32>, stretch: vec3<f32> }

/// The part of the stretch along the face.
fn along(place: Place) -> vec3<f32> {
    return place.stretch - dot(place.stretch, place.normal) * place.normal;
}

/// µ times the force (N) that presses: the limit of friction here.
fn friction_limit(place: Place, hold: u32, c: u32, k: f32) -> f32 {
    return select(0.0, colliders[c].friction * k * max(-place.gap, 0.0), hold == PUSH);
}

// How a face that pushes acts on a particle: not; friction holds it; it slides.
const APART = 0u;
const HOLDS = 1u;
const SLIDES = 2u;

fn grip_of(place: Place, k: f32, limit: f32) -> u32 {
    if (place.gap >= 0.0) {
        return APART;
    }
    return select(HOLDS, SLIDES, k * length(along(place)) > limit);
}

/// Energy (J), force on the particle (N), and minus the force's derivative (N/m).
struct Response { energy: f32, force: vec3<f32>, stiffness: mat3x3<f32> }

fn outer(u: vec3<f32>) -> mat3x3<f32> {
    return mat3x3<f32>(u * u.x, u * u.y, u * u.z);
}

/// Of a spring that is longer by `u` than at rest and acts in the directions of a projection.
fn pulled(k: f32, u: vec3<f32>, projection: mat3x3<f32>) -> Response {
    return Response(0.5 * k * dot(u, u), -k * u, k * projection);
}

/// Of friction's spring, carried by `t` along the face.
fn rubbed(k: f32, t: vec3<f32>, across: mat3x3<f32>, limit: f32) -> Response {
    let size = length(t);
    if (k * size <= limit) {
        return pulled(k, t, across);
    }
    let forward = t / size;
    // Sliding on costs nothing, turning aside does.
    return Response(limit * (size - 0.5 * limit / k), -limit * forward, (limit / size) * (across - outer(forward)));
}

fn sum_of(a: Response, b: Response) -> Response {
    return Response(a.energy + b.energy, a.force + b.force, a.stiffness + b.stiffness);
}

/// Of springs of stiffness `k` (N/m), friction giving way at `limit` (N).
fn response(hold: u32, k: f32, place: Place, limit: f32) -> Response {
    let identity = mat3x3<f32>(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
    let n = place.normal;
    let pressed = place.gap < 0.0;
    var out: Response;
    if (hold == BOND) {
        return pulled(k, place.stretch, identity);
    }
    if (hold == ARREST) {
        if (pressed) {
            out = pulled(k, place.gap * n + along(place), identity);
        }
        return out;
    }
    if (hold == RAIL || pressed) {
        out = pulled(k, place.gap * n, outer(n));
    }
    if (hold == PUSH && limit > 0.0) {
        out = sum_of(out, rubbed(k, along(place), identity - outer(n), limit));
    }
    return out;
}
