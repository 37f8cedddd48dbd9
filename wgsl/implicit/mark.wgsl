// Marks the blocks whose nodes particles touch: nodes floor(y) … floor(y) + 2 along each axis.
// One lane a particle; a block's mark is set to 1 by however many lanes.
//
// uses implicit/layout

@group(0) @binding(2) var<storage, read_write> table: array<atomic<u32>>;

@compute @workgroup_size(LANES)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item(group, groups, lane);
    if (i >= params.particles) {
        return;
    }
    let at = position_in[i];
    let first = vec3<i32>(floor(bitcast<vec3<f32>>(at.xyz)));
    let corner = block_coordinates(at.w);
    for (var k = 0u; k < 8u; k++) {
        let reach = first + 2 * vec3<i32>(vec3<u32>(k & 1u, (k >> 1u) & 1u, k >> 2u));
        let block = block_index(corner + (reach >> vec3<u32>(2u)));
        if (block < 0) {
            fail(ERROR_DOMAIN, tag_in[i].x);
        } else {
            atomicStore(&table[block], 1u);
        }
    }
}
