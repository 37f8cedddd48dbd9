// What faces do to the particles at a trial Δv (Faces::responses in
// src/engine/implicit/physics/contact.rs), by particle and face.
// Out: `press`, and energies (both grids of a pair carry them) by workgroup in `partials`.
// One lane a particle and face.
//
// uses implicit/contact/place, implicit/contact/way, implicit/contact/links, implicit/pair

@compute @workgroup_size(LANES)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let chunk = group_index(group, groups);
    let l = chunk * LANES + lane;
    let evaluated = control[0] == 0u;
    var sum = vec2<f32>(0.0);
    if (l < params.links && evaluated) {
        let link = links[l];
        let body = bodies[link.body];
        let memory = memory_of(link.particle);
        let place = place_at(link.collider, start_of(link.particle), trial_way(link.particle), memory, body);
        let found = response(hold_of(link.collider, memory.holds), body.stiffness, place, link.limit);
        store_force(l, found.force);
        for (var r = 0u; r < 3u; r++) {
            for (var c = r; c < 3u; c++) {
                press[symmetric(r, c) * params.link_room + l] = found.stiffness[c][r];
            }
        }
        sum = vec2<f32>(f32(GRIDS) * found.energy, 0.0);
    }
    let total = sum_lanes(sum, lane);
    if (lane == 0u && evaluated && chunk * LANES < params.links) {
        partials[report.blocks * (1u + GRIDS) + chunk] = total;
    }
}
