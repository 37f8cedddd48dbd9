// Lists particles and the faces near them, by particle and then by collider, and sets the first limits
// of friction (Faces::new in src/engine/implicit/physics/contact.rs): what held before the step holds,
// and what slid is rubbed as it was then.
// In: the sums of `faces` before each particle. One lane a particle.
//
// uses implicit/contact/start, implicit/contact/holding

/// Part of friction's limit up to which it holds: what has slid is at the limit, but for rounding.
const STILL_HOLDS = 0.999;
/// A limit that is none (N).
const UNLIMITED = 1e30;

@compute @workgroup_size(LANES)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let p = item(group, groups, lane);
    if (p >= params.particles) {
        return;
    }
    let end = link_starts[p + 1u];
    if (p == params.particles - 1u) {
        report.links = end;
    }
    if (faces[p] == 0u || end > params.link_room) {
        return;
    }
    var at = link_starts[p];
    let start = start_of(p);
    let memory = memory_of(p);
    for (var c = 0u; c < params.colliders; c++) {
        if (at < end && is_near(c, start.x, memory.holds)) {
            links[at] = first_link(p, c, start, memory);
            at += 1u;
        }
    }
}

fn first_link(p: u32, c: u32, start: Start, memory: Memory) -> Link {
    let body = tag[p].y;
    let k = bodies[body].stiffness;
    let hold = hold_of(c, memory.holds);
    let face = first_face(c, start);
    let stretch = select(vec3<f32>(0.0), memory.stretch, memory.holds == c + 1u);
    let place = Place(face.distance - memory.radius, face.normal, stretch);
    var link = Link(p, c, body, APART, 0.0);
    if (hold == PUSH || hold == ARREST) {
        let limit = friction_limit(place, hold, c, k);
        link.grip = grip_of(place, k, limit);
        let held = limit > 0.0 && grip_of(place, k, STILL_HOLDS * limit) == HOLDS;
        link.limit = select(limit, UNLIMITED, held);
    }
    count_holding(link, hold);
    return link;
}
