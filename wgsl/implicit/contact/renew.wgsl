// Sets the limits of friction to what presses at Δv (Faces::renew in
// src/engine/implicit/physics/contact.rs), and says what has changed.
// One lane a particle and face.
//
// uses implicit/contact/place, implicit/contact/way, implicit/contact/holding

@compute @workgroup_size(LANES)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let l = item(group, groups, lane);
    if (l >= params.links) {
        return;
    }
    let before = links[l];
    var link = before;
    let body = bodies[link.body];
    let memory = memory_of(link.particle);
    let hold = hold_of(link.collider, memory.holds);
    if (hold == PUSH || hold == ARREST) {
        let start = start_of(link.particle);
        let place = place_at(link.collider, start, trial_way(link.particle), memory, body);
        link.limit = friction_limit(place, hold, link.collider, body.stiffness);
        link.grip = grip_of(place, body.stiffness, link.limit);
        links[l] = link;
    }
    count_holding(link, hold);
    if (link.limit != before.limit) {
        atomicStore(&holding[HOLDING_LIMITS], 1u);
    }
    if (link.grip != before.grip) {
        atomicStore(&holding[HOLDING_GRIPS], 1u);
    }
}
