// (I + dt ∇v) F for the velocities that Δv is added to, so that a trial adds dt ∇(Δv) F.
// One workgroup a block, one lane a particle at a time.
//
// uses implicit/cells, implicit/particle, implicit/tile

@compute @workgroup_size(LANES)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let slot = group_index(group, groups);
    let there = slot < report.blocks;
    if (there) {
        for (var t = lane; t < TILE * GRIDS; t += LANES) {
            let at = dense_node(tile_node(block_list[slot], t % TILE), t / TILE);
            var v = vec3<f32>(0.0);
            if (at != NO_NODE) {
                v = moving[at].xyz;
            }
            tile[t] = array<f32, 3>(v.x, v.y, v.z);
        }
    }
    workgroupBarrier();
    if (there) {
        for (var p = starts[slot * IN_BLOCK] + lane; p < starts[(slot + 1u) * IN_BLOCK]; p += LANES) {
            let F = deformation_of(p);
            let next = F + (params.dt / params.dx) * (tile_gradient(offset_of(p)) * F);
            for (var c = 0u; c < 3u; c++) {
                for (var r = 0u; r < 3u; r++) {
                    predicted[(3u * c + r) * params.room + p] = next[c][r];
                }
            }
        }
    }
}
