// Grid update: v_i = p_i / m_i + dt g, then walls and colliders (CK-MPM §3.3; forces are already in
// p_i).
// In: fixed-point mass and momentum. Out: velocities as f32 bits in the momentum's place; mass
// unchanged; what surfaces took.
// One workgroup an active block; each node is read and written by one lane.
//
// uses explicit/collide, shared/kernel_*

/// Contact with the two walls of axis `a`; a wall's nodes are those whose index is on or beyond its
/// plane: of the compact kernel's pairs i ± ¼ both or neither (src/core/sim/contact.rs says why).
fn walls_of_axis(v: vec3<f32>, a: u32, x: f32, cells: f32, mass: f32, slot: u32) -> vec3<f32> {
    let upper = x >= cells;
    if (x > 0.0 && !upper) {
        return v;
    }
    let wall = 2u * a + select(0u, 1u, upper && x > 0.0);
    let n = vec3<f32>(vec3<u32>(0u, 1u, 2u) == vec3<u32>(a)) * select(1.0, -1.0, upper && x > 0.0);
    let after = contact(v, n, u32(params.walls[wall].x), params.walls[wall].y);
    take(slot, wall, mass * (v - after), vec3<f32>(0.0));
    return after;
}

fn wall_velocity(v_in: vec3<f32>, x: vec3<f32>, mass: f32, slot: u32) -> vec3<f32> {
    var v = v_in;
    for (var a = 0u; a < 3u; a++) {
        if (params.periodic[a] == 0u) {
            v = walls_of_axis(v, a, x[a], params.cells[a], mass, slot);
        }
    }
    return v;
}

fn update(slot: u32, lane: u32) {
    let corner = 4 * block_coordinates(blocks_in[slot + 1u]) - params.pad;
    let n = corner + vec3<i32>(vec3<u32>(lane & 3u, (lane >> 2u) & 3u, lane >> 4u));
    for (var grid = 0u; grid < GRIDS; grid++) {
        let at = (slot * GRIDS + grid) * 256u + lane;
        let mass = grid_in[at];
        let p = vec3<i32>(grid_in[at + 64u], grid_in[at + 128u], grid_in[at + 192u]);
        var v = vec3<f32>(0.0);
        if (mass > 0) {
            let momentum = max(max(abs(p.x), abs(p.y)), abs(p.z));
            if (max(momentum, mass) > HARD_LIMIT) {
                fail(ERROR_RANGE, 0xfffffffeu);
            }
            if (momentum > SOFT_LIMIT) {
                atomicOr(&report.halt, HALT_MOMENTUM);
            }
            if (mass > SOFT_LIMIT) {
                atomicOr(&report.halt, HALT_MASS);
            }
            let per_velocity = f32(mass) * (params.momentum_scale / params.mass_scale);
            v = (vec3<f32>(p) / f32(mass)) * (params.mass_scale / params.momentum_scale) + params.gravity * params.dt;
            let x = vec3<f32>(n) + vec3<f32>(node_offset(grid));
            v = wall_velocity(v, vec3<f32>(n), per_velocity, slot);
            if (params.colliders > 0u) {
                v = collide(v, x * params.dx, per_velocity, slot);
            }
        }
        grid_in[at + 64u] = bitcast<i32>(v.x);
        grid_in[at + 128u] = bitcast<i32>(v.y);
        grid_in[at + 192u] = bitcast<i32>(v.z);
    }
}

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) count: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let slot = group_index(id, count);
    open_reactions(lane);
    workgroupBarrier();
    if (slot < report.groups[GROUPS_BLOCKS_IN]) {
        update(slot, lane);
    }
    workgroupBarrier();
    flush_reactions(slot, lane);
}
