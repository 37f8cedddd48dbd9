// Writes every particle's index into its block's bin. One thread a particle; ranks are distinct, so
// no two write one place.
//
// uses explicit/layout

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) count: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let particle = group_index(group, count) * WORKGROUP + lane;
    if (particle >= params.live || halted_before_bin()) {
        return;
    }
    let to = destinations[particle];
    list[atomicLoad(&bins[to.x]) + to.y] = particle;
}

/// A hard error inside this step leaves destinations unwritten.
fn halted_before_bin() -> bool {
    return (atomicLoad(&report.halt) & HALT_ERROR) != 0u;
}
