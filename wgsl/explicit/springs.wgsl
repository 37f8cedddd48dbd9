// Springs between a particle and the faces of colliders. Twin: src/core/sim/touch.rs.
//
// uses explicit/layout, shared/faces

/// Depth, as a share of its spacing, at which a face that only pushes damps in full.
const SOFT: f32 = 0.01;

struct Face {
    collider: u32,       // counted from 1
    kind: u32,
    friction: f32,
    distance: f32,       // of the particle (m)
    normal: vec3<f32>,   // towards the particle
    velocity: vec3<f32>, // m/s
}

/// What a particle remembers: radius (m), how far it was carried along the surface that it holds on
/// to (m), and that collider, counted from 1.
struct Touch { radius: f32, stretch: vec3<f32>, holds: u32 }

fn untouched(body: Body) -> Touch {
    return Touch(0.5 * body.spacing, vec3<f32>(0.0), 0u);
}

/// Meets a face that is there without having come.
fn met(before: Touch, body: Body, face: Face) -> Touch {
    var touch = before;
    if (face.kind <= SLIP && face.distance <= BONDED * body.spacing && touch.holds == 0u) {
        touch = Touch(face.distance, vec3<f32>(0.0), face.collider);
    } else {
        touch.radius = min(touch.radius, face.distance);
    }
    return touch;
}

/// Friction of at most `most`: a spring where the particle holds on, elsewhere what slows it.
fn rub(touch: ptr<function, Touch>, body: Body, face: Face, relative: vec3<f32>, most: f32) -> vec3<f32> {
    if ((*touch).holds == 0u) {
        (*touch).holds = face.collider;
        (*touch).stretch = vec3<f32>(0.0);
    }
    let held = (*touch).holds == face.collider;
    let n = face.normal;
    let stretch = select(vec3<f32>(0.0), (*touch).stretch - dot((*touch).stretch, n) * n, held);
    let slip = relative - dot(relative, n) * n;
    var force = -body.stiffness * stretch - body.damping * slip;
    let size = length(force);
    if (size > most) {
        force *= most / size;
    }
    if (held) {
        // Where it slides, the spring is as long as friction stretches it.
        (*touch).stretch = select(stretch, -force / body.stiffness, size > most);
    }
    return force;
}

/// The force (N) of a face on the particle, whose velocity is `v` (m/s).
fn press(touch: ptr<function, Touch>, body: Body, face: Face, v: vec3<f32>) -> vec3<f32> {
    let n = face.normal;
    let relative = v - face.velocity;
    let gap = face.distance - (*touch).radius;
    let away = dot(relative, n);
    let held = (*touch).holds == face.collider;
    let free = (*touch).holds == 0u;
    if (!held && gap >= 0.0) {
        return vec3<f32>(0.0);
    }
    if (face.kind == STICKY && (held || free)) {
        if (!held) {
            (*touch).holds = face.collider;
            (*touch).stretch = gap * n;
        }
        return -body.stiffness * (*touch).stretch - body.damping * relative;
    }
    if (face.kind == SLIP && (held || free)) {
        if (held && gap > 2.0 * body.spacing) {
            *touch = untouched(body);
            return vec3<f32>(0.0);
        }
        (*touch).holds = face.collider;
        return (-body.stiffness * gap - body.damping * away) * n;
    }
    if (gap >= 0.0) {
        (*touch).holds = 0u;
        (*touch).stretch = vec3<f32>(0.0);
        return vec3<f32>(0.0);
    }
    // What only just touches is not braked at once: the force has no jump.
    let share = min(-gap / (SOFT * body.spacing), 1.0);
    let held_off = max(-body.stiffness * gap - share * body.damping * away, 0.0);
    return held_off * n + rub(touch, body, face, relative, face.friction * held_off);
}
