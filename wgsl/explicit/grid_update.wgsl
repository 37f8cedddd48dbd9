// Grid update: v_i = p_i / m_i + dt g (dt: of this step's forces), then walls and colliders (CK-MPM
// §3.3; forces are already in p_i).
// In: fixed-point mass and momentum. Out: velocities as f32 bits in the momentum's place; mass
// unchanged; what fills nodes and their room, packed, in the last channel; what surfaces took.
// One workgroup an active block; each node is read and written by one lane: its own or, near a
// sticky wall, that of the node that owns its group.
//
// unchecked: lanes index their own images, surfaces are below SHARED_SURFACES
// uses explicit/node, explicit/share, explicit/room, explicit/walls, explicit/collide

/// Asks for a coarser scale, or fails, if a sum comes near the end of its range.
fn check_range(sum: i32, halt: u32) {
    if (sum > SOFT_LIMIT) {
        if (sum > HARD_LIMIT) {
            fail(ERROR_RANGE, 0xfffffffeu);
        }
        ask(halt);
    }
}

/// Cells that are filled at a node.
fn filled(at: u32) -> f32 {
    var sum = grid_in[at];
    if (FILLS == FILLS_VOLUME) {
        sum = grid_in[at + FILLED];
        sum = select(sum, -1 - sum, sum < 0);
        check_range(sum, HALT_MASS);
    }
    return f32(sum) / params.cell_scale;
}

/// Velocity before contact, and mass as fixed-point momentum per velocity. `gain`: of this step's forces (m/s).
fn free(at: u32, gain: vec3<f32>) -> vec4<f32> {
    let mass = grid_in[at];
    if (mass <= 0) {
        return vec4<f32>(0.0);
    }
    let p = vec3<i32>(grid_in[at + CHANNEL], grid_in[at + 2u * CHANNEL], grid_in[at + 3u * CHANNEL]);
    check_range(max(max(abs(p.x), abs(p.y)), abs(p.z)), HALT_MOMENTUM);
    check_range(mass, HALT_MASS);
    let unit = params.mass_scale / params.momentum_scale;
    let v = vec3<f32>(p) / f32(mass) * unit + gain;
    return vec4<f32>(v, f32(mass) / unit);
}

fn finish(at: u32, n: vec3<i32>, grid: u32, node: vec4<f32>, slot: u32) {
    var met = Met(node.xyz, 1.0);
    // Nodes without mass have room, too.
    if (COLLIDERS && (node.w > 0.0 || FILLS != FILLS_NOTHING)) {
        let x = vec3<f32>(n) + vec3<f32>(node_offset(grid));
        // The sides of plates are told by `join`.
        let beyond = params.sided != 0u && grid_in[at + FILLED] < 0;
        met = collide(node.xyz, x * params.dx, node.w, slot, beyond);
    }
    grid_in[at + CHANNEL] = bitcast<i32>(met.v.x);
    grid_in[at + 2u * CHANNEL] = bitcast<i32>(met.v.y);
    grid_in[at + 3u * CHANNEL] = bitcast<i32>(met.v.z);
    if (FILLS != FILLS_NOTHING) {
        var room = met.room;
        if (WALLS_HELD || WALLS_STICKY) {
            let inside = inside_walls(vec3<f32>(n) + vec3<f32>(node_offset(grid)));
            room *= inside.x * inside.y * inside.z;
        }
        grid_in[at + FILLED] = bitcast<i32>(packed_fill(NodeFill(filled(at), room)));
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

/// By groups, which beyond the reach of sticky walls are of one node. `near`: whether the block is within it.
fn update_groups(slot: u32, n: vec3<i32>, lane: u32, gain: vec3<f32>, near: bool) {
    let first_block = layer(blocks_in[slot]);
    let first = lane * MOST_IMAGES;
    for (var grid = 0u; grid < GRIDS; grid++) {
        var group = single(n, grid);
        if (near) {
            group = group_of(n, grid);
        }
        if (!group.owned) {
            continue;
        }
        for (var k = 0u; k <= group.all; k++) {
            if ((k & ~group.all) == 0u) {
                let at = place_of(first_block, image_node(group, k), image_grid(group, k));
                images[first + k] = vec4<f32>(0.0);
                if (at != NOWHERE) {
                    images[first + k] = free(at, gain);
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

/// One by one.
fn update_alone(slot: u32, n: vec3<i32>, lane: u32, gain: vec3<f32>) {
    for (var grid = 0u; grid < GRIDS; grid++) {
        let at = (slot * GRIDS + grid) * GRID_STRIDE + lane;
        var node = free(at, gain);
        if (WALLS_HELD) {
            for (var a = 0u; a < 3u; a++) {
                node = vec4<f32>(held(node.xyz, a, n[a], node.w, slot), node.w);
            }
        }
        finish(at, n, grid, node, slot);
    }
}

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) count: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let slot = group_index(id, count);
    let reacts = COLLIDERS || WALLS_HELD || WALLS_STICKY;
    if (reacts) {
        open_reactions(lane);
    }
    workgroupBarrier();
    if (running() && slot < report.blocks) {
        if (lane == 0u) {
            // For the particles that will come: nobody needs the last bins any more.
            atomicStore(&bins[slot], 0u);
        }
        let corner = 4 * block_coordinates(blocks_in[slot]) - params.pad;
        let n = corner + vec3<i32>(vec3<u32>(lane & 3u, (lane >> 2u) & 3u, lane >> 4u));
        let gain = params.gravity * kick(report.step);
        if (WALLS_STICKY) {
            update_groups(slot, n, lane, gain, is_near_sticky(corner));
        } else {
            update_alone(slot, n, lane, gain);
        }
    }
    workgroupBarrier();
    if (reacts) {
        flush_reactions(slot, lane);
    }
}
