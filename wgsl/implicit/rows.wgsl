// Gathers the nodes of the system into rows. In: the sums of `row_of` = 1 (in the system) or 0
// before each dense node.
// One lane a dense node; each row is written by one.
//
// uses implicit/nodes

@compute @workgroup_size(LANES)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let g = item(group, groups, lane);
    let nodes = min(report.blocks, params.capacity) * GRIDS * 64u;
    if (g >= nodes) {
        return;
    }
    let kind = freedom[g];
    let row = prefix[g];
    let solved = kind.w < PRESCRIBED;
    if (g == nodes - 1u) {
        report.rows = row + select(0u, 1u, solved);
    }
    row_of[g] = NO_NODE;
    if (!solved || row >= params.stride) {
        return;
    }
    row_of[g] = row;
    let block = g / (64u * GRIDS);
    let index = node_of(block_list[block], g % 64u) - params.pad;
    ids[row] = vec4<i32>(index, i32((g / 64u) % GRIDS));
    freedoms[row] = kind;
    masses[row] = node[g].w;
    speeds[row] = length(node[g].xyz);
    scales[row] = 24.0 * params.dx * params.dx * params.dt * node_scale[g];
    let first = begin[g].xyz - node[g].xyz;
    for (var a = 0u; a < 3u; a++) {
        dv[a * params.stride + row] = first[a];
    }
}
