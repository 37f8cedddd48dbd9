// Contact of particles with the faces of colliders: none goes through, springs are carried along and
// press. Twin: src/engine/explicit/cpu/touch.rs. Positions relative to domain.min (m).
//
// What it finds out lies where the transfer that follows will overwrite it: the particle's new offset
// in `position_out`, and what faces add to its velocity in `position_out` and `destinations`.
//
// uses explicit/springs, explicit/reactions, explicit/touched, shared/faces, shared/kernel_*

/// Cells from a block's middle within which its particles may touch something: they move less than a
/// cell, and so do faces.
const REACH = 7.2;

/// Whether some collider is near the block.
var<workgroup> close_by: atomic<u32>;

/// A collider's pose at the start of a step, or after it (`later` = 1).
fn pose_at(c: u32, later: u32) -> Pose {
    return poses[(report.step - params.first_step + later) * params.colliders + c];
}

/// How many particles of a job may touch something: all if a collider is near its block, or none. The transfer
/// is told. Has barriers; zeroes the sums of reactions.
fn count_near(item: u32, job: Work, corner: vec3<f32>, lane: u32, may: bool) -> u32 {
    open_reactions(lane);
    if (lane == 0u) {
        atomicStore(&close_by, 0u);
    }
    workgroupBarrier();
    let middle = (corner + 2.0 + SHIFT) * params.dx;
    // Particles of a block on a periodic seam may be on the other side of the domain.
    let folds = any((corner + 4.0 + SHIFT > params.cells) & (params.periodic == vec3<u32>(1u)));
    for (var c = lane; c < params.colliders; c += 64u) {
        let collider = colliders[c];
        let far = REACH * params.dx + collider.slack;
        if (collider.touches != 0u && (folds || distance_to(collider, to_local(pose_at(c, 0u), middle)) <= far)) {
            atomicStore(&close_by, 1u);
        }
    }
    workgroupBarrier();
    let near = select(0u, atomicLoad(&close_by), may);
    if (lane == 0u && job.count > 0u) {
        work[item].touched = near;
    }
    return job.count * near;
}

fn load_touch(id: u32) -> Touch {
    let n = params.particles;
    var touch = Touch(bitcast<f32>(touches[n + id]), vec3<f32>(0.0), touches[id]);
    if (touch.holds != 0u) {
        touch.stretch = bitcast<vec3<f32>>(
            vec3<u32>(touches[2u * n + id], touches[3u * n + id], touches[4u * n + id]));
    }
    return touch;
}

fn store_touch(id: u32, touch: Touch) {
    let n = params.particles;
    touches[id] = touch.holds;
    touches[n + id] = bitcast<u32>(touch.radius);
    for (var a = 0u; a < 3u; a++) {
        touches[(2u + a) * n + id] = bitcast<u32>(touch.stretch[a]);
    }
}

/// The velocity with which what a collider has at `x` got there: the secant of its path.
fn arrival(c: u32, x: vec3<f32>, later: u32) -> vec3<f32> {
    let before = pose_at(c, 0u);
    let turning = cross(before.angular.xyz, x - pose_at(c, later).center.xyz);
    return before.linear.xyz + turning - before.angular.w * cross(before.angular.xyz, turning);
}

/// A collider's face at a particle at `x`, after the step if `later` is 1.
fn face_at(c: u32, x: vec3<f32>, later: u32) -> Face {
    let collider = colliders[c];
    let pose = pose_at(c, later);
    let local = to_local(pose, x);
    let distance = distance_to(collider, local);
    return Face(c + 1u, collider.kind, collider.friction, distance,
        surface_normal(collider, pose, local, normal_step(distance)), arrival(c, x, later));
}

/// What faces do to a particle: where it ends, and what they add to its velocity (m/s).
struct Touched { end: vec3<f32>, kick: vec3<f32> }

/// Stops the particle on its way from `start` over `dt` at faces that it would go through.
fn stopped(slot: u32, body: Body, start: vec3<f32>, end_in: vec3<f32>, v_in: vec3<f32>, dt: f32) -> Touched {
    let least = STANDOFF * body.spacing;
    var end = end_in;
    var v = v_in;
    var halted = false;
    for (var i = 0u; i < 2u * params.colliders; i++) {
        // What slides along a face may slide through a sheet, which has no inside to come back from.
        let again = i >= params.colliders;
        let c = select(i, i - params.colliders, again);
        let collider = colliders[c];
        let skipped = again && !(halted && collider.touches == SHEET);
        if (skipped || collider.touches == 0u || pose_at(c, 1u).linear.w == 0.0) {
            continue;
        }
        let before = pose_at(c, 0u);
        let to = to_local(pose_at(c, 1u), end);
        let share = meets(collider, to_local(before, start), to, select(least, AGAIN * least, again));
        if (share > 1.0) {
            continue;
        }
        let carried = start + dt * surface_velocity(before, start);
        let at = carried + share * (end - carried);
        if (again) {
            end = at;
            continue;
        }
        halted = true;
        let there = face_at(c, at, 1u).normal;
        let along = end - min(dot(end - at, there), 0.0) * there;
        let inside = distance_to(collider, to_local(pose_at(c, 1u), along)) < 0.25 * least;
        end = select(along, at, inside);
        let n = face_at(c, end, 1u).normal;
        let inward = min(dot(v - (carried - start) / dt, n), 0.0) * n;
        v -= inward;
        take_of(slot, c, body.mass * inward, end, 1u);
    }
    return Touched(end, v - v_in);
}

/// Books an impulse (kg m/s) that a collider takes from a particle. Both grids of a pair carry all mass.
fn take_of(slot: u32, c: u32, impulse: vec3<f32>, at: vec3<f32>, later: u32) {
    let units = f32(GRIDS) * params.momentum_scale * impulse;
    take(slot, WALLS + c, units, (at - pose_at(c, later).center.xyz) / params.dx);
}

/// Carries the spring along from `start`, over `dt`, with a particle that moved by `moved` (m).
fn followed(touch_in: Touch, body: Body, start: vec3<f32>, moved: vec3<f32>, dt: f32) -> Touch {
    var touch = touch_in;
    if (touch.holds == 0u) {
        return touch;
    }
    let before = pose_at(touch.holds - 1u, 0u);
    let after = pose_at(touch.holds - 1u, 1u);
    if (after.linear.w == 0.0) {
        return untouched(body);
    }
    touch.stretch = turned_along(before, after, touch.stretch + (moved - dt * surface_velocity(before, start)));
    return touch;
}

/// What springs add to the velocity of a particle at `x` over a time `kick_s`.
fn pressed(slot: u32, touch: ptr<function, Touch>, body: Body, x: vec3<f32>, v: vec3<f32>, kick_s: f32, later: u32)
        -> vec3<f32> {
    var sum = vec3<f32>(0.0);
    var nearest = body.spacing;
    for (var c = 0u; c < params.colliders; c++) {
        let collider = colliders[c];
        let pose = pose_at(c, later);
        if (collider.touches == 0u || pose.linear.w == 0.0) {
            continue;
        }
        let distance = distance_to(collider, to_local(pose, x));
        nearest = min(nearest, distance);
        let held = (*touch).holds == c + 1u;
        if (distance > BONDED * body.spacing && !held) {
            continue;
        }
        let face = face_at(c, x, later);
        if (later == 1u && pose_at(c, 0u).linear.w == 0.0) {
            *touch = met(*touch, body, face);
        }
        if (distance < (*touch).radius || (*touch).holds == c + 1u) {
            let force = press(touch, body, face, v);
            take_of(slot, c, -kick_s * force, x, later);
            sum += force;
        }
    }
    if ((*touch).holds == 0u) {
        // What was cut off of its radius grows again where it leaves.
        (*touch).radius = max((*touch).radius, min(nearest, 0.5 * body.spacing));
    }
    return sum * (kick_s / body.mass);
}

/// A particle's whole contact in a step of `dt` that takes it from y to `next` (cells in the block), and then for
/// `kick_s`.
fn touch_particle(slot: u32, to: u32, id: u32, block: vec3<f32>, y: vec3<f32>, next: vec3<f32>, v: vec3<f32>, dt: f32,
        kick_s: f32) {
    // Seen from where the particle is in the domain's own period.
    let periods = floor((block + y + SHIFT) / params.cells);
    let corner = block - vec3<f32>(params.periodic) * params.cells * periods;
    let body = bodies[body_of[id]];
    var touch = load_touch(id);
    let start = (corner + y + SHIFT) * params.dx;
    let way = (next - y) * params.dx;
    var done = Touched(start + way, vec3<f32>(0.0));
    var at = next;
    if (dt > 0.0) {
        done = stopped(slot, body, start, start + way, v, dt);
        if (any(done.end != start + way)) {
            at = y + (done.end - start) / params.dx;
        }
        touch = followed(touch, body, start, (at - y) * params.dx, dt);
    }
    if (kick_s > 0.0) {
        let later = select(0u, 1u, dt > 0.0);
        done.kick += pressed(slot, &touch, body, (corner + at + SHIFT) * params.dx, v + done.kick, kick_s, later);
    }
    store_touch(id, touch);
    leave(to, at, done.kick);
}
