// Lets particles meet the faces that are there without having come, and counts the faces that are near
// each at the step's start (Contacts::new in src/engine/implicit/physics/contact.rs).
// In: sorted particles. Out: what they remember, and `faces`. One lane a particle.
//
// uses implicit/contact/start

/// Meets a face that is there without having come.
fn met(before: Memory, body: Body, c: u32, distance: f32) -> Memory {
    var memory = before;
    if (distance > BONDED * body.spacing) {
        return memory;
    }
    if (colliders[c].kind <= SLIP && memory.holds == 0u) {
        memory = Memory(distance, vec3<f32>(0.0), c + 1u);
    } else {
        memory.radius = min(memory.radius, distance);
    }
    return memory;
}

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
    let at = params.touch * params.room + p;
    let body = bodies[tag[p].y];
    let start = start_of(p);
    let is_new = state[at] == UNMET;
    var memory = memory_of(p);
    if (is_new) {
        memory = untouched(body);
    }
    for (var c = 0u; c < params.colliders; c++) {
        let there = pose_at(c, 0u).linear.w;
        if (colliders[c].touches != 0u && (there == APPEARS || (is_new && there != 0.0))) {
            memory = met(memory, body, c, first_face(c, start).distance);
        }
    }
    state[at] = f32(memory.holds);
    state[at + params.room] = memory.radius;
    state[at + 2u * params.room] = memory.stretch.x;
    state[at + 3u * params.room] = memory.stretch.y;
    state[at + 4u * params.room] = memory.stretch.z;
    var count = 0u;
    for (var c = 0u; c < params.colliders; c++) {
        count += select(0u, 1u, is_near(c, start.x, memory.holds));
    }
    faces[p] = count;
}
