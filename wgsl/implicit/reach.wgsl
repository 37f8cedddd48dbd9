// Largest dt ‖∇p‖ (Frobenius) of particles of plastic laws, for a direction p of Δv in `trial`. Out:
// `report.most_strain`.
// One workgroup a block, one lane a particle at a time.
//
// uses implicit/trial, implicit/cells, shared/state

@compute @workgroup_size(LANES)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let slot = group_index(group, groups);
    let there = slot < report.blocks;
    if (there) {
        load_trial(slot, lane);
    }
    workgroupBarrier();
    if (!there) {
        return;
    }
    var most = 0.0;
    for (var p = starts[slot * IN_BLOCK] + lane; p < starts[(slot + 1u) * IN_BLOCK]; p += LANES) {
        if (is_plastic(materials[bodies[tag[p].y].material].model)) {
            most = max(most, norm2(tile_gradient(bitcast<vec3<f32>>(position[p].xyz))));
        }
    }
    atomicMax(&report.most_strain, bitcast<u32>(params.dt / params.dx * sqrt(most)));
}
