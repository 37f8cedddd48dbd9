// Grid update: v_i = p_i / m_i + dt g (dt: of this step's forces), then walls and colliders (CK-MPM
// §3.3; forces are already in p_i).
// In: fixed-point mass and momentum. Out: velocities as f32 bits in the momentum's place; mass
// unchanged; what fills nodes and their room, packed, in the last channel; what surfaces took.
// One workgroup an active block; each node is read and written by one lane: its own or, near a
// sticky wall, that of the node that owns its group.
//
// uses explicit/node, explicit/share, explicit/walls, explicit/collide

/// Asks for a coarser scale, or fails, if a sum comes near the end of its range.
fn check_range(sum: i32, halt: u32) {
    if (sum > HARD_LIMIT) {
        fail(ERROR_RANGE, 0xfffffffeu);
    }
    if (sum > SOFT_LIMIT) {
        atomicOr(&report.halt, halt);
    }
}

/// Cells that are filled at a node.
fn filled(at: u32) -> f32 {
    var sum = grid_in[at];
    if (params.fills == FILLS_VOLUME) {
        sum = grid_in[at + FILLED];
        sum = select(sum, -1 - sum, sum < 0);
        check_range(sum, HALT_MASS);
    }
    return f32(sum) / params.cell_scale;
}

/// Velocity before contact, and mass as fixed-point momentum per velocity.
fn free(at: u32) -> vec4<f32> {
    let mass = grid_in[at];
    if (mass <= 0) {
        return vec4<f32>(0.0);
    }
    let p = vec3<i32>(grid_in[at + CHANNEL], grid_in[at + 2u * CHANNEL], grid_in[at + 3u * CHANNEL]);
    check_range(max(max(abs(p.x), abs(p.y)), abs(p.z)), HALT_MOMENTUM);
    check_range(mass, HALT_MASS);
    let v = (vec3<f32>(p) / f32(mass)) * (params.mass_scale / params.momentum_scale)
        + params.gravity * kick(report.index);
    return vec4<f32>(v, f32(mass) * (params.momentum_scale / params.mass_scale));
}

fn finish(at: u32, n: vec3<i32>, grid: u32, node: vec4<f32>, slot: u32) {
    var met = Met(node.xyz, 1.0);
    // Nodes without mass have room, too.
    if (params.colliders > 0u && (node.w > 0.0 || params.fills != FILLS_NOTHING)) {
        let x = vec3<f32>(n) + vec3<f32>(node_offset(grid));
        // The sides of plates are told by `join`.
        let beyond = params.sided != 0u && grid_in[at + FILLED] < 0;
        met = collide(node.xyz, x * params.dx, node.w, slot, beyond);
    }
    grid_in[at + CHANNEL] = bitcast<i32>(met.v.x);
    grid_in[at + 2u * CHANNEL] = bitcast<i32>(met.v.y);
    grid_in[at + 3u * CHANNEL] = bitcast<i32>(met.v.z);
    if (params.fills != FILLS_NOTHING) {
        grid_in[at + FILLED] = bitcast<i32>(packed_fill(NodeFill(filled(at), met.room)));
    }
}

/// Contact of a group with the walls of axis `a`.
fn walls_of_axis(group: Group, a: u32, first: u32, slot: u32) {
    let bit = group.bits[a];
    let wall = group.walls[a];
    for (var k = 0u; k <= group.all; k++) {
        if ((k & ~group.all) != 0u) {
            continue;
        }
        let node = images[first + k];
        if (wall == NOWHERE) {
            images[first + k] = vec4<f32>(held(node.xyz, a, image_node(group, k)[a], node.w, slot), node.w);
        } else if (bit == 0u) {
            // On the plane.
            take(slot, wall, node.w * node.xyz, vec3<f32>(0.0));
            images[first + k] = vec4<f32>(0.0, 0.0, 0.0, node.w);
        } else if ((k & bit) == 0u) {
            let image = images[first + k + bit];
            let v = (node.w * node.xyz - image.w * image.xyz) / max(node.w + image.w, 1e-30);
            take(slot, wall, node.w * (node.xyz - v) + image.w * (image.xyz + v), vec3<f32>(0.0));
            images[first + k] = vec4<f32>(v, node.w);
            images[first + k + bit] = vec4<f32>(-v, image.w);
        }
    }
}

fn update(slot: u32, lane: u32) {
    let block = blocks_in[slot + 1u];
    let first_block = layer(block);
    let corner = 4 * block_coordinates(block) - params.pad;
    let n = corner + vec3<i32>(vec3<u32>(lane & 3u, (lane >> 2u) & 3u, lane >> 4u));
    let first = lane * MOST_IMAGES;
    for (var grid = 0u; grid < GRIDS; grid++) {
        let group = group_of(n, grid);
        if (!group.owned) {
            continue;
        }
        for (var k = 0u; k <= group.all; k++) {
            if ((k & ~group.all) == 0u) {
                let at = place_of(first_block, image_node(group, k), image_grid(group, k));
                images[first + k] = vec4<f32>(0.0);
                if (at != NOWHERE) {
                    images[first + k] = free(at);
                }
            }
        }
        for (var a = 0u; a < 3u; a++) {
            walls_of_axis(group, a, first, slot);
        }
        for (var k = 0u; k <= group.all; k++) {
            if ((k & ~group.all) == 0u) {
                let m = image_node(group, k);
                let at = place_of(first_block, m, image_grid(group, k));
                if (at != NOWHERE) {
                    finish(at, m, image_grid(group, k), images[first + k], slot);
                }
            }
        }
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
