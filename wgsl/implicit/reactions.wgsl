// Adds up what surfaces took. Out: force and moment by block and surface (`reactions`, six values),
// which the host adds up.
// One workgroup a block, one lane a surface, which goes through the block's nodes in order, and then
// through the particles near faces and what these took of them (`press`).
//
// uses implicit/cells, implicit/contact/place, implicit/contact/links

const NODES_A_BLOCK = 64u * GRIDS;

@compute @workgroup_size(LANES)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let slot = group_index(group, groups);
    if (slot >= report.blocks) {
        return;
    }
    let surfaces = 6u + params.colliders;
    for (var surface = lane; surface < surfaces; surface += LANES) {
        var force = vec3<f32>(0.0);
        var moment = vec3<f32>(0.0);
        for (var at = slot * NODES_A_BLOCK; at < (slot + 1u) * NODES_A_BLOCK; at++) {
            let kept = u32(begin[at].w);
            for (var t = 3u * at; t < 3u * at + kept; t++) {
                let touch = touches[t];
                if (bitcast<u32>(touch.velocity.w) == surface) {
                    let taken = -GRID_SHARE * touch.impulse.xyz;
                    force += taken;
                    moment += cross(touch.arm.xyz, taken);
                }
            }
        }
        if (params.links > 0u) {
            let end = link_starts[starts[(slot + 1u) * IN_BLOCK]];
            for (var l = link_starts[starts[slot * IN_BLOCK]]; l < end; l++) {
                let c = links[l].collider;
                if (6u + c == surface) {
                    force += force_of(l);
                    moment += cross(start_of(links[l].particle).x - pose_at(c, 0u).center.xyz, force_of(l));
                }
            }
        }
        for (var a = 0u; a < 3u; a++) {
            reactions[(slot * surfaces + surface) * 6u + a] = force[a];
            reactions[(slot * surfaces + surface) * 6u + 3u + a] = moment[a];
        }
    }
}
