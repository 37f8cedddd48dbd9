// Rows of each row's neighbours: those nodes that some particle can touch together with it. Slots:
// src/engine/implicit/gpu/interface.rs.
// One lane a row and slot, rows along the lanes.
//
// uses implicit/nodes, implicit/neighbour

@compute @workgroup_size(LANES)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let row = group.x * LANES + lane;
    if (row >= params.rows) {
        return;
    }
    let slot = group.y;
    let id = ids[row];
    let other = neighbour(u32(id.w), slot);
    let at = dense_node(id.xyz + params.pad + other.xyz, u32(other.w));
    var found = NO_NODE;
    if (at != NO_NODE) {
        found = row_of[at];
    }
    columns[slot * params.stride + row] = found;
}
