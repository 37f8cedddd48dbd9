// The mass of the nodes that are solved for, in units of which all particles have 2^30.
// One workgroup a block and grid, one lane a node; sums of workgroups are integers.
//
// uses implicit/layout, shared/kernel_*

var<workgroup> lane_masses: array<f32, LANES>;

@compute @workgroup_size(LANES)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let k = group_index(group, groups);
    let at = k * LANES + lane;
    let there = k < report.blocks * GRIDS;
    var mass = 0.0;
    if (there) {
        mass = select(0.0, node[at].w, row_of[at] != NO_NODE);
    }
    lane_masses[lane] = mass;
    for (var half = LANES / 2u; half > 0u; half /= 2u) {
        workgroupBarrier();
        if (lane < half) {
            lane_masses[lane] += lane_masses[lane + half];
        }
    }
    if (there && lane == 0u) {
        atomicAdd(&holding[HOLDING_MASS], u32(GRID_SHARE * lane_masses[0] * params.mass_unit + 0.5));
    }
}
