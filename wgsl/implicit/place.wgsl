// Lists the particles by cell. One lane a particle; each place of the list is written by one.
//
// uses implicit/layout

@compute @workgroup_size(LANES)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item(group, groups, lane);
    if (i >= params.particles || keys[i].x == NO_NODE) {
        return;
    }
    list[starts[keys[i].x] + keys[i].y] = i;
}
