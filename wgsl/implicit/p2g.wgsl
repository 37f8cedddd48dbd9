// Nodes' masses, velocities and stiffness scales (CK-MPM eqs. 15–17; HOT eq. 9):
//     m_i = Σ w m,  v_i = Σ w m (v + C d) / m_i,  ξ_i = Σ w m ξ_p / m_i.
// In: sorted particles, C in `push`. One workgroup a block and grid, one lane a node, which gathers
// in the order of the particles.
//
// uses implicit/cells, implicit/particle, implicit/shape

@compute @workgroup_size(LANES)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let k = group_index(group, groups);
    if (k >= report.blocks * GRIDS || k >= params.capacity * GRIDS) {
        return;
    }
    let grid = k % GRIDS;
    let n = node_of(block_list[k / GRIDS], lane);
    var mass = 0.0;
    var scale = 0.0;
    var momentum = vec3<f32>(0.0);
    for (var r = 0u; r < RUNS; r++) {
        let from_ = run(n, grid, r);
        for (var p = from_.first; p < from_.end; p++) {
            let s = shape(offset_of(p), n - from_.corner, grid);
            let body = tag[p].y;
            let m = s.w * bodies[body].mass;
            mass += m;
            scale += m * characteristic[body];
            momentum += m * (velocity_of(p) + push_of(p) * s.d);
        }
    }
    let at = k * 64u + lane;
    let heavy = mass > 0.0;
    node[at] = vec4<f32>(select(vec3<f32>(0.0), momentum / mass, heavy), mass);
    node_scale[at] = select(0.0, scale / mass, heavy);
}
