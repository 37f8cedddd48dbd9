// Workgroup memory of the transfers: node velocities (and what fills the nodes, if somebody asks)
// that a block's particles read, and fixed-point sums that they scatter.
//
// Sums are integers: their order does not matter, so that runs repeat bit for bit.
//
// uses explicit/neighbours, explicit/share, explicit/tile_*

var<workgroup> read_tile: array<vec4<i32>, READ_NODES>; // bits of the velocity; what `grid_update` packs
var<workgroup> sum_tile: array<atomic<i32>, 4u * SUM_NODES>;
/// Room for sums of volumes, if anybody asks.
override VOLUME_NODES: u32 = select(1u, SUM_NODES, FILLS == FILLS_VOLUME);
var<workgroup> volume_tile: array<atomic<i32>, VOLUME_NODES>;
var<workgroup> slots_out: array<u32, 27>;  // slot + 1 of each neighbour on the `_out` side
var<workgroup> bin_counts: array<atomic<u32>, 27>;
var<workgroup> bin_bases: array<u32, 27>;

/// Looks up the neighbours on the `_out` side and zeroes the sums. A barrier must follow.
fn open_scatter(job: Work, lane: u32) {
    if (lane < 27u) {
        let b = beside(job, neighbour(lane));
        var slot = 0u;
        if (b >= 0) {
            slot = slot_out(u32(b));
        }
        slots_out[lane] = slot;
        atomicStore(&bin_counts[lane], 0u);
    }
    for (var i = lane; i < 4u * SUM_NODES; i += WORKGROUP) {
        atomicStore(&sum_tile[i], 0);
    }
    if (FILLS == FILLS_VOLUME) {
        for (var i = lane; i < SUM_NODES; i += WORKGROUP) {
            atomicStore(&volume_tile[i], 0);
        }
    }
}

/// Loads what `grid_update` left; nodes of inactive blocks are at rest. A barrier must come before and
/// after.
fn load_nodes(lane: u32) {
    for (var i = lane; i < 216u; i += WORKGROUP) {
        let n = vec3<u32>(i % 6u, (i / 6u) % 6u, i / 36u);
        let high = n >> vec3<u32>(2u);
        let slot = slots_in[high.x + 2u * high.y + 4u * high.z];
        for (var grid = 0u; grid < GRIDS; grid++) {
            var node = vec4<i32>(0);
            if (slot != 0u) {
                let at = place_in(slot - 1u, grid, n & vec3<u32>(3u));
                node = vec4<i32>(grid_in[at + CHANNEL], grid_in[at + 2u * CHANNEL], grid_in[at + 3u * CHANNEL], 0);
                if (FILLS != FILLS_NOTHING) {
                    node.w = grid_in[at + FILLED];
                }
            }
            let place = read_place(grid, n);
            if (place != NOWHERE) {
                read_tile[place] = node;
            }
        }
    }
}

/// Mass of a node of the read tile (kg), from the grid.
fn node_mass(grid: u32, n: vec3<i32>) -> f32 {
    let high = vec3<u32>(n) >> vec3<u32>(2u);
    let low = vec3<u32>(n) & vec3<u32>(3u);
    let slot = slots_in[high.x + 2u * high.y + 4u * high.z];
    if (slot == 0u) {
        return 0.0;
    }
    return f32(grid_in[place_in(slot - 1u, grid, low)]) / params.mass_scale;
}

/// Adds the tile to the grid. A barrier must come before.
fn flush_tile(lane: u32) {
    for (var i = lane; i < 512u; i += WORKGROUP) {
        let n = vec3<u32>(i & 7u, (i >> 3u) & 7u, i >> 6u);
        // Node -1 is 3 of the lower neighbour.
        let from_lower = n + vec3<u32>(3u);
        let high = from_lower >> vec3<u32>(2u);
        let slot = slots_out[high.x + 3u * high.y + 9u * high.z];
        for (var grid = 0u; grid < GRIDS; grid++) {
            let place = sum_place(grid, n);
            if (slot != 0u && place != NOWHERE) {
                flush_node(place, place_in(slot - 1u, grid, from_lower & vec3<u32>(3u)));
            }
        }
    }
}

fn flush_node(place: u32, at: u32) {
    let mass = atomicLoad(&sum_tile[place]);
    let x = atomicLoad(&sum_tile[place + SUM_NODES]);
    let y = atomicLoad(&sum_tile[place + 2u * SUM_NODES]);
    let z = atomicLoad(&sum_tile[place + 3u * SUM_NODES]);
    if ((mass | x | y | z) != 0) {
        atomicAdd(&grid_out[at], mass);
        atomicAdd(&grid_out[at + CHANNEL], x);
        atomicAdd(&grid_out[at + 2u * CHANNEL], y);
        atomicAdd(&grid_out[at + 3u * CHANNEL], z);
    }
    if (FILLS == FILLS_VOLUME) {
        let volume = atomicLoad(&volume_tile[place]);
        if (volume != 0) {
            atomicAdd(&grid_out[at + FILLED], volume);
        }
    }
}
